// SPDX-License-Identifier: MIT
// PolyFEM's keys of geometry: sequences of meshes, boundaries cut into collision meshes, periodic boundaries.
#include <algorithm>
#include <map>

#include "advance.hpp"
#include "block.hpp"
#include "energy/elastic/law_table.hpp"
#include "scene/polyfem/tessellation.hpp"
#include "scene_folder.hpp"

namespace itr::scene {
namespace {

class PolyfemGeometry : public SceneTest {
 protected:
  /// A square above a line that moves as files say: up by 0.1, then to the right by 1.
  json sequence() {
    write("frames/line2.obj", "v -1 -0.9 0\nv 1 -0.9 0\nl 1 2\n");
    write("frames/line10.obj", "v 0 -0.9 0\nv 2 -0.9 0\nl 1 2\n");
    write("frames/line1.obj", "v -1 -1 0\nv 1 -1 0\nl 1 2\n");
    json scene = square();
    scene["geometry"].push_back({{"type", "mesh_sequence"},
                                 {"mesh_sequence", "frames"},
                                 {"fps", 10},
                                 {"is_obstacle", true},
                                 {"surface_selection", 7}});
    return scene;
  }
  void SetUp() override { fs::create_directories(folder_ / "frames"); }
};

TEST_F(PolyfemGeometry, ObstaclesMoveFromFileToFile) {
  json scene = sequence();
  const auto at = [&](double t) {
    const Obstacles<2> obstacles = read2(scene).obstacles;
    return Vec<2>(obstacles.motions.at(static_cast<std::size_t>(obstacles.motion.at(1)))({obstacles.rest[1]}, t));
  };
  EXPECT_LE((read2(scene).obstacles.rest.at(1) - Vec<2>(1, -1)).norm(), 1e-15);
  EXPECT_LE(at(0).norm(), 1e-15);
  EXPECT_LE((at(0.05) - Vec<2>(0, 0.05)).norm(), 1e-15);
  EXPECT_LE((at(0.175) - Vec<2>(0.75, 0.1)).norm(), 1e-14);  // line2 comes before line10
  EXPECT_LE((at(3) - Vec<2>(1, 0.1)).norm(), 1e-15);
  scene["geometry"][1]["transformation"] = {{"scale", 2}};
  EXPECT_LE((at(0.05) - Vec<2>(0, 0.1)).norm(), 1e-15);
  scene["geometry"][1]["mesh_sequence"] = "frames/line1*.obj";
  EXPECT_LE((at(0.1) - Vec<2>(2, 0.2)).norm(), 1e-15);
  scene["geometry"][1]["mesh_sequence"] = {"frames/line10.obj", "frames/line1.obj"};
  EXPECT_LE((at(0.1) - Vec<2>(-2, -0.2)).norm(), 1e-15);
}

TEST_F(PolyfemGeometry, SequencesAreRefusedByKey) {
  const auto place = [&](const std::string& key, const json& value) {
    json scene = sequence();
    scene["geometry"][1][key] = value;
    return failure(scene).place;
  };
  EXPECT_EQ(place("fps", nullptr), "/geometry/1/fps");
  EXPECT_EQ(place("fps", -1), "/geometry/1/fps");
  EXPECT_EQ(place("is_obstacle", false), "/geometry/1/is_obstacle");
  EXPECT_EQ(place("mesh", "line.obj"), "/geometry/1/mesh");
  EXPECT_EQ(place("type", "mesh"), "/geometry/1/mesh_sequence");
  EXPECT_EQ(place("mesh_sequence", "no_such"), "/geometry/1/mesh_sequence");
  write("frames/line11.obj", "v 0 -0.9 0\nv 2 -0.9 0\nv 3 0 0\nl 1 2 3\n");
  EXPECT_EQ(place("name", "moved"), "/geometry/1/mesh_sequence/3/mesh");
  fs::remove(folder_ / "frames/line11.obj");
  json scene = sequence();
  scene["boundary_conditions"]["obstacle_displacements"] = json::array({{{"id", 7}, {"value", {0, 1}}}});
  EXPECT_EQ(failure(scene).place, "/boundary_conditions/obstacle_displacements/0/id");
}

TEST_F(PolyfemGeometry, ChangedFilesOfASequenceAreAnotherScene) {
  const json scene = sequence();
  const std::string before = read_scene(scene).identity;
  EXPECT_EQ(read_scene(scene).identity, before);
  write("frames/line2.obj", "v -1 -0.8 0\nv 1 -0.8 0\nl 1 2\n");
  EXPECT_NE(read_scene(scene).identity, before);
}

/// Displacements of a polynomial at the nodes of a mesh with quadratic edges where `order` says so.
template <typename Function>
VectorX nodal(const Mesh<3>& mesh, const std::map<int, int>& order, const Function& f) {
  const auto curved = edges_of_order_2(mesh, order);
  VectorX u(3 * (mesh.num_vertices() + std::ssize(curved)));
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) u.segment<3>(3 * v) = f(mesh.rest(v));
  for (std::size_t e = 0; e < curved.size(); ++e)
    u.segment<3>(3 * (mesh.num_vertices() + static_cast<int>(e))) =
        f(Vec<3>((mesh.rest(curved[e][0]) + mesh.rest(curved[e][1])) / 2));
  return u;
}

void expect_cut(const Mesh<3>& mesh, const std::map<int, int>& order, const Cuts& cuts) {
  const CollisionProxy<3> proxy = tessellate(mesh, order, cuts);
  double area = 0;
  std::map<std::array<int, 2>, int> uses;
  for (const auto& t : proxy.triangles) {
    area += (proxy.rest[t[1]] - proxy.rest[t[0]]).cross(proxy.rest[t[2]] - proxy.rest[t[0]]).norm() / 2;
    for (int k = 0; k < 3; ++k) ++uses[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}];
  }
  EXPECT_NEAR(area, 6 * kSize * kSize, 1e-12);
  EXPECT_EQ(uses.size(), proxy.edges.size());
  for (const auto& [edge, count] : uses) {
    EXPECT_EQ(count, 2);  // no holes, also where facets of other sizes meet
    if (cuts.parts == 0) EXPECT_LE((proxy.rest[edge[0]] - proxy.rest[edge[1]]).norm(), cuts.longest);
  }
  const bool is_quadratic = !order.empty() && order.begin()->second == 2;
  const auto field = [&](const Vec<3>& X) {
    const double square = is_quadratic ? X[0] * X[1] - 2 * X[2] * X[2] : 0;
    return Vec<3>(1 + X[0] - square, X[1] + 2 * X[2], 0.5 * square);
  };
  const VectorX u = nodal(mesh, order, field);
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> by_node(u.data(), u.size() / 3, 3);
  const MatrixX moved = proxy.weights * by_node;
  for (std::size_t v = 0; v < proxy.rest.size(); ++v)
    EXPECT_LE((moved.row(static_cast<Eigen::Index>(v)).transpose() - field(proxy.rest[v])).norm(), 1e-13);
}

TEST(Tessellation, CutsFollowTheShapeFunctionsOfTheBoundary) {
  const Mesh<3> mesh = make_block<3>();
  for (const int order : {1, 2}) {
    expect_cut(mesh, {{1, order}}, {.parts = 9});
    for (const double longest : {0.3, 0.25, 0.08, 0.03}) expect_cut(mesh, {{1, order}}, {.longest = longest});
  }
}

TEST_F(PolyfemGeometry, CollisionMeshesAreCutBoundaries) {
  json scene = {{"defaults", "polyfem"},
                {"geometry", json::array({{{"mesh", "tet.msh"}, {"volume_selection", 1}}})},
                {"materials", json::array({{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}}})},
                {"space", {{"discr_order", 2}}},
                {"time", {{"dt", 0.1}, {"time_steps", 1}}},
                {"contact", {{"enabled", true}, {"collision_mesh", {{"max_edge_length", 0.3}}}}}};
  const auto proxy = [&] { return *std::get<itr::Setup<3>>(read_scene(scene).setup).proxy; };
  EXPECT_EQ(proxy().triangles.size(), 4 * 81);
  EXPECT_EQ(proxy().weights.cols(), 4 + 6);
  scene["contact"]["collision_mesh"]["tessellation_type"] = "irregular";
  const std::size_t coarse = proxy().triangles.size();
  scene["contact"]["collision_mesh"]["max_edge_length"] = 0.1;
  EXPECT_GT(proxy().triangles.size(), 4 * coarse);
  scene["contact"]["collision_mesh"]["max_edge_length"] = 1e-5;
  EXPECT_EQ(failure(scene).place, "/contact/collision_mesh/max_edge_length");
  json flat = square({{"contact", {{"enabled", true}, {"collision_mesh", {{"max_edge_length", 0.3}}}}}});
  EXPECT_EQ(failure(flat).place, "/contact/collision_mesh/max_edge_length");
}

/// A cell that is pressed by a tenth of its height, free across: its width grows by lambda/(lambda + 2 mu) of that.
TEST_F(PolyfemGeometry, PeriodicCellsAreFreeInComponentsThatAreNotFixed) {
  json scene = square({{"time", nullptr}, {"materials", {{"type", "LinearElasticity"}, {"E", 1e4}, {"nu", 0.3}}}});
  scene["boundary_conditions"]["periodic_boundary"] = {
      {"enabled", true}, {"linear_displacement_offset", {{0, 0}, {0, -0.1}}}, {"fixed_macro_strain", {3}}};
  const auto stretch = [&] {
    const itr::Setup<2> setup = read2(scene);
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    advance(simulation);
    const VectorX& x = simulation.state().history.x[0];
    Vec<2> u = Vec<2>::Zero();  // of the corner (1, 1), from the one that is held
    for (VertexId v = 0; v < 4; ++v)
      if (setup.mesh.rest(v) == Vec<2>(1, 1)) u = x.segment<2>(2 * v) - setup.mesh.rest(v);
    return u;
  };
  const Material material = read2(scene).materials.begin()->second;
  const double lambda = material.lame_lambda(2), ratio = lambda / (lambda + 2 * material.lame_mu());
  EXPECT_LE((stretch() - Vec<2>(0.1 * ratio, -0.1)).norm(), 1e-8);
  scene["boundary_conditions"]["periodic_boundary"]["fixed_macro_strain"] = {0, 1, 2, 3};
  EXPECT_LE((stretch() - Vec<2>(0, -0.1)).norm(), 1e-8);
  json by_ids = scene;
  by_ids["geometry"][0]["surface_selection"] = {{"threshold", 1e-6}};
  by_ids["boundary_conditions"] = {{"periodic", json::array({{{"boundary_ids", {1, 3}}}, {{"boundary_ids", {2, 4}}}})}};
  by_ids["constraints"] = {{"zero_mean", true},
                           {"macro_displacement_gradient", {{"value", {{0, 0}, {0, -0.1}}}, {"fixed_components", {3}}}}};
  std::swap(scene, by_ids);
  EXPECT_LE((stretch() - Vec<2>(0.1 * ratio, -0.1)).norm(), 1e-8);
}

TEST_F(PolyfemGeometry, PeriodicKeysAreRefusedByKey) {
  const auto place = [&](const std::string& key, const json& value) {
    json scene = square({{"time", nullptr}});
    json& periodic = scene["boundary_conditions"]["periodic_boundary"];
    periodic = {{"enabled", true}, {"linear_displacement_offset", {{0, 0}, {0, -0.1}}}, {"fixed_macro_strain", {3}}};
    periodic[key] = value;
    return failure(scene).place;
  };
  const std::string node = "/boundary_conditions/periodic_boundary/";
  EXPECT_EQ(place("linear_displacement_offset", {{0, 0}}), node + "linear_displacement_offset");
  EXPECT_EQ(place("linear_displacement_offset", {{0, 0}, {0, "x"}}), node + "linear_displacement_offset/1/1");
  EXPECT_EQ(place("linear_displacement_offset", nullptr), node + "fixed_macro_strain");
  EXPECT_EQ(place("fixed_macro_strain", {4}), node + "fixed_macro_strain/0");
  EXPECT_EQ(place("correspondence", {{1, 1}, {0, 1}}), node + "correspondence");
  json other = square({{"time", nullptr}, {"defaults", "itr"}});
  other["boundary_conditions"]["periodic_boundary"]["enabled"] = true;
  EXPECT_EQ(failure(other).place, "/boundary_conditions/periodic_boundary");
  EXPECT_EQ(wrong_place({{"constraints", {{"macro_displacement_gradient", {{"value", {{0, 0}, {0, 0}}}}}}}}),
            "/constraints/macro_displacement_gradient");
}

TEST_F(PolyfemGeometry, InverseStiffnessesMayHaveUnitsOfStress) {
  const auto value = [&](const char* unit) {
    json scene = square();
    scene["materials"] = {
        {"type", "UnconstrainedOgden"}, {"mus", 1e4}, {"alphas", 2}, {"Ds", {{"value", 20}, {"unit", unit}}}};
    const auto sum = std::static_pointer_cast<const LawSum>(read2(scene).materials.at(1).own);
    return sum->terms.at(0).values.at(2).at(0);
  };
  EXPECT_NEAR(value("uPa"), 2e-5, 1e-18);
  EXPECT_NEAR(value("1/MPa"), 2e-5, 1e-18);
  json own = square({{"defaults", "itr"}});
  own["materials"] = {{"type", "UnconstrainedOgden"}, {"mus", 1e4}, {"alphas", 2}, {"Ds", {{"value", 20}, {"unit", "uPa"}}}};
  EXPECT_EQ(failure(own).place, "/materials/Ds");
}

/// AMIPS costs nothing where a body grows without distortion, which it then does.
TEST_F(PolyfemGeometry, AmipsHasNoBulkModulus) {
  json scene = square({{"time", nullptr}, {"materials", {{"type", "AMIPS"}, {"use_rest_pose", true}}}});
  scene["geometry"][0]["surface_selection"] = 1;
  scene["boundary_conditions"]["dirichlet_boundary"] = {{"id", 1}, {"value", {"0.1 * x", "0.1 * y"}}};
  linear::Registry registry;
  const itr::Setup<2> setup = read2(scene);
  Simulation<2> simulation(setup, registry);
  EXPECT_NEAR(advance(simulation).report.energy.elastic, 0, 1e-12);
  scene["defaults"] = "itr";
  EXPECT_EQ(failure(scene).place, "/materials");
}

TEST_F(PolyfemGeometry, RefusalsOfMaterialsHaveTheirReason) {
  const auto found = [&](const json& material) { return failure(square({{"materials", material}})).found; };
  EXPECT_NE(found({{"type", "NeoHookean"}, {"E", "by-element.txt"}, {"nu", 0.3}}).find("a file"), std::string::npos);
}

TEST_F(PolyfemGeometry, BasesThatSpanTheSameFunctionsAreAccepted) {
  read2(square({{"space", {{"basis_type", "Bernstein"}, {"use_p_ref", false}}}}));
  EXPECT_EQ(wrong_place({{"space", {{"basis_type", "Spline"}}}}), "/space/basis_type");
  EXPECT_EQ(wrong_place({{"space", {{"use_p_ref", true}}}}), "/space/use_p_ref");
}

}  // namespace
}  // namespace itr::scene
