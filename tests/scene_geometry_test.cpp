// SPDX-License-Identifier: MIT
// Meshes of a scene: selections, transformations, copies, obstacles.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "scene_folder.hpp"
#include "simulation/step_problem.hpp"

namespace itr::scene {
namespace {

TEST_F(SceneTest, SmallBodiesHaveSidesAndAreNotFlat) {
  write("small.obj", "v 0 0 0\nv 1e-7 0 0\nv 1e-7 1e-7 0\nv 0 1e-7 0\nf 1 2 3\nf 1 4 3\n");
  const json geometry = {{"mesh", "small.obj"}, {"volume_selection", 1}, {"surface_selection", {{"threshold", -1}}}};
  const itr::Setup<2> setup = read2(square({{"geometry", json::array({geometry})}}));
  EXPECT_EQ(setup.mesh.facet_tag(setup.mesh.find_facet({2, 3})), 4);
  EXPECT_EQ(setup.mesh.facet_tag(setup.mesh.find_facet({1, 2})), 3);
  write("bent.obj", "v 0 0 0\nv 1e-6 0 0\nv 1e-6 1e-6 5e-7\nv 0 1e-6 0\nf 1 2 3\nf 1 4 3\n");
  EXPECT_EQ(wrong_place({{"geometry", {{"mesh", "bent.obj"}}}}), "/geometry/mesh");
  write("long.obj", "v 0 0 0\nv 1e6 0 0\nv 1e6 1e6 1e-3\nv 0 1e6 0\nf 1 2 3\nf 1 4 3\n");
  EXPECT_EQ(read2(square({{"geometry", json::array({{{"mesh", "long.obj"}, {"volume_selection", 1}}})}})).mesh.num_cells(),
            2);
}

TEST_F(SceneTest, SelectionsOfSurfacesAndVolumes) {
  const auto tags = [&](const json& selection) {
    const json geometry = {{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", selection}};
    const itr::Setup<2> setup = read2(square({{"geometry", json::array({geometry})}}));
    std::array<int, 4> result;  // bottom, right, top, left
    const std::array<std::array<int, 2>, 4> facets = {{{0, 1}, {1, 2}, {2, 3}, {3, 0}}};
    for (int i = 0; i < 4; ++i) result[i] = setup.mesh.facet_tag(setup.mesh.find_facet(facets[i]));
    return result;
  };
  using Tags = std::array<int, 4>;

  EXPECT_EQ(tags(5), (Tags{5, 5, 5, 5}));
  EXPECT_EQ(tags({{"threshold", 0.001}}), (Tags{2, 3, 4, 1}));
  EXPECT_EQ(tags({{"threshold", 0.001}, {"id_offset", 10}}), (Tags{12, 13, 14, 11}));
  EXPECT_EQ(tags({{"threshold", -1}}), (Tags{2, 3, 4, 1}));
  EXPECT_EQ(tags({{"id", 9}, {"axis", "-y"}, {"position", 0.1}}), (Tags{9, kNoTag, kNoTag, kNoTag}));
  EXPECT_EQ(tags({{"id", 9}, {"axis", 2}, {"position", 0.9}, {"relative", true}}), (Tags{kNoTag, kNoTag, 9, kNoTag}));
  EXPECT_EQ(tags(json::parse(R"([{"id": 1, "box": [[0.4, -1], [0.6, 0.1]]}, {"id": 2, "center": [1, 0.5], "radius": 0.1},
                                 {"id": 3, "p1": [0.5, 0.9], "p2": [0.5, 1.1], "radius": 0.1},
                                 {"id": 4, "normal": [-1, 0], "point": [0.1, 0]}])")),
            (Tags{1, 2, 3, 4}));
  EXPECT_EQ(tags(json::parse(R"([{"id": 6, "axis": 1, "position": 0.9}, 8])")), (Tags{8, 6, 8, 8}));
}

TEST_F(SceneTest, SelectionsOfNothingMeantAreRefused) {
  const auto place = [&](const char* selection) {
    return wrong_place({{"geometry", {{"mesh", "square.obj"}, {"surface_selection", json::parse(selection)}}}});
  };
  EXPECT_EQ(place(R"({"id": 1, "axis": "w"})"), "/geometry/surface_selection/axis");
  EXPECT_EQ(place(R"({"id": 1, "normal": [0, 0], "point": [0, 0]})"), "/geometry/surface_selection/normal");
  EXPECT_EQ(place(R"({"id": 1, "center": [0, 0], "radius": -1})"), "/geometry/surface_selection/radius");
  EXPECT_EQ(place(R"({"id": 1, "p1": [0, 0], "p2": [1, 0], "radius": -1})"), "/geometry/surface_selection/radius");
}

TEST_F(SceneTest, TransformationsScaleRotateTranslate) {
  const auto point = [&](const json& transformation) -> Vec<2> {
    return read2(square({{"geometry", {{"mesh", "square.obj"}, {"transformation", transformation}}},
                         {"materials", {{"type", "NeoHookean"}, {"E", 1}, {"nu", 0}}}}))
        .mesh.rest(2);
  };
  EXPECT_TRUE(point({{"scale", 2}, {"rotation", 90}, {"translation", {1, 0, 7}}}).isApprox(Vec<2>(-1, 2)));
  EXPECT_TRUE(point({{"dimensions", {3, 4}}, {"scale", 100}}).isApprox(Vec<2>(3, 4)));
  EXPECT_TRUE(point({{"scale", {-1, 1}}}).isApprox(Vec<2>(-1, 1)));

  json tet = square({{"geometry", {{"mesh", "tet.msh"}, {"transformation", {{"rotation", {0, 90, 90}}}}}}});
  tet["materials"] = {{"type", "NeoHookean"}, {"E", 1}, {"nu", 0}};
  const auto z_of_x = [&](const char* mode) -> Vec<3> {
    tet["geometry"]["transformation"]["rotation_mode"] = mode;
    return std::get<itr::Setup<3>>(read_scene(tet).setup).mesh.rest(1);
  };
  EXPECT_TRUE(z_of_x("xyz").isApprox(Vec<3>(0, 0, -1)));  // about y first: x goes to -z, which z leaves
  EXPECT_TRUE(z_of_x("zyx").isApprox(Vec<3>(0, 1, 0)));   // about z first: x goes to y, which y leaves
}

TEST_F(SceneTest, BodiesAreConcatenatedAndCopied) {
  const itr::Setup<2> setup = read2(square(json::parse(R"({"geometry": [
      {"mesh": "square.obj", "volume_selection": 1},
      {"mesh": "missing.obj", "enabled": false},
      {"mesh": "square.obj", "type": "mesh_array", "volume_selection": [{"id": 2, "axis": 1, "position": 0.5}, 1],
       "array": {"offset": 1.5, "size": [2, 2, 1], "relative": true}, "transformation": {"translation": [5, 0]},
       "surface_selection": 3}],
      "materials": [{"id": [1, 2], "type": "NeoHookean", "E": 1, "nu": 0.3}]})")));

  EXPECT_EQ(setup.mesh.num_vertices(), 20);
  EXPECT_EQ(setup.mesh.num_cells(), 10);
  EXPECT_EQ(setup.mesh.rest(8), Vec<2>(5, 1.5));
  EXPECT_EQ(setup.mesh.rest(12), Vec<2>(6.5, 0));
  EXPECT_EQ(setup.mesh.body(2), 2);
  EXPECT_EQ(setup.mesh.facet_tag(setup.mesh.find_facet({4, 5})), 3);
  EXPECT_EQ(setup.mesh.facet_tag(setup.mesh.find_facet({0, 1})), kNoTag);
  EXPECT_EQ(setup.mesh.find_defect(), "");
}

TEST_F(SceneTest, ObstaclesAreRefined) {
  const auto obstacles = [&](const char* mesh, int n_refs) {
    json geometry = json::array(
        {{{"mesh", "square.obj"}, {"volume_selection", 1}}, {{"mesh", mesh}, {"is_obstacle", true}, {"n_refs", n_refs}}});
    geometry[1]["transformation"] = {{"translation", {0, -5}}};
    return read2(square({{"geometry", geometry}})).obstacles;
  };
  EXPECT_EQ(obstacles("line.obj", 3).edges.size(), 8u);
  const auto square_boundary = obstacles("square.obj", 2);
  EXPECT_EQ(square_boundary.edges.size(), 16u);
  EXPECT_EQ(square_boundary.rest.size(), 16u);
  for (const auto& [a, b] : square_boundary.edges)
    EXPECT_DOUBLE_EQ((square_boundary.rest[a] - square_boundary.rest[b]).norm(), 0.25);

  json tet = square();
  tet["geometry"] = json::array(
      {{{"mesh", "tet.msh"}, {"volume_selection", 1}}, {{"mesh", "tet.msh"}, {"is_obstacle", true}, {"n_refs", 2}}});
  tet["geometry"][1]["transformation"] = {{"translation", {0, 0, -5}}};
  const auto surface = std::get<itr::Setup<3>>(read_scene(tet).setup).obstacles;
  EXPECT_EQ(surface.triangles.size(), 64u);
  EXPECT_EQ(surface.rest.size(), 34u);  // Euler: v - e + f = 2
  EXPECT_EQ(surface.edges.size(), 96u);
  Vec<3> area = Vec<3>::Zero();
  double total = 0;
  for (const auto& [a, b, c] : surface.triangles) {
    const Vec<3> twice = (surface.rest[b] - surface.rest[a]).cross(surface.rest[c] - surface.rest[a]);
    area += twice / 2;
    total += twice.norm() / 2;
  }
  EXPECT_LT(area.norm(), 1e-13);  // closed, all turned the same way
  EXPECT_NEAR(total, 1.5 + std::sqrt(3.0) / 2, 1e-13);
  for (const int too_much : {12, 17}) {
    tet["geometry"][1]["n_refs"] = too_much;
    EXPECT_EQ(failure(tet).place, "/geometry/1/n_refs");
  }
}

TEST_F(SceneTest, PlanesAndGround) {
  json scene = square({{"contact", {{"enabled", true}}}});
  scene["geometry"].push_back({{"type", "ground"}, {"height", -0.5}, {"surface_selection", 3}});
  scene["geometry"].push_back({{"type", "plane"}, {"point", {2, 0}}, {"normal", {-2, 0}}});
  const itr::Setup<2> setup = read2(scene);
  ASSERT_EQ(setup.obstacles.rest.size(), 4u);
  ASSERT_EQ(setup.obstacles.edges.size(), 2u);
  for (int v : {0, 1}) EXPECT_DOUBLE_EQ(setup.obstacles.rest[v].y(), -0.5);
  EXPECT_GT((setup.obstacles.rest[1] - setup.obstacles.rest[0]).norm(), 20);
  for (int v : {2, 3}) EXPECT_DOUBLE_EQ(setup.obstacles.rest[v].x(), 2);

  json solid = square({{"geometry", {{"mesh", "tet.msh"}, {"volume_selection", 1}}}, {"contact", {{"enabled", true}}}});
  solid["geometry"] = json::array({solid["geometry"], {{"type", "plane"}, {"point", {0, 0, -1}}, {"normal", {1, 2, 3}}}});
  const auto in_space = std::get<itr::Setup<3>>(read_scene(solid).setup);
  ASSERT_EQ(in_space.obstacles.triangles.size(), 1u) << "an edge in its middle has a barrier of its own";
  for (const Vec<3>& p : in_space.obstacles.rest)
    EXPECT_NEAR((p - Vec<3>(0, 0, -1)).dot(Vec<3>(1, 2, 3)), 0, 1e-12 * p.norm());

  scene["geometry"][1] = {{"type", "plane"}, {"point", {0, 0}}};
  EXPECT_EQ(failure(scene).place, "/geometry/1/normal");
  scene["geometry"][1] = {{"type", "ground"}, {"normal", {0, 1}}};
  EXPECT_EQ(failure(scene).place, "/geometry/1/normal");
  scene["geometry"][1] = {{"type", "ground"}, {"mesh", "line.obj"}};
  EXPECT_EQ(failure(scene).place, "/geometry/1/mesh");
}

TEST_F(SceneTest, SelectedPointsAreHeld) {
  const json scene = square(json::parse(R"json({
    "geometry": [{"mesh": "square.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-3},
                  "point_selection": [{"id": 9, "box": [[0.5, 0.5], [2, 2]]}]}],
    "boundary_conditions": {"dirichlet_boundary": [{"id": 9, "value": ["t", 0]}, {"id": 3, "value": [5, 5]}]}})json"));
  const auto setup = read2(scene);
  for (VertexId v = 0; v < 4; ++v) EXPECT_EQ(setup.mesh.vertex_tag(v), v == 2 ? 9 : kNoTag);
  const HeldDofs<2> held = held_dofs(setup, setup.mesh, 2);
  EXPECT_EQ(held.held, (std::vector<char>{0, 0, 1, 1, 1, 1, 0, 0}));
  EXPECT_EQ(held.target.segment<2>(2), Vec<2>(6, 5));  // its facet is of the right side
  EXPECT_EQ(held.target.segment<2>(4), Vec<2>(3, 1));  // points win
}

}  // namespace
}  // namespace itr::scene
