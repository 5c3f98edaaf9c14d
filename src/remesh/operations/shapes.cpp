// SPDX-License-Identifier: MIT
// Puts vertices of surfaces that have a shape onto it, at rest, and splits edges there that are too far off it.
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "geometry/shape.hpp"
#include "mesh/cell_of_facet.hpp"
#include "mesh/rest_box.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits/edit_checks.hpp"
#include "remesh/schedule/session.hpp"
#include "remesh/shapes.hpp"

namespace itr {

namespace {

template <int Dim>
Vec<3> in_space(const Vec<Dim>& p) {
  Vec<3> point = Vec<3>::Zero();
  point.head<Dim>() = p;
  return point;
}

using ShapeOfTag = std::map<int, const Shape*>;

/// Surfaces that a place has to lie on: shapes, and planes where there are none.
template <int Dim>
class Carriers {
 public:
  /// Takes those of the boundary facets at an edge, or at a vertex (both ends the same).
  Carriers(const Mesh<Dim>& mesh, const ShapeOfTag& shapes, const EdgeKey& edge) {
    for (const FacetId f : mesh.facets_of(edge[0])) {
      if (!holds(mesh.facet(f), edge[1])) continue;
      if (const auto shape = shapes.find(mesh.facet_tag(f)); shape != shapes.end())
        add(*shape->second);
      else
        add_plane(mesh, f);
    }
  }
  /// How far an edge on them that may touch may be off [m].
  double most_sag(double otherwise) const {
    double most = std::numeric_limits<double>::infinity();
    for (const Shape* shape : shapes_) most = std::min(most, shape->sag > 0 ? shape->sag : otherwise);
    return most;
  }

  /// How far a place is off them, at most [m].
  double distance(const Vec<Dim>& place) const { return gaps(place).first.cwiseAbs().maxCoeff(); }
  /// The place near this one on all of them; nothing where there is none or Newton finds none.
  std::optional<Vec<Dim>> nearest(const Vec<Dim>& from, double tolerance) const {
    constexpr int kMostIterations = 30;
    if (shapes_.size() + planes_.size() > Dim) return std::nullopt;
    Vec<Dim> place = from;
    double before = std::numeric_limits<double>::infinity();
    for (int i = 0; i < kMostIterations; ++i) {
      const auto [gap, slopes] = gaps(place);
      const double worst = gap.cwiseAbs().maxCoeff();
      if (worst == 0 || (worst <= tolerance && worst >= before)) return place;
      before = worst;
      place -= Vec<Dim>(slopes.completeOrthogonalDecomposition().solve(gap));
    }
    return before <= tolerance ? std::optional(place) : std::nullopt;
  }

 private:
  struct Plane {
    Vec<Dim> point, normal;
  };
  void add(const Shape& shape) {
    if (std::ranges::find(shapes_, &shape) == shapes_.end()) shapes_.push_back(&shape);
  }
  void add_plane(const Mesh<Dim>& mesh, FacetId f) {
    constexpr double kSame = 1e-6;  // sine of the angle between planes that count as one
    const CellId c = cell_of_facet(mesh, f);
    Vec<Dim> normal = Vec<Dim>::Zero();  // gradient of the shape function of the vertex inside
    for (int k = 0; k <= Dim; ++k)
      if (!holds(mesh.facet(f), mesh.cell(c)[k])) normal = barycentric_gradient<Dim>(mesh.inverse_rest_edges(c), k);
    normal.normalize();
    if (std::ranges::none_of(planes_, [&](const Plane& p) { return 1 - std::abs(p.normal.dot(normal)) < kSame * kSame; }))
      planes_.push_back({mesh.rest(mesh.facet(f)[0]), normal});
  }
  std::pair<VectorX, MatrixX> gaps(const Vec<Dim>& place) const {
    const auto n = static_cast<Eigen::Index>(shapes_.size() + planes_.size());
    VectorX gap(n);
    MatrixX slopes(n, Dim);
    Eigen::Index row = 0;
    for (const Shape* shape : shapes_) {
      const ShapeOffset offset = offset_from(*shape, in_space<Dim>(place));
      gap[row] = offset.distance;
      slopes.row(row++) = offset.normal.head<Dim>();
    }
    for (const Plane& plane : planes_) {
      gap[row] = plane.normal.dot(place - plane.point);
      slopes.row(row++) = plane.normal;
    }
    return {gap, slopes};
  }

  std::vector<const Shape*> shapes_;
  std::vector<Plane> planes_;
};

template <int Dim>
class ShapeOperation {
 public:
  ShapeOperation(RemeshSession<Dim>& session, const Shapes& shapes, const RemeshFields<Dim>& fields,
                 AddedMaterial<Dim>& added)
      : session_(session),
        queries_(session.queries()),
        mesh_(queries_.mesh()),
        fields_(fields),
        added_(added),
        tolerance_(kTolerance * (rest_box(mesh_).diagonal() + rest_box(mesh_).center().cwiseAbs()).norm()),
        motion_of_obstacles_(largest_motion(queries_.context().obstacles)) {
    for (const auto& shape : shapes)
      for (const int tag : shape->surfaces) shape_of_.emplace(tag, shape.get());
  }

  void run() {
    constexpr int kMostRounds = 12;
    for (const VertexId v : shaped_vertices()) put_on_shape(v);
    std::vector<EdgeKey> edges = shaped_edges();
    for (int round = 0; round < kMostRounds && !edges.empty(); ++round) edges = split(edges);
    for (const VertexId v : shaped_vertices())
      if (!stays(v)) note_if_off(v);
  }

 private:
  static constexpr double kTolerance = 1e-14;  ///< how far off its shape a vertex counts as on it, by the mesh's diagonal
  static constexpr double kWorthMoving = 10;   ///< tolerances from which on it is moved

  bool has_shape(FacetId f) const { return shape_of_.contains(mesh_.facet_tag(f)); }
  std::vector<VertexId> shaped_vertices() const {
    std::vector<VertexId> vertices;
    for (const VertexId v : mesh_.live_vertices())
      if (std::ranges::any_of(mesh_.facets_of(v), [&](FacetId f) { return has_shape(f); })) vertices.push_back(v);
    return vertices;
  }
  bool is_kept(FacetId f) const {
    const auto& kept = queries_.context().kept_surfaces;
    return std::ranges::find(kept, mesh_.facet_tag(f)) != kept.end();
  }
  bool stays(VertexId v) const {
    return mesh_.is_on_axis(v) || mesh_.is_on_interface(v) || mesh_.vertex_tag(v) != kNoTag ||
           std::ranges::any_of(mesh_.facets_of(v), [&](FacetId f) { return is_kept(f); });
  }

  void note_if_off(VertexId v) {
    const double distance = Carriers<Dim>(mesh_, shape_of_, {v, v}).distance(mesh_.rest(v));
    if (distance <= kWorthMoving * tolerance_) return;
    ++added_.off;
    added_.farthest = std::max(added_.farthest, distance);
  }

  void put_on_shape(VertexId v) {
    const Carriers<Dim> carriers(mesh_, shape_of_, {v, v});
    if (carriers.distance(mesh_.rest(v)) <= kWorthMoving * tolerance_ || stays(v)) return;
    const auto place = carriers.nearest(mesh_.rest(v), tolerance_);
    if (!place) return session_.report().smooths.note(Refusal::held);
    for (const CellId c : mesh_.cells_of(v))
      if (!(quality_with<Dim>(mesh_, mesh_.cell(c), v, *place) > kLeastQuality * std::min(1.0, mesh_.quality(c))))
        return session_.report().smooths.note(Refusal::shape);
    // New material has what the nearest cell's functions have there, or less of it where something is in the way; at last
    // the nearest point's place.
    for (const double part : {1.0, 0.5, 0.25, 0.125, 0.0}) {
      const Edit<Dim> edit = make_move(v, *place, part);
      if (!session_.gate().passes(edit, session_.scratch().gate)) continue;
      note_material(v, edit);
      if (part < 1) ++added_.compressed;
      ++session_.report().smooths.tried;
      session_.commit_unjudged(edit, session_.report().smooths);
      return;
    }
    session_.report().smooths.note(Refusal::invalid);
  }
  static constexpr double kLeastQuality = 0.1;  ///< of what a cell was

  /// Moves a vertex at rest. Its fields and those of nodes around become by a `part` those of the extrapolated functions.
  Edit<Dim> make_move(VertexId v, const Vec<Dim>& place, double part) const {
    Edit<Dim> edit{.kind = Edit<Dim>::Kind::smooth};
    typename Edit<Dim>::Value value{v, place};
    const auto around = mesh_.cells_of(v);
    edit.removed_cells.assign(around.begin(), around.end());
    for (const CellId c : around) edit.inserted_cells.push_back({mesh_.cell(c), mesh_.body(c)});
    for (const FacetId f : mesh_.facets_of(v)) {
      edit.removed_facets.push_back(f);
      edit.inserted_facets.push_back({mesh_.facet(f), mesh_.facet_tag(f), f});
    }
    extrapolate(around, place, value);
    mix(value, v, part);
    edit.value = value;
    std::vector<VertexId> ends;
    for (const CellId c : around)
      for (const VertexId w : mesh_.cell(c))
        if (w != v && !holds_end(ends, w) && mesh_.node_of(v, w) != kNone) ends.push_back(w);
    for (const VertexId w : ends) {
      edit.removed_nodes.push_back(edge_key(v, w));
      typename Edit<Dim>::NewNode node{edge_key(v, w)};
      extrapolate(around, (place + mesh_.rest(w)) / 2, node);
      mix(node, mesh_.node_of(v, w), part);
      edit.inserted_nodes.push_back(node);
    }
    return edit;
  }
  /// Sets parents and weights to the nodes and functions of the nearest of these cells, also outside of it.
  template <typename Target>
  void extrapolate(std::span<const CellId> cells, const Vec<Dim>& place, Target& target) const {
    double deepest = -std::numeric_limits<double>::infinity();
    CellId nearest = kNone;
    std::array<double, Dim + 1> l{};
    for (const CellId c : cells) {
      const Vec<Dim> tail = mesh_.inverse_rest_edges(c) * (place - mesh_.rest(mesh_.cell(c)[0]));
      const double depth = std::min(1 - tail.sum(), tail.minCoeff());
      if (!(depth > deepest)) continue;
      deepest = depth;
      nearest = c;
      l[0] = 1 - tail.sum();
      for (int k = 0; k < Dim; ++k) l[k + 1] = tail[k];
    }
    const auto set = [&](const auto& nodes, const auto& shapes) {
      for (std::size_t k = 0; k < nodes.size(); ++k)
        if (shapes[k] != 0) {
          target.parents[target.num_parents] = nodes[k];
          target.weights[target.num_parents++] = shapes[k];
        }
    };
    const CurvedCell<Dim> cell = cell_before(mesh_, nearest);
    if (cell.edges)
      set(cell.nodes, quadratic_shapes<Dim>(cell.edges, l));
    else
      set(mesh_.cell(nearest), l);
  }
  static bool holds_end(const std::vector<VertexId>& ends, VertexId v) { return std::ranges::find(ends, v) != ends.end(); }
  /// Takes a `part` of the weights, and the rest from a node that is one of the parents.
  template <typename Target>
  static void mix(Target& target, VertexId own, double part) {
    if (part == 1) return;
    for (int k = 0; k < target.num_parents; ++k)
      target.weights[k] = part * target.weights[k] + (target.parents[k] == own ? 1 - part : 0);
    if (std::find(target.parents.begin(), target.parents.begin() + target.num_parents, own) !=
        target.parents.begin() + target.num_parents)
      return;
    target.num_parents = 1;  // a node of which the nearest cell does not know
    target.parents[0] = own;
    target.weights[0] = 1;
  }

  /// Notes the simplices between the surface before and after a move, with the fields at their corners.
  void note_material(VertexId v, const Edit<Dim>& edit) {
    const auto at = [&](const VectorX& field, VertexId w) { return Vec<Dim>(field.segment<Dim>(Dim * w)); };
    for (const FacetId f : mesh_.facets_of(v)) {
      const auto& facet = mesh_.facet(f);
      typename AddedMaterial<Dim>::Piece piece{.body = mesh_.body(cell_of_facet(mesh_, f))};
      for (int k = 0; k < Dim; ++k) piece.rest[k] = mesh_.rest(facet[k]);
      piece.rest[Dim] = edit.value->rest;
      const auto corners_of = [&](const VectorX& field) {
        std::array<Vec<Dim>, Dim + 1> corners;
        for (int k = 0; k < Dim; ++k) corners[k] = at(field, facet[k]);
        corners[Dim] = RemeshFields<Dim>::interpolate(field, *edit.value);
        return corners;
      };
      piece.x = corners_of(fields_.past_positions.front());
      for (const VectorX& rate : fields_.past_rates) piece.rates.push_back(corners_of(rate));
      added_.pieces.push_back(std::move(piece));
    }
    added_.moved.push_back(v);
  }

  std::vector<EdgeKey> shaped_edges() const {
    std::vector<EdgeKey> edges;
    for (const FacetId f : mesh_.live_facets()) {
      if (!has_shape(f)) continue;
      const auto& facet = mesh_.facet(f);
      for (int k = 0; k < (Dim == 2 ? 1 : 3); ++k) edges.push_back(edge_key(facet[k], facet[(k + 1) % Dim]));
    }
    std::ranges::sort(edges);
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
  }

  /// How far the middle of an edge of a surface is off its shape [m]; 0 where that may stay: the edge is short beside the
  /// radius of the shape, and contact sees nothing of it.
  double sag_to_mend(const EdgeKey& edge) {
    const auto both = [&](auto&& holds) { return holds(edge[0]) && holds(edge[1]); };
    if (both([&](VertexId v) { return mesh_.is_on_axis(v); }) ||
        both([&](VertexId v) { return mesh_.is_on_interface(v); }) ||
        std::ranges::any_of(mesh_.facets_of_edge(edge), [&](FacetId f) { return is_kept(f); }))
      return 0;
    const Carriers<Dim> carriers(mesh_, shape_of_, edge);
    for (const VertexId v : edge)  // halves would be no nearer to the shape
      if (carriers.distance(mesh_.rest(v)) > kWorthMoving * tolerance_) return 0;
    const double sag = carriers.distance((mesh_.rest(edge[0]) + mesh_.rest(edge[1])) / 2);
    // Wherever it is: material of a body that turns, or is about to touch, is there before.
    const bool is_coarse = sag > kMostSag<Dim> * (mesh_.rest(edge[0]) - mesh_.rest(edge[1])).norm();
    const bool is_seen = queries_.has_contact() &&
                         sag > carriers.most_sag(kMostOverhang * queries_.context().contact.dhat) && may_touch(edge, sag);
    return is_coarse || is_seen ? sag : 0;
  }

  /// Splits the edges that are too far off their shapes, those farthest off first, and returns the new ones.
  std::vector<EdgeKey> split(const std::vector<EdgeKey>& edges) {
    std::vector<std::pair<double, EdgeKey>> wanted;
    for (const EdgeKey& edge : edges)
      if (const double sag = sag_to_mend(edge); sag > 0) wanted.emplace_back(-sag, edge);
    std::ranges::sort(wanted);
    std::vector<EdgeKey> made;
    for (const auto& [height, edge] : wanted) {
      const Refusal refusal = queries_.refuse_split(edge);
      if (refusal != Refusal::none) {
        session_.report().splits.note(refusal);
        continue;
      }
      const Edit<Dim> edit = make_split(mesh_, edge);
      ++session_.report().splits.tried;
      if (!session_.commit_unjudged(edit, session_.report().splits)) continue;
      const VertexId v = mesh_.node_slots() - 1 - static_cast<int>(edit.inserted_nodes.size());
      put_on_shape(v);
      for (const FacetId f : mesh_.facets_of(v))
        for (const VertexId a : mesh_.facet(f))
          for (const VertexId b : mesh_.facet(f))
            if (a < b) made.push_back({a, b});
    }
    std::ranges::sort(made);
    made.erase(std::unique(made.begin(), made.end()), made.end());
    std::erase_if(made, [&](const EdgeKey& edge) { return mesh_.facets_of_edge(edge).empty(); });
    return made;
  }

  static double largest_motion(const typename StepContext<Dim>::ObstacleGeometry& obstacles) {
    double most = 0;
    if (!obstacles.past_x.empty())
      for (std::size_t i = 0; i < obstacles.x.size(); ++i)
        most = std::max(most, (obstacles.x[i] - obstacles.past_x[0][i]).norm());
    return most;
  }

  /// Whether the shape of an edge may come into reach of contact by the motion of one more step. Parts of one body that are
  /// as near at rest do not count.
  bool may_touch(const EdgeKey& edge, double height) {
    const auto at = [](const VectorX& field, VertexId v) { return field.segment<Dim>(Dim * v); };
    double motion = motion_of_obstacles_;
    for (const VertexId v : edge)
      motion = std::max(motion, (at(fields_.x, v) - at(fields_.past_positions[0], v)).norm() + motion_of_obstacles_);
    const double reach = queries_.context().contact.dhat + motion + height;
    const SurfaceIndex<Dim>& surface = queries_.surface();
    const auto rest_of = [&](FacetId f) {
      SurfacePiece<Dim> piece;
      for (const VertexId v : mesh_.facet(f)) piece.add(mesh_.rest(v), v);
      return piece;
    };
    for (const FacetId f : mesh_.facets_of_edge(edge)) {
      surface.query(surface.box_of(f).inflated(reach), hits_);
      const SurfacePiece<Dim> here = surface.piece(f);
      for (const int i : hits_.obstacles)
        if (come_near(here, surface.obstacle_piece(i), reach)) return true;
      for (const FacetId other : hits_.facets) {
        if (other == f || !come_near(here, surface.piece(other), reach)) continue;
        const bool is_same = mesh_.part_of_vertex(mesh_.facet(f)[0]) == mesh_.part_of_vertex(mesh_.facet(other)[0]);
        if (!is_same || !come_near(rest_of(f), rest_of(other), 2 * reach)) return true;
      }
    }
    return false;
  }

  RemeshSession<Dim>& session_;
  ShapeOfTag shape_of_;
  const RemeshQueries<Dim>& queries_;
  const Mesh<Dim>& mesh_;
  const RemeshFields<Dim>& fields_;
  AddedMaterial<Dim>& added_;
  double tolerance_;            ///< [m]
  double motion_of_obstacles_;  ///< in the last step, at most [m]
  typename SurfaceIndex<Dim>::Hits hits_;
};

}  // namespace

template <int Dim>
RemeshReport put_on_shapes(const Shapes& shapes, Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                           const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata,
                           AddedMaterial<Dim>& added) {
  RemeshReport report;
  {
    RemeshSession<Dim> session(mesh, fields, context, options, nullptr, memory, strata);
    ShapeOperation<Dim>(session, shapes, fields, added).run();
    report = session.finish();
  }
  if (report.changed()) strata = Strata<Dim>(mesh);
  return report;
}

#define ITR_INSTANTIATE(Dim)                                                                                  \
  template RemeshReport put_on_shapes(const Shapes&, Mesh<Dim>&, RemeshFields<Dim>&, const StepContext<Dim>&, \
                                      const RemeshOptions&, RemeshMemory&, Strata<Dim>&, AddedMaterial<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
