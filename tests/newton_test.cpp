// SPDX-License-Identifier: MIT
// The minimiser itself, on energies of a few unknowns whose minima are known.
#include "itr/newton/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace itr {
namespace {

/// sum over the dofs of x^4 / 4 - c x^2 / 2: a saddle at 0, minima at +-sqrt(c). Its "projected" Hessian is much stiffer
/// than the true one near the saddle, as the sum of projected element Hessians is near a buckling load.
class DoubleWell final : public Energy {
 public:
  explicit DoubleWell(double c) : c_(c) {}
  std::string_view name() const override { return "double well"; }
  double value(ConstVectorView x, Workspace&) const override {
    return (x.array().pow(4) / 4 - c_ * x.array().square() / 2).sum();
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

 private:
  double c_;
};

TEST(Newton, LeavesASaddleInFewSteps) {
  const double c = 1e-2;
  VectorX x = VectorX::Constant(4, 1e-6);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options;
  options.max_iterations = 500;
  options.step_tolerance = 1e-10;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  Workspace workspace;
  const NewtonSummary summary = minimize(DoubleWell(c), x, dofs, VectorX(), system, options, workspace);
  EXPECT_TRUE(summary.converged()) << summary.message;
  EXPECT_LT(summary.iterations, 60);  // growing by a hundredth a step it would be a thousand
  EXPECT_LE((x.array() - std::sqrt(c)).abs().maxCoeff(), 1e-9);
}

TEST(Newton, CallsBackAfterEachStepAndTakesInAChangedEnergy) {
  VectorX x = VectorX::Constant(4, 2.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options;
  options.step_tolerance = 1e-10;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  Workspace workspace;
  int calls = 0;
  const NewtonSummary summary = minimize(DoubleWell(1), x, dofs, VectorX(), system, options, workspace, [&](const VectorX&) {
    ++calls;
    return true;
  });
  EXPECT_TRUE(summary.converged());
  EXPECT_EQ(calls, summary.iterations);
}

}  // namespace
}  // namespace itr
