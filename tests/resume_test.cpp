// SPDX-License-Identifier: MIT
// Nothing is lost: the command is killed, interrupted and denied its disk, and goes on to the same end, bit for bit.
#include <gtest/gtest.h>

#include <cmath>

#include "interrupt.hpp"
#include "itr/output.hpp"
#include "output/certify.hpp"

namespace itr::output {
namespace {

class ResumeTest : public InterruptTest, public ::testing::WithParamInterface<Case> {};

TEST_P(ResumeTest, KilledRunGoesOnBitForBit) {
  const Case& which = GetParam();
  const fs::path whole = folder / "whole", killed = folder / "killed";
  ASSERT_EQ(start(arguments(which, whole, 30)).wait(), 0) << text_of(folder / "log");
  ASSERT_EQ(results_of(whole).size(), static_cast<std::size_t>(which.steps + 1));

  // With a period of 0 the newest frame is the state; with 0.05 s the run has to go back to an older one.
  ASSERT_EQ(stop_at(start(arguments(which, killed, 0)), killed, which.steps / 3, SIGKILL), -SIGKILL);
  expect_readable(killed);
  ASSERT_EQ(stop_at(start(arguments(which, killed, 0.05, true)), killed, 2 * which.steps / 3, SIGKILL), -SIGKILL);
  expect_readable(killed);
  const Command last = start(arguments(which, killed, 0.05, true));
  ASSERT_EQ(last.wait(), 0) << last.said();
  EXPECT_NE(last.said().find("going on after step"), std::string::npos) << last.said();
  expect_same_results(whole, killed);
  EXPECT_EQ(summary_of(whole), summary_of(killed));

  if (which.name == std::string("cubes_remeshed")) {
    const auto saved = find_saved_state(killed);
    const hdf5::Session session;
    EXPECT_TRUE(hdf5::File::open(saved->file).contains("/checkpoint/strata"));
  }

  const Command again = start(arguments(which, killed, 0.05, true));
  ASSERT_EQ(again.wait(), 0) << again.said();
  EXPECT_EQ(summary_of(whole), summary_of(killed)) << "of a finished run that was resumed";
}

TEST_F(InterruptTest, FinishesTheStepSavesAndSaysHowToGoOn) {
  const fs::path whole = folder / "whole", stopped = folder / "stopped";
  ASSERT_EQ(start(arguments(kStopped, whole, 30)).wait(), 0);
  const Command first = start(arguments(kStopped, stopped, 30));
  ASSERT_EQ(stop_at(first, stopped, 10, SIGINT), 3) << first.said();
  EXPECT_NE(first.said().find("interrupted after step"), std::string::npos) << first.said();
  EXPECT_NE(first.said().find("--resume"), std::string::npos) << first.said();
  const int steps = static_cast<int>(results_of(stopped).size());
  const Command second = start(arguments(kStopped, stopped, 30, true));
  ASSERT_EQ(second.wait(), 0) << second.said();
  EXPECT_NE(second.said().find(fmt::format("going on after step {}\n", steps - 1)), std::string::npos) << second.said();
  expect_same_results(whole, stopped);
}

TEST_F(InterruptTest, AnotherSceneIsRefusedWithWhatDiffers) {
  Case which = kStopped;
  const fs::path run = folder / "run";
  const Command first = start(arguments(which, run, 0));
  ASSERT_EQ(stop_at(first, run, 5, SIGINT), 3) << first.said();
  which.sets.push_back("/materials/nu=0.3");
  const Command second = start(arguments(which, run, 0, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("/materials/nu: was 0.45, is 0.3"), std::string::npos) << second.said();
  expect_readable(run);
}

/// A longer end is no other scene: a finished run goes on, to the bits of one that was longer from the start.
TEST_F(InterruptTest, ALongerEndGoesOnAfterAFinishedRun) {
  const fs::path whole = folder / "whole", run = folder / "run";
  Case which = kStopped;
  ASSERT_EQ(start(arguments(which, whole, 30)).wait(), 0);
  which.steps = 25;
  ASSERT_EQ(start(arguments(which, run, 30)).wait(), 0);
  ASSERT_EQ(results_of(run).size(), 26u);
  which.steps = kStopped.steps;
  const Command longer = start(arguments(which, run, 30, true));
  ASSERT_EQ(longer.wait(), 0) << longer.said();
  EXPECT_NE(longer.said().find("/time/time_steps: was 25, is 60"), std::string::npos) << longer.said();
  EXPECT_NE(longer.said().find("going on after step 25"), std::string::npos) << longer.said();
  expect_same_results(whole, run);
}

/// With tend and time_steps alone, another tend is another step.
TEST_F(InterruptTest, AnotherStepIsAnotherScene) {
  Case which = kStopped;
  which.time = R"("tend":0.0012)";
  const fs::path run = folder / "run";
  ASSERT_EQ(stop_at(start(arguments(which, run, 0)), run, 5, SIGINT), 3);
  which.time = R"("tend":0.0024)";
  const Command second = start(arguments(which, run, 0, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("/time/tend: was 0.0012, is 0.0024"), std::string::npos) << second.said();
}

/// A step that fails says what would change that, and that does change it.
TEST_F(InterruptTest, WhatAFailedStepRecommendsIsAllowedAndHelps) {
  Case which = kStopped;
  which.sets = kImpact + Arguments{"/space/remesh/enabled=false", "/time/step_cuts=0", "/solver/nonlinear/max_iterations=3"};
  const fs::path run = folder / "run";
  const Command first = start(arguments(which, run, 30));
  ASSERT_EQ(first.wait(), 3) << first.said();
  EXPECT_NE(first.said().find("--allow-changes and --set /time/step_cuts=8"), std::string::npos) << first.said();
  const int failed = static_cast<int>(results_of(run).size());
  ASSERT_LT(failed, which.steps);
  which.sets.back() = "/solver/nonlinear/max_iterations=300";
  const Command refused = start(arguments(which, run, 30, true));
  EXPECT_EQ(refused.wait(), 2);
  EXPECT_NE(refused.said().find("--allow-changes"), std::string::npos) << refused.said();
  const Command allowed = start(arguments(which, run, 30, true) + Arguments{"--allow-changes", "--solver", "eigen:llt"});
  EXPECT_EQ(allowed.wait(), 0) << allowed.said();
  EXPECT_EQ(results_of(run).size(), static_cast<std::size_t>(which.steps + 1));
}

TEST_F(InterruptTest, ResultsAreNotErasedUnasked) {
  Case which = kStopped;
  which.steps = 3;
  const fs::path run = folder / "run";
  ASSERT_EQ(start(arguments(which, run, 30)).wait(), 0);
  const auto lines = results_of(run);
  const Command again = start(arguments(which, run, 30));
  EXPECT_EQ(again.wait(), 2);
  EXPECT_NE(again.said().find("--overwrite"), std::string::npos) << again.said();
  EXPECT_NE(again.said().find("--resume"), std::string::npos) << again.said();
  EXPECT_EQ(results_of(run), lines);
  which.steps = 2;
  const Command over = start(arguments(which, run, 30) + Arguments{"--overwrite"});
  EXPECT_EQ(over.wait(), 0) << over.said();
  EXPECT_EQ(results_of(run).size(), 3u);
}

/// A step that remeshes for many seconds: splits of splits, each of which gains something.
Case slow_remeshing() {
  return {
      "slow",
      "masticator.json",
      5,
      R"("dt":0.05)",
      {"/geometry/0/n_refs=3", R"(/space/remesh/split={"acceptance_tolerance":1e-30,"max_depth":30,"min_edge_length":0})",
       R"j(/initial_conditions/velocity=[{"id":0,"value":["sin(7*x)",0]}])j"}};
}

TEST_F(InterruptTest, TheSecondSignalIsHeardWithinRemeshing) {
  const Case slow = slow_remeshing();
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 0));
  ASSERT_TRUE(wait_until([&] { return count_lines(run / "steps.jsonl") >= 1; })) << command.said();
  const int steps = count_lines(run / "steps.jsonl");
  std::this_thread::sleep_for(std::chrono::seconds(2));
  command.send(SIGINT);
  const auto heard = [&] { return command.said().find("finishing the step; again to stop now") != std::string::npos; };
  EXPECT_TRUE(wait_until(heard)) << command.said();
  const auto second = std::chrono::steady_clock::now();
  command.send(SIGINT);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - second, std::chrono::seconds(10));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  expect_readable(run);
  EXPECT_EQ(count_lines(run / "steps.jsonl"), steps) << "it was no long step";
  EXPECT_TRUE(find_saved_state(run).has_value());
}

/// Time that batch systems give after it: seconds.
TEST_F(InterruptTest, ATerminatedRunSavesTheLastWholeStep) {
  const Case slow = slow_remeshing();
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 30));
  ASSERT_TRUE(wait_until([&] { return count_lines(run / "steps.jsonl") >= 1; })) << command.said();
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const int steps = count_lines(run / "steps.jsonl");
  const auto signal = std::chrono::steady_clock::now();
  command.send(SIGTERM);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - signal, std::chrono::seconds(10));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  EXPECT_EQ(count_lines(run / "steps.jsonl"), steps);
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, steps - 1);
  EXPECT_TRUE(fs::exists(run / "summary.json"));
}

/// A step that looks at nothing for long: one factorisation by a slow solver.
TEST_F(InterruptTest, ATerminatedRunDoesNotWaitForAFactorisation) {
  const Case slow{"slow",
                  "cubes.json",
                  2,
                  R"("dt":0.01)",
                  {"/space/remesh/enabled=false", "/geometry/0/n_refs=3", "/geometry/1/n_refs=3",
                   "/solver/linear/solver=\"eigen:ldlt\""}};
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 30));
  ASSERT_TRUE(wait_until([&] { return count_lines(run / "steps.jsonl") >= 1; })) << command.said();
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const int steps = count_lines(run / "steps.jsonl");
  const auto signal = std::chrono::steady_clock::now();
  command.send(SIGTERM);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - signal, std::chrono::seconds(15));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, steps - 1);
  EXPECT_TRUE(fs::exists(run / "summary.json"));
}

/// The state before a step that fails is saved, and the reason is said, also where the frame of that state is being kept in
/// memory for the next one.
TEST_F(InterruptTest, AStepThatFailsDoesNotFailItsCheckpoint) {
  Case which = kStopped;
  which.time = R"("dt":2e-5,"quasistatic":true)";
  which.sets = {"/space/remesh/enabled=false", "/geometry/0/surface_selection=1", "/geometry/1/surface_selection=2",
                R"(/boundary_conditions/dirichlet_boundary=[{"id":1,"value":[0,0]}])",
                R"j(/boundary_conditions/obstacle_displacements=[{"id":2,"value":["-if(t-3e-5,0.2,0)",0]}])j"};
  const fs::path run = folder / "run";
  const Command command = start(arguments(which, run, 30));
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_NE(command.said().find("stopped in step 2"), std::string::npos) << command.said();
  EXPECT_NE(command.said().find("held vertices cannot reach their targets"), std::string::npos) << command.said();
  EXPECT_EQ(command.said().find("HDF5"), std::string::npos) << command.said();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, 1);
}

/// The limit on the size of a file fails a write as a full disk does; sim.xdmf meets it first.
class FullDiskTest : public InterruptTest, public ::testing::WithParamInterface<double> {};

TEST_P(FullDiskTest, StopsTheRunAndLeavesConsistentFiles) {
  const double period = GetParam();
  constexpr rlim_t kLimit = 60'000;
  const fs::path whole = folder / "whole", run = folder / "run";
  ASSERT_EQ(start(arguments(kStopped, whole, 30)).wait(), 0);
  const Command first(arguments(kStopped, run, period), folder / "log", kLimit);
  EXPECT_EQ(first.wait(), 3) << first.said();
  EXPECT_NE(first.said().find("File too large"), std::string::npos) << first.said();
  EXPECT_NE(first.said().find("space left"), std::string::npos) << first.said();
  expect_readable(run);
  for (const auto& entry : fs::recursive_directory_iterator(run)) EXPECT_NE(entry.path().extension(), ".tmp");
  const Command second = start(arguments(kStopped, run, 30, true));
  ASSERT_EQ(second.wait(), 0) << second.said();
  expect_same_results(whole, run);
}

INSTANTIATE_TEST_SUITE_P(CheckpointPeriod, FullDiskTest, ::testing::Values(0.0, 30.0));

TEST_F(InterruptTest, FolderThatCannotBeWrittenStopsTheRunBeforeItStarts) {
  std::ofstream(folder / "run") << "a file stands here";
  const Command command = start(arguments(kStopped, folder / "run", 30));
  EXPECT_EQ(command.wait(), 2);
  EXPECT_NE(command.said().find((folder / "run").string()), std::string::npos) << command.said();
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, ResumeTest,
    ::testing::Values(
        Case{"impact", "ball_wall.json", 40, R"("dt":2e-5)", kImpact},
        Case{"newmark", "ball_wall.json", 40, R"("dt":2e-5,"integrator":"ImplicitNewmark")",
             kImpact + Arguments{"/contact/friction_coefficient=0.3"}},
        Case{"bdf3", "ball_wall.json", 40, R"("dt":2e-5,"integrator":"BDF3")", kImpact},
        Case{"adaptive", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{"/space/remesh/enabled=false", "/contact/friction_coefficient=0.3",
                                 "/solver/contact/barrier_stiffness=\"adaptive\""}},
        Case{"adaptive_remeshed", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{"/contact/friction_coefficient=0.3", "/solver/contact/barrier_stiffness=\"adaptive\""}},
        Case{"cut_steps", "ball_wall.json", 40, R"("dt":2e-5,"step_cuts":6)",
             kImpact + Arguments{"/solver/nonlinear/max_iterations=8", "/space/remesh/enabled=false"}},
        Case{"damping", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{R"(/solver/rayleigh_damping=[{"form":"elasticity","stiffness_ratio":0.1}])"}},
        Case{
            "quadratic", "ball_wall.json", 40, R"("dt":2e-5)",
            kImpact + Arguments{"/space/remesh/enabled=false", "/space/discr_order=2", "/contact/friction_coefficient=0.3"}},
        Case{"cubes_quadratic",
             "cubes.json",
             20,
             R"("dt":0.01)",
             {R"(/space/discr_order=[{"id":1,"order":2}])"}},  // the other cube is linear
        Case{"cubes", "cubes.json", 45, R"("dt":0.01)", {}},   // 3D; they meet in step 14
        Case{"cubes_remeshed",
             "cubes.json",
             28,
             R"("dt":0.01)",
             {"/space/remesh/enabled=true", "/space/remesh/split/acceptance_tolerance=2e-4",
              "/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"}},
        Case{"cubes_curved",
             "cubes.json",
             28,
             R"("dt":0.01)",
             {"/space/remesh/enabled=true", "/space/remesh/split/acceptance_tolerance=2e-4",
              "/space/remesh/curve/enabled=true", "/space/remesh/swap/enabled=true"}},
        Case{"masticator_curved",
             "masticator.json",
             24,
             R"("dt":0.05)",
             {"/space/remesh/curve/enabled=true", "/space/remesh/straighten/enabled=true",
              "/space/remesh/split/acceptance_tolerance=0.1"}},
        Case{"curved",
             "cantilever.json",
             12,
             R"("dt":0.02)",
             {"/space/remesh/curve/enabled=true", "/geometry/0/n_refs=1", "/space/remesh/swap/enabled=true",
              "/space/remesh/smooth/enabled=true", "/space/remesh/split/acceptance_tolerance=300"}},
        Case{"kept_order",
             "cubes.json",
             45,
             R"("dt":0.01)",
             {R"(/solver/linear/solver=["cholmod", "eigen"])", "/space/remesh/enabled=false"}},
        Case{"old_factor", "cantilever.json", 30, R"("dt":0.01)", {"/space/remesh/enabled=false", "/geometry/0/n_refs=4"}},
        Case{"held_points",
             "cantilever.json",
             12,
             R"("dt":0.05,"quasistatic":true)",
             {R"(/geometry/0/point_selection=[{"id":9,"box":[[-1,-1],[0.1,45]],"relative":false}])",
              R"(/boundary_conditions/dirichlet_boundary=[{"id":9,"value":[0,0]}])"}},
        Case{"masticator", "masticator.json", 30, R"("dt":0.05)", {}},
        Case{"quasistatic", "cantilever.json", 12, R"("dt":0.05,"quasistatic":true)", {}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace itr::output
