// SPDX-License-Identifier: MIT
// The factor g(t) that scales a boundary value over time (docs/theory.md, "Conditions").
#pragma once

#include <Eigen/Sparse>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "node.hpp"

namespace itr::scene {

class Interpolation {
 public:
  enum class Kind { none, linear, linear_ramp, piecewise_constant, piecewise_linear, piecewise_cubic };
  enum class Extend { constant, extrapolate, repeat, repeat_offset };

  Interpolation() = default;  ///< g = 1
  /// Throws InputError for a wrong type, or points that do not increase or do not match the values.
  explicit Interpolation(const Node& node) {
    kind_ = static_cast<Kind>(node["type"].choice(
        {"none", "linear", "linear_ramp", "piecewise_constant", "piecewise_linear", "piecewise_cubic"}, -1));
    if (!node.has("type")) node["type"].fail("the type of interpolation");
    if (kind_ == Kind::linear_ramp) {
      if (!node.has("to")) node["to"].fail("the end of the ramp");
      from_ = node["from"].number(0);
      to_ = node["to"].number(0);
      if (to_ < from_) node["to"].fail("a number >= from");
    }
    if (kind_ < Kind::piecewise_constant) return;
    read_points(node);
    if (kind_ == Kind::piecewise_cubic && points_.size() > 1) fit_spline();
  }

  double operator()(double t) const {
    switch (kind_) {
      case Kind::none:
        return 1;
      case Kind::linear:
        return t;
      case Kind::linear_ramp:
        return std::clamp(t, from_, to_) - from_;
      default:
        break;
    }
    if (t < points_.front() || t >= points_.back()) return outside(t);
    const auto after = std::upper_bound(points_.begin(), points_.end(), t);
    return inside(t, static_cast<std::size_t>(after - points_.begin()) - 1);
  }
  bool is_one() const { return kind_ == Kind::none; }
  /// Times between these two at which g is not smooth: ends of a ramp and points, of all periods.
  std::vector<double> kinks(double begin, double end) const {
    if (kind_ == Kind::linear_ramp) return {from_, to_};
    std::vector<double> found = points_;
    const bool repeats = extend_ == Extend::repeat || extend_ == Extend::repeat_offset;
    const double period = points_.empty() ? 0 : points_.back() - points_.front();
    if (!repeats || period == 0) return found;
    found.clear();
    for (double turn = std::floor((begin - points_.front()) / period); points_.front() + turn * period <= end; ++turn)
      for (const double point : points_) found.push_back(point + turn * period);
    return found;
  }

 private:
  void read_points(const Node& node) {
    points_ = node["points"].numbers();
    values_ = node["values"].numbers();
    extend_ = static_cast<Extend>(node["extend"].choice({"constant", "extrapolate", "repeat", "repeat_offset"}, 0));
    if (points_.empty()) node["points"].fail("at least one point in time");
    if (std::adjacent_find(points_.begin(), points_.end(), std::greater_equal<>()) != points_.end())
      node["points"].fail("points in time that increase strictly");
    if (values_.size() != points_.size()) node["values"].fail("as many values as points: " + std::to_string(points_.size()));
  }
  /// Fits a C2 cubic by its second derivatives m at the points. Row i says that the slopes of both pieces agree at point i;
  /// the end rows say: slope zero (constant), m = 0 (extrapolate), or slope and m periodic (repeat, repeat_offset).
  void fit_spline() {
    const int n = static_cast<int>(points_.size());
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    const auto width = [&](int i) { return points_[i + 1] - points_[i]; };
    const auto chord = [&](int i) { return (values_[i + 1] - values_[i]) / width(i); };
    const auto add_slope_at_begin = [&](int row, int i, double sign) {  // chord - h/6 (2 m_i + m_i+1)
      entries.emplace_back(row, i, -sign * width(i) / 3);
      entries.emplace_back(row, i + 1, -sign * width(i) / 6);
      right[row] -= sign * chord(i);
    };
    const auto add_slope_at_end = [&](int row, int i, double sign) {  // chord + h/6 (m_i + 2 m_i+1)
      entries.emplace_back(row, i, sign * width(i) / 6);
      entries.emplace_back(row, i + 1, sign * width(i) / 3);
      right[row] -= sign * chord(i);
    };
    for (int i = 1; i + 1 < n; ++i) {
      add_slope_at_end(i, i - 1, 1);
      add_slope_at_begin(i, i, -1);
    }
    if (extend_ == Extend::constant) {
      add_slope_at_begin(0, 0, 1);
      add_slope_at_end(n - 1, n - 2, 1);
    } else if (extend_ == Extend::extrapolate) {
      entries.emplace_back(0, 0, 1);
      entries.emplace_back(n - 1, n - 1, 1);
    } else {
      add_slope_at_end(0, n - 2, 1);
      add_slope_at_begin(0, 0, -1);
      entries.emplace_back(n - 1, 0, 1);
      entries.emplace_back(n - 1, n - 1, -1);
    }
    Eigen::SparseMatrix<double> matrix(n, n);
    matrix.setFromTriplets(entries.begin(), entries.end());
    const Eigen::VectorXd m = Eigen::SparseLU<Eigen::SparseMatrix<double>>(matrix).solve(right);
    curvature_.assign(m.data(), m.data() + n);
  }
  /// Evaluates g on [points_i, points_i+1].
  double inside(double t, std::size_t i) const {
    if (kind_ == Kind::piecewise_constant) return values_[i];
    const double h = points_[i + 1] - points_[i];
    const double b = (t - points_[i]) / h, a = 1 - b;
    const double line = a * values_[i] + b * values_[i + 1];
    if (kind_ == Kind::piecewise_linear) return line;
    return line + h * h / 6 * ((a * a * a - a) * curvature_[i] + (b * b * b - b) * curvature_[i + 1]);
  }
  double slope(double t, std::size_t i) const {
    if (kind_ == Kind::piecewise_constant) return 0;
    const double h = points_[i + 1] - points_[i];
    const double chord = (values_[i + 1] - values_[i]) / h;
    if (kind_ == Kind::piecewise_linear) return chord;
    const double b = (t - points_[i]) / h, a = 1 - b;
    return chord + h / 6 * ((1 - 3 * a * a) * curvature_[i] + (3 * b * b - 1) * curvature_[i + 1]);
  }
  double outside(double t) const {
    const bool before = t < points_.front();
    const double end = before ? points_.front() : points_.back();
    const double value = before ? values_.front() : values_.back();
    const double period = points_.back() - points_.front();
    if (extend_ == Extend::constant || period == 0) return value;
    if (extend_ == Extend::extrapolate) return value + slope(end, before ? 0 : points_.size() - 2) * (t - end);
    const double turns = std::floor((t - points_.front()) / period);
    // Rounding may leave the wrapped time just outside of the first period.
    const double last = std::nextafter(points_.back(), points_.front());
    const double wrapped = std::clamp(t - turns * period, points_.front(), last);
    const double offset = extend_ == Extend::repeat_offset ? turns * (values_.back() - values_.front()) : 0;
    return (*this)(wrapped) + offset;
  }

  Kind kind_ = Kind::none;
  Extend extend_ = Extend::constant;
  double from_ = 0, to_ = 0;
  std::vector<double> points_, values_;
  std::vector<double> curvature_;  ///< second derivatives of the spline at the points
};

}  // namespace itr::scene
