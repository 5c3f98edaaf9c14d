// SPDX-License-Identifier: MIT
#include "transformation.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace itr::scene {

namespace {

constexpr double kRadians = std::numbers::pi / 180;

template <int Dim>
Vec<Dim> padded(const std::vector<double>& values) {
  Vec<Dim> result = Vec<Dim>::Zero();
  for (std::size_t c = 0; c < std::min<std::size_t>(Dim, values.size()); ++c) result[c] = values[c];
  return result;
}

/// `dimensions` as a list beats `scale`; as a number it means nothing.
template <int Dim>
Vec<Dim> read_scale(const Node& node, const Box<Dim>& box) {
  if (const Node dimensions = node["dimensions"]; dimensions.exists() && dimensions.json().is_array()) {
    const Vec<Dim> extent = box.sizes().unaryExpr([](double e) { return e == 0 ? 1.0 : e; });
    return padded<Dim>(dimensions.numbers()).cwiseQuotient(extent);
  }
  const Node scale = node["scale"];
  if (!scale.exists() || !scale.json().is_array()) return Vec<Dim>::Constant(scale.number(1));
  const std::vector<double> factors = scale.numbers();
  return factors.empty() ? Vec<Dim>::Ones().eval() : padded<Dim>(factors);
}

Mat<2> read_rotation(const Node& node, const Mat<2>&) {
  const Node rotation = node["rotation"];
  if (!rotation.exists() || (rotation.json().is_array() && rotation.json().empty())) return Mat<2>::Identity();
  if (rotation.json().is_array()) rotation.fail("one number: degrees, counter-clockwise (this is a 2D scene)");
  return Eigen::Rotation2Dd(kRadians * rotation.number(0)).toRotationMatrix();
}

/// Rotates about one axis after another; the angles are indexed by axis, not by their place in the mode.
Mat<3> rotation_about_axes(const Node& rotation, const std::string& axes) {
  Mat<3> result = Mat<3>::Identity();
  if (!rotation.json().is_array())
    return Eigen::AngleAxisd(kRadians * rotation.number(0), Vec<3>::Unit(axes[0] - 'x')).toRotationMatrix();
  const std::vector<double> angles = rotation.numbers();
  for (const char letter : axes) {
    const auto axis = static_cast<std::size_t>(letter - 'x');
    if (axis >= angles.size()) rotation.fail("an angle for each of x, y, z");
    result = Eigen::AngleAxisd(kRadians * angles[axis], Vec<3>::Unit(letter - 'x')) * result;
  }
  return result;
}

Vec<3> direction(const Node& rotation, const Vec<3>& axis) {
  if (!(axis.norm() > 0)) rotation.fail("an axis that is not zero");
  return axis.normalized();
}

Mat<3> read_rotation(const Node& node, const Mat<3>&) {
  const Node rotation = node["rotation"], mode_node = node["rotation_mode"];
  std::string mode = mode_node.string("xyz");
  std::transform(mode.begin(), mode.end(), mode.begin(), [](unsigned char c) { return std::tolower(c); });
  const bool is_axes = !mode.empty() && mode.find_first_not_of("xyz") == std::string::npos;
  const bool is_known = is_axes || mode == "axis_angle" || mode == "quaternion" || mode == "rotation_vector";
  if (!is_known) mode_node.fail("letters x, y, z, or \"axis_angle\", \"quaternion\", \"rotation_vector\"");
  if (!rotation.exists() || (rotation.json().is_array() && rotation.json().empty())) return Mat<3>::Identity();
  if (is_axes) return rotation_about_axes(rotation, mode);

  const std::vector<double> r = rotation.numbers();
  const std::size_t count = mode == "rotation_vector" ? 3 : 4;
  if (r.size() != count) rotation.fail(std::to_string(count) + " numbers, as rotation_mode is " + mode);
  if (mode == "axis_angle")
    return Eigen::AngleAxisd(kRadians * r[0], direction(rotation, {r[1], r[2], r[3]})).toRotationMatrix();
  if (mode == "quaternion") {
    const Eigen::Quaterniond quaternion(r[3], r[0], r[1], r[2]);  // the file has x, y, z, w; the constructor w first
    if (!(quaternion.norm() > 0)) rotation.fail("a quaternion that is not zero");
    return quaternion.normalized().toRotationMatrix();
  }
  const Vec<3> vector(r[0], r[1], r[2]);
  if (vector.isZero(0)) return Mat<3>::Identity();
  return Eigen::AngleAxisd(kRadians * vector.norm(), vector.normalized()).toRotationMatrix();
}

/// Unit of length of a mesh file [m].
double unit_of_mesh(const Node& geometry) {
  const std::string unit = geometry["unit"].string("");
  return unit.empty() ? geometry.document().units.factor("m") : Units::length_in_metres(unit);
}

}  // namespace

template <int Dim>
Box<Dim> bounding_box(const std::vector<Vec<Dim>>& points) {
  Box<Dim> box;
  for (const Vec<Dim>& point : points) box.extend(point);
  return box;
}

template <int Dim>
bool transform(std::vector<Vec<Dim>>& points, const Node& geometry) {
  if (geometry["advanced"]["normalize_mesh"].boolean(false)) {
    const Box<Dim> box = bounding_box<Dim>(points);
    const double extent = box.sizes().maxCoeff();
    for (Vec<Dim>& point : points) point = (point - box.min()) / (extent > 0 ? extent : 1);
  }
  if (const double unit = unit_of_mesh(geometry); unit != 1)
    for (Vec<Dim>& point : points) point *= unit;
  const Node node = geometry["transformation"];
  const Vec<Dim> scale = read_scale<Dim>(node, bounding_box<Dim>(points));
  const Mat<Dim> rotation = read_rotation(node, Mat<Dim>());
  const Vec<Dim> translation = padded<Dim>(node["translation"].numbers());
  const Mat<Dim> linear = rotation * scale.asDiagonal();
  // The identity keeps the bits of the file.
  if (!linear.isIdentity(0) || !translation.isZero(0))
    for (Vec<Dim>& point : points) point = linear * point + translation;
  return scale.prod() < 0;
}

void warn_of_radians(const Node& transformation, std::vector<std::string>& warnings) {
  constexpr double kPart = std::numbers::pi / 12, kWhole = 24, kRounding = 1e-4;
  const Node rotation = transformation["rotation"];
  const Node mode = transformation["rotation_mode"];
  if (!rotation.exists() || (mode.exists() && mode.json() == "quaternion")) return;
  for (const Node& angle : rotation.items()) {
    const double parts = std::abs(angle.number(0)) / kPart;
    if (parts < 0.5 || parts > kWhole + 0.5 || std::abs(parts - std::round(parts)) > kRounding * parts) continue;
    warnings.push_back(rotation.pointer() + ": " + abbreviate(rotation.json()) + " is a part of pi: are angles in degrees?");
    return;
  }
}

template Box<2> bounding_box(const std::vector<Vec<2>>&);
template Box<3> bounding_box(const std::vector<Vec<3>>&);
template bool transform(std::vector<Vec<2>>&, const Node&);
template bool transform(std::vector<Vec<3>>&, const Node&);

}  // namespace itr::scene
