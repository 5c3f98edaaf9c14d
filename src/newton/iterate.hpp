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
  /// Gradient at the last update_gradient.
  const VectorView& gradient() const { return gradient_; }
  bool has_gradient() const { return has_gradient_; }
  double gradient_norm() const { return gradient_norm_; }
  /// The norm of the forces that act, of which the gradient is the sum: those of each term, on held dofs, too.
  double force_size() const { return force_size_; }
  /// Grows with each move: what was found out at the same revision is still true.
  int revision() const { return revision_; }

  /// The decrease of energy that the quadratic model promises for a full Newton step.
  double decrement_of(const Step& step) const { return -0.5 * task_.norms.dot(step.way, gradient_); }
  /// By how much round-off may change the value.
  double value_round_off() const;
  /// The norm of what round-off may change of the gradient.
  double gradient_round_off() const;
  /// Whether a step promises less than the energy resolves.
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
    KeptVector gradient, sizes, round_off;
  };
  const Task& task_;
  VectorView x_, gradient_;
  double value_;
  double gradient_norm_ = 0, force_size_ = 0;
  double work_ = 0;  ///< of the sizes of all forces along x
  mutable double first_round_off_ = 0, value_round_off_ = 0, gradient_round_off_ = 0;
  mutable int value_round_off_at_ = kNone, gradient_round_off_at_ = kNone;  ///< revisions of x
  bool has_gradient_ = false;
  int revision_ = 0;
};

}  // namespace itr
