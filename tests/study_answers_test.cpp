// SPDX-License-Identifier: MIT
// Answers of a study to rows made up for it: when it has to say nothing, and that its table and sentences agree.
#include "apps/study/answers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/study/curves.hpp"
#include "apps/study/plot.hpp"
#include "apps/study/rows.hpp"
#include "mesh/mesh_file.hpp"

namespace itr::cli::study {
namespace {

const Measure& measure(const std::string& name) {
  return *std::find_if(measures().begin(), measures().end(), [&](const Measure& m) { return m.name == name; });
}

const Series& series(const std::string& name) {
  return *std::find_if(all_series().begin(), all_series().end(), [&](const Series& s) { return s.name == name; });
}

/// A run with the same relative error in L2 and H1, and ten times it in J, of a reference of 10 J.
Row row(const std::string& of, const std::string& name, double error, double seconds, double unknowns = 100) {
  Row made;
  made.run.name = name;
  made.run.series = &series(of);
  made.run.reference = kReference;
  made.finished = made.certified = true;
  made.unknowns = unknowns;
  made.processor_seconds = seconds;
  made.memory_mb = 10;
  made.errors = Errors{};
  made.errors->l2 = made.errors->h1 = error;
  made.errors->energy = 10 * error;
  made.errors->reference_energy = 10;
  return made;
}

Results study_of(std::vector<Row> rows) {
  Results results;
  results.scene = "scene.json";
  results.reference = "`reference`";
  results.worth = Errors{};
  results.second_reference = "`second-reference`";
  results.rows = std::move(rows);
  return results;
}

Verdict verdict_of(const Results& results, const std::string& of, const std::string& in = "h1") {
  for (auto& verdict : verdicts(results))
    if (verdict.series == &series(of) && verdict.measure == &measure(in)) return verdict;
  ADD_FAILURE() << "no verdict on " << of;
  return {};
}

std::string all_of(const std::vector<std::string>& sentences) {
  std::string text;
  for (const auto& sentence : sentences) text += sentence + "\n";
  return text;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::vector<Row> uniform_rows() {
  return {row("uniform", "uniform-0", 0.4, 1, 100), row("uniform", "uniform-1", 0.2, 10, 400),
          row("uniform", "uniform-2", 0.1, 100, 1600)};
}

Results with(std::vector<Row> more) {
  std::vector<Row> rows = uniform_rows();
  rows.insert(rows.end(), more.begin(), more.end());
  return study_of(rows);
}

TEST(StudyAnswers, TellNoErrorBelowWhatTheReferenceIsWorth) {
  Results results = with({row("itr", "itr-1", 0.15, 2), row("itr", "itr-0.1", 0.05, 4)});
  EXPECT_EQ(verdict_of(results, "itr").points.size(), 2u);
  results.worth->l2 = results.worth->h1 = 0.08;
  results.worth->energy = 0.8;
  EXPECT_EQ(verdict_of(results, "itr").points.size(), 1u);
  EXPECT_FALSE(told_error(results, results.rows.back(), measure("h1")));
  EXPECT_TRUE(has(page(results), "below 0.08"));
  EXPECT_TRUE(has(all_of(doubts(results)), "worth 8 % (l2), 8 % (h1), 0.8 J (energy)"));
  EXPECT_TRUE(has(csv(results), "itr-0.1,itr,,finished"));
  EXPECT_FALSE(has(csv(results), "0.05"));
  results.worth.reset();
  EXPECT_TRUE(has(all_of(doubts(results)), "not known"));
}

TEST(StudyAnswers, SayNothingPaysOfErrorsBeyondHalf) {
  // Ten times faster than a uniform mesh that is as wrong.
  const Results results =
      with({row("uniform", "uniform-x", 0.9, 0.5), row("itr", "itr-4", 0.8, 0.05), row("itr", "itr-1", 0.3, 20)});
  const Verdict verdict = verdict_of(results, "itr");
  ASSERT_EQ(verdict.points.size(), 2u);
  EXPECT_TRUE(verdict.points[0].is_large);
  EXPECT_LT(verdict.points[0].time_ratio, 1);
  EXPECT_FALSE(verdict.pays_from);
  EXPECT_EQ(verdict.largest_error, 0.3);
  EXPECT_TRUE(has(all_of(answers(results)), "It does not pay here"));
  EXPECT_TRUE(has(all_of(doubts(results)), "`uniform-x`, `itr-4` are off by 50 % and more"));
  EXPECT_FALSE(has(choices_table(results), "itr-4"));
}

TEST(StudyAnswers, RelateEnergiesToTheReference) {
  Results results = with({row("itr", "itr-1", 0.3, 0.1)});
  EXPECT_FALSE(verdict_of(results, "itr", "energy").points[0].is_large);
  for (Row& one : results.rows) one.errors->reference_energy = 5;
  EXPECT_TRUE(verdict_of(results, "itr", "energy").points[0].is_large);
}

TEST(StudyAnswers, ShowTolerancesThatOthersBeat) {
  const Results results = with({row("itr", "itr-4", 0.3, 50), row("itr", "itr-1", 0.15, 5)});
  const Verdict verdict = verdict_of(results, "itr");
  ASSERT_EQ(verdict.points.size(), 2u);
  EXPECT_EQ(verdict.points[0].beaten_by, "itr-1");
  EXPECT_EQ(verdict.points[1].beaten_by, "");
  EXPECT_GT(verdict.points[0].time_ratio, 1);
  EXPECT_EQ(verdict.pays_from, 0.15);  // not from 0.3 on: that run takes longer
  const std::string said = all_of(answers(results));
  EXPECT_TRUE(has(said, "`itr-4` by `itr-1`"));
  EXPECT_TRUE(has(said, "pays from 15 % on"));
}

TEST(StudyAnswers, TableRecommendsWhatTheSentenceDoes) {
  // itr-1 is the cheapest run below 0.2, but a uniform mesh between the levels would take less than it: it does not pay.
  const Results results = with({row("itr", "itr-1", 0.19, 15)});
  EXPECT_GT(verdict_of(results, "itr").points[0].time_ratio, 1);
  EXPECT_TRUE(has(all_of(answers(results)), "It does not pay here"));
  EXPECT_FALSE(has(choices_table(results), "itr-1"));
  EXPECT_TRUE(has(choices_table(results), "| h1 | 10 % | `uniform-2` |"));
  // Nor where it is more accurate than asked, and uniform refinement has what is asked for less.
  const Results finer = with({row("itr", "itr-1", 0.11, 30)});
  EXPECT_TRUE(has(all_of(answers(finer)), "It pays at all of these errors"));
  EXPECT_FALSE(has(choices_table(finer), "| h1 | 20 % | `itr-1`"));
  // Where only remeshing reaches an error, it is what there is.
  const Results alone = with({row("itr", "itr-1", 0.05, 30)});
  EXPECT_TRUE(has(choices_table(alone), "| h1 | 5 % | `itr-1` |"));
}

TEST(StudyAnswers, CountRunsBelowTheWorthAsReachingIt) {
  // uniform-2's error is not told, but it is no larger than 0.12: a run that takes longer for 0.12 is not recommended.
  Results results = with({row("itr", "itr-1", 0.121, 200)});
  results.worth->h1 = 0.12;
  EXPECT_EQ(points(results, {"uniform"}, measure("h1"), costs()[0]).size(), 2u);
  EXPECT_EQ(points_reached(results, {"uniform"}, measure("h1"), costs()[0]).back().error, 0.12);
  EXPECT_GT(verdict_of(results, "itr").points[0].time_ratio, 1.9);
  EXPECT_TRUE(has(choices_table(results), "| h1 | 20 % | `uniform-1` |"));
  EXPECT_FALSE(has(choices_table(results), "itr-1"));
}

TEST(StudyAnswers, SayThatARunIsNearerToTheLimitThanTheReference) {
  Results results = with({row("uniform-p2", "uniform-p2-2", 0.05, 20)});
  results.reference_run = "reference";
  results.rows.push_back(row("uniform", "reference", 0, 1));
  results.rows.back().run.reference = "";
  results.rows.back().potential = -10;
  results.rows[3].potential = -12;
  EXPECT_TRUE(has(all_of(doubts(results)), "`uniform-p2-2` ends with a potential lower than the reference's, by 2 J"));
  results.has_friction = true;
  EXPECT_FALSE(has(all_of(doubts(results)), "potential"));
}

TEST(StudyAnswers, JudgeByTheBetterOfLevelsAndRows) {
  Results results = with({row("itr", "itr-1", 0.2, 5)});
  EXPECT_NEAR(verdict_of(results, "itr").points[0].time_ratio, 0.5, 1e-12);
  results.rows.push_back(row("rows", "rows-1", 0.2, 2.5));
  EXPECT_NEAR(verdict_of(results, "itr").points[0].time_ratio, 2, 1e-12);
  EXPECT_TRUE(has(choices_table(results), "| h1 | 20 % | `rows-1` |"));
}

TEST(StudyAnswers, JudgeQuadraticElementsByLinearOnesAndRemeshingByBoth) {
  Results results = with(
      {row("itr", "itr-1", 0.2, 5), row("uniform-p2", "uniform-p2-0", 0.2, 2), row("uniform-p2", "uniform-p2-1", 0.02, 20)});
  const Verdict quadratic = verdict_of(results, "uniform-p2"), remeshed = verdict_of(results, "itr");
  EXPECT_NEAR(quadratic.points[0].time_ratio, 0.2, 1e-12);
  EXPECT_TRUE(std::isnan(quadratic.points[1].time_ratio));  // linear elements have not come to it
  EXPECT_EQ(quadratic.pays_from, 0.2);
  EXPECT_NEAR(remeshed.points[0].time_ratio, 0.5, 1e-12);
  EXPECT_NEAR(remeshed.points[0].quadratic_ratio, 2.5, 1e-12);
  EXPECT_FALSE(remeshed.pays_from);
  const std::string said = all_of(answers(results)), table = choices_table(results);
  EXPECT_TRUE(has(said, "2.5 of the time that it takes with quadratic elements. It does not pay here"));
  EXPECT_TRUE(has(table, "| h1 | 20 % | `uniform-p2-0` |"));
  EXPECT_TRUE(has(table, "| h1 | 2 % | `uniform-p2-1` |"));
  EXPECT_FALSE(has(table, "itr-1"));
  EXPECT_TRUE(has(work_precision_svg(results), "uniform-p2: uniform refinement, quadratic elements (P2)"));
}

TEST(StudyAnswers, RecommendNothingWhereNoRunIsNearTheReference) {
  const Results results = study_of({row("uniform", "uniform-0", 1.2, 1), row("uniform", "uniform-1", 0.9, 10),
                                    row("itr", "itr-1", 0.8, 2), row("itr", "itr-0.1", 0.7, 3)});
  EXPECT_TRUE(has(all_of(doubts(results)), "no run is nearer to the reference than 70 % of it"));
  EXPECT_EQ(choices_table(results), "");
  EXPECT_FALSE(has(all_of(answers(results)), "pay"));
  EXPECT_FALSE(verdict_of(results, "itr").is_recommended);
}

TEST(StudyAnswers, RecommendNothingOfImpossibleOrders) {
  // Four times the unknowns and a hundredth of the error: order 6.6 in 2D.
  const Results results = study_of({row("uniform", "uniform-0", 0.4, 1, 100), row("uniform", "uniform-1", 0.004, 10, 400),
                                    row("uniform", "uniform-2", 4e-5, 100, 1600), row("itr", "itr-1", 0.2, 0.1)});
  EXPECT_TRUE(has(all_of(doubts(results)), "an order of 6.6"));
  EXPECT_EQ(choices_table(results), "");
  const Results own = with(
      {row("itr", "itr-4", 0.4, 0.1, 100), row("itr", "itr-1", 0.004, 0.2, 200), row("itr", "itr-0.1", 4e-5, 0.3, 400)});
  EXPECT_FALSE(verdict_of(own, "itr").is_recommended);
  EXPECT_FALSE(has(choices_table(own), "`itr-"));
  EXPECT_TRUE(has(choices_table(own), "uniform-1"));
}

TEST(StudyAnswers, LeaveOutRunsInWhichABodyFlies) {
  Results results = with({row("itr", "itr-1", 0.15, 2), row("itr", "itr-0.1", 0.12, 3)});
  results.rows.back().flight = 3.6;
  EXPECT_EQ(verdict_of(results, "itr").points.size(), 1u);
  EXPECT_TRUE(has(doubts(results).front(), "A body flies away, by up to 3.6 times the size of the scene, in `itr-0.1`"));
  results.is_dynamic = true;  // a body in motion may
  EXPECT_EQ(verdict_of(results, "itr").points.size(), 2u);
}

TEST(StudyAnswers, SayFirstThatAReferenceIsRefused) {
  Results results = with({row("itr", "itr-1", 0.15, 2)});
  results.refused = "it equals the finest uniform level, `uniform-2`";
  for (Row& one : results.rows) one.errors.reset();
  const std::string text = page(results);
  const auto refusal = text.find("Nothing is said of errors: `reference` is no reference, since it equals");
  ASSERT_NE(refusal, std::string::npos);
  EXPECT_EQ(text.find("- "), refusal - 2);
  EXPECT_TRUE(verdicts(results).empty());
  EXPECT_EQ(choices_table(results), "");
}

TEST(StudyAnswers, RepeatWarningsOfRuns) {
  Results results = with({});
  results.rows[0].warnings = {{"dhat is large", 1}};
  results.rows[1].warnings = {{"dhat is large", 1}, {"friction is off", 7}};
  const std::string text = page(results);
  EXPECT_TRUE(has(text, "2 of 3 runs gave warnings"));
  EXPECT_TRUE(has(text, "- dhat is large: `uniform-0`, `uniform-1`"));
  EXPECT_TRUE(has(text, "- friction is off: `uniform-1` (7 times)"));
}

std::map<std::string, std::string> settings(const PlannedRun& run) {
  std::map<std::string, std::string> all;
  for (const auto& set : run.overrides) all[set.pointer] = set.value;
  return all;
}

class StudyPlan : public testing::Test {
 protected:
  void SetUp() override {
    options.scene = std::filesystem::path(ITR_SOURCE_DIR) / "examples/cubes.json";
    options.directory = std::filesystem::path(testing::TempDir()) / "itr_study_plan";
    options.overrides = {{"/contact/friction_coefficient", "0.3"}};
  }
  void TearDown() override { std::filesystem::remove_all(options.directory); }
  std::vector<PlannedRun> all() const {
    Plan plan = make_plan(options);
    plan.runs.insert(plan.runs.end(), plan.references.begin(), plan.references.end());
    return plan.runs;
  }
  Options options;
};

TEST_F(StudyPlan, LagsFrictionAlikeInAllRuns) {
  for (const auto& run : all()) {
    EXPECT_EQ(settings(run)["/solver/contact/friction_iterations"], "50") << run.name;
    EXPECT_EQ(settings(run)["/solver/contact/friction_convergence_tol"], "0") << run.name;
  }
  EXPECT_TRUE(has(make_plan(options).notes, "friction lagged until it does not change, at most 50 rounds"));
  options.overrides.push_back({"/solver/contact/friction_iterations", "3"});
  for (const auto& run : all()) EXPECT_EQ(settings(run)["/solver/contact/friction_iterations"], "3") << run.name;
  options.overrides = {{"/contact/friction_coefficient", "0"}};
  for (const auto& run : all()) EXPECT_FALSE(settings(run).contains("/solver/contact/friction_iterations")) << run.name;
}

TEST_F(StudyPlan, HasASecondReferenceAndSmallerTolerancesForTheFirst) {
  options.tolerances = {1, 0.25};
  const Plan plan = make_plan(options);
  ASSERT_EQ(plan.references.size(), 3u);
  EXPECT_EQ(plan.references[0].name, "reference");
  const char* const tolerance = "/space/remesh/split/acceptance_tolerance";
  double last = 1;
  for (const auto& run : plan.references) {
    EXPECT_LT(std::stod(settings(run)[tolerance]), last);
    last = std::stod(settings(run)[tolerance]);
  }
  const auto second =
      std::find_if(plan.runs.begin(), plan.runs.end(), [](const auto& run) { return run.name == kSecondReference; });
  ASSERT_NE(second, plan.runs.end());
  EXPECT_EQ(second->reference, kReference);
  EXPECT_EQ(std::stod(settings(*second)[tolerance]), 0.0625);
  EXPECT_LT(std::stoi(settings(*second)["/geometry/0/n_refs"]),
            std::stoi(settings(plan.references[0])["/geometry/0/n_refs"]));
  options.reference_tolerance = 0.01;
  EXPECT_EQ(make_plan(options).references.size(), 1u);
}

TEST_F(StudyPlan, HasQuadraticElementsBesideLinearOnes) {
  std::map<std::string, std::string> order;
  for (const auto& run : all())
    if (const auto all_settings = settings(run); all_settings.contains("/space/discr_order"))
      order[run.name] = all_settings.at("/space/discr_order");
  EXPECT_EQ(order, (std::map<std::string, std::string>{{"uniform-p2-0", "2"}, {"uniform-p2-1", "2"}}));
  // The linear series of a scene of quadratic elements are linear all the same.
  options.overrides.push_back({"/space/discr_order", "2"});
  for (const auto& run : all())
    EXPECT_EQ(settings(run)["/space/discr_order"], run.name.starts_with("uniform-p2") ? "2" : "1") << run.name;
}

TEST(RowsOfABox, FillItWithAsManyCells) {
  const Mesh<3> bar({{0, 0, 0}, {2, 0, 0}, {0, 1, 0}, {2, 1, 0}, {0, 0, 1}, {2, 0, 1}, {0, 1, 1}, {2, 1, 1}},
                    {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}},
                    std::vector<int>(6, 3));
  const auto box = find_box(bar);
  ASSERT_TRUE(box);
  EXPECT_EQ(box->counts(12 * 64), (std::array<int, 3>{8, 4, 4}));
  const auto file = std::filesystem::path(testing::TempDir()) / "itr_rows.msh";
  write_rows(*box, {4, 2, 2}, 3, file);
  const MeshFile read = read_mesh_file(file);
  EXPECT_EQ(read.tetrahedra.size(), 96u);
  EXPECT_EQ(read.tetrahedron_body, std::vector<int>(96, 3));
  std::vector<Vec<3>> points = read.vertices;
  const Mesh<3> mesh(points, {read.tetrahedra.begin(), read.tetrahedra.end()}, read.tetrahedron_body);
  double volume = 0;
  for (CellId c = 0; c < mesh.num_cells(); ++c) {
    EXPECT_NEAR(mesh.volume(c), 2.0 / 96, 1e-15);
    volume += mesh.volume(c);
  }
  EXPECT_NEAR(volume, 2, 1e-14);
  std::filesystem::remove(file);
  const Mesh<3> corner({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  EXPECT_FALSE(find_box(corner));
}

}  // namespace
}  // namespace itr::cli::study
