// SPDX-License-Identifier: MIT
// Which ids parts of a mesh get (docs/theory.md, "Meshes").
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "sets.hpp"
#include "transformation.hpp"

namespace itr::scene {

template <int Dim>
class Selection {
 public:
  /// `box` is what relative places refer to; `node` may be absent: then nothing matches.
  Selection(const Node& node, const Box<Dim>& box);

  /// The label by the first rule that matches a barycenter; `stored` is the number that the mesh file gave it.
  std::optional<Label> operator()(const Vec<Dim>& p, int stored = 0) const;

  /// Whether a rule gives this number, whatever is stored.
  bool gives(int number) const { return numbers_.contains(number); }

  /// Pointers of the rules with a region that no call has matched so far.
  std::vector<std::string> unmatched() const;

 private:
  using Test = std::function<bool(const Vec<Dim>&)>;
  using Rule = std::function<std::optional<Label>(const Vec<Dim>&, int)>;

  Rule read_rule(const Node& node);
  Rule read_threshold(const Node& node);
  Test read_box(const Node& node) const;
  Test read_sphere(const Node& node) const;
  Test read_cylinder(const Node& node) const;
  Test read_axis(const Node& node) const;
  Test read_plane(const Node& node) const;
  Vec<Dim> read_point(const Node& list, bool is_relative) const;
  double read_radius(const Node& node, bool is_relative) const;

  Box<Dim> box_;
  std::vector<Rule> rules_;
  std::set<int> numbers_;              ///< that rules give
  std::vector<std::string> pointers_;  ///< of the rules; empty for those without a region
  mutable std::vector<char> matched_;  ///< whether a call was answered by the rule
};

}  // namespace itr::scene
