// SPDX-License-Identifier: MIT
#include "geometry/shape.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace itr {

namespace {

Vec<3> unit_or(const Vec<3>& v, const Vec<3>& otherwise) {
  const double length = v.norm();
  return length > 0 ? Vec<3>(v / length) : otherwise;
}

/// Place and first two derivatives of a cubic curve.
std::array<Vec<3>, 3> evaluate(const std::array<Vec<3>, 4>& b, double t) {
  const double s = 1 - t;
  return {s * s * s * b[0] + 3 * s * s * t * b[1] + 3 * s * t * t * b[2] + t * t * t * b[3],
          3 * (s * s * (b[1] - b[0]) + 2 * s * t * (b[2] - b[1]) + t * t * (b[3] - b[2])),
          6 * (s * (b[2] - 2 * b[1] + b[0]) + t * (b[3] - 2 * b[2] + b[1]))};
}

/// The parameter of the place of a curve that is nearest to a point, by Newton from the nearest place of its chord.
double nearest_parameter(const std::array<Vec<3>, 4>& b, const Vec<3>& point) {
  constexpr int kMostIterations = 20;
  const Vec<3> chord = b[3] - b[0];
  double t = std::clamp((point - b[0]).dot(chord) / chord.squaredNorm(), 0.0, 1.0);
  for (int i = 0; i < kMostIterations; ++i) {
    const auto [place, first, second] = evaluate(b, t);
    const double slope = first.dot(place - point);
    const double curvature = std::max(first.squaredNorm() + second.dot(place - point), 0.1 * first.squaredNorm());
    const double next = std::clamp(t - slope / curvature, 0.0, 1.0);
    if (next == t) break;
    t = next;
  }
  return t;
}

ShapeOffset offset_from(const FittedSurface& fitted, const Vec<3>& point) {
  ShapeOffset nearest{0, Vec<3>::Zero()};
  double least = std::numeric_limits<double>::infinity();
  for (const auto& curve : fitted.curves) {
    const double reach = std::max((curve[1] - curve[0]).norm(), (curve[2] - curve[3]).norm());
    const Vec<3> chord = curve[3] - curve[0];
    const double along = std::clamp((point - curve[0]).dot(chord) / chord.squaredNorm(), 0.0, 1.0);
    if ((curve[0] + along * chord - point).norm() - reach > least) continue;
    const auto [place, tangent, unused] = evaluate(curve, nearest_parameter(curve, point));
    const double distance = (point - place).norm();
    if (!(distance < least)) continue;
    least = distance;
    const Vec<3> normal = Vec<3>(tangent[1], -tangent[0], 0).normalized();
    nearest = {(point - place).dot(normal), normal};
  }
  return nearest;
}

}  // namespace

ShapeOffset offset_from(const Shape& shape, const Vec<3>& point) {
  const Vec<3> from = point - shape.center, &axis = shape.axis;
  const double height = from.dot(axis);
  const Vec<3> across = from - height * axis;
  const double radius = across.norm();
  const Vec<3> outward = unit_or(across, axis.unitOrthogonal());
  switch (shape.kind) {
    case Shape::Kind::plane:
      return {height, axis};
    case Shape::Kind::sphere:
      return {from.norm() - shape.radius, unit_or(from, axis)};
    case Shape::Kind::cylinder:
      return {radius - shape.radius, outward};
    case Shape::Kind::cone: {
      const double c = std::cos(shape.angle), s = std::sin(shape.angle);
      return {c * radius - s * height, c * outward - s * axis};
    }
    case Shape::Kind::torus: {
      const Vec<3> from_circle = (radius - shape.radius) * outward + height * axis;
      return {from_circle.norm() - shape.tube_radius, unit_or(from_circle, outward)};
    }
    case Shape::Kind::fitted:
      break;
  }
  return offset_from(*shape.fitted, point);
}

std::shared_ptr<const FittedSurface> fit_curves(const std::vector<std::array<Vec<3>, 2>>& segments, double feature_angle) {
  using Key = std::array<double, 3>;
  const auto key = [](const Vec<3>& p) { return Key{p[0], p[1], p[2]}; };
  std::map<Key, std::vector<Vec<3>>> to_next;  // from a place to the other ends of its segments
  for (const auto& [a, b] : segments) {
    to_next[key(a)].emplace_back(b - a);
    to_next[key(b)].emplace_back(a - b);
  }
  const auto along = [&](std::size_t i) { return Vec<3>(segments[i][1] - segments[i][0]); };
  /// Tangent at a smooth place in the direction of a segment that ends there; 0 at corners.
  const auto tangent_at = [&](const Vec<3>& place, const Vec<3>& segment) {
    const std::vector<Vec<3>>& next = to_next.at(key(place));
    if (next.size() != 2) return Vec<3>(Vec<3>::Zero());
    const Vec<3> a = -next[0], b = next[1];
    if (std::atan2(a.cross(b).norm(), a.dot(b)) > feature_angle) return Vec<3>(Vec<3>::Zero());
    const Vec<3> tangent = (a / a.squaredNorm() + b / b.squaredNorm()).normalized();
    return Vec<3>(tangent.dot(segment) < 0 ? -tangent : tangent);
  };
  auto fitted = std::make_shared<FittedSurface>();
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Vec<3> chord = along(i), direction = chord.normalized();
    std::array<Vec<3>, 2> tangents{tangent_at(segments[i][0], chord), tangent_at(segments[i][1], chord)};
    for (int end = 0; end < 2; ++end) {
      if (tangents[end] != Vec<3>::Zero()) continue;
      const Vec<3>& other = tangents[1 - end];  // an arc has it mirrored
      tangents[end] = other == Vec<3>::Zero() ? direction : Vec<3>(2 * direction.dot(other) * direction - other);
    }
    const double turn = std::atan2(tangents[0].cross(tangents[1]).norm(), tangents[0].dot(tangents[1]));
    const double handle = chord.norm() / (3 * std::pow(std::cos(turn / 4), 2));  // those of an arc
    fitted->curves.push_back(
        {segments[i][0], segments[i][0] + handle * tangents[0], segments[i][1] - handle * tangents[1], segments[i][1]});
  }
  return fitted;
}

}  // namespace itr
