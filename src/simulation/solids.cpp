// SPDX-License-Identifier: MIT
#include "solids.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/connected_parts.hpp"
#include "fem/refined_chords.hpp"
#include "geometry/distance.hpp"
#include "geometry/measures.hpp"
#include "mesh/cell_of_facet.hpp"
#include "sizes.hpp"

namespace itr {

namespace {

/// Corners, and middles of what has several of them.
template <int Dim>
void set_points(Solid<Dim>& solid) {
  std::map<std::array<int, 2>, std::size_t> number;
  auto& points = solid.points;
  for (std::size_t f = 0; f < solid.facets.size(); ++f) {
    const auto& facet = solid.facets[f];
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j <= i; ++j) {
        const auto [place, is_new] =
            number.emplace(std::array{std::min(facet[i], facet[j]), std::max(facet[i], facet[j])}, points.size());
        if (is_new) {
          FacetPoint<Dim>& point = points.emplace_back(facet);
          point.weights[i] += 0.5;
          point.weights[j] += 0.5;
          solid.facets_at.emplace_back();
        }
        solid.facets_at[place->second].push_back(static_cast<int>(f));
      }
    if constexpr (Dim == 3) {
      points.push_back({facet, {1.0 / 3, 1.0 / 3, 1.0 / 3}});
      solid.facets_at.push_back({static_cast<int>(f)});
    }
  }
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
  std::vector<Solid<Dim>> solids;
  for (auto& [part, solid] : by_part) solids.push_back(std::move(solid));
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
  for (Solid<Dim>& solid : solids) set_points(solid);
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
    for (const auto& facet : solid.facets) shape.normals.push_back(-inward_normal(corners_of<Dim>(facet, y_)).normalized());
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
  for (std::size_t k = 0; k < one.points.size(); ++k) {
    const bool is_inside =
        shapes_[j].closed ? shapes_[j].closed->winding(one.points[k].at(y_)) != 0 : find_nearest(i, k, j).gap < 0;
    ++(is_inside ? inside : outside);
  }
  return inside > outside ? -1 : 1;
}

template <int Dim>
bool Solids<Dim>::is_facing(std::size_t i, std::size_t point, std::size_t j, int facet) const {
  constexpr double kFacing = -0.1;  // of the cosine of their normals
  if (solids_[i].part == kNone || solids_[j].part == kNone) return true;
  const auto faces = [&](int f) { return shapes_[i].normals[f].dot(shapes_[j].normals[facet]) < kFacing; };
  return std::ranges::any_of(solids_[i].facets_at[point], faces);
}

/// Where several facets are equally near, one that faces the point, and of these the one whose plane is farthest from it,
/// tells the side.
template <int Dim>
Nearest<Dim> Solids<Dim>::find_nearest(std::size_t i, std::size_t point, std::size_t j) const {
  constexpr double kEqual = 1e-9;
  const Shape& shape = shapes_[j];
  const Vec<Dim> p = solids_[i].points[point].at(y_);
  const double size = (shape.box.max - shape.box.min).norm();
  Nearest<Dim> nearest;
  double least = std::numeric_limits<double>::infinity(), best = -1;
  std::vector<int> hits;
  // A query may have left out facets nearer than one that it finds beyond its reach.
  for (double reach = 0, next = size / static_cast<double>(solids_[j].facets.size()); !(least <= reach); next *= 4) {
    reach = next;
    hits.clear();
    shape.tree.query(Box<Dim>{p, p}.inflated(reach), hits);
    for (const int f : hits) {
      const auto& facet = solids_[j].facets[f];
      const FacetPoint<Dim> foot{facet, nearest_weights<Dim>(p, corners_of<Dim>(facet, y_))};
      const Vec<Dim> way = p - foot.at(y_);
      const double distance = way.norm(), height = shape.normals[f].dot(way);
      const bool faces = is_facing(i, point, j, f);
      const double rank = (distance > 0 ? std::abs(height) / distance : 1) + (faces ? 1 : 0);
      const double slack = kEqual * (least < size ? least : 0) + 1e-15 * size;
      if (distance > least + slack || (distance >= least - slack && rank <= best)) continue;
      least = std::min(least, distance);
      best = rank;
      const bool is_inside = shape.closed ? shape.closed->winding(p) != 0 : height < 0;
      const double sign = is_inside ? -1 : 1;
      nearest = {foot, distance > 1e-12 * size ? Vec<Dim>(sign * way / distance) : shape.normals[f], sign * distance,
                 faces ? Nearest<Dim>::Way::out : Nearest<Dim>::Way::beside};
    }
  }
  return nearest;
}

template <int Dim>
Nearest<Dim> Solids<Dim>::find_facing(std::size_t i, std::size_t point, std::size_t j, double gap) const {
  const Shape& shape = shapes_[j];
  const Vec<Dim> p = solids_[i].points[point].at(y_);
  const double farthest = std::min(solids_[i].thickness, solids_[j].thickness);
  Nearest<Dim> nearest;
  double least = std::numeric_limits<double>::infinity();
  std::vector<int> hits;
  for (double reach = 0, next = farthest / 1024; !(least <= reach) && next <= farthest; next *= 4) {
    reach = next;
    hits.clear();
    shape.tree.query(Box<Dim>{p, p}.inflated(reach), hits);
    for (const int f : hits) {
      if (!is_facing(i, point, j, f)) continue;
      const auto& facet = solids_[j].facets[f];
      const FacetPoint<Dim> foot{facet, nearest_weights<Dim>(p, corners_of<Dim>(facet, y_))};
      const Vec<Dim> way = p - foot.at(y_);
      if (way.norm() >= least) continue;
      least = way.norm();
      const double height = shape.normals[f].dot(way);
      const bool is_before = (way - height * shape.normals[f]).norm() <= gap;
      nearest = {foot, shape.normals[f], height, is_before ? Nearest<Dim>::Way::beside : Nearest<Dim>::Way::none};
    }
  }
  return nearest;
}

template <int Dim>
std::optional<Nearest<Dim>> Solids<Dim>::find_near(std::size_t i, std::size_t point, std::size_t j, double gap) const {
  const Shape& shape = shapes_[j];
  const Vec<Dim> p = solids_[i].points[point].at(y_);
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
  if (nearest.gap >= gap) return std::nullopt;
  return nearest.way == Nearest<Dim>::Way::out ? nearest : find_facing(i, point, j, gap);
}

/// Points beside others are no deeper than twice those that tell their way out themselves, else that way is another one.
template <int Dim>
std::vector<std::pair<std::size_t, Nearest<Dim>>> Solids<Dim>::find_near_points(std::size_t i, std::size_t j,
                                                                                double gap) const {
  std::vector<std::pair<std::size_t, Nearest<Dim>>> found;
  if (side_of(i, j) == 0) return found;
  double depth = gap;
  for (std::size_t k = 0; k < solids_[i].points.size(); ++k)
    if (const auto nearest = find_near(i, k, j, gap); nearest && nearest->way != Nearest<Dim>::Way::none) {
      found.emplace_back(k, *nearest);
      if (nearest->way == Nearest<Dim>::Way::out) depth = std::max(depth, -nearest->gap);
    }
  std::erase_if(found, [&](const auto& entry) {
    const Nearest<Dim>& nearest = entry.second;
    return nearest.way == Nearest<Dim>::Way::beside && (nearest.gap >= gap || -nearest.gap > 2 * depth);
  });
  return found;
}

template <int Dim>
std::vector<Penetration<Dim>> Solids<Dim>::penetrations() const {
  std::vector<Penetration<Dim>> found;
  for (std::size_t i = 0; i < solids_.size(); ++i)
    for (std::size_t j = 0; j < solids_.size(); ++j) {
      if (side_of(i, j) == 0) continue;
      Penetration<Dim> penetration{i, j, 0, solids_[i].points[0].at(y_), true};
      for (std::size_t k = 0; k < solids_[i].points.size(); ++k) {
        const auto nearest = find_near(i, k, j, 0);
        if (!nearest) penetration.is_whole = false;
        if (nearest && nearest->way == Nearest<Dim>::Way::out && -nearest->gap > penetration.depth)
          penetration.depth = -nearest->gap, penetration.place = solids_[i].points[k].at(y_);
      }
      if (penetration.depth > 0 || penetration.is_whole) found.push_back(penetration);
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
      for (std::size_t k = 0; k < solids_[i].points.size(); ++k) {
        const Vec<Dim> p = solids_[i].points[k].at(y_);
        if (!solids_[i].is_flat && box.contains(p) && find_nearest(i, k, j).gap < -kTouching * (box.max - box.min).norm())
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
