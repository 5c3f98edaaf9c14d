// SPDX-License-Identifier: MIT
#include "search.hpp"

#include <algorithm>
#include <cmath>

#include "core/timer.hpp"
#include "energy/arcs.hpp"
#include "newton/newton.hpp"

namespace itr {

namespace {

/// Where a step begins, and the Newton system that it solves.
struct StepOrigin {
  const Energy& energy;
  ConstVectorView x;
  const DofMap& dofs;
  ConstVectorView gradient;
  NewtonSystem& system;
  Workspace& workspace;
};

constexpr int kMostRounds = 6;       ///< gaps are linearised so often
constexpr double kAhead = 4;         ///< pairs that stop the step within so many times its free fraction are bounded
constexpr double kFreeEnough = 0.5;  ///< fraction of the step with which it is done
constexpr double kLongest = 10;      ///< of the step's largest motion: a turned one is not longer
constexpr double kMuchMore = 2;      ///< what a step of another direction must bring

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

/// The quadratic model along a step; `change` is that of its energy at a fraction of the step.
struct ModelAlong {
  double slope, curvature;
  double change(double fraction) const { return fraction * slope + 0.5 * fraction * fraction * curvature; }
};

/// Bounds on the gaps of pairs, and the corrections of a step by forces between these pairs.
class BoundedGaps {
 public:
  BoundedGaps(const DofMap& dofs, NewtonSystem& system) : dofs_(dofs), system_(system) {}

  /// Takes over the bounds, linearised at the present step. A pair keeps the direction of force of its first round, so that
  /// its correction is solved for only once. Returns false if there are no bounds, or a solve fails.
  bool update(const std::vector<BlockingPairs::Bound>& bounds, const VectorX& correction) {
    const auto count = static_cast<Eigen::Index>(bounds.size()), known = forces_.cols();
    if (count == 0) return false;
    rows_.setZero(dofs_.num_unknowns, count);
    asked_.resize(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const BlockingPairs::Bound& bound = bounds[i];
      for (std::size_t k = 0; k < bound.dofs.size(); ++k)
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

/// Turns a Newton step of which only `fraction` is free, so that the pairs that stop it keep a gap at its end. The projected
/// step is the minimum of the quadratic model under bounds on linearised gaps (an active set, as in sequential quadratic
/// programming). Returns the free fraction of `step`; both stay unchanged if the model gains no more along the projected
/// step, or, where held dofs advance, if these come hardly farther.
double project_step(const StepOrigin& origin, Step& step, double fraction, bool is_advancing) {
  const auto& [energy, x, dofs, gradient, system, workspace] = origin;
  const VectorX first = step.direction;
  const ModelAlong along_first{gradient.dot(first), step.curvature};
  double least = along_first.change(fraction), free = fraction, best_fraction = fraction;
  VectorX ahead = first, correction = VectorX::Zero(dofs.num_unknowns);
  BlockingPairs blocking;
  blocking.takes_first = is_advancing;
  BoundedGaps gaps(dofs, system);
  for (int round = 0; round < kMostRounds; ++round) {
    if (!energy.find_blocking(x, ahead, std::min(1.0, kAhead * free), blocking, workspace)) break;
    double curvature_of_correction = 0;
    if (!gaps.update(blocking.bounds, correction) || !gaps.correct(correction, curvature_of_correction)) break;
    double slope_of_correction = 0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const int unknown = dofs.unknown[i];
      if (unknown == kNone) continue;
      ahead[i] = first[i] + correction[unknown];
      slope_of_correction += gradient[i] * correction[unknown];
    }
    // Nearly dependent bounds ask for forces without limit, and for far motions all pairs are candidates of contact.
    if (!(ahead.lpNorm<Eigen::Infinity>() <= kLongest * first.lpNorm<Eigen::Infinity>())) break;
    const double asked = is_advancing ? std::min(1.0, kAhead * free) : 1;
    free = asked * energy.max_step(x, asked * ahead, workspace);
    // The gradient at free dofs is minus H times the Newton step.
    const ModelAlong model{along_first.slope + slope_of_correction,
                           along_first.curvature - 2 * slope_of_correction + curvature_of_correction};
    if (is_advancing ? free > kMuchMore * best_fraction : model.slope < 0 && model.change(free) < least) {
      least = model.change(free);
      best_fraction = free;
      step.direction = ahead;
      step.curvature = model.curvature;
    }
    if (free >= kFreeEnough) break;
  }
  return best_fraction;
}

constexpr double kArmijo = 1e-4;
constexpr double kResolved = 8;  ///< times its round-off: changes of energy below which slopes tell more
constexpr double kLeastFraction = 1e-14;
constexpr double kStraightFall = 0.8;  ///< of the slope: an energy that falls by more over a full step hardly curves
constexpr double kShorter = 0.9;       ///< of an arc, at most, where its chord is not free
constexpr int kMostHalvings = 40, kMostDoublings = 12;
constexpr double kVertexStepsBelow = 0.25;  ///< see try_vertex_steps
constexpr double kBlockedBelow = 0.5;       ///< fraction of a step below which what is in the way is looked at
constexpr int kLong = 20;                   ///< iterations from which on what blocks steps is kept
constexpr double kWaitBelow = 0.1;          ///< blocked to less, or turned: bodies relax before held dofs go on

}  // namespace

Search::Search(const Task& task, Iterate& at, DirichletContinuation& held)
    : task_(task),
      at_(at),
      held_(held),
      scratch_(task.workspace.get<Scratch>()),
      candidate_(scratch_.candidate.resize(at.x().size())),
      other_(scratch_.other.resize(at.x().size())) {}

bool Search::along(Step& step) {
  const bool advancing = held_.is_advancing();
  const auto* const arcs = dynamic_cast<const Arcs*>(&task_.energy);
  if (arcs && along_arcs(*arcs, step)) return true;
  const Ahead ahead = look_ahead(step);
  if (advancing && (ahead.fraction < kWaitBelow || ahead.is_turned)) held_.wait();
  if (ahead.fraction < kBlockedBelow) note_blocked(step);
  held_.raise_penalty(step, ahead.slope);
  double fraction = ahead.fraction;
  for (int i = 0; i < kMostHalvings && fraction > kLeastFraction; ++i, fraction /= 2) {
    candidate_ = at_.x() + fraction * step.direction;
    if (advancing && fraction == 1) held_.move_to_targets(candidate_);
    double value = at_.value_at(candidate_);
    if (!std::isfinite(value) || !is_acceptable(value, fraction, ahead, step)) continue;
    const bool straight = falls_straight(value, fraction, ahead, step);
    held_.note_fraction(fraction);
    if (ahead.has_vertex_steps) try_vertex_steps(value);
    at_.move_to(candidate_, value);
    if (straight) go_on(step.direction);
    return true;
  }
  return false;
}

/// Goes to where a part of the step leads along arcs, on the straight way there, which has to be free for its whole length:
/// halves of a chord are no shorter arcs. While held dofs advance, only bends the step.
bool Search::along_arcs(const Arcs& arcs, Step& step) {
  constexpr double kStraight = 1e-5;  // [rad]: arcs that turn by less are their chords
  const VectorX whole = step.direction;
  if (arcs.bend(at_.x(), step.direction) < kStraight) return false;
  if (held_.is_advancing()) return false;
  double length = 1;
  for (int i = 0; i < kMostHalvings && length > kLeastFraction; ++i) {
    if (i > 0) {
      step.direction = length * whole;
      arcs.bend(at_.x(), step.direction);
    }
    if (const double free = at_.free_fraction(step.direction); free < 1) {
      if (i == 0 && free < kBlockedBelow) note_blocked(step);
      length *= std::min(std::max(free, kLeastFraction), kShorter);
      continue;
    }
    candidate_ = at_.x() + step.direction;
    const double value = at_.value_at(candidate_), slope = task_.norms.dot(step.direction, at_.gradient());
    if (std::isfinite(value) && slope < 0 && is_acceptable(value, 1, {1, slope, false}, step)) {
      at_.move_to(candidate_, value);
      return true;
    }
    length /= 2;
  }
  step.direction = whole;
  return false;
}

Search::Ahead Search::look_ahead(Step& step) {
  // Not in patches, which end after a few iterations in any case, and not with PolyFEM's way, which is kept as it is.
  const bool is_own_step = task_.options.indefinite == IndefiniteHessian::project;
  const bool may_project = !task_.extras.is_brief && is_own_step;
  const bool advancing = held_.is_advancing();
  const double free = at_.free_fraction(step.direction);
  double fraction = free;
  bool has_vertex_steps = false;
  {
    const ScopedTimer timer(task_.summary.ccd_seconds);
    if (fraction < (advancing ? kWaitBelow : kBlockedBelow) && may_project)
      fraction = project_step({task_.energy, at_.x(), task_.dofs, at_.gradient(), task_.system, task_.workspace}, step,
                              fraction, advancing);
    if (fraction < kVertexStepsBelow && !advancing && is_own_step)
      has_vertex_steps =
          task_.energy.get_vertex_steps(at_.x(), step.direction, scratch_.steps.resize(at_.x().size()), task_.workspace);
  }
  return {fraction, at_.gradient().dot(step.direction), has_vertex_steps, fraction != free};
}

void Search::note_blocked(const Step& step) {
  NewtonSummary& summary = task_.summary;
  if (summary.iterations == last_blocked_) return;  // a step of this iteration was, before it was given up
  last_blocked_ = summary.iterations;
  ++summary.blocked;
  if (task_.extras.is_brief || summary.iterations < kLong) return;
  summary.blocked_from = at_.x();
  summary.blocked_step = step.direction;
}

bool Search::is_acceptable(double value, double fraction, const Ahead& ahead, const Step& step) {
  const bool advancing = held_.is_advancing();
  const double change = held_.merit_change(value - at_.value(), fraction), slope = held_.merit_slope(ahead.slope);
  if (change <= kArmijo * fraction * slope) return true;
  if (advancing) return false;
  // PolyFEM's "RobustArmijo" (docs/theory.md, "Tolerances"; Hager & Zhang): if the energy changes little, in either
  // direction, a slope that still falls at the end suffices. This rule refuses full steps to the minimum of a quadratic.
  // So, where the energy changes by round-off alone, a slope that shrinks to half suffices, too: if the end is no higher, or
  // the promised decrease was below round-off.
  const double change_of_energy = std::abs(value - at_.value());
  if (change_of_energy > 0.1 * std::abs(at_.value()) && change_of_energy > kResolved * at_.value_round_off()) return false;
  const double after = slope_at_candidate(step);
  const double resolved = kResolved * at_.value_round_off();
  return after <= kArmijo * slope ||
         (change_of_energy <= resolved && (value <= at_.value() || -fraction * slope <= resolved) && after <= -0.5 * slope);
}

/// Whether the energy hardly curves over the full step. The slope at the end has to confirm it: values alone are unreliable
/// near round-off.
bool Search::falls_straight(double value, double fraction, const Ahead& ahead, const Step& step) {
  return !held_.is_advancing() && fraction == 1 && value - at_.value() < kStraightFall * ahead.slope &&
         slope_at_candidate(step) < kStraightFall / 2 * ahead.slope;
}

double Search::slope_at_candidate(const Step& step) {
  at_.gradient_at(candidate_, other_);
  return task_.norms.dot(step.direction, other_);
}

/// Moves each vertex as far as it can go alone, if the energy falls by much more there. Not if cells invert on the way: this
/// leads to squeezed cells, which take more iterations than it saves.
void Search::try_vertex_steps(double& value) {
  const VectorView steps = scratch_.steps.view();
  if (at_.free_fraction(steps) < 1) return;
  other_ = at_.x() + steps;
  const double there = at_.value_at(other_);
  if (!(there - at_.value() < kMuchMore * (value - at_.value()))) return;
  candidate_ = other_;
  value = there;
}

void Search::go_on(ConstVectorView ahead) {
  other_ = ahead;
  for (int k = 0; k < kMostDoublings; ++k) {
    other_ *= 2;
    if (at_.free_fraction(other_) < 1) return;
    candidate_ = at_.x() + other_;
    const double value = at_.value_at(candidate_);
    if (!(value < at_.value())) return;
    at_.move_to(candidate_, value);
  }
}

}  // namespace itr
