// SPDX-License-Identifier: MIT
// Grounds and planes have no end: bodies slide, fly and leap past the borders of their meshes, and stay on them.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>

#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "output/checkpoint.hpp"
#include "output/frame_file.hpp"
#include "random_cube.hpp"
#include "simulation_scenes.hpp"
#include "temporary_path.hpp"

namespace itr {
namespace {

/// The square of `impact` at rest on a line of 4 m that is meant to have no end.
itr::Setup<2> on_ground(const Vec<2>& velocity) {
  itr::Setup<2> setup = impact();
  setup.obstacles.rest = {{-2, -0.001}, {2, -0.001}};
  setup.obstacles.flats = {0};
  setup.materials[1].youngs_modulus = 1e6;
  setup.contact.barrier_stiffness = 1e5;
  setup.contact.friction_coefficient = 0;
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
  setup.initial_velocity = {{1, [=](const Vec<2>&, double) { return velocity; }}};
  setup.time = {.dt = 0.02, .steps = 40};
  return setup;
}

/// How far the lowest vertex is above the line through the first two vertices of the obstacle.
double height(const Simulation<2>& simulation) {
  const VectorX& x = simulation.state().history.x[0];
  const int bodies = simulation.state().mesh.num_vertices();
  const Vec<2> a = x.segment<2>(2 * bodies), b = x.segment<2>(2 * bodies + 2), along = (b - a).normalized();
  double least = 1e9;
  for (int v = 0; v < bodies; ++v) least = std::min(least, (x.segment<2>(2 * v) - a).dot(Vec<2>(-along[1], along[0])));
  return least;
}

double length(const Simulation<2>& simulation) {
  const VectorX& x = simulation.state().history.x[0];
  return (x.tail<2>() - x.segment<2>(x.size() - 4)).norm();
}

void run(Simulation<2>& simulation) {
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_GT(height(simulation), 0) << "step " << result.report.step;
  }
}

TEST(FlatObstacles, GoOnWhereBodiesSlide) {
  for (const double speed : {30.0, -30.0}) {
    linear::Registry registry;
    Simulation<2> simulation(on_ground({speed, 0}), registry);
    run(simulation);
    EXPECT_NEAR(simulation.state().history.x[0][0], 0.8 * speed, 1e-3);  // its weight spreads it
    EXPECT_LT(height(simulation), 0.1);
    EXPECT_EQ(length(simulation), 4 * std::exp2(simulation.state().doublings.at(0)));
    EXPECT_GE(simulation.state().doublings.at(0), 4);
  }
}

TEST(FlatObstacles, GoOnInBothDirectionsAtOnce) {
  linear::Registry registry;
  itr::Setup<2> setup = on_ground({0, 0});
  const Mesh<2> one = setup.mesh;
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  std::vector<int> bodies;
  for (const int body : {1, 2}) {
    const int first = static_cast<int>(rest.size());
    for (VertexId v = 0; v < one.num_vertices(); ++v) rest.push_back(one.rest(v) + Vec<2>(0.5 * body, 0));
    for (CellId c = 0; c < one.num_cells(); ++c) {
      auto cell = one.cell(c);
      for (int& v : cell) v += first;
      cells.push_back(cell);
      bodies.push_back(body);
    }
  }
  setup.mesh = Mesh<2>(rest, cells, bodies);
  setup.materials[2] = setup.materials[1];
  setup.initial_velocity = {{1, [](const Vec<2>&, double) { return Vec<2>(-20, 0); }},
                            {2, [](const Vec<2>&, double) { return Vec<2>(20, 0); }}};
  Simulation<2> simulation(setup, registry);
  run(simulation);
  EXPECT_LT(height(simulation), 0.1);
}

/// Nothing tells beforehand how far a load carries a body in the first step.
TEST(FlatObstacles, GoOnUnderLeaps) {
  linear::Registry registry;
  itr::Setup<2> setup = on_ground({0, 0});
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(2e4, -9.81); };
  setup.time = {.dt = 0.1, .steps = 2};
  Simulation<2> simulation(setup, registry);
  run(simulation);
  EXPECT_GT(simulation.state().history.x[0][0], 100);
  EXPECT_GE(length(simulation), 2 * 100);
}

/// One that turns and rises carries bodies that fly over it; its ends are those of one plane.
TEST(FlatObstacles, MoveAsPlanesDo) {
  linear::Registry registry;
  itr::Setup<2> setup = on_ground({30, 15});
  setup.obstacles.motion = {0, 0};
  setup.obstacles.motions = {[](const Vec<2>& X, double t) {
    const double angle = 0.2 * t;
    return Vec<2>(std::cos(angle) * X[0] - std::sin(angle) * X[1] - X[0],
                  std::sin(angle) * X[0] + std::cos(angle) * X[1] - X[1] + 0.1 * t);
  }};
  setup.time.steps = 100;
  Simulation<2> simulation(setup, registry);
  run(simulation);
  const State<2>& state = simulation.state();
  EXPECT_GE(state.doublings.at(0), 4);
  const VectorX& x = state.history.x[0];
  const Vec<2> along = (x.tail<2>() - x.segment<2>(x.size() - 4)).normalized();
  EXPECT_NEAR(std::atan2(along[1], along[0]), 0.2 * state.t, 1e-9);
  EXPECT_LT(height(simulation), 1) << "it has landed";
}

TEST(FlatObstacles, StayAsTheyAreUnderBodiesThatStay) {
  linear::Registry registry;
  itr::Setup<2> setup = on_ground({0.3, 0});
  Simulation<2> endless(setup, registry);
  setup.obstacles.flats.clear();
  Simulation<2> with_ends(setup, registry);
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(endless.advance().ok);
    ASSERT_TRUE(with_ends.advance().ok);
    ASSERT_EQ(endless.state().history.x[0], with_ends.state().history.x[0]);
  }
  EXPECT_TRUE(endless.state().doublings.empty());
}

TEST(FlatObstacles, AreAsTheyWereAfterRestoringAndFailedSteps) {
  linear::Registry registry;
  std::atomic<bool> cancel = false;
  itr::Setup<2> setup = on_ground({30, 0});
  setup.newton.cancel = &cancel;
  Simulation<2> simulation(setup, registry);
  const Snapshot<2> start = simulation.save();
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(simulation.advance().ok);
  const Snapshot<2> middle = simulation.save();
  while (!simulation.finished()) ASSERT_TRUE(simulation.advance().ok);
  const VectorX end = simulation.state().history.x[0];

  simulation.restore(start);
  EXPECT_EQ(length(simulation), 4);
  EXPECT_EQ(simulation.setup().obstacles.rest[1], Vec<2>(2, -0.001));
  simulation.restore(middle);
  for (int i = 0; i < 20; ++i) {
    cancel = true;
    const VectorX before = simulation.state().history.x[0];
    ASSERT_FALSE(simulation.advance().ok);
    EXPECT_EQ(simulation.state().history.x[0], before);
    EXPECT_EQ((simulation.setup().obstacles.rest[1] - simulation.setup().obstacles.rest[0]).norm(), length(simulation));
    cancel = false;
    ASSERT_TRUE(simulation.advance().ok);
  }
  EXPECT_EQ(simulation.state().history.x[0], end);

  // From a file.
  simulation.restore(middle);
  const std::filesystem::path path = temporary_path(".h5");
  simulation.observe([&](const FrameView<2>& frame) {
    output::write_frame(path, frame, 20, simulation.state().t, {}, [&](hdf5::File& file) {
      output::write_checkpoint(file, simulation.state(), {"{}", "eigen", "{}", 0});
    });
  });
  Simulation<2> resumed(setup, registry);
  resumed.restore(*output::read_checkpoint<2>({path, "{}", "eigen", 2}).state);
  EXPECT_EQ(length(resumed), length(simulation));
  while (!resumed.finished()) ASSERT_TRUE(resumed.advance().ok);
  EXPECT_EQ(resumed.state().history.x[0], end);

  State<2> misfit = *middle.state;
  misfit.doublings = {1, 1};
  EXPECT_THROW(resumed.restore(misfit), InputError);
  misfit.doublings = {-1};
  EXPECT_THROW(resumed.restore(misfit), InputError);
  std::filesystem::remove(path);
}

/// A cube that slides down a plane of 45 degrees in 3D, along a direction that is none of its sides'.
TEST(FlatObstacles, AreInclinedPlanesIn3D) {
  linear::Registry registry;
  itr::Setup<3> setup;
  std::mt19937 random(1);
  setup.mesh = make_cube(1, random, 0);
  setup.materials[1] = {.youngs_modulus = 1e7, .poisson_ratio = 0.3, .density = 1000};
  const Vec<3> normal = Vec<3>(1, 2, 2) / 3, a = normal.unitOrthogonal(), b = normal.cross(a);
  double low = 1e9;
  for (VertexId v = 0; v < setup.mesh.num_vertices(); ++v) low = std::min(low, setup.mesh.rest(v).dot(normal));
  const Vec<3> middle = (low - 2e-3) * normal;
  setup.obstacles.rest = {middle - 5 * (std::sqrt(3.0) * a + b), middle + 5 * (std::sqrt(3.0) * a - b), middle + 10 * b};
  setup.obstacles.edges = {{0, 1}, {1, 2}, {2, 0}};
  setup.obstacles.triangles = {{0, 1, 2}};
  setup.obstacles.motion.assign(3, kNone);
  setup.obstacles.flats = {0};
  setup.contact = {.enabled = true, .dhat = 4e-3, .convergent = true, .barrier_stiffness = 1e6};
  setup.body_acceleration = [](const Vec<3>&, double) { return Vec<3>(0, -9.81, 0); };
  setup.time = {.dt = 0.05, .steps = 80};
  Simulation<3> simulation(setup, registry);
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
  }
  const State<3>& state = simulation.state();
  double least = 1e9, farthest = 0;
  for (int v = 0; v < state.mesh.num_vertices(); ++v) {
    const Vec<3> from = state.history.x[0].segment<3>(3 * v) - middle;
    least = std::min(least, from.dot(normal));
    farthest = std::max(farthest, from.norm());
  }
  EXPECT_GT(farthest, 40) << "it slides by g sin(angle) t^2 / 2";
  EXPECT_GT(least, 0);
  EXPECT_LT(least, 0.1);
}

}  // namespace
}  // namespace itr
