// SPDX-License-Identifier: MIT
// Integrators by themselves, on functions and an oscillator whose solutions are known.
#include <gtest/gtest.h>

#include <cmath>

#include "time/integrator.hpp"

namespace itr {
namespace {

VectorX scalar(double value) { return VectorX::Constant(1, value); }

/// The past of x(t), with its derivatives, at t = 0, -h, -2h, ...
template <typename X, typename V, typename A>
History exact_history(int states, double h, X x, V v, A a) {
  History history;
  for (int i = 0; i < states; ++i) {
    history.x.push_back(scalar(x(-i * h)));
    history.v.push_back(scalar(v(-i * h)));
    history.a.push_back(scalar(a(-i * h)));
  }
  return history;
}

/// Error at t = 1 of x'' = -w^2 x, x(0) = 1, x'(0) = w, started from exact states.
double oscillator_error(const TimeOptions& options, int steps) {
  constexpr double w = 6;  // so fast that high orders are seen above round-off
  const auto x = [](double t) { return std::cos(w * t) + std::sin(w * t); };
  const auto v = [](double t) { return w * (std::cos(w * t) - std::sin(w * t)); };
  const auto a = [x](double t) { return -w * w * x(t); };
  TimeOptions with_step = options;
  with_step.dt = 1.0 / steps;
  const TimeIntegrator integrator(with_step);
  History history = exact_history(integrator.depth(), with_step.dt, x, v, a);
  for (int k = 0; k < steps; ++k)  // the minimiser of 1/2 (x - xhat)^2 + scaling * 1/2 w^2 x^2
    integrator.push(integrator.predictor(history) / (1 + w * w * integrator.scaling(history)), history);
  return std::abs(history.x[0][0] - x(1));
}

class Bdf : public ::testing::TestWithParam<int> {
 protected:
  TimeOptions options() const { return {.integrator = Integrator::bdf, .bdf_order = GetParam()}; }
};

TEST_P(Bdf, IsExactForPolynomialsOfItsOrder) {
  const int order = GetParam();
  TimeOptions with_step = options();
  with_step.dt = 0.3;
  const TimeIntegrator integrator(with_step);
  for (int degree = 0; degree <= order; ++degree) {
    const auto x = [=](double t) { return std::pow(t, degree); };
    const auto v = [=](double t) { return degree == 0 ? 0 : degree * std::pow(t, degree - 1); };
    const auto a = [=](double t) { return degree < 2 ? 0 : degree * (degree - 1) * std::pow(t, degree - 2); };
    const History history = exact_history(order, with_step.dt, x, v, a);
    const VectorX end = scalar(x(with_step.dt)), velocity = integrator.velocity(end, history);
    EXPECT_NEAR(velocity[0], v(with_step.dt), 1e-11) << "degree " << degree;
    EXPECT_NEAR(integrator.acceleration(velocity, history)[0], a(with_step.dt), 1e-10) << "degree " << degree;
    // The predictor is where no force leads: x - xhat = scaling * acceleration.
    EXPECT_NEAR(end[0] - integrator.predictor(history)[0], integrator.scaling(history) * a(with_step.dt), 1e-11);
  }
}

TEST_P(Bdf, ConvergesWithItsOrder) {
  const int steps = GetParam() == 6 ? 80 : 160;
  const double rate = std::log2(oscillator_error(options(), steps) / oscillator_error(options(), 2 * steps));
  EXPECT_NEAR(rate, GetParam(), 0.15);
}

TEST_P(Bdf, StartsWithFirstOrderAndGrows) {
  TimeOptions with_step = options();
  with_step.dt = 0.5;
  const TimeIntegrator integrator(with_step);
  History history = exact_history(
      1, 0.5, [](double) { return 1.0; }, [](double) { return 0.0; }, [](double) { return 0.0; });
  const double b[] = {1, 2.0 / 3, 6.0 / 11, 12.0 / 25, 60.0 / 137, 60.0 / 147};
  for (int k = 1; k <= GetParam() + 2; ++k) {
    const int order = std::min(k, GetParam());
    EXPECT_EQ(integrator.order(history), order);
    EXPECT_DOUBLE_EQ(integrator.scaling(history), b[order - 1] * b[order - 1] * 0.25);
    integrator.push(scalar(1), history);
    EXPECT_NEAR(history.v[0][0], 0, 1e-15);  // rest stays rest at every order
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, Bdf, ::testing::Range(1, 7));

TEST(Newmark, ConvergesWithSecondOrder) {
  const TimeOptions options{.integrator = Integrator::newmark};
  EXPECT_NEAR(std::log2(oscillator_error(options, 80) / oscillator_error(options, 160)), 2, 0.05);
}

TEST(ImplicitEuler, IsTheFirstOfTheFormulas) {
  const TimeOptions euler{.integrator = Integrator::implicit_euler}, bdf1{.integrator = Integrator::bdf, .bdf_order = 1};
  EXPECT_EQ(oscillator_error(euler, 16), oscillator_error(bdf1, 16));
}

}  // namespace
}  // namespace itr
