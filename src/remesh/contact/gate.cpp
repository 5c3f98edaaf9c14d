// SPDX-License-Identifier: MIT
#include "gate.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "contact_reach.hpp"
#include "geometry/predicates.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

namespace {

template <int Dim>
int orientation_of(const std::array<Vec<Dim>, Dim + 1>& p) {
  if constexpr (Dim == 2) return orientation(p[0], p[1], p[2]);
  if constexpr (Dim == 3) return orientation(p[0], p[1], p[2], p[3]);
}

bool meet(const SurfacePiece<2>& a, const SurfacePiece<2>& b) {
  for (int k = 0; k < a.size; ++k)
    if (b.has(a.id[k])) return false;
  return a.size == 2 && b.size == 2 && segments_intersect(a.p[0], a.p[1], b.p[0], b.p[1]);
}

/// Whether p and q lie beyond one side of a triangle, by far more than round-off: then p-q does not cross it. Coplanar ones,
/// of which flat surfaces are full, cost exact predicates most.
bool are_beyond_a_side(const Vec<3>& p, const Vec<3>& q, const std::array<Vec<3>, 3>& t) {
  constexpr double kFarAboveRoundOff = 1e-11;
  const Vec<3> along = t[1] - t[0], across = t[2] - t[0], normal = along.cross(across);
  const double scale = kFarAboveRoundOff * std::sqrt(along.squaredNorm() * across.squaredNorm());
  for (int k = 0; k < 3; ++k) {
    const Vec<3> side = t[(k + 1) % 3] - t[k], outward = side.cross(normal), to_p = p - t[k], to_q = q - t[k];
    const double least = scale * side.norm();
    if (outward.dot(to_p) > least * to_p.norm() && outward.dot(to_q) > least * to_q.norm()) return true;
  }
  return false;
}

/// Whether an edge of `a` that shares no corner with the triangle `b` crosses it.
bool crosses(const SurfacePiece<3>& a, const SurfacePiece<3>& b) {
  if (b.size < 3 || a.size < 2) return false;
  for (int k = 0; k < (a.size == 3 ? 3 : 1); ++k) {
    const int l = (k + 1) % a.size;
    if (!b.has(a.id[k]) && !b.has(a.id[l]) && !are_beyond_a_side(a.p[k], a.p[l], b.p) &&
        segment_intersects_triangle(a.p[k], a.p[l], b.p[0], b.p[1], b.p[2]))
      return true;
  }
  return false;
}
bool meet(const SurfacePiece<3>& a, const SurfacePiece<3>& b) { return crosses(a, b) || crosses(b, a); }

template <int Dim>
bool lies_in(const Vec<Dim>& point, const std::array<Vec<Dim>, Dim + 1>& simplex);

/// Tells whether the point lies in points on one line (in whose box it is) or in one plane.
bool lies_in_flat(const Vec<2>&, const std::array<Vec<2>, 3>&) { return true; }
bool lies_in_flat(const Vec<3>& point, const std::array<Vec<3>, 4>& simplex) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto projected = [axis](const Vec<3>& p) { return Vec<2>(p[(axis + 1) % 3], p[(axis + 2) % 3]); };
    bool inside = false;  // one of the four triangles, which cover it
    for (int k = 0; k < 4; ++k)
      inside = inside || lies_in<2>(projected(point), {projected(simplex[k]), projected(simplex[(k + 1) % 4]),
                                                       projected(simplex[(k + 2) % 4])});
    if (!inside) return false;
  }
  return true;
}

/// Whether a point lies in a closed simplex of whatever orientation, or flat.
template <int Dim>
bool lies_in(const Vec<Dim>& point, const std::array<Vec<Dim>, Dim + 1>& simplex) {
  Box<Dim> box;
  for (const auto& corner : simplex) box.include(corner);
  if (!box.contains(point)) return false;
  bool positive = false, negative = false;
  for (int k = 0; k <= Dim; ++k) {
    auto corners = simplex;
    corners[k] = point;
    const int side = orientation_of<Dim>(corners);
    positive = positive || side > 0;
    negative = negative || side < 0;
  }
  if (!positive && !negative) return lies_in_flat(point, simplex);
  return !(positive && negative);
}

/// The corners of the tetrahedron between the surface before and after a swap. A quad that is flat at rest is not flat when
/// deformed: its two diagonals are edges of a tetrahedron. (In 2D facets do not swap.)
std::array<Vec<3>, 4> between_diagonals(const Mesh<3>& mesh, const SurfaceIndex<3>& surface, const Edit<3>& edit) {
  std::array<Vec<3>, 4> corners;
  const auto& facet = mesh.facet(edit.removed_facets[0]);
  for (int k = 0; k < 3; ++k) corners[k] = surface.at(facet[k]);
  for (const VertexId v : mesh.facet(edit.removed_facets[1]))
    if (std::find(facet.begin(), facet.end(), v) == facet.end()) corners[3] = surface.at(v);
  return corners;
}
std::array<Vec<2>, 3> between_diagonals(const Mesh<2>&, const SurfaceIndex<2>&, const Edit<2>&) { return {}; }

/// The simplices that straight facets sweep over. Two vertices move on the way to the new surface, both to the target: the
/// one that is set and the one that disappears.
template <int Dim>
void find_swept_by_facets(const Mesh<Dim>& mesh, const SurfaceIndex<Dim>& surface, const Edit<Dim>& edit,
                          const Vec<Dim>& target, std::vector<std::array<Vec<Dim>, Dim + 1>>& swept) {
  swept.clear();
  if (edit.kind == Edit<Dim>::Kind::swap) swept.push_back(between_diagonals(mesh, surface, edit));
  const VertexId set = edit.value ? edit.value->vertex : kNone;
  for (const FacetId f : edit.removed_facets) {
    std::array<Vec<Dim>, Dim + 1> simplex;
    int moving = 0;
    for (int k = 0; k < Dim; ++k) {
      const VertexId v = mesh.facet(f)[k];
      simplex[k] = surface.at(v);
      moving += v == set || v == edit.removed_vertex;
    }
    simplex[Dim] = target;
    if (moving > 0) swept.push_back(simplex);
  }
}

/// Whether a facet that the edit replaces or inserts is curved.
template <int Dim>
bool has_chords(const Edit<Dim>& edit, const GateScratch<Dim>& scratch) {
  return scratch.removed.size() != edit.removed_facets.size() || scratch.inserted.size() != edit.inserted_facets.size();
}

/// Holds what lies between two surfaces of one rim: the cones over all of their simplices from a point of either.
template <int Dim>
void find_swept_by_chords(const std::vector<SurfacePiece<Dim>>& removed, const std::vector<SurfacePiece<Dim>>& inserted,
                          const Vec<Dim>& apex, std::vector<std::array<Vec<Dim>, Dim + 1>>& swept) {
  swept.clear();
  for (const auto* pieces : {&removed, &inserted})
    for (const SurfacePiece<Dim>& piece : *pieces) {
      if (std::find(piece.p.begin(), piece.p.begin() + Dim, apex) != piece.p.begin() + Dim) continue;  // flat
      auto& cone = swept.emplace_back();
      std::copy_n(piece.p.begin(), Dim, cone.begin());
      cone[Dim] = apex;
    }
}

}  // namespace

template <int Dim>
Gate<Dim>::Gate(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context)
    : mesh_(mesh), has_contact_(context.contact.enabled), primitives_(ObstaclePrimitives::make<Dim>(context.obstacles)) {
  configurations_.reserve(1 + fields.past_positions.size());
  const double span = has_contact_ ? span_of_clearances(mesh, fields.x, context.contact.dhat) : 0;
  configurations_.push_back({&fields.x, {mesh, fields.x, primitives_, context.obstacles.x, span}});
  for (std::size_t i = 0; i < fields.past_positions.size(); ++i)
    configurations_.push_back(
        {&fields.past_positions[i], {mesh, fields.past_positions[i], primitives_, context.obstacles.past_x[i]}});
}

template <int Dim>
bool Gate<Dim>::passes(const Edit<Dim>& edit, GateScratch<Dim>& scratch) const {
  for (const auto& configuration : configurations_)
    if (!keeps_orientation(edit, *configuration.x)) return false;
  if (!moves_surface(edit)) return true;
  for (const auto& configuration : configurations_)
    if (!stays_free(edit, configuration, scratch)) return false;
  return true;
}

template <int Dim>
bool Gate<Dim>::keeps_orientation(const Edit<Dim>& edit, const VectorX& x) const {
  if (edit.kind == Edit<Dim>::Kind::curve) return true;  // the same functions
  return std::all_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
    if (const auto curved = cell_after(mesh_, edit, cell.vertices); curved.edges)
      return is_positive_everywhere<Dim>(curved.values(x, edit));
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = RemeshFields<Dim>::after(x, edit, cell.vertices[k]);
    return orientation_of<Dim>(p) > 0;
  });
}

template <int Dim>
bool Gate<Dim>::is_any_removed_curved(const Edit<Dim>& edit) const {
  bool is_any = false;
  for (const FacetId f : edit.removed_facets)
    for_each_node_on<Dim>(mesh_.facet(f), nodes_of_edges(mesh_), [&](VertexId) { is_any = true; });
  return is_any;
}

/// The pieces of the surface that the edit removes, and those that it inserts.
template <int Dim>
void Gate<Dim>::find_pieces(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const {
  scratch.removed.clear();
  for (const FacetId f : edit.removed_facets) {
    const auto pieces = at.surface.pieces(f);
    scratch.removed.insert(scratch.removed.end(), pieces.begin(), pieces.end());
  }
  scratch.inserted.clear();
  for (const auto& facet : edit.inserted_facets)
    for_each_chord<Dim>(
        facet.vertices, [&](VertexId a, VertexId b) { return node_after(mesh_, edit, a, b); },
        [&](const auto& ids) {
          SurfacePiece<Dim>& piece = scratch.inserted.emplace_back();
          for (const VertexId v : ids) piece.add(RemeshFields<Dim>::after(*at.x, edit, v), v);
        });
}

template <int Dim>
void Gate<Dim>::find_swept(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const {
  const VectorX& x = *at.x;
  const Vec<Dim> target = edit.value ? RemeshFields<Dim>::interpolate(x, *edit.value) : Vec<Dim>(Vec<Dim>::Zero());
  if (!has_chords(edit, scratch)) return find_swept_by_facets<Dim>(mesh_, at.surface, edit, target, scratch.swept);
  const VertexId node = mesh_.node_of(edit.edge[0], edit.edge[1]);
  const Vec<Dim> apex = edit.value ? target : Vec<Dim>(x.segment<Dim>(Dim * (node == kNone ? edit.edge[0] : node)));
  find_swept_by_chords(scratch.removed, scratch.inserted, apex, scratch.swept);
}

template <int Dim>
bool Gate<Dim>::stays_free(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const {
  const SurfaceIndex<Dim>& surface = at.surface;
  find_pieces(edit, at, scratch);
  find_swept(edit, at, scratch);
  const VertexId set = edit.value ? edit.value->vertex : kNone;
  const Vec<Dim> target = edit.value ? RemeshFields<Dim>::interpolate(*at.x, *edit.value) : Vec<Dim>(Vec<Dim>::Zero());
  Box<Dim> box;
  for (const auto* pieces : {&scratch.removed, &scratch.inserted})
    for (const SurfacePiece<Dim>& piece : *pieces) box.include(piece.box);
  surface.query(box, scratch.hits);
  const auto is_swept = [&](const Vec<Dim>& point) {
    return std::any_of(scratch.swept.begin(), scratch.swept.end(),
                       [&](const auto& simplex) { return lies_in<Dim>(point, simplex); });
  };
  const auto is_part = [&](SurfaceId v) {
    const auto has = [&](const SurfacePiece<Dim>& piece) { return piece.has(v); };
    return v == set || v == edit.removed_vertex || std::any_of(scratch.inserted.begin(), scratch.inserted.end(), has) ||
           std::any_of(scratch.removed.begin(), scratch.removed.end(), has);
  };
  const auto is_free_of = [&](const SurfacePiece<Dim>& other) {
    return std::none_of(scratch.inserted.begin(), scratch.inserted.end(),
                        [&](const SurfacePiece<Dim>& piece) { return piece.box.overlaps(other.box) && meet(piece, other); });
  };
  for (const FacetId f : scratch.hits.facets) {
    if (std::find(edit.removed_facets.begin(), edit.removed_facets.end(), f) != edit.removed_facets.end()) continue;
    for (const SurfacePiece<Dim>& there : surface.pieces(f)) {
      SurfacePiece<Dim> piece;
      for (int k = 0; k < there.size; ++k) {
        piece.add(there.id[k] == set ? target : there.p[k], there.id[k]);
        if (!is_part(there.id[k]) && is_swept(piece.p[k])) return false;
      }
      if (!is_free_of(piece)) return false;
    }
  }
  for (const int i : scratch.hits.obstacles) {
    const SurfacePiece<Dim> piece = surface.obstacle_piece(i);
    for (int k = 0; k < piece.size; ++k)
      if (is_swept(piece.p[k])) return false;
    if (!is_free_of(piece)) return false;
  }
  return !has_chords(edit, scratch) || std::all_of(scratch.inserted.begin(), scratch.inserted.end(), is_free_of);
}

template <int Dim>
void Gate<Dim>::follow(const Edit<Dim>& edit, FacetId first_new) {
  if (!has_contact_) return;
  for (auto& configuration : configurations_) {
    configuration.surface.follow(edit.removed_facets, first_new);
    if (edit.value && edit.value->vertex != kNewVertex) configuration.surface.move(edit.value->vertex);
  }
}

template class Gate<2>;
template class Gate<3>;

}  // namespace itr
