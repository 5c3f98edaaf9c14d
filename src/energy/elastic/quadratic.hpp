// SPDX-License-Identifier: MIT
// Elastic energy of cells with curved edges, by quadrature at rest.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "energy/elastic/elastic.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/energy.hpp"
#include "energy/step_limit.hpp"
#include "fem/cell_set.hpp"
#include "fem/displacement.hpp"
#include "fem/quadrature.hpp"
#include "itr/types.hpp"

namespace itr {

/// scale * sum over curved elements of rest volume * (sum over points of share * W(F), plus barrier_density). Feasible: det
/// F > 0 everywhere in each cell. The energy is infinite in feasible cells, too, where the barrier cannot prove that.
template <int Dim>
class QuadraticElasticity {
 public:
  QuadraticElasticity(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale, int degree);

  /// `x` are the positions that `u` leads to.
  double value(const Displacement<Dim>& u, ConstVectorView x) const;
  void add_gradient(const Displacement<Dim>& u, ConstVectorView x, VectorView gradient) const;
  /// The sum of |W| + |P| |G| over points: what value() rounds.
  double size_of_summands(const Displacement<Dim>& u, ConstVectorView x) const;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink) const;
  double max_step(ConstVectorView x, ConstVectorView dx) const;
  /// See ElasticEnergy.
  bool refine_quadrature(ConstVectorView x);
  const QuadratureLevels& levels() const { return levels_; }
  void set_levels(const QuadratureLevels& levels);
  void limit_step(ConstVectorView x, ConstVectorView dx, StepLimit& least) const;

 private:
  using Element = typename CellSet<Dim>::Element;
  static constexpr int kNodes = kQuadraticNodes<Dim>;

  const std::vector<QuadraturePoint<Dim>>& rule(std::size_t e) const {
    return cell_quadrature<Dim>(levels_.empty() ? 0 : levels_[e], degree_);
  }
  const ElasticModuli& moduli(std::size_t e, std::size_t point) const {
    return varying_.empty() ? *by_element_[e] : varying_[first_varying_[e] + point];
  }
  template <typename F>
  double sum_over_cells(const Displacement<Dim>& u, ConstVectorView x, const F& at_point) const;
  void sample_moduli();
  bool is_blind(std::size_t e, ConstVectorView x) const;
  const ElasticModuli& moduli_at_barycenter(std::size_t e) const {
    return varying_.empty() ? *by_element_[e] : at_barycenters_[e];
  }

  const CellSet<Dim>& cells_;
  std::span<const Element> elements_;  ///< the curved ones
  int degree_;                         ///< of level 0
  QuadratureLevels levels_;
  std::map<int, Material> materials_;  ///< empty unless moduli vary in space
  std::map<int, ElasticModuli> by_body_;
  std::vector<const ElasticModuli*> by_element_;
  std::vector<ElasticModuli> varying_;  ///< by element and point; empty unless moduli vary in space
  std::vector<ElasticModuli> at_barycenters_;
  std::vector<std::size_t> first_varying_;  ///< by element
  double scale_;
};

}  // namespace itr
