// SPDX-License-Identifier: MIT
// The table of a report's fields: it has all members, and totals follow its rules.
#include "simulation/report_fields.hpp"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <limits>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

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
               a25, a26, a27, a28, a29, a30, a31, a32, a33, a34, a35, a36, a37, a38, a39, a40, a41, a42, a43, a44, a45,
               a46] = report;
  EXPECT_EQ(members_of(kStepFields, report),
            places_of(a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14, a15, a16, a17, a18, a19, a20, a21, a22,
                      a23, a24, a25, a26, a27, a28, a29, a30, a31, a32, a33, a34, a35, a36, a37, a38, a39, a40, a41, a42,
                      a43, a44, a45, a46));
}

std::string text_of(const char* file) {
  std::ifstream stream(std::string(ITR_SOURCE_DIR) + file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The words of `text` that `pattern` finds.
std::vector<std::string> words_of(const std::string& text, const std::string& pattern) {
  const std::regex word(pattern);
  std::vector<std::string> words;
  for (std::sregex_iterator next(text.begin(), text.end(), word), end; next != end; ++next) words.push_back(next->str(1));
  return words;
}

/// Each row of the page has fields of one unit and rule, in the table's order.
TEST(ReportFields, AreThoseOfThePage) {
  constexpr const char* kRules[] = {"last", "sum", "least", "most"};
  const std::string page = text_of("/docs/theory.md");
  std::istringstream rows(page.substr(page.find("| field | unit | of a run |")));
  std::vector<std::array<std::string, 3>> found, expected;
  std::string row;
  std::getline(rows, row);
  std::getline(rows, row);
  while (std::getline(rows, row) && row.starts_with("| ")) {
    const auto columns = words_of(row + " ", R"(\| ([^|]*?) ?(?=\|))");
    const auto names = words_of(columns.at(0), "`(\\w+)`"), units = words_of(columns.at(1) + ",", "([^,]*),");
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string& unit = units[std::min(i, units.size() - 1)];
      found.push_back({names[i], unit.substr(std::min(unit.size(), unit.find_first_not_of(' '))), columns.at(2)});
    }
  }
  for_each_field(kStepFields, [&](const auto& field) {
    expected.push_back({field.name, field.unit, kRules[static_cast<int>(field.add_up)]});
  });
  EXPECT_EQ(found, expected);
}

TEST(ReportFields, NameTheMembersOfTheStructsOfC) {
  const std::string header = text_of("/include/itr/itr.h");
  const auto members = [&](const std::string& name) {
    const std::size_t begin = header.find("typedef struct " + name + " {");
    return words_of(header.substr(begin, header.find('}', begin) - begin), "(\\w+)[,;]");
  };
  std::vector<std::string> energies;
  for_each_field(kEnergyFields, [&](const auto& field) { energies.push_back(field.name); });
  EXPECT_EQ(members("itr_energies"), energies);
  std::set<std::string> shown;
  for_each_field(kStepFields, [&](const auto& field) {
    if (field.shown & in_program) shown.insert(field.name);
  });
  const auto statistics = members("itr_step_statistics");
  EXPECT_EQ(statistics.size(), 14u);
  for (const std::string& name : statistics) EXPECT_TRUE(shown.contains(name)) << name;
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

// In formats 7 and 8, the gain is first; counts, energies, seconds and scalars follow, then refusals.
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
