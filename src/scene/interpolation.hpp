// SPDX-License-Identifier: MIT
// The factor g(t) that scales a boundary value over time (docs/theory.md, "Conditions").
#pragma once

#include <vector>

#include "node.hpp"

namespace itr::scene {

class Interpolation {
 public:
  enum class Kind { none, linear, linear_ramp, piecewise_constant, piecewise_linear, piecewise_cubic };
  enum class Extend { constant, extrapolate, repeat, repeat_offset };

  Interpolation() = default;  ///< g = 1
  /// Throws InputError for a wrong type, or points that do not increase or do not match the values.
  explicit Interpolation(const Node& node);

  double operator()(double t) const;
  bool is_one() const { return kind_ == Kind::none; }

 private:
  void read_points(const Node& node);
  void fit_spline();
  double inside(double t, std::size_t i) const;  ///< on [points_i, points_i+1]
  double slope(double t, std::size_t i) const;
  double outside(double t) const;

  Kind kind_ = Kind::none;
  Extend extend_ = Extend::constant;
  double from_ = 0, to_ = 0;
  std::vector<double> points_, values_;
  std::vector<double> curvature_;  ///< second derivatives of the spline at the points
};

}  // namespace itr::scene
