// SPDX-License-Identifier: MIT
// Vertices of the rest shape move where the energy falls by it (r-adaptation, along the configurational force), and where
// cells are badly shaped.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "geometry/measures.hpp"
#include "itr/energy/elastic/laws.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

constexpr double kStep = 0.2;        ///< length of a move, in shortest edges at the vertex
constexpr double kBadShape = 1.4;    ///< one over the quality of the worst cell from which shapes are bettered
constexpr double kLeastMove = 0.1;   ///< for that, in shortest edges at the vertex
constexpr double kSameShape = 1.05;  ///< the same of the worst shape around a vertex
constexpr int kShapeIterations = 10;
constexpr double kSameForce = 1.5;  ///< change of the force by which a refused move is tried again

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

/// Derivative of the elastic energy by the rest position of a vertex that takes the deformation along: sum over its cells
/// of the integral of (W I - F^T P) grad phi (Eshelby 1975), times the scaling.
template <int Dim>
Vec<Dim> configurational_gradient(const RemeshQueries<Dim>& ask, VertexId vertex) {
  const Mesh<Dim>& mesh = ask.mesh();
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const CellId c : mesh.cells_of(vertex)) {
    const auto& cell = mesh.cell(c);
    const auto k = std::find(cell.begin(), cell.end(), vertex) - cell.begin();
    const auto element = element_of(mesh, c);
    const Vec<Dim> gradient = barycentric_gradient<Dim>(element.inverse_edges, static_cast<int>(k));
    const ElasticModuli moduli = elastic_moduli<Dim>(ask.context().materials.at(element.body), mesh.barycenter(c));
    const auto add = [&](const Mat<Dim>& F, double weight) {
      sum += weight *
             (elastic_density<Dim>(F, moduli) * gradient - F.transpose() * (elastic_stress<Dim>(F, moduli) * gradient));
    };
    const double weight = ask.context().scaling * element.volume;
    if (const CurvedCell<Dim> curved = cell_before(mesh, c); curved.edges)
      for_each_gradient<Dim>(curved, element.inverse_edges, ask.fields().x,
                             [&](const Mat<Dim>& F, double share) { add(F, share * weight); });
    else
      add(deformation_gradient<Dim>(element, ask.fields().x), weight);
  }
  return sum;
}

/// Common part of both operations that move vertices.
template <int Dim>
class Mover {
 public:
  explicit Mover(RemeshSession<Dim>& session)
      : session_(session),
        ask_(session.ask()),
        mesh_(ask_.mesh()),
        tolerance_(ask_.options().smooth.acceptance_tolerance.value()),
        one_ring_(ask_.options().local) {
    one_ring_.rings = 1;
  }

 protected:
  bool may_move(VertexId v) const { return mesh_.is_vertex_alive(v) && !mesh_.is_boundary(v); }
  void judge(Trial<Dim>& trial, const Vec<Dim>& target, double tolerance, LocalScratch<Dim>& scratch) const {
    if (!trial.take(propose_move<Dim>(mesh_, ask_.strata(), trial.candidate.place.vertex(), target))) return;
    if (ask_.is_hopeless(trial.edit->removed_cells, ask_.predict(*trial.edit), tolerance))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance, one_ring_, scratch);
  }
  /// `same`: the change of the signal by which it is asked again.
  void settle(Trial<Dim>& trial, RemeshMemory::Kind kind, double same) {
    OperationCount& count = session_.report().smooths;
    count.note(trial.verdict.refusal);
    if (!trial.is_asked || (trial.was_previewed && session_.commits().commit(trial, count))) return;
    session_.memory().remember(kind, trial.candidate.place, {trial.signal / same, trial.signal * same, false});
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const Mesh<Dim>& mesh_;
  double tolerance_;  ///< [J]
  LocalRelaxationOptions one_ring_;
};

/// Moves vertices by kStep along the force, where that promises enough, most first.
template <int Dim>
class ForceFollower : Mover<Dim> {
 public:
  explicit ForceFollower(RemeshSession<Dim>& session)
      : Mover<Dim>(session),
        worthwhile_(std::max(this->tolerance_, this->ask_.least_worthwhile())),
        least_promise_(this->ask_.context().scaling * worthwhile_) {}

  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>&) const {
    const VertexId v = place.vertex();
    if (!this->may_move(v)) return std::nullopt;
    const double promise = configurational_gradient(this->ask_, v).norm() * length(v);
    return promise > least_promise_ ? std::optional(PlaceQueue::Entry{.place = place, .priority = promise}) : std::nullopt;
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const VertexId v = trial.candidate.place.vertex();
    const Vec<Dim> gradient = configurational_gradient(this->ask_, v);
    const double force = gradient.norm();
    if (force * length(v) <= least_promise_ ||
        this->session_.memory().was_refused(RemeshMemory::smooth, trial.candidate.place, force, false))
      return;
    trial.signal = force;
    trial.is_asked = true;
    this->judge(trial, this->mesh_.rest(v) - length(v) / force * gradient, worthwhile_, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>&) { Mover<Dim>::settle(trial, RemeshMemory::smooth, kSameForce); }

 private:
  double length(VertexId v) const { return kStep * shortest_edge(this->mesh_, v); }

  double worthwhile_;     ///< [J]
  double least_promise_;  ///< [J, times the scaling]
};

/// Moves vertices to where the cells around are best shaped, where one of them is badly shaped.
template <int Dim>
class ShapeBetterer : Mover<Dim> {
 public:
  explicit ShapeBetterer(RemeshSession<Dim>& session) : Mover<Dim>(session) {}

  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>&) const {
    const VertexId v = place.vertex();
    if (!this->may_move(v) || worst_shape(this->mesh_, v) < kBadShape) return std::nullopt;
    if (!this->session_.shape_matters(place, this->ask_.roughness(place))) return std::nullopt;
    return PlaceQueue::Entry{.place = place, .priority = -static_cast<double>(v)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const VertexId v = trial.candidate.place.vertex();
    trial.signal = worst_shape(this->mesh_, v);
    if (trial.signal < kBadShape ||
        this->session_.memory().was_refused(RemeshMemory::reshape, trial.candidate.place, trial.signal, false))
      return;
    trial.is_asked = true;
    const Vec<Dim> target = best_shaped_position<Dim>(this->mesh_, this->ask_.strata(), v, kShapeIterations);
    if ((target - this->mesh_.rest(v)).norm() <= kLeastMove * shortest_edge(this->mesh_, v))
      trial.refuse(Refusal::length);
    else
      this->judge(trial, target, this->tolerance_, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>&) { Mover<Dim>::settle(trial, RemeshMemory::reshape, kSameShape); }
};

}  // namespace

template <int Dim>
void smooth_vertices(RemeshSession<Dim>& session) {
  std::vector<Place> vertices;
  for (VertexId v = 0; v < session.ask().mesh().vertex_slots(); ++v) vertices.push_back(Place::at_vertex(v));
  ForceFollower<Dim> follower(session);
  run_waves(session, follower, vertices);
  ShapeBetterer<Dim> betterer(session);
  run_waves(session, betterer, vertices);
}

template void smooth_vertices(RemeshSession<2>&);
template void smooth_vertices(RemeshSession<3>&);

}  // namespace itr
