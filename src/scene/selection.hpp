// SPDX-License-Identifier: MIT
// Which ids parts of a mesh get (docs/theory.md, "Meshes").
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "transformation.hpp"

namespace itr::scene {

template <int Dim>
class Selection {
 public:
  /// `box` is what relative places refer to; `node` may be absent: then nothing matches.
  Selection(const Node& node, const Box<Dim>& box);

  /// Id of the first rule that matches a barycenter; `stored` is the id that the mesh file gave it.
  std::optional<int> operator()(const Vec<Dim>& p, int stored = 0) const;

  /// Pointers of the rules with a region that no call has matched so far.
  std::vector<std::string> unmatched() const;

 private:
  using Test = std::function<bool(const Vec<Dim>&)>;
  using Rule = std::function<std::optional<int>(const Vec<Dim>&, int)>;

  Rule read_rule(const Node& node) const;
  Rule read_threshold(const Node& node) const;
  Test read_box(const Node& node) const;
  Test read_sphere(const Node& node) const;
  Test read_cylinder(const Node& node) const;
  Test read_axis(const Node& node) const;
  Test read_plane(const Node& node) const;
  Vec<Dim> read_point(const Node& list, bool is_relative) const;
  double read_radius(const Node& node, bool is_relative) const;

  Box<Dim> box_;
  std::vector<Rule> rules_;
  std::vector<std::string> pointers_;  ///< of the rules; empty for those without a region
  mutable std::vector<char> matched_;  ///< whether a call was answered by the rule
};

/// An id of a selection or condition: 0 to 2147483646.
int read_id(const Node& node, int fallback);

}  // namespace itr::scene
