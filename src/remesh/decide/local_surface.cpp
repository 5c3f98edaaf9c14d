// SPDX-License-Identifier: MIT
// The surface of a local problem: what can touch what the patch changes.
#include <algorithm>

#include "energy/contact/friction.hpp"
#include "local_problem.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

/// Free vertices and nodes of the surface, and those of facets that the edit replaces (on both sides of the comparison).
template <int Dim>
void LocalProblem<Dim>::find_what_changes() {
  changes_.assign(vertices_.size(), 0);
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    if (is_on_surface(vertices_[i])) changes_[i] = is_free(static_cast<int>(i));
  const auto mark = [&](VertexId v) {
    if (v == kNewVertex && !is_after_) return;
    if (is_after_ && v == edit_.removed_vertex) return;
    changes_[local(v)] = 1;
  };
  const auto mark_all = [&](const typename MeshTypes<Dim>::Facet& facet) {
    for (const int v : facet) mark(v);
    for_each_node_on<Dim>(
        facet, [&](VertexId a, VertexId b) { return node_of(a, b); }, mark);
  };
  for (const FacetId f : edit_.removed_facets) mark_all(mesh_.facet(f));
  for (const auto& facet : edit_.inserted_facets) mark_all(facet.vertices);
}

/// Hands over the facets at what changes, and looks for what they could touch.
template <int Dim>
void LocalProblem<Dim>::find_contacts() {
  ContactReach<Dim>& reach = scratch_.reach;
  reach.clear(mesh_.facet_slots());
  const auto add = [&](const typename MeshTypes<Dim>::Facet& facet, FacetId f) {
    SurfacePieces<Dim> pieces;
    bool moves = false;
    for_each_chord<Dim>(
        facet, [&](VertexId a, VertexId b) { return node_of(a, b); },
        [&](const auto& ids) {
          SurfacePiece<Dim>& piece = pieces.emplace_back();
          for (const VertexId v : ids) {
            piece.add(field_value(state_.fields.x, {}, {is_created(v) ? Kind::created : Kind::of_mesh, v}), v);
            moves = moves || (is_created(v) || scratch_.known[v] ? is_free(local(v)) : false);
          }
        });
    for (const auto& piece : pieces) reach.add(piece, f, moves);
  };
  scratch_.facets.clear(mesh_.facet_slots());
  for (std::size_t i = 0; i < changes_.size(); ++i) {
    if (!changes_[i] || vertices_[i].kind != Kind::of_mesh) continue;
    for_each_facet_at(mesh_, vertices_[i].id, [&](FacetId f) {
      if (scratch_.facets.mark(f) && !is_removed(f)) add(mesh_.facet(f), f);
    });
  }
  if (is_after_)
    for (const auto& facet : edit_.inserted_facets) add(facet.vertices, kNone);
  // Chords are short beside the edges of their facets, which give the room, so that most of them could touch some.
  reach.find(state_.surface, scratch_.neighbourhoods, state_.context.contact.dhat, scratch_.hits, mesh_.has_nodes(),
             [&](FacetId f) { return is_removed(f); });
}

/// Finds the facets that stay and the primitives of obstacles around the vertices that can touch, ascending.
template <int Dim>
void LocalProblem<Dim>::find_stars_of_touching() {
  std::vector<FacetId>& facets = scratch_.near_facets;
  std::vector<int>& primitives = scratch_.near_primitives;
  facets.clear();
  primitives.clear();
  const ObstaclePrimitives& obstacles = state_.surface.primitives();
  scratch_.facets.clear(mesh_.facet_slots());
  scratch_.primitives.clear(static_cast<int>(obstacles.all.size()));
  for (const SurfaceId id : scratch_.reach.touching()) {
    if (id.is_of_obstacle()) {
      for (const int i : obstacles.at_vertex[id.number()])
        if (scratch_.primitives.mark(i)) primitives.push_back(i);
      continue;
    }
    if (is_created(id.number())) continue;
    for_each_facet_at(mesh_, id.number(), [&](FacetId f) {
      if (scratch_.facets.mark(f) && !is_removed(f)) facets.push_back(f);
    });
  }
  std::sort(facets.begin(), facets.end());
  std::sort(primitives.begin(), primitives.end());
}

/// Whether the vertex or node is of closed faces: of what the edit creates, if a parent is.
template <int Dim>
bool LocalProblem<Dim>::is_closed(const LocalVertex& v) const {
  if (v.kind == Kind::of_obstacle) return false;
  const auto has_closed = [&](const auto& created) {
    return std::any_of(created.parents.begin(), created.parents.begin() + created.num_parents,
                       [&](VertexId parent) { return mesh_.steps_apart(parent) == 0; });
  };
  if (is_after_ && edit_.sets(v.id)) return has_closed(*edit_.value);
  const auto* node = edit_.created_node(v.id);
  return node ? has_closed(*node) : mesh_.steps_apart(v.id) == 0;
}

/// Which sides of friction pairs a vertex is of: one that the edit creates on an edge of those that both ends are of.
template <int Dim>
std::uint64_t LocalProblem<Dim>::friction_sides_of(const LocalVertex& v) const {
  const auto& pairs = state_.context.contact.friction_pairs;
  if (v.kind == Kind::of_obstacle) return friction_sides_of_obstacle(v.id, pairs);
  if (!is_created(v.id)) return friction_sides_of_node(mesh_, v.id, pairs);
  const auto* node = edit_.created_node(v.id);
  const auto [a, b] = node ? node->edge : edit_.edge;
  const auto of = [&](VertexId end) { return friction_sides_of({is_created(end) ? Kind::created : Kind::of_mesh, end}); };
  return of(a) & of(b);
}

/// The part of the surface that can touch what changes, with the stars of its vertices: contact is weighted by them.
template <int Dim>
void LocalProblem<Dim>::add_surface() {
  find_what_changes();
  if (std::find(changes_.begin(), changes_.end(), 1) == changes_.end()) return;
  find_contacts();
  has_surface_ = true;
  const ContactReach<Dim>& reach = scratch_.reach;
  surface_read_ = reach.read();
  touches_contact_ = !reach.touching().empty();
  if (!touches_contact_) return;

  using Facet = typename MeshTypes<Dim>::Facet;
  CollisionSurface& surface = storage_->surface;
  surface.axisymmetric = mesh_.is_axisymmetric();
  surface.edges.clear();
  surface.triangles.clear();
  std::vector<int>& points = scratch_.points;
  points.clear();
  const auto add = [&](const auto& ids, std::size_t size) {  // local ones
    if (size == 1) points.push_back(ids[0]);
    if (size == 2) surface.edges.push_back({ids[0], ids[1]});
    if constexpr (Dim == 3)
      if (size == 3) surface.triangles.push_back({ids[0], ids[1], ids[2]});
  };
  const auto add_facet = [&](const Facet& facet, const auto& is_wanted) {
    for_each_chord<Dim>(
        facet, [&](VertexId a, VertexId b) { return node_of(a, b); },
        [&](const Facet& chord) {
          if (!is_wanted(chord)) return;
          Facet ids;
          for (int k = 0; k < Dim; ++k) ids[k] = local(chord[k]);
          add(ids, Dim);
        });
  };
  find_stars_of_touching();
  for (const FacetId f : scratch_.near_facets) {
    add_facet(mesh_.facet(f), [](const Facet&) { return true; });
    surface_read_.include(state_.surface.box_of(f));
  }
  if (is_after_)
    for (const auto& facet : edit_.inserted_facets)
      add_facet(facet.vertices, [&](const Facet& chord) {
        return std::any_of(chord.begin(), chord.end(), [&](int v) { return reach.touches(v); });
      });
  const ObstaclePrimitives& obstacles = state_.surface.primitives();
  for (const int i : scratch_.near_primitives) {
    std::array<int, 3> ids{};
    for (int k = 0; k < obstacles.all[i].size; ++k) ids[k] = local({Kind::of_obstacle, obstacles.all[i].vertices[k]});
    add(ids, obstacles.all[i].size);
  }
  dofs_.unknown.resize(Dim * vertices_.size(), kNone);
  changes_.resize(vertices_.size(), 0);
  surface.counts = changes_;
  surface.closed = closed_faces<Dim>(cells_.rest, state_.context.contact.reach_of_closed(), 0,
                                     [&](int i) { return is_closed(vertices_[i]); });
  surface.friction_sides.clear();
  if (!state_.context.contact.friction_pairs.empty())
    for (const LocalVertex& v : vertices_) surface.friction_sides.push_back(friction_sides_of(v));
  if (state_.context.contact.has_turning_friction()) surface.rest = rest_positions<Dim>(cells_);
  complete_collision_surface<Dim>(surface, points, cells_.rest);
}

#define ITR_INSTANTIATE(Dim)                                            \
  template void LocalProblem<Dim>::find_what_changes();                 \
  template void LocalProblem<Dim>::find_contacts();                     \
  template void LocalProblem<Dim>::find_stars_of_touching();            \
  template void LocalProblem<Dim>::add_surface();                       \
  template bool LocalProblem<Dim>::is_closed(const LocalVertex&) const; \
  template std::uint64_t LocalProblem<Dim>::friction_sides_of(const LocalVertex&) const;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
