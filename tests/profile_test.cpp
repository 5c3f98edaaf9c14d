// SPDX-License-Identifier: MIT
// Times by phase, and what is predicted for other numbers of cores.
#include "core/profile.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/parallel.hpp"

namespace itr {
namespace {

void spin(double seconds) {
  const double end = seconds_now() + seconds;
  while (seconds_now() < end) {
  }
}

PhaseTimes find(const std::vector<PhaseTimes>& all, const std::string& name) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const PhaseTimes& times) { return times.name == name; });
  return found == all.end() ? PhaseTimes{} : *found;
}

TEST(Profile, GivesEachMomentToOnePhase) {
  const double begin = seconds_now();
  Profile profile;
  {
    const Profile::Active active(&profile);
    const ScopedPhase outer("outer");
    spin(2e-3);
    {
      const ScopedPhase inner("inner", "term");
      spin(4e-3);
    }
    spin(1e-3);
  }
  spin(1e-3);
  const auto times = profile.take();
  const double all = seconds_now() - begin;
  double sum = 0;
  for (const PhaseTimes& phase : times) sum += phase.wall;
  EXPECT_GE(find(times, "inner of term").wall, 4e-3);
  EXPECT_GE(find(times, "outer").wall, 3e-3);
  EXPECT_LE(find(times, "outer").wall, all - 5e-3);
  EXPECT_GE(find(times, "rest").wall, 1e-3);
  EXPECT_LE(sum, all);
  EXPECT_GE(sum, 8e-3);
  EXPECT_TRUE(find(profile.take(), "outer").name.empty()) << "taken once";
}

TEST(Profile, TakesFinePhasesIntoACoarseOneButNotCoarseOnes) {
  Profile profile;
  {
    const Profile::Active active(&profile);
    const auto coarse = ScopedPhase::coarse("remeshing");
    const ScopedPhase fine("assembly");
    const ScopedPhase finer("solve");
    spin(1e-3);
    {
      const auto inner = ScopedPhase::coarse("trials");
      const ScopedPhase hidden("assembly");
      spin(2e-3);
    }
    spin(1e-3);
  }
  const auto times = profile.take();
  EXPECT_GE(find(times, "remeshing").wall, 2e-3);
  EXPECT_GE(find(times, "trials").wall, 2e-3);
  EXPECT_TRUE(find(times, "assembly").name.empty());
}

/// Blocks of 1 ms but for one of 4 ms, and 2 ms beside the loop, whatever number of threads there is.
TEST(Profile, PredictsTimesByWorkAndLongestBlocks) {
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    Profile profile;
    {
      const Profile::Active active(&profile);
      const ScopedPhase phase("loop");
      spin(2e-3);
      parallel_blocks(13, 1, [&](std::size_t block, std::size_t) {
        const ScopedPhase none("of another thread, or part of the block");
        spin(block == 5 ? 4e-3 : 1e-3);
      });
    }
    const auto times = profile.take();
    const PhaseTimes loop = find(times, "loop");
    EXPECT_GE(loop.work, 18e-3);
    EXPECT_GE(loop.span, 6e-3);
    EXPECT_LT(loop.span, loop.work);
    EXPECT_GE(loop.predicted[0], 10e-3);
    EXPECT_GE(loop.predicted[3], 6e-3);
    EXPECT_LE(loop.predicted[3], loop.predicted[1]);
    EXPECT_LE(loop.predicted[1], loop.predicted[0]);
    EXPECT_LE(loop.predicted[0], loop.work);
    EXPECT_EQ(times.size(), 2u) << "the loop, and the rest";
  }
}

/// With several cores a phase beside the others takes only what it is longer than they are.
TEST(Profile, PredictsThatAPhaseRunsBesideTheOthers) {
  for (const double seconds : {2e-3, 12e-3}) {
    Profile profile;
    {
      const Profile::Active active(&profile);
      const auto beside = ScopedPhase::beside("output");
      spin(seconds);
    }
    spin(6e-3);
    const auto times = profile.take();
    const PhaseTimes output = find(times, "output"), rest = find(times, "rest");
    EXPECT_GE(output.work, seconds);
    for (const double predicted : output.predicted)
      EXPECT_DOUBLE_EQ(predicted, std::max(0.0, output.wall - rest.wall)) << seconds;
  }
}

TEST(Profile, IsNoneWhereNobodyAsks) {
  EXPECT_EQ(Profile::active(), nullptr);
  const ScopedPhase phase("nothing");
  add_bytes(1);
  Profile profile;
  EXPECT_EQ(find(profile.take(), "nothing").wall, 0);
}

}  // namespace
}  // namespace itr
