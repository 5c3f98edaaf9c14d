// SPDX-License-Identifier: MIT
// Branch and bound. The distance to one facet is convex along another, so its largest value is at a corner: for a piece of a
// facet, the least over a few facets of the largest distance of its corners bounds the distance to the surface from above.
// The distances of corners themselves bound it from below.
#include "surface_distance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"

namespace itr::output {

namespace {

// In 3D every edge of the other surface that runs below a piece asks for smaller ones, down to the tolerance.
template <int Dim>
constexpr double kRelative = Dim == 2 ? 1e-3 : 1e-2;
template <int Dim>
constexpr double kOfExtent = Dim == 2 ? 1e-6 : 1e-3;

template <int Dim>
using Facet = std::array<Vec<Dim>, Dim>;

double distance_to(const Vec<2>& p, const Facet<2>& f) { return std::sqrt(point_edge_distance_squared<2>(p, f[0], f[1])); }
double distance_to(const Vec<3>& p, const Facet<3>& f) {
  return std::sqrt(point_triangle_distance_squared(p, f[0], f[1], f[2]));
}

template <int Dim>
Box<Dim> box_of(const std::vector<Facet<Dim>>& facets) {
  Box<Dim> box;
  for (const auto& facet : facets)
    for (const auto& p : facet) box.include(p);
  return box;
}

template <int Dim>
class Surface {
 public:
  explicit Surface(const std::vector<Facet<Dim>>& facets) : facets_(facets) {
    std::vector<Box<Dim>> boxes(facets.size());
    for (std::size_t f = 0; f < facets.size(); ++f)
      for (const auto& p : facets[f]) boxes[f].include(p);
    tree_.build(boxes);
    const Box<Dim> all = box_of<Dim>(facets);
    first_radius_ = (all.max - all.min).norm() / static_cast<double>(facets.size());
  }

  struct Nearest {
    int facet;
    double distance;
  };
  /// `guess`: a facet that may be near; kNone where none is known.
  Nearest nearest(const Vec<Dim>& p, int guess) {
    // Boxes are searched with some room: round-off loses no facet.
    for (double radius = guess == kNone ? first_radius_ : (1 + 1e-9) * distance_to(p, facets_[guess]) + 1e-9 * first_radius_;
         ; radius *= 2) {
      Box<Dim> box;
      box.include(p);
      hits_.clear();
      tree_.query(box.inflated(radius), hits_);
      Nearest found{kNone, std::numeric_limits<double>::infinity()};
      for (const int f : hits_)
        if (const double d = distance_to(p, facets_[f]); d < found.distance) found = {f, d};
      if (found.distance <= radius) return found;  // nothing outside of the box is nearer
    }
  }
  const Facet<Dim>& facet(int f) const { return facets_[f]; }

 private:
  const std::vector<Facet<Dim>>& facets_;
  Bvh<Dim> tree_;
  double first_radius_;
  std::vector<int> hits_;
};

template <int Dim>
struct Piece {
  double bound;  ///< no point of it is farther from the surface
  Facet<Dim> corners;
  std::array<int, Dim + 1> near;  ///< facets of the surface that are nearest to its corners and its centre
  bool operator<(const Piece& other) const { return bound < other.bound; }
};

/// The largest distance of a point of `from` to the surface.
template <int Dim>
double largest_distance(const std::vector<Facet<Dim>>& from, Surface<Dim>& to, double tolerance) {
  double reached = 0;
  const auto nearest = [&](const Vec<Dim>& p, int guess) {
    const auto found = to.nearest(p, guess);
    reached = std::max(reached, found.distance);
    return found.facet;
  };
  std::priority_queue<Piece<Dim>> queue;
  const auto push = [&](const Facet<Dim>& corners, std::array<int, Dim + 1> near) {
    Vec<Dim> centre = Vec<Dim>::Zero();
    for (const auto& p : corners) centre += p / Dim;
    near[Dim] = nearest(centre, near[0]);
    double bound = std::numeric_limits<double>::infinity();
    for (const int f : near) {
      double largest = 0;
      for (const auto& p : corners) largest = std::max(largest, distance_to(p, to.facet(f)));
      bound = std::min(bound, largest);
    }
    queue.push({bound, corners, near});
  };
  for (const auto& facet : from) {
    std::array<int, Dim + 1> near{};
    for (int k = 0; k < Dim; ++k) near[k] = nearest(facet[k], k == 0 ? kNone : near[0]);
    push(facet, near);
  }
  while (!queue.empty() && queue.top().bound > std::max((1 + kRelative<Dim>)*reached, reached + tolerance)) {
    const Piece<Dim> piece = queue.top();
    queue.pop();
    const auto& corners = piece.corners;
    int a = 0, b = 1;  // the ends of the longest edge
    for (int i = 0; i < Dim; ++i)
      for (int j = i + 1; j < Dim; ++j)
        if ((corners[i] - corners[j]).squaredNorm() > (corners[a] - corners[b]).squaredNorm()) a = i, b = j;
    const Vec<Dim> middle = 0.5 * (corners[a] + corners[b]);
    const int near_middle = nearest(middle, piece.near[Dim]);
    for (const int replaced : {a, b}) {
      Facet<Dim> half = corners;
      std::array<int, Dim + 1> near = piece.near;
      half[replaced] = middle;
      near[replaced] = near_middle;
      push(half, near);
    }
  }
  return reached;
}

}  // namespace

template <int Dim>
double surface_distance(const std::vector<Facet<Dim>>& a, const std::vector<Facet<Dim>>& b) {
  if (a.empty() || b.empty()) return 0;
  Box<Dim> box = box_of<Dim>(a);
  box.include(box_of<Dim>(b));
  const double tolerance = kOfExtent<Dim> * (box.max - box.min).norm();
  Surface<Dim> surface_a(a), surface_b(b);
  return std::max(largest_distance<Dim>(a, surface_b, tolerance), largest_distance<Dim>(b, surface_a, tolerance));
}

template double surface_distance<2>(const std::vector<Facet<2>>&, const std::vector<Facet<2>>&);
template double surface_distance<3>(const std::vector<Facet<3>>&, const std::vector<Facet<3>>&);

}  // namespace itr::output
