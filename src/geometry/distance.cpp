// SPDX-License-Identifier: MIT
#include "itr/geometry/distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace itr {

template <int Dim>
EdgeFeature closest_feature_on_edge(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  const Vec<Dim> e = b - a;
  const double along = e.dot(p - a), length_squared = e.squaredNorm();
  if (!(along > 0)) return EdgeFeature::vertex0;
  return along < length_squared ? EdgeFeature::interior : EdgeFeature::vertex1;
}

template <int Dim>
double point_point_distance_squared(const Vec<Dim>& p, const Vec<Dim>& q) {
  return (p - q).squaredNorm();
}

template <int Dim>
Vec<2 * Dim> point_point_distance_squared_gradient(const Vec<Dim>& p, const Vec<Dim>& q) {
  Vec<2 * Dim> gradient;
  gradient << 2 * (p - q), 2 * (q - p);
  return gradient;
}

template <int Dim>
Mat<2 * Dim> point_point_distance_squared_hessian() {
  Mat<2 * Dim> hessian;
  const Mat<Dim> two = 2 * Mat<Dim>::Identity();
  hessian << two, -two, -two, two;
  return hessian;
}

// With e = b - a, t = e.(p - a) / e.e and r = p - a - t e (the perpendicular), D = r.r. Since r is orthogonal to e, the
// gradient is 2 (r, -(1-t) r, -t r), and the Hessian follows from dr = dp - (1-t) da - t db - e dt with
// dt = (e.(dp - (1-t) da - t db) + r.(db - da)) / e.e.
template <int Dim>
struct Perpendicular {
  Vec<Dim> e, r;
  double t, length_squared;
  Perpendicular(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) : e(b - a), length_squared(e.squaredNorm()) {
    t = e.dot(p - a) / length_squared;
    r = p - a - t * e;
  }
};

template <int Dim>
double point_line_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  if constexpr (Dim == 2) {  // the determinant keeps more digits for points close to the line
    const Vec<2> e = b - a, d = p - a;
    const double cross = e[0] * d[1] - e[1] * d[0];
    return cross * cross / e.squaredNorm();
  } else {
    return (b - a).cross(p - a).squaredNorm() / (b - a).squaredNorm();
  }
}

template <int Dim>
Vec<3 * Dim> point_line_distance_squared_gradient(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  const Perpendicular<Dim> q(p, a, b);
  Vec<3 * Dim> gradient;
  gradient << 2 * q.r, -2 * (1 - q.t) * q.r, -2 * q.t * q.r;
  return gradient;
}

template <int Dim>
Mat<3 * Dim> point_line_distance_squared_hessian(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  const Perpendicular<Dim> q(p, a, b);
  Eigen::Matrix<double, Dim, 3 * Dim> W;  // dp - (1-t) da - t db
  W << Mat<Dim>::Identity(), -(1 - q.t) * Mat<Dim>::Identity(), -q.t * Mat<Dim>::Identity();
  Eigen::Matrix<double, 1, 3 * Dim> dt = q.e.transpose() * W;
  dt.template segment<Dim>(Dim) -= q.r.transpose();
  dt.template segment<Dim>(2 * Dim) += q.r.transpose();
  dt /= q.length_squared;
  const Eigen::Matrix<double, Dim, 3 * Dim> dr = W - q.e * dt;
  Mat<3 * Dim> hessian;
  hessian.template topRows<Dim>() = 2 * dr;
  hessian.template middleRows<Dim>(Dim) = 2 * (q.r * dt - (1 - q.t) * dr);
  hessian.template bottomRows<Dim>() = -2 * (q.r * dt + q.t * dr);
  return 0.5 * (hessian + hessian.transpose());
}

template <int Dim>
double point_edge_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  switch (closest_feature_on_edge<Dim>(p, a, b)) {
    case EdgeFeature::vertex0:
      return (p - a).squaredNorm();
    case EdgeFeature::vertex1:
      return (p - b).squaredNorm();
    case EdgeFeature::interior:
      return point_line_distance_squared<Dim>(p, a, b);
  }
  return 0;
}

double point_triangle_distance_squared(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const Vec<3> normal = (b - a).cross(c - a);
  const double area_squared = normal.squaredNorm();
  if (area_squared > 0) {
    const auto inside = [&](const Vec<3>& u, const Vec<3>& v) { return normal.dot((v - u).cross(p - u)) >= 0; };
    if (inside(a, b) && inside(b, c) && inside(c, a)) {
      const double height = normal.dot(p - a);
      return height * height / area_squared;
    }
  }
  return std::min({point_edge_distance_squared<3>(p, a, b), point_edge_distance_squared<3>(p, b, c),
                   point_edge_distance_squared<3>(p, c, a)});
}

double edge_edge_distance_squared(const Vec<3>& a0, const Vec<3>& a1, const Vec<3>& b0, const Vec<3>& b1) {
  const Vec<3> u = a1 - a0, v = b1 - b0, w = b0 - a0, normal = u.cross(v);
  const double n = normal.squaredNorm();
  if (n > 1e-24 * u.squaredNorm() * v.squaredNorm()) {
    const double s = w.cross(v).dot(normal) / n, t = w.cross(u).dot(normal) / n;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return std::pow(normal.dot(w), 2) / n;
  }
  return std::min({point_edge_distance_squared<3>(a0, b0, b1), point_edge_distance_squared<3>(a1, b0, b1),
                   point_edge_distance_squared<3>(b0, a0, a1), point_edge_distance_squared<3>(b1, a0, a1)});
}

#define ITR_INSTANTIATE(Dim)                                                                                          \
  template EdgeFeature closest_feature_on_edge<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&);               \
  template double point_point_distance_squared<Dim>(const Vec<Dim>&, const Vec<Dim>&);                                \
  template Vec<2 * Dim> point_point_distance_squared_gradient<Dim>(const Vec<Dim>&, const Vec<Dim>&);                 \
  template Mat<2 * Dim> point_point_distance_squared_hessian<Dim>();                                                  \
  template double point_line_distance_squared<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&);                \
  template Vec<3 * Dim> point_line_distance_squared_gradient<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&); \
  template Mat<3 * Dim> point_line_distance_squared_hessian<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&);  \
  template double point_edge_distance_squared<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
