// SPDX-License-Identifier: MIT
#include "itr/geometry/ccd.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "itr/geometry/distance.hpp"

namespace itr {

namespace {

constexpr double kCloseEnough = 0.1;  ///< of the gap: nearer to it than this, the contact is reached

/// Additive advancement. `distance(t)` is the distance of the primitives at time t; `speed` bounds the rate at which it can
/// fall. Each step covers nine tenths of what is safe, so t converges geometrically to a contact and never passes it.
template <typename Distance>
double advance(const Distance& distance, double speed, const CcdOptions& options) {
  const double start = distance(0.0);
  if (!(start > 0)) return 0;
  if (speed == 0) return 1;
  const double gap = options.min_separation_ratio * start;
  if (start - gap > speed) return 1;
  double t = 0, now = start;
  for (int i = 0; i < options.max_iterations; ++i) {
    const double step = 0.9 * (now - gap) / speed;
    if (i > 0 && now - gap < kCloseEnough * gap) break;
    t += step;
    if (t >= 1) return 1;
    now = distance(t);
    if (now <= gap) return std::max(0.0, t - step);
  }
  return t;
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
  return advance(
      [&](double t) { return std::sqrt(point_edge_distance_squared<Dim>(p0 + t * d[0], a0 + t * d[1], b0 + t * d[2])); },
      speed, options);
}

double edge_edge_ccd(const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& d0, const Vec<3>& a1,
                     const Vec<3>& b1, const Vec<3>& c1, const Vec<3>& d1, const CcdOptions& options) {
  std::array<Vec<3>, 4> d{a1 - a0, b1 - b0, c1 - c0, d1 - d0};
  subtract_mean<3>(d);
  const double speed = std::max(d[0].norm(), d[1].norm()) + std::max(d[2].norm(), d[3].norm());
  return advance(
      [&](double t) {
        return std::sqrt(edge_edge_distance_squared(a0 + t * d[0], b0 + t * d[1], c0 + t * d[2], d0 + t * d[3]));
      },
      speed, options);
}

double point_triangle_ccd(const Vec<3>& p0, const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& p1,
                          const Vec<3>& a1, const Vec<3>& b1, const Vec<3>& c1, const CcdOptions& options) {
  std::array<Vec<3>, 4> d{p1 - p0, a1 - a0, b1 - b0, c1 - c0};
  subtract_mean<3>(d);
  const double speed = d[0].norm() + std::max({d[1].norm(), d[2].norm(), d[3].norm()});
  return advance(
      [&](double t) {
        return std::sqrt(point_triangle_distance_squared(p0 + t * d[0], a0 + t * d[1], b0 + t * d[2], c0 + t * d[3]));
      },
      speed, options);
}

template double point_edge_ccd<2>(const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&, const Vec<2>&,
                                  const CcdOptions&);
template double point_edge_ccd<3>(const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&, const Vec<3>&,
                                  const CcdOptions&);

}  // namespace itr
