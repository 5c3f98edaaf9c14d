// SPDX-License-Identifier: MIT
// The volumetric energy of patches, sum_i W_i U(theta_i) with theta_i the mean of J = det F by the weights w_i of the
// patches (fem/volume_patches.hpp) and W_i their volume. Its forces are those of pressures sum_i w_i U'(theta_i) in the
// cells.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "energy/elastic/laws.hpp"
#include "energy/energy.hpp"
#include "energy/polyfem/ideal_cell.hpp"
#include "fem/cell_set.hpp"
#include "fem/displacement.hpp"
#include "fem/quadrature.hpp"
#include "fem/shared_patches.hpp"

namespace itr {

/// A law that is kept elsewhere, or a copy of it with the pressure of patches.
class PatchedLaw {
 public:
  explicit PatchedLaw(const ElasticModuli& moduli) : moduli_(moduli) {}
  void set_pressure(double pressure) { copy_.emplace(moduli_).set_pressure(pressure); }
  operator const ElasticModuli&() const { return copy_ ? *copy_ : moduli_; }

 private:
  const ElasticModuli& moduli_;
  std::optional<ElasticModuli> copy_;  ///< empty: no patch takes part
};

/// dU/dJ by patch; without patches none.
template <int Dim>
struct PatchPressures {
  const VolumePatches<Dim>* patches = nullptr;
  std::vector<double> values;

  /// At a point of an element, by its number in the cells [Pa].
  double at(std::size_t element, const std::array<double, Dim + 1>& weights) const {
    double sum = 0;
    if (const auto* shared = SharedPatches<Dim>::of(patches)) {
      for (const auto& share : shared->shares_of(element)) sum += share.at(weights) * values[share.patch];
      return sum;
    }
    for (int part = 0; part < VolumePatches<Dim>::kParts; ++part)
      if (const int patch = patches->patch_of[element][part]; patch != kNone)
        sum += patches->weight(static_cast<int>(element), part, weights) * values[patch];
    return sum;
  }
  /// The law there; `moduli` must outlive it.
  PatchedLaw in(const ElasticModuli& moduli, std::size_t element, const std::array<double, Dim + 1>& weights) const {
    PatchedLaw law(moduli);
    if (patches) law.set_pressure(at(element, weights));
    return law;
  }
  PatchedLaw in_straight(const ElasticModuli& moduli, std::size_t element) const {
    PatchedLaw law(moduli);
    if (patches)
      if (const int patch = patches->patch_of[element][VolumePatches<Dim>::kLeft]; patch != kNone)
        law.set_pressure(values[patch]);
    return law;
  }
};

/// The law of a material in the elements, in space where these are turned: without U(J) if patches of the cells take that.
template <int Dim>
ElasticModuli cell_moduli(const CellSet<Dim>& cells, const Material& material, const Vec<Dim>& X) {
  const bool is_parted = cells.patches && material.volume == VolumeForm::patches;
  if (cells.axisymmetric) {
    const ElasticModuli whole = elastic_moduli<3>(material, Vec<3>(X[0], X[1], 0));
    return is_parted ? without_volume<3>(whole) : whole;
  }
  const ElasticModuli whole = elastic_moduli<Dim>(material, X);
  return is_parted ? without_volume<Dim>(whole) : whole;
}

/// The law at a point of one of them.
template <int Dim>
ElasticModuli cell_moduli(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, const Material& material,
                          const Vec<Dim>& X) {
  ElasticModuli moduli = cell_moduli<Dim>(cells, material, X);
  if (is_of_ideal_cell(material)) set_ideal_cell<Dim>(element.inverse_edges, moduli);
  return moduli;
}

/// Gives `cells` the patches of the bodies whose material asks for some.
template <int Dim>
void add_patches(const std::map<int, Material>& materials, CellSet<Dim>& cells);

template <int Dim>
class PatchedVolume {
 public:
  /// Quadrature of an element with curved edges, by its number among these.
  using RuleOf = std::function<const std::vector<QuadraturePoint<Dim>>&(std::size_t)>;

  /// Takes `cells` that have patches and must outlive this.
  PatchedVolume(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale, RuleOf rule_of);

  /// theta - 1 by patch.
  std::vector<double> changes(const Displacement<Dim>& u) const;
  /// W_i U(theta_i) is summed.
  double value(const std::vector<double>& changes) const;
  PatchPressures<Dim> pressures(const std::vector<double>& changes) const;
  /// Adds U''(theta) / W of each patch times the square of the gradient of W theta: the rest of the Hessian is of pressures
  /// in the cells. Negative U'' are projected.
  void add_hessian(ConstVectorView x, const std::vector<double>& changes, PsdProjection psd, HessianSink& sink) const;
  /// Derivative of W theta by the positions of the patch's nodes.
  VectorX gradient_of(std::size_t patch, ConstVectorView x) const;
  /// U(theta) by patch [J/m^Dim, J/m^3 where cells are turned].
  std::vector<double> densities(const std::vector<double>& changes) const;

 private:
  VolumeResponse response(std::size_t patch, double change) const {
    const ElasticModuli& whole = whole_.at(cells_.patches->body[patch]);
    return cells_.axisymmetric ? volume_energy<3>(whole, change) : volume_energy<Dim>(whole, change);
  }
  const CellSet<Dim>& cells_;
  std::map<int, ElasticModuli> whole_;  ///< by body
  double scale_;
  RuleOf rule_of_;
};

}  // namespace itr
