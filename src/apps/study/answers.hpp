// SPDX-License-Identifier: MIT
// From rows to sentences: which run to take for an error, where remeshing pays, what rules, which solver.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doubts.hpp"
#include "report.hpp"

namespace itr::cli::study {

/// Cost of one series against uniform refinement at equal error: with linear elements, and with quadratic ones.
struct Verdict {
  struct Point {
    std::string run;
    double error = 0, seconds = 0;
    double time_ratio = 0,    ///< by uniform refinement's with linear elements, between its levels
        quadratic_ratio = 0,  ///< by that with quadratic ones
        unknowns_ratio = 0;   ///< all NaN where it has not that error
    std::string beaten_by;    ///< run of the series with a smaller error in less time; empty: none
    bool is_large = false;    ///< an error of which nothing is said
  };
  const Series* series;
  const Measure* measure;
  std::vector<Point> points;   ///< the largest error first
  bool is_recommended = true;  ///< false: its errors are not those of meshes, or all are large
  /// The largest error from which on all of its runs take less time than either uniform refinement; none: nowhere.
  std::optional<double> pays_from;
  /// The largest error at which it takes longer than the finest uniform run, whose error is larger still: what uniform
  /// refinement would take is not known from there on.
  std::optional<double> untold_from;
  double largest_error = 0;  ///< of which something is said
  Point finest_uniform;      ///< the least error of the uniform levels, and the seconds of the dearest
};
std::vector<Verdict> verdicts(const Results& results);

std::vector<std::string> answers(const Results& results);

/// For each error of a ladder the run to take, as Markdown: the cheapest that reaches it, of those that a verdict says to
/// pay at it; where none does, of uniform refinement, if that reaches it. Empty where nothing is recommended.
std::string choices_table(const Results& results);

}  // namespace itr::cli::study
