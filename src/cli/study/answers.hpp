// SPDX-License-Identifier: MIT
// From rows to sentences: which run to take for an error, where remeshing pays, what rules, which solver.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report.hpp"

namespace itr::cli::study {

/// Of a series, fitted over its runs: error = C * size^in_size, error = C * seconds^-in_seconds.
struct Order {
  std::string series, measure;
  double in_size = 0, in_seconds = 0;
  int runs = 0;
};
/// For series of at least three runs with that error.
std::vector<Order> orders(const Results& results);

/// What one series costs against uniform refinement at equal error.
struct Verdict {
  struct Point {
    double error = 0, seconds = 0;
    double time_ratio = 0,
           unknowns_ratio = 0;  ///< by uniform refinement's, between its levels; NaN where it has not that error
  };
  const Series* series;
  const Measure* measure;
  std::vector<Point> points;        ///< the largest error first; runs that another of the series beats are left out
  std::optional<double> pays_from;  ///< the largest error from which on it takes less time at all errors; none: nowhere
  /// The largest error at which it takes longer than the finest uniform run, whose error is larger still: what uniform
  /// refinement would take is not known from there on.
  std::optional<double> untold_from;
  double largest_error = 0;
  Point finest_uniform;  ///< the least error of the uniform levels, and the seconds of the dearest
};
std::vector<Verdict> verdicts(const Results& results);

std::vector<std::string> answers(const Results& results);

/// For each error of a ladder the run that reaches it in least time, as Markdown; empty where no run has an error.
std::string choices_table(const Results& results);

}  // namespace itr::cli::study
