// SPDX-License-Identifier: MIT
// The C interface: arrays in, steps, arrays out, statuses and messages instead of exceptions.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "block_arrays.hpp"
#include "itr/itr.h"

namespace itr {
namespace {

struct CBlock {
  itr_model* model = itr_model_create(2);
  itr_simulation* simulation = nullptr;
  explicit CBlock(const char* more = "{}", const std::function<itr_status(itr_model*)>& change = nullptr) {
    const Arrays<2> arrays;
    EXPECT_EQ(itr_model_set_mesh(model, arrays.vertices.size() / 2, arrays.vertices.data(), arrays.cells.size() / 3,
                                 arrays.cells.data(), nullptr),
              ITR_SUCCESS);
    const double low[] = {0, 0}, high[] = {0, 1};
    EXPECT_EQ(itr_model_add_boundary_box(model, "left", low, high, nullptr), ITR_SUCCESS);
    EXPECT_EQ(itr_model_set_options(model, kOptions), ITR_SUCCESS);
    EXPECT_EQ(itr_model_set_options(model, more), ITR_SUCCESS);
    EXPECT_EQ(change ? change(model) : ITR_SUCCESS, ITR_SUCCESS) << itr_model_message(model);
    EXPECT_EQ(itr_simulation_create(model, nullptr, nullptr, &simulation), ITR_SUCCESS) << itr_model_message(model);
  }
  ~CBlock() {
    itr_simulation_destroy(simulation);
    itr_model_destroy(model);
  }
};

TEST(CInterface, SaysWhatIsWrongAndGoesOn) {
  EXPECT_EQ(itr_model_create(5), nullptr);
  CBlock block;
  EXPECT_EQ(itr_model_set_mesh(block.model, 3, nullptr, 1, nullptr, nullptr), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_model_message(block.model), "vertices: found NULL; expected an argument");
  EXPECT_EQ(itr_model_set_options(block.model, "{"), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_model_message(block.model), "options: found text that is no JSON; expected a JSON object");
  EXPECT_EQ(itr_model_read_scene(block.model, "nowhere.json"), ITR_BAD_INPUT);
  EXPECT_NE(std::string(itr_model_message(block.model)).find("nowhere.json"), std::string::npos);
  EXPECT_EQ(itr_step(nullptr, 1), ITR_BAD_INPUT);
  EXPECT_EQ(itr_step(block.simulation, -1), ITR_BAD_INPUT);
  const int mask[] = {1, 1};
  EXPECT_EQ(itr_fix(block.simulation, "right", mask, nullptr, nullptr), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(block.simulation), "boundary: found 'right'; expected 'left'");
  EXPECT_EQ(itr_fix(block.simulation, "left", mask, nullptr, nullptr), ITR_BAD_INPUT);
  EXPECT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS);
}

TEST(CInterface, ResultantTakesNamesAndIdsAndRefusesOthers) {
  CBlock block(R"({"contact": {"enabled": true, "dhat": 1e-3}})", [](itr_model* model) {
    const double wall[] = {0.2005, -1, 0.2005, 1};
    const int edge[] = {0, 1};
    return itr_model_add_obstacle(model, "wall", 2, wall, 1, edge, 0, nullptr, nullptr);
  });
  ASSERT_EQ(itr_watch_forces(block.simulation, 1), ITR_SUCCESS);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS);
  const double about[] = {0, 0};
  double force[2], other[2], moment;
  for (const char* part : {"left", "wall", "1", "2", "boundary:1", "obstacle:2", "body:0", "0"})
    EXPECT_EQ(itr_resultant(block.simulation, part, about, force, &moment), ITR_SUCCESS) << part;
  for (const char* part : {"lefd", "7", "", "body:1", "boundary:wall"})
    EXPECT_EQ(itr_resultant(block.simulation, part, about, force, &moment), ITR_BAD_INPUT) << part;
  EXPECT_EQ(itr_resultant(block.simulation, "wall", about, force, &moment), ITR_SUCCESS);
  EXPECT_EQ(itr_resultant_of_id(block.simulation, 2, about, other, &moment), ITR_SUCCESS);
  EXPECT_GT(force[0], 0);  // the block pushes it away
  std::vector<double> pressure(itr_num_nodes(block.simulation));
  EXPECT_EQ(itr_get_contact_pressure(block.simulation, pressure.size(), pressure.data()), ITR_SUCCESS);
  EXPECT_GT(*std::max_element(pressure.begin(), pressure.end()), 0);
  EXPECT_EQ(other[0], force[0]);
  EXPECT_EQ(itr_resultant_of_id(block.simulation, 7, about, force, &moment), ITR_BAD_INPUT);
  EXPECT_EQ(itr_resultant_of_id(nullptr, 2, about, force, &moment), ITR_BAD_INPUT);
}

TEST(CInterface, AnswersAnErrorWithoutASimulation) {
  EXPECT_TRUE(std::isnan(itr_time(nullptr)));
  EXPECT_EQ(itr_steps(nullptr), -1);
  EXPECT_EQ(itr_finished(nullptr), -1);
  EXPECT_EQ(itr_dimension(nullptr), -1);
  EXPECT_EQ(itr_num_vertices(nullptr) + itr_num_cells(nullptr) + itr_num_facets(nullptr), 0u);
  EXPECT_EQ(itr_positions(nullptr), nullptr);
  EXPECT_EQ(itr_velocities(nullptr), nullptr);
  EXPECT_EQ(itr_forces(nullptr, ITR_CONTACT), nullptr);
  EXPECT_EQ(itr_save(nullptr), nullptr);
  itr_energies energies;
  itr_step_statistics statistics;
  EXPECT_EQ(itr_get_energies(nullptr, &energies), ITR_BAD_INPUT);
  EXPECT_EQ(itr_get_statistics(nullptr, &statistics), ITR_BAD_INPUT);
  EXPECT_EQ(itr_fix_values(nullptr, "left", nullptr, 0, nullptr), ITR_BAD_INPUT);
  EXPECT_EQ(itr_get_cells(nullptr, 0, nullptr), ITR_BAD_INPUT);
  CBlock block;
  EXPECT_EQ(itr_get_energies(block.simulation, nullptr), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(block.simulation), "energies: found NULL; expected an argument");
  EXPECT_EQ(itr_get_statistics(block.simulation, nullptr), ITR_BAD_INPUT);
}

/// Two triangles that touch along an edge, with vertices of their own: values, tractions and forces by vertex of one are not
/// those of the other.
void check_vertices_that_coincide(const char* options) {
  itr_model* model = itr_model_create(2);
  const double vertices[] = {0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1, 1};
  const int cells[] = {0, 1, 2, 3, 5, 4}, touching[] = {1, 2, 4, 3};
  EXPECT_EQ(itr_model_set_mesh(model, 6, vertices, 2, cells, nullptr), ITR_SUCCESS);
  EXPECT_EQ(itr_model_add_boundary(model, "touching", 2, touching, nullptr), ITR_SUCCESS) << itr_model_message(model);
  EXPECT_EQ(itr_model_set_options(model, kOptions), ITR_SUCCESS);
  EXPECT_EQ(itr_model_set_options(model, options), ITR_SUCCESS) << itr_model_message(model);
  itr_simulation* s = nullptr;
  EXPECT_EQ(itr_simulation_create(model, nullptr, nullptr, &s), ITR_SUCCESS) << itr_model_message(model);
  std::vector<double> values(12, 0);
  for (int v = 0; v < 6; ++v) values[2 * v] = v < 3 ? -0.01 : 0.02;
  const int mask[] = {1, 1}, free[] = {0, 0};
  EXPECT_EQ(itr_fix_values(s, "touching", mask, 12, values.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_step(s, 0.01), ITR_SUCCESS) << itr_simulation_message(s);
  for (const int v : {1, 2, 3, 4}) EXPECT_NEAR(itr_positions(s)[2 * v] - vertices[2 * v], values[2 * v], 1e-15) << v;
  EXPECT_EQ(itr_fix(s, "touching", free, nullptr, nullptr), ITR_SUCCESS);
  EXPECT_EQ(itr_set_traction_values(s, "touching", 12, values.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_watch_forces(s, 1), ITR_SUCCESS);
  EXPECT_EQ(itr_step(s, 0.01), ITR_SUCCESS) << itr_simulation_message(s);
  for (const int v : {1, 2, 3, 4})
    EXPECT_NEAR(itr_forces(s, ITR_APPLIED)[2 * v], values[2 * v] / std::sqrt(2.0), 1e-12) << v;
  itr_simulation_destroy(s);
  itr_model_destroy(model);
}
TEST(CInterface, KeepsVerticesThatCoincideApart) {
  check_vertices_that_coincide("{}");
  check_vertices_that_coincide(R"({"contact": {"enabled": true, "dhat": 0.001}})");
}

TEST(CInterface, ChecksTheLengthsOfArrays) {
  CBlock block;
  itr_simulation* s = block.simulation;
  const int mask[] = {1, 1};
  std::vector<double> numbers(32, 0.0);
  std::vector<int> ids(54);
  EXPECT_EQ(itr_fix_values(s, "left", mask, 31, numbers.data()), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(s), "displacements: found 31 numbers; expected 32");
  EXPECT_EQ(itr_set_traction_values(s, "left", 16, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_pressure_values(s, "left", 32, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_acceleration_values(s, 30, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_forces(s, 30, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_forces(s, 0, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_velocities(s, 33, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_get_rest_positions(s, 31, numbers.data()), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(s), "X: found a length of 31; expected 32");
  EXPECT_EQ(itr_get_cells(s, 53, ids.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_fix_values(s, "left", mask, 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_traction_values(s, "left", 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_pressure_values(s, "left", 16, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_acceleration_values(s, 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_forces(s, 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_forces(s, 0, nullptr), ITR_SUCCESS);
  EXPECT_EQ(itr_set_eigenstrain(s, 16, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_set_eigenstrain(s, 15, numbers.data()), ITR_BAD_INPUT);
  EXPECT_EQ(itr_set_eigenstrain(s, 0, nullptr), ITR_SUCCESS);
  EXPECT_EQ(itr_set_velocities(s, 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_get_rest_positions(s, 32, numbers.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_get_cells(s, 54, ids.data()), ITR_SUCCESS);
  EXPECT_EQ(itr_step(s, 0), ITR_SUCCESS);
}

TEST(CInterface, RefusesChangesFromInsideOfAStep) {
  CBlock block, other;
  struct Seen {
    itr_simulation* simulation;
    itr_snapshot *start, *inside;
    int calls, refused;
  } seen{block.simulation, itr_save(block.simulation), nullptr, 0, 0};
  itr_set_acceleration(
      block.simulation, [](const double*, double, double* a, void*) { a[0] = 0, a[1] = -10; }, nullptr);
  itr_on_iteration(
      block.simulation,
      [](int, double, double, double, void* user) {
        auto& s = *static_cast<Seen*>(user);
        const std::vector<double> zero(32);
        ++s.calls;
        s.refused += itr_restore(s.simulation, s.start) == ITR_BAD_INPUT;
        s.refused += itr_set_velocities(s.simulation, 32, zero.data()) == ITR_BAD_INPUT;
        s.refused += itr_step(s.simulation, 0) == ITR_BAD_INPUT;
        s.refused += itr_set_acceleration(s.simulation, nullptr, nullptr) == ITR_BAD_INPUT;
        s.refused += itr_on_iteration(s.simulation, nullptr, nullptr) == ITR_BAD_INPUT;
        itr_snapshot_destroy(s.inside);
        s.inside = itr_save(s.simulation);
        return 1;
      },
      &seen);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS) << itr_simulation_message(block.simulation);
  EXPECT_GT(seen.calls, 0);
  EXPECT_EQ(seen.refused, 5 * seen.calls);
  EXPECT_NEAR(itr_time(block.simulation), 0.01, 1e-15);
  ASSERT_EQ(itr_restore(block.simulation, seen.inside), ITR_SUCCESS);
  EXPECT_EQ(itr_time(block.simulation), 0);
  EXPECT_EQ(itr_restore(other.simulation, seen.inside), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(other.simulation),
               "saved state: found one of another simulation; expected one that this simulation has saved");
  itr_snapshot_destroy(seen.start);
  itr_snapshot_destroy(seen.inside);
}

TEST(CInterface, CancelsSavesAndRestores) {
  CBlock block;
  const auto gravity = [](const double*, double, double* a, void*) { a[0] = 0, a[1] = -10; };
  itr_set_acceleration(block.simulation, gravity, nullptr);
  int calls = 0;
  itr_on_iteration(
      block.simulation, [](int, double, double, double, void* user) { return ++*static_cast<int*>(user) < 1 ? 1 : 0; },
      &calls);
  EXPECT_EQ(itr_step(block.simulation, 0.01), ITR_CANCELLED);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(itr_steps(block.simulation), 0);
  itr_on_iteration(block.simulation, nullptr, nullptr);
  itr_snapshot* saved = itr_save(block.simulation);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS);
  EXPECT_NEAR(itr_velocities(block.simulation)[1], -0.1, 1e-9);
  EXPECT_EQ(itr_forces(block.simulation, ITR_CONTACT), nullptr);
  const double y = itr_positions(block.simulation)[1];
  itr_energies energies;
  itr_get_energies(block.simulation, &energies);
  itr_step_statistics statistics;
  itr_get_statistics(block.simulation, &statistics);
  EXPECT_GT(statistics.newton_iterations, 0);
  EXPECT_NEAR(energies.total, energies.inertia + energies.elastic + energies.body, 1e-12);
  itr_restore(block.simulation, saved);
  EXPECT_EQ(itr_time(block.simulation), 0);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS);
  EXPECT_EQ(itr_positions(block.simulation)[1], y);
  itr_snapshot_destroy(saved);
}

template <typename Get>
std::vector<int> ints(itr_simulation* simulation, const Get& get, size_t length) {
  std::vector<int> values(length);
  EXPECT_EQ(get(simulation, length, values.data()), ITR_SUCCESS) << itr_simulation_message(simulation);
  return values;
}
template <typename Get>
std::vector<double> doubles(itr_simulation* simulation, const Get& get, size_t length) {
  std::vector<double> values(length);
  EXPECT_EQ(get(simulation, length, values.data()), ITR_SUCCESS) << itr_simulation_message(simulation);
  return values;
}

/// A pulled quadratic triangle, in C and by the facade.
TEST(CInterface, GivesMeshAndStressOfTheFacade) {
  const std::array nodes{0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.5, 0.5, 0.0, 0.5};
  const std::array cell{0, 1, 2, 3, 4, 5};
  const std::array bodies{7};
  const std::array left{0, 2};
  Model facade_model(2);
  facade_model.set_quadratic_mesh(nodes, cell, bodies);
  facade_model.add_boundary("left", left);
  facade_model.set_options(kOptions);
  facade_model.set_option("/time/dt", "0.02");
  AnySimulation facade(facade_model);
  facade.set_traction("left", [](const double* X, double, double* f) { f[0] = -1000 * X[1], f[1] = 0; });
  facade.set_pressure("left", [](const double*, double, double* p) { *p = 500; });
  ASSERT_TRUE(facade.step().ok);

  itr_model* model = itr_model_create(2);
  ASSERT_EQ(itr_model_set_quadratic_mesh(model, 6, nodes.data(), 1, cell.data(), bodies.data()), ITR_SUCCESS);
  ASSERT_EQ(itr_model_add_boundary(model, "left", 1, left.data(), nullptr), ITR_SUCCESS);
  ASSERT_EQ(itr_model_set_options(model, kOptions), ITR_SUCCESS);
  ASSERT_EQ(itr_model_set_number(model, "/time/dt", 0.02), ITR_SUCCESS);
  itr_simulation* s = nullptr;
  ASSERT_EQ(itr_simulation_create(model, nullptr, nullptr, &s), ITR_SUCCESS) << itr_model_message(model);
  itr_set_traction(
      s, "left", [](const double* X, double, double* f, void*) { f[0] = -1000 * X[1], f[1] = 0; }, nullptr);
  itr_set_pressure(
      s, "left", [](const double*, double, double* p, void*) { *p = 500; }, nullptr);
  ASSERT_EQ(itr_step(s, 0), ITR_SUCCESS) << itr_simulation_message(s);
  EXPECT_EQ(itr_time(s), 0.02);

  const std::span<const double> x = facade.positions();
  EXPECT_EQ(std::vector(itr_positions(s), itr_positions(s) + 12), std::vector(x.begin(), x.end()));
  EXPECT_NE(x[10], 0);
  EXPECT_EQ(ints(s, itr_get_bodies, 1), facade.bodies());
  EXPECT_EQ(ints(s, itr_get_facets, 6), facade.facets());
  EXPECT_EQ(ints(s, itr_get_facet_boundaries, 3), facade.facet_boundaries());
  EXPECT_EQ(ints(s, itr_get_curved_edges, 6), facade.curved_edges());
  EXPECT_EQ(doubles(s, itr_get_stress, 4), facade.stress());
  EXPECT_EQ(doubles(s, itr_get_von_mises, 1), facade.von_mises());
  EXPECT_GT(facade.von_mises()[0], 0);
  itr_simulation_destroy(s);
  itr_model_destroy(model);
}

TEST(CInterface, AdaptsAndTellsOfNewMeshes) {
  CBlock block(kRemesh);
  itr_simulation* s = block.simulation;
  const int both[] = {1, 1};
  itr_fix(
      s, "left", both, [](const double*, double, double* u, void*) { u[0] = u[1] = 0; }, nullptr);
  itr_set_acceleration(
      s, [](const double*, double, double* a, void*) { a[0] = 0, a[1] = -100; }, nullptr);
  struct Told {
    int changes = 0, failed = 0;
    double worst = 0;  ///< how far a constant field is from 1 on the new mesh
  } told;
  itr_on_mesh_change(
      s,
      [](const itr_mesh_change* change, void* user) {
        Told& t = *static_cast<Told*>(user);
        ++t.changes;
        const std::vector<double> ones(change->old_vertices, 1.0);
        std::vector<double> projected(change->new_vertices);
        t.failed += itr_project(change, 1, ones.data(), projected.data()) != ITR_SUCCESS;
        for (size_t i = 0; i < change->new_vertices; ++i) {
          double interpolated = 0;
          for (int k = change->row_start[i]; k < change->row_start[i + 1]; ++k) interpolated += change->value[k];
          t.worst = std::max({t.worst, std::abs(projected[i] - 1), std::abs(interpolated - 1)});
        }
      },
      &told);
  const size_t cells = itr_num_cells(s);
  ASSERT_EQ(itr_adapt(s, 0.01), ITR_SUCCESS) << itr_simulation_message(s);
  EXPECT_EQ(itr_steps(s), 0);
  EXPECT_EQ(told.changes, 1);
  EXPECT_EQ(told.failed, 0);
  EXPECT_LT(told.worst, 1e-12);
  const size_t adapted = itr_num_cells(s);
  EXPECT_GT(adapted, cells);
  ASSERT_EQ(itr_freeze_mesh(s, 1), ITR_SUCCESS);
  ASSERT_EQ(itr_step(s, 0.01), ITR_SUCCESS) << itr_simulation_message(s);
  EXPECT_EQ(itr_num_cells(s), adapted);
  EXPECT_EQ(told.changes, 1);
}

TEST(CInterface, MovesAnObstacle) {
  CBlock block(R"({"contact": {"enabled": true, "dhat": 1e-3}})", [](itr_model* model) {
    const double wall[] = {0.2005, -1, 0.2005, 1};
    const int edge[] = {0, 1};
    return itr_model_add_obstacle(model, "wall", 2, wall, 1, edge, 0, nullptr, nullptr);
  });
  const auto to_the_left = [](const double*, double t, double* u, void*) { u[0] = -t, u[1] = 0; };
  EXPECT_EQ(itr_move_obstacle(block.simulation, "wand", to_the_left, nullptr), ITR_BAD_INPUT);
  ASSERT_EQ(itr_move_obstacle(block.simulation, "wall", to_the_left, nullptr), ITR_SUCCESS);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS) << itr_simulation_message(block.simulation);
  for (size_t v = 0; v < itr_num_vertices(block.simulation); ++v)
    EXPECT_LT(itr_positions(block.simulation)[2 * v], 0.2005 - 0.01) << v;
}

TEST(CInterface, HasTheVersionOfItsCitation) {
  std::ifstream file(std::string(ITR_SOURCE_DIR) + "/CITATION.cff");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_NE(text.find("\nversion: " + std::string(itr_version()) + "\n"), std::string::npos) << itr_version();
}

TEST(CInterface, CountsCurvedEdges) {
  CBlock block(R"({"space": {"remesh": {"enabled": true, "split": {"enabled": false}, "collapse": {"enabled": false},
                                        "curve": {"enabled": true, "acceptance_tolerance": 1e-6}}}})");
  const size_t n = itr_num_vertices(block.simulation);
  std::vector<double> rest(2 * n), held(2 * n, 0.0);
  ASSERT_EQ(itr_get_rest_positions(block.simulation, rest.size(), rest.data()), ITR_SUCCESS);
  const int both[] = {1, 1};
  for (size_t i = 0; i < n; ++i) held[2 * i] = 0.05 * rest[2 * i + 1] * rest[2 * i + 1];
  ASSERT_EQ(itr_fix_values(block.simulation, "left", both, held.size(), held.data()), ITR_SUCCESS)
      << itr_simulation_message(block.simulation);
  ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS) << itr_simulation_message(block.simulation);
  itr_step_statistics statistics;
  ASSERT_EQ(itr_get_statistics(block.simulation, &statistics), ITR_SUCCESS);
  EXPECT_GT(statistics.curves, 0);
  EXPECT_EQ(static_cast<size_t>(statistics.curves - statistics.straightens), itr_num_nodes(block.simulation) - n);
  EXPECT_EQ(statistics.splits + statistics.collapses + statistics.swaps + statistics.smooths + statistics.cut_steps, 0);
  EXPECT_GT(statistics.min_volume_ratio, 0);
  EXPECT_GT(statistics.seconds, 0);
}

TEST(CInterface, TakesForcesOfPositions) {
  CBlock block;
  itr_set_follower_forces(
      block.simulation,
      [](size_t n, const double*, const double* x, double, double* f, void*) {
        for (size_t i = 0; i < 2 * n; ++i) f[i] -= 100 * x[i];
      },
      nullptr, nullptr);
  for (int i = 0; i < 3; ++i)
    ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS) << itr_simulation_message(block.simulation);
  double sum = 0;  // drawn towards the origin
  for (size_t i = 0; i < 2 * itr_num_vertices(block.simulation); ++i) sum += itr_velocities(block.simulation)[i];
  EXPECT_LT(sum, -0.1);
}

TEST(CInterface, TakesTheirStiffness) {
  std::vector<int> iterations;
  std::vector<double> heights;
  const auto springs = [](size_t n, const double*, const double* x, double, double* f, void*) {
    for (size_t i = 0; i < 2 * n; ++i) f[i] -= 300 * x[i];
  };
  const auto stiffness = [](size_t n, const double*, const double*, double, itr_block_receiver add, void* to, void*) {
    const double block[] = {300, 0, 0, 300};
    for (int v = 0; v < static_cast<int>(n); ++v) add(to, 1, &v, block);
  };
  for (const bool with_stiffness : {false, true}) {
    CBlock block;
    itr_set_follower_forces(block.simulation, springs, with_stiffness ? +stiffness : nullptr, nullptr);
    ASSERT_EQ(itr_step(block.simulation, 0.01), ITR_SUCCESS);
    itr_step_statistics statistics;
    itr_get_statistics(block.simulation, &statistics);
    iterations.push_back(statistics.newton_iterations);
    heights.push_back(itr_positions(block.simulation)[31]);
  }
  EXPECT_LT(iterations[1], iterations[0]);
  EXPECT_NEAR(heights[1], heights[0], 1e-9);
}

constexpr double kFoundation = 1e4;  // [N/m^2]

/// f(vertex, k) for the ends of the facets of the boundary of id 1, k by the trapezoidal rule.
template <typename F>
void for_each_spring(const itr_part* part, F&& f) {
  for (size_t i = 0; i < part->num_facets; ++i)
    if (part->boundaries[i] == 1) {
      const int a = part->facets[2 * i], b = part->facets[2 * i + 1];
      const double k =
          kFoundation * std::hypot(part->X[2 * a] - part->X[2 * b], part->X[2 * a + 1] - part->X[2 * b + 1]) / 2;
      f(a, k), f(b, k);
    }
}

const itr_term kCFoundation{[](const itr_part* part, const double* x, void*) {
                              double sum = 0;
                              for_each_spring(part, [&](int v, double k) {
                                for (int i = 2 * v; i < 2 * v + 2; ++i)
                                  sum += k / 2 * (x[i] - part->X[i]) * (x[i] - part->X[i]);
                              });
                              return sum;
                            },
                            [](const itr_part* part, const double* x, double* gradient, void*) {
                              for_each_spring(part, [&](int v, double k) {
                                for (int i = 2 * v; i < 2 * v + 2; ++i) gradient[i] += k * (x[i] - part->X[i]);
                              });
                            },
                            [](const itr_part* part, const double*, itr_block_receiver add, void* to, void*) {
                              for_each_spring(part, [&](int v, double k) {
                                const double block[] = {k, 0, 0, k};
                                add(to, 1, &v, block);
                              });
                            }};

/// Foundation as an energy of the library's kind.
class Foundation final : public Energy {
 public:
  Foundation(const CellSet<2>& cells, double scale) : cells_(cells) {
    for (const auto& facet : cells.facets)
      if (facet.tag == 1) {
        const auto [a, b] = facet.vertices;
        const double k = scale * kFoundation * (cells.rest[a] - cells.rest[b]).norm() / 2;
        springs_.insert(springs_.end(), {{a, k}, {b, k}});
      }
  }
  std::string_view name() const override { return "foundation"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = 0;
    for (const auto& [v, k] : springs_) sum += k / 2 * (x.segment<2>(2 * v) - cells_.rest[v]).squaredNorm();
    return sum;
  }
  void add_gradient(ConstVectorView x, VectorView g, Workspace&) const override {
    for (const auto& [v, k] : springs_) g.segment<2>(2 * v) += k * (x.segment<2>(2 * v) - cells_.rest[v]);
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (const auto& [v, k] : springs_) sink.add<2>(std::array{v}, Mat<2>(k * Mat<2>::Identity()).data());
  }

 private:
  const CellSet<2>& cells_;
  std::vector<std::pair<int, double>> springs_;
};

TEST(CInterface, TakesTermsThatTrialsAskToo) {
  Model model = block_model<2>();
  model.set_options(kRemesh);
  AnySimulation cpp(model);
  cpp.as<2>().conditions().terms.push_back(
      [](const CellSet<2>& cells, double, double scale) { return std::make_shared<Foundation>(cells, scale); });
  cpp.set_acceleration([](const double*, double, double* a) { a[1] = -100; });

  CBlock block(kRemesh);
  ASSERT_EQ(itr_set_term(block.simulation, "foundation", &kCFoundation, nullptr), ITR_SUCCESS);
  itr_set_acceleration(
      block.simulation, [](const double*, double, double* a, void*) { a[1] = -100; }, nullptr);
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(cpp.step().ok);
    ASSERT_EQ(itr_step(block.simulation, 0), ITR_SUCCESS) << itr_simulation_message(block.simulation);
  }
  EXPECT_NE(cpp.num_vertices(), 16);
  ASSERT_EQ(itr_num_vertices(block.simulation), size_t(cpp.num_vertices()));
  itr_energies energies;
  itr_get_energies(block.simulation, &energies);
  EXPECT_GT(energies.host, 0);
  EXPECT_NEAR(energies.host, cpp.report().energy.host, 1e-9 * energies.host);
  for (std::size_t i = 0; i < cpp.positions().size(); ++i)
    EXPECT_NEAR(itr_positions(block.simulation)[i], cpp.positions()[i], 1e-9);

  itr_term half = kCFoundation;
  half.add_hessian = nullptr;
  EXPECT_EQ(itr_set_term(block.simulation, "foundation", &half, nullptr), ITR_BAD_INPUT);
  EXPECT_STREQ(itr_simulation_message(block.simulation), "term.add_hessian: found NULL; expected a function");
  ASSERT_EQ(itr_set_term(block.simulation, "foundation", nullptr, nullptr), ITR_SUCCESS);
  ASSERT_EQ(itr_step(block.simulation, 0), ITR_SUCCESS);
  itr_get_energies(block.simulation, &energies);
  EXPECT_EQ(energies.host, 0);
}

/// mu/2 (|F|^2 - 2 - 2 ln J) + lambda/2 (ln J)^2 in 2D; `user`: mu and lambda.
const itr_law kCNeoHookean{
    [](int, const double* F, void* user) {
      const double* lame = static_cast<double*>(user);
      const double log_j = std::log(F[0] * F[3] - F[1] * F[2]);
      return lame[0] / 2 * (F[0] * F[0] + F[1] * F[1] + F[2] * F[2] + F[3] * F[3] - 2 - 2 * log_j) +
             lame[1] / 2 * log_j * log_j;
    },
    [](int, const double* F, double* P, void* user) {
      const double* lame = static_cast<double*>(user);
      const double J = F[0] * F[3] - F[1] * F[2], T[] = {F[3] / J, -F[2] / J, -F[1] / J, F[0] / J};
      for (int i = 0; i < 4; ++i) P[i] = lame[0] * (F[i] - T[i]) + lame[1] * std::log(J) * T[i];
    },
    [](int, const double* F, double* H, void* user) {
      const double* lame = static_cast<double*>(user);
      const double J = F[0] * F[3] - F[1] * F[2], T[] = {F[3] / J, -F[2] / J, -F[1] / J, F[0] / J};
      const double c = lame[0] - lame[1] * std::log(J);
      const double cofactor[4][4] = {{0, 0, 0, 1}, {0, 0, -1, 0}, {0, -1, 0, 0}, {1, 0, 0, 0}};  // d2J/dF2
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j)
          H[4 * j + i] = (i == j ? lame[0] : 0) + (c + lame[1]) * T[i] * T[j] - c * cofactor[i][j] / J;
    }};

TEST(CInterface, TakesLawsOfTheProgram) {
  for (const char* more : {"{}", kRemesh}) {
    Material material{.youngs_modulus = 1e5, .poisson_ratio = 0.3};
    double lame[] = {material.lame_mu(), material.lame_lambda(2)};
    CBlock library(more), own(more, [&](itr_model*model) { return itr_model_set_law(model, 0, &kCNeoHookean, lame); });
    std::vector<double> heights;
    for (itr_simulation* simulation : {library.simulation, own.simulation}) {
      const int mask[] = {1, 1};
      itr_fix(
          simulation, "left", mask, [](const double*, double, double*, void*) {}, nullptr);
      itr_set_acceleration(
          simulation, [](const double*, double, double* a, void*) { a[1] = -100; }, nullptr);
      for (int i = 0; i < 4; ++i) ASSERT_EQ(itr_step(simulation, 0), ITR_SUCCESS) << itr_simulation_message(simulation);
      itr_energies energies;
      itr_get_energies(simulation, &energies);
      heights.push_back(energies.elastic);
    }
    EXPECT_EQ(itr_num_vertices(own.simulation) > 16, more == kRemesh);
    EXPECT_NEAR(heights[1], heights[0], (more == kRemesh ? 1e-3 : 1e-8) * heights[0]);
  }
  // A law that gives no numbers: a step that cannot be done, with a reason.
  itr_law broken = kCNeoHookean;
  broken.stress = [](int, const double*, double* P, void*) { P[0] = std::numeric_limits<double>::quiet_NaN(); };
  double lame[] = {1e5, 1e5};
  CBlock block("{}", [&](itr_model* model) { return itr_model_set_law(model, 0, &broken, lame); });
  itr_set_acceleration(
      block.simulation, [](const double*, double, double* a, void*) { a[1] = -100; }, nullptr);
  EXPECT_EQ(itr_step(block.simulation, 0), ITR_STOPPED);
  EXPECT_STRNE(itr_simulation_message(block.simulation), "");
  EXPECT_EQ(itr_steps(block.simulation), 0);
}

}  // namespace
}  // namespace itr
