// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "energy/energy.hpp"

namespace itr {

/// A constant and the sum over the dofs of x^4 / 4 - c x^2 / 2: a saddle at 0, minima at +-sqrt(c). Its "projected" Hessian
/// is much stiffer than the true one near the saddle, as the sum of projected element Hessians is near a buckling load. No
/// step goes beyond |x| = wall.
class DoubleWell final : public Energy {
 public:
  explicit DoubleWell(double c, double constant = 0, double wall = 1e9) : c_(c), constant_(constant), wall_(wall) {}
  std::string_view name() const override { return "double well"; }
  double value(ConstVectorView x, Workspace&) const override {
    return constant_ + (x.array().pow(4) / 4 - c_ * x.array().square() / 2).sum();
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    gradient.array() += x.array().cube() - c_ * x.array();
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override {
    for (int v = 0; v < x.size() / 2; ++v) {
      Mat<2> block = Mat<2>::Zero();
      for (int k = 0; k < 2; ++k) {
        const double second = 3 * x[2 * v + k] * x[2 * v + k] - c_;
        block(k, k) = psd == PsdProjection::clamp ? std::max(second, 1.0) : second;
      }
      sink.add<2>(std::array{v}, block.data());
    }
  }
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const override {
    double fraction = 1;
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (std::abs(x[i] + dx[i]) > wall_) fraction = std::min(fraction, 0.9 * (wall_ - std::abs(x[i])) / std::abs(dx[i]));
    return fraction;
  }

 private:
  double c_, constant_, wall_;
};

}  // namespace itr
