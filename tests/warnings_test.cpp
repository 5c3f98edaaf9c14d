// SPDX-License-Identifier: MIT
// What `itr run` says of a run that it distrusts: in words, in steps.jsonl and in summary.json, over --resume too.
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
  bool has(const std::string& words) const { return text.find(words) != std::string::npos; }
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
  Json summary() const { return Json::parse(std::ifstream(folder_ / "out" / "summary.json")); }

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

TEST_F(WarningsTest, AreSaidCountedAndStored) {
  const std::string steps = "--set /time/tend=0.25 --set /time/dt=0.1 --set /contact/friction_coefficient=0.5";
  const Said said = run("cantilever.json", steps);
  EXPECT_EQ(said.status, 0) << said.text;
  EXPECT_TRUE(said.has("warning: /time/tend: 0.25 s is no whole number of steps")) << said.text;
  EXPECT_TRUE(said.has("2 warnings: see above, or summary.json")) << said.text;
  const Json before = summary();
  EXPECT_EQ(before["warning_count"], 2);
  ASSERT_EQ(before["warnings"].size(), 2u);
  EXPECT_NE(before["warnings"][0]["text"].get<std::string>().find("/time/tend"), std::string::npos);

  // Warnings from before are not lost, nor counted twice.
  const Said resumed = run("cantilever.json", steps + " --set /time/tend=0.35 --resume");
  EXPECT_EQ(resumed.status, 0) << resumed.text;
  EXPECT_EQ(summary()["warning_count"], 3) << summary()["warnings"];
}

TEST_F(WarningsTest, AreNotThereWhereNothingIsWrong) {
  const Said said = run("cantilever.json", "--set /time/tend=0.2 --set /time/dt=0.1");
  EXPECT_FALSE(said.has("warning:")) << said.text;
  EXPECT_EQ(summary()["warning_count"], 0);
}

TEST_F(WarningsTest, LinearElasticityThatTurns) {
  const Said said =
      run("cantilever.json", "--set '/materials/0/type=\"LinearElasticity\"' --set /time/tend=0.3 --overwrite");
  EXPECT_TRUE(said.has(": body 1 is linear elastic and turns by")) << said.text;
  EXPECT_EQ(summary()["warning_count"], 1);
}

TEST_F(WarningsTest, ToleranceThatStarvesRemeshing) {
  const std::string loose = "tasks/press.json --set '/solver/nonlinear={\"x_delta\": 1e-2}' --set /time/tend=0.2";
  EXPECT_TRUE(itr("explain " ITR_SOURCE_DIR "/examples/" + loose).has("warning: Newton ends at steps of"));
  const Said said = run(loose);
  EXPECT_TRUE(said.has("Newton ended where one more iteration would gain")) << said.text;
  EXPECT_TRUE(said.has("refinement sees the residual")) << said.text;
  EXPECT_FALSE(run("tasks/press.json", "--set /time/tend=0.2 --overwrite").has("warning:"));
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
      EXPECT_TRUE(said.has("Newton ended where one more iteration would gain")) << tolerance << said.text;
    }
    // Where remeshing starves, about 5 % are the mesh's whatever the tolerance, and errors do not compare.
    larger = error > kStarved ? 1e300 : error;
  }
  EXPECT_LT(larger, 0.02);
}

TEST_F(WarningsTest, LoadOnWhatIsHeld) {
  const std::string both =
      "--set '/boundary_conditions/dirichlet_boundary=[{\"id\": 1, \"value\": [0, 0]}]' "
      "--set '/boundary_conditions/neumann_boundary=[{\"id\": 1, \"value\": [0, 1]}]'";
  const std::string scene = "explain " ITR_SOURCE_DIR "/examples/cantilever.json ";
  EXPECT_TRUE(itr(scene + both).has("a load acts on the surface 1, of which all vertices are held"))
      << itr(scene + both).text;
  EXPECT_FALSE(itr(scene).has("a load acts on"));
}

/// Without remeshing forces are what is off.
TEST_F(WarningsTest, ToleranceThatLeavesForcesOff) {
  const std::string fixed =
      "--set /space/remesh/enabled=false --set /time/tend=0.4 --set /time/quasistatic=true --overwrite ";
  const Said said = run("tasks/press.json", fixed + "--set '/solver/nonlinear={\"x_delta\": 3e-2}'");
  EXPECT_TRUE(said.has("forces may be off by about")) << said.text;
  EXPECT_FALSE(run("tasks/press.json", fixed).has("forces may be off")) << said.text;
}

TEST_F(WarningsTest, DistanceThatIsNotSmall) {
  const std::string press = "explain " ITR_SOURCE_DIR "/examples/tasks/press.json ";
  const Said said = itr(press + "--set /contact/dhat=0.001");
  EXPECT_TRUE(said.has("of the thickness of body 1")) << said.text;
  EXPECT_TRUE(said.has("forces may be too large by some percent")) << said.text;
  EXPECT_TRUE(itr(press + "--set /contact/dhat=0.01 --set /contact/dhat_percentage=10").has("by tens of percent"));
  EXPECT_FALSE(itr(press).has("of the thickness of body")) << said.text;
}

TEST_F(WarningsTest, FrictionInPercent) {
  const std::string press = "explain " ITR_SOURCE_DIR "/examples/tasks/press.json ";
  EXPECT_TRUE(itr(press + "--set /contact/friction_coefficient=30").has("friction coefficient 30 is unusual"));
  EXPECT_FALSE(itr(press).has("friction coefficient"));
}

TEST_F(WarningsTest, SelectionOfNothing) {
  const std::string press = "explain " ITR_SOURCE_DIR "/examples/tasks/press.json --set '/geometry/0/surface_selection=[";
  const std::string all = R"({"id": 5, "box": [[-1, -1], [1, 1]]})", far = R"({"id": 6, "box": [[50, 50], [60, 60]]})";
  EXPECT_TRUE(itr(press + all + "," + far + "]'").has("/geometry/0/surface_selection/1: selects nothing: no barycentre"));
  EXPECT_FALSE(itr(press + all + "]'").has("selects nothing"));
}

/// Where the scene asks for no tolerance, the last digit of the energy is all that there is.
TEST_F(WarningsTest, RoundOffIsNoneWhereAllDigitsAreThere) {
  const Said said = run("tasks/press.json", "--set /materials/0/E=2e9 --set /time/quasistatic=true --set /time/tend=0.2");
  EXPECT_EQ(said.status, 0) << said.text;
  EXPECT_FALSE(said.has("round-off")) << said.text;
}

TEST_F(WarningsTest, LockingElements) {
  const std::string twist = "explain " ITR_SOURCE_DIR "/examples/tasks/twist.json --set /space/remesh/enabled=false ";
  EXPECT_TRUE(itr(twist + "--set /materials/0/nu=0.499").has("they lock, forces are too large")) << itr(twist).text;
  EXPECT_TRUE(itr(twist).has("where it bends they are too stiff")) << itr(twist).text;
  EXPECT_FALSE(itr(twist + "--set /space/discr_order=2 --set /materials/0/nu=0.499").has("lock"));
  const std::string remeshed = "explain " ITR_SOURCE_DIR "/examples/tasks/twist.json ";
  EXPECT_TRUE(itr(remeshed + "--set /materials/0/nu=0.49").has("remeshing takes most of that away"));
  EXPECT_FALSE(itr(remeshed).has("lock")) << itr(remeshed).text;
  EXPECT_TRUE(itr(remeshed).has("where it bends they are too stiff")) << itr(remeshed).text;
}

/// Without a floor, inertia or anything that holds it.
TEST_F(WarningsTest, BodyThatFliesAwayStopsTheRun) {
  const std::string fly =
      "--set /geometry/1/enabled=false --set /contact/enabled=false --set /time/quasistatic=true "
      "--set '/time/integrator=\"ImplicitEuler\"' --set /time/tend=0.01 --overwrite "
      "--set /solver/nonlinear/max_iterations=100 ";
  EXPECT_TRUE(itr("explain " ITR_SOURCE_DIR "/examples/tasks/drop.json " + fly).has("nothing keeps them in place"));
  const Said said = run("tasks/drop.json", fly);
  EXPECT_NE(said.status, 0) << said.text;
  EXPECT_TRUE(said.has("no equilibrium")) << said.text;
  EXPECT_FALSE(run("tasks/drop.json", fly + "--set /time/allow_jumps=true").has("no equilibrium"));
}

TEST_F(WarningsTest, RemeshingSaysWhatItDid) {
  EXPECT_TRUE(run("cantilever.json", "--set /time/tend=0.2").has("remeshing: 81 vertices at the start"));
  const Said idle =
      run("cantilever.json", "--set /time/tend=0.2 --set /space/remesh/split/acceptance_tolerance=1e9 --overwrite");
  EXPECT_TRUE(idle.has("accepted nothing, because no")) << idle.text;
}

}  // namespace
}  // namespace itr
