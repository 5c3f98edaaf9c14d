// SPDX-License-Identifier: MIT
#include "geometry/closed_surface.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <utility>

#include "core/connected_parts.hpp"
#include "geometry/measures.hpp"
#include "geometry/predicates.hpp"

namespace itr {

namespace {

/// Sign with which the edge a b crosses the ray from p along +y: their sum over a counter-clockwise polygon is 1 inside. A
/// point below an end is taken to be right of it.
int crossing(const Vec<2>& p, const Vec<2>& a, const Vec<2>& b) {
  const bool right = a[0] <= p[0] && p[0] < b[0], left = b[0] <= p[0] && p[0] < a[0];
  if (!right && !left) return 0;
  const int side = orientation(a, b, p);
  return right ? (side < 0 ? -1 : 0) : (side > 0 ? 1 : 0);
}

/// Counts the crossing of a triangle with the ray along +z: its shadow winds around that of p, and p is below.
int crossing(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const Vec<2> q = p.head<2>(), u = a.head<2>(), v = b.head<2>(), w = c.head<2>();
  const int turns = crossing(q, u, v) + crossing(q, v, w) + crossing(q, w, u);
  return turns != 0 && turns * orientation(a, b, c, p) < 0 ? turns : 0;
}

int crossing(const Vec<2>& p, std::span<const Vec<2>> x, const std::array<int, 2>& f) {
  return crossing(p, x[f[0]], x[f[1]]);
}
int crossing(const Vec<3>& p, std::span<const Vec<3>> x, const std::array<int, 3>& f) {
  return crossing(p, x[f[0]], x[f[1]], x[f[2]]);
}

bool holds(std::span<const Vec<2>> x, const std::array<int, 2>& f, const Vec<2>& p) {
  return segment_contains(x[f[0]], x[f[1]], p);
}
bool holds(std::span<const Vec<3>> x, const std::array<int, 3>& f, const Vec<3>& p) {
  return triangle_contains(x[f[0]], x[f[1]], x[f[2]], p);
}

/// Vertices that an odd number of edges has; vertices of edges that an odd number of triangles has.
std::vector<int> open_vertices(std::span<const std::array<int, 2>> facets) {
  std::vector<int> ends, open;
  for (const auto& f : facets) ends.insert(ends.end(), f.begin(), f.end());
  std::sort(ends.begin(), ends.end());
  for (std::size_t i = 0, j = 0; i < ends.size(); i = j) {
    while (j < ends.size() && ends[j] == ends[i]) ++j;
    if ((j - i) % 2 == 1) open.push_back(ends[i]);
  }
  return open;
}
std::vector<int> open_vertices(std::span<const std::array<int, 3>> facets) {
  std::vector<std::array<int, 2>> edges;
  std::vector<int> open;
  for (const auto& f : facets)
    for (int k = 0; k < 3; ++k) edges.push_back({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0, j = 0; i < edges.size(); i = j) {
    while (j < edges.size() && edges[j] == edges[i]) ++j;
    if ((j - i) % 2 == 1) open.push_back(edges[i][0]);
  }
  return open;
}

}  // namespace

template <int Dim>
ClosedSurface<Dim>::ClosedSurface(std::vector<Vec<Dim>> x, std::span<const Facet> facets)
    : x_(std::move(x)), part_(x_.size(), kNone) {
  const std::vector<int> connected = connected_parts<Dim>(x_.size(), facets);
  std::vector<char> is_open(x_.size(), 0);
  for (const int v : open_vertices(facets)) is_open[connected[v]] = 1;
  std::vector<int> number(x_.size(), kNone);
  std::vector<Box<Dim>> boxes;
  for (const Facet& f : facets) {
    const int r = connected[f[0]];
    if (is_open[r]) continue;
    if (number[r] == kNone) {
      number[r] = static_cast<int>(first_.size());
      first_.push_back(f[0]);
    }
    facets_.push_back(f);
    boxes.emplace_back();
    for (const int v : f) {
      part_[v] = number[r];
      boxes.back().include(x_[v]);
    }
  }
  tree_.build(boxes);
}

template <int Dim>
int ClosedSurface<Dim>::winding(const Vec<Dim>& p, int left_out) const {
  Box<Dim> ray{p, p};
  ray.max[Dim - 1] = std::numeric_limits<double>::infinity();
  std::vector<int> hits;
  tree_.query(ray, hits);
  int sum = 0;
  for (const int f : hits)
    if (part_[facets_[f][0]] != left_out) sum += crossing(p, x_, facets_[f]);
  return sum;
}

template <int Dim>
bool ClosedSurface<Dim>::touches(const Vec<Dim>& p) const {
  std::vector<int> hits;
  tree_.query({p, p}, hits);
  return std::any_of(hits.begin(), hits.end(), [&](int f) { return holds(x_, facets_[f], p); });
}

template <int Dim>
std::vector<int> ClosedSurface<Dim>::nested(const std::vector<char>& doubtful) const {
  std::vector<double> volume(first_.size(), 0);  // times d!, of the sign of the orientation
  for (const Facet& f : facets_) {
    const int part = part_[f[0]];
    Mat<Dim> corners;
    for (int k = 0; k < Dim; ++k) corners.col(k) = x_[f[k]] - x_[first_[part]];
    volume[part] += corners.determinant();
  }
  std::vector<int> asked = first_, found;
  for (int v = static_cast<int>(doubtful.size()) - 1; v >= 0; --v)
    if (part_[v] != kNone && doubtful[v] == 0) asked[part_[v]] = v;
  for (std::size_t part = 0; part < asked.size(); ++part) {
    const int around = winding(x_[asked[part]], static_cast<int>(part));
    if (around * volume[part] > 0) found.push_back(asked[part]);
  }
  return found;
}

/// Looks behind points of each facet: where the surface winds around these twice, another body is there, too. How far that
/// goes on is the depth.
template <int Dim>
Overlap<Dim> ClosedSurface<Dim>::find_overlap(const ClosedFaces& closed, const std::vector<char>& left_out) const {
  constexpr int kMostDoublings = 64, kHalvings = 12;
  constexpr double kToCenter = 0.25;
  Overlap<Dim> deepest;
  for (const Facet& f : facets_) {
    if (!left_out.empty() && std::ranges::any_of(f, [&](int v) { return left_out[v] != 0; })) continue;
    std::array<Vec<Dim>, Dim> corners;
    Vec<Dim> center = Vec<Dim>::Zero();
    for (int k = 0; k < Dim; ++k) center += (corners[k] = x_[f[k]]) / Dim;
    const Vec<Dim> inward = inward_normal(corners).normalized();
    for (const Vec<Dim>& corner : corners) {
      const Vec<Dim> place = corner + kToCenter * (center - corner);
      const auto is_inside = [&](double depth) { return winding(place + depth * inward) > 1; };
      double inside = 1e3 * closed.coincident;
      if (!is_inside(inside)) continue;
      if (!closed.has_any(f)) return {std::numeric_limits<double>::infinity(), place};
      double outside = 2 * inside;
      for (int k = 0; k < kMostDoublings && is_inside(outside); ++k) outside *= 2;
      for (int k = 0; k < kHalvings; ++k) {
        const double middle = (std::max(inside, outside / 2) + outside) / 2;
        (is_inside(middle) ? inside : outside) = middle;
      }
      if (outside > deepest.depth) deepest = {outside, place};
    }
  }
  return deepest;
}

template class ClosedSurface<2>;
template class ClosedSurface<3>;

}  // namespace itr
