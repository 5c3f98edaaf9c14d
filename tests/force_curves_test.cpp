// SPDX-License-Identifier: MIT
// forces.csv: what it sums, that it goes on over --resume, and that `itr forces` makes the same from frames.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>

namespace itr {
namespace {

namespace fs = std::filesystem;

class ForceCurvesTest : public ::testing::Test {
 protected:
  ForceCurvesTest() : folder_(fs::path(::testing::TempDir()) / ("itr_curves_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~ForceCurvesTest() override { fs::remove_all(folder_); }

  int itr(const std::string& arguments) {
    FILE* pipe = popen((std::string(ITR_BINARY_DIR) + "/bin/itr " + arguments + " 2>&1").c_str(), "r");
    said_.clear();
    for (std::array<char, 4096> buffer; std::fgets(buffer.data(), buffer.size(), pipe);) said_ += buffer.data();
    return WEXITSTATUS(pclose(pipe));
  }
  int press(const std::string& folder, const std::string& more, const std::string& forces = kForces) {
    return itr("run " ITR_SOURCE_DIR
               "/examples/tasks/press.json --threads 1 --set /time/quasistatic=true "
               "--set /geometry/2/name='\"plate\"' --set '/output/forces=" +
               forces + "' --set /output/checkpoint_period=0 -o " + (folder_ / folder).string() + " " + more);
  }
  std::string text(const std::string& file) const {
    std::ostringstream all;
    all << std::ifstream(folder_ / file).rdbuf();
    return all.str();
  }
  /// Name -> column -> value, of the last step.
  std::map<std::string, std::map<std::string, double>> last(const std::string& file) const {
    std::istringstream lines(text(file));
    std::string line;
    const auto cells = [&] {
      std::vector<std::string> parts;
      std::istringstream stream(line);
      for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
      return parts;
    };
    std::getline(lines, line);
    const std::vector<std::string> head = cells();
    std::map<std::string, std::map<std::string, double>> values;
    while (std::getline(lines, line)) {
      const std::vector<std::string> row = cells();
      for (std::size_t i = 3; i < row.size(); ++i)
        if (!row[i].empty()) values[row[2]][head.at(i)] = std::stod(row[i]);
    }
    return values;
  }

  static constexpr const char* kForces =
      R"([{"name": "top", "obstacles": "plate", "about": [0, 0.05]}, {"name": "bottom", "obstacles": [1]},)"
      R"( {"name": "disc", "bodies": 1}])";
  fs::path folder_;
  std::string said_;
};

TEST_F(ForceCurvesTest, BalanceAndSurviveResume) {
  ASSERT_EQ(press("whole", "--set /time/tend=0.15"), 0) << said_;
  const std::string whole = text("whole/forces.csv");
  EXPECT_TRUE(whole.starts_with("step,t,name,contact_x,contact_y,contact_moment,friction_x,"));
  EXPECT_NE(whole.find("\n0,0,top,"), std::string::npos);
  auto sums = last("whole/forces.csv");
  const double top = sums["top"]["contact_y"];
  EXPECT_GT(top, 0.1);  // the disc pushes the upper plate up
  EXPECT_NEAR(sums["bottom"]["contact_y"], -top, 1e-3 * top);
  for (const char* kind : {"contact", "friction"})
    for (const char* c : {"_x", "_y"})
      EXPECT_NEAR(sums["disc"][kind + std::string(c)],
                  -sums["top"][kind + std::string(c)] - sums["bottom"][kind + std::string(c)], 1e-9 * top)
          << kind << c;
  EXPECT_DOUBLE_EQ(sums["top"]["all_y"], sums["top"]["contact_y"] + sums["top"]["friction_y"]);

  ASSERT_EQ(press("parts", "--set /time/tend=0.1"), 0) << said_;
  ASSERT_EQ(press("parts", "--set /time/tend=0.15 --resume"), 0) << said_;
  EXPECT_EQ(text("parts/forces.csv"), whole);

  fs::remove(folder_ / "parts/forces.csv");
  ASSERT_EQ(itr("forces " + (folder_ / "parts").string()), 0) << said_;
  EXPECT_EQ(text("parts/forces.csv"), whole);
}

/// Rows of steps without a frame have no other place than the file.
TEST_F(ForceCurvesTest, NoRowIsLostThatFramesDoNotHave) {
  ASSERT_EQ(press("run", "--set /time/tend=0.15 --set /output/paraview/skip_frame=4"), 0) << said_;
  const fs::path file = folder_ / "run/forces.csv";
  const std::string whole = text("run/forces.csv"), command = "forces " + (folder_ / "run").string();
  const auto write = [&](const std::string& rows) { std::ofstream(file, std::ios::binary) << rows; };
  ASSERT_EQ(itr(command), 0) << said_;
  EXPECT_EQ(text("run/forces.csv"), whole);

  const std::size_t fourth = whole.find("\n4,") + 1, fifth = whole.find("\n5,") + 1;
  write(whole.substr(0, fourth) + whole.substr(fifth));  // rows that a frame has come back, at their place
  ASSERT_EQ(itr(command), 0) << said_;
  EXPECT_EQ(text("run/forces.csv"), whole);
  write(whole.substr(0, whole.size() - 1));  // without the end of the last line
  ASSERT_EQ(itr(command), 0) << said_;
  EXPECT_EQ(text("run/forces.csv"), whole);

  const std::string noted = whole.substr(0, fifth) + "# a note\n" + whole.substr(fifth);
  write(noted);
  EXPECT_EQ(itr(command), 2);
  EXPECT_NE(said_.find("forces.csv: line "), std::string::npos) << said_;
  EXPECT_EQ(text("run/forces.csv"), noted);
}

TEST_F(ForceCurvesTest, HaveErrorBarsAndPointsWhereTheyAreAskedFor) {
  const char* asked =
      "--set /time/tend=0.1 --set /output/error_bars=true --set /space/remesh/enabled=false "
      "--set '/output/points=[{\"name\": \"apex\", \"rest\": [0, 0.05]}]'";
  ASSERT_EQ(press("bars", asked), 0) << said_;
  EXPECT_NE(said_.find("peak force on top "), std::string::npos) << said_;
  EXPECT_NE(said_.find(" first\n"), std::string::npos) << said_;
  auto sums = last("bars/forces.csv");
  for (const char* source : {"mesh", "dhat", "friction", "lag", "solver"}) {
    const std::string name = std::string("_error_") + source;
    ASSERT_TRUE(sums["top"].contains("all_y" + name)) << name;
    const double error = sums["top"]["all_y" + name];
    EXPECT_NEAR(sums["bottom"]["all_y" + name], -error, 0.02 * std::abs(sums["top"]["all_y"])) << name;
  }
  EXPECT_GT(std::abs(sums["top"]["all_y_error_mesh"]), 1e-3 * sums["top"]["all_y"]);
  EXPECT_NE(text("bars/steps.jsonl").find(R"("bars":{"energy":{"mesh":)"), std::string::npos);
  EXPECT_TRUE(text("bars/points.csv").starts_with("step,t,name,x,y,u_x,u_y,u_x_error_mesh,u_y_error_mesh,"));
  const auto apex = last("bars/points.csv")["apex"];
  const double below_the_arc = 0.05 * std::cos(std::numbers::pi / 30);  // middle of the uppermost chord
  EXPECT_NEAR(apex.at("y") - apex.at("u_y"), below_the_arc, 1e-12);
  EXPECT_LT(apex.at("u_y"), -1e-4);

  const std::string whole = text("bars/forces.csv");
  ASSERT_EQ(itr("forces " + (folder_ / "bars").string()), 0) << said_;
  EXPECT_EQ(text("bars/forces.csv"), whole);
}

TEST_F(ForceCurvesTest, RefuseWhatNothingHas) {
  const auto refused = [&](const char* forces, const char* words) {
    EXPECT_EQ(press("none", "", forces), 2) << said_;
    EXPECT_NE(said_.find(words), std::string::npos) << said_;
  };
  refused(R"([{"name": "a", "obstacles": 7}])", "/output/forces/0/obstacles: found 7, which nothing has");
  refused(R"([{"name": "a", "obstacles": "door"}])", R"(or its name: 1, 2, "plate")");
  refused(R"([{"name": "a", "surfaces": 3}])", "/output/forces/0/surfaces");
  refused(R"([{"name": "a", "bodies": [1, 2]}])", "/output/forces/0/bodies/1: found 2");
  refused(R"([{"name": "a"}])", "at least one of them");
  refused(R"([{"bodies": 1}])", "/output/forces/0/name");
  refused(R"([{"name": "a", "bodies": 1}, {"name": "a", "bodies": 1}])", "/output/forces/1/name");
  ASSERT_EQ(press("plain", "--set /time/tend=0.05", "[]"), 0) << said_;
  EXPECT_FALSE(fs::exists(folder_ / "plain/forces.csv"));
  EXPECT_EQ(itr("forces " + (folder_ / "plain").string()), 2);
  EXPECT_NE(said_.find("/output/forces"), std::string::npos) << said_;
}

}  // namespace
}  // namespace itr
