// SPDX-License-Identifier: MIT
#pragma once

#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "energy/quadratic_blocks.hpp"
#include "energy/support.hpp"

namespace itr {

/// scale/2 * integral of u . K u over the facets of a spring at rest, with the displacement u.
template <int Dim>
class SpringEnergy final : public Energy, public IncrementalTerm {
 public:
  SpringEnergy(const CellSet<Dim>& cells, const Spring& spring, double scale);
  bool empty() const { return is_empty_; }
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override { return scale_ * blocks_.value(x, rest_); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    blocks_.add_gradient(x, rest_, scale_, gradient);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;

 private:
  QuadraticBlocks<Dim> blocks_;
  VectorX rest_, none_;  ///< positions at rest, and 0
  double scale_;
  bool is_empty_ = true;
};

}  // namespace itr
