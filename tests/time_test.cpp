// SPDX-License-Identifier: MIT
// Integrators by themselves, on functions and an oscillator whose solutions are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "time/integrator.hpp"
#include "time/step_control.hpp"

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

/// x(t), its derivatives, and a past of two states `before` and 0 of it.
template <typename F>
History two_states(double before, const F& f) {
  History history;
  for (const double t : {0.0, -before}) {
    const auto [x, v, a] = f(t);
    history.x.push_back(scalar(x));
    history.v.push_back(scalar(v));
    history.a.push_back(scalar(a));
  }
  history.dt = before;
  return history;
}

TEST(VariableBdf2, IsExactForQuadraticsAtAnyRatio) {
  const auto quadratic = [](double t) { return std::array{3 - 2 * t + 5 * t * t, -2 + 10 * t, 10.0}; };
  for (const double h : {0.02, 0.1, 0.13, 0.2}) {
    const TimeIntegrator integrator({.integrator = Integrator::bdf, .dt = h});
    const History history = two_states(0.1, quadratic);
    const auto [x, v, a] = quadratic(h);
    EXPECT_NEAR(integrator.velocity(scalar(x), history)[0], v, 1e-13);
    EXPECT_NEAR(integrator.acceleration(scalar(v), history)[0], a, 1e-12);
    EXPECT_NEAR(x - integrator.predictor(history)[0], integrator.scaling(history) * a, 1e-14);
  }
}

TEST(VariableBdf2, HasTheConstantStepAsItsCase) {
  const auto wave = [](double t) { return std::array{std::sin(t), std::cos(t), -std::sin(t)}; };
  const TimeIntegrator integrator({.integrator = Integrator::bdf, .dt = 0.1});
  History known = two_states(0.1, wave), unknown = known;
  unknown.dt = 0;
  EXPECT_EQ(integrator.predictor(known), integrator.predictor(unknown));
  EXPECT_EQ(integrator.scaling(known), 4.0 / 9 * 0.1 * 0.1);
}

/// One step of x'' = -w^2 x from a past on cos(wt), and what it is off by at its end.
struct StepFromExact {
  double error_x, error_v;
  LocalError estimate;
};
StepFromExact step_from_exact(const TimeOptions& time, double before, double w) {
  const auto wave = [w](double t) {
    return std::array{std::cos(w * t + 1), -w * std::sin(w * t + 1), -w * w * std::cos(w * t + 1)};
  };
  const TimeIntegrator integrator(time);
  History history = two_states(before, wave);
  history.x.resize(integrator.depth());
  history.v.resize(integrator.depth());
  const VectorX x = integrator.predictor(history) / (1 + w * w * integrator.scaling(history));
  const auto [exact_x, exact_v, exact_a] = wave(time.dt);
  return {x[0] - exact_x, integrator.velocity(x, history)[0] - exact_v, integrator.local_error(x - history.x[0], history)};
}

TEST(LocalError, IsThatOfAStepFromExactStates) {
  const AdaptiveTimeOptions adaptive{.enabled = true};
  for (const auto& [integrator, order] :
       {std::pair(Integrator::bdf, 2), std::pair(Integrator::newmark, 2), std::pair(Integrator::implicit_euler, 1)})
    for (const double ratio : {0.5, 1.0, 2.0}) {
      const TimeOptions time{.integrator = integrator, .dt = 1e-3, .adaptive = adaptive};
      const StepFromExact step = step_from_exact(time, time.dt / ratio, 6);
      EXPECT_NEAR(std::abs(step.estimate.x[0] / step.error_x), 1, 0.02) << static_cast<int>(integrator) << " " << ratio;
      EXPECT_NEAR(std::abs(step.estimate.v[0] / step.error_v), 1, 0.02) << static_cast<int>(integrator) << " " << ratio;
      const double C = TimeIntegrator(time).error_constant(two_states(time.dt / ratio, [](double) {
        return std::array{0.0, 0.0, 0.0};
      }));
      EXPECT_GT(C, 0);
      TimeOptions half = time;
      half.dt /= 2;
      const StepFromExact halved = step_from_exact(half, half.dt / ratio, 6);
      EXPECT_NEAR(std::log2(step.error_x / halved.error_x), order + 1, 0.05);
    }
}

/// A free oscillator that steps of random lengths, of ratios up to the bound, take on: it gains no energy, whatever the
/// lengths are by its period.
TEST(VariableBdf2, LetsAFreeOscillatorGainNoEnergyUnderRandomRatios) {
  std::mt19937 random(1);
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  for (int trial = 0; trial < 3000; ++trial) {
    const double longest = std::pow(10, uniform(-1.5, 2)), shortest = longest * std::pow(10, uniform(-3, 0));
    TimeOptions time{.integrator = Integrator::bdf, .dt = std::sqrt(longest * shortest)};
    History history{.x = {scalar(uniform(-1, 1))}, .v = {scalar(uniform(-1, 1))}, .a = {}};
    const auto energy = [&] { return history.x[0].squaredNorm() + history.v[0].squaredNorm(); };
    const double first = energy();
    const int kind = trial % 3;
    for (int k = 0; k < 200; ++k) {
      const TimeIntegrator integrator(time);
      integrator.push(integrator.predictor(history) / (1 + integrator.scaling(history)), history);
      ASSERT_LE(energy(), first * (1 + 1e-12)) << "trial " << trial << ", step " << k;
      const double growth = StepController::kGrowth;
      const double ratio = kind == 0   ? std::pow(growth, uniform(-1, 1))
                           : kind == 1 ? (uniform(0, 1) < 0.6 ? growth : 0.3)
                                       : uniform(0.2, growth);
      time.dt = std::clamp(time.dt * ratio, shortest, longest);
    }
  }
}

TimeOptions adaptive_options(Integrator integrator, double tolerance) {
  return {.integrator = integrator, .adaptive = {.enabled = true, .tolerance = tolerance, .dt_max = 1e3, .end = 1e3}};
}

/// The error that an oscillator of period 2 pi has after one period, by its amplitude, and the steps that it took.
struct Period {
  double error = 0, sum = 0;
  int steps = 0;
};
Period one_period(TimeOptions time) {
  const double end = 2 * std::numbers::pi;
  time.adaptive.end = end;
  History history{.x = {scalar(1)}, .v = {scalar(0)}, .a = {}};
  if (time.integrator == Integrator::newmark) history.a = {scalar(-1)};
  StepControl control;
  Period period;
  for (double t = 0; t < end; ++period.steps) {
    const StepController controller(time);
    const auto next = controller.next(control, t, 0.01, history.x.size() > 1 ? history.dt : 0);
    time.dt = next.dt;
    StepTrial trial;
    for (;;) {
      const TimeIntegrator integrator(time);
      const VectorX x = integrator.predictor(history) / (1 + integrator.scaling(history)), increment = x - history.x[0];
      const LocalError error = integrator.local_error(increment, history);
      const StepErrors errors{.error = std::hypot(error.x[0], error.v.size() ? error.v[0] : 0)};
      if (const auto shorter = controller.shorter(errors, trial, time.dt, integrator.accuracy(history))) {
        time.dt *= shorter->part;
        trial = *shorter;
        continue;
      }
      control = controller.after(control, errors, trial, time.dt, 0.5);
      period.sum += errors.error;
      integrator.push(x, history);
      t = trial.length < 1 ? t + time.dt : next.end;
      break;
    }
  }
  period.error = std::hypot(history.x[0][0] - 1, history.v[0][0]);
  return period;
}

TEST(StepController, ReachesTheToleranceInAPeriodOfAnOscillator) {
  for (const Integrator integrator : {Integrator::bdf, Integrator::newmark, Integrator::implicit_euler})
    for (const double tolerance : {0.1, 0.02, 0.005}) {
      const Period period = one_period(adaptive_options(integrator, tolerance));
      EXPECT_GT(period.error, tolerance / 3) << static_cast<int>(integrator) << " at " << tolerance;
      EXPECT_LT(period.error, tolerance * 1.5) << static_cast<int>(integrator) << " at " << tolerance;
      EXPECT_NEAR(period.sum / period.error, 1, 0.5) << static_cast<int>(integrator) << " at " << tolerance;
    }
  const auto steps = [](Integrator integrator, double tolerance) {
    return one_period(adaptive_options(integrator, tolerance)).steps;
  };
  EXPECT_NEAR(steps(Integrator::bdf, 0.0025) / double(steps(Integrator::bdf, 0.01)), 2, 0.3);
  EXPECT_NEAR(steps(Integrator::implicit_euler, 0.0125) / double(steps(Integrator::implicit_euler, 0.05)), 4, 0.5);
}

TEST(StepController, RejectsWhatIsTooLongAndGivesUpAtJumps) {
  const TimeOptions time = adaptive_options(Integrator::bdf, 0.01);
  const StepController controller(time);
  const double allowed = controller.allowed();
  EXPECT_FALSE(controller.shorter({.error = allowed}, {}, 1, 2));
  const auto once = controller.shorter({.error = 8 * allowed}, {}, 1, 2);
  ASSERT_TRUE(once);
  EXPECT_NEAR(once->part, 0.475, 1e-12);
  EXPECT_EQ(once->error, 8);
  // A smooth motion's error falls by the third power of the length, a jump's hardly.
  EXPECT_EQ(controller.shorter({.error = 2.5 * allowed}, *once, 0.475, 2)->jumps, 0);
  const auto twice = controller.shorter({.error = 7 * allowed}, *once, 0.475, 2);
  ASSERT_TRUE(twice);
  EXPECT_EQ(twice->jumps, 1);
  EXPECT_EQ(twice->part, 0.4);
  EXPECT_NEAR(twice->length, once->part * twice->part, 1e-15);
  EXPECT_FALSE(controller.shorter({.error = 6 * allowed}, *twice, 0.2, 2));
  TimeOptions bounded = time;
  bounded.adaptive.dt_min = 0.5;
  EXPECT_FALSE(StepController(bounded).shorter({.error = 100 * allowed}, {}, 0.5, 2));
  EXPECT_EQ(StepController(bounded).shorter({.error = 1e9 * allowed}, {}, 0.8, 2)->part, 0.5 / 0.8);
}

TEST(StepController, LandsOnAnImpactWhoseEnergyMatters) {
  const TimeOptions time = adaptive_options(Integrator::bdf, 0.01);
  const StepController controller(time);
  const StepErrors small{.impact = 0.005, .resolving_dt = 0.01, .way_to_contact = 0.4};
  EXPECT_FALSE(controller.shorter(small, {}, 1, 2));
  StepErrors large = small;
  large.impact = 0.02;
  EXPECT_EQ(controller.shorter(large, {}, 1, 2)->part, 0.4);
  large.way_to_contact = 1;
  EXPECT_EQ(controller.shorter(large, {}, 1, 2)->part, 0.2);
  EXPECT_EQ(controller.shorter(large, {}, 0.04, 2)->part, 0.25);
  EXPECT_FALSE(controller.shorter(large, {}, 0.01, 2)) << "resolved";
}

TEST(StepController, EndsStepsAtStops) {
  TimeOptions time = adaptive_options(Integrator::bdf, 0.01);
  time.adaptive = {
      .enabled = true, .dt_min = 1e-6, .dt_max = 1, .begin = 0, .end = 1, .output_dt = 0.3, .kinks = {0.1, 0.6}};
  const StepController controller(time);
  std::vector<double> ends;
  for (double t = 0; t < 1;) {
    const auto next = controller.next({.dt = 0.08}, t, 1, 0);
    EXPECT_NEAR(next.end - t, next.dt, 1e-15);
    EXPECT_LE(next.dt, 0.08 * (1 + 1e-12));
    ends.push_back(t = next.end);
  }
  for (const double stop : {0.1, 0.3, 0.6, 2 * 0.3, 3 * 0.3, 1.0})
    EXPECT_TRUE(std::any_of(ends.begin(), ends.end(), [&](double end) { return std::abs(end - stop) < 1e-12; })) << stop;
  EXPECT_EQ(ends.back(), 1);
  EXPECT_EQ(ends[1], 0.1) << "two of the same length, none of what is left over";
  EXPECT_EQ(controller.next({.dt = 0.08}, 0.4, 1, 0.01).dt, 0.02) << "twice the step before";
  for (const double t : {0.0, 0.3, 0.6, 0.9, 1.0}) EXPECT_TRUE(time.adaptive.is_asked(t));
  EXPECT_FALSE(time.adaptive.is_asked(0.1));
}

}  // namespace
}  // namespace itr
