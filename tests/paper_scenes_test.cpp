// SPDX-License-Identifier: MIT
// The paper's own scenes, unmodified, as the reference implementation reads them.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "itr/core.hpp"
#include "itr/scene.hpp"

namespace itr::scene {
namespace {

namespace fs = std::filesystem;

const fs::path kScripts = fs::path(ITR_SHARED_DIR) / "paper-scenes" / "scripts";

/// They are not part of the project: a machine without them does without.
class PaperScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kScripts)) GTEST_SKIP() << "a machine without the data of the paper does without: no " << kScripts;
  }
};

int num_vertices(const Scene& scene) {
  return std::visit([](const auto& s) { return s.mesh.num_vertices() + static_cast<int>(s.obstacles.rest.size()); },
                    scene.setup);
}

TEST_F(PaperScenes, AreReadAndHaveTheVerticesOfTheReferenceRuns) {
  const std::vector<std::pair<const char*, int>> scenes = {
      {"cantilever/cantilever.json", 81},  {"masticator/h=0.1.json", 249},    {"masticator/h=0.1-noremesh.json", 249},
      {"masticator/h=0.2.json", 0},        {"masticator/h=0.05.json", 0},     {"ball-wall/2D.json", 141},
      {"ball-wall/2D-noremesh.json", 141}, {"shake-rod/shake-rod-y.json", 0}, {"spikes2d/spikes2d.json", 676},
      {"spikes2d/drop-bar.json", 0}};
  for (const auto& [name, expected] : scenes) {
    const Scene scene = read(kScripts / name);
    if (expected > 0) {
      EXPECT_EQ(num_vertices(scene), expected) << name;
    }
    EXPECT_EQ(std::visit([](const auto& s) { return s.mesh.find_defect(); }, scene.setup), "") << name;
  }
  for (const auto& entry : fs::directory_iterator(kScripts / "unit-tests"))
    if (entry.path().extension() == ".json") {
      EXPECT_NO_THROW(read(entry.path())) << entry.path();
    }
}

TEST_F(PaperScenes, Masticator) {
  const Scene scene = read(kScripts / "masticator" / "h=0.1.json");
  const auto& setup = std::get<itr::Setup<2>>(scene.setup);

  EXPECT_EQ(setup.time.steps, 200);
  EXPECT_EQ(setup.materials.at(0).youngs_modulus, 1e4);
  EXPECT_EQ(setup.contact.barrier_stiffness, 1e3);
  EXPECT_FALSE(setup.contact.adaptive_stiffness);
  EXPECT_TRUE(setup.contact.convergent);
  EXPECT_EQ(setup.contact.friction_iterations, 1000);
  EXPECT_EQ(setup.remesh.split.acceptance_tolerance, 0.4);
  EXPECT_FALSE(setup.remesh.collapse.acceptance_tolerance);  // the scene does not say
  EXPECT_EQ(setup.newton.max_iterations, 3000);
  EXPECT_DOUBLE_EQ(setup.newton.step_tolerance, 1e-3 * 0.05);
  ASSERT_EQ(setup.obstacles.motions.size(), 2u);
  const double down = 0.76 * (1 - 4. / 5) * std::tanh(5 * (1 - 4. / 5)) - 0.76;
  EXPECT_NEAR(setup.obstacles.motions[0]({0, 0.5}, 4)[1], down, 1e-15);
  EXPECT_NEAR(setup.obstacles.motions[1]({0, 0.5}, 4)[1], -down, 1e-15);
}

TEST_F(PaperScenes, BrokenOnesSayWhy) {
  const auto place = [](const char* name) {
    try {
      read(kScripts / name);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string("nothing wrong");
  };
  EXPECT_EQ(place("masticator/2D.json"), "/geometry/0/mesh");
  EXPECT_EQ(place("spikes3d/drop-ball-noremesh-nref1.json"), "/patch/2");
  EXPECT_EQ(place("common.json"), "/geometry");
}

}  // namespace
}  // namespace itr::scene
