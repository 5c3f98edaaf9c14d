// SPDX-License-Identifier: MIT
// Which ids parts of a mesh get (docs/theory.md, "Meshes").
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "selection_file.hpp"
#include "sets.hpp"
#include "transformation.hpp"

namespace itr::scene {

template <int Dim>
class Selection {
 public:
  /// `box` is what relative places refer to; `node` may be absent: then nothing matches.
  Selection(const Node& node, const Box<Dim>& box) : box_(box) {
    if (find_selection_file(node).exists()) return;  // which is in the groups of the mesh file
    for (const Node& item : node.items()) {
      rules_.push_back(read_rule(item));
      const bool has_region = item.json().is_object() && item.has("id") && item.json().size() > 1;
      pointers_.push_back(has_region ? item.pointer() : "");
    }
    matched_.assign(rules_.size(), 0);
  }

  /// The label by the first rule that matches a barycenter; `stored` is the number that the mesh file gave it.
  std::optional<Label> operator()(const Vec<Dim>& p, int stored = 0) const {
    for (std::size_t i = 0; i < rules_.size(); ++i)
      if (std::optional<Label> label = rules_[i](p, stored)) {
        matched_[i] = 1;
        return label;
      }
    return std::nullopt;
  }

  /// Whether a rule gives this number, whatever is stored.
  bool gives(int number) const { return numbers_.contains(number); }

  /// Pointers of the rules with a region that no call has matched so far.
  std::vector<std::string> unmatched() const {
    std::vector<std::string> pointers;
    for (std::size_t i = 0; i < rules_.size(); ++i)
      if (!matched_[i] && !pointers_[i].empty()) pointers.push_back(pointers_[i]);
    return pointers;
  }

 private:
  static constexpr double kNear = 1e-7;  ///< of the box's diagonal: how far from a side a threshold below 0 selects

  using Test = std::function<bool(const Vec<Dim>&)>;
  using Rule = std::function<std::optional<Label>(const Vec<Dim>&, int)>;

  Rule read_rule(const Node& node) {
    const auto read = [&](const Node& id) {
      const Label label = read_label(id, 0);
      if (label.name.empty()) numbers_.insert(label.number);
      return label;
    };
    if (!node.json().is_object()) return [label = read(node)](const Vec<Dim>&, int) { return std::optional(label); };
    if (!node.has("box") && node.has("threshold")) return read_threshold(node);
    if (!node.has("id")) {
      if (node.json().size() != 1 || !node.has("id_offset")) node["id"].fail("the id of what is selected");
      return [offset = node["id_offset"].integer(0)](const Vec<Dim>&, int stored) {
        return std::optional(Label{stored + offset});
      };
    }
    const Label label = read(node["id"]);
    Test test;
    if (node.has("box"))
      test = read_box(node);
    else if (node.has("center"))
      test = read_sphere(node);
    else if (node.has("radius"))
      test = read_cylinder(node);
    else if (node.has("axis"))
      test = read_axis(node);
    else if (node.has("normal"))
      test = read_plane(node);
    else if (node.json().size() == 1)
      test = [](const Vec<Dim>&) { return true; };
    else
      node.fail("box, threshold, center, radius, axis or normal, beside the id");
    return [test, label](const Vec<Dim>& p, int) { return test(p) ? std::optional(label) : std::nullopt; };
  }
  /// Sides of the bounding box: left 1, bottom 2, right 3, top 4, back 5, front 6; the rest 7.
  Rule read_threshold(const Node& node) {
    const double given = node["threshold"].number(0);
    const double threshold = given < 0 ? kNear * box_.diagonal().norm() : given;
    const int offset = node["id_offset"].integer(0);
    for (int side = 1; side <= 7; ++side) numbers_.insert(side + offset);
    return [box = box_, threshold, offset](const Vec<Dim>& p, int) {
      const auto is_near = [&](double a, double b) { return std::abs(a - b) < threshold; };
      int side = 7;
      if (is_near(p[0], box.min()[0]))
        side = 1;
      else if (is_near(p[1], box.min()[1]))
        side = 2;
      else if (is_near(p[0], box.max()[0]))
        side = 3;
      else if (is_near(p[1], box.max()[1]))
        side = 4;
      else if (Dim == 3 && is_near(p[Dim - 1], box.min()[Dim - 1]))
        side = 5;
      else if (Dim == 3 && is_near(p[Dim - 1], box.max()[Dim - 1]))
        side = 6;
      return std::optional(Label{side + offset});
    };
  }
  Test read_box(const Node& node) const {
    const Node corners = node["box"];
    if (!corners.json().is_array() || corners.json().size() != 2) corners.fail("two corners: [[...], [...]]");
    const bool is_relative = node["relative"].boolean(false);
    const Box<Dim> box(read_point(corners.at(0), is_relative), read_point(corners.at(1), is_relative));
    return [box](const Vec<Dim>& p) { return box.contains(p); };
  }
  Test read_sphere(const Node& node) const {
    const bool is_relative = node["relative"].boolean(false);
    if (!node.has("radius")) node["radius"].fail("the radius of the sphere");
    const Vec<Dim> center = read_point(node["center"], is_relative);
    const double radius = read_radius(node["radius"], is_relative);
    return [=](const Vec<Dim>& p) { return (p - center).norm() <= radius; };
  }
  Test read_cylinder(const Node& node) const {
    const bool is_relative = node["relative"].boolean(false);
    const Vec<Dim> begin = read_point(node["p1"], is_relative), end = read_point(node["p2"], is_relative);
    const double radius = read_radius(node["radius"], is_relative);
    const double length = (end - begin).norm();
    if (!(length > 0)) node["p2"].fail("a point other than p1");
    const Vec<Dim> axis = (end - begin) / length;
    return [=](const Vec<Dim>& p) {
      const double along = (p - begin).dot(axis);
      return along >= 0 && along <= length && (p - begin - along * axis).norm() <= radius;
    };
  }
  Test read_axis(const Node& node) const {
    const Node axis_node = node["axis"];
    int axis = 0;  // 1 to Dim, negative for the other direction
    if (axis_node.json().is_string()) {
      const std::string name = axis_node.string("");
      const bool has_sign = name.size() == 2 && (name[0] == '+' || name[0] == '-');
      const auto found = std::string_view("xyz").find(has_sign || name.size() == 1 ? name.back() : '?');
      if (found != std::string_view::npos) axis = static_cast<int>(found) + 1;
      if (has_sign && name[0] == '-') axis = -axis;
    } else {
      axis = axis_node.integer(0);
    }
    if (axis == 0 || std::abs(axis) > Dim)
      axis_node.fail(Dim == 2 ? "1, 2, -1, -2 or [+-]x, y" : "1 to 3, -1 to -3 or [+-]x, y, z");
    const int a = std::abs(axis) - 1;
    const bool is_relative = node["relative"].boolean(false);
    const Node place = node["position"];
    if (!place.exists()) place.fail("where on the axis the selection begins");
    double position = (is_relative ? place.without_units() : place).number(0);
    if (is_relative) position = box_.min()[a] + position * box_.sizes()[a];
    return [=](const Vec<Dim>& p) { return axis > 0 ? p[a] >= position : p[a] <= position; };
  }
  Test read_plane(const Node& node) const {
    const Vec<Dim> normal = read_point(node["normal"], false);
    if (normal.isZero(0)) node["normal"].fail("a direction");
    const bool is_relative = node["relative"].boolean(false);
    if (!node.has("point") && !node.has("offset")) node["point"].fail("a point of the plane, or its offset");
    const Vec<Dim> point =
        node.has("point") ? read_point(node["point"], is_relative) : (normal * node["offset"].number(0)).eval();
    return [=](const Vec<Dim>& p) { return (p - point).dot(normal) >= 0; };
  }
  Vec<Dim> read_point(const Node& list, bool is_relative) const {
    const std::vector<double> values = (is_relative ? list.without_units() : list).numbers();
    if (values.size() != Dim) list.fail(std::to_string(Dim) + " numbers");
    const Vec<Dim> point = Eigen::Map<const Vec<Dim>>(values.data());
    return is_relative ? (box_.min() + point.cwiseProduct(box_.sizes())).eval() : point;
  }
  double read_radius(const Node& node, bool is_relative) const {
    return is_relative ? node.without_units().non_negative(0) * box_.diagonal().norm() : node.non_negative(0);
  }

  Box<Dim> box_;
  std::vector<Rule> rules_;
  std::set<int> numbers_;              ///< that rules give
  std::vector<std::string> pointers_;  ///< of the rules; empty for those without a region
  mutable std::vector<char> matched_;  ///< whether a call was answered by the rule
};

}  // namespace itr::scene
