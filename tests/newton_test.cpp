// SPDX-License-Identifier: MIT
// The minimiser itself, on energies of a few unknowns whose minima are known.
#include "newton/newton.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "double_well.hpp"
#include "energy/contact/contact.hpp"
#include "linear/choice.hpp"

namespace itr {
namespace {

/// Until a step is below this, whatever the gradient.
NewtonOptions until_steps_below(double tolerance) {
  NewtonOptions options;
  options.step_tolerance = tolerance;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  return options;
}

/// A large constant and, by the first dof, a valley whose slope is linear in pieces: beyond the short one in the middle
/// Newton's full step leads from -0.2 to 1 and back, and hardly changes the energy.
class LopsidedValley final : public Energy {
 public:
  std::string_view name() const override { return "lopsided valley"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = kConstant + x[1] * x[1] / 2;
    const double t = x[0], from = -1;
    for (const Piece& piece : kPieces) {
      const double a = std::clamp(piece.from, from, t), b = std::clamp(piece.to, from, t);
      sum += (b - a) * (slope(piece, a) + slope(piece, b)) / 2;
    }
    return sum;
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    gradient[0] += slope(piece_at(x[0]), x[0]);
    gradient[1] += x[1];
  }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    Mat<2> block = Mat<2>::Identity();
    block(0, 0) = piece_at(x[0]).second;
    sink.add<2>(std::array{0}, block.data());
  }

 private:
  struct Piece {
    double from, to, root, second;
  };
  static constexpr double kConstant = 5e8, kLeft = -1.19, kRight = 0.0625, kMiddle = (kRight - kLeft) / 0.14;
  static constexpr std::array<Piece, 3> kPieces{
      {{-1, -0.19, 1, 1}, {-0.19, -0.05, -0.05 - kRight / kMiddle, kMiddle}, {-0.05, 9, -0.2, 1 / 2.4}}};
  static double slope(const Piece& piece, double x) { return piece.second * (x - piece.root); }
  static const Piece& piece_at(double x) { return x < -0.19 ? kPieces[0] : x < -0.05 ? kPieces[1] : kPieces[2]; }
};

/// Over all dofs of `x`, with a solver's own system.
NewtonSummary minimize_by(linear::Solver& solver, const Energy& energy, VectorX& x, const NewtonOptions& options) {
  SparseSystem system(solver);
  const DofMap dofs = DofMap::from_held(std::vector<char>(x.size(), 0));
  system.reset(dofs, 2, {});
  Workspace workspace;
  return minimize(energy, x, dofs, VectorX(), system, options, workspace);
}

TEST(Newton, LeavesASaddleInFewSteps) {
  const double c = 1e-2;
  VectorX x = VectorX::Constant(4, 1e-6);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options = until_steps_below(1e-10);
  options.max_iterations = 500;
  Workspace workspace;
  const NewtonSummary summary = minimize(DoubleWell(c), x, dofs, VectorX(), system, options, workspace);
  EXPECT_TRUE(summary.converged()) << summary.message;
  EXPECT_LT(summary.iterations, 60);  // growing by a hundredth a step it would be a thousand
  EXPECT_LE((x.array() - std::sqrt(c)).abs().maxCoeff(), 1e-9);
}

TEST(Newton, GoesNotToAndFroWhereTheEnergyHardlyChanges) {
  VectorX x = Vec<2>(-0.2, 0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(2, 0));
  DenseSystem system;
  NewtonOptions options = until_steps_below(1e-4);
  options.max_iterations = 200;
  Workspace workspace;
  const NewtonSummary summary = minimize(LopsidedValley(), x, dofs, VectorX(), system, options, workspace);
  EXPECT_TRUE(summary.converged()) << summary.message << " at " << x.transpose();
  EXPECT_GT(x[0], -0.19);
  EXPECT_LT(x[0], -0.05);
}

/// The second dof's descent outweighs that the first one goes up, to the saddle.
TEST(Newton, IsNotDrawnToASaddleByASolverThatAllowsIt) {
  const double c = 1e-2;
  linear::Registry registry;
  for (const char* name : {"eigen:llt", "eigen:ldlt", "eigen:lu", "eigen:cg"}) {
    const auto solver = registry.create(name);
    VectorX x = Vec<2>(1e-6, 0.3);
    const NewtonSummary summary = minimize_by(*solver, DoubleWell(c), x, until_steps_below(1e-10));
    EXPECT_TRUE(summary.converged()) << name << ": " << summary.message;
    EXPECT_LE((x.array().abs() - std::sqrt(c)).abs().maxCoeff(), 1e-6) << name;  // the saddle is at 0
  }
}

/// Follows PolyFEM's way by an L D L^T to the saddle, with any engine.
TEST(Newton, TakesIndefiniteDirectionsWithAnySolverWhereAskedTo) {
  linear::Registry registry;
  for (const char* name : {"eigen:llt", "eigen:ldlt", "eigen:lu", "dense"}) {
    const auto solver = linear::choose_solver({.solvers = {name}}, true, registry, {});
    VectorX x = Vec<2>(1e-6, 0.3);
    NewtonOptions options = until_steps_below(1e-10);
    options.indefinite = IndefiniteHessian::accept;
    const NewtonSummary summary = minimize_by(*solver, DoubleWell(1e-2), x, options);
    EXPECT_TRUE(summary.converged()) << name << ": " << summary.message;
    EXPECT_LE(std::abs(x[0]), 1e-9) << name;
    EXPECT_LE(std::abs(x[1] - 0.1), 1e-9) << name;
    EXPECT_EQ(summary.indefinite > 0, solver->capabilities().tells_definiteness) << name;
  }
}

/// The gradient is below its tolerance at the saddle, but the last factorisation has seen a negative eigenvalue.
TEST(Newton, CallsNoSaddleConverged) {
  const double c = 1e-2;
  linear::Registry registry;
  for (const char* name : {"eigen:llt", "eigen:ldlt"})
    for (const double tolerance : {1e-4, 0.0}) {
      const auto solver = registry.create(name);
      VectorX x = Vec<2>(1e-12, 0.3);
      NewtonOptions options = until_steps_below(1e-4);
      options.gradient_tolerance = options.first_gradient_tolerance = tolerance;
      const NewtonSummary summary = minimize_by(*solver, DoubleWell(c), x, options);
      EXPECT_TRUE(summary.converged()) << name << ": " << summary.message;
      EXPECT_GT(summary.indefinite, 0) << name;
      EXPECT_LE((x.array().abs() - std::sqrt(c)).abs().maxCoeff(), 1e-4 / (2 * c)) << name;  // by the curvature there
    }
}

/// A start whose gradient is exactly zero, with solvers that tell of negative eigenvalues and solvers that cannot.
TEST(Newton, LeavesASaddleThatItStartsAtWhereAMinimumIsAskedFor) {
  const double c = 1e-2;
  linear::Registry registry;
  for (const char* name : {"eigen:llt", "eigen:ldlt", "eigen:lu", "eigen:cg"}) {
    const auto solver = registry.create(name);
    SparseSystem system(*solver);
    const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
    system.reset(dofs, 2, {});
    VectorX x = VectorX::Zero(4);
    Workspace workspace;
    const NewtonSummary summary =
        minimize(DoubleWell(c), x, dofs, VectorX(), system, until_steps_below(1e-10), workspace, {.must_be_minimum = true});
    EXPECT_TRUE(summary.converged()) << name << ": " << summary.message;
    EXPECT_LE((x.array().abs() - std::sqrt(c)).abs().maxCoeff(), 1e-6) << name;
  }
}

/// Where not all digits are asked for, like iterations that end before they meet the first dof, and what curvature it has.
class ShortSighted final : public NewtonSystem {
 public:
  explicit ShortSighted(double c) : c_(c) {}
  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    curvature_ = 3 * x[1] * x[1] - c_;
    exact_.assemble(energy, x, psd, dofs, motion, workspace);
  }
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override {
    if (!(asked.loose > kTightResidual && curvature_ > 0)) return exact_.solve(shift, rhs, asked, solution);
    ++loose;
    solution = Vec<2>(0, rhs[1] / curvature_);
    return {linear::Outcome::ok, asked.loose, linear::Definiteness::positive};
  }
  linear::SystemReport factorize(const Shift& shift) override { return exact_.factorize(shift); }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    return exact_.solve_again(rhs, solution);
  }
  std::string message() const override { return "short-sighted"; }
  double diagonal_scale() const override { return exact_.diagonal_scale(); }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return exact_.curvature_of(shift, step); }
  int loose = 0;  ///< solves

 private:
  DenseSystem exact_;
  double c_, curvature_ = 0;
};

/// Directions may be loose, but what is said of the end is not.
TEST(Newton, AsksAtTheEndForAllDigits) {
  const double c = 1e-2;
  for (const double tolerance : {1e-9, 0.0}) {
    ShortSighted system(c);
    VectorX x = Vec<2>(1e-12, 0.3);
    NewtonOptions options = until_steps_below(1e-8);
    options.gradient_tolerance = options.first_gradient_tolerance = tolerance;
    Workspace workspace;
    const DofMap dofs = DofMap::from_held(std::vector<char>(2, 0));
    const NewtonSummary summary = minimize(DoubleWell(c), x, dofs, VectorX(), system, options, workspace);
    EXPECT_TRUE(summary.converged()) << summary.message;
    EXPECT_GT(system.loose, 0);
    EXPECT_GT(summary.indefinite, 0);
    EXPECT_LE((x.array().abs() - std::sqrt(c)).abs().maxCoeff(), 1e-6)  // the saddle is at 0
        << "gradient tolerance " << tolerance << ": " << to_string(summary.termination) << ", " << summary.message
        << ", x = " << x.transpose() << ", " << summary.iterations << " iterations";
  }
}

/// A saddle so flat that steps from it promise less than the energy resolves: not a place to end, and which of the equal
/// minima follows must not hang on round-off in the gradient.
TEST(Newton, LeavesASaddleWithinRoundOffToOneSide) {
  const double c = 1e-2;
  linear::Registry registry;
  for (const char* name : {"eigen:llt", "eigen:ldlt"})
    for (const double noise : {1e-12, -1e-12}) {
      const auto solver = registry.create(name);
      SparseSystem system(*solver);
      const DofMap dofs = DofMap::from_held(std::vector<char>(2, 0));
      system.reset(dofs, 2, {});
      VectorX x = VectorX::Constant(2, noise);
      NewtonOptions options;
      options.gradient_tolerance = options.first_gradient_tolerance = 0;
      options.step_tolerance = 1e-16;
      Workspace workspace;
      const NewtonSummary summary = minimize(DoubleWell(c, 1), x, dofs, VectorX(), system, options, workspace);
      EXPECT_TRUE(summary.converged()) << name << ": " << summary.message;
      EXPECT_LE((x.array() - std::sqrt(c)).abs().maxCoeff(), 1e-6) << name << " from " << noise;
    }
}

/// A quadratic whose gradient has noise that no step removes.
class NoisyBowl final : public Energy {
 public:
  std::string_view name() const override { return "noisy bowl"; }
  double value(ConstVectorView x, Workspace&) const override { return 1 + x.squaredNorm() / 2; }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    gradient += x;
    gradient[0] += 1e-9 * std::sin(12.9 * ++calls_);
  }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, Mat<2>(Mat<2>::Identity()).data());
  }

 private:
  mutable int calls_ = 0;
};

TEST(Newton, EndsAtRoundOffAndSaysSo) {
  VectorX x = VectorX::Constant(4, 1.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options;
  options.step_tolerance = options.gradient_tolerance = options.first_gradient_tolerance = 1e-12;  // below the noise
  Workspace workspace;
  const NewtonSummary summary = minimize(NoisyBowl(), x, dofs, VectorX(), system, options, workspace);
  EXPECT_EQ(summary.termination, Termination::round_off) << to_string(summary.termination);
  EXPECT_TRUE(summary.converged());
  EXPECT_EQ(summary.message, "");
  EXPECT_LT(summary.iterations, 12);
}

/// A slope without an end whose values are too coarse to show it.
class CoarseSlope final : public Energy {
 public:
  std::string_view name() const override { return "coarse slope"; }
  double value(ConstVectorView, Workspace&) const override { return 1e6; }
  void add_gradient(ConstVectorView, VectorView gradient, Workspace&) const override { gradient.array() += 1e-12; }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, Mat<2>(Mat<2>::Identity()).data());
  }
};

TEST(Newton, DoesNotCallForcesFarAboveTheirRoundOffConverged) {
  VectorX x = VectorX::Constant(4, 1.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options;
  options.force_tolerance = 0;
  Workspace workspace;
  const NewtonSummary summary = minimize(CoarseSlope(), x, dofs, VectorX(), system, options, workspace);
  EXPECT_EQ(summary.termination, Termination::no_descent) << to_string(summary.termination);
  EXPECT_LT(summary.iterations, 30);
}

/// A bowl that a load pushes from rest; both scaled, as by a short step.
class LoadedBowl final : public Energy {
 public:
  explicit LoadedBowl(double scale) : scale_(scale) {}
  std::string_view name() const override { return "loaded bowl"; }
  double value(ConstVectorView x, Workspace&) const override { return scale_ * (x.squaredNorm() / 2 - x.sum()); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    gradient.array() += scale_ * (x.array() - 1);
  }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, Mat<2>(scale_ * Mat<2>::Identity()).data());
  }

 private:
  double scale_;
};

TEST(Newton, PassesOverNoLoadByDefaultHoweverSmallTheScale) {
  for (const double scale : {1e-30, 1e-14, 1.0, 1e14}) {
    VectorX x = VectorX::Zero(4);
    const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
    DenseSystem system;
    Workspace workspace;
    const NewtonSummary summary = minimize(LoadedBowl(scale), x, dofs, VectorX(), system, NewtonOptions(), workspace);
    EXPECT_TRUE(summary.converged()) << scale;
    EXPECT_LE((x.array() - 1).abs().maxCoeff(), 1e-12) << scale;
  }
}

/// A quadratic whose minimum lies between coordinates that doubles have.
class FarBowl final : public Energy {
 public:
  std::string_view name() const override { return "far bowl"; }
  double value(ConstVectorView x, Workspace&) const override { return away(x).squaredNorm() / 2; }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override { gradient += away(x); }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, Mat<2>(Mat<2>::Identity()).data());
  }

 private:
  static VectorX away(ConstVectorView x) { return (x.array() - 1e6 - 4e-11).matrix(); }
};

TEST(Newton, EndsAtTheRoundOffOfPositions) {
  VectorX x = VectorX::Constant(4, 1e6 + 1);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options;
  options.step_tolerance = options.gradient_tolerance = options.first_gradient_tolerance = 1e-12;  // the spacing is 1e-10
  Workspace workspace;
  const NewtonSummary summary = minimize(FarBowl(), x, dofs, VectorX(), system, options, workspace);
  EXPECT_EQ(summary.termination, Termination::round_off) << to_string(summary.termination);
  EXPECT_LT(summary.iterations, 100);
  EXPECT_LE((x.array() - 1e6).abs().maxCoeff(), 2e-10);
}

TEST(Newton, CallsBackAfterEachStepAndTakesInAChangedEnergy) {
  VectorX x = VectorX::Constant(4, 2.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  NewtonOptions options = until_steps_below(1e-10);
  Workspace workspace;
  int calls = 0;
  const NewtonExtras extras{.after_step = [&](const VectorX&) {
    ++calls;
    return true;
  }};
  const NewtonSummary summary = minimize(DoubleWell(1), x, dofs, VectorX(), system, options, workspace, extras);
  EXPECT_TRUE(summary.converged());
  EXPECT_EQ(calls, summary.iterations);
}

TEST(Newton, EndsBeforeTheNextIterationWhereItIsCancelled) {
  VectorX x = VectorX::Constant(4, 2.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  DenseSystem system;
  std::atomic<bool> cancel = false;
  NewtonOptions options = until_steps_below(1e-10);
  options.cancel = &cancel;
  Workspace workspace;
  int calls = 0;
  const NewtonExtras extras{.after_step = [&](const VectorX&) {
    cancel = ++calls == 2;
    return true;
  }};
  const NewtonSummary summary = minimize(DoubleWell(1), x, dofs, VectorX(), system, options, workspace, extras);
  EXPECT_EQ(summary.termination, Termination::cancelled);
  EXPECT_FALSE(summary.converged());
  EXPECT_EQ(summary.iterations, 2);
  EXPECT_EQ(calls, 2);
}

TEST(Newton, MeasuresGradientsAndStepsInTheNormOfItsOptions) {
  const VectorX start = VectorX::LinSpaced(4, 1.5, 3.0), weights = VectorX::LinSpaced(4, 1.0, 4.0);
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  Workspace workspace;
  VectorX gradient = VectorX::Zero(4);
  DoubleWell(1).add_gradient(start, gradient, workspace);
  const auto summary_of = [&](NewtonOptions options) {
    VectorX x = start;
    DenseSystem system;
    return minimize(DoubleWell(1), x, dofs, VectorX(), system, options, workspace, {.norm_weights = {weights.data(), 4}});
  };
  const auto gradient_norm = [&](NewtonNorm norm) {
    const NewtonSummary summary = summary_of({.norm = norm, .first_gradient_tolerance = 1e300});
    EXPECT_EQ(summary.termination, Termination::gradient);
    return summary.gradient_norm;
  };
  EXPECT_DOUBLE_EQ(gradient_norm(NewtonNorm::euclidean), gradient.norm());
  EXPECT_DOUBLE_EQ(gradient_norm(NewtonNorm::l2), std::sqrt((gradient.array().square() / weights.array()).sum()));
  EXPECT_DOUBLE_EQ(gradient_norm(NewtonNorm::linf), (gradient.array() / weights.array()).abs().maxCoeff());
  const auto step_norm = [&](NewtonNorm norm) {
    const NewtonSummary summary = summary_of({.norm = norm, .step_tolerance = 1e300});
    EXPECT_EQ(summary.termination, Termination::step);
    return summary.step_norm;
  };
  const double euclidean = step_norm(NewtonNorm::euclidean);
  EXPECT_GT(step_norm(NewtonNorm::l2), euclidean);  // weights of 1 to 4
  EXPECT_LT(step_norm(NewtonNorm::l2), 2 * euclidean);
  EXPECT_LE(step_norm(NewtonNorm::linf), euclidean);
}

TEST(Newton, StopsByEachTestAndNamesIt) {
  const DofMap dofs = DofMap::from_held(std::vector<char>(4, 0));
  const auto stop = [&](NewtonOptions options) {
    VectorX x = VectorX::LinSpaced(4, 1.5, 3.0);
    DenseSystem system;
    Workspace workspace;
    const NewtonSummary summary = minimize(DoubleWell(1), x, dofs, VectorX(), system, options, workspace);
    EXPECT_TRUE(summary.converged());
    EXPECT_GT(summary.iterations, 0);
    EXPECT_LT((x.array() - 1).abs().maxCoeff(), 0.1);
    return summary.termination;
  };
  NewtonOptions none;
  none.gradient_tolerance = none.first_gradient_tolerance = 0;
  const auto with = [&](auto member, auto value) {
    NewtonOptions options = none;
    options.*member = value;
    return options;
  };
  EXPECT_EQ(stop(with(&NewtonOptions::relative_gradient_tolerance, 1e-3)), Termination::gradient);
  EXPECT_EQ(stop(with(&NewtonOptions::relative_step_tolerance, 1e-3)), Termination::step);
  EXPECT_EQ(stop(with(&NewtonOptions::decrement_tolerance, 1e-6)), Termination::decrement);
  NewtonOptions by_energy = with(&NewtonOptions::energy_tolerance, 1e-6);
  by_energy.energy_steps = 1;
  EXPECT_EQ(stop(by_energy), Termination::energy);
}

/// 1/2 |x - target|^2.
class Pull final : public Energy {
 public:
  explicit Pull(VectorX target) : target_(std::move(target)) {}
  std::string_view name() const override { return "pull"; }
  double value(ConstVectorView x, Workspace&) const override { return (x - target_).squaredNorm() / 2; }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override { gradient += x - target_; }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<2> block = Mat<2>::Identity();
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, block.data());
  }

 private:
  VectorX target_;
};

/// Points fall on a floor from heights that differ by a factor of a thousand: each is stopped on its own.
/// Two coordinates on a spring so stiff that the Hessian is singular in floating point, and two that are soft; all go to 1.
class StiffPair final : public Energy {
 public:
  std::string_view name() const override { return "stiff pair"; }
  double value(ConstVectorView x, Workspace&) const override {
    return kStiff / 2 * std::pow(x[0] - x[1], 2) + kSoft / 2 * (x.array() - 1).square().sum();
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    const double force = kStiff * (x[0] - x[1]);
    gradient[0] += force;
    gradient[1] -= force;
    gradient.array() += kSoft * (x.array() - 1);
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    Mat<2> pair = kSoft * Mat<2>::Identity(), soft = pair;
    pair(0, 0) += kStiff, pair(1, 1) += kStiff, pair(0, 1) -= kStiff, pair(1, 0) -= kStiff;
    sink.add<2>(std::array{0}, pair.data());
    sink.add<2>(std::array{1}, soft.data());
  }

 private:
  static constexpr double kStiff = 0x1p58, kSoft = 1e-3;
};

TEST(Newton, WhatIsStiffHoldsNothingElse) {
  NewtonOptions options;
  options.step_tolerance = 1e-6;
  VectorX x = VectorX::Zero(4);
  x[0] = x[1] = 1;
  DenseSystem system;
  Workspace workspace;
  const auto summary =
      minimize(StiffPair(), x, DofMap::from_held(std::vector<char>(4, 0)), VectorX(), system, options, workspace);
  EXPECT_TRUE(summary.converged());
  EXPECT_NEAR(x[2], 1, 1e-6);
  EXPECT_NEAR(x[3], 1, 1e-6);
}

TEST(Newton, StepsThatAShiftMakesShortAreNoEnd) {
  NewtonOptions options;
  options.step_tolerance = 1e-6;
  options.max_iterations = 30;
  VectorX x = VectorX::Zero(4);
  DenseSystem system;
  Workspace workspace;
  const auto summary =
      minimize(StiffPair(), x, DofMap::from_held(std::vector<char>(4, 0)), VectorX(), system, options, workspace);
  EXPECT_EQ(summary.termination, Termination::iterations) << x.transpose();
}

TEST(Newton, ContactOfOneVertexStopsNoOther) {
  constexpr int n = 20;
  std::vector<Vec<2>> rest;
  std::vector<int> points;
  for (int i = 0; i < n; ++i) {
    rest.emplace_back(i, 0.02 * std::pow(1.4, i));
    points.push_back(i);
  }
  rest.insert(rest.end(), {{-1, 0}, {n, 0}});
  std::vector<char> counts(n, 1), held(2 * n, 0);
  counts.resize(n + 2, 0);
  held.resize(2 * n + 4, 1);
  const auto surface = make_collision_surface<2>({{n, n + 1}}, {}, points, rest, counts);
  VectorX x(2 * n + 4);
  for (int v = 0; v < n + 2; ++v) x.segment<2>(2 * v) = rest[v];
  VectorX target = x;
  for (int v = 0; v < n; ++v) target[2 * v + 1] = -0.5;
  EnergySum energy;
  energy.add(std::make_shared<Pull>(target));
  energy.add(std::make_shared<ContactEnergy<2>>(surface, ContactOptions{.enabled = true, .dhat = 0.01}, 1e7, 1));
  DenseSystem system;
  Workspace workspace;
  const NewtonSummary summary = minimize(energy, x, DofMap::from_held(held), VectorX(), system, {}, workspace);
  EXPECT_TRUE(summary.converged()) << summary.message;
  EXPECT_LT(summary.iterations, 15);
  for (int v = 0; v < n; ++v) EXPECT_NEAR(x[2 * v + 1], x[1], 1e-8);
}

}  // namespace
}  // namespace itr
