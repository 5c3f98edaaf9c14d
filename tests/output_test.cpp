// SPDX-License-Identifier: MIT
// Files that `itr run` leaves in a folder (docs/theory.md, "Output").
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
#include "itr/core.hpp"
#include "itr/output.hpp"
#include "temporary_path.hpp"
#include "written_scenes.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

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
    folder = temporary_path();
    fs::remove_all(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  Writer make_writer(int skip_frames = 1) { return Writer(folder, {skip_frames}, {"a \"scene\".json", "eigen:ldlt", 1}); }

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
  ASSERT_GT(last_written, written);
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

}  // namespace
}  // namespace itr::output
