// SPDX-License-Identifier: MIT
#include "blocked_step.hpp"

#include <algorithm>
#include <cmath>

namespace itr {

namespace {

constexpr int kMostRounds = 6;            ///< gaps are linearised so often
constexpr Eigen::Index kMostPairs = 128;  ///< a back-solve each
constexpr double kAhead = 4;              ///< pairs that stop the step within so many times its free share are bounded
constexpr double kFreeEnough = 0.5;       ///< share of the step with which it is done
constexpr double kLongest = 10;           ///< of the step's largest motion: a turned one is not longer

/// Solves for the multipliers l >= 0 of the bounds S l >= asked by Gauss-Seidel. A multiplier is 0 if its bound holds
/// without it.
VectorX find_multipliers(const MatrixX& S, const VectorX& asked) {
  constexpr int kMostSweeps = 500;
  constexpr double kSettled = 1e-9;
  VectorX l = VectorX::Zero(asked.size());
  const double scale = asked.lpNorm<Eigen::Infinity>();
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double change = 0;
    for (Eigen::Index i = 0; i < l.size(); ++i) {
      if (!(S(i, i) > 0)) continue;
      const double next = std::max(0.0, l[i] + (asked[i] - S.row(i).dot(l)) / S(i, i));
      change = std::max(change, std::abs(next - l[i]) * S(i, i));
      l[i] = next;
    }
    if (change <= kSettled * scale) break;
  }
  return l;
}

/// The quadratic model along a step; `change` is that of its energy at a share of the step.
struct ModelAlong {
  double slope, curvature;
  double change(double share) const { return share * slope + 0.5 * share * share * curvature; }
};

/// Bounds on the gaps of pairs, and the corrections of a step by forces between these pairs.
class BoundedGaps {
 public:
  BoundedGaps(const DofMap& dofs, NewtonSystem& system) : dofs_(dofs), system_(system) {}

  /// Takes over the bounds, linearised at the present step. A pair keeps the direction of force of its first round, so that
  /// its correction is solved for only once. Returns false if there are no bounds, too many, or a solve fails.
  bool update(const std::vector<BlockingPairs::Bound>& bounds, const VectorX& correction) {
    const auto count = static_cast<Eigen::Index>(bounds.size()), known = forces_.cols();
    if (count == 0 || count > kMostPairs) return false;
    rows_.setZero(dofs_.num_unknowns, count);
    asked_.resize(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const BlockingPairs::Bound& bound = bounds[i];
      for (int k = 0; k < bound.size; ++k)
        if (const int unknown = dofs_.unknown[bound.dofs[k]]; unknown != kNone) rows_(unknown, i) += bound.coefficients[k];
      asked_[i] = bound.missing + rows_.col(i).dot(correction);
    }
    if (count > known) {
      MatrixX solved;
      if (!system_.solve_columns(rows_.rightCols(count - known), solved)) return false;
      forces_.conservativeResize(dofs_.num_unknowns, count);
      corrections_.conservativeResize(dofs_.num_unknowns, count);
      forces_.rightCols(count - known) = rows_.rightCols(count - known);
      corrections_.rightCols(count - known) = solved;
    }
    return true;
  }

  /// Computes the least correction, in the norm of the Hessian, that meets the bounds. Returns false if they hold without
  /// one.
  bool correct(VectorX& correction, double& curvature) const {
    const VectorX multipliers = find_multipliers(rows_.transpose() * corrections_, asked_);
    if (multipliers.isZero(0)) return false;
    correction.noalias() = corrections_ * multipliers;
    curvature = correction.dot(forces_ * multipliers);
    return true;
  }

 private:
  const DofMap& dofs_;
  NewtonSystem& system_;
  MatrixX rows_, forces_, corrections_;
  VectorX asked_;
};

}  // namespace

double turn_blocked_step(const StepOrigin& origin, VectorView step, double share) {
  const auto& [energy, x, dofs, gradient, system, workspace] = origin;
  const VectorX first = step;
  // The curvature along a Newton step is minus its slope, because H step = -gradient.
  const double slope = gradient.dot(first);
  double least = ModelAlong{slope, -slope}.change(share), free = share, best_share = share;
  VectorX way = first, correction = VectorX::Zero(dofs.num_unknowns);
  BlockingPairs blocking;
  BoundedGaps gaps(dofs, system);
  for (int round = 0; round < kMostRounds; ++round) {
    if (!energy.find_blocking(x, way, std::min(1.0, kAhead * free), blocking, workspace)) break;
    double curvature_of_correction = 0;
    if (!gaps.update(blocking.bounds, correction) || !gaps.correct(correction, curvature_of_correction)) break;
    double slope_of_correction = 0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const int unknown = dofs.unknown[i];
      if (unknown == kNone) continue;
      way[i] = first[i] + correction[unknown];
      slope_of_correction += gradient[i] * correction[unknown];
    }
    // Nearly dependent bounds ask for forces without limit, and for far motions all pairs are candidates of contact.
    if (!(way.lpNorm<Eigen::Infinity>() <= kLongest * first.lpNorm<Eigen::Infinity>())) break;
    free = energy.max_step(x, way, workspace);
    const ModelAlong model{slope + slope_of_correction, -slope - 2 * slope_of_correction + curvature_of_correction};
    if (model.slope < 0 && model.change(free) < least) {
      least = model.change(free);
      best_share = free;
      step = way;
    }
    if (free >= kFreeEnough) break;
  }
  return best_share;
}

}  // namespace itr
