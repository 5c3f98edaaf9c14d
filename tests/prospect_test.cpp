// SPDX-License-Identifier: MIT
// Bounds of the gains of splits.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numeric>

#include "remesh/contact/gate.hpp"
#include "remesh/decide/local_problem.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/decide/prospect.hpp"
#include "remesh_options.hpp"
#include "tet_scene.hpp"

namespace itr {
namespace {

/// A cube in free fall, turned and pulled, with noise on where it came from.
TetScene falling_cube(double pull, double noise) {
  TetScene scene(1);
  scene.mesh = make_cubes(2, unit_grid(2), [](int, int, int) { return 1; });
  scene.context.contact.enabled = false;
  scene.context.obstacles = {};
  scene.context.obstacles.past_x.resize(1);  // of the one past position
  scene.context.coupling = 0;
  const Mat<3> turn = (1 + pull) * Eigen::AngleAxisd(0.7, Vec<3>(1, 2, 3).normalized()).toRotationMatrix();
  const Vec<3> fall = scene.context.scaling * scene.context.loads.acceleration(Vec<3>::Zero());
  std::uniform_real_distribution<double> random(-noise, noise);
  scene.fields = {};
  scene.fields.x = scene.fields.predictor = VectorX(3 * scene.mesh.node_slots());
  for (int v = 0; v < scene.mesh.node_slots(); ++v) {
    scene.fields.x.segment<3>(3 * v) = turn * scene.mesh.rest(v);
    scene.fields.predictor.segment<3>(3 * v) =
        turn * scene.mesh.rest(v) - fall + Vec<3>(random(scene.random), random(scene.random), random(scene.random));
  }
  scene.fields.velocity_reference = scene.fields.x;
  scene.fields.past_positions = {scene.fields.x};
  return scene;
}

TEST(Prospect, IsTheIncrementalPotentialWithItsLoadsCompletedToSquares) {
  for (const MassKind kind : {MassKind::consistent, MassKind::lumped}) {
    TetScene scene = falling_cube(0.1, 0.01);
    scene.context.mass = kind;
    // -s a . M (x - X) + 1/2 |x - xhat|^2 = 1/2 |x - xhat - s a|^2 - s a . M (xhat - X) - 1/2 s^2 |a|^2 m
    const Vec<3> fall = scene.context.scaling * scene.context.loads.acceleration(Vec<3>::Zero());
    double offset = 0;
    for (int c = 0; c < scene.mesh.cell_slots(); ++c)
      for (const int v : scene.mesh.cell(c)) {
        const double mass = 2 * scene.mesh.volume(c) / 4;
        const Vec<3> step = scene.fields.predictor.segment<3>(3 * v) - scene.mesh.rest(v);
        offset += mass * (fall.dot(step) + fall.squaredNorm() / 2);
      }
    const double expected = whole_energy(scene.mesh, scene.fields, scene.context) + offset;
    EXPECT_NEAR(available_energy(scene.mesh, scene.fields, scene.context), expected, 1e-12 * expected);
    scene.context.coupling = 0.25;
    EXPECT_NEAR(available_energy(scene.mesh, scene.fields, scene.context), expected + 0.25, 1e-12 * expected);
  }
}

TEST(Prospect, NoSplitGainsMoreThanIsThere) {
  int compared = 0;
  for (unsigned seed = 0; compared < 300 && seed < 30; ++seed) {
    TetScene scene(seed);
    StepContext<3> without = scene.context;
    without.contact.barrier_stiffness = 0;
    const double energy = whole_energy(scene.mesh, scene.fields, scene.context);
    if (!std::isfinite(energy)) continue;
    scene.context.coupling = energy - whole_energy(scene.mesh, scene.fields, without);
    const double available = available_energy(scene.mesh, scene.fields, scene.context);
    const Gate<3> gate(scene.mesh, scene.fields, scene.context);
    const RemeshState<3> state{scene.mesh, scene.fields, scene.context, gate.present(), HistoryRule::interpolated};
    LocalScratch<3> scratch;
    Marks marks;
    for (const EdgeKey& edge : scene.mesh.edges()) {
      const auto split = make_split(scene.mesh, edge);
      const auto patch = select_patch<3>(scene.mesh, split, {}, marks);
      LocalProblem<3> before(state, patch, split, false, scratch), after(state, patch, split, true, scratch);
      if (!after.has_unknowns()) continue;
      EXPECT_LE(before.value() - after.relax(20).energy, available) << "seed " << seed;
      ++compared;
    }
  }
  EXPECT_GE(compared, 300);
}

TEST(Prospect, NothingIsAskedInFreeFlightUntilThereIsSomethingToGain) {
  RemeshOptions options = remesh_options();
  options.enabled = true;
  options.collapse.enabled = false;
  const auto splits = [&](const TetScene& scene) {
    TetScene changed = scene;
    RemeshMemory memory;
    Strata<3> strata;
    return remesh<3>(changed.mesh, changed.fields, changed.context, options, memory, strata).splits;
  };
  const auto asked = [&](const TetScene& scene) {
    const OperationCount count = splits(scene);
    return std::accumulate(count.refused.begin(), count.refused.end(), count.accepted);
  };
  const TetScene flight = falling_cube(0, 0), noisy = falling_cube(0.2, 0.01);
  EXPECT_LT(available_energy(flight.mesh, flight.fields, flight.context), 1e-20);
  options.split.acceptance_tolerance = 1e-12;
  EXPECT_EQ(asked(flight), 0);
  const double all = available_energy(noisy.mesh, noisy.fields, noisy.context) / noisy.context.scaling;
  options.split.acceptance_tolerance = 1e-3 * all;
  EXPECT_GT(splits(noisy).tried, 0);
  options.split.acceptance_tolerance = 2 * all;
  EXPECT_EQ(asked(noisy), 0);
  TetScene pressed = noisy;
  pressed.context.coupling = std::numeric_limits<double>::infinity();  // as where a term's sign is not known
  EXPECT_GT(asked(pressed), 0);
}

/// Shapes do no harm in free flight: nothing is swapped or moved, and nothing is even set up for it.
TEST(Prospect, NothingIsStirredInFreeFlight) {
  RemeshOptions options = remesh_options();
  options.split.enabled = options.collapse.enabled = false;
  options.swap.enabled = options.smooth.enabled = true;
  options.split.acceptance_tolerance = 1e-9;
  for (const bool flies : {true, false}) {
    TetScene scene = falling_cube(0, 0);
    std::mt19937 random(4);
    std::uniform_real_distribution<double> noise(-0.08, 0.08);
    const auto place = [&](int i, int j, int k) {
      const auto shift = [&](int at) { return at > 0 && at < 3 ? noise(random) : 0.0; };
      return Vec<3>(i / 3.0 + shift(i), j / 3.0 + shift(j), k / 3.0 + shift(k));
    };
    scene.mesh = make_cubes(3, place, [](int, int, int) { return 1; });
    const Mat<3> turn = Eigen::AngleAxisd(0.7, Vec<3>(1, 2, 3).normalized()).toRotationMatrix();
    const Vec<3> fall = scene.context.scaling * scene.context.loads.acceleration(Vec<3>::Zero());
    scene.fields.x = scene.fields.predictor = VectorX(3 * scene.mesh.node_slots());
    for (int v = 0; v < scene.mesh.node_slots(); ++v) {
      const Vec<3>& X = scene.mesh.rest(v);
      scene.fields.predictor.segment<3>(3 * v) = turn * X - fall;
      scene.fields.x.segment<3>(3 * v) = turn * (X + (flies ? 0.0 : 0.1) * Vec<3>(X[1] * X[1], 0, 0));
    }
    scene.fields.velocity_reference = scene.fields.x;
    scene.fields.past_positions = {scene.fields.x};
    RemeshMemory memory;
    Strata<3> strata;
    const RemeshReport report = remesh<3>(scene.mesh, scene.fields, scene.context, options, memory, strata);
    EXPECT_EQ(report.swaps.tried + report.smooths.tried > 0, !flies);
    EXPECT_EQ(strata.empty(), flies);
    strata = {};
    RemeshOptions coarse = options;  // one split has to gain more than there is
    coarse.split.acceptance_tolerance =
        2 * available_energy(scene.mesh, scene.fields, scene.context) / scene.context.scaling + 1e-9;
    EXPECT_FALSE((remesh<3>(scene.mesh, scene.fields, scene.context, coarse, memory, strata).changed()));
    EXPECT_TRUE(strata.empty());
  }
}

}  // namespace
}  // namespace itr
