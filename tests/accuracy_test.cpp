// SPDX-License-Identifier: MIT
// Runs and their error bars where a scene asks for an accuracy.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

#include "apps/itr/accuracy.hpp"
#include "simulation/remesh_step.hpp"

namespace itr::cli {
namespace {

constexpr double kFirst = 1e-4;
const TimeOptions kIncrements{.quasistatic = true, .adaptive = {.enabled = true}};

AccuracyWatch watch(double accuracy, const TimeOptions& time = kIncrements, bool follows = true) {
  scene::Accuracy asked;
  asked.value = accuracy;
  asked.follows_bars = follows;
  RemeshOptions remesh;
  remesh.enabled = true;
  remesh.relative_tolerance = kFirst;
  return {asked, time, remesh, true};
}

/// A step whose mesh is wrong by this part of an energy of 1 J.
StepReport step(double mesh, double dhat = 0) {
  StepReport report;
  report.errors.is_asked = true;
  report.errors.energy[0] = -mesh;
  report.errors.energy[1] = -dhat;
  report.energy.elastic = 1;
  return report;
}

TEST(Accuracy, StepWithTooLargeABarIsTakenAgainOnAFinerMesh) {
  AccuracyWatch run = watch(0.01);
  const auto finer = run.finer(step(0.024), 1, true);
  ASSERT_TRUE(finer);
  EXPECT_DOUBLE_EQ(*finer, kFirst / 16) << "four times the error, which goes with the root";
  EXPECT_FALSE(run.finer(step(0.007), 1, true)) << "near enough";
  run.add(step(0.007), 1);
  EXPECT_DOUBLE_EQ(run.relative_tolerance(), kFirst / 16);
}

TEST(Accuracy, TrialsEndWhereTheyDoNotHelp) {
  AccuracyWatch run = watch(0.01);
  EXPECT_TRUE(run.finer(step(0.1), 1, true));
  EXPECT_FALSE(run.finer(step(0.0995), 1, true));
  run.add(step(0.0995), 1);
  EXPECT_NE(run.describe("", "").find("was no finer"), std::string::npos) << run.describe("", "");
  int trials = 0;
  for (double error = 0.4; run.finer(step(error), 1, true); error /= 2) ++trials;
  EXPECT_EQ(trials, 3);
}

TEST(Accuracy, FinerMeshThanNeededIsGivenUp) {
  AccuracyWatch run = watch(0.01);
  run.add(step(0.0015), 1);
  EXPECT_DOUBLE_EQ(run.relative_tolerance(), kFirst) << "the energy grows fast";
  EXPECT_FALSE(run.finer(step(0.0015), 1, false));
  run.add(step(0.0015), 1);
  EXPECT_DOUBLE_EQ(run.relative_tolerance(), 4 * kFirst);
  AccuracyWatch fixed = watch(0.01, kIncrements, false);
  EXPECT_FALSE(fixed.finer(step(1), 1, true));
  fixed.add(step(0.0001), 1);
  EXPECT_DOUBLE_EQ(fixed.relative_tolerance(), kFirst) << "of a scene that sets it";
}

TEST(Accuracy, EarlyStepsOfALoadThatGrowsDoNotRule) {
  AccuracyWatch run = watch(0.01);
  EXPECT_FALSE(run.finer(step(0.5), 1, false));
  run.add(step(0.5), 1);
  EXPECT_FALSE(run.finer(step(0.5), 2, false));
  EXPECT_TRUE(run.finer(step(0.5), 2, true));
}

TEST(Accuracy, EndSaysWhetherItWasReached) {
  AccuracyWatch run = watch(0.02);
  run.add(step(0.004, 0.001), 1);
  run.add(step(0.02, 0.002), 2);
  EXPECT_EQ(run.describe("", ""), "accuracy of the energy: 2 % asked, 1.1 % estimated (mesh 1, dhat 0.1): reached");
  run.add(step(0.05, 0.06), 2);
  EXPECT_EQ(
      run.describe("", ""),
      "accuracy of the energy: 2 % asked, 5.5 % estimated (mesh 2.5, dhat 3): not reached: a smaller /contact/dhat first");
  StepReport none = step(0);
  none.errors.no_bar = "the solution is not stable";
  run.add(none, 2);
  run.add(step(3), 2);
  EXPECT_NE(run.describe("", "").find("5.5 % estimated"), std::string::npos);
  EXPECT_NE(run.describe("", "").find("no bar in 2 of 5 steps: it would exceed half of the energy"), std::string::npos);
  run.add(none, 2);
  EXPECT_NE(run.describe("", "").find("no bar in 3 of 6 steps: the solution is not stable"), std::string::npos);
}

TEST(Accuracy, ErrorInTimeIsByTheIntegrator) {
  const auto percent = [](TimeOptions time, int steps) {
    time.adaptive.enabled = true;
    time.adaptive.tolerance = 0.01;
    AccuracyWatch run = watch(0.1, time);
    StepReport moving = step(0);
    moving.time_error = 1e-3;
    for (int i = 0; i < steps; ++i) run.add(moving, 1);
    const std::string text = run.describe("", "");
    return std::stod(text.substr(text.find("(time ") + 6));
  };
  EXPECT_NEAR(percent({.integrator = Integrator::bdf}, 100), 1, 1e-9) << "independent of each other";
  EXPECT_NEAR(percent({.integrator = Integrator::implicit_euler}, 100), 20, 1e-9) << "all of one sign";
  EXPECT_NEAR(percent({.quasistatic = true}, 100), 1e-4, 1e-9) << "between two increments";
}

/// The force at its peak counts, and the displacement.
TEST(Accuracy, OfAForceOrAPoint) {
  scene::Accuracy asked;
  asked.value = 0.01;
  asked.of = "plate";
  AccuracyWatch run(asked, kIncrements, {}, false);
  const std::string errors = "_error_mesh,all_x_error_dhat,all_x_error_friction,all_x_error_lag,all_x_error_solver";
  const std::string forces = "step,t,name,all_x,all_x" + errors + "\n1,0,plate,10,1,1,1,1,1\n2,1,plate,100,-3,0.5,0,0,0\n";
  EXPECT_NE(run.describe(forces, "").find("accuracy of plate: 1 % asked, 3.5 % estimated (mesh 3, dhat 0.5): not reached"),
            std::string::npos)
      << run.describe(forces, "");
  EXPECT_NE(run.describe("", "").find("no bar"), std::string::npos);
  EXPECT_NE(run.describe("step,t,name,all_x\n1,0,plate,10\n", "").find("no bar"), std::string::npos)
      << "nobody asked for any";
}

TEST(Accuracy, RunWithoutBarsOrWithStepsOfTheSceneSaysSo) {
  AccuracyWatch run = watch(0.01, {.quasistatic = true});
  StepReport without = step(0);
  without.errors = {};
  run.add(without, 1);
  EXPECT_NE(run.describe("", "").find("no bar in any step: /output/error_bars is false"), std::string::npos);
  const auto says_so = [&] {
    return run.describe("", "").find("without the error of the steps, as the scene sets /time/dt") != std::string::npos;
  };
  run.add(step(0.001), 1);
  EXPECT_FALSE(says_so()) << "the bars know it: 0";
  StepReport unknown = step(0.002);
  unknown.errors.energy[static_cast<std::size_t>(ErrorSource::time)] = std::nan("");
  run.add(unknown, 1);
  EXPECT_TRUE(says_so());
}

TEST(Accuracy, EasyStepsDoNotPutOffAFinerMesh) {
  AccuracyWatch run = watch(0.01);
  for (int i = 0; i < 50; ++i) run.add(step(1e-9), 1);
  const auto finer = run.finer(step(0.1), 1, false);
  ASSERT_TRUE(finer);
  EXPECT_LT(*finer, kFirst);
}

TEST(Accuracy, ResumedRunKnowsTheStepsBefore) {
  const Units units("mm", "t", "s");
  AccuracyWatch through = watch(0.01), resumed = watch(0.01);
  std::ostringstream log;
  double largest = 0;
  for (const double error : {0.004, 0.001, 0.1, 0.09, 0.06, 0.001}) {
    StepReport now = step(error);
    now.energy.elastic = largest = largest + 1;
    through.finer(now, largest, false);
    const double used = through.relative_tolerance();
    through.add(now, largest);
    const auto shown = [&](double value) { return units.from_si(value, "J"); };
    log << R"({"step":)" << largest << R"(,"energy":{"elastic":)" << shown(largest)
        << R"(,"contact":null},"split_tolerance":)" << shown(kStoredFraction * used * 1.1 * largest)
        << R"(,"bars":{"energy":{"mesh":)" << shown(-error) << "}}}\n";
  }
  EXPECT_NE(through.relative_tolerance(), kFirst);
  resumed.go_on(log.str(), units);
  EXPECT_DOUBLE_EQ(resumed.relative_tolerance(), through.relative_tolerance());
  EXPECT_EQ(resumed.describe("", ""), through.describe("", ""));
}

}  // namespace
}  // namespace itr::cli
