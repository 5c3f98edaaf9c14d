// SPDX-License-Identifier: MIT
// Vertices of the rest shape move where the energy falls by it (r-adaptation, along the configurational force), and where
// cells are badly shaped.
#include <algorithm>
#include <cmath>
#include <limits>

#include "itr/energy/elastic/laws.hpp"
#include "itr/remesh/edits.hpp"
#include "session.hpp"

namespace itr {

namespace {

constexpr double kStep = 0.2;        ///< length of a move, in shortest edges at the vertex
constexpr double kBadShape = 1.4;    ///< AMIPS measure (1 of an equilateral triangle) from which shapes are bettered
constexpr double kLeastMove = 0.1;   ///< for that, in shortest edges at the vertex
constexpr double kSameShape = 1.05;  ///< the same of the worst shape around a vertex
constexpr double kSameForce = 1.5;   ///< change of the force by which a refused move is tried again

/// Worst AMIPS measure over the ring: how badly its triangles need smoothing.
double worst_shape(const Mesh<2>& mesh, VertexId vertex) {
  double worst = 0;
  for (const CellId c : mesh.cells_of(vertex)) {
    double squares = 0;
    for (int k = 0; k < 3; ++k) squares += (mesh.rest(mesh.cell(c)[k]) - mesh.rest(mesh.cell(c)[(k + 1) % 3])).squaredNorm();
    worst = std::max(worst, squares / (4 * std::sqrt(3.0) * mesh.volume(c)));
  }
  return worst;
}

double shortest_edge(const Mesh<2>& mesh, VertexId vertex) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const CellId c : mesh.cells_of(vertex))
    for (const int v : mesh.cell(c))
      if (v != vertex) shortest = std::min(shortest, (mesh.rest(v) - mesh.rest(vertex)).norm());
  return shortest;
}

/// Derivative of the elastic energy by the rest position of a vertex that takes the deformation along: sum over its cells
/// of V (W I - F^T P) grad phi (Eshelby 1975), times the scaling.
Vec<2> configurational_gradient(const RemeshSession<2>& session, VertexId vertex) {
  const Mesh<2>& mesh = session.mesh();
  Vec<2> sum = Vec<2>::Zero();
  for (const CellId c : mesh.cells_of(vertex)) {
    const auto& cell = mesh.cell(c);
    const auto k = std::find(cell.begin(), cell.end(), vertex) - cell.begin();
    const CellSet<2>::Element element{cell, mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c)};
    const Vec<2> gradient = k == 0 ? Vec<2>(-element.inverse_edges.colwise().sum().transpose())
                                   : Vec<2>(element.inverse_edges.row(k - 1).transpose());
    const Vec<2> barycenter = (mesh.rest(cell[0]) + mesh.rest(cell[1]) + mesh.rest(cell[2])) / 3;
    const ElasticModuli moduli = elastic_moduli<2>(session.context().materials.at(mesh.body(c)), barycenter);
    const Mat<2> F = deformation_gradient<2>(element, session.fields().x);
    const double weight = session.context().scaling * element.volume;
    sum += weight * (elastic_density<2>(F, moduli) * gradient - F.transpose() * (elastic_stress<2>(F, moduli) * gradient));
  }
  return sum;
}

class Smoother {
 public:
  explicit Smoother(RemeshSession<2>& session)
      : session_(session),
        mesh_(session.mesh()),
        options_(session.options().smooth),
        worthwhile_(std::max(options_.acceptance_tolerance, session.least_worthwhile())),
        one_ring_(session.options().local) {
    one_ring_.rings = 1;
    one_ring_.relative_volume = 0;
  }

  void run() {
    for (int round = 0; round < options_.max_iterations; ++round) {
      follow_forces();
      better_shapes();
    }
  }

 private:
  /// Where a move by kStep along the force promises enough, most first.
  void follow_forces() {
    const double least = session_.screens() ? session_.context().scaling * worthwhile_ : 0;
    std::vector<std::pair<double, VertexId>> order;
    for (VertexId v = 0; v < mesh_.vertex_slots(); ++v) {
      if (!may_move(v)) continue;
      const double promise = configurational_gradient(session_, v).norm() * kStep * shortest_edge(mesh_, v);
      if (promise > least) order.emplace_back(-promise, v);
    }
    std::sort(order.begin(), order.end());
    for (const auto& [promise, v] : order) {
      const Vec<2> gradient = configurational_gradient(session_, v);
      const double force = gradient.norm(), length = kStep * shortest_edge(mesh_, v);
      if (force * length <= least || session_.was_refused(RemeshMemory::smooth, {v, kNone}, force, false)) continue;
      if (!move(v, mesh_.rest(v) - length / force * gradient, worthwhile_))
        session_.remember(RemeshMemory::smooth, {v, kNone}, {force / kSameForce, force * kSameForce, false});
    }
  }

  void better_shapes() {
    constexpr int kIterations = 10;
    for (VertexId v = 0; v < mesh_.vertex_slots(); ++v) {
      if (!may_move(v)) continue;
      const double shape = worst_shape(mesh_, v);
      if (shape < kBadShape || session_.was_refused(RemeshMemory::reshape, {v, kNone}, shape, false)) continue;
      const Vec<2> target = best_shaped_position(mesh_, v, kIterations);
      const bool is_far = (target - mesh_.rest(v)).norm() > kLeastMove * shortest_edge(mesh_, v);
      if (!is_far || !move(v, target, options_.acceptance_tolerance))
        session_.remember(RemeshMemory::reshape, {v, kNone}, {shape / kSameShape, shape * kSameShape, false});
    }
  }

  bool may_move(VertexId v) const { return mesh_.is_vertex_alive(v) && !mesh_.is_boundary(v); }

  bool move(VertexId v, const Vec<2>& target, double tolerance) {
    const auto edit = make_move(mesh_, v, target);
    if (!edit || session_.is_hopeless(*edit, session_.predict(*edit), tolerance)) return false;
    OperationCount& count = session_.report().smooths;
    ++count.tried;
    const auto verdict = session_.attempt(*edit, target, tolerance, one_ring_);
    count.relaxed += verdict.was_relaxed;
    count.accepted += verdict.accepted();
    return verdict.accepted();
  }

  RemeshSession<2>& session_;
  const Mesh<2>& mesh_;
  const SmoothOptions& options_;
  double worthwhile_;  ///< [J]
  LocalRelaxationOptions one_ring_;
};

}  // namespace

void smooth_vertices(RemeshSession<2>& session) { Smoother(session).run(); }

}  // namespace itr
