// SPDX-License-Identifier: MIT
#include "geometry/fit_shape.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace itr {

namespace {

/// Changes of a shape: of its centre, by a turn of its axis about the centre, and of radius, tube radius and angle.
using Change = Eigen::Matrix<double, 9, 1>;

/// Corners of some triangles in the box of diagonal 1 around the origin, and the triangles' normals where they are.
struct Samples {
  std::vector<Vec<3>> points{}, centroids{}, normals{};
  std::vector<double> areas{};
  Vec<3> origin;
  double size;
};

Samples sample(std::span<const SurfaceTriangle> triangles) {
  Eigen::AlignedBox<double, 3> box;
  for (const SurfaceTriangle& triangle : triangles)
    for (const Vec<3>& corner : triangle) box.extend(corner);
  Samples samples{.origin = box.center(), .size = box.diagonal().norm()};
  constexpr std::size_t kMost = 1000;  // tell the numbers as well as more do
  for (std::size_t i = 0; i < triangles.size(); i += 1 + triangles.size() / kMost) {
    const SurfaceTriangle& triangle = triangles[i];
    SurfaceTriangle scaled;
    for (int k = 0; k < 3; ++k) scaled[k] = (triangle[k] - samples.origin) / samples.size;
    samples.points.insert(samples.points.end(), scaled.begin(), scaled.end());
    const Vec<3> twice = (scaled[1] - scaled[0]).cross(scaled[2] - scaled[0]);
    if (!(twice.norm() > 0)) continue;
    samples.centroids.push_back((scaled[0] + scaled[1] + scaled[2]) / 3);
    samples.normals.push_back(twice.normalized());
    samples.areas.push_back(twice.norm() / 2);
  }
  return samples;
}

/// Derivative of the distance of a point by the changes that a shape has; 0 for others.
Change slope(const Shape& shape, const Vec<3>& point, const Vec<3>& normal) {
  const Vec<3> from = point - shape.center;
  const double height = from.dot(shape.axis);
  const Vec<3> across = from - height * shape.axis;
  Change slope = Change::Zero();
  slope.head<3>() = -normal;
  if (shape.kind != Shape::Kind::sphere) slope.segment<3>(3) = -from.cross(normal);
  switch (shape.kind) {
    case Shape::Kind::sphere:
    case Shape::Kind::cylinder:
      slope[6] = -1;
      break;
    case Shape::Kind::torus:
      slope[6] = across.norm() > 0 ? -normal.dot(across.normalized()) : 0;
      slope[7] = -1;
      break;
    case Shape::Kind::cone:
      slope[8] = -std::sin(shape.angle) * across.norm() - std::cos(shape.angle) * height;
      break;
    default:
      break;
  }
  return slope;
}

Shape changed(Shape shape, const Change& change) {
  shape.center += change.head<3>();
  const Vec<3> turn = change.segment<3>(3);
  if (const double angle = turn.norm(); angle > 0)
    shape.axis = (Eigen::AngleAxisd(angle, turn / angle) * shape.axis).normalized();
  shape.radius += change[6];
  shape.tube_radius += change[7];
  shape.angle += change[8];
  return shape;
}

double squares(const Shape& shape, const Samples& samples) {
  double sum = 0;
  for (const Vec<3>& point : samples.points) sum += std::pow(offset_from(shape, point).distance, 2);
  return sum;
}

/// Lowers the sum of squares of distances until it is round-off or no longer falls.
Shape descend(Shape shape, const Samples& samples) {
  constexpr int kMostIterations = 200, kMostStill = 5;
  constexpr double kLeastDamping = 1e-15, kMostDamping = 1e8, kRoundOff = 1e-30, kStill = 1e-3;
  double now = squares(shape, samples), damping = 1e-3;
  const double least = kRoundOff * static_cast<double>(samples.points.size());
  for (int i = 0, still = 0; i < kMostIterations && damping < kMostDamping && now > least && still < kMostStill; ++i) {
    Eigen::Matrix<double, 9, 9> matrix = Eigen::Matrix<double, 9, 9>::Zero();
    Change gradient = Change::Zero();
    for (const Vec<3>& point : samples.points) {
      const ShapeOffset offset = offset_from(shape, point);
      const Change row = slope(shape, point, offset.normal);
      matrix += row * row.transpose();
      gradient += offset.distance * row;
    }
    const double scale = matrix.trace();
    matrix.diagonal().array() += damping * scale / 9;
    const Shape next = changed(shape, -matrix.ldlt().solve(gradient));
    const double then = squares(next, samples);
    damping = then < now ? std::max(damping / 10, kLeastDamping) : damping * 10;
    if (!(then < now)) continue;
    still = now - then < kStill * now ? still + 1 : 0;
    shape = next;
    now = then;
  }
  return shape;
}

/// Eigenvectors of a symmetric matrix, that of the least eigenvalue first.
std::array<Vec<3>, 3> directions(const Mat<3>& matrix) {
  const Mat<3> vectors = Eigen::SelfAdjointEigenSolver<Mat<3>>(matrix).eigenvectors();
  return {vectors.col(0), vectors.col(1), vectors.col(2)};
}

/// A function of each triangle, summed by area.
template <typename Sum, typename Function>
Sum sum_of(const Samples& samples, Sum sum, const Function& function) {
  for (std::size_t i = 0; i < samples.areas.size(); ++i)
    sum += samples.areas[i] * function(samples.centroids[i], samples.normals[i]);
  return sum;
}

/// Middle and radius of the circle or sphere through points of the plane or of space, by linear least squares.
template <int Dim>
std::pair<Vec<Dim>, double> circle_through(const std::vector<Vec<Dim>>& points) {
  MatrixX rows(points.size(), Dim + 1);
  VectorX squares(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    rows.row(static_cast<Eigen::Index>(i)) << 2 * points[i].transpose(), 1;
    squares[static_cast<Eigen::Index>(i)] = points[i].squaredNorm();
  }
  const VectorX solution = rows.completeOrthogonalDecomposition().solve(squares);
  const Vec<Dim> middle = solution.template head<Dim>();
  return {middle, std::sqrt(std::max(solution[Dim] + middle.squaredNorm(), 0.0))};
}

Mat<3> spread_of_points(const Samples& samples, Vec<3>& mean) {
  mean.setZero();
  for (const Vec<3>& p : samples.points) mean += p / static_cast<double>(samples.points.size());
  Mat<3> spread = Mat<3>::Zero();
  for (const Vec<3>& p : samples.points) spread += (p - mean) * (p - mean).transpose();
  return spread;
}

void add_cylinders(const Samples& samples, std::vector<Shape>& starts) {
  const Mat<3> spread = sum_of(samples, Mat<3>(Mat<3>::Zero()), [](auto&, const Vec<3>& n) { return n * n.transpose(); });
  for (const Vec<3>& axis : directions(spread)) {
    const Vec<3> a = axis.unitOrthogonal(), b = axis.cross(a);
    std::vector<Vec<2>> flat;
    for (const Vec<3>& p : samples.points) flat.emplace_back(a.dot(p), b.dot(p));
    const auto [middle, radius] = circle_through<2>(flat);
    starts.push_back(
        {.kind = Shape::Kind::cylinder, .center = middle[0] * a + middle[1] * b, .axis = axis, .radius = radius});
  }
}

void add_cones(const Samples& samples, std::vector<Shape>& starts) {
  const double area = sum_of(samples, 0.0, [](auto&, auto&) { return 1.0; });
  const Vec<3> mean = sum_of(samples, Vec<3>(Vec<3>::Zero()), [](auto&, const Vec<3>& n) { return n; }) / area;
  Mat<3> normals = Mat<3>::Zero(), spread = Mat<3>::Zero();
  Vec<3> heights = Vec<3>::Zero(), middle = Vec<3>::Zero();
  for (std::size_t i = 0; i < samples.areas.size(); ++i) {
    const Vec<3>& n = samples.normals[i];
    normals += samples.areas[i] * n * n.transpose();
    spread += samples.areas[i] * (n - mean) * (n - mean).transpose();
    heights += samples.areas[i] * n.dot(samples.centroids[i]) * n;
    middle += samples.areas[i] / area * samples.centroids[i];
  }
  const Vec<3> apex = normals.completeOrthogonalDecomposition().solve(heights);  // all triangles' planes meet there
  for (Vec<3> axis : directions(spread)) {
    if (axis.dot(middle - apex) < 0) axis = -axis;
    const double sine = std::min(std::abs(mean.dot(axis)), 1.0);
    starts.push_back({.kind = Shape::Kind::cone, .center = apex, .axis = axis, .angle = std::asin(sine)});
  }
}

void add_torus(const Samples& samples, const Vec<3>& axis, const Vec<3>& on_axis, std::vector<Shape>& starts) {
  std::vector<Vec<2>> profile;  // distances from the axis, and heights
  for (const Vec<3>& p : samples.points) {
    const double height = axis.dot(p - on_axis);
    profile.emplace_back((p - on_axis - height * axis).norm(), height);
  }
  const auto [middle, radius] = circle_through<2>(profile);
  starts.push_back({.kind = Shape::Kind::torus,
                    .center = on_axis + middle[1] * axis,
                    .axis = axis,
                    .radius = std::abs(middle[0]),
                    .tube_radius = radius});
}

/// With axes that the normals meet, and those of the box of the points.
void add_tori(const Samples& samples, std::vector<Shape>& starts) {
  Mat<3> of_axis = Mat<3>::Zero(), mixed = Mat<3>::Zero(), of_moment = Mat<3>::Zero();
  for (std::size_t i = 0; i < samples.areas.size(); ++i) {
    const Vec<3>& n = samples.normals[i];
    const Vec<3> moment = samples.centroids[i].cross(n);
    of_axis += samples.areas[i] * moment * moment.transpose();
    mixed += samples.areas[i] * n * moment.transpose();
    of_moment += samples.areas[i] * n * n.transpose();
  }
  const Mat<3> by_axis = -of_moment.completeOrthogonalDecomposition().solve(mixed);
  for (const Vec<3>& axis : directions(of_axis + mixed.transpose() * by_axis))
    add_torus(samples, axis, axis.cross(by_axis * axis), starts);
  Vec<3> mean;
  for (const Vec<3>& axis : directions(spread_of_points(samples, mean))) add_torus(samples, axis, mean, starts);
}

std::vector<Shape> starts_of(Shape::Kind kind, const Samples& samples) {
  std::vector<Shape> starts;
  switch (kind) {
    case Shape::Kind::plane: {
      Vec<3> mean;
      const Vec<3> normal = directions(spread_of_points(samples, mean)).front();
      starts.push_back({.kind = kind, .center = mean, .axis = normal});
      break;
    }
    case Shape::Kind::sphere: {
      const auto [center, radius] = circle_through<3>(samples.points);
      starts.push_back({.kind = kind, .center = center, .radius = radius});
      break;
    }
    case Shape::Kind::cylinder:
      add_cylinders(samples, starts);
      break;
    case Shape::Kind::cone:
      add_cones(samples, starts);
      break;
    case Shape::Kind::torus:
      add_tori(samples, starts);
      break;
    case Shape::Kind::fitted:
      break;
  }
  return starts;
}

/// Whether the numbers are those of such a shape.
bool is_valid(const Shape& shape) {
  const bool is_finite = shape.center.allFinite() && shape.axis.allFinite();
  switch (shape.kind) {
    case Shape::Kind::sphere:
    case Shape::Kind::cylinder:
      return is_finite && shape.radius > 0;
    case Shape::Kind::torus:
      return is_finite && shape.radius > 0 && shape.tube_radius > 0;
    case Shape::Kind::cone:
      return is_finite && shape.angle > 0 && shape.angle < std::numbers::pi / 2;
    default:
      return is_finite;
  }
}

double farthest_from(const Shape& shape, std::span<const SurfaceTriangle> triangles) {
  double most = 0;
  for (const SurfaceTriangle& triangle : triangles)
    for (const Vec<3>& corner : triangle) most = std::max(most, std::abs(offset_from(shape, corner).distance));
  return most;
}

/// Whether the points tell all numbers of a shape: no change of these leaves all distances alone.
bool is_told_by(const Shape& shape, const Samples& samples) {
  constexpr double kRoundOff = 1e-16;          // of squares of derivatives
  constexpr int kNumbers[] = {3, 4, 5, 6, 7};  // by kind: those that make another surface
  Eigen::Matrix<double, 9, 9> matrix = Eigen::Matrix<double, 9, 9>::Zero();
  for (const Vec<3>& point : samples.points) {
    const Change row = slope(shape, point, offset_from(shape, point).normal);
    matrix += row * row.transpose();
  }
  const Eigen::Matrix<double, 9, 1> squares =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>>(matrix).eigenvalues();
  return squares[9 - kNumbers[static_cast<int>(shape.kind)]] > kRoundOff * squares[8];
}

/// The nearest shape, in the samples' box; nothing if there are many.
std::optional<Shape> fit_samples(Shape::Kind kind, const Samples& samples) {
  std::optional<Shape> best;
  double least = std::numeric_limits<double>::infinity();
  for (const Shape& start : starts_of(kind, samples)) {
    if (!is_valid(start)) continue;
    const Shape shape = descend(start, samples);
    const double left = squares(shape, samples);
    if (!is_valid(shape) || !(left < least)) continue;
    best = shape;
    least = left;
  }
  return best && is_told_by(*best, samples) ? best : std::nullopt;
}

/// Mean of the squared sines of the angles between a shape and the triangles.
double tilt(const Shape& shape, const Samples& samples) {
  const double area = sum_of(samples, 0.0, [](auto&, auto&) { return 1.0; });
  return sum_of(samples, 0.0,
                [&](const Vec<3>& p, const Vec<3>& n) { return n.cross(offset_from(shape, p).normal).squaredNorm(); }) /
         area;
}

ShapeFit in_space(Shape shape, const Samples& samples, std::span<const SurfaceTriangle> triangles) {
  // The place on the axis that is nearest to the middle of the points.
  if (shape.kind == Shape::Kind::cylinder) shape.center -= shape.center.dot(shape.axis) * shape.axis;
  shape.center = samples.origin + samples.size * shape.center;
  for (double* length : {&shape.radius, &shape.tube_radius}) *length *= samples.size;
  return {shape, farthest_from(shape, triangles)};
}

}  // namespace

std::optional<ShapeFit> fit_shape(Shape::Kind kind, std::span<const SurfaceTriangle> triangles) {
  const Samples samples = sample(triangles);
  const std::optional<Shape> shape = fit_samples(kind, samples);
  return shape ? std::optional(in_space(*shape, samples, triangles)) : std::nullopt;
}

std::optional<ShapeFit> recognize_shape(std::span<const SurfaceTriangle> triangles, double tolerance) {
  constexpr double kMostTilt = 0.15;  // that of a square in a cylinder is 0.1
  constexpr double kBetter = 0.75;    // of the tilt of a simpler kind, from which on another one is taken
  constexpr double kRoundOff = 1e-12;
  const Samples samples = sample(triangles);
  std::optional<ShapeFit> best;
  double least = std::numeric_limits<double>::infinity();
  using enum Shape::Kind;
  for (const Shape::Kind kind : {plane, sphere, cylinder, cone, torus}) {
    const std::optional<Shape> shape = fit_samples(kind, samples);
    if (!shape) continue;
    const double tilted = tilt(*shape, samples) + kRoundOff;
    const ShapeFit fit = in_space(*shape, samples, triangles);
    if (fit.farthest > tolerance || tilted > kMostTilt || tilted >= kBetter * least) continue;
    best = fit;
    least = tilted;
    if (tilted <= 2 * kRoundOff) break;
  }
  return best;
}

}  // namespace itr
