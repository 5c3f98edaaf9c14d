// SPDX-License-Identifier: MIT
#pragma once

#include "energy/energy.hpp"

namespace itr {

/// weight / 2 |x - x0|^2, as setup.hpp says of LaggedRegularization.
template <int Dim>
class LaggedRegularizationEnergy final : public Energy {
 public:
  LaggedRegularizationEnergy(VectorX x0, double weight) : x0_(std::move(x0)), weight_(weight) {}
  std::string_view name() const override { return "lagged regularization"; }
  double value(ConstVectorView x, Workspace&) const override { return weight_ / 2 * (x - x0_).squaredNorm(); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override { gradient += weight_ * (x - x0_); }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<Dim> block = weight_ * Mat<Dim>::Identity();
    for (int v = 0; Dim * v < x0_.size(); ++v) sink.add<Dim>(std::span(&v, 1), block.data());
  }

 private:
  VectorX x0_;
  double weight_;
};

}  // namespace itr
