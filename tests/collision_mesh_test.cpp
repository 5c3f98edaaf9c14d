// SPDX-License-Identifier: MIT
// A surface that touches in place of the bodies' boundary: in simulations, in scenes, and what is refused.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "block.hpp"
#include "core/hdf5.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"
#include "itr/scene.hpp"
#include "output/certify.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// The boundary of a mesh as its own proxy.
template <int Dim>
CollisionProxy<Dim> boundary_of(const Mesh<Dim>& mesh) {
  CollisionProxy<Dim> proxy;
  std::map<int, int> number;
  std::vector<Eigen::Triplet<double>> weights;
  const auto number_of = [&](int v) {
    const auto [found, is_new] = number.emplace(v, static_cast<int>(number.size()));
    if (is_new) {
      weights.emplace_back(found->second, v, 1);
      proxy.rest.push_back(mesh.rest(v));
    }
    return found->second;
  };
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    auto facet = mesh.facet(f);
    for (int& v : facet) v = number_of(v);
    if constexpr (Dim == 2)
      proxy.edges.push_back(facet);
    else
      proxy.triangles.push_back(facet);
  }
  proxy.weights.resize(static_cast<Eigen::Index>(proxy.rest.size()), mesh.node_slots());
  proxy.weights.setFromTriplets(weights.begin(), weights.end());
  return proxy;
}

/// Every boundary triangle cut into n x n, vertices interpolated and then moved by `shape`.
CollisionProxy<3> fine_surface(const Mesh<3>& mesh, int n, const std::function<Vec<3>(const Vec<3>&)>& shape) {
  CollisionProxy<3> proxy;
  std::map<std::map<int, int>, int> number;  // by the multiples of 1/n of a facet's vertices
  std::vector<Eigen::Triplet<double>> weights;
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    const auto& facet = mesh.facet(f);
    const auto vertex = [&](int i, int j) {
      std::map<int, int> key;
      for (const auto& [v, part] : {std::pair{facet[0], n - i - j}, {facet[1], i}, {facet[2], j}})
        if (part > 0) key[v] = part;
      const auto [found, is_new] = number.emplace(key, static_cast<int>(number.size()));
      if (is_new) {
        Vec<3> X = Vec<3>::Zero();
        for (const auto& [v, part] : key) {
          weights.emplace_back(found->second, v, part / static_cast<double>(n));
          X += part / static_cast<double>(n) * mesh.rest(v);
        }
        proxy.rest.push_back(shape(X));
      }
      return found->second;
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        proxy.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)});
        if (i + j + 1 < n) proxy.triangles.push_back({vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
      }
  }
  proxy.weights.resize(static_cast<Eigen::Index>(proxy.rest.size()), mesh.node_slots());
  proxy.weights.setFromTriplets(weights.begin(), weights.end());
  return proxy;
}

/// Positions, and the forces of contact and friction by the weight.
template <int Dim>
VectorX after_steps(Setup<Dim> setup, int steps) {
  linear::Registry registry;
  Simulation<Dim> simulation(std::move(setup), registry);
  for (int step = 0; step < steps; ++step) {
    const StepResult result = simulation.advance();
    EXPECT_TRUE(result.ok) << result.reason;
  }
  const NodalForces forces = asked(simulation).forces;
  VectorX all(2 * forces.contact.size());
  all << simulation.state().history.x[0].head(forces.contact.size()), (forces.contact + forces.friction) / weight<Dim>();
  return all;
}

/// With the boundary as its own proxy a step is what it is without one.
template <int Dim>
void expect_boundary_is_its_proxy() {
  Setup<Dim> plain = sliding_block<Dim>(3);
  plain.newton.step_tolerance /= 1000;  // pairs come in another order, and so may Newton's way
  Setup<Dim> damped = plain;
  damped.damping.push_back({DampingOptions::Term::contact, 1e-3, 2});
  Setup<Dim> adaptive = plain;
  adaptive.contact.adaptive_stiffness = true;
  for (Setup<Dim>* setup : {&plain, &damped, &adaptive}) {
    const VectorX expected = after_steps(*setup, 4);
    setup->proxy = boundary_of(setup->mesh);
    const VectorX actual = after_steps(*setup, 4);
    EXPECT_GT(expected.tail(expected.size() / 2).norm(), 0.1) << "nothing touches";
    EXPECT_LE((actual - expected).norm(), 1e-8 * expected.norm());
  }
}

TEST(CollisionMesh, BoundaryAsItsOwnProxyChangesNothing2D) { expect_boundary_is_its_proxy<2>(); }
TEST(CollisionMesh, BoundaryAsItsOwnProxyChangesNothing3D) { expect_boundary_is_its_proxy<3>(); }

constexpr double kBump = 0.02;

/// A coarse cube over a table, which touches it with a bump on its bottom that its mesh does not have.
Setup<3> block_on_bump() {
  Setup<3> setup = block<3>();
  setup.materials[1].youngs_modulus = 1e6;
  add_table(setup);
  for (Vec<3>& X : setup.obstacles.rest) X[1] -= kBump;
  setup.proxy = fine_surface(setup.mesh, 8, [](Vec<3> X) {
    if (X[1] < 1e-9) X[1] -= kBump * std::sin(M_PI * X[0] / kSize) * std::sin(M_PI * X[2] / kSize);
    return X;
  });
  return setup;
}

class CollisionMeshTest : public ::testing::Test {
 protected:
  CollisionMeshTest() : folder_(fs::path(::testing::TempDir()) / ("itr_collision_mesh_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~CollisionMeshTest() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(CollisionMeshTest, BlockRestsOnABumpThatItsMeshDoesNotHave) {
  const itr::Setup<3> setup = block_on_bump();
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  output::Writer writer(folder_ / "run", {}, {"scene", "eigen:ldlt", 1});
  const auto store = [&](const StepReport& report) {
    simulation.observe([&](const FrameView<3>& frame) { writer.write(frame, report); });
  };
  store(simulation.report());
  const auto momentum = [&] {
    const AskedFields fields = asked(simulation);
    return Vec<3>(Eigen::Map<const Vec<3>>(fields.momentum.data()));
  };
  const ContactSurface<3> contact = contact_surface(setup, simulation.state().mesh);
  double push = 0;
  for (int step = 0; step < setup.time.steps; ++step) {
    const Vec<3> before = momentum();
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    store(result.report);
    const VectorX& x = simulation.state().history.x[0];
    EXPECT_FALSE(has_intersection<3>(contact.surface, contact.positions(x)));
    const Vec<3> force = sum<3>(asked(simulation).forces.contact);
    push += force[1] / weight<3>() / setup.time.steps;
    EXPECT_LT(((momentum() - before) / setup.time.dt - force + weight<3>() * Vec<3>::Unit(1)).norm(), 1e-6 * weight<3>());
    for (int v = 0; v < setup.mesh.node_slots(); ++v) EXPECT_GT(x[3 * v + 1], -0.1 * kBump) << "the bump carries nothing";
  }
  EXPECT_GT(push, 0.5);
  writer.finish("finished");
  const output::Certificate certificate = output::certify(folder_ / "run");
  EXPECT_EQ(certificate.frames, setup.time.steps + 1);
  EXPECT_TRUE(certificate.violations.empty()) << certificate.violations[0].text;
  const hdf5::Session session;
  const hdf5::File frame = hdf5::File::open(folder_ / "run/frames/000010.h5");
  EXPECT_EQ(frame.read_doubles("/proxy/x").rows(), setup.proxy->rest.size());
  EXPECT_EQ(frame.read_integers("/proxy/faces").rows(), setup.proxy->triangles.size());
}

TEST_F(CollisionMeshTest, OnlyTheProxyTouches) {
  itr::Setup<3> setup = block_on_bump();
  linear::Registry registry;
  for (Vec<3>& X : setup.obstacles.rest) X[1] += kBump / 2;  // crosses the bump, not the mesh
  try {
    Simulation<3> simulation(setup, registry);
    ADD_FAILURE() << "the bump crosses the table";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "initial state");
  }
  setup = block_on_bump();
  for (Vec<3>& X : setup.proxy->rest) X[1] += 2 * kBump;
  for (Vec<3>& X : setup.obstacles.rest) X[1] += 2 * kBump;  // crosses the mesh, not the proxy
  Simulation<3> simulation(setup, registry);
  EXPECT_TRUE(simulation.advance().ok);
}

TEST_F(CollisionMeshTest, WhatCannotBeCombinedIsRefused) {
  linear::Registry registry;
  const auto place = [&](auto setup) -> std::string {
    try {
      Simulation(std::move(setup), registry);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return "accepted";
  };
  itr::Setup<2> remeshed = block<2>();
  add_table(remeshed);
  remeshed.proxy = boundary_of(remeshed.mesh);
  remeshed.remesh.enabled = true;
  EXPECT_EQ(place(remeshed), "/contact/collision_mesh");
  itr::Setup<3> other_size = block_on_bump();
  other_size.proxy->rest.pop_back();
  EXPECT_EQ(place(other_size), "weights of the collision mesh");
}

/// A scene of a tetrahedron on a floor, with its faces cut in four as a collision mesh.
class CollisionMeshScene : public CollisionMeshTest {
 protected:
  CollisionMeshScene()
      : proxy_(fine_surface(Mesh<3>({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1}), 2,
                            [](const Vec<3>& X) { return X; })) {
    write("tet.msh",
          "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
          "$Elements\n1\n1 4 2 3 1 1 2 3 4\n$EndElements\n");
    write("star.msh",
          "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 .2 .2 .2\n$EndNodes\n"
          "$Elements\n4\n1 4 2 3 1 1 2 3 5\n2 4 2 3 1 1 2 5 4\n3 4 2 3 1 1 5 3 4\n4 4 2 3 1 5 2 3 4\n$EndElements\n");
    write("floor.obj", "v -9 -9 -0.1\nv 9 -9 -0.1\nv 0 9 -0.1\nf 1 2 3\n");
    std::ostringstream ply;
    ply << "ply\nformat ascii 1.0\nelement vertex " << proxy_.rest.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nelement face " << proxy_.triangles.size()
        << "\nproperty list uchar int vertex_indices\nend_header\n";
    for (const Vec<3>& X : proxy_.rest) ply << X.transpose() << '\n';
    for (const auto& [a, b, c] : proxy_.triangles) ply << "3 " << a << ' ' << b << ' ' << c << '\n';
    write("fine.ply", ply.str());
    for (int i = 0; i < proxy_.weights.outerSize(); ++i)
      for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(proxy_.weights, i); it; ++it) {
        rows_.push_back(it.row());
        cols_.push_back(it.col());
        values_.push_back(it.value());
      }
    shape_ = {proxy_.weights.rows(), proxy_.weights.cols()};
  }

  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  /// weights.h5 of what the members say, without the dataset `left_out`.
  void write_weights(const std::string& left_out = "") const {
    const hdf5::Session session;
    hdf5::File file = hdf5::File::create(folder_ / "weights.h5");
    const auto put = [&](const std::string& name, const auto& values) {
      if (name != left_out) file.write("/weight_triplets/" + name, std::span(values), 0);
    };
    put("values", values_);
    put("rows", rows_);
    put("cols", cols_);
    if (!shape_.empty()) file.write_attribute("weight_triplets", "shape", shape_);
    std::ofstream(folder_ / "weights.h5", std::ios::binary) << file.image();
  }

  static Json scene(const Json& changes = Json::object()) {
    Json scene = {
        {"geometry",
         {{{"mesh", "tet.msh"}, {"volume_selection", 1}, {"transformation", {{"scale", 0.5}, {"rotation", {0, 0, 30}}}}},
          {{"mesh", "floor.obj"}, {"is_obstacle", true}}}},
        {"materials", {{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}}}},
        {"time", {{"dt", 0.01}, {"time_steps", 2}}},
        {"contact",
         {{"enabled", true}, {"dhat", 1e-2}, {"collision_mesh", {{"mesh", "fine.ply"}, {"linear_map", "weights.h5"}}}}},
        {"solver", {{"contact", {{"barrier_stiffness", 1e5}}}}}};
    scene.merge_patch(changes);
    return scene;
  }

  scene::Scene read(const Json& changes = Json::object()) const {
    write("scene.json", scene(changes).dump());
    return scene::read(folder_ / "scene.json");
  }

  /// Checks that the scene is refused, with the file and parts of what else an error says.
  void expect_refusal(const std::string& file, const std::string& place, const std::string& found,
                      const std::string& expected, const Json& changes = Json::object()) const {
    try {
      read(changes);
      ADD_FAILURE() << "read without an error: " << place << ", " << found;
    } catch (const InputError& error) {
      const auto& parts = error.parts();
      EXPECT_EQ(fs::path(parts.file).filename(), file) << error.what();
      EXPECT_NE(parts.place.find(place), std::string::npos) << error.what();
      EXPECT_NE(parts.found.find(found), std::string::npos) << error.what();
      EXPECT_NE(parts.expected.find(expected), std::string::npos) << error.what();
    }
  }

  CollisionProxy<3> proxy_;
  std::vector<double> values_;
  std::vector<std::int64_t> rows_, cols_, shape_;
};

TEST_F(CollisionMeshScene, IsReadAndTransformedAsTheFirstGeometry) {
  rows_.push_back(rows_[0]);  // triplets for one entry are summed
  cols_.push_back(cols_[0]);
  values_.push_back(0.25 * values_[0]);
  values_[0] *= 0.75;
  write_weights();
  const itr::Setup<3> setup = std::get<itr::Setup<3>>(read().setup);
  ASSERT_TRUE(setup.proxy);
  EXPECT_EQ(setup.proxy->triangles, proxy_.triangles);
  EXPECT_LE((MatrixX(setup.proxy->weights) - MatrixX(proxy_.weights)).norm(), 1e-15);
  for (std::size_t i = 0; i < proxy_.rest.size(); ++i) {  // the proxy interpolates the transformed mesh
    Vec<3> X = Vec<3>::Zero();
    for (int v = 0; v < 4; ++v) X += proxy_.weights.coeff(static_cast<int>(i), v) * setup.mesh.rest(v);
    EXPECT_LE((setup.proxy->rest[i] - X).norm(), 1e-15);
  }
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  EXPECT_TRUE(simulation.advance().ok);
  const std::string before = read().identity;
  values_[1] += 1e-3;
  write_weights();
  EXPECT_EQ(scene::find_changes(before, read().identity).size(), 1u);
}

TEST_F(CollisionMeshScene, IsALoopOfLinesIn2D) {
  write("square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n");
  write("loop.obj", "v .5 -.05 0\nv 1 .5 0\nv .5 1 0\nv 0 .5 0\nl 1 2 3 4 1\n");
  write("line.obj", "v -1 -0.055 0\nv 2 -0.055 0\nl 1 2\n");
  values_.assign(8, 0.5);
  rows_ = {0, 0, 1, 1, 2, 2, 3, 3};
  cols_ = {0, 1, 1, 2, 2, 3, 3, 0};
  shape_ = {4, 4};
  write_weights();
  const auto plane =
      read({{"geometry", {{{"mesh", "square.obj"}, {"volume_selection", 1}}, {{"mesh", "line.obj"}, {"is_obstacle", true}}}},
            {"contact", {{"collision_mesh", {{"mesh", "loop.obj"}}}}}});
  EXPECT_TRUE(plane.warnings.empty());
  const auto setup = std::get<itr::Setup<2>>(plane.setup);
  ASSERT_TRUE(setup.proxy);
  EXPECT_EQ(setup.proxy->edges.size(), 4u);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  EXPECT_TRUE(result.ok) << result.reason;
  EXPECT_LT(result.report.min_distance, 0.01);  // of the corner below to the line
}

TEST_F(CollisionMeshScene, WarnsOfLooseVerticesAndOfWeightsThatLagBehind) {
  write_weights();
  EXPECT_EQ(read().warnings, std::vector<std::string>());
  values_[0] *= 0.9;
  write_weights();
  ASSERT_EQ(read().warnings.size(), 1u);
  EXPECT_NE(read().warnings[0].find("the weights of 1 vertices do not sum to 1"), std::string::npos) << read().warnings[0];
  values_[0] /= 0.9;
  rows_.push_back(shape_[0]++);
  cols_.push_back(0);
  values_.push_back(1);
  write_weights();
  std::string obj;
  for (const Vec<3>& X : proxy_.rest)
    obj += "v " + std::to_string(X[0]) + ' ' + std::to_string(X[1]) + ' ' + std::to_string(X[2]) + '\n';
  obj += "v .1 .1 .1\n";
  for (const auto& [a, b, c] : proxy_.triangles)
    obj += "f " + std::to_string(a + 1) + ' ' + std::to_string(b + 1) + ' ' + std::to_string(c + 1) + '\n';
  write("loose.obj", obj);
  const auto warnings = read({{"contact", {{"collision_mesh", {{"mesh", "loose.obj"}}}}}}).warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("/contact/collision_mesh/mesh: 1 vertices in no edge"), std::string::npos) << warnings[0];
}

TEST_F(CollisionMeshScene, IsNotLookedAtWhereItIsNotUsed) {
  EXPECT_FALSE(std::get<itr::Setup<3>>(read({{"contact", {{"collision_mesh", {{"enabled", false}}}}}}).setup).proxy);
  EXPECT_FALSE(std::get<itr::Setup<3>>(read({{"contact", {{"enabled", false}}}}).setup).proxy);
}

TEST_F(CollisionMeshScene, RefusesWhatItCannotBeCombinedWith) {
  write_weights();
  const auto with = [](const char* key, const Json& value) {
    return Json{{"contact", {{"collision_mesh", {{key, value}}}}}};
  };
  expect_refusal("scene.json", "/contact/collision_mesh", "the bodies' mesh changes", "one or the other",
                 {{"space", {{"remesh", {{"enabled", true}}}}}});
  expect_refusal("scene.json", "/contact/collision_mesh/max_edge_length", "no effect", "without mesh",
                 with("max_edge_length", 0.1));
  expect_refusal("scene.json", "/contact/collision_mesh/tessellation_type", "no effect", "without mesh",
                 with("tessellation_type", "regular"));
  expect_refusal("scene.json", "/contact/collision_mesh/linear_map", "nothing", "HDF5 file with weights",
                 with("linear_map", nullptr));
  expect_refusal("scene.json", "/contact/collision_mesh/linear_map", "no.h5", "HDF5 file with weights",
                 with("linear_map", "no.h5"));
  expect_refusal("scene.json", "/contact/collision_mesh/mesh", "nothing", "a mesh file", with("mesh", nullptr));
  Json both = with("max_edge_length", 0.1);
  both["contact"]["collision_mesh"]["mesh"] = nullptr;
  expect_refusal("scene.json", "/contact/collision_mesh/linear_map", "beside max_edge_length", "one of both", both);
  expect_refusal("scene.json", "/contact/collision_mesh/mesh", "no.ply", "a mesh file", with("mesh", "no.ply"));
  expect_refusal("scene.json", "/contact/collision_mesh/mesh", "star.msh", "a surface", with("mesh", "star.msh"));
  Json refined = scene();
  refined["geometry"][0]["n_refs"] = 1;
  expect_refusal("scene.json", "/geometry/0/n_refs", "1", "0: ", {{"geometry", refined["geometry"]}});
}

TEST_F(CollisionMeshScene, RefusesWrongWeights) {
  const auto expect_wrong = [&](const std::string& place, const std::string& found, const std::string& expected,
                                const auto& change) {
    const auto values = values_;
    const auto rows = rows_, cols = cols_, shape = shape_;
    change();
    write_weights();
    expect_refusal("weights.h5", place, found, expected);
    values_ = values;
    rows_ = rows;
    cols_ = cols;
    shape_ = shape;
  };
  const std::string group = "weight_triplets";
  expect_wrong(group + "/rows", "index 10", "0 to 10 - 1", [&] { rows_[3] = 10; });
  expect_wrong(group + "/cols", "index -1", "0 to 4 - 1", [&] { cols_[3] = -1; });
  expect_wrong(group + "/cols", "15 numbers", "16, one a value", [&] { cols_.pop_back(); });
  expect_wrong(group + "/values", "weight 2", "", [&] { values_[2] = std::nan(""); });
  expect_wrong(group + ", attribute shape", "9 x 4", "10 x 4", [&] { shape_[0] = 9; });
  expect_wrong(group + ", attribute shape", "10 x 5", "10 x 4", [&] { shape_[1] = 5; });
  expect_wrong(group + ", attribute shape", "10", "10 x 4", [&] { shape_.pop_back(); });
  expect_wrong(group + ", attribute shape", "HDF5", "", [&] { shape_.clear(); });
  for (const char* name : {"values", "rows", "cols"}) {
    write_weights(name);
    expect_refusal("weights.h5", group + "/" + name, "no such dataset", "it");
  }
  write("weights.h5", "text");
  expect_refusal("weights.h5", "file", "HDF5", "HDF5 file");
}

TEST_F(CollisionMeshScene, RefusesWrongSurfaces) {
  write_weights();
  const auto expect_wrong = [&](const std::string& text, const std::string& found) {
    write("other.ply", text);
    expect_refusal("other.ply", "", found, "", {{"contact", {{"collision_mesh", {{"mesh", "other.ply"}}}}}});
  };
  expect_wrong("solid", "another beginning");
  expect_wrong("ply\nformat ascii 1.0\nend_header\n", "no vertices");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\n");
  expect_refusal("scene.json", "/contact/collision_mesh/mesh", "length 0", "degenerate",
                 {{"contact", {{"collision_mesh", {{"mesh", "flat.obj"}}}}}});
}

}  // namespace
}  // namespace itr
