// SPDX-License-Identifier: MIT
// Viscoelasticity of the deviator by a Prony series (docs/theory.md, "Viscoelasticity"). Over a step the potential is that
// of a law with other moduli, plus H : M(F) / 2 with a constant H of the past and a measure M of the change of shape.
#pragma once

#include <array>
#include <iterator>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "energy/cell_field.hpp"
#include "energy/elastic/growth.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/past_energy.hpp"

namespace itr {

/// M(F), of the elastic part of F: J^(-2/3) C - 1 of laws with an isochoric part, C - 1 of other laws, 2 e of small strains.
enum class ShapeMeasure { isochoric, whole, small };
ShapeMeasure shape_measure(const Material& material);

/// H : M / 2 at a displacement gradient in space, and its derivatives by F (by columns).
double past_density(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<3> past_stress(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<9> past_hessian(ShapeMeasure measure, const Mat<3>& F, const Mat<3>& H);

/// A record of a CellField of viscoelastic bodies: of the instantaneous law the stress S = 2 dW/dM, the density W and S : M
/// / 2, and of each term of the series the stress Q that has relaxed, the energy E that the term stores and Q : M / 2.
struct ViscousRecord {
  static constexpr Eigen::Index kOfLaw = 8, kOfTerm = 8, kDensity = 6, kProduct = 7;

  static Eigen::Index size(const Material& material) {
    return material.prony.empty() ? 0 : kOfLaw + kOfTerm * std::ssize(material.prony);
  }
};

/// The state of bodies that come to positions x at once, or have long been there; null where none is viscoelastic. Cells
/// that are where they are at rest have no stress: an eigenstrain there acts from the first step on.
template <int Dim>
std::shared_ptr<const CellHistory> begin_viscous(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                 ConstVectorView x, double t, bool has_relaxed = false);

/// Weights of a term over a step of y = dt / tau in which stresses of the law change evenly: with its decay e = exp(-y) and
/// the share a = (1 - e) / y of a change of stress that is left at the end.
struct ViscousWeights {
  double g, decay, left;
  double relaxed, carried;  ///< 1 - a and a - e
  double work, stored;      ///< these by y

  ViscousWeights(const PronyTerm& term, double dt);
};

/// The past at a point, for PastEnergy: H : M(F) / 2.
struct ViscousPoint {
  ShapeMeasure measure = ShapeMeasure::isochoric;
  Mat<3> H = Mat<3>::Zero();
  Growth growth{};

  double density(const Mat<3>& G) const;
  Mat<3> stress(const Mat<3>& G) const;
  Mat<9> hessian(const Mat<3>& G) const;
};

/// A step of viscoelastic bodies: stresses of the law change evenly over its length.
template <int Dim>
class ViscousStep {
 public:
  using Records = typename CellField<Dim>::Records;
  using Stress = Eigen::Matrix<double, 6, Dim + 1>;  ///< 00, 11, 22, 01, 02, 12 at the vertices of a cell [Pa]

  /// `materials` are those of the setup at the end of the step, `dt` may be 0 or infinite [s].
  ViscousStep(std::shared_ptr<const CellField<Dim>> start, const std::map<int, Material>& materials, double dt);

  /// Share of the instantaneous moduli of shape that act on changes over the step.
  double factor(int body) const;
  bool acts_on(int body) const { return materials_.contains(body); }
  /// H in an element.
  Stress past(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const;
  /// The past of a body at its rest position X, by the past of its element.
  ViscousPoint point_at(int body, const Vec<Dim>& X, const std::array<double, Dim + 1>& weights, const Stress& past) const;
  /// Energy that the bodies store at x beyond the potential's, without scale [J].
  double stored_excess(const CellSet<Dim>& cells, ConstVectorView x) const;

  /// The state at the end of a step to x at the time t, on a compact mesh; the loss is to second order in strains.
  HistoryEnd end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const;

 private:
  struct Cell;
  Cell update(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, ConstVectorView x) const;

  std::shared_ptr<const CellField<Dim>> start_;
  std::map<int, Material> materials_;  ///< viscoelastic ones
  std::map<int, std::vector<ViscousWeights>> weights_;
};

template <int Dim>
using ViscousEnergy = PastEnergy<Dim, ViscousPoint>;
extern template class PastEnergy<2, ViscousPoint>;
extern template class PastEnergy<3, ViscousPoint>;

/// Cauchy stress in space [Pa] and energy density that the past of a body adds to those of its instantaneous law, at the
/// rest position X, a point with barycentric coordinates `weights` of a cell with these records.
template <int Dim>
std::pair<Mat<3>, double> past_of_state(const typename CellField<Dim>::Records& records,
                                        const std::array<double, Dim + 1>& weights, const Material& material,
                                        const Vec<3>& X, const Mat<3>& F);

}  // namespace itr
