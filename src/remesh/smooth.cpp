// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include "itr/remesh/edits.hpp"
#include "session.hpp"

namespace itr {

namespace {

/// Worst AMIPS measure over the ring: how badly its triangles need smoothing.
double worst_shape(const Mesh<2>& mesh, VertexId vertex) {
  double worst = 0;
  for (const CellId c : mesh.cells_of(vertex)) {
    double squares = 0;
    for (int k = 0; k < 3; ++k) squares += (mesh.rest(mesh.cell(c)[k]) - mesh.rest(mesh.cell(c)[(k + 1) % 3])).squaredNorm();
    worst = std::max(worst, squares / (2 * std::sqrt(3.0) * mesh.volume(c)));
  }
  return worst;
}

}  // namespace

void smooth_vertices(RemeshSession<2>& session) {
  const Mesh<2>& mesh = session.mesh();
  const SmoothOptions& options = session.options().smooth;
  LocalRelaxationOptions one_ring = session.options().local;
  one_ring.rings = 1;
  one_ring.relative_volume = 0;
  std::vector<std::pair<double, VertexId>> order;
  for (int v = 0; v < mesh.vertex_slots(); ++v)
    if (mesh.is_vertex_alive(v) && !mesh.is_boundary(v)) order.emplace_back(-worst_shape(mesh, v), v);
  std::sort(order.begin(), order.end());
  for (int round = 0; round < options.max_iterations; ++round)
    for (const auto& [badness, v] : order) {
      const Vec<2> target = best_shaped_position(mesh, v, 10);
      if ((target - mesh.rest(v)).squaredNorm() < 1e-6 * std::abs(mesh.volume(mesh.cells_of(v)[0]))) continue;
      const auto edit = make_move(mesh, v, target);
      if (!edit) continue;
      ++session.report().smooths.tried;
      const auto verdict = session.attempt(*edit, target, options.acceptance_tolerance, one_ring);
      session.report().smooths.relaxed += verdict.was_relaxed;
      if (verdict.accepted()) ++session.report().smooths.accepted;
    }
}

}  // namespace itr
