// SPDX-License-Identifier: MIT
// `/shapes` of scenes: obstacles are refined on them, and vertices tell their numbers.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "geometry/shape.hpp"
#include "scene_folder.hpp"

namespace itr::scene {
namespace {

constexpr double kRadius = 0.7;
constexpr int kSides = 12;

struct ShapesScene : SceneTest {
  /// The square above a polygon or a tube of few sides; an obstacle of id 8 around (0.2, -1).
  json above(const char* mesh, const json& shape) {
    json scene = square({{"contact", {{"enabled", true}, {"dhat", 1e-3}}}, {"shapes", json::array({shape})}});
    scene["shapes"][0]["surface"] = 8;
    scene["geometry"].push_back({{"mesh", mesh}, {"is_obstacle", true}, {"surface_selection", 8}});
    return scene;
  }
  static Vec<2> corner(int k) {
    const double angle = 2 * std::numbers::pi * k / kSides;
    return {0.2 + kRadius * std::cos(angle), -1 + kRadius * std::sin(angle)};
  }
  void write_polygon() {
    std::string text;
    for (int k = 0; k < kSides; ++k) text += fmt::format("v {:.17g} {:.17g} 0\n", corner(k)[0], corner(k)[1]);
    for (int k = 0; k < kSides; ++k) text += fmt::format("l {} {}\n", k + 1, (k + 1) % kSides + 1);
    write("polygon.obj", text);
  }
  void write_tube() {
    std::string text;
    for (int k = 0; k < kSides; ++k)
      for (const double z : {0.0, 0.5}) text += fmt::format("v {:.17g} {:.17g} {}\n", corner(k)[0], corner(k)[1], z);
    for (int k = 0; k < kSides; ++k) {
      const int a = 2 * k + 1, b = 2 * ((k + 1) % kSides) + 1;
      text += fmt::format("f {} {} {}\nf {} {} {}\n", a, b, b + 1, a, b + 1, a + 1);
    }
    write("tube.obj", text);
  }
};

TEST_F(ShapesScene, RefineObstaclesOnCircles) {
  write_polygon();
  for (const json& shape :
       {json{{"type", "circle"}}, json{{"type", "circle"}, {"center", {0.2, -1}}, {"radius", kRadius}}}) {
    const auto setup = read2(above("polygon.obj", shape));
    EXPECT_GE(setup.obstacles.edges.size(), 96u);
    EXPECT_LE(setup.obstacles.edges.size(), 192u);
    for (const auto& p : setup.obstacles.rest) EXPECT_NEAR((p - Vec<2>(0.2, -1)).norm(), kRadius, 1e-14);
    EXPECT_TRUE(setup.shapes.empty());
  }
  const auto fine = read2(above("polygon.obj", {{"type", "fitted"}, {"sag", 1e-5}}));
  for (const auto& [a, b] : fine.obstacles.edges) {
    const Vec<2> middle = (fine.obstacles.rest[a] + fine.obstacles.rest[b]) / 2;
    EXPECT_NEAR((middle - Vec<2>(0.2, -1)).norm(), kRadius, 1.5e-5);
  }
}

TEST_F(ShapesScene, RefineObstaclesInSpace) {
  write_tube();
  json scene = above("tube.obj", {{"type", "fitted"}});
  scene["geometry"][0]["mesh"] = "tet.msh";
  const auto setup = std::get<itr::Setup<3>>(read_scene(scene).setup);
  EXPECT_GT(setup.obstacles.triangles.size(), 32u);
  for (const auto& p : setup.obstacles.rest) EXPECT_NEAR((p.head<2>() - Vec<2>(0.2, -1)).norm(), kRadius, 1e-12);
  for (const auto& [a, b] : setup.obstacles.edges) {
    const Vec<3> middle = (setup.obstacles.rest[a] + setup.obstacles.rest[b]) / 2;
    const double length = (setup.obstacles.rest[b] - setup.obstacles.rest[a]).norm();
    EXPECT_LE(kRadius - (middle.head<2>() - Vec<2>(0.2, -1)).norm(), kMostSag<3> * length);
  }
}

TEST_F(ShapesScene, RefuseObstaclesThatAreNotOnThem) {
  write_polygon();
  EXPECT_EQ(failure(above("polygon.obj", {{"type", "plane"}})).place, "/shapes/0/surface");
  EXPECT_EQ(failure(above("polygon.obj", {{"type", "circle"}, {"center", {0.2, -1}}, {"radius", 2}})).place, "/shapes/0");
}

}  // namespace
}  // namespace itr::scene
