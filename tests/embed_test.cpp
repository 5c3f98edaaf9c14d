// SPDX-License-Identifier: MIT
// The facade over both dimensions: arrays in, steps, arrays out, errors that name a place.
#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <optional>

#include "block_arrays.hpp"
#include "itr/itr.hpp"

namespace itr {
namespace {

/// Message of an InputError.
template <typename F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Facade, ErrorsNameArrayIndexFoundAndExpected) {
  const Arrays<2> arrays;
  const auto with = [&](auto&& change) {
    return message_of([&] {
      Arrays<2> changed = arrays;
      Model model(2);
      change(changed);
      model.set_mesh(changed.vertices, changed.cells, changed.bodies);
      model.set_options(kOptions);
      AnySimulation simulation(model);
    });
  };
  EXPECT_EQ(with([](auto& a) { a.vertices[5] = NAN; }), "vertices[5]: found nan; expected a finite number");
  EXPECT_EQ(with([](auto& a) { a.vertices.pop_back(); }), "vertices: found 31 numbers; expected a multiple of 2");
  EXPECT_EQ(with([](auto& a) { a.cells[4] = 16; }), "cells[4]: found 16; expected a vertex, 0 to 16 - 1");
  EXPECT_EQ(with([](auto& a) { a.bodies.pop_back(); }), "bodies: found 17 numbers; expected 18, one a cell");
  EXPECT_NE(with([](auto& a) { std::swap(a.cells[0], a.cells[1]); }).find("cell 0"), std::string::npos);
  EXPECT_EQ(message_of([] { Model(4); }), "dimension: found 4; expected 2 or 3");

  Model model = block_model<2>();
  EXPECT_NE(message_of([&] { model.add_boundary("top", std::array{0, 1}); }).find("'top' twice"), std::string::npos);
  model.set_option("/time/dt", "-1");
  EXPECT_NE(message_of([&] { AnySimulation s(model); }).find("/time/dt: found -1"), std::string::npos);
  Model unknown = block_model<2>();
  unknown.set_options(R"({"contact": {"dhatt": 1}})");
  EXPECT_NE(message_of([&] { AnySimulation s(unknown); }).find("/contact/dhatt"), std::string::npos);
  Model inner = block_model<2>();
  inner.add_boundary("inside", std::array{0, 5});
  EXPECT_EQ(message_of([&] { AnySimulation s(inner); }),
            "boundary 'inside', facet 0: found vertices 0 5; expected a facet of the mesh's boundary");

  AnySimulation simulation(block_model<2>());
  const std::array mask{1, 1};
  EXPECT_EQ(message_of([&] { simulation.fix("lefd", mask, std::vector<double>(32)); }),
            "boundary: found 'lefd'; expected 'left', 'top'");
  EXPECT_EQ(message_of([&] { simulation.fix("left", mask, std::vector<double>(31)); }),
            "displacements: found 31 numbers; expected 32");
  std::vector<double> forces(32);
  forces[7] = std::numeric_limits<double>::infinity();
  EXPECT_NE(message_of([&] { simulation.set_forces(forces); }).find("forces[7]"), std::string::npos);
  const std::string expected = "; expected a number > 0 of which a double holds the square";
  EXPECT_EQ(message_of([&] { simulation.step(-1); }), "dt: found -1" + expected);
  EXPECT_EQ(message_of([&] { simulation.step(1e-300); }), "dt: found 1e-300" + expected);
  AnySimulation other(block_model<3>());
  EXPECT_NE(message_of([&] { simulation.restore(other.save()); }).find("another simulation"), std::string::npos);
}

template <int Dim>
void expect_same_as_template() {
  Setup<Dim> setup = block<Dim>();
  setup.newton = {};
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-10 * setup.time.dt;
  DirichletCondition<Dim> left{1, {}, [](const Vec<Dim>& X, double t) { return Vec<Dim>(t * X); }};
  left.components.fill(true);
  setup.dirichlet.push_back(left);
  setup.neumann.push_back({2, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Unit(1) * 50); }});
  linear::Registry registry;
  Simulation<Dim> below(setup, registry);

  AnySimulation simulation(block_model<Dim>());
  EXPECT_EQ(simulation.dimension(), Dim);
  const std::vector<int> mask(Dim, 1);
  simulation.set_acceleration([](const double*, double, double* a) { a[1] = -kGravity; });
  simulation.set_traction("top", [](const double*, double, double* f) { f[1] = 50; });
  for (int i = 1; i <= 3; ++i) {
    std::vector<double> u = simulation.rest_positions();
    for (double& component : u) component *= 0.01 * i;
    simulation.fix("left", mask, u);
    ASSERT_TRUE(below.advance().ok);
    ASSERT_TRUE(simulation.step().ok);
  }
  const Eigen::Map<const VectorX> x(simulation.positions().data(), Dim * simulation.num_vertices());
  EXPECT_LT((x - below.state().history.x[0]).norm(), 1e-12);
  EXPECT_EQ(simulation.time(), below.state().t);
  EXPECT_EQ(simulation.cells(), Arrays<Dim>().cells);
  EXPECT_EQ(simulation.bodies(), Arrays<Dim>().bodies);
  EXPECT_EQ(simulation.facets().size(), std::size_t(Dim * simulation.num_facets()));
  EXPECT_THROW(simulation.as<5 - Dim>(), std::bad_variant_access);
}

TEST(Facade, DoesWhatTheTemplatesDo) {
  expect_same_as_template<2>();
  expect_same_as_template<3>();
}

TEST(Facade, MovesObstaclesByArraysAndFunctions) {
  Model model = block_model<2>();
  model.add_obstacle("wall", std::array{0.21, -1.0, 0.21, 1.0}, std::array{0, 1});
  model.add_obstacle("far", std::array{9.0, 0.0, 9.0, 1.0}, std::array{0, 1});
  model.set_options(R"({"contact": {"enabled": true, "dhat": 1e-3}, "solver": {"contact": {"barrier_stiffness": 1e6}}})");
  AnySimulation simulation(model);
  simulation.fix("left", std::array{1, 1}, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  simulation.watch_forces(true);
  for (int i = 1; i <= 5; ++i) {
    const double x = 0.21 - 0.005 * i;
    if (i % 2)
      simulation.move_obstacle("wall", std::array{x, -1.0, x, 1.0});
    else
      simulation.move_obstacle("wall", [=](const double*, double, double* u) { u[0] = x - 0.21; });
    ASSERT_TRUE(simulation.step().ok);
    EXPECT_NEAR(simulation.obstacle_positions()[0], x, 1e-15);
    EXPECT_NEAR(simulation.obstacle_positions()[3], 1, 1e-15);
    EXPECT_EQ(simulation.obstacle_positions()[4], 9);
  }
  EXPECT_GT(simulation.resultant("left").force[0], 1);  // it is squeezed
  const VectorX& contact = simulation.forces().contact;
  double pushed = 0;
  for (Eigen::Index i = 0; i < contact.size(); i += 2) pushed += contact[i];
  EXPECT_NEAR(simulation.resultant("wall").force[0], -pushed, 1e-9 * std::abs(pushed));
  EXPECT_EQ(simulation.resultant("far").force[0], 0);
  const std::vector<double> stress = simulation.stress(), von_mises = simulation.von_mises();
  ASSERT_EQ(von_mises.size(), static_cast<std::size_t>(simulation.num_cells()));
  ASSERT_EQ(stress.size(), 4 * von_mises.size());
  for (std::size_t c = 0; c < von_mises.size(); ++c) {  // of plane stress
    const double xx = stress[4 * c], xy = stress[4 * c + 1], yy = stress[4 * c + 3];
    EXPECT_NEAR(von_mises[c], std::sqrt(xx * xx - xx * yy + yy * yy + 3 * xy * xy), 1e-9 * von_mises[c]);
    EXPECT_LT(xx, 0);
  }
  EXPECT_LE(simulation.as<2>().setup().obstacles.motions.size(), 3u);  // places are used again
  const std::vector<double> pressure = simulation.contact_pressure();
  simulation.as<2>().conditions().fields.contact_pressure = true;
  simulation.as<2>().observe([&](const FrameView<2>& frame) {
    const VectorX& asked = frame.asked->contact_pressure;
    EXPECT_EQ(pressure, std::vector<double>(asked.begin(), asked.end()));
  });
  EXPECT_GT(*std::max_element(pressure.begin(), pressure.end()), 0);
}

TEST(Facade, EigenstrainOfAnArrayIsThatOfTheOptions) {
  const auto moved = [](const char* options, bool by_array) {
    Model model = block_model<2>();
    model.set_options(options);
    AnySimulation simulation(model);
    if (by_array) {
      std::vector<double> strains;
      for (int v = 0; v < simulation.num_vertices(); ++v) strains.push_back(0.1 * simulation.rest_positions()[2 * v]);
      simulation.set_eigenstrain(strains);
    }
    EXPECT_TRUE(simulation.step().ok);
    return VectorX(simulation.as<2>().positions());
  };
  const VectorX rest = moved("{}", false), by_array = moved(kRemesh, true);
  const VectorX by_options = moved(R"({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000,
    "eigenstrain": "0.1 * x"}, "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-4}}}})",
                                   false);
  ASSERT_EQ(by_array.size(), by_options.size());
  EXPECT_LT((by_array - by_options).norm(), 1e-9 * by_options.norm());
  EXPECT_GT((by_options.head(rest.size()) - rest).norm(), 1e-4);
}

TEST(Facade, EigenstrainKeepsToItsBodyAndIsRemoved) {
  Model model(2);  // two squares that touch at x = 1
  model.set_mesh(std::array{0., 0., 1., 0., 1., 1., 0., 1., 1., 0., 2., 0., 2., 1., 1., 1.},
                 std::array{0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}, std::array{1, 1, 2, 2});
  model.set_options(kOptions);
  AnySimulation simulation(model);
  simulation.set_eigenstrain(std::array{0.01, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02});
  const auto& materials = simulation.as<2>().setup().materials;
  for (const int body : {1, 2}) {
    const Mat<3> strain = materials.at(body).eigenstrain(Vec<3>(1, 0.4, 0), 0);
    EXPECT_LT((strain - 0.01 * body * Mat<3>::Identity()).norm(), 1e-15);
  }
  EXPECT_EQ(message_of([&] { simulation.set_eigenstrain(std::array{1.0}); }), "strains: found 1 numbers; expected 8");
  EXPECT_TRUE(materials.at(1).eigenstrain && materials.at(2).eigenstrain);
  simulation.set_eigenstrain({});
  EXPECT_FALSE(materials.at(1).eigenstrain || materials.at(2).eigenstrain);
}

/// A scene of a square (body 1, surface 8) on a ground (obstacle 2, named) after some steps.
AnySimulation square_on_ground() {
  const std::string file = std::string(::testing::TempDir()) + "itr_square_" + std::to_string(::getpid()) + ".json";
  std::ofstream(file) << R"({"geometry": [{"mesh": ")" ITR_SOURCE_DIR
                         R"(/examples/meshes/square.msh", "name": "block", "volume_selection": 1, "surface_selection": 8},
      {"type": "ground", "height": -0.5005, "surface_selection": 2, "name": "table"}],
      "materials": [{"id": 1, "type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000}],
      "boundary_conditions": {"rhs": [0, 9.81]}, "time": {"dt": 0.01, "time_steps": 5, "integrator": "ImplicitEuler"},
      "contact": {"enabled": true, "dhat": 1e-3}})";
  const Model model = Model::from_scene(file);
  std::remove(file.c_str());
  return AnySimulation(model);
}

TEST(Facade, ResultantTakesWhatOutputForcesTakes) {
  AnySimulation simulation = square_on_ground();
  simulation.watch_forces(true);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.step().ok);
  const double up = simulation.resultant("table").force[1];
  EXPECT_LT(up, -1);  // the body presses it down
  for (const char* text : {"2", "obstacle:2", "obstacle:table"}) EXPECT_EQ(simulation.resultant(text).force[1], up) << text;
  EXPECT_EQ(simulation.resultant(2).force[1], up);
  for (const char* text : {"block", "1", "body:1", "body:block", "8", "boundary:8"})
    EXPECT_NEAR(simulation.resultant(text).force[1], -up, 1e-10 * std::abs(up)) << text;
  EXPECT_EQ(simulation.resultant(8).force[1], simulation.resultant("8").force[1]);
  const std::array<std::string, 3> both = {"table", "2", "block"};
  EXPECT_NEAR(simulation.resultant(both, std::array{0.0, 0.0}).force[1], 0, 1e-10 * std::abs(up));
  for (const char* text : {"7", "tables", "", "body:2", "obstacle:1", "boundary:table", "block "})
    EXPECT_THROW(simulation.resultant(text), InputError) << text;
  EXPECT_THROW(simulation.resultant(7), InputError);
  EXPECT_THROW(simulation.resultant(-1), InputError);
  EXPECT_THROW(simulation.resultant(std::span<const std::string>(), std::array{0.0, 0.0}), InputError);
  EXPECT_THROW(simulation.set_traction("7", std::vector<double>()), InputError);
}

TEST(Facade, ReadsScenes) {
  Model model = Model::from_scene(std::string(ITR_SOURCE_DIR) + "/examples/masticator.json", {{"/time/tend", "0.1"}});
  AnySimulation simulation(model);
  ASSERT_TRUE(simulation.step().ok);
  EXPECT_GT(simulation.num_vertices(), 100);
  model.set_option("/time/dt", "0.01");
  EXPECT_EQ(AnySimulation(model).step_length(), 0.01);
  EXPECT_THROW(model.set_option("/time/dtt", "0.01"), InputError);
  EXPECT_EQ(AnySimulation(model).step_length(), 0.01);
  EXPECT_THROW(model.set_options("{}"), InputError);
  EXPECT_NE(message_of([&] {
              simulation.watch_forces(true), simulation.step(), simulation.resultant("left");
            }).find("the id of a surface"),
            std::string::npos);
}

TEST(Facade, MeshChangesReachTheHost) {
  Model model = block_model<2>();
  model.set_options(R"({"space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-4}}}})");
  AnySimulation simulation(model);
  simulation.fix("left", std::array{1, 1}, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  simulation.set_traction("top", [](const double*, double, double* f) { f[0] = 1000, f[1] = 0; });
  VectorX own = VectorX::Ones(simulation.num_vertices());
  std::vector<double> forces(static_cast<std::size_t>(2 * simulation.num_vertices()), 0.01);
  simulation.set_forces(forces);
  int changes = 0;
  simulation.on_mesh_change([&](const AnyMeshChange& change) {
    ++changes;
    EXPECT_LT((change.project(own) - VectorX::Ones(simulation.num_vertices())).norm(), 1e-12);
    own = change.interpolation * own;
  });
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(simulation.step().ok);
  EXPECT_GT(changes, 0);
  ASSERT_EQ(own.size(), simulation.num_vertices());
  EXPECT_LT((own - VectorX::Ones(own.size())).norm(), 1e-14);
  simulation.freeze_mesh(true);
  const int vertices = simulation.num_vertices();
  ASSERT_TRUE(simulation.step().ok);
  EXPECT_EQ(simulation.num_vertices(), vertices);
}

/// Also where the mesh changed behind the facade's back.
TEST(Facade, ValuesByVertexAreOfTheMeshThatThereIs) {
  Model model = block_model<2>();
  model.set_options(kRemesh);
  AnySimulation simulation(model);
  const std::array mask{1, 1};
  const auto stretched = [&] {
    std::vector<double> u = simulation.rest_positions();
    for (double& component : u) component *= 0.05;
    return u;
  };
  simulation.fix("left", mask, stretched());
  simulation.set_traction("top", [](const double*, double, double* f) { f[0] = 1000, f[1] = 0; });
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(simulation.as<2>().advance().ok);
  ASSERT_GT(simulation.num_vertices(), 16);
  EXPECT_EQ(simulation.report().step, 2);
  EXPECT_EQ(simulation.report().vertices, simulation.num_vertices());
  simulation.freeze_mesh(true);
  simulation.fix("left", mask, stretched());
  ASSERT_TRUE(simulation.step().ok);
  const std::vector<double> X = simulation.rest_positions();
  for (std::size_t v = 0; v < X.size() / 2; ++v)
    if (X[2 * v] == 0) {
      EXPECT_NEAR(simulation.positions()[2 * v + 1], 1.05 * X[2 * v + 1], 1e-15);
    }
}

TEST(Facade, AProjectionIsOverWithItsListener) {
  Model model = block_model<2>();
  model.set_options(kRemesh);
  AnySimulation simulation(model);
  simulation.set_traction("top", [](const double*, double, double* f) { f[0] = 1000, f[1] = 0; });
  simulation.fix("left", std::array{1, 1}, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  std::optional<AnyMeshChange> kept;
  simulation.on_mesh_change([&](const AnyMeshChange& change) {
    kept = change;
    EXPECT_NE(message_of([&] { change.project(VectorX::Ones(3)); }).find("found 3 rows"), std::string::npos);
  });
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.step().ok);
  ASSERT_TRUE(kept.has_value());
  const VectorX field = VectorX::Ones(static_cast<Eigen::Index>(kept->vertex.size()));
  EXPECT_EQ(message_of([&] { kept->project(field); }),
            "project: found a call after that of the listener; expected one from inside of the listener");
}

}  // namespace
}  // namespace itr
