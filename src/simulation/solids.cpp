// SPDX-License-Identifier: MIT
#include "solids.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "core/connected_parts.hpp"
#include "fem/refined_chords.hpp"
#include "geometry/distance.hpp"
#include "geometry/measures.hpp"
#include "mesh/cell_of_facet.hpp"
#include "sizes.hpp"
#include "step_terms.hpp"

namespace itr {

namespace {

/// Corners, and middles of what has several of them.
template <int Dim>
std::vector<FacetPoint<Dim>> points_of(const std::vector<std::array<int, Dim>>& facets) {
  std::set<std::array<int, 2>> seen;
  std::vector<FacetPoint<Dim>> points;
  for (const auto& facet : facets) {
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j <= i; ++j) {
        if (!seen.insert({std::min(facet[i], facet[j]), std::max(facet[i], facet[j])}).second) continue;
        FacetPoint<Dim> point{facet, {}};
        point.weights[i] += 0.5;
        point.weights[j] += 0.5;
        points.push_back(point);
      }
    if constexpr (Dim == 3) points.push_back({facet, {1.0 / 3, 1.0 / 3, 1.0 / 3}});
  }
  return points;
}

template <int Dim>
std::vector<std::array<int, Dim>> facets_of_obstacles(const Obstacles<Dim>& obstacles) {
  if constexpr (Dim == 2)
    return obstacles.edges;
  else
    return obstacles.triangles;
}

template <int Dim>
std::array<Vec<Dim>, Dim> corners_of(const std::array<int, Dim>& facet, ConstVectorView y) {
  std::array<Vec<Dim>, Dim> corners;
  for (int k = 0; k < Dim; ++k) corners[k] = y.segment<Dim>(Dim * facet[k]);
  return corners;
}

/// The weights of the point of a facet that is nearest to p.
template <int Dim>
std::array<double, Dim> nearest_weights(const Vec<Dim>& p, const std::array<Vec<Dim>, Dim>& corners) {
  constexpr PairKind kKind = Dim == 2 ? PairKind::edge_vertex : PairKind::face_vertex;
  std::array<Vec<Dim>, 4> x{p}, local;
  std::copy(corners.begin(), corners.end(), x.begin() + 1);
  const ClosestFeatures closest = closest_features<Dim>(kKind, x.data());
  for (int k = 0; k < pair_size(closest.kind); ++k) local[k] = x[closest.local[k]];
  const Vec<4> coefficients = pair_distance<Dim>(closest.kind, local.data()).coefficients;
  double of_p = 1;
  for (int k = 0; k < pair_size(closest.kind); ++k)
    if (closest.local[k] == 0) of_p = coefficients[k];
  std::array<double, Dim> weights{};
  for (int k = 0; k < pair_size(closest.kind); ++k)
    if (closest.local[k] > 0) weights[closest.local[k] - 1] = -coefficients[k] / of_p;
  return weights;
}

/// Whether conditions hold a point and a facet along `way`, as on a plane of symmetry that cuts both bodies.
template <int Dim>
bool are_held(const Solid<Dim>& one, const FacetPoint<Dim>& point, const Solid<Dim>& other,
              const std::array<int, Dim>& facet, const Vec<Dim>& way) {
  constexpr double kAlong = 1e-9;
  for (int c = 0; c < Dim; ++c) {
    if (std::abs(way[c]) <= kAlong) continue;
    for (int k = 0; k < Dim; ++k)
      if ((point.weights[k] != 0 && !one.held.contains(Dim * point.vertices[k] + c)) ||
          !other.held.contains(Dim * facet[k] + c))
        return false;
  }
  return true;
}

}  // namespace

template <int Dim>
std::vector<Solid<Dim>> find_solids(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords) {
  const RefinedChords<Dim> boundary =
      refine_chords(mesh, chords.empty() ? ChordLevels(static_cast<std::size_t>(mesh.num_curved()), 0) : chords);
  const std::map<int, BodySize> sizes = body_sizes(mesh);
  std::map<int, Solid<Dim>> by_part;
  for (const CellId c : mesh.live_cells()) {
    Solid<Dim>& solid = by_part[mesh.part(c)];
    solid.part = mesh.part(c);
    solid.thickness = std::min(solid.thickness, sizes.at(mesh.body(c)).thickness);
    if (solid.body == kNone) solid.body = mesh.body(c);
  }
  for (std::size_t i = 0; i < boundary.facets.size(); ++i)
    by_part.at(mesh.part(cell_of_facet(mesh, boundary.parents[i]))).facets.push_back(boundary.facets[i]);
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0).held;
  std::vector<Solid<Dim>> solids;
  for (auto& [part, solid] : by_part) {
    for (const auto& facet : solid.facets)
      for (const int v : facet)
        for (int k = Dim * v; v < mesh.num_nodes() && k < Dim * (v + 1); ++k)
          if (held[static_cast<std::size_t>(k)]) solid.held.insert(k);
    solids.push_back(std::move(solid));
  }
  const Obstacles<Dim>& obstacles = setup.obstacles;
  const int first = mesh.num_nodes() + static_cast<int>(boundary.points.size());
  const auto facets = facets_of_obstacles(obstacles);
  const std::vector<int> connected = connected_parts<Dim>(obstacles.rest.size(), facets);
  std::map<int, Solid<Dim>> by_component;
  for (auto facet : facets) {
    Solid<Dim>& solid = by_component[connected[facet[0]]];
    for (int& v : facet) v += first;
    solid.facets.push_back(facet);
  }
  for (const int v : obstacles.flats) by_component[connected[v]].is_flat = true;
  for (auto& [component, solid] : by_component) solids.push_back(std::move(solid));
  for (Solid<Dim>& solid : solids) solid.points = points_of<Dim>(solid.facets);
  return solids;
}

template <int Dim>
Solids<Dim>::Solids(std::vector<Solid<Dim>> solids, ConstVectorView y) : y_(y), solids_(std::move(solids)) {
  make_shapes();
  for (std::size_t i = 0; i < solids_.size(); ++i)
    for (std::size_t j = 0; j < solids_.size(); ++j) sides_.push_back(find_side(i, j));
}

template <int Dim>
Solids<Dim>::Solids(const Solids& first, ConstVectorView y) : y_(y), solids_(first.solids_), sides_(first.sides_) {
  make_shapes();
}

template <int Dim>
void Solids<Dim>::make_shapes() {
  for (const Solid<Dim>& solid : solids_) {
    Shape& shape = shapes_.emplace_back();
    std::vector<Box<Dim>> boxes;
    std::map<int, int> number;
    std::vector<Vec<Dim>> corners;
    std::vector<std::array<int, Dim>> facets = solid.facets;
    for (auto& facet : facets) {
      boxes.emplace_back();
      for (int& v : facet) {
        const auto [place, is_new] = number.emplace(v, static_cast<int>(corners.size()));
        if (is_new) corners.emplace_back(y_.segment<Dim>(Dim * v));
        v = place->second;
        boxes.back().include(corners[v]);
      }
      shape.box.include(boxes.back());
    }
    shape.tree.build(boxes);
    ClosedSurface<Dim> closed(std::move(corners), facets);
    if (std::ranges::all_of(facets, [&](const auto& facet) { return closed.is_vertex(facet[0]); })) shape.closed = closed;
  }
}

template <int Dim>
double Solids<Dim>::find_side(std::size_t i, std::size_t j) const {
  const Solid<Dim>&one = solids_[i], &other = solids_[j];
  const bool are_bodies = one.part != kNone && other.part != kNone;
  if (i == j || (one.part == kNone && other.part == kNone)) return 0;
  const double near = std::min(one.thickness, other.thickness);
  if (!shapes_[i].box.inflated(near).overlaps(shapes_[j].box)) return 0;
  if (are_bodies || other.part != kNone) return 1;
  int inside = 0, outside = 0;
  for (const FacetPoint<Dim>& point : one.points) {
    const Vec<Dim> p = point.at(y_);
    const bool is_inside = shapes_[j].closed ? shapes_[j].closed->winding(p) != 0 : find_nearest(i, point, j).gap < 0;
    ++(is_inside ? inside : outside);
  }
  return inside > outside ? -1 : 1;
}

/// Where several facets are equally near, the one whose plane is farthest from p tells the side.
template <int Dim>
Nearest<Dim> Solids<Dim>::find_nearest(std::size_t i, const FacetPoint<Dim>& point, std::size_t j) const {
  constexpr double kEqual = 1e-9, kFarthest = 4;
  const Shape& shape = shapes_[j];
  const Vec<Dim> p = point.at(y_);
  const double size = (shape.box.max - shape.box.min).norm(), farthest = kFarthest * (size + (p - shape.box.min).norm());
  Nearest<Dim> nearest;
  double least = std::numeric_limits<double>::infinity(), steepest = -1;
  std::vector<int> hits;
  for (double reach = size / static_cast<double>(solids_[j].facets.size()); !(least <= reach) && reach < farthest;
       reach *= 4) {
    hits.clear();
    shape.tree.query(Box<Dim>{p, p}.inflated(reach), hits);
    for (const int f : hits) {
      const auto& facet = solids_[j].facets[f];
      const auto corners = corners_of<Dim>(facet, y_);
      const FacetPoint<Dim> foot{facet, nearest_weights<Dim>(p, corners)};
      const Vec<Dim> way = p - foot.at(y_), outward = -inward_normal(corners).normalized();
      const double distance = way.norm(), height = outward.dot(way);
      const double slope = distance > 0 ? std::abs(height) / distance : 1;
      if (are_held<Dim>(solids_[i], point, solids_[j], facet, outward)) continue;
      const double slack = kEqual * (least < size ? least : 0) + 1e-15 * size;
      if (distance > least + slack || (distance >= least - slack && slope <= steepest)) continue;
      least = std::min(least, distance);
      steepest = slope;
      const bool is_inside = shape.closed ? shape.closed->winding(p) != 0 : height < 0;
      const double sign = is_inside ? -1 : 1;
      nearest = {foot, distance > 1e-12 * size ? Vec<Dim>(sign * way / distance) : outward, sign * distance};
    }
  }
  return nearest;
}

template <int Dim>
std::optional<Nearest<Dim>> Solids<Dim>::find_near(std::size_t i, const FacetPoint<Dim>& point, std::size_t j,
                                                   double gap) const {
  const Shape& shape = shapes_[j];
  const Vec<Dim> p = point.at(y_);
  const double side = side_of(i, j);
  const double margin = shape.closed ? gap : std::max(gap, std::min(solids_[i].thickness, solids_[j].thickness));
  if (side > 0 && !shape.box.inflated(margin).contains(p)) return std::nullopt;
  if (shape.closed && (shape.closed->winding(p) != 0) == (side < 0)) {  // on its side: is it near?
    std::vector<int> hits;
    shape.tree.query(Box<Dim>{p, p}.inflated(gap), hits);
    if (hits.empty()) return std::nullopt;
  }
  Nearest<Dim> nearest = find_nearest(i, point, j);
  nearest.gap *= side;
  nearest.normal *= side;
  if (nearest.gap < gap) return nearest;
  return std::nullopt;
}

template <int Dim>
std::vector<Penetration<Dim>> Solids<Dim>::penetrations() const {
  std::vector<Penetration<Dim>> found;
  for (std::size_t i = 0; i < solids_.size(); ++i)
    for (std::size_t j = 0; j < solids_.size(); ++j) {
      if (side_of(i, j) == 0) continue;
      Penetration<Dim> penetration{i, j, 0, Vec<Dim>::Zero(), true};
      for (const FacetPoint<Dim>& point : solids_[i].points) {
        const auto nearest = find_near(i, point, j, 0);
        if (!nearest) penetration.is_whole = false;
        if (nearest && -nearest->gap > penetration.depth)
          penetration.depth = -nearest->gap, penetration.place = point.at(y_);
      }
      if (penetration.depth > 0) found.push_back(penetration);
    }
  return found;
}

template <int Dim>
std::optional<Vec<Dim>> Solids<Dim>::find_crossing_obstacles() const {
  constexpr double kTouching = 1e-9;
  for (std::size_t i = 0; i < solids_.size(); ++i)
    for (std::size_t j = 0; j < solids_.size(); ++j) {
      if (i == j || solids_[i].part != kNone || solids_[j].part != kNone || !shapes_[j].closed) continue;
      const Box<Dim>& box = shapes_[j].box;
      for (const FacetPoint<Dim>& point : solids_[i].points) {
        const Vec<Dim> p = point.at(y_);
        if (!solids_[i].is_flat && box.contains(p) &&
            find_nearest(i, point, j).gap < -kTouching * (box.max - box.min).norm())
          return p;
      }
    }
  return std::nullopt;
}

#define ITR_INSTANTIATE(Dim)                                                                                 \
  template std::vector<Solid<Dim>> find_solids(const StepSetup<Dim>&, const Mesh<Dim>&, const ChordLevels&); \
  template class Solids<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
