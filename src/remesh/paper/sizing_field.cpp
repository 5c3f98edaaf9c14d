// SPDX-License-Identifier: MIT
// The baseline that the paper compares with: lengths of edges decide, not energies. The size of an edge (1: as long as it
// may be) is that of Wicke et al. 2010 (the deformed length, in longest edges of the initial mesh) and, on the surface, of
// Li et al. 2018 (what the edge spans of the way to what is in contact). Schedule of Narain et al. 2012: edges of size above
// 1 are split, largest first; then edges collapse, shortest first, where no edge becomes larger than 0.8.
#include <algorithm>
#include <cmath>

#include "geometry/distance.hpp"
#include "remesh/edits/edit_checks.hpp"
#include "remesh/schedule/session.hpp"

namespace itr {

namespace {

constexpr double kSplitAbove = 1 + 1e-6;  ///< an edge of the initial mesh at rest, turned, is not split
constexpr double kCollapseBelow = 0.8;
constexpr double kNearerThanAtRest = 0.1;  ///< squared distances of pairs in contact, over those at rest

template <int Dim>
class SizingField {
 public:
  explicit SizingField(RemeshSession<Dim>& session) : session_(session), queries_(session.queries()) {}

  void split() {
    const double least = least_length();
    OperationCount& count = session_.report().splits;
    for (const EdgeKey& edge : queries_.mesh().edges()) push_split(edge);
    while (const auto entry = queue_.pop()) {
      const EdgeKey edge = entry->candidate.edge();
      if (queries_.is_cancelled()) return;
      if (!queries_.exists(entry->candidate)) continue;
      Refusal refusal = queries_.refuse_split(edge);
      if (refusal == Refusal::none && queries_.rest_length(edge) < least) refusal = Refusal::length;
      count.note(refusal);
      if (refusal != Refusal::none) continue;
      ++count.tried;
      const VertexId created = queries_.mesh().node_slots();
      if (!session_.commit_unjudged(make_split(queries_.mesh(), edge), count)) continue;
      for (const EdgeKey& near : edges_of<Dim>(queries_.mesh(), queries_.mesh().cells_of(created))) push_split(near);
    }
  }

  void collapse() {
    OperationCount& count = session_.report().collapses;
    for (const EdgeKey& edge : queries_.mesh().edges()) push_collapse(edge);
    while (const auto entry = queue_.pop()) {
      const EdgeKey edge = entry->candidate.edge();
      if (queries_.is_cancelled()) return;
      if (!queries_.exists(entry->candidate)) continue;
      const Refusal refusal = queries_.refuse_collapse(edge);
      count.note(refusal);
      if (refusal != Refusal::none) continue;
      ++count.tried;
      auto proposal = propose_collapse(queries_.mesh(), queries_.strata(), edge);
      if (proposal && makes_large_edges(*proposal.edit)) proposal = refused<Dim>(Refusal::length);
      count.note(proposal.refusal);
      if (!proposal || !session_.commit_unjudged(*proposal.edit, count)) continue;
      for (const EdgeKey& near : edges_of<Dim>(queries_.mesh(), queries_.mesh().cells_of(proposal.edit->value->vertex)))
        push_collapse(near);
    }
  }

 private:
  void push_split(const EdgeKey& edge) {
    const double size = size_of(edge);
    if (size > kSplitAbove) queue_.push({{OperationKind::split, edge}, size});
  }
  void push_collapse(const EdgeKey& edge) {
    if (size_of(edge) <= kCollapseBelow) queue_.push({{OperationKind::collapse, edge}, -queries_.rest_length(edge)});
  }

  /// No edge is split that is shorter [m].
  double least_length() const {
    Box<Dim> box;
    for (const VertexId v : queries_.mesh().live_vertices()) box.include(queries_.mesh().rest(v));
    return queries_.options().sizing_field.rel_min_edge_length * (box.max - box.min).maxCoeff();
  }

  Vec<Dim> x(VertexId v) const { return queries_.fields().x.template segment<Dim>(Dim * v); }

  double size_of(const EdgeKey& edge) {
    const Vec<Dim> span = x(edge[1]) - x(edge[0]);
    return size_of(span, contact_squared(edge, span));
  }
  double size_of(const Vec<Dim>& span, double contact_squared) const {
    const double longest = queries_.context().longest_edge;
    return std::sqrt(span.squaredNorm() / (longest * longest) + contact_squared);
  }

  /// Mean over the facets at an edge, and over their vertices, of the squared fraction that the edge spans of the distance
  /// to what is in contact there.
  double contact_squared(const EdgeKey& edge, const Vec<Dim>& span) {
    if (!queries_.has_contact()) return 0;
    double sum = 0;
    int facets = 0;
    for (const FacetId f : queries_.mesh().facets_of_edge(edge)) {
      ++facets;
      for (const VertexId v : queries_.mesh().facet(f)) {
        const double fraction = span.dot(contact_at(v));
        sum += fraction * fraction / Dim;
      }
    }
    return facets > 0 ? sum / facets : 0;
  }

  /// At a vertex of the surface: the unit direction to what is nearest of all that its facets are in contact with, over the
  /// distance [1/m]; zero without contact.
  Vec<Dim> contact_at(VertexId vertex) {
    const double dhat = queries_.context().contact.dhat;
    double least = dhat * dhat;
    Vec<Dim> direction = Vec<Dim>::Zero();
    const auto look_at = [&](const auto& point, int k, const auto& facet) {
      if (facet.now.size < Dim || facet.now.has(point.now.id[k])) return;
      constexpr PairKind kKind = Dim == 2 ? PairKind::edge_vertex : PairKind::face_vertex;
      const auto pair_of = [&](const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b) {
        std::array<Vec<Dim>, 4> p{a.p[k]};
        std::copy_n(b.p.begin(), Dim, p.begin() + 1);
        return p;
      };
      const auto p = pair_of(point.now, facet.now), rest = pair_of(point.rest, facet.rest);
      const double squared = pair_distance_squared<Dim>(kKind, p.data());
      if (squared >= least || squared >= kNearerThanAtRest * pair_distance_squared<Dim>(kKind, rest.data())) return;
      const auto closest = closest_features<Dim>(kKind, p.data());
      std::array<Vec<Dim>, 4> features;
      for (int i = 0; i < pair_size(closest.kind); ++i) features[i] = p[closest.local[i]];
      least = squared;
      direction = pair_distance<Dim>(closest.kind, features.data()).separation / squared;
    };
    for (const FacetId f : queries_.mesh().facets_of(vertex)) {
      const auto own = piece(f);
      const auto at =
          static_cast<int>(std::find(own.now.id.begin(), own.now.id.end(), SurfaceId(vertex)) - own.now.id.begin());
      for (const auto& other : pieces_in_contact(f)) {
        look_at(own, at, other);
        for (int k = 0; k < other.now.size; ++k) look_at(other, k, own);
      }
    }
    return direction;
  }

  /// Part of the surface or of an obstacle, at present and at rest.
  struct Piece {
    SurfacePiece<Dim> now, rest;
  };
  Piece piece(FacetId f) const {
    Piece piece{queries_.surface().piece(f), {}};
    for (const int v : queries_.mesh().facet(f)) piece.rest.add(queries_.mesh().rest(v), v);
    return piece;
  }
  /// Finds the pieces that are nearer than dhat to a facet of the surface at present.
  std::vector<Piece> pieces_in_contact(FacetId f) {
    const SurfaceIndex<Dim>& surface = queries_.surface();
    const double dhat = queries_.context().contact.dhat;
    LocalScratch<Dim>& scratch = session_.scratch();
    std::vector<Piece> pieces;
    for (const auto& [other, distance] : scratch.neighbourhoods.near(surface, f, dhat, scratch.hits)) {
      if (distance >= dhat) continue;
      if (!other.is_of_obstacle()) {
        pieces.push_back(piece(other.number()));
        continue;
      }
      const int primitive = other.number();
      Piece& obstacle = pieces.emplace_back(Piece{surface.obstacle_piece(primitive), {}});
      for (const int v : surface.primitives().all[primitive].ids())
        obstacle.rest.add(queries_.context().obstacles.rest[v], SurfaceId::of_obstacle(v));
    }
    return pieces;
  }

  /// Whether an edge at the vertex that a collapse keeps would be larger than edges that collapse may be.
  bool makes_large_edges(const Edit<Dim>& edit) {
    const auto& value = *edit.value;
    const Vec<Dim> target = RemeshFields<Dim>::interpolate(queries_.fields().x, value);
    const Vec<Dim> contact = queries_.mesh().is_boundary(value.vertex) && queries_.has_contact()
                                 ? contact_at(value.vertex)
                                 : Vec<Dim>(Vec<Dim>::Zero());
    return std::any_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
      return std::any_of(cell.vertices.begin(), cell.vertices.end(), [&](VertexId v) {
        if (v == value.vertex) return false;
        const Vec<Dim> span = x(v) - target;
        const double fraction = queries_.mesh().is_boundary(v) ? span.dot(contact) : 0;
        return size_of(span, fraction * fraction) > kCollapseBelow;
      });
    });
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& queries_;
  CandidateQueue queue_;
};

}  // namespace

template <int Dim>
void follow_sizing_field(RemeshSession<Dim>& session) {
  SizingField<Dim> field(session);
  if (session.queries().options().split.enabled) field.split();
  if (session.queries().options().collapse.enabled) field.collapse();
}

template void follow_sizing_field(RemeshSession<2>&);
template void follow_sizing_field(RemeshSession<3>&);

}  // namespace itr
