// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "energy/elastic/laws.hpp"
#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "fem/cell_set.hpp"
#include "fem/quadrature.hpp"

namespace itr {

template <int Dim>
class QuadraticElasticity;
template <int Dim>
class PatchedVolume;
template <int Dim>
struct PatchPressures;
template <int Dim>
class Displacement;

/// By curved element, see cell_quadrature; empty: all 0.
using QuadratureLevels = std::vector<std::uint8_t>;

/// scale * integral of W(F) over the rest shape: exact on straight elements, by quadrature on curved ones. Where `cells`
/// have patches, its volumetric part is that of PatchedVolume. Feasible: det F > 0 everywhere in every element.
/// JacobianBarrier adds to it in distorted curved ones, infinite where it cannot prove that.
template <int Dim>
class ElasticEnergy final : public Energy, public IncrementalTerm {
 public:
  /// `scale` is alpha h^2 [s^2]; `degree` that of the quadrature on curved elements. Elements are referred to, not copied:
  /// `cells` must outlive this.
  ElasticEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale,
                int degree = kElasticDegree);
  ~ElasticEnergy() override;
  /// Makes it what a new one on the same `cells`, of which the content may be another, would be. Memory is used again.
  void renew(const std::map<int, Material>& materials, double scale, int degree = kElasticDegree);
  std::string_view name() const override { return "elastic"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_round_off(ConstVectorView x, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;
  double value_round_off_at(const Increment& at, Workspace&) const override;
  /// 0.9 of the first time at which an element's volume vanishes on the way.
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const override;
  /// Validity asks for det F > 0 everywhere, the energy sees it at quadrature points only. Where det F is much smaller
  /// elsewhere in a curved element, it gets a finer rule with points at its corners, so that Newton is not stopped again and
  /// again by what the energy does not see. Says whether any did: the energy is another one then.
  bool refine_quadrature(ConstVectorView x);
  QuadratureLevels quadrature_levels() const;
  void set_quadrature_levels(const QuadratureLevels& levels);
  /// The element that max_step comes from.
  StepLimit step_limit(ConstVectorView x, ConstVectorView dx) const;

 private:
  const ElasticModuli& moduli(std::size_t e) const;
  template <typename F>
  double sum_over_elements(const F& f) const;
  /// `x` are the positions; only curved elements, of which the validity depends on them, read it.
  double value_of(const Displacement<Dim>& u, ConstVectorView x) const;
  PatchPressures<Dim> pressures(const Displacement<Dim>& u) const;
  double round_off_of(const Displacement<Dim>& u, ConstVectorView x) const;
  void add_gradient_of(const Displacement<Dim>& u, ConstVectorView x, VectorView gradient) const;
  ConstVectorView curved_positions(const Increment& at, Workspace& workspace) const;

  const CellSet<Dim>& cells_;
  std::vector<std::pair<int, ElasticModuli>> by_body_;  ///< few, searched linearly
  std::vector<ElasticModuli> by_element_;               ///< empty unless moduli vary in space
  double scale_ = 1;
  std::unique_ptr<QuadraticElasticity<Dim>> curved_;  ///< null: all elements are straight
  std::unique_ptr<PatchedVolume<Dim>> patched_;       ///< null: without patches
};

}  // namespace itr
