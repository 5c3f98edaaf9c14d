// SPDX-License-Identifier: MIT
// In all pairs the separation r is affine in the parameters beta of the closest points (none for two points, one on a line,
// two on a plane or on two lines): r = sum_i c_i(beta) x_i with c = c_0 + C beta. D = min over beta of r.r, so at the
// minimum
//   dD/dx_i = 2 c_i r,
//   d2D/dx2 = H_xx - H_xb H_bb^-1 H_bx,  H_xx = 2 c c^T (x) I,  H_x_bk = 2 (C_ik r + c_i J_k),  H_bb = 2 J^T J,  J =
//   dr/dbeta.
#include "geometry/distance.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace itr {

namespace {

constexpr double kParallel = 1e-24;  ///< squared sine of the angle of edges that count as parallel
/// Closest points that are outside a feature by less than this fraction of the distance count as inside: the distance is the
/// same to its square, its gradient to this, and round-off does not decide between the features' second derivatives, which
/// differ.
constexpr double kOnBoundary = 1e-9;

enum class OnEdge { start, end, inside };

template <int Dim>
OnEdge closest_on_edge(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  const Vec<Dim> e = b - a;
  const double along = e.dot(p - a);
  const double beyond = along - e.squaredNorm();
  if (along > 0 && beyond < 0) return OnEdge::inside;
  const Vec<Dim>& end = along > 0 ? b : a;
  const double out = along > 0 ? beyond : -along;  // times the edge's length
  if (out * out < kOnBoundary * kOnBoundary * e.squaredNorm() * (p - end).squaredNorm()) return OnEdge::inside;
  return along > 0 ? OnEdge::end : OnEdge::start;
}

template <int Dim>
double point_line_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  if constexpr (Dim == 2) {
    const Vec<2> e = b - a, d = p - a;
    const double cross = e[0] * d[1] - e[1] * d[0];
    return cross * cross / e.squaredNorm();
  } else {
    return (b - a).cross(p - a).squaredNorm() / (b - a).squaredNorm();
  }
}

/// Closest features of the vertex and the edge at these places of a pair.
template <int Dim>
ClosestFeatures of_point_and_edge(const Vec<Dim>* x, signed char p, signed char a, signed char b) {
  switch (closest_on_edge<Dim>(x[p], x[a], x[b])) {
    case OnEdge::start:
      return {PairKind::vertex_vertex, {p, a, -1, -1}};
    case OnEdge::end:
      return {PairKind::vertex_vertex, {p, b, -1, -1}};
    default:
      return {PairKind::edge_vertex, {p, a, b, -1}};
  }
}

/// The nearest of several combinations of a vertex and an edge.
ClosestFeatures nearest_of(const Vec<3>* x, std::span<const std::array<signed char, 3>> combinations) {
  ClosestFeatures best{};
  double least = 0;
  for (std::size_t k = 0; k < combinations.size(); ++k) {
    const auto [p, a, b] = combinations[k];
    const double D = point_edge_distance_squared<3>(x[p], x[a], x[b]);
    if (k > 0 && !(D < least)) continue;
    least = D;
    best = of_point_and_edge<3>(x, p, a, b);
  }
  return best;
}

constexpr std::array<signed char, 3> kTriangleEdges[] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
constexpr std::array<signed char, 3> kEdgeEnds[] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};

/// The plane of a triangle and whether the foot of the perpendicular from p is in it.
struct Foot {
  Vec<3> normal;
  double area_squared;  ///< |normal|^2
  bool inside = false;
  Foot(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c)
      : normal((b - a).cross(c - a)), area_squared(normal.squaredNorm()) {
    const double slack = kOnBoundary * std::abs(normal.dot(p - a));
    const auto left_of = [&](const Vec<3>& u, const Vec<3>& v) {
      const double side = normal.dot((v - u).cross(p - u));
      return side >= 0 || side > -slack * (v - u).norm();
    };
    inside = area_squared > 0 && left_of(a, b) && left_of(b, c) && left_of(c, a);
  }
};

/// The common perpendicular of two lines: a0 + s u and b0 + t v are closest.
struct CommonPerpendicular {
  Vec<3> u, v, w, normal;
  double n, s = 0, t = 0;
  CommonPerpendicular(const Vec<3>& a0, const Vec<3>& a1, const Vec<3>& b0, const Vec<3>& b1)
      : u(a1 - a0), v(b1 - b0), w(b0 - a0), normal(u.cross(v)), n(normal.squaredNorm()) {
    if (!(n > kParallel * u.squaredNorm() * v.squaredNorm())) return;
    s = w.cross(v).dot(normal) / n;
    t = w.cross(u).dot(normal) / n;
    exists = true;
  }
  bool exists = false;
  bool inside() const {
    if (!exists) return false;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return true;
    const double slack = kOnBoundary * std::abs(normal.dot(w)) / std::sqrt(n);
    const auto on_edge = [slack](double s, const Vec<3>& e) {
      const double out = std::max(-s, s - 1);
      return out <= 0 || out * e.norm() < slack;
    };
    return on_edge(s, u) && on_edge(t, v);
  }
};

/// dc/dbeta: columns are the parameters.
Eigen::Matrix<double, 4, 2> parameter_slopes(PairKind kind) {
  Eigen::Matrix<double, 4, 2> C = Eigen::Matrix<double, 4, 2>::Zero();
  switch (kind) {
    case PairKind::vertex_vertex:
      break;
    case PairKind::edge_vertex:
      C.col(0) << 0, 1, -1, 0;
      break;
    case PairKind::face_vertex:
      C.col(0) << 0, 1, -1, 0;
      C.col(1) << 0, 1, 0, -1;
      break;
    case PairKind::edge_edge:
      C.col(0) << -1, 1, 0, 0;
      C.col(1) << 0, 0, 1, -1;
      break;
  }
  return C;
}

}  // namespace

template <int Dim>
ClosestFeatures closest_features(PairKind kind, const Vec<Dim>* x) {
  switch (kind) {
    case PairKind::vertex_vertex:
      return {kind, {0, 1, -1, -1}};
    case PairKind::edge_vertex:
      return of_point_and_edge<Dim>(x, 0, 1, 2);
    // In 2D this case does nothing, as the next: NOLINTNEXTLINE(bugprone-branch-clone)
    case PairKind::face_vertex:
      if constexpr (Dim == 3) {
        if (Foot(x[0], x[1], x[2], x[3]).inside) return {kind, {0, 1, 2, 3}};
        return nearest_of(x, kTriangleEdges);
      }
      break;
    case PairKind::edge_edge:
      if constexpr (Dim == 3) {
        if (CommonPerpendicular(x[0], x[1], x[2], x[3]).inside()) return {kind, {0, 1, 2, 3}};
        return nearest_of(x, kEdgeEnds);
      }
      break;
  }
  return {};
}

template <int Dim>
PairDistance<Dim> pair_distance(PairKind kind, const Vec<Dim>* x) {
  PairDistance<Dim> result;
  Vec<4>& c = result.coefficients;
  switch (kind) {
    case PairKind::vertex_vertex:
      c << 1, -1, 0, 0;
      result.separation = x[0] - x[1];
      break;
    case PairKind::edge_vertex: {
      const Vec<Dim> e = x[2] - x[1];
      const double t = e.dot(x[0] - x[1]) / e.squaredNorm();
      c << 1, t - 1, -t, 0;
      result.separation = x[0] - x[1] - t * e;
      break;
    }
    // In 2D this case does nothing, as the next: NOLINTNEXTLINE(bugprone-branch-clone)
    case PairKind::face_vertex:
      if constexpr (Dim == 3) {
        const Vec<3> u = x[2] - x[1], v = x[3] - x[1], w = x[0] - x[1], normal = u.cross(v);
        const double n = normal.squaredNorm(), s = w.cross(v).dot(normal) / n, t = u.cross(w).dot(normal) / n;
        c << 1, s + t - 1, -s, -t;
        result.separation = normal.dot(w) / n * normal;
      }
      break;
    case PairKind::edge_edge:
      if constexpr (Dim == 3) {
        const CommonPerpendicular q(x[0], x[1], x[2], x[3]);
        c << 1 - q.s, q.s, q.t - 1, -q.t;
        result.separation = -q.normal.dot(q.w) / q.n * q.normal;
      }
      break;
  }
  result.squared = result.separation.squaredNorm();
  return result;
}

template <int Dim>
Mat<4 * Dim> pair_distance_hessian(PairKind kind, const Vec<Dim>* x) {
  const int size = pair_size(kind), parameters = size == 2 ? 0 : size == 3 ? 1 : 2;
  const PairDistance<Dim> pair = pair_distance<Dim>(kind, x);
  const Eigen::Matrix<double, 4, 2> C = parameter_slopes(kind);
  Eigen::Matrix<double, Dim, 2> J = Eigen::Matrix<double, Dim, 2>::Zero();
  for (int k = 0; k < parameters; ++k)
    for (int i = 0; i < size; ++i) J.col(k) += C(i, k) * x[i];
  Eigen::Matrix<double, 4 * Dim, 2> X = Eigen::Matrix<double, 4 * Dim, 2>::Zero();  // H_xb / 2
  for (int k = 0; k < parameters; ++k)
    for (int i = 0; i < size; ++i)
      X.col(k).template segment<Dim>(Dim * i) = C(i, k) * pair.separation + pair.coefficients[i] * J.col(k);
  Mat<4 * Dim> hessian = Mat<4 * Dim>::Zero();
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j)
      hessian.template block<Dim, Dim>(Dim * i, Dim * j)
          .diagonal()
          .setConstant(2 * pair.coefficients[i] * pair.coefficients[j]);
  if (parameters == 1) hessian -= (2 / J.col(0).squaredNorm()) * X.col(0) * X.col(0).transpose();
  if constexpr (Dim == 3) {
    if (parameters == 2) {
      const double determinant = J.col(0).cross(J.col(1)).squaredNorm();  // of J^T J, without its cancellation
      const double a = J.col(0).squaredNorm(), b = J.col(0).dot(J.col(1)), c = J.col(1).squaredNorm();
      Mat<2> inverse;
      inverse << c, -b, -b, a;
      hessian.noalias() -= X * (2 / determinant * inverse) * X.transpose();
    }
  }
  return hessian;
}

template <int Dim>
Eigen::Matrix<double, 4 * Dim, Dim + 2> pair_distance_range(PairKind kind, const PairDistance<Dim>& pair) {
  Eigen::Matrix<double, 4 * Dim, Dim + 2> basis = Eigen::Matrix<double, 4 * Dim, Dim + 2>::Zero();
  const Vec<4> c = pair.coefficients.normalized();
  for (int i = 0; i < 4; ++i)
    for (int d = 0; d < Dim; ++d) basis(Dim * i + d, d) = c[i];
  // X_k = C_k (x) r + c (x) J_k: what is new in it is the part of C_k that is orthogonal to c and to the others'.
  Eigen::Matrix<double, 4, 2> C = parameter_slopes(kind);
  const Vec<Dim> r = pair.separation.normalized();
  for (int k = 0; k < 2; ++k) {
    C.col(k) -= c * c.dot(C.col(k));
    if (k == 1) C.col(1) -= C.col(0) * C.col(0).dot(C.col(1));
    const double length = C.col(k).norm();
    if (length > 0) C.col(k) /= length;
    for (int i = 0; i < 4; ++i) basis.template block<Dim, 1>(Dim * i, Dim + k) = C(i, k) * r;
  }
  return basis;
}

template <int Dim>
double box_distance_squared(PairKind kind, const Vec<Dim>* x) {
  const int first = kind == PairKind::edge_edge ? 2 : 1, size = pair_size(kind);
  Vec<Dim> low = x[0], high = x[0], other_low = x[first], other_high = x[first];
  if (first == 2) low = low.cwiseMin(x[1]), high = high.cwiseMax(x[1]);
  for (int k = first + 1; k < size; ++k) other_low = other_low.cwiseMin(x[k]), other_high = other_high.cwiseMax(x[k]);
  return (low - other_high).cwiseMax(other_low - high).cwiseMax(0.0).squaredNorm();
}

template <int Dim>
double pair_distance_squared(PairKind kind, const Vec<Dim>* x) {
  switch (kind) {
    case PairKind::vertex_vertex:
      return (x[0] - x[1]).squaredNorm();
    case PairKind::edge_vertex:
      return point_edge_distance_squared<Dim>(x[0], x[1], x[2]);
    // In 2D this case does nothing, as the next: NOLINTNEXTLINE(bugprone-branch-clone)
    case PairKind::face_vertex:
      if constexpr (Dim == 3) return point_triangle_distance_squared(x[0], x[1], x[2], x[3]);
      break;
    case PairKind::edge_edge:
      if constexpr (Dim == 3) return edge_edge_distance_squared(x[0], x[1], x[2], x[3]);
      break;
  }
  return 0;
}

template <int Dim>
double point_edge_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b) {
  switch (closest_on_edge<Dim>(p, a, b)) {
    case OnEdge::start:
      return (p - a).squaredNorm();
    case OnEdge::end:
      return (p - b).squaredNorm();
    default:
      return point_line_distance_squared<Dim>(p, a, b);
  }
}

double point_triangle_distance_squared(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const Foot foot(p, a, b, c);
  if (foot.inside) {
    const double height = foot.normal.dot(p - a);
    return height * height / foot.area_squared;
  }
  return std::min({point_edge_distance_squared<3>(p, a, b), point_edge_distance_squared<3>(p, b, c),
                   point_edge_distance_squared<3>(p, c, a)});
}

double edge_edge_distance_squared(const Vec<3>& a0, const Vec<3>& a1, const Vec<3>& b0, const Vec<3>& b1) {
  const CommonPerpendicular q(a0, a1, b0, b1);
  if (q.inside()) {
    const double height = q.normal.dot(q.w);
    return height * height / q.n;
  }
  return std::min({point_edge_distance_squared<3>(a0, b0, b1), point_edge_distance_squared<3>(a1, b0, b1),
                   point_edge_distance_squared<3>(b0, a0, a1), point_edge_distance_squared<3>(b1, a0, a1)});
}

double edge_cross_squared(const Vec<3>* x) { return (x[1] - x[0]).cross(x[3] - x[2]).squaredNorm(); }

CrossSquared edge_cross_squared_with_gradient(const Vec<3>* x) {
  const Vec<3> u = x[1] - x[0], v = x[3] - x[2], n = u.cross(v);
  const Vec<3> du = 2 * v.cross(n), dv = 2 * n.cross(u);
  CrossSquared result{n.squaredNorm(), {}};
  const Vec<3> parts[] = {-du, du, -dv, dv};
  for (int k = 0; k < 4; ++k) result.gradient.segment<3>(3 * k) = parts[k];
  return result;
}

Mat<12> edge_cross_squared_hessian(const Vec<3>* x) {
  const Vec<3> u = x[1] - x[0], v = x[3] - x[2];
  const Mat<3> identity = Mat<3>::Identity();
  const Mat<3> uu = 2 * (v.squaredNorm() * identity - v * v.transpose());
  const Mat<3> vv = 2 * (u.squaredNorm() * identity - u * u.transpose());
  const Mat<3> uv = 4 * u * v.transpose() - 2 * v * u.transpose() - 2 * u.dot(v) * identity;
  Mat<12> hessian;
  hessian << uu, -uu, uv, -uv,                   //
      -uu, uu, -uv, uv,                          //
      uv.transpose(), -uv.transpose(), vv, -vv,  //
      -uv.transpose(), uv.transpose(), -vv, vv;
  return hessian;
}

#define ITR_INSTANTIATE(Dim)                                                                                         \
  template ClosestFeatures closest_features<Dim>(PairKind, const Vec<Dim>*);                                         \
  template PairDistance<Dim> pair_distance<Dim>(PairKind, const Vec<Dim>*);                                          \
  template Mat<4 * (Dim)> pair_distance_hessian<Dim>(PairKind, const Vec<Dim>*);                                     \
  template Eigen::Matrix<double, 4 * (Dim), (Dim) + 2> pair_distance_range<Dim>(PairKind, const PairDistance<Dim>&); \
  template double box_distance_squared<Dim>(PairKind, const Vec<Dim>*);                                              \
  template double pair_distance_squared<Dim>(PairKind, const Vec<Dim>*);                                             \
  template double point_edge_distance_squared<Dim>(const Vec<Dim>&, const Vec<Dim>&, const Vec<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
