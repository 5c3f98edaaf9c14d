// SPDX-License-Identifier: MIT
#include "simulation/step_ladder.hpp"

#include <gtest/gtest.h>

namespace itr {
namespace {

using Kind = StepFailure::Kind;
using enum StepMethod;
using enum Remeshing;
constexpr auto kNone = Straightening::none, kAround = Straightening::around_failure, kAll = Straightening::everywhere,
               kLast = Straightening::at_any_volume;
constexpr auto kNoRemeshing = Remeshing::none;

const StepFailure kCancelled{Kind::cancelled, "", {}, false}, kUnsolved{Kind::unsolved, "", {}, false},
    kInverted{Kind::unsolved, "", {7}, false}, kCreates{Kind::creates_energy, "", {}, false},
    kRemeshed{Kind::remeshed_unsolved, "", {}, false}, kCurved{Kind::remeshed_unsolved, "", {}, true},
    kNotStraight{Kind::nothing_straightened, "", {7}, false};

struct Row {
  Attempt attempt;
  const StepFailure& failure;
  std::optional<Attempt> next;
};

TEST(StepLadder, ChoosesTheNextAttemptByTheFailure) {
  const std::optional<Attempt> fails;
  const Attempt whole{}, half{1, implicit_euler, kNone, with_new_curves}, quarter{2, implicit_euler, kNone, with_new_curves};
  const Attempt euler{0, implicit_euler, kNone, with_new_curves};
  const std::vector<Row> rows = {
      {whole, kCancelled, fails},
      {whole, kUnsolved, half},
      {whole, kInverted, Attempt{0, of_setup, kAround, with_new_curves}},
      {whole, kCreates, euler},
      {whole, kRemeshed, Attempt{0, of_setup, kNone, kNoRemeshing}},
      {whole, kCurved, Attempt{0, of_setup, kNone, without_new_curves}},
      // Without new curves, and without remeshing.
      {{0, of_setup, kNone, without_new_curves}, kRemeshed, Attempt{0, of_setup, kNone, kNoRemeshing}},
      {{0, of_setup, kNone, without_new_curves}, kCreates, euler},
      {{0, of_setup, kNone, without_new_curves}, kCancelled, fails},
      {{0, of_setup, kNone, kNoRemeshing}, kCreates, euler},
      {{0, of_setup, kNone, kNoRemeshing}, kCancelled, fails},
      // By implicit Euler: straightening goes back to the setup's integrator.
      {euler, kCancelled, fails},
      {euler, kUnsolved, half},
      {euler, kInverted, Attempt{0, of_setup, kAround, with_new_curves}},
      {euler, kCreates, half},
      {euler, kRemeshed, Attempt{0, implicit_euler, kNone, kNoRemeshing}},
      {euler, kCurved, Attempt{0, implicit_euler, kNone, without_new_curves}},
      // From a straightened state.
      {{0, of_setup, kAround, with_new_curves}, kNotStraight, Attempt{0, of_setup, kAll, with_new_curves}},
      {{0, of_setup, kAround, with_new_curves}, kInverted, Attempt{0, of_setup, kAll, with_new_curves}},
      {{0, of_setup, kAround, with_new_curves}, kUnsolved, half},
      {{0, of_setup, kAround, with_new_curves}, kCreates, Attempt{0, implicit_euler, kAround, with_new_curves}},
      {{0, of_setup, kAround, with_new_curves}, kCurved, Attempt{0, of_setup, kAround, without_new_curves}},
      {{0, implicit_euler, kAround, with_new_curves}, kInverted, Attempt{0, of_setup, kAll, with_new_curves}},
      {{0, of_setup, kAll, with_new_curves}, kNotStraight, Attempt{0, of_setup, kLast, with_new_curves}},
      {{0, of_setup, kAll, with_new_curves}, kInverted, Attempt{0, of_setup, kLast, with_new_curves}},
      {{0, of_setup, kLast, with_new_curves}, kNotStraight, half},
      {{0, of_setup, kLast, with_new_curves}, kInverted, half},
      // A part begins with implicit Euler from the top, and keeps its straightening.
      {half, kCancelled, fails},
      {half, kUnsolved, quarter},
      {half, kInverted, Attempt{1, implicit_euler, kAround, with_new_curves}},
      {half, kRemeshed, Attempt{1, implicit_euler, kNone, kNoRemeshing}},
      {half, kCurved, Attempt{1, implicit_euler, kNone, without_new_curves}},
      {{1, implicit_euler, kLast, with_new_curves}, kInverted, quarter},
      {quarter, kInverted, Attempt{2, implicit_euler, kAround, with_new_curves}},
      {quarter, kUnsolved, fails},
      {{2, implicit_euler, kLast, with_new_curves}, kInverted, fails},
  };
  const StepLadder ladder{.most_halvings = 2};
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_EQ(ladder.next(rows[i].attempt, rows[i].failure), rows[i].next) << "row " << i;
}

TEST(StepLadder, TakesAnAdaptiveStepAgainFromTheTopAndShorter) {
  const StepLadder ladder{.least_part = 0.1}, at_least{.least_part = 0.9};
  StepFailure inaccurate{Kind::inaccurate, "", {}, false};
  inaccurate.trial = {.length = 0.4, .part = 0.4, .error = 9};
  const Attempt straight{.straightening = kAround, .remeshing = kNoRemeshing}, top{.trial = inaccurate.trial};
  EXPECT_EQ(ladder.next(straight, inaccurate), top);
  for (const StepFailure* failure : {&kUnsolved, &kCreates, &kNotStraight}) {
    Attempt from = top;
    from.straightening = kLast;
    EXPECT_EQ(ladder.next(from, *failure), (Attempt{.trial = {.length = 0.1, .part = 0.25}}));
  }
  EXPECT_EQ(ladder.next(top, kInverted), (Attempt{.straightening = kAround, .trial = inaccurate.trial}));
  EXPECT_EQ(ladder.next(top, kRemeshed), (Attempt{.remeshing = kNoRemeshing, .trial = inaccurate.trial}));
  const Attempt short_one{.trial = {.length = 0.09, .part = 0.25}};
  EXPECT_EQ(ladder.next(short_one, kCreates), (Attempt{.method = implicit_euler, .trial = short_one.trial}));
  // As short as it may be: implicit Euler takes what would create energy.
  EXPECT_FALSE(at_least.next(top, kUnsolved));
  EXPECT_EQ(at_least.next(top, kCreates), (Attempt{.method = implicit_euler, .trial = inaccurate.trial}));
}

TEST(StepLadder, EndsWhateverFails) {
  for (const StepFailure* failure : {&kUnsolved, &kInverted, &kCreates, &kNotStraight}) {
    const StepLadder ladder{.most_halvings = 3};
    int attempts = 0;
    for (std::optional<Attempt> attempt = Attempt(); attempt && attempts < 100; ++attempts)
      attempt = ladder.next(*attempt, *failure);
    EXPECT_LE(attempts, 16);  // four lengths, each with at most four states to start from
  }
}

}  // namespace
}  // namespace itr
