// SPDX-License-Identifier: MIT
// Strata of a simulation: found once, carried over steps, changes of the mesh and saved states.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "itr/core.hpp"
#include "output/checkpoint.hpp"
#include "output/frame_file.hpp"
#include "random_tets.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;

/// Two bodies that hang together and bend; `bump` takes their vertices off the planes that they lie in. [m]
Setup<3> two_bodies(double bump = 0) {
  const Mat<3> turn = Eigen::AngleAxisd(0.7, Vec<3>(1, 2, 3).normalized()).toRotationMatrix();
  const auto place = [&](int i, int j, int k) {
    return Vec<3>(turn * (Vec<3>(i, j, k) / 3 + bump * Vec<3>(std::sin(7 * j), std::sin(5 * k), std::sin(3 * i))));
  };
  Setup<3> setup;
  setup.mesh = make_cubes(3, place, [](int i, int, int) { return i == 0 ? 1 : 2; });
  for (const int body : {1, 2}) {
    setup.materials[body] = {.youngs_modulus = 1e4 * body, .poisson_ratio = 0.3, .density = 1000};
    setup.initial_velocity.push_back(
        {body, [](const Vec<3>& X, double) { return Vec<3>(std::sin(4 * X[1]), 2 * X[2] * X[2], std::cos(3 * X[0])); }});
  }
  setup.time = {.dt = 0.02, .steps = 100};
  setup.newton.step_tolerance = 1e-8;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-10;
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 0.05;
  setup.remesh.collapse.acceptance_tolerance = -0.02;
  setup.remesh.collapse.rel_max_edge_length = 2;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  return setup;
}

Simulation<3> simulate(const Setup<3>& setup) {
  static linear::Registry registry;
  return Simulation<3>(setup, registry);
}

/// Advances some steps, each of which has to change the mesh. Returns accepted splits, collapses, swaps and moves.
std::array<int, 4> advance(Simulation<3>& simulation, int steps) {
  std::array<int, 4> accepted{};
  for (int i = 0; i < steps; ++i) {
    const StepResult result = simulation.advance();
    EXPECT_TRUE(result.ok) << result.reason;
    EXPECT_FALSE(result.renumbering.empty());
    const StepReport& report = result.report;
    accepted[0] += report.splits.accepted;
    accepted[1] += report.collapses.accepted;
    accepted[2] += report.swaps.accepted;
    accepted[3] += report.smooths.accepted;
  }
  return accepted;
}

/// Up to the numbers of patches.
void expect_same(const Strata<3>& a, const Strata<3>& b) {
  const auto x = a.record(), y = b.record();
  EXPECT_EQ(x.vertices, y.vertices);
  std::map<int, int> number;
  const auto is_same = [&](int p, int q) { return number.try_emplace(p, q).first->second == q; };
  ASSERT_EQ(x.patches.size(), y.patches.size());
  for (std::size_t f = 0; f < x.patches.size(); ++f) EXPECT_TRUE(is_same(x.patches[f], y.patches[f])) << "facet " << f;
  ASSERT_EQ(x.interfaces.size(), y.interfaces.size());
  for (std::size_t i = 0; i < x.interfaces.size(); ++i) {
    EXPECT_TRUE(std::equal(x.interfaces[i].begin(), x.interfaces[i].end() - 1, y.interfaces[i].begin()))
        << "interface " << i;
    EXPECT_TRUE(is_same(x.interfaces[i][3], y.interfaces[i][3])) << "interface " << i;
  }
  EXPECT_EQ(a.num_patches(), b.num_patches());
}

TEST(KeptStrata, AreThoseOfTheMeshAfterManySteps) {
  auto simulation = simulate(two_bodies());
  EXPECT_TRUE(simulation.state().strata.empty());
  std::array<int, 4> accepted{};
  for (int i = 0; i < 6; ++i) {
    const auto edits = advance(simulation, 1);
    for (int kind = 0; kind < 4; ++kind) accepted[kind] += edits[kind];
    const auto& [mesh, strata] = std::tie(simulation.state().mesh, simulation.state().strata);
    EXPECT_EQ(strata.find_defect(mesh), "") << "step " << i;
    EXPECT_EQ(strata.num_patches(), 11);
    expect_same(strata, Strata<3>(mesh));
  }
  for (const int count : accepted) EXPECT_GT(count, 5);
}

/// Planes rougher than kFlatness allows, as if round-off had got the better of them: found anew they are many.
TEST(KeptStrata, AreNotFoundAgain) {
  const auto setup = two_bodies(1e-8);
  const Strata<3> known(setup.mesh, 1e-6);
  EXPECT_EQ(known.num_patches(), 11);
  EXPECT_GT(Strata<3>(setup.mesh).num_patches(), 11);
  auto simulation = simulate(setup);
  State<3> state = simulation.state();
  state.strata = known;
  simulation.restore(state);
  advance(simulation, 3);
  const auto& after = simulation.state();
  EXPECT_EQ(after.strata.num_patches(), 11);
  EXPECT_EQ(after.strata.find_defect(after.mesh), "");
}

TEST(KeptStrata, OfAnotherMeshAreDropped) {
  auto simulation = simulate(two_bodies());
  advance(simulation, 1);
  State<3> state = simulation.state();
  simulation.restore(state);
  EXPECT_FALSE(simulation.state().strata.empty());
  state.strata = Strata<3>(two_bodies().mesh);
  simulation.restore(state);
  EXPECT_TRUE(simulation.state().strata.empty());
  advance(simulation, 1);
  expect_same(simulation.state().strata, Strata<3>(simulation.state().mesh));
}

class SavedStrata : public ::testing::Test {
 protected:
  SavedStrata() : simulation(simulate(two_bodies())) { advance(simulation, 2); }

  /// Saves the state, lets `damage` change the file and reads it.
  template <typename Damage>
  State<3> saved(const Damage& damage) {
    simulation.observe([&](const FrameView<3>& frame) {
      output::write_frame(path, frame, 2, simulation.state().t, {}, [&](hdf5::File& file) {
        output::write_checkpoint(file, simulation.state(), {"scene", "backend", {}, 0});
        damage(file);
      });
    });
    return *output::read_checkpoint<3>({path, "scene", "backend", 3}).state;
  }

  void expect_refused(const std::string& name, const std::vector<std::int64_t>& values, int columns,
                      const std::string& found) {
    expect_refused<std::int64_t>(name, values, columns, found);
  }
  template <typename T>
  void expect_refused(const std::string& name, const std::vector<T>& values, int columns, const std::string& found) {
    try {
      saved([&](hdf5::File& file) {
        file.unlink(name);
        file.write(name, values, columns);
      });
      ADD_FAILURE() << name << " was read";
    } catch (const InputError& error) {
      EXPECT_EQ(error.parts().file, path.string());
      EXPECT_EQ(error.parts().place.find("/checkpoint/strata"), 0u) << error.what();
      EXPECT_NE(error.parts().found.find(found), std::string::npos) << error.what();
    }
  }

  const fs::path path = fs::path(ITR_BINARY_DIR) / "tests" / "kept_strata.h5";
  Simulation<3> simulation;
};

TEST_F(SavedStrata, AreReadAsTheyWereAndGiveTheSameBits) {
  const auto kept = simulation.state().strata.record();
  State<3> state = saved([](hdf5::File&) {});
  const auto read = state.strata.record();
  EXPECT_EQ(read.vertices, kept.vertices);
  EXPECT_EQ(read.patches, kept.patches);
  EXPECT_EQ(read.interfaces, kept.interfaces);
  EXPECT_EQ(read.tolerance, kept.tolerance);
  ASSERT_EQ(read.planes.size(), kept.planes.size());
  for (std::size_t p = 0; p < read.planes.size(); ++p) {
    EXPECT_EQ(read.planes[p].point, kept.planes[p].point);
    EXPECT_EQ(read.planes[p].normal, kept.planes[p].normal);
  }
  auto resumed = simulate(two_bodies());
  resumed.restore(std::move(state));
  advance(resumed, 2);
  advance(simulation, 2);
  EXPECT_EQ(resumed.state().history.x[0], simulation.state().history.x[0]);
}

TEST_F(SavedStrata, OfAnOlderVersionAreFoundAnew) {
  EXPECT_TRUE(saved([](hdf5::File& file) { file.unlink("/checkpoint/strata"); }).strata.empty());
}

TEST_F(SavedStrata, ThatAreWrongAreRefused) {
  const auto record = simulation.state().strata.record();
  std::vector<std::int64_t> vertices, interfaces;
  for (const Stratum stratum : record.vertices) vertices.push_back(static_cast<std::int64_t>(stratum));
  for (const auto& row : record.interfaces) interfaces.insert(interfaces.end(), row.begin(), row.end());
  const auto with = [](std::vector<std::int64_t> values, std::size_t i, std::int64_t value) {
    values.at(i) = value;
    return values;
  };
  expect_refused("/checkpoint/strata/vertices", with(vertices, 0, 5), 0, "stratum 5");
  expect_refused("/checkpoint/strata/vertices", {0, 1}, 0, "wrong number of vertices");
  expect_refused("/checkpoint/strata/patches", {0, 1}, 0, "wrong number of facets");
  expect_refused("/checkpoint/strata/patches", std::vector<std::int64_t>(record.patches.size(), 11), 0, "without a patch");
  expect_refused("/checkpoint/strata/interfaces", with(interfaces, 0, 99999), 4, "vertex 99999");
  expect_refused("/checkpoint/strata/interfaces", {0, 1, 2, 0}, 4, "without a patch");
  expect_refused("/checkpoint/strata/interfaces", interfaces, 2, "2 columns");
  expect_refused<double>("/checkpoint/strata/planes", {0, 0, 0, 0, 0, 1}, 3, "3 columns");
  expect_refused<double>("/checkpoint/strata/planes", {0, 0, 0, 0, 0, 2}, 6, "length 2");
  expect_refused<double>("/checkpoint/strata/tolerance", {0, 0}, 0, "2 numbers");
}

}  // namespace
}  // namespace itr
