// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "itr/solver.hpp"

namespace itr::linear {

/// A x = b, of a lower triangle. It refers to what others own.
struct SystemView {
  const SparsityPattern& pattern;
  std::span<const double> values, b;
};

/// Conjugate gradients with a given preconditioner. The solution is kept, and can be given more digits.
class ConjugateGradients {
 public:
  /// z from a residual; false where it fails.
  using Preconditioner = std::function<bool(std::span<const double> residual, std::span<double> z)>;
  enum class End {
    reached,   ///< the target
    too_slow,  ///< not within the iterations allowed, or the preconditioner fails
    negative   ///< met a direction of negative curvature
  };

  /// Starts from an error with a part in every direction. False where the preconditioner fails.
  bool begin(const SystemView& system, const Preconditioner& precondition);
  /// Goes on to a residual of `target`, relative to b, with at most so many iterations.
  End run(const SystemView& system, const Preconditioner& precondition, double target, int most);

  static double norm(std::span<const double> a);

  std::span<const double> solution() const { return x_; }
  double residual() const { return residual_; }   ///< relative, computed from the solution
  int iterations() const { return iterations_; }  ///< of the last run

 private:
  End iterate(const SystemView& system, const Preconditioner& precondition, double target, int most);
  void compute_residual(const SystemView& system);

  std::vector<double> x_, r_, z_, p_, q_;
  double residual_ = 1;
  int iterations_ = 0;
};

}  // namespace itr::linear
