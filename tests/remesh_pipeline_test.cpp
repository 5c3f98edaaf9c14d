// SPDX-License-Identifier: MIT
// The pipeline of operations: one that the library does not have, added in this file alone, and the order of collapses.
#include "remesh/schedule/pipeline.hpp"

#include <gtest/gtest.h>

#include <set>

#include "core/parallel.hpp"
#include "fem/inverted.hpp"
#include "random_mesh.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

/// Moves vertices to the mean of their neighbours where that gains energy.
void average_vertices(RemeshSession<2>& session, double least_gain) {
  const Mesh<2>& mesh = session.queries().mesh();
  Operation<2> average(session, OperationKind::smooth, &RemeshReport::smooths, least_gain);
  average.list = [&] {
    std::vector<Candidate> found;
    for (VertexId v = 0; v < mesh.node_slots(); ++v) found.emplace_back(OperationKind::smooth, v);
    return found;
  };
  average.is_candidate = [](const EdgeKey&) { return false; };
  average.refuse = [&](const Candidate& candidate) {
    return mesh.is_boundary(candidate.vertex()) ? Refusal::held : Refusal::none;
  };
  average.priority = [](const Candidate&) { return 0.0; };
  average.propose = [&](const Candidate& candidate, auto&) {
    Vec<2> sum = Vec<2>::Zero();
    int count = 0;
    for (const CellId c : mesh.cells_of(candidate.vertex()))
      for (const VertexId v : mesh.cell(c)) sum += mesh.rest(v), ++count;
    return propose_move<2>(mesh, session.queries().strata(), candidate.vertex(), sum / count);
  };
  run_operations<2>(session, {&average});
}

/// A scene whose vertices are averaged.
struct Averaging {
  TrialScene scene{2, 8};
  RemeshMemory memory;
  Strata<2> strata;
  RemeshOptions options = remesh_options();

  OperationCount operator()(double tolerance) {
    RemeshSession<2> session(scene.mesh, scene.fields, scene.context, options, nullptr, memory, strata);
    average_vertices(session, tolerance);
    return session.finish().smooths;
  }
};

TEST(Pipeline, TakesAnOperationOfATest) {
  Averaging run;
  const OperationCount first = run(1e-4);
  EXPECT_GT(first.accepted, 0);
  EXPECT_GT(first.refused_by(Refusal::held), 0);
  EXPECT_GT(first.refused_by(Refusal::energy) + first.refused_by(Refusal::prediction), 0);
  EXPECT_EQ(find_inverted<2>(run.scene.mesh, run.scene.fields.x), kNone);
  EXPECT_EQ(run.scene.mesh.find_defect(), "");
}

TEST(Pipeline, RemembersRefusalsOfAnOperationOfATest) {
  Averaging run;
  const OperationCount refused = run(1e6);
  EXPECT_EQ(refused.accepted, 0);
  EXPECT_FALSE(run.memory.refusals.empty());
  const OperationCount again = run(1e6);
  EXPECT_EQ(again.refused_by(Refusal::energy) + again.refused_by(Refusal::prediction), 0);
  run.memory = {};
  EXPECT_GT(run(1e-4).accepted, 0);
}

TEST(Pipeline, FindsTheSameOnAnyNumberOfThreads) {
  std::vector<VectorX> found;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    Averaging run;
    EXPECT_GT(run(1e-4).accepted, 0);
    found.push_back(run.scene.fields.x);
  }
  EXPECT_TRUE(found[0] == found[1]);
}

/// Rest positions of the cells of two bodies.
std::set<std::array<double, 6>> cells_of_first_bodies(const Mesh<2>& mesh) {
  std::set<std::array<double, 6>> found;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c) || mesh.body(c) == 3) continue;
    const auto& cell = mesh.cell(c);
    std::array<double, 6> at{};
    const int first = static_cast<int>(std::min_element(cell.begin(), cell.end()) - cell.begin());
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 2; ++i) at[2 * k + i] = mesh.rest(cell[(first + k) % 3])[i];
    found.insert(at);
  }
  return found;
}

/// Collapses with this tolerance [J], and returns what that makes of the first bodies. The third may have a curved edge.
std::set<std::array<double, 6>> collapse(unsigned seed, double tolerance, bool curves) {
  TrialScene scene(seed, 10, {.second_body = true});
  scene.context.materials[3] = scene.context.materials[1];
  scene.context.contact.enabled = false;
  RemeshOptions options = remesh_options();
  options.split.enabled = false;
  options.collapse.rel_max_edge_length = 100;
  options.collapse.acceptance_tolerance = tolerance;
  options.straighten.enabled = true;
  options.straighten.acceptance_tolerance = 1e6;  // the curve stays
  RemeshMemory memory;
  Strata<2> strata;
  if (curves) {
    std::vector<EdgeKey> edges = scene.mesh.edges();
    std::erase_if(edges, [&](const EdgeKey& edge) { return scene.mesh.rest(edge[0])[0] < 1.01; });
    curve_edges<2>(std::span(edges).first(1), scene.mesh, scene.fields, scene.context, options, memory, strata);
    EXPECT_EQ(scene.mesh.num_curved(), 1);
  }
  const auto report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
  EXPECT_GT(report.collapses.accepted, 20);
  return cells_of_first_bodies(scene.mesh);
}

/// A curved edge in one body leaves the order of collapses in others as it is, and what decides about them.
TEST(Pipeline, OneCurvedEdgeChangesNoCollapsesElsewhere) {
  for (const unsigned seed : {0u, 1u, 2u, 4u})
    for (const double tolerance : {-1e-3, -1e-4, -1e-5})
      EXPECT_EQ(collapse(seed, tolerance, false), collapse(seed, tolerance, true)) << seed << ", " << tolerance;
}

}  // namespace
}  // namespace itr
