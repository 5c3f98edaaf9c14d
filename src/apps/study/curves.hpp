// SPDX-License-Identifier: MIT
// Errors against costs, as points of the runs of a study.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report.hpp"

namespace itr::cli::study {

/// A run with an error and a cost, both positive.
struct Point {
  const Row* row;
  double error, cost;
};

/// Points of these series (none: of all that are compared with the reference and vary the mesh), the largest error first.
/// Runs that are not certified or that flies() names have none, nor has the reference.
std::vector<Point> points(const Results& results, const std::vector<std::string>& series, const Measure& measure,
                          const Cost& cost);
/// Points with runs whose errors are not told, at the reference's worth: they reach it, if not less.
std::vector<Point> points_reached(const Results& results, const std::vector<std::string>& series, const Measure& measure,
                                  const Cost& cost);

/// Points that no other run beats in both.
std::vector<Point> front(const std::vector<Point>& all);

/// Cost of an error, by straight lines in logarithms; the cheapest run's cost for larger errors; none for smaller ones.
std::optional<double> cost_at(const std::vector<Point>& front, double error);

/// Slope of the logarithm of the error over that of the cost; NaN where all cost the same.
double slope(const std::vector<Point>& all);

/// Uniform refinement with linear elements: `uniform` and, for boxes in 3D, `rows`.
const std::vector<std::string>& linear_uniform();

/// Tells whether answers are about a measure; the others are in tables and plots.
bool is_judged(const Measure& measure);

/// "0.12 %", "3.1 J"
std::string show(double error, const Measure& measure);

}  // namespace itr::cli::study
