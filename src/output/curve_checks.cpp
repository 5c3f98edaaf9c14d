// SPDX-License-Identifier: MIT
#include "curve_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "fem/chords.hpp"

namespace itr::output {

namespace {

template <int Dim>
bool is_nearer(const Vec<Dim>& a, const Vec<Dim>& b, const FrameSurface<Dim>& surface, int primitive, double distance) {
  std::array<Vec<Dim>, Dim> corners;
  for (int k = 0; k < Dim; ++k) corners[k] = surface.x[facets_of(surface)[primitive][k]];
  return simplex_distance_squared<Dim>(std::array{a, b}, corners) < distance * distance;
}

template <int Dim>
Box<Dim> box_of(const QuadraticPatch<Dim>& patch) {
  Box<Dim> box;
  for (const auto& row : patch.at)
    for (const Vec<Dim>& p : row) box.include(p);
  return box;
}

/// Finds the curved patches in the boxes of whose control points a point is.
template <int Dim>
class CurveTree {
 public:
  explicit CurveTree(const Patches<Dim>& all) {
    std::vector<Box<Dim>> boxes;
    for (std::size_t i = 0; i < all.patches.size(); ++i) {
      if (!all.is_curved[i]) continue;
      patches_.push_back(static_cast<int>(i));
      boxes.push_back(box_of(all.patches[i]));
    }
    tree_.build(boxes);
  }
  /// Numbers in Patches, ascending.
  std::vector<int> around(const Vec<Dim>& p) const {
    std::vector<int> hits;
    tree_.query({p, p}, hits);
    for (int& hit : hits) hit = patches_[hit];
    std::sort(hits.begin(), hits.end());
    return hits;
  }

 private:
  std::vector<int> patches_;
  Bvh<Dim> tree_;
};

/// Calls visit(vertex, curve, is_hollow) for vertices between a curve and its chords, where neither is crossed. `is_hollow`:
/// the curve lies on the body's side of the chord.
template <typename Visit>
void for_each_beyond_chord(const FrameSurface<2>& surface, const Patches<2>& all, const Visit& visit) {
  for (std::size_t i = 0; i < all.patches.size(); ++i) {
    if (!all.is_curved[i]) continue;
    const Box<2> box = box_of(all.patches[i]);
    const auto halves = parts_of(all.patches[i]);
    for (std::size_t j = 0; j < all.facets.size(); ++j) {
      const auto& other = all.facets[j];
      const Vec<2>& p = surface.x[other[0]];
      if ((p.array() < box.min.array()).any() || (p.array() > box.max.array()).any()) continue;
      const bool has_points = surface.is_obstacle(other) && other[0] != other[1];  // ends are tested as points
      if (has_points || num_shared(all.facets[i], other) > 0 || surface.closed.exclude<2>(all.facets[i], other)) continue;
      for (const auto& half : halves)
        if (is_beyond_chord(half, p)) visit(other[0], i, orientation(half.at[0][0], half.at[1][1], half.at[0][1]) > 0);
    }
  }
}

/// Solid angle of a triangle seen from p (van Oosterom & Strackee 1983).
double solid_angle(const Vec<3>& p, Vec<3> a, Vec<3> b, Vec<3> c) {
  a -= p, b -= p, c -= p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

/// Whether control points, of a patch that leaves its flat simplex by up to `bulge`, are so far from p that this simplex has
/// its solid angle.
template <typename Points>
bool is_flat_from(const Vec<3>& p, const Points& control, double bulge) {
  constexpr double kAngle = 1e-3;  ///< that the patch may be off by
  Box<3> box;
  for (const Vec<3>& q : control) box.include(q);
  const Vec<3> away = (box.min - p).cwiseMax(p - box.max).cwiseMax(0);
  return bulge * (box.max - box.min).norm() <= kAngle * away.squaredNorm();
}

/// Solid angle of the plane part between a quadratic curve, from a to b with the control point c, and the chord of its ends.
double solid_angle_of_lens(const Vec<3>& p, const Vec<3>& a, const Vec<3>& c, const Vec<3>& b, int depth = 48) {
  if (depth == 0 || is_flat_from(p, std::array{a, c, b}, (c - (a + b) / 2).norm())) return 0;
  const Vec<3> left = (a + c) / 2, right = (c + b) / 2, middle = (left + right) / 2;
  return solid_angle(p, a, middle, b) + solid_angle_of_lens(p, a, left, middle, depth - 1) +
         solid_angle_of_lens(p, middle, right, b, depth - 1);
}

double solid_angle(const Vec<3>& p, const QuadraticPatch<3>& patch, int depth = 48) {
  const auto& at = patch.at;
  double bulge = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < i; ++j) bulge = std::max(bulge, (at[i][j] - (at[i][i] + at[j][j]) / 2).norm());
  if (depth == 0 || is_flat_from(p, std::array{at[0][0], at[1][1], at[2][2], at[0][1], at[1][2], at[0][2]}, bulge))
    return solid_angle(p, at[0][0], at[1][1], at[2][2]);
  double sum = 0;
  for (const auto& part : parts_of(patch)) sum += solid_angle(p, part, depth - 1);
  return sum;
}

/// Solid angle of a patch less those of its chords through the nodes and of the plane parts between both of each edge.
/// Neighbours share these plane parts, with the same bits, so that the sum is what curves wind around p more than chords.
double solid_angle_beyond_chords(const FrameSurface<3>& surface, const std::array<int, 3>& facet,
                                 const QuadraticPatch<3>& patch, const Vec<3>& p) {
  const auto& x = surface.x;
  double angle = solid_angle(p, patch);
  for_each_chord<3>(
      facet, [&](int a, int b) { return surface.node_of(a, b); },
      [&](const std::array<int, 3>& chord) { angle -= solid_angle(p, x[chord[0]], x[chord[1]], x[chord[2]]); });
  for (int k = 0; k < 3; ++k) {
    const bool is_ascending = facet[k] < facet[(k + 1) % 3];
    const int i = is_ascending ? k : (k + 1) % 3, j = is_ascending ? (k + 1) % 3 : k;
    const Vec<3>&a = patch.at[i][i], &c = patch.at[i][j], &b = patch.at[j][j];
    const Vec<3> left = (a + c) / 2, right = (c + b) / 2, middle = (left + right) / 2;
    const double of_edge = solid_angle_of_lens(p, a, left, middle) + solid_angle_of_lens(p, middle, right, b);
    angle -= is_ascending ? of_edge : -of_edge;
  }
  return angle;
}

/// Calls visit(vertex) for obstacles' vertices that curves have on another side than their chords through the nodes.
template <typename Visit>
void for_each_beyond_chord(const FrameSurface<3>& surface, const Patches<3>& all, const Visit& visit) {
  const CurveTree<3> tree(all);
  for (int v = surface.num_body_vertices; v < static_cast<int>(surface.x.size()); ++v) {
    double angle = 0;
    for (const int i : tree.around(surface.x[v]))
      angle += solid_angle_beyond_chords(surface, all.facets[i], all.patches[i], surface.x[v]);
    if (std::lround(angle / (4 * std::numbers::pi)) % 2 != 0) visit(v);
  }
}

}  // namespace

template <int Dim>
Patches<Dim> true_surface(const FrameSurface<Dim>& surface) {
  Patches<Dim> result;
  const auto& x = surface.x;
  const auto add = [&](const std::array<int, Dim>& facet) {
    bool is_curved = false;
    std::array<Vec<Dim>, Dim> corners;
    for (int k = 0; k < Dim; ++k) corners[k] = x[facet[k]];
    result.patches.push_back(quadratic_patch<Dim>(corners, [&](int i, int j) -> Vec<Dim> {
      const int node = surface.is_obstacle(facet) ? kNone : surface.node_of(facet[i], facet[j]);
      is_curved = is_curved || node != kNone;
      return node != kNone ? x[node] : Vec<Dim>((corners[i] + corners[j]) / 2);
    }));
    result.facets.push_back(facet);
    result.is_curved.push_back(is_curved);
  };
  for (const auto& facet : surface.boundary) add(facet);
  for (const auto& facet : facets_of(surface))
    if (surface.is_obstacle(facet)) add(facet);
  if constexpr (Dim == 3)
    for (const auto& [a, b] : surface.edges)
      if (surface.is_obstacle(std::array{a, b})) add({a, b, b});
  for (int v = surface.num_body_vertices; v < static_cast<int>(x.size()); ++v) {
    std::array<int, Dim> point;
    point.fill(v);
    add(point);
  }
  return result;
}

template <int Dim>
std::vector<char> find_doubtful(const FrameSurface<Dim>& surface, const Patches<Dim>& all,
                                const ClosedSurface<Dim>& closed) {
  std::vector<char> doubtful(surface.x.size(), 0);
  const CurveTree<Dim> tree(all);
  for (int v = 0; v < static_cast<int>(doubtful.size()); ++v)
    doubtful[v] = closed.is_vertex(v) && std::ranges::any_of(tree.around(surface.x[v]), [&](int i) {
                    return closed.part_of(all.facets[i][0]) != closed.part_of(v);
                  });
  return doubtful;
}

template <int Dim>
std::set<int> find_beyond_chords(const FrameSurface<Dim>& surface, const Patches<Dim>& all) {
  std::set<int> found;
  if constexpr (Dim == 2)
    for_each_beyond_chord(surface, all, [&](int vertex, std::size_t, bool is_hollow) {
      if (is_hollow) found.insert(vertex);
    });
  else
    for_each_beyond_chord(surface, all, [&](int vertex) { found.insert(vertex); });
  return found;
}

template <int Dim>
void check_curves(const FrameSurface<Dim>& surface, const Patches<Dim>& all, const std::string& name,
                  std::vector<Violation>& violations) {
  std::vector<Box<Dim>> boxes(all.patches.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i] = box_of(all.patches[i]);
  const Bvh<Dim> tree(boxes);
  std::vector<int> hits;
  for (int i = 0; i < static_cast<int>(boxes.size()); ++i) {
    if (!all.is_curved[i]) continue;
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      if ((all.is_curved[j] && j <= i) || num_shared(all.facets[i], all.facets[j]) > 0) continue;
      if (surface.closed.template exclude<Dim>(all.facets[i], all.facets[j])) continue;  // their chords are checked
      if (!are_apart(all.patches[i], all.patches[j]))
        violations.push_back(
            {Violation::Of::surfaces, fmt::format("{}: curve {} is not proven to be apart from {}", name,
                                                  surface.name(all.facets[i]), surface.name(all.facets[j]))});
    }
  }
  if constexpr (Dim == 2)
    for_each_beyond_chord(surface, all, [&](int vertex, std::size_t curve, bool is_hollow) {
      if (!is_hollow)
        violations.push_back(
            {Violation::Of::surfaces, fmt::format("{}: vertex ({}) is between curve {} and its chords", name,
                                                  surface.name(vertex), surface.name(all.facets[curve]))});
    });
}

template <int Dim>
void measure_overhangs(const FrameSurface<Dim>& surface, Certificate& certificate) {
  if (surface.curved.empty()) return;  // as with a proxy
  const auto& primitives = facets_of(surface);
  const Bvh<Dim> tree(boxes_of<Dim>(surface.x, primitives));
  const auto& x = surface.x;
  std::vector<int> hits;
  for (const auto& facet : surface.boundary)
    for (int k = 0; k < (Dim == 2 ? 1 : 3); ++k) {
      const int a = facet[k], b = facet[(k + 1) % Dim], node = surface.node_of(a, b);
      if (node == kNone) continue;
      std::array<Vec<Dim>, Dim> corners;
      for (int i = 0; i < Dim; ++i) corners[i] = x[facet[i]];
      const double height = distance_from_chords<Dim>(corners, k, (k + 1) % Dim, x[node]);
      certificate.overhang = std::max(certificate.overhang, height);
      if (height <= certificate.blocked_overhang) continue;
      Box<Dim> box;
      for (const int v : {a, b, node}) box.include(x[v]);
      hits.clear();
      tree.query(box.inflated(height), hits);
      std::vector<int> around;
      for (const int i : hits)
        if (num_shared(primitives[i], std::array{a, b, node}) > 0)
          around.insert(around.end(), primitives[i].begin(), primitives[i].end());
      const auto is_around = [&](int v) { return std::find(around.begin(), around.end(), v) != around.end(); };
      if (std::any_of(hits.begin(), hits.end(), [&](int i) {
            return std::none_of(primitives[i].begin(), primitives[i].end(), is_around) &&
                   (is_nearer(x[a], x[node], surface, i, height) || is_nearer(x[node], x[b], surface, i, height));
          }))
        certificate.blocked_overhang = height;
    }
}

#define ITR_INSTANTIATE(Dim)                                                                                              \
  template Patches<Dim> true_surface(const FrameSurface<Dim>&);                                                           \
  template std::vector<char> find_doubtful(const FrameSurface<Dim>&, const Patches<Dim>&, const ClosedSurface<Dim>&);     \
  template std::set<int> find_beyond_chords(const FrameSurface<Dim>&, const Patches<Dim>&);                               \
  template void check_curves(const FrameSurface<Dim>&, const Patches<Dim>&, const std::string&, std::vector<Violation>&); \
  template void measure_overhangs(const FrameSurface<Dim>&, Certificate&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::output
