// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>
#include <unordered_map>

#include "itr/energy/elastic/laws.hpp"
#include "itr/geometry/measures.hpp"
#include "itr/remesh/edits.hpp"
#include "session.hpp"

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

/// Tries a swap that was not refused before; one that betters the shape may cost a little energy.
template <int Dim>
Verdict<Dim> attempt(RemeshSession<Dim>& session, const EdgeKey& edge, const Edit<Dim>& edit, const Vec<Dim>& center,
                     bool betters_shape) {
  const double tolerance = session.options().swap.acceptance_tolerance;
  const double least = betters_shape ? tolerance : std::max(session.least_worthwhile(), tolerance);
  const double signal = session.roughness(edge);
  const bool in_contact = session.is_in_contact(edge);
  Verdict<Dim> verdict{.decision = Decision::by_bound};
  if (session.was_refused(RemeshMemory::swap, edge, signal, in_contact)) return verdict;
  if (!session.screens() || session.predict(edit) >= session.context().scaling * least) {
    OperationCount& count = session.report().swaps;
    ++count.tried;
    verdict = session.attempt(edit, center, least);
    count.relaxed += verdict.was_relaxed;
    count.accepted += verdict.accepted();
  }
  if (!verdict.accepted())
    session.remember(RemeshMemory::swap, edge, {signal / kSameSignal, signal * kSameSignal, in_contact});
  return verdict;
}

/// Of the worst cell around an edge.
double worst_quality(const Mesh<3>& mesh, std::span<const CellId> cells) {
  double worst = 1;
  for (const CellId c : cells) {
    const auto& v = mesh.cell(c);
    worst = std::min(worst, simplex_quality<3>({mesh.rest(v[0]), mesh.rest(v[1]), mesh.rest(v[2]), mesh.rest(v[3])}));
  }
  return worst;
}

}  // namespace

void swap_edges(RemeshSession<2>& session) {
  const Mesh<2>& mesh = session.mesh();
  const SwapOptions& options = session.options().swap;
  EdgeQueue queue;
  for (const EdgeKey& edge : mesh.edges())
    if (!session.is_surface(edge)) queue.push(edge, valence_gain(mesh, edge));
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries;
  while (const auto edge = queue.pop()) {
    if (session.is_cancelled()) return;
    if (!session.exists(*edge) || tries[*edge]++ >= options.max_depth) continue;
    const auto edit = make_swap(mesh, *edge);
    if (!edit) continue;
    // An increase in energy is allowed for the sake of the mesh's shape only: without that, edges swap to and fro.
    const Vec<2> center = 0.5 * (mesh.rest((*edge)[0]) + mesh.rest((*edge)[1]));
    const auto verdict = attempt(session, *edge, *edit, center, valence_gain(mesh, *edge) > 0);
    if (!verdict.accepted()) continue;
    for (const EdgeKey& near : session.edges_of(verdict.patch))
      if (!session.is_surface(near) && valence_gain(mesh, near) > 0) queue.push(near, valence_gain(mesh, near));
  }
}

void swap_edges(RemeshSession<3>& session) {
  const Mesh<3>& mesh = session.mesh();
  const auto at = [&](const VectorX& field, VertexId v) { return Vec<3>(field.segment<3>(3 * v)); };
  // At frozen positions the elastic energy is a sum over tetrahedra: that of the new ones is least.
  const CellCost elastic_energy = [&](const MeshTypes<3>::Cell& cell, int body) {
    std::array<Vec<3>, 4> X, x;
    Vec<3> barycenter = Vec<3>::Zero();
    for (int k = 0; k < 4; ++k) {
      X[k] = mesh.rest(cell[k]);
      x[k] = at(session.fields().x, cell[k]);
      barycenter += X[k] / 4;
    }
    const Mat<3> edges = edge_matrix<3>(X), F = edge_matrix<3>(x) * edges.inverse();
    const ElasticModuli moduli = elastic_moduli<3>(session.context().materials.at(body), barycenter);
    return simplex_volume<3>(edges) * elastic_density<3>(F, moduli);
  };
  EdgeQueue queue;
  const auto push = [&](const EdgeKey& edge) {
    if (!session.is_surface(edge)) queue.push(edge, -worst_quality(mesh, mesh.cells_of_edge(edge)));
  };
  for (const EdgeKey& edge : mesh.edges()) push(edge);
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries;
  while (const auto edge = queue.pop()) {
    if (!session.exists(*edge) || tries[*edge]++ >= session.options().swap.max_depth) continue;
    const auto proposal = propose_edge_removal(mesh, session.strata(), *edge, elastic_energy);
    if (!proposal) continue;
    double after = 1;
    for (const auto& cell : proposal.edit->inserted_cells) {
      const auto& v = cell.vertices;
      after = std::min(after, simplex_quality<3>({mesh.rest(v[0]), mesh.rest(v[1]), mesh.rest(v[2]), mesh.rest(v[3])}));
    }
    constexpr double kBetter = 1.2;
    const bool betters_shape = after > kBetter * worst_quality(mesh, proposal.edit->removed_cells);
    const Vec<3> center = 0.5 * (mesh.rest((*edge)[0]) + mesh.rest((*edge)[1]));
    const auto verdict = attempt(session, *edge, *proposal.edit, center, betters_shape);
    if (!verdict.accepted()) continue;
    const auto new_cells = std::span(verdict.patch).last(proposal.edit->inserted_cells.size());
    for (const EdgeKey& near : session.edges_of(new_cells)) push(near);
  }
}

}  // namespace itr
