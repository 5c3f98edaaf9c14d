// SPDX-License-Identifier: MIT
#include "geometry/ccd.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/distance.hpp"

namespace itr {

namespace {

constexpr double kCloseEnough = 0.1;     ///< of the gap: nearer to it than this, the contact is reached
constexpr double kSafe = 0.9;            ///< part of what is safe that a step covers
constexpr int kPassingIterations = 100;  ///< what takes longer to pass by counts as a collision
constexpr double kLeastGap = 1e-14;      ///< of the largest coordinate: nearer than this, round-off could decide
constexpr int kMostHalvings = 6;         ///< of the time left, when pairs are asked whether they stay apart over it
constexpr double kRoundOff = 1e-15;      ///< of places by the largest coordinate, of rates by the speed
constexpr double kProductRoundOff = 64 * std::numeric_limits<double>::epsilon();  ///< of areas and volumes

/// Two convex primitives that move: of `first` vertices and the rest.
template <int Dim>
struct MovingPair {
  PairKind kind;
  std::array<Vec<Dim>, 4> start{}, motion{};
  int first() const { return kind == PairKind::edge_edge ? 2 : 1; }
  std::array<Vec<Dim>, 4> at(double t) const {
    std::array<Vec<Dim>, 4> x{};
    for (int k = 0; k < pair_size(kind); ++k) x[k] = start[k] + t * motion[k];
    return x;
  }
  /// From the second primitive's closest point to the first's.
  Vec<Dim> separation(const std::array<Vec<Dim>, 4>& x) const {
    const ClosestFeatures features = closest_features<Dim>(kind, x.data());
    std::array<Vec<Dim>, 4> closest{};
    bool from_second = features.kind == PairKind::vertex_vertex || features.kind == PairKind::edge_vertex;
    for (int k = 0; k < pair_size(features.kind); ++k) closest[k] = x[features.local[k]];
    from_second = from_second && features.local[0] >= first();
    const Vec<Dim> separation = pair_distance<Dim>(features.kind, closest.data()).separation;
    return from_second ? Vec<Dim>(-separation) : separation;
  }
  /// Bounds the rate at which the distance can fall.
  double speed() const {
    double fastest[2] = {0, 0};
    for (int k = 0; k < pair_size(kind); ++k) fastest[k < first()] = std::max(fastest[k < first()], motion[k].squaredNorm());
    return std::sqrt(fastest[0]) + std::sqrt(fastest[1]);
  }
  /// Subtracts the common motion, which brings no two points nearer.
  void subtract_mean() {
    Vec<Dim> mean = Vec<Dim>::Zero();
    for (int k = 0; k < pair_size(kind); ++k) mean += motion[k] / pair_size(kind);
    for (int k = 0; k < pair_size(kind); ++k) motion[k] -= mean;
  }
  double farthest_start() const {
    double farthest = 0;
    for (int k = 0; k < pair_size(kind); ++k) farthest = std::max(farthest, start[k].cwiseAbs().maxCoeff());
    return farthest;
  }
};

struct Sizes {
  double speed;     ///< bounds the rate at which the distance can fall
  double farthest;  ///< of all coordinates on the way
};

/// Along a direction: how far the primitives are apart now, and how long that stays above `gap`; less than round-off allows.
struct AlongDirection {
  double apart = std::numeric_limits<double>::infinity(), safe_time = apart;
};
template <int Dim>
AlongDirection along(const MovingPair<Dim>& pair, const std::array<Vec<Dim>, 4>& x, const Vec<Dim>& direction, double gap,
                     const Sizes& sizes) {
  std::array<double, 4> place, rate;
  const int size = pair_size(pair.kind), first = pair.first();
  for (int k = 0; k < size; ++k) {
    place[k] = direction.dot(x[k]);
    rate[k] = direction.dot(pair.motion[k]);
  }
  AlongDirection result;
  for (int i = 0; i < first; ++i)
    for (int j = first; j < size; ++j) {
      const double apart = place[i] - place[j] - kRoundOff * sizes.farthest;
      const double closing = rate[j] - rate[i] + kRoundOff * sizes.speed;
      result.apart = std::min(result.apart, apart);
      if (closing > 0) result.safe_time = std::min(result.safe_time, (apart - gap) / closing);
    }
  return result;
}

/// A vector between two points of a pair.
template <int Dim>
struct MovingVector {
  MovingVector(const MovingPair<Dim>& pair, int from, int to)
      : start(pair.start[to] - pair.start[from]),
        motion(pair.motion[to] - pair.motion[from]),
        longest(start.norm() + motion.norm()) {}
  Vec<Dim> operator()(double t) const { return start + t * motion; }
  Vec<Dim> start, motion;
  double longest;  ///< bound of its length, which its round-off is relative to
};

/// Whether all coefficients of a polynomial in Bernstein's form, and so its values, are beyond `least` on one side of 0.
template <std::size_t N>
bool keeps_sign(const std::array<double, N>& coefficients, double least) {
  const auto [low, high] = std::minmax_element(coefficients.begin(), coefficients.end());
  return *low > least || *high < -least;
}

/// Whether the line through the edge stays `gap` from the vertex over [t, s], by the area that they span.
bool stays_apart(const MovingPair<2>& pair, double t, double s, double gap) {
  const auto cross = [](const Vec<2>& a, const Vec<2>& b) { return a[0] * b[1] - a[1] * b[0]; };
  const MovingVector<2> e(pair, 1, 2), r(pair, 1, 0);
  const Vec<2> e0 = e(t), e1 = e(s), r0 = r(t), r1 = r(s);
  const std::array<double, 3> area{cross(e0, r0), (cross(e0, r1) + cross(e1, r0)) / 2, cross(e1, r1)};
  const double length = std::sqrt(std::max(e0.squaredNorm(), e1.squaredNorm()));
  return keeps_sign(area, length * gap + kProductRoundOff * e.longest * r.longest);
}

/// Whether the plane through the face stays `gap` from the vertex over [t, s], or that along one edge from the other edge,
/// by the volume (u x v) . w that they span.
bool stays_apart(const MovingPair<3>& pair, double t, double s, double gap) {
  if (pair.kind == PairKind::edge_vertex) return false;
  const bool is_face = pair.kind == PairKind::face_vertex;
  const MovingVector<3> u = is_face ? MovingVector<3>(pair, 1, 2) : MovingVector<3>(pair, 0, 1);
  const MovingVector<3> v = is_face ? MovingVector<3>(pair, 1, 3) : MovingVector<3>(pair, 2, 3);
  const MovingVector<3> w = is_face ? MovingVector<3>(pair, 1, 0) : MovingVector<3>(pair, 0, 2);
  const Vec<3> u0 = u(t), u1 = u(s), v0 = v(t), v1 = v(s), w0 = w(t), w1 = w(s);
  const std::array<Vec<3>, 3> normal{u0.cross(v0), (u0.cross(v1) + u1.cross(v0)) / 2, u1.cross(v1)};
  const std::array<double, 4> volume{normal[0].dot(w0), (normal[0].dot(w1) + 2 * normal[1].dot(w0)) / 3,
                                     (2 * normal[1].dot(w1) + normal[2].dot(w0)) / 3, normal[2].dot(w1)};
  const double area = std::sqrt(std::max({normal[0].squaredNorm(), normal[1].squaredNorm(), normal[2].squaredNorm()}));
  return keeps_sign(volume, area * gap + kProductRoundOff * u.longest * v.longest * w.longest);
}

/// The longest of the intervals [t, 1], [t, (1 + t) / 2], ... over which the pair stays apart by its lines or planes; 0
/// where they are no longer than `least`.
template <int Dim>
double time_apart(const MovingPair<Dim>& pair, double gap, double t, double& reach, double least) {
  double interval = std::min(1 - t, reach), found = 0;
  for (int k = 0; k < kMostHalvings && found == 0 && interval > least; ++k, interval /= 2)
    if (stays_apart(pair, t, t + interval, gap)) found = interval;
  reach = 8 * interval;
  return found;
}

/// Conservative advancement: each step covers nine tenths of the time for which the primitives stay apart along the
/// direction in which they are nearest (Mirtich 1996), and, `by_speed`, no less of what their speed allows. What they are
/// apart along a line is never more than their distance, whatever the line: without `by_speed` round-off in distances, which
/// is large where primitives are slivers, misses nothing. `t` goes on from where the distance is above `gap` to where it
/// hardly is, or to 1 where it stays above. Pairs that slide and turn at a small gap would creep: there a longer step is one
/// over which their lines or planes stay apart. In 2D only `by_speed`: there it finds few more pairs
/// that pass.
template <int Dim>
double advance(const MovingPair<Dim>& pair, const Sizes& sizes, double gap, bool by_speed, double t, int iterations) {
  double step = 0, reach = 1;
  for (int i = 0; i < iterations; ++i) {
    const auto x = pair.at(t);
    const Vec<Dim> separation = pair.separation(x);
    const double now = separation.norm();
    if (!(now > gap)) return std::max(0.0, t - step);
    if (i > 0 && now - gap < kCloseEnough * gap) return t;
    const AlongDirection free = along<Dim>(pair, x, separation / now, gap, sizes);
    if (!(free.apart > gap) && !by_speed) return t;
    step = kSafe * std::max(by_speed ? (now - gap) / sizes.speed : 0.0, free.apart > gap ? free.safe_time : 0.0);
    if (t + step >= 1) return 1;
    if (by_speed || Dim == 3) step = std::max(step, time_apart(pair, gap + kRoundOff * sizes.farthest, t, reach, 2 * step));
    t += step;
    if (t >= 1) return 1;
  }
  return t;
}

/// Whether primitives that are so near that round-off could decide move apart, or together, along their separation.
template <int Dim>
bool keeps_apart(const MovingPair<Dim>& pair, const Sizes& sizes) {
  const Vec<Dim> direction = pair.separation(pair.start).normalized();
  const double before = along<Dim>(pair, pair.start, direction, 0, sizes).apart;
  return before > 0 && along<Dim>(pair, pair.at(1), direction, 0, sizes).apart >= before;
}

/// Counts a pair that passes by as free only where the whole way is; elsewhere it stops where `min_separation_ratio` says.
template <int Dim>
double ccd(MovingPair<Dim> pair, const CcdOptions& options) {
  pair.subtract_mean();
  const double start = std::sqrt(pair_distance_squared<Dim>(pair.kind, pair.start.data()));
  if (!(start > 0)) return 0;
  const double speed = pair.speed();
  if (speed == 0) return 1;
  const double farthest = pair.farthest_start();
  const Sizes sizes{speed, speed + farthest};
  const double least_gap = kLeastGap * farthest;
  if (start <= least_gap) return keeps_apart(pair, sizes) ? 1 : 0;
  const double gap = std::max(options.min_separation_ratio * start, least_gap);
  if (start - gap > speed) return 1;
  const double t = advance(pair, sizes, gap, true, 0, options.max_iterations);
  const double passing = std::max(options.passing_ratio * start, kLeastGap * sizes.farthest);
  const bool passes = t < 1 && passing < gap && advance(pair, sizes, passing, false, t, kPassingIterations) == 1;
  return passes ? 1 : t;
}

}  // namespace

template <int Dim>
double point_edge_ccd(const Vec<Dim>& p0, const Vec<Dim>& a0, const Vec<Dim>& b0, const Vec<Dim>& p1, const Vec<Dim>& a1,
                      const Vec<Dim>& b1, const CcdOptions& options) {
  return ccd<Dim>({PairKind::edge_vertex, {p0, a0, b0}, {p1 - p0, a1 - a0, b1 - b0}}, options);
}

double edge_edge_ccd(const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& d0, const Vec<3>& a1,
                     const Vec<3>& b1, const Vec<3>& c1, const Vec<3>& d1, const CcdOptions& options) {
  return ccd<3>({PairKind::edge_edge, {a0, b0, c0, d0}, {a1 - a0, b1 - b0, c1 - c0, d1 - d0}}, options);
}

double point_triangle_ccd(const Vec<3>& p0, const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& p1,
                          const Vec<3>& a1, const Vec<3>& b1, const Vec<3>& c1, const CcdOptions& options) {
  return ccd<3>({PairKind::face_vertex, {p0, a0, b0, c0}, {p1 - p0, a1 - a0, b1 - b0, c1 - c0}}, options);
}

template double point_edge_ccd<2>(const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&,
                                  const CcdOptions&);
template double point_edge_ccd<3>(const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&,
                                  const CcdOptions&);

}  // namespace itr
