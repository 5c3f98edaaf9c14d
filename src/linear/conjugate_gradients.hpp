// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "core/noise.hpp"
#include "itr/solver.hpp"
#include "linear/low_rank.hpp"

namespace itr::linear {

/// (A + U U^T) x = b, A by its lower triangle. It refers to what others own.
struct SystemView {
  const SparsityPattern& pattern;
  std::span<const double> values, b;
  const MatrixX* U = nullptr;  ///< null: none
};

inline double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// y = (A + U U^T) x.
inline void multiply(const SystemView& system, std::span<const double> x, std::span<double> y) {
  const auto& [pattern, values, b, U] = system;
  std::ranges::fill(y, 0.0);
  for (int j = 0; j < pattern.order; ++j) {
    const int diagonal = pattern.column_starts[j], end = pattern.column_starts[j + 1];
    double row = values[diagonal] * x[j];
    for (int p = diagonal + 1; p < end; ++p) {
      const int i = pattern.row_indices[p];
      y[i] += values[p] * x[j];
      row += values[p] * x[i];
    }
    y[j] += row;
  }
  if (U) add_low_rank(*U, as_vector(x), as_vector(y));
}

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
  bool begin(const SystemView& system, const Preconditioner& precondition) {
    const std::size_t n = system.b.size();
    for (auto* vector : {&x_, &r_, &z_, &p_, &q_}) vector->resize(n);
    const double scale = kNoise * norm(system.b) / std::sqrt(static_cast<double>(n));
    for (std::size_t i = 0; i < n; ++i) r_[i] = system.b[i] + scale * noise(i);
    if (!precondition(r_, x_)) return false;
    compute_residual(system);
    return true;
  }
  /// Goes on to a residual of `target`, relative to b, with at most so many iterations.
  End run(const SystemView& system, const Preconditioner& precondition, double target, int most) {
    const double scale = norm(system.b);
    const End end = iterate(system, precondition, target * scale, most);
    if (end != End::reached) return end;
    compute_residual(system);
    residual_ = norm(r_) / scale;
    return residual_ <= target ? End::reached : End::too_slow;
  }

  static double norm(std::span<const double> a) { return std::sqrt(dot(a, a)); }

  std::span<const double> solution() const { return x_; }
  double residual() const { return residual_; }   ///< relative, computed from the solution
  int iterations() const { return iterations_; }  ///< of the last run

 private:
  static constexpr int kTellsRate = 6;       ///< iterations after which their rate is known roughly, to a factor of two
  static constexpr double kCertain = 1e-12;  ///< negative curvature, relative, that is no round-off
  static constexpr double kNoise = 1e-2;     ///< of the right-hand side: what iterations start from in every direction

  End iterate(const SystemView& system, const Preconditioner& precondition, double target, int most) {
    const std::size_t n = r_.size();
    const double first = norm(r_);
    double product = 0;
    for (iterations_ = 1; iterations_ <= most; ++iterations_) {
      const int k = iterations_;
      if (!precondition(r_, z_)) return End::too_slow;
      const double before = std::exchange(product, dot(r_, z_));
      const double fraction = k == 1 ? 0 : product / before;
      for (std::size_t i = 0; i < n; ++i) p_[i] = z_[i] + fraction * p_[i];
      multiply(system, p_, q_);
      const double curvature = dot(p_, q_);
      if (product > 0 && curvature < -kCertain * norm(p_) * norm(q_)) return End::negative;
      if (!(product > 0) || !(curvature > 0)) return End::too_slow;
      const double length = product / curvature;
      for (std::size_t i = 0; i < n; ++i) {
        x_[i] += length * p_[i];
        r_[i] -= length * q_[i];
      }
      const double now = norm(r_);
      if (now <= target) return End::reached;
      const double by_rate = k * std::log(target / first) / std::min(-1e-3, std::log(now / first));
      if (k >= kTellsRate && by_rate > 2.0 * most) return End::too_slow;
    }
    iterations_ = std::max(0, most);
    return End::too_slow;
  }
  void compute_residual(const SystemView& system) {
    multiply(system, x_, q_);
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] = system.b[i] - q_[i];
  }

  std::vector<double> x_, r_, z_, p_, q_;
  double residual_ = 1;
  int iterations_ = 0;
};

}  // namespace itr::linear
