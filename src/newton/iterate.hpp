// SPDX-License-Identifier: MIT
#pragma once

#include "task.hpp"

namespace itr {

/// Where a solve is: positions, their energy and its gradient. It alone evaluates the energy, and keeps the time of that.
class Iterate {
 public:
  Iterate(const Task& task, VectorView x);

  const VectorView& x() const { return x_; }
  double value() const { return value_; }
  double first_value() const { return first_value_; }  ///< where the solve began
  /// Of the last update_gradient.
  const VectorView& gradient() const { return gradient_; }
  bool has_gradient() const { return has_gradient_; }
  double gradient_norm() const { return gradient_norm_; }
  /// Grows with each move: what was found out at the same revision is still true.
  int revision() const { return revision_; }

  /// The decrease of energy that the quadratic model promises for a full Newton step.
  double decrement_of(const Step& step) const { return -0.5 * task_.norms.dot(step.way, gradient_); }
  /// Whether a step promises less than a sum of many terms resolves, or changes only the last bits of positions.
  bool is_unresolved(const Step& step) const;

  double value_at(ConstVectorView x) const;
  void gradient_at(ConstVectorView x, VectorView gradient) const;
  /// Share of a way that is feasible.
  double free_share(ConstVectorView way) const;

  void update_value() { value_ = value_at(x_); }
  void update_gradient();
  void move_to(ConstVectorView x, double value);

 private:
  struct Kept {
    KeptVector gradient;
  };
  const Task& task_;
  VectorView x_, gradient_;
  double value_, first_value_;
  double gradient_norm_ = 0;
  bool has_gradient_ = false;
  int revision_ = 0;
};

/// Relative change of energy that a sum of many terms does not resolve.
inline constexpr double kUnresolved = 1e-14;

}  // namespace itr
