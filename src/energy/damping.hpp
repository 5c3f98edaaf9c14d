// SPDX-License-Identifier: MIT
#pragma once

#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "energy/quadratic_blocks.hpp"
#include "energy/velocity_rule.hpp"
#include "itr/options.hpp"

namespace itr {

/// coefficient / (2 rate) * v^T K v with K the Hessian of another term at the positions where this was made, projected to be
/// positive semi-definite: it only ever takes energy out. A new lag is a new object.
template <int Dim>
class DampingEnergy final : public Energy, public IncrementalTerm {
 public:
  /// K is taken with the scale (alpha h^2) that `damped` has.
  DampingEnergy(const Energy& damped, ConstVectorView lagged_x, double coefficient, VelocityRule velocity,
                Workspace& workspace);
  std::string_view name() const override { return "damping"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;

 private:
  QuadraticBlocks<Dim> damped_;
  double coefficient_;
  VelocityRule velocity_;
};

}  // namespace itr
