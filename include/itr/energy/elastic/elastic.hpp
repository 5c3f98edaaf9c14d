// SPDX-License-Identifier: MIT
#pragma once

#include <map>

#include "itr/energy/elastic/laws.hpp"
#include "itr/energy/energy.hpp"
#include "itr/energy/step_limit.hpp"
#include "itr/fem/cell_set.hpp"

namespace itr {

/// scale * sum over elements of rest volume * W(F). Feasible: every element has det F > 0.
template <int Dim>
class ElasticEnergy final : public Energy {
 public:
  /// `scale` is alpha h^2 [s^2]. Elements are referred to, not copied: `cells` must outlive this.
  ElasticEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale);
  /// Makes it what a new one on the same `cells`, of which the content may be another, would be. Memory is used again.
  void renew(const std::map<int, Material>& materials, double scale);
  std::string_view name() const override { return "elastic"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  /// 0.9 of the first time at which an element's volume vanishes on the way.
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const override;
  /// The element that max_step comes from.
  StepLimit step_limit(ConstVectorView x, ConstVectorView dx) const;

 private:
  const ElasticModuli& moduli(std::size_t e) const;

  const CellSet<Dim>& cells_;
  std::vector<std::pair<int, ElasticModuli>> by_body_;  ///< few, searched linearly
  std::vector<ElasticModuli> by_element_;               ///< empty unless moduli vary in space
  double scale_ = 1;
};

}  // namespace itr
