// SPDX-License-Identifier: MIT
#include "itr/geometry/ccd.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "itr/geometry/distance.hpp"

namespace itr {

namespace {

constexpr double kCloseEnough = 0.1;  ///< of the gap: nearer to it than this, the contact is reached
constexpr int kMostHalvings = 6;      ///< of the interval that is asked about, before time moves on

/// Additive advancement. `distance(t)` is the distance of the primitives at time t; `speed` bounds the rate at which it can
/// fall; `stays_apart(t, s, gap)` may say that the lines or planes of the primitives stay `gap` apart from t to t + s. Pairs
/// that slide along each other at a small gap go far by the latter where the former creeps.
template <typename Distance, typename StaysApart>
double advance(const Distance& distance, const StaysApart& stays_apart, double speed, const CcdOptions& options) {
  const double start = distance(0.0);
  if (!(start > 0)) return 0;
  if (speed == 0) return 1;
  const double gap = options.min_separation_ratio * start;
  if (start - gap > speed) return 1;
  double t = 0, now = start, reach = 1;
  for (int i = 0; i < options.max_iterations; ++i) {
    double step = 0.9 * (now - gap) / speed;
    if (i > 0 && now - gap < kCloseEnough * gap) break;
    if (t + step >= 1) return 1;
    double longer = std::min(1 - t, reach);
    for (int k = 0; k < kMostHalvings && longer > 2 * step; ++k, longer /= 2)
      if (stays_apart(t, longer, gap)) {
        if (longer == 1 - t) return 1;
        step = longer;
        break;
      }
    reach = 4 * longer;
    t += step;
    if (t >= 1) return 1;
    now = distance(t);
    if (now <= gap) return std::max(0.0, t - step);
  }
  return t;
}

constexpr double kRoundOff = 64 * std::numeric_limits<double>::epsilon();

/// A vector between two points that move.
template <int Dim>
struct MovingVector {
  MovingVector(const Vec<Dim>& from, const Vec<Dim>& motion_from, const Vec<Dim>& to, const Vec<Dim>& motion_to)
      : start(to - from), motion(motion_to - motion_from), longest(start.norm() + motion.norm()) {}
  Vec<Dim> operator()(double t) const { return start + t * motion; }
  Vec<Dim> start, motion;
  double longest;  ///< a bound of its length, and what its round-off is relative to
};

/// Whether the line along the edge e and the point to which r leads from it stay `gap` apart from time t to t + s: by the
/// Bernstein coefficients of their cross product.
bool line_stays_apart(const MovingVector<2>& e, const MovingVector<2>& r, double t, double s, double gap) {
  const auto cross = [](const Vec<2>& a, const Vec<2>& b) { return a[0] * b[1] - a[1] * b[0]; };
  const Vec<2> e0 = e(t), e1 = e(t + s), r0 = r(t), r1 = r(t + s);
  const std::array<double, 3> area{cross(e0, r0), (cross(e0, r1) + cross(e1, r0)) / 2, cross(e1, r1)};
  const double length = std::sqrt(std::max(e0.squaredNorm(), e1.squaredNorm()));
  const double least = length * gap + kRoundOff * e.longest * r.longest;
  return std::min({area[0], area[1], area[2]}) > least || std::max({area[0], area[1], area[2]}) < -least;
}

/// Whether the plane along u and v and a point, or the lines along u and v, stay `gap` apart; w leads from one to the other.
/// By the Bernstein coefficients of their volume (u x v) . w.
bool plane_stays_apart(const MovingVector<3>& u, const MovingVector<3>& v, const MovingVector<3>& w, double t, double s,
                       double gap) {
  const Vec<3> u0 = u(t), u1 = u(t + s), v0 = v(t), v1 = v(t + s), w0 = w(t), w1 = w(t + s);
  const std::array<Vec<3>, 3> normal{u0.cross(v0), (u0.cross(v1) + u1.cross(v0)) / 2, u1.cross(v1)};
  const std::array<double, 4> volume{normal[0].dot(w0), (normal[0].dot(w1) + 2 * normal[1].dot(w0)) / 3,
                                     (2 * normal[1].dot(w1) + normal[2].dot(w0)) / 3, normal[2].dot(w1)};
  const double area = std::sqrt(std::max({normal[0].squaredNorm(), normal[1].squaredNorm(), normal[2].squaredNorm()}));
  const double least = area * gap + kRoundOff * u.longest * v.longest * w.longest;
  return std::min({volume[0], volume[1], volume[2], volume[3]}) > least ||
         std::max({volume[0], volume[1], volume[2], volume[3]}) < -least;
}

template <int Dim, std::size_t N>
void subtract_mean(std::array<Vec<Dim>, N>& motion) {
  Vec<Dim> mean = Vec<Dim>::Zero();
  for (const auto& m : motion) mean += m;
  mean /= static_cast<double>(N);
  for (auto& m : motion) m -= mean;
}

}  // namespace

template <int Dim>
double point_edge_ccd(const Vec<Dim>& p0, const Vec<Dim>& a0, const Vec<Dim>& b0, const Vec<Dim>& p1, const Vec<Dim>& a1,
                      const Vec<Dim>& b1, const CcdOptions& options) {
  std::array<Vec<Dim>, 3> d{p1 - p0, a1 - a0, b1 - b0};
  subtract_mean<Dim>(d);
  const double speed = d[0].norm() + std::max(d[1].norm(), d[2].norm());
  const MovingVector<Dim> e(a0, d[1], b0, d[2]), r(a0, d[1], p0, d[0]);
  const auto stays_apart = [&](double t, double s, double gap) {
    if constexpr (Dim == 2) return line_stays_apart(e, r, t, s, gap);
    return false;
  };
  return advance(
      [&](double t) { return std::sqrt(point_edge_distance_squared<Dim>(p0 + t * d[0], a0 + t * d[1], b0 + t * d[2])); },
      stays_apart, speed, options);
}

double edge_edge_ccd(const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& d0, const Vec<3>& a1,
                     const Vec<3>& b1, const Vec<3>& c1, const Vec<3>& d1, const CcdOptions& options) {
  std::array<Vec<3>, 4> d{a1 - a0, b1 - b0, c1 - c0, d1 - d0};
  subtract_mean<3>(d);
  const double speed = std::max(d[0].norm(), d[1].norm()) + std::max(d[2].norm(), d[3].norm());
  const MovingVector<3> u(a0, d[0], b0, d[1]), v(c0, d[2], d0, d[3]), w(a0, d[0], c0, d[2]);
  return advance(
      [&](double t) {
        return std::sqrt(edge_edge_distance_squared(a0 + t * d[0], b0 + t * d[1], c0 + t * d[2], d0 + t * d[3]));
      },
      [&](double t, double s, double gap) { return plane_stays_apart(u, v, w, t, s, gap); }, speed, options);
}

double point_triangle_ccd(const Vec<3>& p0, const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& p1,
                          const Vec<3>& a1, const Vec<3>& b1, const Vec<3>& c1, const CcdOptions& options) {
  std::array<Vec<3>, 4> d{p1 - p0, a1 - a0, b1 - b0, c1 - c0};
  subtract_mean<3>(d);
  const double speed = d[0].norm() + std::max({d[1].norm(), d[2].norm(), d[3].norm()});
  const MovingVector<3> u(a0, d[1], b0, d[2]), v(a0, d[1], c0, d[3]), w(a0, d[1], p0, d[0]);
  return advance(
      [&](double t) {
        return std::sqrt(point_triangle_distance_squared(p0 + t * d[0], a0 + t * d[1], b0 + t * d[2], c0 + t * d[3]));
      },
      [&](double t, double s, double gap) { return plane_stays_apart(u, v, w, t, s, gap); }, speed, options);
}

template double point_edge_ccd<2>(const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&,
                                  const CcdOptions&);
template double point_edge_ccd<3>(const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&,
                                  const CcdOptions&);

}  // namespace itr
