// SPDX-License-Identifier: MIT
// Conditions on facets that are of several sets.
#pragma once

#include <algorithm>
#include <type_traits>
#include <utility>
#include <vector>

#include "itr/setup.hpp"

namespace itr::scene {

/// The condition on this tag, or the end.
template <typename Condition>
auto find_condition(std::vector<Condition>& all, int tag) {
  return std::find_if(all.begin(), all.end(), [&](const Condition& other) { return other.tag == tag; });
}

/// Adds what holds a tag: in each component the condition counts that was there first. Returns whether all of it counts.
template <int Dim>
bool add_condition(std::vector<DirichletCondition<Dim>>& all, DirichletCondition<Dim> added) {
  const auto earlier = find_condition(all, added.tag);
  if (earlier == all.end()) {
    all.push_back(std::move(added));
    return true;
  }
  bool counts = true;
  for (int c = 0; c < Dim; ++c) {
    counts = counts && !(added.components[c] && earlier->components[c]);
    added.components[c] = added.components[c] && !earlier->components[c];
    earlier->components[c] = earlier->components[c] || added.components[c];
  }
  earlier->displacement = [first = earlier->displacement, second = added.displacement, of_second = added.components](
                              const RestPoint<Dim>& X, double t) {
    Vec<Dim> value = first(X, t);
    const Vec<Dim> other = second(X, t);
    for (int c = 0; c < Dim; ++c)
      if (of_second[c]) value[c] = other[c];
    return value;
  };
  return counts;
}

/// Adds a load to those that a tag has already.
template <int Dim, typename Condition, typename Function>
void add_load(std::vector<Condition>& all, Condition added, Function Condition::*value) {
  const auto earlier = find_condition(all, added.tag);
  if (earlier == all.end()) return all.push_back(std::move(added));
  using Value = std::invoke_result_t<Function, const RestPoint<Dim>&, double>;
  Function& sum = (*earlier).*value;
  sum = [first = sum, second = added.*value](const RestPoint<Dim>& X, double t) {
    return Value(first(X, t) + second(X, t));
  };
}

}  // namespace itr::scene
