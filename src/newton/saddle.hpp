// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>

#include "core/timer.hpp"
#include "curvature.hpp"
#include "direction.hpp"
#include "search.hpp"

namespace itr {

/// The way off a saddle, where Newton's method would end as if it were a minimum.
class Saddle {
 public:
  Saddle(const Task& task, Iterate& at, Direction& direction, Search& search)
      : task_(task),
        at_(at),
        direction_(direction),
        search_(search),
        candidate_(task.workspace.get<Scratch>().candidate.resize(at.x().size())) {}

  bool is_here() {
    if (task_.options.indefinite == IndefiniteHessian::accept || !task_.has_unknowns()) return false;
    return asks_products() ? curvature_by_products() < 0 : direction_.is_hessian_indefinite();
  }
  /// Called before a solve ends: leaves x if it is a saddle. Returns whether x has moved to a lower energy.
  bool leave() { return is_here() && descend(); }

 private:
  static constexpr double kResolved = 1e4;  ///< times its round-off: the change of energy that the first step exceeds
  static constexpr int kMostDoublings = 12;

  struct Scratch {
    ScratchVector candidate;
  };
  /// Goes along an eigenvector of a negative eigenvalue as long as that lowers the energy.
  bool descend() {
    VectorView direction = direction_.step().direction;
    if (!find_descent(direction)) return false;
    for (int k = 0; k < kMostDoublings; ++k, direction *= 2) {
      if (at_.free_fraction(direction) < 1) return false;
      candidate_ = at_.x() + direction;
      const double value = at_.value_at(candidate_);
      if (!(value < at_.value())) continue;
      at_.move_to(candidate_, value);
      search_.go_on(direction);
      return true;
    }
    return false;
  }
  /// The shortest step whose change of energy exceeds round-off, down the slope. If the slope is round-off, the sign of the
  /// eigenvector decides, which is the same for all linear solvers; the other branch may be as low.
  bool find_descent(VectorView direction) {
    VectorX eigenvector;
    double curvature = 0;
    if (asks_products()) {
      curvature = curvature_by_products();
      eigenvector = eigenvector_;
    } else {
      direction_.assemble(PsdProjection::none);
      const ScopedTimer timer(task_.summary.linear_seconds);
      curvature = find_negative_curvature(task_.system, task_.dofs.num_unknowns, eigenvector);
    }
    if (!(curvature < 0)) return false;
    direction.setZero();
    for (Eigen::Index i = 0; i < direction.size(); ++i)
      if (task_.dofs.unknown[i] != kNone) direction[i] = eigenvector[task_.dofs.unknown[i]];
    const double resolved = kResolved * at_.value_round_off();
    direction *= std::max(task_.options.step_tolerance, std::sqrt(2 * resolved / -curvature));
    if (direction.dot(at_.gradient()) > resolved) direction = -direction;
    return true;
  }
  /// Iterations may tell of negative curvature that they meet, but those from a symmetric right-hand side meet none without
  /// that symmetry.
  bool asks_products() const { return task_.extras.must_be_minimum && !task_.system.sees_all_directions(); }
  /// Asks once for each x.
  double curvature_by_products() {
    if (known_at_ == at_.revision()) return curvature_;
    known_at_ = at_.revision();
    const auto assemble = [this](PsdProjection psd) { direction_.assemble(psd); };
    const ScopedTimer timer(task_.summary.linear_seconds);
    const auto found = find_negative_curvature_by_products(task_.system, assemble, task_.dofs.num_unknowns, eigenvector_);
    return curvature_ = found.value_or(0);
  }

  const Task& task_;
  Iterate& at_;
  Direction& direction_;
  Search& search_;
  VectorView candidate_;
  VectorX eigenvector_;  ///< by products, of the curvature below
  double curvature_ = 0;
  int known_at_ = kNone;  ///< revision of x where that was
};

}  // namespace itr
