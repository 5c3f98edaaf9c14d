// SPDX-License-Identifier: MIT
// Finds mistakes and gaps in a study's reference and runs: said before anything is made of them.
#pragma once

#include <string>
#include <vector>

#include "report.hpp"

namespace itr::cli::study {

inline constexpr double kLargeError = 0.5;  ///< of the reference's size: beyond it a run is no approximation

/// Orders of a series, fitted over its runs: error = C * size^in_size, error = C * seconds^-in_seconds.
struct Order {
  std::string series, measure;
  double in_size = 0, in_seconds = 0;
  int runs = 0;
};
/// For series of at least three runs with that error.
std::vector<Order> orders(const Results& results);
/// Whether it is beyond what meshes can do: then it is not meshes that the errors are of.
bool is_impossible(const Order& order);

bool is_large(const Results& results, const Row& row, const Measure& measure);
/// Whether anything is recommended by these errors: no run is near the reference, or uniform refinement's order is
/// impossible.
bool can_recommend(const Results& results, const Measure& measure);
/// The doubts about one series, its own order among them.
bool can_recommend(const Results& results, const Measure& measure, const std::string& series);

/// In words, the gravest first; the last says what the reference is worth.
std::vector<std::string> doubts(const Results& results);

}  // namespace itr::cli::study
