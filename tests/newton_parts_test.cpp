// SPDX-License-Identifier: MIT
// The parts of the minimiser, each on its own, on energies of a few unknowns.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "double_well.hpp"
#include "newton/saddle.hpp"

namespace itr {
namespace {

/// Solves exactly, and remembers what was asked. Where the caller is content with less, it says that it has no more.
class Recording final : public NewtonSystem {
 public:
  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    projections.push_back(psd);
    exact_.assemble(energy, x, psd, dofs, motion, workspace);
  }
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override {
    shifts.push_back(shift);
    this->asked.push_back(asked);
    linear::SystemReport report = NewtonSystem::solve(shift, rhs, asked, solution);
    if (report.outcome == linear::Outcome::ok) report.residual = asked.loose;
    return report;
  }
  linear::SystemReport factorize(const Shift& shift) override {
    ++factorizations;
    return exact_.factorize(shift);
  }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    return exact_.solve_again(rhs, solution);
  }
  std::string message() const override { return "recording"; }
  double diagonal_scale() const override { return exact_.diagonal_scale(); }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return exact_.curvature_of(shift, step); }

  std::vector<PsdProjection> projections;
  std::vector<Shift> shifts;
  std::vector<linear::Asked> asked;
  int factorizations = 0;

 private:
  DenseSystem exact_;
};

/// All that the parts of a solve refer to. The dofs of `held` move to `target`.
struct Parts {
  Parts(const Energy& energy, VectorX start, NewtonOptions given = {}, std::vector<char> held = {}, VectorX goal = {})
      : options(given), x(std::move(start)), target(std::move(goal)) {
    held.resize(x.size(), 0);
    dofs = DofMap::from_held(held);
    task.emplace(Task{energy, dofs, system, options, extras, workspace, Norms(dofs, options.norm, {}), summary});
    at.emplace(*task, x);
    motion.emplace(*task, *at, target);
    convergence.emplace(*task, *at, *motion);
    direction.emplace(*task, *at, *motion, *convergence);
    search.emplace(*task, *at, *motion);
    saddle.emplace(*task, *at, *direction, *search);
    begin(0);
  }
  void begin(int iteration) {
    summary.iterations = iteration;
    motion->plan();
    at->update_gradient();
  }

  NewtonOptions options;
  NewtonExtras extras;
  VectorX x, target;
  DofMap dofs;
  Recording system;
  Workspace workspace;
  NewtonSummary summary;
  std::optional<Task> task;
  std::optional<Iterate> at;
  std::optional<DirichletContinuation> motion;
  std::optional<Convergence> convergence;
  std::optional<Direction> direction;
  std::optional<Search> search;
  std::optional<Saddle> saddle;
};

TEST(Iterate, KnowsWhereItIs) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(2, 3));
  EXPECT_EQ(parts.at->value(), 4 - 2 + 81 / 4.0 - 4.5);
  EXPECT_EQ(parts.at->gradient(), VectorX(Vec<2>(6, 24)));
  EXPECT_EQ(parts.at->gradient_norm(), std::sqrt(36.0 + 576));
  const int before = parts.at->revision();
  parts.at->move_to(Vec<2>(1, 1), -0.5);
  EXPECT_GT(parts.at->revision(), before);
  EXPECT_EQ(parts.x, VectorX(Vec<2>(1, 1)));
  EXPECT_EQ(parts.at->value(), -0.5);
}

TEST(Iterate, SaysWhatIsBelowItsResolution) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(2, 3));
  Step& step = parts.direction->step();
  const auto is_unresolved = [&](double length) {
    step.direction = -length * parts.at->gradient();
    return parts.at->is_unresolved(step);
  };
  EXPECT_FALSE(is_unresolved(1e-3));
  EXPECT_FALSE(is_unresolved(1e-14));
  EXPECT_TRUE(is_unresolved(1e-17));
  Parts at_end(energy, Vec<2>(1 + 1e-9, 1));
  at_end.direction->step().direction = -at_end.at->gradient();
  EXPECT_TRUE(at_end.at->is_unresolved(at_end.direction->step())) << "the energy does not resolve 1e-18";
}

TEST(DirichletContinuation, TakesTurnsWithTheBodies) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1, 1), {}, {0, 1}, Vec<2>(7, 2));
  DirichletContinuation& motion = *parts.motion;
  EXPECT_TRUE(motion.is_advancing());
  EXPECT_EQ(motion.motion().step, VectorX(Vec<2>(0, 1))) << "unknowns have no target";
  EXPECT_TRUE(motion.takes_turns(false));
  motion.plan();
  EXPECT_FALSE(motion.is_advancing() || motion.is_done()) << "it waits";
  EXPECT_EQ(motion.motion().step.size(), 0);
  EXPECT_FALSE(motion.takes_turns(false)) << "the bodies have not relaxed";
  EXPECT_TRUE(motion.takes_turns(true));
  motion.plan();
  EXPECT_TRUE(motion.is_advancing());
  motion.wait();
  motion.plan();
  EXPECT_FALSE(motion.is_advancing());
  motion.plan();
  EXPECT_TRUE(motion.is_advancing()) << "it waits once";
}

TEST(DirichletContinuation, GivesUpWhereItIsBlocked) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1, 1), {}, {0, 1}, Vec<2>(1, 2));
  DirichletContinuation& motion = *parts.motion;
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(motion.takes_turns(true));
  EXPECT_FALSE(motion.is_blocked_for_good());
  motion.note_fraction(0.5);
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(motion.takes_turns(true));
  EXPECT_FALSE(motion.is_blocked_for_good()) << "it has advanced in between";
  EXPECT_TRUE(motion.takes_turns(true));
  EXPECT_TRUE(motion.is_blocked_for_good());

  EXPECT_FALSE(motion.is_stuck()) << "the way left is looked at for the first time";
  parts.begin(49);
  EXPECT_FALSE(motion.is_stuck());
  parts.begin(50);
  EXPECT_TRUE(motion.is_stuck());
  EXPECT_NE(motion.describe_distance_left().find("100 % of their way is left"), std::string::npos)
      << motion.describe_distance_left();
}

TEST(DirichletContinuation, PutsDofsAtTheirTargetsWithinTheTolerance) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.step_tolerance = 1e-3;
  Parts parts(energy, Vec<2>(1, 1), options, {0, 1}, Vec<2>(1, 1 + 1e-4));
  EXPECT_TRUE(parts.motion->is_done());
  EXPECT_EQ(parts.x[1], 1 + 1e-4);
  EXPECT_EQ(parts.at->value(), energy.value(parts.x, parts.workspace));
  const DoubleWell walled(1, 0, 1 + 1e-5);
  Parts blocked(walled, Vec<2>(1, 1), options, {0, 1}, Vec<2>(1, 1 + 1e-4));
  EXPECT_TRUE(blocked.motion->is_advancing());
  EXPECT_EQ(blocked.x[1], 1);
}

/// The merit falls along the way to the target even where the energy rises.
TEST(DirichletContinuation, RaisesItsPenalty) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1, 1), {}, {0, 1}, Vec<2>(1, 2));
  ASSERT_TRUE(parts.direction->find());
  const double slope = 5;
  parts.motion->raise_penalty(parts.direction->step(), slope);
  EXPECT_LE(parts.motion->merit_slope(slope), -slope);
  EXPECT_LT(parts.motion->merit_change(slope, 1), 0);
  Parts still(energy, Vec<2>(1, 1));
  still.motion->raise_penalty(still.direction->step(), slope);
  EXPECT_EQ(still.motion->merit_slope(slope), slope);
  EXPECT_EQ(still.motion->merit_change(slope, 1), slope);
}

TEST(Convergence, HasATighterGradientAtTheStart) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.gradient_tolerance = 1e-2;
  options.first_gradient_tolerance = 1e-4;
  Parts parts(energy, Vec<2>(1 + 1e-3, 1), options);
  EXPECT_FALSE(parts.convergence->has_small_gradient());
  parts.begin(1);
  EXPECT_TRUE(parts.convergence->has_small_gradient());
  options.gradient_tolerance = 0;
  options.relative_gradient_tolerance = 0.1;
  Parts relative(energy, Vec<2>(2, 1), options);
  EXPECT_FALSE(relative.convergence->has_small_gradient());
  EXPECT_DOUBLE_EQ(relative.convergence->gradient_asked(), 0.1 * 6);
  relative.at->move_to(Vec<2>(1.1, 1), 0);
  relative.begin(1);
  EXPECT_TRUE(relative.convergence->has_small_gradient());
}

TEST(Convergence, WaitsForHeldDofs) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.gradient_tolerance = options.first_gradient_tolerance = options.decrement_tolerance = 1e9;
  Parts moving(energy, Vec<2>(2, 1), options, {0, 1}, Vec<2>(2, 2)), still(energy, Vec<2>(2, 1), options);
  for (Parts* parts : {&moving, &still}) {
    ASSERT_TRUE(parts->direction->find());
    EXPECT_EQ(parts->convergence->has_small_gradient(), parts == &still);
    EXPECT_EQ(parts->convergence->test(parts->direction->step()).has_value(), parts == &still);
  }
}

/// The gradient times `shrinks` in each step: how many steps below round-off are taken until the solve ends, up to 100.
int count_unresolved(double shrinks) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  Parts parts(energy, Vec<2>(1 + 1e-9, 1), options);
  Step& step = parts.direction->step();
  int count = 0;
  bool ends = false;
  for (double distance = 1e-9; !ends && count < 100; distance *= shrinks, ++count) {
    parts.at->move_to(Vec<2>(1 + distance, 1), -0.5);
    parts.begin(count);
    step.direction = -parts.at->gradient() / 2;
    step.norm = step.direction.norm();
    ends = parts.convergence->test(step) == Termination::round_off;
  }
  return count;
}

TEST(Convergence, EndsWhereStepsBelowRoundOffDoNotShrinkTheGradient) {
  EXPECT_EQ(count_unresolved(1), 5);
  EXPECT_EQ(count_unresolved(0.95), 20);
  EXPECT_EQ(count_unresolved(0.8), 20);
}

TEST(Convergence, CountsStepsBelowRoundOffInARow) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  Parts parts(energy, Vec<2>(2, 3), options);
  Step& step = parts.direction->step();
  const auto ends = [&](double length) {
    step.direction = -length * parts.at->gradient();
    step.norm = step.direction.norm();
    return parts.convergence->test(step).has_value();
  };
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(ends(1e-18));
  EXPECT_FALSE(ends(1e-3));
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(ends(1e-18)) << "a step in between begins the count anew";
  EXPECT_TRUE(ends(1e-18));
}

TEST(Convergence, CountsIterationsThatHardlyChangeTheEnergy) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.energy_tolerance = 0.1;
  options.energy_steps = 2;
  Parts parts(energy, Vec<2>(2, 3), options);
  const double value = parts.at->value();
  EXPECT_FALSE(parts.convergence->has_stalled(value + 0.05));
  EXPECT_FALSE(parts.convergence->has_stalled(value + 0.5));
  EXPECT_FALSE(parts.convergence->has_stalled(value + 0.05));
  EXPECT_TRUE(parts.convergence->has_stalled(value + 0.05));
}

TEST(Convergence, ForeseesTheDecrementByTheGradient) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1.01, 1));
  ASSERT_TRUE(parts.direction->find());
  parts.convergence->note_decrement(parts.direction->step());
  const double before = parts.convergence->decrement();
  EXPECT_NEAR(before, 1e-4, 1e-5);
  parts.at->move_to(Vec<2>(1.001, 1), 0);
  parts.at->update_gradient();
  parts.convergence->predict_decrement();
  EXPECT_NEAR(parts.convergence->decrement(), 0.01 * before, 1e-3 * before);
}

TEST(Direction, IsOfTheTrueHessianWhereThatIsDefinite) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1.1, 1));
  ASSERT_TRUE(parts.direction->find());
  EXPECT_EQ(parts.system.projections, std::vector{PsdProjection::none});
  const double expected = -(std::pow(1.1, 3) - 1.1) / (3 * 1.21 - 1);
  EXPECT_NEAR(parts.direction->step().direction[0], expected, 1e-15);
  EXPECT_NEAR(parts.direction->step().norm, std::abs(expected), 1e-15);
  EXPECT_NEAR(parts.direction->step().curvature, 2 * parts.at->decrement_of(parts.direction->step()), 1e-15);
  EXPECT_EQ(parts.direction->indefinite(), 0);
  EXPECT_TRUE(parts.direction->find_projected()) << "for a search that has failed";
  EXPECT_FALSE(parts.direction->find_projected()) << "once";
}

TEST(Direction, IsProjectedForSomeIterationsWhereTheTrueHessianIsIndefinite) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.projected_iterations = 3;
  Parts parts(energy, Vec<2>(0.1, 0.1), options);
  using enum PsdProjection;
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(parts.direction->find());
  EXPECT_EQ(parts.system.projections, (std::vector{none, clamp, clamp, clamp, none, clamp}));
  EXPECT_EQ(parts.direction->indefinite(), 2);
}

TEST(Direction, IsShiftedWhereItIsNotProjected) {
  const DoubleWell energy(1);
  NewtonOptions options;
  options.project_to_psd = false;
  Parts parts(energy, Vec<2>(0.1, 0.1), options);
  ASSERT_TRUE(parts.direction->find());
  const auto& shifts = parts.system.shifts;
  EXPECT_EQ(shifts.front().value, 0);
  for (std::size_t i = 2; i < shifts.size(); ++i)
    if (shifts[i].is_fraction == shifts[i - 1].is_fraction) {
      EXPECT_NEAR(shifts[i].value / shifts[i - 1].value, 10, 1e-12);
    }
  EXPECT_TRUE(shifts[1].is_fraction);
  EXPECT_FALSE(shifts.back().is_fraction) << "shares of a negative entry do not make it positive";
  EXPECT_GT(shifts.back().value, 0.97);
  EXPECT_LT(parts.direction->step().direction.dot(parts.at->gradient()), 0);
}

TEST(Direction, AsksForAsManyDigitsAsItCanUse) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(3, 3));
  Direction& direction = *parts.direction;
  ASSERT_TRUE(direction.find());
  EXPECT_GT(parts.system.asked.back().loose, kTightResidual);
  EXPECT_TRUE(direction.is_loose());
  EXPECT_TRUE(direction.tighten());
  EXPECT_TRUE(parts.system.asked.back().goes_on);
  EXPECT_EQ(parts.system.asked.back().loose, kTightResidual);
  EXPECT_FALSE(direction.is_loose());
  ASSERT_TRUE(direction.find());
  EXPECT_EQ(parts.system.asked.back().loose, kTightResidual) << "once tight, always tight";
  EXPECT_FALSE(parts.system.asked.back().goes_on);

  Parts late(energy, Vec<2>(3, 3));
  late.begin(8);
  ASSERT_TRUE(late.direction->find());
  EXPECT_EQ(late.system.asked.back().loose, kTightResidual) << "after many iterations";
  Parts saddle(energy, Vec<2>(0.1, 3));
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(saddle.direction->find());
  EXPECT_EQ(saddle.system.asked.back().loose, kTightResidual) << "loose solves may overlook negative curvature";
}

TEST(Direction, RemembersWhatTheHessianIsWhileTheIterateStays) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(0.1, 0.1));
  ASSERT_TRUE(parts.direction->find());
  const int before = parts.system.factorizations;
  EXPECT_TRUE(parts.direction->is_hessian_indefinite());
  EXPECT_EQ(parts.system.factorizations, before);
  parts.at->move_to(Vec<2>(1, 1), -0.5);
  EXPECT_FALSE(parts.direction->is_hessian_indefinite());
  EXPECT_EQ(parts.system.factorizations, before + 1);
}

TEST(Search, StopsBeforeWhatIsInTheWay) {
  const DoubleWell energy(4, 0, 1.5);
  Parts parts(energy, Vec<2>(1.4, 1.4));
  ASSERT_TRUE(parts.direction->find());
  const double before = parts.at->value();
  ASSERT_TRUE(parts.search->along(parts.direction->step()));
  EXPECT_LT(parts.at->value(), before);
  EXPECT_LE(parts.x.maxCoeff(), 1.5);
  EXPECT_EQ(parts.summary.blocked, 1);
  EXPECT_EQ(parts.summary.blocked_step.size(), 0) << "the first iterations are not explained";
  parts.begin(20);
  ASSERT_TRUE(parts.direction->find());
  ASSERT_TRUE(parts.search->along(parts.direction->step()));
  EXPECT_EQ(parts.summary.blocked, 2);
  EXPECT_EQ(parts.summary.blocked_step, parts.direction->step().direction);
}

TEST(Search, StaysWhereNothingLowersTheEnergy) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(2, 2));
  parts.direction->step().direction = parts.at->gradient();
  EXPECT_FALSE(parts.search->along(parts.direction->step()));
  EXPECT_EQ(parts.x, VectorX(Vec<2>(2, 2)));
  parts.direction->step().direction = -0.1 * parts.at->gradient();
  EXPECT_TRUE(parts.search->along(parts.direction->step()));
  EXPECT_LT(parts.x[0], 2);
}

TEST(Search, GoesOnWhereTheEnergyFallsInAStraightLine) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1e-3, 1e-3));
  ASSERT_TRUE(parts.direction->find());
  const double one_step = 1e-3 + parts.direction->step().direction[0];
  ASSERT_TRUE(parts.search->along(parts.direction->step()));
  EXPECT_LT(one_step, 0.1);
  EXPECT_GT(parts.x[0], 0.1);
}

TEST(Search, PutsHeldDofsExactlyAtTheirTargets) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(1, 0.1), {}, {0, 1}, Vec<2>(1, 0.7));
  ASSERT_TRUE(parts.direction->find());
  ASSERT_TRUE(parts.search->along(parts.direction->step()));
  EXPECT_EQ(parts.x[1], 0.7);
}

TEST(Saddle, IsLeftDownwards) {
  const DoubleWell energy(1);
  Parts parts(energy, Vec<2>(0, 1));
  ASSERT_TRUE(parts.direction->find());
  EXPECT_TRUE(parts.saddle->is_here());
  const double before = parts.at->value();
  EXPECT_TRUE(parts.saddle->leave());
  EXPECT_LT(parts.at->value(), before);
  EXPECT_GT(std::abs(parts.x[0]), 1e-6);
  EXPECT_NEAR(parts.x[1], 1, 0.1);
  Parts minimum(energy, Vec<2>(1, 1));
  ASSERT_TRUE(minimum.direction->find());
  EXPECT_FALSE(minimum.saddle->leave());
  EXPECT_EQ(minimum.x, VectorX(Vec<2>(1, 1)));
}

}  // namespace
}  // namespace itr
