// SPDX-License-Identifier: MIT
// The table of a report's fields: it has all members, and totals follow its rules.
#include "simulation/report_fields.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "itr/core.hpp"
#include "output/report_json.hpp"

namespace itr {
namespace {

template <typename Fields, typename Whole>
std::set<const void*> members_of(const Fields& fields, const Whole& whole) {
  std::set<const void*> members;
  for_each_field(fields, [&](const auto& field) { members.insert(&(whole.*field.member)); });
  return members;
}

template <typename... Values>
std::set<const void*> places_of(const Values&... values) {
  return {&values...};
}

// A binding fails to compile if its struct has another number of members.
TEST(ReportFields, AreAllMembers) {
  const EnergyReport energy;
  {
    const auto& [a, b, c, d, e, f, g, h] = energy;
    EXPECT_EQ(members_of(kEnergyFields, energy), places_of(a, b, c, d, e, f, g, h));
  }
  const StepSeconds seconds;
  {
    const auto& [a, b, c, d, e, f, g, h] = seconds;
    EXPECT_EQ(members_of(kSecondsFields, seconds), places_of(a, b, c, d, e, f, g, h));
  }
  const StepReport report;
  const auto& [a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22, a23, a24,
               a25, a26, a27, a28, a29, a30, a31, a32, a33, a34, a35, a36, a37] = report;
  EXPECT_EQ(members_of(kStepFields, report),
            places_of(a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
                      a23, a24, a25, a26, a27, a28, a29, a30, a31, a32, a33, a34, a35, a36, a37));
}

StepReport step(int number, int iterations, double distance, double best) {
  StepReport report;
  report.step = number;
  report.vertices = 3 + number;
  report.newton_iterations = iterations;
  report.min_distance = distance;
  report.best_refused_split = best;
  report.energy.host = 0.1 * number;
  report.residual_worth = 1e-300 / number;
  report.order = 2;
  report.splits = {.tried = 5, .accepted = 1, .relaxed = 4};
  report.splits.note(Refusal::energy);
  report.seconds.ccd = 0.25;
  return report;
}

TEST(ReportFields, AddUpByTheirRules) {
  StepReport total = step(2, 4, 0.5, 1);
  add_up(total, step(1, 3, 0.25, 2));
  EXPECT_EQ(total.vertices, 5);
  EXPECT_EQ(total.newton_iterations, 7);
  EXPECT_EQ(total.min_distance, 0.25);
  EXPECT_EQ(total.best_refused_split, 2);
  EXPECT_EQ(total.energy.host, 0.2);
  EXPECT_EQ(total.splits.refused_by(Refusal::energy), 2);
  EXPECT_EQ(total.seconds.ccd, 0.5);
}

TEST(Totals, AreRestoredFromTheirText) {
  output::Totals totals, restored;
  totals.add(step(1, 3, std::numeric_limits<double>::infinity(), 2));
  totals.add(step(2, 4, std::numeric_limits<double>::infinity(), 1.0 / 3));
  restored.restore(totals.save());
  EXPECT_EQ(restored.save(), totals.save());
  const StepReport& report = restored.report();
  EXPECT_EQ(report.min_distance, std::numeric_limits<double>::infinity());
  EXPECT_EQ(report.energy.host, totals.report().energy.host);
  EXPECT_EQ(report.residual_worth, 5e-301);
  EXPECT_EQ(report.order, 2);
  EXPECT_EQ(report.splits.relaxed, 8);
  EXPECT_EQ(report.splits.refused_by(Refusal::energy), 2);
  EXPECT_THROW(restored.restore("[1]"), InputError);
}

// In format 8, the gain is first; counts, energies, seconds and scalars follow, then refusals.
TEST(Totals, AreRestoredFromAListOfNumbers) {
  std::vector<double> numbers(16 + 12 + 7 + 8 + 7 + 6 + 6 * kRefusals);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(i);
  numbers[46] = std::numeric_limits<double>::infinity();
  output::Totals totals;
  totals.restore(output::totals_of_list(numbers));
  const StepReport& report = totals.report();
  EXPECT_EQ(report.step, 1);
  EXPECT_EQ(report.cut_steps, 15);
  EXPECT_EQ(report.splits.tried, 16);
  EXPECT_EQ(report.smooths.accepted, 27);
  EXPECT_EQ(report.energy.inertia, 28);
  EXPECT_EQ(report.energy.total, 34);
  EXPECT_EQ(report.seconds.total, 42);
  EXPECT_EQ(report.t, 43);
  EXPECT_EQ(report.min_distance, std::numeric_limits<double>::infinity());
  EXPECT_EQ(report.peak_rss_mb, 49);
  EXPECT_EQ(report.curves.tried, 50);
  EXPECT_EQ(report.straightens.accepted, 55);
  EXPECT_EQ(report.splits.refused[0], 56);
  EXPECT_EQ(report.smooths.refused[kRefusals - 1], 55 + 6 * kRefusals);

  numbers.resize(50);
  output::Totals older;
  older.restore(output::totals_of_list(numbers));
  EXPECT_EQ(older.report().peak_rss_mb, 49);
  EXPECT_EQ(older.report().curves.tried, 0);
  numbers.pop_back();
  EXPECT_THROW(output::totals_of_list(numbers), InputError);
}

}  // namespace
}  // namespace itr
