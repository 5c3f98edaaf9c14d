// SPDX-License-Identifier: MIT
// Warnings are counted by kind, and a run whose forces are off has one. Their texts are in texts.txt.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "output/warnings.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct Said {
  int status = 0;
  std::string text;
};

class WarningsTest : public ::testing::Test {
 protected:
  WarningsTest() : folder_(fs::path(::testing::TempDir()) / ("itr_warnings_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~WarningsTest() override { fs::remove_all(folder_); }

  Said itr(const std::string& arguments) const {
    FILE* pipe = popen((std::string(ITR_BINARY_DIR) + "/bin/itr " + arguments + " 2>&1").c_str(), "r");
    Said said;
    for (std::array<char, 4096> buffer; std::fgets(buffer.data(), buffer.size(), pipe);) said.text += buffer.data();
    said.status = pclose(pipe);
    return said;
  }
  Said run(const std::string& scene, const std::string& more = "") const {
    return itr("run " ITR_SOURCE_DIR "/examples/" + scene + " -o " + (folder_ / "out").string() + " " + more);
  }

  fs::path folder_;
};

TEST(WarningList, CountsKinds) {
  EXPECT_EQ(output::kind_of_warning("step 12: 3.5e-07 J, (-1, 2) of body 3"), "step #: # J, (-#, #) of body #");
  EXPECT_EQ(output::kind_of_warning("step 12: 1e+20 J of -0.5e3m"), output::kind_of_warning("step 3: 7 J of -2m"));
  output::WarningList list;
  list.add("step 1: off by 2 m");
  list.add("step 2: off by 3.5 m");
  list.add("odd");
  EXPECT_EQ(list.count(), 3);
  const Json summary = Json(list.summary_members());
  EXPECT_EQ(summary["warning_count"], 3);
  EXPECT_EQ(summary["warnings"][0], (Json{{"text", "step 1: off by 2 m"}, {"count", 2}}));
  EXPECT_EQ(list.take_new().size(), 3u);
  EXPECT_TRUE(list.take_new().empty());
}

/// The warning says by how much the force is too large.
TEST_F(WarningsTest, GapsThatAddToAPrescribedMotionAreToldOf) {
  std::ofstream(folder_ / "square.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
  std::ofstream(folder_ / "press.json") << R"({
    "geometry": [{"mesh": "square.obj", "n_refs": 2, "surface_selection": {"threshold": 1e-3}},
                 {"type": "plane", "point": [0, 1.02], "normal": [0, -1], "is_obstacle": true, "name": "press"}],
    "materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 100},
    "boundary_conditions": {
      "rhs": [0, 9.81],
      "dirichlet_boundary": [{"id": 1, "value": [0, 0], "dimension": [true, false]},
                             {"id": 2, "value": [0, 0], "dimension": [false, true]}],
      "obstacle_displacements": [{"id": "press", "value": [0, "-0.06 * t"]}]},
    "time": {"dt": 0.25, "tend": 1, "quasistatic": true},
    "contact": {"enabled": true},
    "output": {"forces": [{"name": "press", "obstacles": "press"}]}})";
  const auto press = [&](const std::string& dhat) {
    const Said said = itr("run " + (folder_ / "press.json").string() + " -o " + (folder_ / "out").string() +
                          " --overwrite --set /contact/dhat=" + dhat);
    EXPECT_EQ(said.status, 0) << said.text;
    return said.text;
  };
  const auto force = [&] {
    std::ifstream file(folder_ / "out/forces.csv");
    std::string line, last;
    while (std::getline(file, line)) last = line;
    std::istringstream cells(last);
    for (int i = 0; i < 5; ++i) std::getline(cells, line, ',');
    return std::stod(line);  // contact_y
  };
  const std::string told = " % of the way that bodies would be compressed by";
  EXPECT_EQ(press("1e-4").find(told), std::string::npos);
  const double hard = force();
  const std::string text = press("0.01");
  const double soft = force();
  const std::size_t at = text.find(told);
  ASSERT_NE(at, std::string::npos) << text;
  const double said = std::stod(text.substr(text.rfind(' ', at - 1))) / 100;
  EXPECT_NEAR(said, soft / hard - 1, 0.1 * said);
}

/// Against a tenth of the split tolerance; what is off by more than 2 % is said.
TEST_F(WarningsTest, SmallerTolerancesGiveNoLargerErrors) {
  const std::string press = "--set /time/tend=0.3 --set /time/quasistatic=true --overwrite ";
  const auto force = [&] {
    std::ifstream file(folder_ / "out/forces.csv");
    std::string line, last;
    while (std::getline(file, line)) last = line;
    std::istringstream cells(last);
    for (int i = 0; i < 14; ++i) std::getline(cells, line, ',');
    return std::stod(line);  // all_y
  };
  ASSERT_EQ(run("tasks/press.json", press + "--set /space/remesh/relative_tolerance=1e-5").status, 0);
  const double reference = force();
  constexpr double kStarved = 0.03;
  double larger = 1e300;
  for (const char* tolerance : {"1e-2", "1e-3", "1e-4", "1e-5", "1e-6", ""}) {
    const std::string set = *tolerance ? std::string("--set '/solver/nonlinear={\"x_delta\": ") + tolerance + "}'" : "";
    const Said said = run("tasks/press.json", press + set);
    ASSERT_EQ(said.status, 0) << said.text;
    const double error = std::abs(force() / reference - 1);
    EXPECT_LE(error, larger + 2e-3) << tolerance;
    if (error > 0.02) {
      EXPECT_NE(said.text.find("Newton ended where one more iteration would gain"), std::string::npos) << tolerance;
    }
    // Where remeshing starves, about 5 % are the mesh's whatever the tolerance, and errors do not compare.
    larger = error > kStarved ? 1e300 : error;
  }
  EXPECT_LT(larger, 0.02);
}

}  // namespace
}  // namespace itr
