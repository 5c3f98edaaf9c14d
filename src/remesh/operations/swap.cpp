// SPDX-License-Identifier: MIT
// Swaps. Only one that betters the shape may cost a little energy: without that condition, edges swap to and fro.
#include <algorithm>
#include <unordered_map>

#include "remesh/edits/edit_checks.hpp"
#include "remesh/schedule/pipeline.hpp"

namespace itr {

namespace {

int valence(const Mesh<2>& mesh, VertexId v) {
  return static_cast<int>(mesh.cells_of(v).size()) + (mesh.is_boundary(v) ? 1 : 0);
}

/// By how much a swap brings the valences of its quadrilateral nearer to 6 (4 on the boundary).
double valence_gain(const Mesh<2>& mesh, const EdgeKey& edge) {
  double gain = 0;
  const auto badness = [&](VertexId v, int change) {
    const double off = valence(mesh, v) + change - (mesh.is_boundary(v) ? 4 : 6);
    return off * off;
  };
  for (const int v : edge) gain += badness(v, 0) - badness(v, -1);
  for (const CellId c : mesh.cells_of_edge(edge))
    for (const int v : mesh.cell(c))
      if (v != edge[0] && v != edge[1]) gain += badness(v, 0) - badness(v, 1);
  return gain;
}

constexpr double kBetter = 1.2;  ///< least factor of the worst quality by which a swap betters a shape

/// Worst quality of the cells that an edit makes over that of those that it removes.
double shape_gain(const Mesh<3>& mesh, const Edit<3>& edit) {
  double after = 1;
  for (const auto& cell : edit.inserted_cells)
    after = std::min(after, quality_with<3>(mesh, cell.vertices, kNone, Vec<3>::Zero()));
  return after / worst_quality<3>(mesh, edit.removed_cells);
}

/// Sets the least gain of a swap: for each node that it adds, that of a curve more.
template <int Dim, typename Betters>
void set_tolerance(RemeshSession<Dim>& session, Operation<Dim>& swap, const Betters& betters_shape) {
  swap.tolerance = [&session, betters_shape](const Trial<Dim>& trial) {
    const RemeshQueries<Dim>& queries = session.queries();
    const bool for_shape = betters_shape(*trial.edit) && session.shape_matters(trial.candidate(), trial.key);
    const double tolerance = queries.options().swap.acceptance_tolerance.value();
    const double least = for_shape ? tolerance : std::max(queries.least_worthwhile(), tolerance);
    return least + std::max(trial.edit->added_nodes(), 0) * queries.options().curve_tolerance();
  };
  swap.patch_over_prediction = [](const Trial<Dim>& trial) { return trial.in_contact ? std::nullopt : std::optional(1.0); };
}

/// Runs swaps of edges, each of which is tried up to kMostGenerations times. `priority`(edge, whether an edge was evaluated
/// yet).
template <int Dim, typename Priority>
void run_edge_swaps(RemeshSession<Dim>& session, Operation<Dim>& swap, const Priority& priority) {
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries;
  bool has_begun = false;
  swap.refuse = [&](const Candidate& candidate) {
    const auto it = tries.find(candidate.edge());
    const bool is_over = it != tries.end() && it->second >= kMostGenerations;
    return is_over ? Refusal::depth : Refusal::none;
  };
  swap.priority = [&](const Candidate& candidate) { return priority(candidate.edge(), has_begun); };
  swap.after = [&](const Trial<Dim>& trial, bool) {
    has_begun = true;
    if (trial.was_previewed) ++tries[trial.edge()];
  };
  run_operations<Dim>(session, {&swap});
}

/// Removes facets between cells that are there at first, each once, in the order of their vertices and only for a gain of
/// energy. Leaves out those whose removal an edge removal would undo to improve the shape.
void remove_facets(RemeshSession<3>& session) {
  const Mesh<3>& mesh = session.queries().mesh();
  Operation<3> removal(session, OperationKind::remove_facet, &RemeshReport::swaps, 0);
  set_tolerance(session, removal, [](const Edit<3>&) { return false; });
  removal.list = [&] {
    std::vector<Candidate> sides, found;
    for (CellId c = 0; c < mesh.cell_slots(); ++c)
      for (int k = 0; k < 4 && mesh.is_cell_alive(c); ++k)
        sides.emplace_back(OperationKind::remove_facet, opposite_facet<3>(mesh.cell(c), k));
    std::sort(sides.begin(), sides.end());
    for (auto side = sides.begin(); (side = std::adjacent_find(side, sides.end())) != sides.end(); ++side)
      found.push_back(*side);
    return found;
  };
  removal.priority = [](const Candidate&) { return 0.0; };
  removal.propose = [&](const Candidate& candidate, auto&) {
    auto proposal = propose_facet_removal(mesh, candidate.facet());
    if (proposal && shape_gain(mesh, *proposal.edit) < 1 / kBetter) return refused<3>(Refusal::shape);
    return proposal;
  };
  removal.is_candidate = [](const EdgeKey&) { return false; };
  run_operations<3>(session, {&removal});
}

}  // namespace

/// Most gain of valence first; after the first swap, edges that gain none are left out.
void swap_edges(RemeshSession<2>& session) {
  const RemeshQueries<2>& queries = session.queries();
  const Mesh<2>& mesh = queries.mesh();
  Operation<2> swap(session, OperationKind::swap, &RemeshReport::swaps, 0);
  set_tolerance(session, swap, [&](const Edit<2>& edit) { return valence_gain(mesh, edit.edge) > 0; });
  swap.propose = [&](const Candidate& candidate, auto&) {
    return propose_diagonal_swap(mesh, queries.strata(), candidate.edge());
  };
  // Valences change all around.
  swap.edges_to_ask = [&](const Trial<2>& trial) { return edges_of<2>(mesh, trial.verdict.patch); };
  run_edge_swaps(session, swap, [&](const EdgeKey& edge, bool has_begun) -> std::optional<double> {
    const double gain = valence_gain(mesh, edge);
    if (queries.is_surface(edge) || (has_begun && gain <= 0)) return std::nullopt;
    return gain;
  });
}

/// Removes edges, in the volume or within a flat patch, such that the energy of the new tetrahedra is least, worst shape
/// first. At frozen positions this energy is a sum over tetrahedra.
void swap_edges(RemeshSession<3>& session) {
  const RemeshQueries<3>& queries = session.queries();
  const Mesh<3>& mesh = queries.mesh();
  Operation<3> removal(session, OperationKind::swap, &RemeshReport::swaps, 0);
  set_tolerance(session, removal, [&](const Edit<3>& edit) { return shape_gain(mesh, edit) > kBetter; });
  const auto cost = [&](const auto& cell, int body, const Edit<3>& edit) { return queries.energy_of(cell, body, edit); };
  removal.propose = [&](const Candidate& candidate, auto&) {
    return propose_edge_removal(mesh, queries.strata(), candidate.edge(), cost);
  };
  run_edge_swaps(session, removal, [&](const EdgeKey& edge, bool) {
    return std::optional(-worst_quality<3>(mesh, mesh.cells_of_edge(edge)));
  });
  remove_facets(session);
}

}  // namespace itr
