// SPDX-License-Identifier: MIT
// Vertices of the rest shape move where the energy falls by it (r-adaptation, along the configurational force), and where
// cells are badly shaped.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "itr/energy/elastic/laws.hpp"
#include "itr/geometry/measures.hpp"
#include "itr/remesh/edits.hpp"
#include "session.hpp"

namespace itr {

namespace {

constexpr double kStep = 0.2;        ///< length of a move, in shortest edges at the vertex
constexpr double kBadShape = 1.4;    ///< one over the quality of the worst cell from which shapes are bettered
constexpr double kLeastMove = 0.1;   ///< for that, in shortest edges at the vertex
constexpr double kSameShape = 1.05;  ///< the same of the worst shape around a vertex
constexpr double kSameForce = 1.5;   ///< change of the force by which a refused move is tried again

/// How badly the worst cell at a vertex is shaped: 1 where all are regular.
template <int Dim>
double worst_shape(const Mesh<Dim>& mesh, VertexId vertex) {
  double worst = 1;
  for (const CellId c : mesh.cells_of(vertex)) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
    worst = std::max(worst, 1 / simplex_quality<Dim>(p));
  }
  return worst;
}

std::optional<Edit<2>> move_of(const RemeshSession<2>& session, VertexId vertex, const Vec<2>& target) {
  return make_move(session.mesh(), vertex, target);
}
std::optional<Edit<3>> move_of(const RemeshSession<3>& session, VertexId vertex, const Vec<3>& target) {
  return propose_move<3>(session.mesh(), session.strata(), vertex, target).edit;
}

constexpr int kShapeIterations = 10;
Vec<2> best_shape(const RemeshSession<2>& session, VertexId vertex) {
  return best_shaped_position(session.mesh(), vertex, kShapeIterations);
}
Vec<3> best_shape(const RemeshSession<3>& session, VertexId vertex) {
  return best_shaped_position<3>(session.mesh(), session.strata(), vertex, kShapeIterations);
}

template <int Dim>
double shortest_edge(const Mesh<Dim>& mesh, VertexId vertex) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const CellId c : mesh.cells_of(vertex))
    for (const int v : mesh.cell(c))
      if (v != vertex) shortest = std::min(shortest, (mesh.rest(v) - mesh.rest(vertex)).norm());
  return shortest;
}

/// Derivative of the elastic energy by the rest position of a vertex that takes the deformation along: sum over its cells
/// of V (W I - F^T P) grad phi (Eshelby 1975), times the scaling.
template <int Dim>
Vec<Dim> configurational_gradient(const RemeshSession<Dim>& session, VertexId vertex) {
  const Mesh<Dim>& mesh = session.mesh();
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const CellId c : mesh.cells_of(vertex)) {
    const auto& cell = mesh.cell(c);
    const auto k = std::find(cell.begin(), cell.end(), vertex) - cell.begin();
    const typename CellSet<Dim>::Element element{cell, mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c)};
    const Vec<Dim> gradient = k == 0 ? Vec<Dim>(-element.inverse_edges.colwise().sum().transpose())
                                     : Vec<Dim>(element.inverse_edges.row(k - 1).transpose());
    Vec<Dim> barycenter = Vec<Dim>::Zero();
    for (const int v : cell) barycenter += mesh.rest(v) / (Dim + 1);
    const ElasticModuli moduli = elastic_moduli<Dim>(session.context().materials.at(mesh.body(c)), barycenter);
    const Mat<Dim> F = deformation_gradient<Dim>(element, session.fields().x);
    const double weight = session.context().scaling * element.volume;
    sum +=
        weight * (elastic_density<Dim>(F, moduli) * gradient - F.transpose() * (elastic_stress<Dim>(F, moduli) * gradient));
  }
  return sum;
}

template <int Dim>
class Smoother {
 public:
  explicit Smoother(RemeshSession<Dim>& session)
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
      if (session_.is_cancelled()) return;
      const Vec<Dim> gradient = configurational_gradient(session_, v);
      const double force = gradient.norm(), length = kStep * shortest_edge(mesh_, v);
      if (force * length <= least || session_.was_refused(RemeshMemory::smooth, {v, kNone}, force, false)) continue;
      if (!move(v, mesh_.rest(v) - length / force * gradient, worthwhile_))
        session_.remember(RemeshMemory::smooth, {v, kNone}, {force / kSameForce, force * kSameForce, false});
    }
  }

  void better_shapes() {
    for (VertexId v = 0; v < mesh_.vertex_slots(); ++v) {
      if (session_.is_cancelled()) return;
      if (!may_move(v)) continue;
      const double shape = worst_shape(mesh_, v);
      if (shape < kBadShape || session_.was_refused(RemeshMemory::reshape, {v, kNone}, shape, false)) continue;
      const Vec<Dim> target = best_shape(session_, v);
      const bool is_far = (target - mesh_.rest(v)).norm() > kLeastMove * shortest_edge(mesh_, v);
      if (!is_far || !move(v, target, options_.acceptance_tolerance))
        session_.remember(RemeshMemory::reshape, {v, kNone}, {shape / kSameShape, shape * kSameShape, false});
    }
  }

  bool may_move(VertexId v) const { return mesh_.is_vertex_alive(v) && !mesh_.is_boundary(v); }

  bool move(VertexId v, const Vec<Dim>& target, double tolerance) {
    const auto edit = move_of(session_, v, target);
    if (!edit || session_.is_hopeless(*edit, session_.predict(*edit), tolerance)) return false;
    OperationCount& count = session_.report().smooths;
    ++count.tried;
    const auto verdict = session_.attempt(*edit, target, tolerance, one_ring_);
    count.relaxed += verdict.was_relaxed;
    count.accepted += verdict.accepted();
    return verdict.accepted();
  }

  RemeshSession<Dim>& session_;
  const Mesh<Dim>& mesh_;
  const SmoothOptions& options_;
  double worthwhile_;  ///< [J]
  LocalRelaxationOptions one_ring_;
};

}  // namespace

template <int Dim>
void smooth_vertices(RemeshSession<Dim>& session) {
  Smoother<Dim>(session).run();
}

template void smooth_vertices(RemeshSession<2>&);
template void smooth_vertices(RemeshSession<3>&);

}  // namespace itr
