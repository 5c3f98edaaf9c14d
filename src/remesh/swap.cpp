// SPDX-License-Identifier: MIT
#include <algorithm>
#include <unordered_map>

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

}  // namespace

void swap_edges(RemeshSession<2>& session) {
  const Mesh<2>& mesh = session.mesh();
  const SwapOptions& options = session.options().swap;
  EdgeQueue queue;
  for (const EdgeKey& edge : mesh.edges())
    if (!session.is_surface(edge)) queue.push(edge, valence_gain(mesh, edge));
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries;
  while (const auto edge = queue.pop()) {
    if (!session.exists(*edge) || tries[*edge]++ >= options.max_depth) continue;
    const auto edit = make_swap(mesh, *edge);
    if (!edit) continue;
    const double signal = session.roughness(*edge);
    const bool in_contact = session.is_in_contact(*edge);
    if (session.was_refused(RemeshMemory::swap, *edge, signal, in_contact)) continue;
    const RemeshMemory::Refusal refusal{signal / kSameSignal, signal * kSameSignal, in_contact};
    const Vec<2> center = 0.5 * (mesh.rest((*edge)[0]) + mesh.rest((*edge)[1]));
    // An increase in energy is allowed for the sake of the mesh's shape only: without that, edges swap to and fro.
    const double least = valence_gain(mesh, *edge) > 0 ? options.acceptance_tolerance
                                                       : std::max(session.least_worthwhile(), options.acceptance_tolerance);
    if (session.screens() && session.predict(*edit) < session.context().scaling * least) {
      session.remember(RemeshMemory::swap, *edge, refusal);
      continue;
    }
    ++session.report().swaps.tried;
    const auto verdict = session.attempt(*edit, center, least);
    session.report().swaps.relaxed += verdict.was_relaxed;
    if (!verdict.accepted()) {
      session.remember(RemeshMemory::swap, *edge, refusal);
      continue;
    }
    ++session.report().swaps.accepted;
    for (const EdgeKey& near : session.edges_of(verdict.patch))
      if (!session.is_surface(near) && valence_gain(mesh, near) > 0) queue.push(near, valence_gain(mesh, near));
  }
}

}  // namespace itr
