// SPDX-License-Identifier: MIT
// Vertices of the rest shape move where the energy falls by it (r-adaptation, along the configurational force), and where
// cells are badly shaped.
#include <algorithm>
#include <limits>
#include <optional>

#include "energy/elastic/laws.hpp"
#include "geometry/measures.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"
#include "remesh/schedule/pipeline.hpp"

namespace itr {

namespace {

constexpr double kStep = 0.2;        ///< length of a move, in shortest edges at the vertex
constexpr double kBadShape = 1.4;    ///< one over the quality of the worst cell from which shapes are bettered
constexpr double kLeastMove = 0.1;   ///< for that, in shortest edges at the vertex
constexpr double kSameShape = 1.05;  ///< change of the worst shape by which a refused move is tried again
constexpr double kSameForce = 1.5;   ///< change of the force by which a refused move is tried again
constexpr int kShapeIterations = 10;

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

template <int Dim>
double shortest_edge(const Mesh<Dim>& mesh, VertexId vertex) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const CellId c : mesh.cells_of(vertex))
    for (const int v : mesh.cell(c))
      if (v != vertex) shortest = std::min(shortest, (mesh.rest(v) - mesh.rest(vertex)).norm());
  return shortest;
}

/// Derivative of the elastic energy by the rest position of a vertex that takes the deformation along: sum over its cells of
/// the integral of (W I - F^T P) grad phi (Eshelby 1975), times the scaling.
template <int Dim>
Vec<Dim> configurational_gradient(const RemeshQueries<Dim>& queries, VertexId vertex) {
  const Mesh<Dim>& mesh = queries.mesh();
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const CellId c : mesh.cells_of(vertex)) {
    const auto& cell = mesh.cell(c);
    const auto k = std::find(cell.begin(), cell.end(), vertex) - cell.begin();
    const auto element = element_of(mesh, c);
    const Vec<Dim> gradient = barycentric_gradient<Dim>(element.inverse_edges, static_cast<int>(k));
    const ElasticModuli moduli = elastic_moduli<Dim>(queries.context().materials.at(element.body), mesh.barycenter(c));
    const double weight = queries.context().scaling * element.volume;
    for_each_gradient<Dim>(element, queries.fields().x, [&](const Mat<Dim>& F, double fraction) {
      sum += fraction * weight *
             (elastic_density<Dim>(F, moduli) * gradient - F.transpose() * (elastic_stress<Dim>(F, moduli) * gradient));
    });
  }
  return sum;
}

/// Runs an operation that moves vertices of the volume, by what their own cells gain. `same`: change of the refusal key by
/// which a refused move is tried again.
template <int Dim>
void run_moves(RemeshSession<Dim>& session, Operation<Dim>& move, double same) {
  const Mesh<Dim>& mesh = session.queries().mesh();
  move.local.rings = 1;
  move.list = [&] {
    std::vector<Candidate> found;
    for (const VertexId v : mesh.live_vertices())
      if (!mesh.is_boundary(v)) found.emplace_back(move.kind, v);
    return found;
  };
  move.is_candidate = [](const EdgeKey&) { return false; };
  move.remember = [=](const Trial<Dim>& trial) {
    return RemeshMemory::KeyRange{trial.key / same, trial.key * same, trial.in_contact};
  };
  run_operations<Dim>(session, {&move});
}

/// Moves vertices by kStep along the configurational force, where that promises enough, most first.
template <int Dim>
void follow_forces(RemeshSession<Dim>& session) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  const double least = std::max(queries.options().smooth.acceptance_tolerance.value(), queries.least_worthwhile());
  const double least_promise = queries.context().scaling * least;  // [J, times the scaling]
  const auto length = [&](VertexId v) { return kStep * shortest_edge(mesh, v); };
  Operation<Dim> move(session, OperationKind::smooth, &RemeshReport::smooths, least);
  move.priority = [&](const Candidate& candidate) {
    const VertexId v = candidate.vertex();
    const double promise = configurational_gradient(queries, v).norm() * length(v);
    return promise > least_promise ? std::optional(promise) : std::nullopt;
  };
  move.key = [&](const auto& trial, auto&) { return configurational_gradient(queries, trial.candidate().vertex()).norm(); };
  move.propose = [&](const Candidate& candidate, auto&) {
    const VertexId v = candidate.vertex();
    const Vec<Dim> gradient = configurational_gradient(queries, v);
    const double force = gradient.norm(), step = length(v);
    if (force * step <= least_promise) return refused<Dim>(Refusal::prediction);
    return propose_move<Dim>(mesh, queries.strata(), v, mesh.rest(v) - step / force * gradient);
  };
  run_moves(session, move, kSameForce);
}

/// Moves vertices to where the cells around are best shaped, where one of them is badly shaped.
template <int Dim>
void better_shapes(RemeshSession<Dim>& session) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  Operation<Dim> move(session, OperationKind::reshape, &RemeshReport::smooths,
                      queries.options().smooth.acceptance_tolerance.value());
  move.refuse = [&](const Candidate& candidate) {
    return worst_shape(mesh, candidate.vertex()) < kBadShape ? Refusal::not_asked : Refusal::none;
  };
  move.priority = [&](const Candidate& candidate) -> std::optional<double> {
    if (!session.shape_matters(candidate, queries.roughness(candidate))) return std::nullopt;
    return -static_cast<double>(candidate.vertex());
  };
  move.key = [&](const auto& trial, auto&) { return worst_shape(mesh, trial.candidate().vertex()); };
  move.propose = [&](const Candidate& candidate, auto&) {
    const VertexId v = candidate.vertex();
    const Vec<Dim> target = best_shaped_position<Dim>(mesh, queries.strata(), v, kShapeIterations);
    const bool is_there = (target - mesh.rest(v)).norm() <= kLeastMove * shortest_edge(mesh, v);
    return is_there ? refused<Dim>(Refusal::length) : propose_move<Dim>(mesh, queries.strata(), v, target);
  };
  run_moves(session, move, kSameShape);
}

}  // namespace

template <int Dim>
void smooth_vertices(RemeshSession<Dim>& session) {
  follow_forces(session);
  better_shapes(session);
}

template void smooth_vertices(RemeshSession<2>&);
template void smooth_vertices(RemeshSession<3>&);

}  // namespace itr
