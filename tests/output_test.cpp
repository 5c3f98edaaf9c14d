// SPDX-License-Identifier: MIT
// What `itr run` leaves in a folder (CONVENTIONS.md, "Output"), and that a certificate finds what is wrong in it.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/hdf5.hpp"
#include "core/process.hpp"
#include "itr/core/error.hpp"
#include "itr/output/writer.hpp"
#include "output/certify.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Two unit squares one above the other, a gap between them, and a line obstacle below: all that a frame refers to.
struct Plane {
  Mesh<2> mesh = Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 2}, {1, 2}, {1, 3}, {0, 3}},
                         {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, {1, 1, 2, 2});
  VectorX x, v;
  std::vector<double> density = {1, 2, 3, 4};
  std::vector<Vec<2>> obstacle_x = {{-1, -0.5}, {2, -0.5}};
  std::vector<std::array<int, 2>> obstacle_edges = {{0, 1}};
  std::vector<std::array<int, 3>> obstacle_triangles;

  Plane() {
    x.resize(16);
    for (int i = 0; i < 8; ++i) vertex_of<2>(x, i) = mesh.rest(i);
    v = VectorX::LinSpaced(16, 0, 1);
  }
  FrameView<2> view() const { return {mesh, x, v, density, obstacle_x, obstacle_edges, obstacle_triangles}; }
};

struct Solid {
  Mesh<3> mesh = Mesh<3>({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  VectorX x, v = VectorX::Zero(12);
  std::vector<double> density = {0};
  std::vector<Vec<3>> obstacle_x = {{-9, -9, -1}, {9, -9, -1}, {0, 9, -1}};
  std::vector<std::array<int, 2>> obstacle_edges = {{0, 1}, {1, 2}, {0, 2}};
  std::vector<std::array<int, 3>> obstacle_triangles = {{0, 1, 2}};

  Solid() {
    x.resize(12);
    for (int i = 0; i < 4; ++i) vertex_of<3>(x, i) = mesh.rest(i);
  }
  FrameView<3> view() const { return {mesh, x, v, density, obstacle_x, obstacle_edges, obstacle_triangles}; }
};

StepReport report_of(int step) {
  StepReport report;
  report.step = step;
  report.t = 0.1 * step;
  report.vertices = 8;
  report.elements = 4;
  report.unknowns = 16;
  report.newton_iterations = 3;
  report.factorizations = 1;
  report.linear_solves = 3;
  report.reused_factors = 2;
  report.linear_iterations = 11;
  report.splits = {.tried = 10, .accepted = 2};
  for (const Refusal reason : {Refusal::energy, Refusal::long_ring, Refusal::energy, Refusal::none, Refusal::gone})
    report.splits.note(reason);
  report.energy.total = 1.0 / 3;
  report.energy_before_remesh = 4.0 / 3;
  report.min_distance = 0.5 / (step + 1);
  report.seconds.total = 0.25;
  report.processor_seconds = 0.5;
  return report;
}

std::string text_of(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::vector<std::string> keys_of(const Json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.push_back(key);
  return keys;
}

int count_of(const std::string& text, const std::string& what) {
  int count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

class OutputTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder = fs::path(testing::TempDir()) / ("itr_output_" + std::string(test->name()));
    fs::remove_all(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  Writer make_writer(int skip_frames = 1) { return Writer(folder, {skip_frames}, {"a \"scene\".json", "eigen:ldlt", 1}); }

  template <typename Scene>
  std::vector<std::string> violations_of(const Scene& scene) {
    Writer writer = make_writer();
    writer.write(scene.view(), report_of(0));
    writer.finish("finished");
    return certify(folder).violations;
  }

  fs::path folder;
};

TEST_F(OutputTest, FrameHoldsTheStateWithTheAgreedNames) {
  Plane plane;
  plane.x[0] = -0.1;
  make_writer().write(plane.view(), report_of(7));

  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(folder / "frames/000007.h5");
  const std::vector<std::pair<std::string, std::string>> units = {{"/mesh/rest", "m"},
                                                                  {"/fields/x", "m"},
                                                                  {"/fields/u", "m"},
                                                                  {"/fields/v", "m/s"},
                                                                  {"/fields/elastic_density", "J/m^2"},
                                                                  {"/obstacles/x", "m"}};
  for (const auto& [name, unit] : units) EXPECT_EQ(file.read_text_attribute(name, "unit"), unit) << name;
  const auto x = file.read_doubles("/fields/x");
  EXPECT_EQ(x.columns, 2);
  EXPECT_EQ(file.shape("/fields/x").columns, 2);
  EXPECT_EQ(file.shape("/fields/x").rows, x.rows());
  EXPECT_EQ(file.shape("/mesh/body").columns, 0);
  EXPECT_EQ(file.shape("/mesh/body").rows, file.read_integers("/mesh/body").values.size());
  EXPECT_THROW(file.shape("/fields"), InputError);
  EXPECT_EQ(x.values, std::vector<double>(plane.x.begin(), plane.x.end()));
  EXPECT_EQ(file.read_doubles("/fields/u").values[0], -0.1);
  EXPECT_EQ(file.read_doubles("/fields/v").values, std::vector<double>(plane.v.begin(), plane.v.end()));
  EXPECT_EQ(file.read_doubles("/fields/elastic_density").values, plane.density);
  EXPECT_EQ(file.read_doubles("/mesh/rest").values[0], 0);
  EXPECT_EQ(file.read_integers("/mesh/simplices").columns, 3);
  EXPECT_EQ(file.read_integers("/mesh/simplices").rows(), 4u);
  EXPECT_EQ(file.read_integers("/mesh/body").values, (std::vector<std::int64_t>{1, 1, 2, 2}));
  EXPECT_EQ(file.read_integers("/mesh/surface").rows(), 8u);
  EXPECT_EQ(file.read_doubles("/obstacles/x").values, (std::vector<double>{-1, -0.5, 2, -0.5}));
  EXPECT_EQ(file.read_integers("/obstacles/edges").values, (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(file.read_integers("/obstacles/faces").columns, 3);
  EXPECT_EQ(file.read_integers("/obstacles/faces").rows(), 0u);
}

TEST_F(OutputTest, StepLineHasExactlyThePromisedNames) {
  StepReport report = report_of(1);
  report.min_distance = std::numeric_limits<double>::infinity();
  make_writer().write(Plane().view(), report);

  const Json line = Json::parse(text_of(folder / "steps.jsonl"));
  EXPECT_EQ(keys_of(line), (std::vector<std::string>{"step",
                                                     "t",
                                                     "order",
                                                     "cut_steps",
                                                     "vertices",
                                                     "elements",
                                                     "unknowns",
                                                     "newton_iterations",
                                                     "factorizations",
                                                     "linear_solves",
                                                     "reused_factors",
                                                     "linear_iterations",
                                                     "energy",
                                                     "energy_before_remesh",
                                                     "splits",
                                                     "curves",
                                                     "straightens",
                                                     "collapses",
                                                     "swaps",
                                                     "smooths",
                                                     "bound_by_dhat",
                                                     "reverted_remeshes",
                                                     "min_distance",
                                                     "min_volume_ratio",
                                                     "history_loss",
                                                     "indefinite",
                                                     "damped_steps",
                                                     "refined_quadrature",
                                                     "seconds",
                                                     "processor_seconds",
                                                     "peak_rss_mb",
                                                     "residual_worth",
                                                     "split_tolerance",
                                                     "best_refused_split",
                                                     "trial_seconds"}));
  EXPECT_EQ(keys_of(line["energy"]),
            (std::vector<std::string>{"inertia", "elastic", "body", "contact", "friction", "total"}));
  EXPECT_EQ(keys_of(line["seconds"]), (std::vector<std::string>{"assembly", "linear_solve", "line_search", "ccd", "remesh",
                                                                "projection", "output", "rest", "total"}));
  EXPECT_EQ(keys_of(line["splits"]), (std::vector<std::string>{"tried", "relaxed", "accepted", "refused"}));
  EXPECT_EQ(line["splits"]["refused"], (Json{{"long_ring", 1}, {"energy", 2}}));
  EXPECT_TRUE(line["collapses"]["refused"].empty());
  EXPECT_TRUE(line["min_distance"].is_null());
  EXPECT_EQ(line["energy"]["total"].get<double>(), 1.0 / 3);  // the same bits
}

TEST(PeakMemory, GrowsByWhatIsTouchedAndStays) {
  constexpr double kMegabytes = 64;
  const double before = peak_rss_mb();
  EXPECT_GT(before, 1);
  {
    std::vector<char> touched(static_cast<std::size_t>(kMegabytes * 1024 * 1024), 1);
    EXPECT_EQ(touched.back(), 1);
  }
  const double after = peak_rss_mb();
  EXPECT_GT(after, before + 0.5 * kMegabytes);  // some of it may have been there before, freed
  EXPECT_LT(after, before + 1.5 * kMegabytes);
}

TEST_F(OutputTest, EachLineIsThereAsSoonAsItsStep) {
  Writer writer = make_writer();
  for (int step = 0; step < 5; ++step) {
    writer.write(Plane().view(), report_of(step));
    const std::string text = text_of(folder / "steps.jsonl");
    EXPECT_EQ(count_of(text, "\n"), step + 1);
    EXPECT_EQ(text.back(), '\n');
  }
}

TEST_F(OutputTest, SummaryHasTotalsAndNorms) {
  Writer writer = make_writer();
  for (int step = 0; step <= 3; ++step) writer.write(Plane().view(), report_of(step));
  writer.finish("finished");

  const Json summary = Json::parse(text_of(folder / "summary.json"));
  EXPECT_EQ(summary["scene"], "a \"scene\".json");
  EXPECT_EQ(summary["outcome"], "finished");
  EXPECT_EQ(summary["backend"], "eigen:ldlt");
  EXPECT_EQ(summary["threads"], 1);
  EXPECT_EQ(summary["steps"], 3);
  EXPECT_EQ(summary["newton_iterations"], 12);
  EXPECT_EQ(summary["factorizations"], 4);
  EXPECT_EQ(summary["linear_solves"], 12);
  EXPECT_EQ(summary["reused_factors"], 8);
  EXPECT_EQ(summary["linear_iterations"], 44);
  EXPECT_EQ(summary["splits"]["tried"], 40);
  EXPECT_EQ(summary["splits"]["refused"]["energy"], 8);
  EXPECT_EQ(summary["seconds"]["total"], 1.0);
  EXPECT_EQ(summary["processor_seconds"], 2.0);
  EXPECT_EQ(summary["min_distance"], 0.125);
  EXPECT_DOUBLE_EQ(summary["energy_decrease_by_remeshing"].get<double>(), 3);
  EXPECT_EQ(keys_of(summary["norms"]), (std::vector<std::string>{"l2", "h1", "h1_semi", "linf", "linf_grad", "lp"}));
  EXPECT_TRUE(summary["versions"].contains("hdf5"));
}

TEST_F(OutputTest, StoresEveryNthStepOnly) {
  Writer writer = make_writer(3);
  for (int step = 0; step < 7; ++step) writer.write(Plane().view(), report_of(step));
  EXPECT_TRUE(fs::exists(folder / "frames/000000.h5"));
  EXPECT_FALSE(fs::exists(folder / "frames/000001.h5"));
  EXPECT_TRUE(fs::exists(folder / "frames/000006.h5"));
  EXPECT_EQ(count_of(text_of(folder / "steps.jsonl"), "\n"), 7);
}

TEST_F(OutputTest, FramesOfOneShapeAndOfAnotherHoldTheirOwnNumbers) {
  Plane plane, single;
  single.mesh = Mesh<2>({{0, 0}, {1, 0}, {0, 1}}, {{0, 1, 2}}, {5});
  single.x = single.v = VectorX::LinSpaced(6, 0, 5);
  single.density = {7};
  const auto at = [&](int step) -> Plane& { return step == 2 ? single : plane; };
  Writer writer = make_writer();
  for (int step = 0; step < 4; ++step) {
    Plane& frame = at(step);
    frame.x[0] = 0.25 * step;
    frame.density[0] = step;
    frame.obstacle_x[0][0] = -step;
    writer.write(frame.view(), report_of(step));
  }
  for (int step = 0; step < 4; ++step) {
    const hdf5::Session session;
    const hdf5::File file = hdf5::File::open(folder / fmt::format("frames/{:06}.h5", step));
    EXPECT_EQ(file.read_integer_attribute("step"), step);
    EXPECT_EQ(file.read_double_attribute("t"), report_of(step).t);
    EXPECT_EQ(file.read_integers("/mesh/body").values.size(), at(step).density.size());
    EXPECT_EQ(file.read_doubles("/fields/x").values.size(), static_cast<std::size_t>(at(step).x.size()));
    EXPECT_EQ(file.read_doubles("/fields/x").values[0], 0.25 * step);
    EXPECT_EQ(file.read_doubles("/fields/elastic_density").values[0], step);
    EXPECT_EQ(file.read_doubles("/obstacles/x").values[0], -step);
    EXPECT_EQ(file.read_text_attribute("/fields/v", "unit"), "m/s");
  }
}

TEST_F(OutputTest, SeriesIsReadableAtAnyMomentAndCompleteAtTheEnd) {
  constexpr int kSteps = 60;
  Writer writer = make_writer();
  for (int step = 0; step < kSteps; ++step) {
    writer.write(Plane().view(), report_of(step));
    const std::string xdmf = text_of(folder / "sim.xdmf");
    EXPECT_EQ(count_of(xdmf, "</Xdmf>"), 1);
    EXPECT_GE(2 * count_of(xdmf, "<Time "), step + 1);
    const hdf5::Session session;
    const hdf5::File file = hdf5::File::open(folder / "sim.h5", hdf5::OtherFiles::followed);
    EXPECT_EQ(file.read_doubles(fmt::format("/frames/{:06}/fields/x", step)).rows(), 8u);
  }
  writer.finish("finished");
  EXPECT_EQ(count_of(text_of(folder / "sim.xdmf"), "<Time "), kSteps);

  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(folder / "sim.h5", hdf5::OtherFiles::followed);
  for (const char* frame : {"/frames/000000", "/frames/000059"}) {
    EXPECT_EQ(file.read_doubles(std::string(frame) + "/fields/x").rows(), 8u);
  }
}

std::size_t bytes_written_by_process() {
  std::ifstream file("/proc/self/io");
  for (std::string name; file >> name;) {
    std::size_t bytes = 0;
    file >> bytes;
    if (name == "wchar:") return bytes;
  }
  return 0;
}

/// Neither memory nor what is written grows with the number of frames before.
TEST_F(OutputTest, AFrameCostsTheSameHoweverManyThereAre) {
  constexpr int kFrames = 4096, kFirst = 512;
  constexpr std::size_t kMostMemory = 16 << 10, kMostBeside = 16 << 10;  // [bytes]; of a frame, beside its own file
  const Plane plane;
  Writer writer(folder, {1, 1e9, true}, {"scene", "eigen:ldlt", 1});
  std::size_t memory = 0;
  const std::size_t written = bytes_written_by_process();
  for (int step = 0; step < kFrames; ++step) {
    if (step == kFirst) memory = mallinfo2().uordblks;
    writer.write(plane.view(), report_of(step));
  }
  const std::size_t last_memory = mallinfo2().uordblks, last_written = bytes_written_by_process();
  EXPECT_LT(last_memory, memory + kMostMemory);
  EXPECT_LT(last_written - written, kFrames * (fs::file_size(folder / "frames/000000.h5") + kMostBeside));
  writer.finish("finished");
  EXPECT_EQ(count_of(text_of(folder / "sim.xdmf"), "<Time "), kFrames);
  EXPECT_EQ(count_of(text_of(folder / "sim.pvd"), "<DataSet "), kFrames);
}

/// A run that is killed goes on from a frame, and would leave out the VTU file of that.
TEST_F(OutputTest, NoFrameIsStoredBeforeItsVtuFile) {
  Writer writer(folder, {1, 30, true}, {"scene", "eigen:ldlt", 1});
  std::ofstream(folder / "vtu") << "a file stands where the folder would";
  EXPECT_THROW(writer.write(Plane().view(), report_of(0)), InputError);
  EXPECT_FALSE(fs::exists(folder / "frames/000000.h5"));
}

TEST_F(OutputTest, LeavesNoTemporaryFilesAndNoFramesOfAnEarlierRun) {
  {
    Writer earlier = make_writer();
    for (int step = 0; step < 4; ++step) earlier.write(Plane().view(), report_of(step));
    earlier.finish("finished");
  }
  std::ofstream(folder / "frames/notes.txt") << "mine";
  Writer writer = make_writer();
  writer.write(Plane().view(), report_of(0));
  EXPECT_FALSE(fs::exists(folder / "frames/000003.h5"));
  EXPECT_FALSE(fs::exists(folder / "summary.json"));
  EXPECT_TRUE(fs::exists(folder / "frames/notes.txt"));
  for (const auto& entry : fs::recursive_directory_iterator(folder)) EXPECT_NE(entry.path().extension(), ".tmp");
}

TEST_F(OutputTest, FolderThatCannotBeWrittenIsAnInputError) {
  fs::create_directories(folder.parent_path());
  std::ofstream(folder) << "a file stands here";
  EXPECT_THROW(make_writer(), InputError);
}

TEST(DisplacementNorms, AreThoseOfAffineMaps) {
  const Plane plane;  // area 2
  VectorX x = plane.x;
  Mat<2> gradient;
  gradient << 0.1, 0.2, -0.3, 0.4;
  for (int i = 0; i < 8; ++i) vertex_of<2>(x, i) += gradient * plane.mesh.rest(i);
  const DisplacementNorms linear = displacement_norms(plane.mesh, x);
  EXPECT_NEAR(linear.h1_semi, gradient.norm() * std::sqrt(2.0), 1e-14);
  EXPECT_NEAR(linear.linf_grad, gradient.norm(), 1e-14);
  EXPECT_NEAR(linear.h1, std::hypot(linear.l2, linear.h1_semi), 1e-14);

  x = plane.x;
  for (int i = 0; i < 8; ++i) x[2 * i + 1] -= 0.00613125;
  const DisplacementNorms constant = displacement_norms(plane.mesh, x);
  EXPECT_NEAR(constant.l2, 0.00613125 * std::sqrt(2.0), 1e-15);
  EXPECT_NEAR(constant.linf, 0.00613125, 1e-15);
  EXPECT_NEAR(constant.lp, 0.00613125 * std::pow(2.0, 0.125), 1e-15);
  EXPECT_NEAR(constant.h1_semi, 0, 1e-15);
}

TEST_F(OutputTest, CertifiesAValidPlaneFrame) { EXPECT_TRUE(violations_of(Plane()).empty()); }

TEST_F(OutputTest, CertifiesAValidSolidFrame) { EXPECT_TRUE(violations_of(Solid()).empty()); }

TEST_F(OutputTest, FindsInvertedAndDegenerateCells) {
  Plane plane;
  plane.x[2 * 3] = 1.5;  // vertex 3 moves across the diagonal 0-2 of its cell
  const auto inverted = violations_of(plane);
  ASSERT_FALSE(inverted.empty());
  EXPECT_EQ(inverted[0], "frames/000000.h5: cell 1 is inverted");

  plane.x[2 * 3] = plane.x[2 * 3 + 1] = 0.25;  // onto it
  const auto degenerate = violations_of(plane);
  ASSERT_FALSE(degenerate.empty());
  EXPECT_EQ(degenerate[0], "frames/000000.h5: cell 1 is degenerate");
}

TEST_F(OutputTest, FindsBodiesThatTouch) {
  Plane plane;
  for (int i = 4; i < 8; ++i) plane.x[2 * i + 1] = plane.mesh.rest(i)[1] - 1;
  for (int i = 4; i < 6; ++i) plane.x[2 * i + 1] = std::nextafter(1.0, 2.0);
  EXPECT_TRUE(violations_of(plane).empty()) << "a gap of one unit in the last place";
  for (int i = 4; i < 6; ++i) plane.x[2 * i + 1] = 1;
  EXPECT_FALSE(violations_of(plane).empty());
}

TEST_F(OutputTest, FindsABodyInAnObstacleButLetsObstaclesCross) {
  Plane plane;
  plane.obstacle_x.insert(plane.obstacle_x.end(), {{0, -1}, {0, -0.25}});
  plane.obstacle_edges.push_back({2, 3});
  EXPECT_TRUE(violations_of(plane).empty());
  plane.obstacle_x[3] = {0.5, 0.25};
  const auto violations = violations_of(plane);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0], "frames/000000.h5: edges (0, 1) and (obstacle 2, obstacle 3) intersect");
}

struct PlaneWithProxy : Plane {
  std::vector<Vec<2>> proxy_x = {{-1, 0.2}, {0.5, 0.1}, {2, 0.2}};
  std::vector<std::array<int, 2>> proxy_edges = {{0, 1}, {1, 2}};
  FrameView<2> view() const {
    FrameView<2> frame = Plane::view();
    frame.proxy = {&proxy_x, &proxy_edges, &obstacle_triangles};
    return frame;
  }
};

TEST_F(OutputTest, AProxyTouchesInPlaceOfTheBoundary) {
  PlaneWithProxy plane;
  plane.obstacle_x = {{0.5, -0.25}, {0.5, 0.05}};  // through the lower square's bottom
  EXPECT_FALSE(violations_of<Plane>(plane).empty());
  EXPECT_TRUE(violations_of(plane).empty());
  plane.proxy_x[1][1] = 0;
  const auto violations = violations_of(plane);
  ASSERT_EQ(violations.size(), 2u);
  EXPECT_EQ(violations[0], "frames/000000.h5: edges (proxy 0, proxy 1) and (obstacle 0, obstacle 1) intersect");
  plane.proxy_x[1][0] = std::nan("");
  EXPECT_EQ(violations_of(plane).size(), 1u);
}

TEST_F(OutputTest, FindsAnEdgeFoldedOntoItsNeighbour) {
  Plane plane;  // two triangles with one common vertex, an edge of one on an edge of the other
  plane.mesh = Mesh<2>({{0, 0}, {2, 0}, {1, 1}, {0.5, -1}, {1, 0}}, {{0, 1, 2}, {0, 3, 4}}, {1, 1});
  plane.x.resize(10);
  plane.v = VectorX::Zero(10);
  plane.density = {0, 0};
  for (int i = 0; i < 5; ++i) vertex_of<2>(plane.x, i) = plane.mesh.rest(i);
  plane.obstacle_x = {};
  plane.obstacle_edges = {};
  const auto violations = violations_of(plane);
  EXPECT_NE(std::find(violations.begin(), violations.end(), "frames/000000.h5: edges (0, 1) and (0, 4) intersect"),
            violations.end());
  plane.x[9] = -0.1;
  EXPECT_TRUE(violations_of(plane).empty());
}

TEST_F(OutputTest, FindsASolidThatPiercesAnObstacle) {
  Solid solid;
  for (int i = 0; i < 4; ++i) solid.x[3 * i + 2] -= 1.5;
  EXPECT_EQ(violations_of(solid).size(), 3u);  // the three edges at the apex
}

TEST_F(OutputTest, FindsObstaclePointsInABody) {
  Plane plane;
  const auto violations_at = [&](double x, double y) {
    plane.obstacle_x[2] = {x, y};
    return violations_of(plane);
  };
  plane.obstacle_x.emplace_back(0, 0);
  for (const double x : {0.25, 0.5, 0.75}) {  // also where the ray upward meets vertices
    EXPECT_TRUE(violations_at(x, -0.25).empty());
    EXPECT_TRUE(violations_at(x, 1.5).empty());
    EXPECT_EQ(violations_at(x, 0.5), std::vector<std::string>{"frames/000000.h5: vertex (obstacle 2) is inside of a body"});
    EXPECT_EQ(violations_at(x, 3), std::vector<std::string>{"frames/000000.h5: vertex (obstacle 2) is on a body"});
  }
  for (const double x : {0.0, 1.0}) {
    EXPECT_EQ(violations_at(x, 0.5).size(), 1u) << "on the side";
    EXPECT_TRUE(violations_at(x, -0.25).empty());
  }
}

TEST_F(OutputTest, FindsObstaclePointsAndEdgesInASolid) {
  Solid solid;
  solid.obstacle_x.insert(solid.obstacle_x.end(), {{0.1, 0.1, -0.5}, {0.2, 0.1, -0.5}});
  for (const bool joined : {false, true}) {
    if (joined) solid.obstacle_edges.push_back({3, 4});
    const auto violations_at = [&](double z) {
      solid.obstacle_x[3][2] = solid.obstacle_x[4][2] = z;
      return violations_of(solid).size();
    };
    EXPECT_EQ(violations_at(-0.5), 0u);
    EXPECT_EQ(violations_at(0.9), 0u);
    EXPECT_EQ(violations_at(0.1), 2u);
    EXPECT_GE(violations_at(0), 1u) << "on it";
  }
  solid.obstacle_edges.pop_back();
  solid.obstacle_x[3] = {0.125, 0.125, -0.5};  // the ray meets an edge, a vertex, and a plane of facets
  solid.obstacle_x[4] = {0, 0, -0.5};
  EXPECT_EQ(violations_of(solid).size(), 0u);
  solid.obstacle_x[3][2] = 0.125;
  EXPECT_EQ(violations_of(solid).size(), 1u);
}

TEST_F(OutputTest, FindsABodyInABody) {
  Plane plane;
  const auto shrink_into = [&](double y) {  // the upper square
    for (int i = 4; i < 8; ++i) vertex_of<2>(plane.x, i) = Vec<2>(0.5, y) + 0.1 * (plane.mesh.rest(i) - Vec<2>(0.5, 2.5));
  };
  shrink_into(1.5);
  EXPECT_TRUE(violations_of(plane).empty());
  shrink_into(0.75);
  EXPECT_EQ(violations_of(plane),
            std::vector<std::string>{"frames/000000.h5: the part of the boundary at vertex 4 is inside of a body"});

  Solid solid;
  const std::vector<Vec<3>> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<Vec<3>> rest = corners;
  for (const Vec<3>& p : corners) rest.push_back(p + Vec<3>(2, 0, 0));
  solid.mesh = Mesh<3>(rest, {{0, 1, 2, 3}, {4, 5, 6, 7}}, {1, 2});
  solid.v = VectorX::Zero(24);
  solid.density = {0, 0};
  solid.x.resize(24);
  for (int i = 0; i < 8; ++i) vertex_of<3>(solid.x, i) = rest[i];
  EXPECT_TRUE(violations_of(solid).empty());
  for (int i = 0; i < 4; ++i) vertex_of<3>(solid.x, 4 + i) = 0.1 * corners[i] + Vec<3>::Constant(0.2);
  EXPECT_EQ(violations_of(solid).size(), 1u);
}

/// A sheet of two triangles as a proxy, folded shut along their common edge.
TEST_F(OutputTest, FindsTrianglesFoldedOntoTheirNeighbours) {
  struct Sheet : Solid {
    std::vector<Vec<3>> proxy_x = {{0, 0, 5}, {1, 0, 5}, {0.25, 1, 5}, {0.75, -1, 5}};
    std::vector<std::array<int, 2>> proxy_edges = {{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}};
    std::vector<std::array<int, 3>> proxy_triangles = {{0, 1, 2}, {1, 0, 3}};
    FrameView<3> view() const {
      FrameView<3> frame = Solid::view();
      frame.proxy = {&proxy_x, &proxy_edges, &proxy_triangles};
      return frame;
    }
  } sheet;
  EXPECT_TRUE(violations_of(sheet).empty());
  sheet.proxy_x[3] = {0.75, 1, std::nextafter(5.0, 6.0)};
  EXPECT_TRUE(violations_of(sheet).empty()) << "open by one unit in the last place";
  sheet.proxy_x[3][2] = 5;
  EXPECT_FALSE(violations_of(sheet).empty());
}

TEST_F(OutputTest, FindsCellsOfNoVolumeAtRest) {
  Plane plane;
  for (double& value : plane.x) value += 10;
  EXPECT_TRUE(violations_of(plane).empty());
  std::vector<double> rest;
  for (int i = 0; i < 8; ++i) rest.insert(rest.end(), {plane.mesh.rest(i)[0], plane.mesh.rest(i)[1]});
  const fs::path frame = folder / "frames/000000.h5";
  std::string bytes = text_of(frame);
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(rest.data()), 8 * rest.size()));
  ASSERT_NE(at, std::string::npos);
  rest[6] = 1.5;  // vertex 3 across the diagonal
  std::memcpy(bytes.data() + at, rest.data(), 8 * rest.size());
  std::ofstream(frame, std::ios::binary) << bytes;
  EXPECT_EQ(certify(folder).violations,
            std::vector<std::string>{"frames/000000.h5: /mesh/rest is damaged: not what was written"});
  for (std::size_t name; (name = bytes.find("digests")) != std::string::npos;) bytes[name] = 'D';  // as of before these
  std::ofstream(frame, std::ios::binary) << bytes;
  EXPECT_EQ(certify(folder).violations, std::vector<std::string>{"frames/000000.h5: at rest cell 1 is inverted"});
}

TEST_F(OutputTest, FindsCurvesInObstaclesThatTheirChordsDoNotReach) {
  const Space space({{0, 1}});
  Plane plane;
  VectorX x(18);  // and the node of the lowest edge
  x << plane.x, 0.5, -0.4;
  plane.x = x;
  plane.v = VectorX::Zero(18);
  plane.density.assign(4, 0);
  const auto violations = [&](double a, double b, double height) {
    plane.obstacle_x = {{a, height}, {b, height}};
    fs::remove_all(folder);
    Writer writer = make_writer();
    FrameView<2> view = plane.view();
    view.space = &space;
    writer.write(view, report_of(0));
    writer.finish("finished");
    return certify(folder).violations.size();
  };
  // At x = 1/4 the parabola is at -0.3, its chord at -0.2.
  EXPECT_EQ(violations(-1, 0.25, -0.300001), 0u);
  EXPECT_EQ(violations(-1, 0.25, -0.299), 1u + 1u) << "the edge crosses, and its end is beyond";
  EXPECT_EQ(violations(0.25, 0.26, -0.25), 2u) << "wholly between curve and chord";
}

TEST_F(OutputTest, FindsPositionsThatAreNotNumbers) {
  Plane plane;
  plane.x[5] = std::nan("");
  EXPECT_EQ(violations_of(plane).size(), 1u);
}

TEST_F(OutputTest, CertifyRefusesWhatItCannotRead) {
  EXPECT_THROW(certify(folder), InputError);
  EXPECT_TRUE(violations_of(Plane()).empty());
  fs::resize_file(folder / "frames/000000.h5", 1000);
  EXPECT_THROW(certify(folder), InputError);
}

}  // namespace
}  // namespace itr::output
