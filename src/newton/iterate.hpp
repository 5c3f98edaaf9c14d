// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "core/timer.hpp"
#include "newton/newton.hpp"

namespace itr {

/// Norms over the unknowns. What they refer to must outlive them.
class Norms {
 public:
  /// `weights` are D of `kind` by dof; empty for the Euclidean one.
  Norms(const DofMap& dofs, NewtonNorm kind, std::span<const double> weights)
      : dofs_(dofs), kind_(kind), weights_(weights) {}

  double of_gradient(ConstVectorView gradient) const {
    return norm(gradient, [&](double g, Eigen::Index i) {
      if (kind_ == NewtonNorm::euclidean) return g;
      return kind_ == NewtonNorm::l2 ? g / std::sqrt(weights_[i]) : g / weights_[i];
    });
  }
  /// Norm over all dofs, held ones included.
  double of_forces(ConstVectorView forces) const {
    double sum = 0, largest = 0;
    for (Eigen::Index i = 0; i < forces.size(); ++i) {
      double entry = forces[i];
      if (kind_ == NewtonNorm::l2) entry /= std::sqrt(weights_[i]);
      if (kind_ == NewtonNorm::linf) entry /= weights_[i];
      sum += entry * entry;
      largest = std::max(largest, entry);
    }
    return kind_ == NewtonNorm::linf ? largest : std::sqrt(sum);
  }
  double of_step(ConstVectorView step) const {
    return norm(step, [&](double p, Eigen::Index i) { return kind_ == NewtonNorm::l2 ? p * std::sqrt(weights_[i]) : p; });
  }
  /// Dot product of two fields over the unknowns, whatever the norm.
  double dot(ConstVectorView a, ConstVectorView b) const {
    double sum = 0;
    for (Eigen::Index i = 0; i < a.size(); ++i)
      if (dofs_.unknown[i] != kNone) sum += a[i] * b[i];
    return sum;
  }

 private:
  template <typename Weighted>
  double norm(ConstVectorView field, const Weighted& weighted) const {
    double sum = 0, largest = 0;
    for (Eigen::Index i = 0; i < field.size(); ++i) {
      if (dofs_.unknown[i] == kNone) continue;
      const double entry = weighted(field[i], i);
      sum += entry * entry;
      largest = std::max(largest, std::abs(entry));
    }
    return kind_ == NewtonNorm::linf ? largest : std::sqrt(sum);
  }

  const DofMap& dofs_;
  NewtonNorm kind_;
  std::span<const double> weights_;
};

/// Energy that a solve minimises, and how. All parts of the solve share it and keep their vectors in the workspace.
struct Task {
  const Energy& energy;
  const DofMap& dofs;
  NewtonSystem& system;
  const NewtonOptions& options;
  const NewtonExtras& extras;
  Workspace& workspace;
  const Norms norms;
  NewtonSummary& summary;  ///< each part adds its seconds and counts

  bool has_unknowns() const { return dofs.num_unknowns > 0; }
};

/// A full step, and what the quadratic model says of it.
struct Step {
  VectorView direction;      ///< over all dofs
  bool is_set = false;       ///< `direction` holds a step
  double norm = 0;           ///< of the options
  double curvature = 0;      ///< direction^T H direction
  bool is_of_shift = false;  ///< it is short because the Hessian was shifted, not because the end is near
};

/// Where a solve is: positions, their energy and its gradient. It alone evaluates the energy, and keeps the time of that.
class Iterate {
 public:
  Iterate(const Task& task, VectorView x)
      : task_(task), x_(x), gradient_(task.workspace.get<Scratch>().gradient.resize(x.size())), value_(value_at(x)) {}

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
  double decrement_of(const Step& step) const { return -0.5 * task_.norms.dot(step.direction, gradient_); }
  /// By how much round-off may change the value.
  double value_round_off() const {
    if (value_round_off_at_ != revision_) {
      const ScopedTimer timer(task_.summary.line_search_seconds);
      value_round_off_ = task_.energy.value_round_off(x_, task_.workspace);
      if (value_round_off_at_ == kNone) first_round_off_ = value_round_off_;
      value_round_off_at_ = revision_;
    }
    return value_round_off_;
  }
  /// The norm of what round-off may change of the gradient.
  double gradient_round_off() const {
    if (gradient_round_off_at_ != revision_) {
      const ScopedTimer timer(task_.summary.assembly_seconds);
      VectorView round_off = task_.workspace.get<Scratch>().round_off.resize(x_.size());
      round_off.setZero();
      task_.energy.add_gradient_round_off(x_, round_off, task_.workspace);
      gradient_round_off_ = task_.norms.of_gradient(round_off);
      gradient_round_off_at_ = revision_;
    }
    return gradient_round_off_;
  }
  /// Whether a step promises less than so many times what the energy resolves.
  bool is_unresolved(const Step& step, double times = 1) const {
    // Round-off costs as much as a gradient. It is asked for where the first one, and what forces have done since, leave it
    // open.
    constexpr double kSafe = 1e4;
    const double decrement = decrement_of(step);
    const bool is_open = value_round_off_at_ == kNone ||
                         decrement < kSafe * (first_round_off_ + std::numeric_limits<double>::epsilon() * work_);
    return is_open && decrement < times * value_round_off();
  }

  double value_at(ConstVectorView x) const {
    const ScopedTimer timer(task_.summary.line_search_seconds);
    return task_.energy.value(x, task_.workspace);
  }
  void gradient_at(ConstVectorView x, VectorView gradient) const {
    const ScopedTimer timer(task_.summary.assembly_seconds);
    gradient.setZero();
    task_.energy.add_gradient(x, gradient, task_.workspace);
  }
  /// Fraction of `direction` that is feasible.
  double free_fraction(ConstVectorView direction) const {
    const ScopedTimer timer(task_.summary.ccd_seconds);
    return task_.energy.max_step(x_, direction, task_.workspace);
  }

  void update_value() { value_ = value_at(x_); }
  void update_gradient() {
    const ScopedTimer timer(task_.summary.assembly_seconds);
    VectorView sizes = task_.workspace.get<Scratch>().sizes.resize(x_.size());
    sizes.setZero();
    gradient_.setZero();
    task_.energy.add_gradient_and_sizes(x_, gradient_, sizes, task_.workspace);
    has_gradient_ = true;
    gradient_norm_ = task_.norms.of_gradient(gradient_);
    force_size_ = task_.norms.of_forces(sizes);
    work_ = sizes.dot(x_.cwiseAbs());
  }
  void move_to(ConstVectorView x, double value) {
    x_ = x;
    value_ = value;
    ++revision_;
  }

 private:
  struct Scratch {
    ScratchVector gradient, sizes, round_off;
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
