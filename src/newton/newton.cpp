// SPDX-License-Identifier: MIT
#include "itr/newton/newton.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>
#include <utility>

#include "blocked_step.hpp"
#include "curvature.hpp"
#include "itr/core/timer.hpp"
#include "norms.hpp"
#include "round_off.hpp"

namespace itr {

namespace {

constexpr double kArmijo = 1e-4;
constexpr double kRoundOff = 1e-9;     ///< relative change of energy below which slopes tell more
constexpr double kUnresolved = 1e-14;  ///< relative change of energy that a sum of many terms does not resolve
constexpr double kSpacing = 8 * std::numeric_limits<double>::epsilon();  ///< of the largest coordinate
constexpr const char* kFlatSaddle = "the Hessian has negative eigenvalues, but no way along them lowers the energy";
constexpr double kLoosest = 1e-4;       ///< residual of a direction
constexpr int kMostLoose = 8;           ///< iterations of a solve that may be loose
constexpr double kNothing = 1e-10;      ///< see NewtonExtras::way_to_start
constexpr int kMostUnresolved = 20;     ///< steps in a row that promise less than that
constexpr double kLeastPenalty = 1e-8;  ///< force by length and stiffness: above the round-off of a body at rest
constexpr double kStraight = 0.8;       ///< of the slope: an energy that falls by more over a full step hardly curves
constexpr int kMostDoublings = 12;
constexpr double kSingleWaysBelow = 0.25, kMuchMore = 2;  ///< see try_single_ways
constexpr double kBlockedBelow = 0.5;                     ///< share of a step below which what is in the way is looked at
constexpr int kLong = 20;                                 ///< iterations from which on what blocks steps is kept
constexpr double kRelaxBelow = 0.1;  ///< a step blocked to less than this lets the bodies relax before held dofs go on

/// The vectors of a solve; the workspace keeps them for the next one.
struct Buffers {
  KeptVector gradient, step, candidate, other, rhs, solution, ways;
};

class Minimizer {
 public:
  Minimizer(const Energy& energy, VectorView x, const DofMap& dofs, const VectorX& target, NewtonSystem& system,
            const NewtonOptions& options, Workspace& workspace, const NewtonExtras& extras)
      : energy_(energy),
        x_(x),
        dofs_(dofs),
        target_(target),
        system_(system),
        options_(options),
        workspace_(workspace),
        extras_(extras),
        norms_(dofs, options.norm, extras.norm_weights),
        buffers_(workspace.get<Buffers>()),
        gradient_(buffers_.gradient.resize(x.size())),
        step_(buffers_.step.resize(x.size())),
        candidate_(buffers_.candidate.resize(x.size())),
        other_(buffers_.other.resize(x.size())) {}

  NewtonSummary run() {
    first_value_ = value_ = timed_value(x_);
    if (!std::isfinite(value_)) return stop(Termination::infeasible, "the energy at the start is not finite");
    for (summary_.iterations = 0; summary_.iterations < options_.max_iterations; ++summary_.iterations) {
      if (options_.is_cancelled()) return stop(Termination::cancelled);
      compute_remaining();
      compute_gradient();
      if (is_stuck()) return stop(Termination::no_descent, describe_way_left());
      if (!moving_ && has_small_gradient()) {
        if (can_leave_saddle()) continue;
        foresee_decrement();
        return finish(Termination::gradient);
      }
      if (!compute_direction())
        return stop(Termination::no_descent, "the Newton system has no descent direction" + failure_);
      note_decrement();
      if (is_loose_ && is_near_end() && !tighten())
        return stop(Termination::no_descent, "the Newton system has no descent direction" + failure_);
      if (const bool by_step = has_small_step(); by_step || (!moving_ && decrement() < options_.decrement_tolerance)) {
        if (can_leave_saddle()) continue;
        return finish(by_step ? Termination::step : Termination::decrement);
      }
      if (is_lost_in_round_off()) {
        if (can_leave_saddle()) continue;
        return finish(Termination::round_off, kAtRoundOff);
      }
      const double before = value_;
      if (!line_search() && !retry_tightly() && !retry_projected()) {
        // Terms that cancel, as in a body that has turned back to rest, keep the round-off of the energy at the start.
        const bool relaxed = is_unresolved() || decrement() < kUnresolved * std::abs(first_value_);
        if (moving_ && (!relaxing_ || relaxed)) {  // where held dofs are blocked, let the bodies give way first
          relax_next_ = !relaxing_;
          if (++blocked_ > kMaxBlocked) return stop(Termination::no_descent, describe_way_left());
          continue;
        }
        if (!relaxed) return stop(Termination::no_descent, "the line search found no step");
        if (can_leave_saddle()) continue;
        return finish(Termination::round_off, kAtRoundOff);
      }
      const bool stalled = has_stalled(before);
      if (extras_.after_step && extras_.after_step(x_)) value_ = timed_value(x_);
      if (extras_.on_iteration &&
          !extras_.on_iteration({summary_.iterations + 1, value_, summary_.gradient_norm, summary_.step_norm}))
        return stop(Termination::cancelled, "as the program asked");
      if (stalled) {
        ++summary_.iterations;
        return stop(Termination::energy);
      }
    }
    if (extras_.is_brief) return stop(Termination::iterations);
    return stop(Termination::iterations, "no convergence in " + std::to_string(options_.max_iterations) + " iterations" +
                                             (moving_ ? ", " + describe_way_left() : ""));
  }

 private:
  static constexpr int kMaxBlocked = 50;
  static constexpr double kLeastProgress = 0.99;

  /// Whether held dofs have hardly come nearer to their targets in many iterations: something blocks their way for good.
  bool is_stuck() {
    if (!moving_ || summary_.iterations % kMaxBlocked != 0) return false;
    return remaining_l1_ > kLeastProgress * std::exchange(remaining_before_, remaining_l1_);
  }

  std::string describe_way_left() const {
    double longest = 0;
    for (Eigen::Index i = 0; i < x_.size(); ++i)
      if (dofs_.unknown[i] == kNone) longest = std::max(longest, std::abs(target_[i] - x_[i]));
    std::ostringstream text;
    text << "held vertices cannot reach their targets, up to " << longest << " m are left";
    return text.str();
  }

  /// Called before a solve ends: leaves x if it is a saddle. Returns whether x has moved to a lower energy.
  bool can_leave_saddle() { return is_at_saddle() && leave_saddle(); }

  NewtonSummary finish(Termination termination, std::string_view message = {}) {
    if (is_at_saddle()) return stop(Termination::round_off, kFlatSaddle);
    return stop(termination, message);
  }

  NewtonSummary stop(Termination termination, std::string_view message = {}) {
    summary_.termination = termination;
    summary_.energy = value_;
    if (extras_.is_brief) return summary_;
    summary_.message = message;
    if (summary_.converged()) return summary_;
    if (has_step_) summary_.failed_step = step_;
    double largest = 0;
    for (Eigen::Index i = 0; has_gradient_ && i < gradient_.size(); ++i) {
      if (dofs_.unknown[i] == kNone || !(std::abs(gradient_[i]) > largest)) continue;
      largest = std::abs(gradient_[i]);
      summary_.worst_dof = static_cast<int>(i);
    }
    return summary_;
  }

  double timed_value(ConstVectorView x) {
    const ScopedTimer timer(summary_.line_search_seconds);
    return energy_.value(x, workspace_);
  }

  void gradient_at(ConstVectorView x, VectorView gradient) {
    const ScopedTimer timer(summary_.assembly_seconds);
    gradient.setZero();
    energy_.add_gradient(x, gradient, workspace_);
  }

  /// Slope of the energy along the step, at the candidate.
  double slope_at_candidate() {
    gradient_at(candidate_, other_);
    return free_dot(step_, other_);
  }

  double free_dot(ConstVectorView a, ConstVectorView b) const {
    double sum = 0;
    for (Eigen::Index i = 0; i < a.size(); ++i)
      if (dofs_.unknown[i] != kNone) sum += a[i] * b[i];
    return sum;
  }

  void compute_gradient() {
    gradient_at(x_, gradient_);
    has_gradient_ = true;
    summary_.gradient_norm = norms_.of_gradient(gradient_);
  }

  bool has_moved() const { return extras_.way_to_start.size() > 0; }

  bool has_small_gradient() {
    if (first_gradient_ < 0) first_gradient_ = summary_.gradient_norm;
    const bool is_first = summary_.iterations == 0;
    if (is_first && has_moved() && summary_.gradient_norm > kNothing * norms_.of_gradient(extras_.gradient_of_way))
      return false;
    return summary_.gradient_norm < (is_first ? options_.first_gradient_tolerance : options_.gradient_tolerance) ||
           (!is_first && summary_.gradient_norm < options_.relative_gradient_tolerance * first_gradient_);
  }

  bool has_small_step() {
    if (moving_) return false;
    if (first_step_ < 0) first_step_ = summary_.step_norm;
    if (summary_.iterations == 0 && has_moved() && summary_.step_norm > kNothing * norms_.of_step(extras_.way_to_start))
      return false;
    return summary_.step_norm < options_.step_tolerance ||
           (summary_.iterations > 0 && summary_.step_norm < options_.relative_step_tolerance * first_step_);
  }

  /// The decrease of energy that the quadratic model promises for the full step.
  double decrement() const { return -0.5 * free_dot(step_, gradient_); }

  void note_decrement() {
    summary_.decrement = decrement();
    gradient_of_decrement_ = summary_.gradient_norm;
  }
  /// Estimates the decrement if no direction was computed: it scales with the square of the gradient.
  void foresee_decrement() {
    if (!(gradient_of_decrement_ > 0)) return;
    const double ratio = summary_.gradient_norm / gradient_of_decrement_;
    summary_.decrement *= std::min(1.0, ratio * ratio);
  }

  bool is_unresolved() const { return decrement() < kUnresolved * std::abs(value_) || is_below_spacing(); }

  /// Whether the step changes only the last bits of positions. Far from the origin these bits are long distances.
  bool is_below_spacing() const { return step_.lpNorm<Eigen::Infinity>() <= kSpacing * x_.lpNorm<Eigen::Infinity>(); }

  /// Whether many steps in a row promised a decrease below the resolution of energy or positions. The gradient is then
  /// round-off and does not shrink further.
  bool is_lost_in_round_off() {
    unresolved_ = !moving_ && is_unresolved() ? unresolved_ + 1 : 0;
    return unresolved_ >= kMostUnresolved;
  }

  /// Counts the steps in a row that hardly changed the energy.
  bool has_stalled(double before) {
    stalled_ = !moving_ && std::abs(value_ - before) < options_.energy_tolerance ? stalled_ + 1 : 0;
    return stalled_ >= options_.energy_steps && options_.energy_tolerance > 0;
  }

  /// Computes the way that the held dofs still have to their targets.
  void compute_remaining() {
    moving_ = false;
    relaxing_ = std::exchange(relax_next_, false);
    motion_.step.resize(0);
    if (target_.size() == 0) return;
    VectorX remaining = VectorX::Zero(x_.size());
    for (Eigen::Index i = 0; i < x_.size(); ++i)
      if (dofs_.unknown[i] == kNone) remaining[i] = target_[i] - x_[i];
    remaining_l1_ = remaining.lpNorm<1>();
    moving_ = remaining_l1_ > 0;
    if (moving_ && remaining.norm() < options_.step_tolerance && finish_motion(remaining)) moving_ = false;
    if (moving_ && !relaxing_) motion_.step = std::move(remaining);
  }

  /// Puts held dofs at their targets if the way is free. No line search is made: the rest of the way is within the tolerance
  /// of positions, and may change the energy by less than its round-off.
  bool finish_motion(const VectorX& remaining) {
    {
      const ScopedTimer timer(summary_.ccd_seconds);
      if (energy_.max_step(x_, remaining, workspace_) < 1) return false;
    }
    candidate_ = x_;
    move_to_targets(candidate_);
    const double value = timed_value(candidate_);
    if (!std::isfinite(value)) return false;
    accept(value);
    return true;
  }

  void move_to_targets(VectorView x) const {
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] == kNone) x[i] = target_[i];
  }

  /// Relative residual to which a direction is solved. The gradient after a Newton step is at best of second order in the
  /// one before, so more digits are wasted (Eisenstat & Walker 1996). Only steps that may end the solve get all digits.
  double forcing() const {
    if (is_tight_ || moving_ || options_.indefinite == IndefiniteHessian::accept) return kTightResidual;
    // Loose solves may overlook negative curvature; Newton then creeps.
    if (summary_.indefinite > 0 || summary_.iterations >= kMostLoose) return kTightResidual;
    const double left = previous_gradient_ > 0 ? summary_.gradient_norm / previous_gradient_ : 1;
    const double asked = std::clamp(0.1 * left * left, kTightResidual, kLoosest);
    const double tolerance = std::max(options_.gradient_tolerance, options_.relative_gradient_tolerance * first_gradient_);
    const bool may_be_last = 0.1 * summary_.gradient_norm * std::max(left * left, asked) < tolerance;
    return may_be_last ? kTightResidual : asked;
  }

  /// Whether a loosely solved step may be the last one of the solve.
  bool is_near_end() const {
    constexpr double kNear = 10;
    return summary_.step_norm < kNear * options_.step_tolerance ||
           summary_.step_norm < kNear * options_.relative_step_tolerance * first_step_ ||
           decrement() < kNear * options_.decrement_tolerance || is_unresolved();
  }

  /// Solves for the same step again with all digits, and for later ones too, so that convergence is certain.
  bool tighten() {
    is_tight_ = true;
    asked_ = kTightResidual;
    const bool found = factor_and_solve(shift_);
    if (!projected_ && shift_ == 0) note_definiteness();
    return found || compute_direction();
  }

  bool retry_tightly() { return is_loose_ && tighten() && line_search(); }

  bool compute_direction() {
    asked_ = forcing();
    previous_gradient_ = summary_.gradient_norm;
    // A direction of the true Hessian is only taken where it is known to lead to a minimum, not to a saddle.
    const bool may_be_true = options_.indefinite == IndefiniteHessian::accept || system_.tells_definiteness();
    projected_ = options_.project_to_psd && (psd_iterations_ > 0 || options_.projected_iterations == 0 || !may_be_true);
    if (psd_iterations_ > 0) --psd_iterations_;
    if (!projected_ && try_direction(PsdProjection::none, 0)) return true;
    if (options_.project_to_psd) {
      if (!projected_) psd_iterations_ = options_.projected_iterations - 1;
      projected_ = true;
      if (try_direction(projection(), 0)) return true;
    }
    double shift = 1e-10 * std::max(system_.diagonal_scale(), 1e-300);
    for (int attempt = 0; attempt < 12 && is_curable(outcome_); ++attempt, shift *= 10)
      if (factor_and_solve(shift)) return true;
    return false;
  }

  PsdProjection projection() const { return PsdProjection::clamp; }

  bool try_direction(PsdProjection psd, double shift) {
    {
      const ScopedTimer timer(summary_.assembly_seconds);
      system_.assemble(energy_, x_, psd, dofs_, motion_, workspace_);
    }
    const bool found = factor_and_solve(shift);
    if (psd == PsdProjection::none) note_definiteness();
    return found;
  }

  /// Records whether the true Hessian at x is indefinite. It has to be the last matrix that was factorised.
  void note_definiteness() {
    is_indefinite_ = outcome_ == linear::Outcome::not_positive_definite || system_.negative_pivots() > 0;
    is_known_here_ = true;
    summary_.indefinite += is_indefinite_;
  }

  /// Whether a factorisation of the true Hessian finds x no minimum. Factorises only if the last true Hessian was
  /// indefinite, or if a loose solve left this open.
  bool is_at_saddle() {
    if (options_.indefinite == IndefiniteHessian::accept || dofs_.num_unknowns == 0) return false;
    if (!is_indefinite_ && !is_loose_) return false;
    if (is_indefinite_ && is_known_here_) return true;
    {
      const ScopedTimer timer(summary_.assembly_seconds);
      system_.assemble(energy_, x_, PsdProjection::none, dofs_, motion_, workspace_);
    }
    const ScopedTimer timer(summary_.linear_seconds);
    outcome_ = is_indefinite_ ? system_.factorize(0) : system_.prepare(0, right_hand_side(), kTightResidual);
    is_loose_ = false;
    note_definiteness();
    return is_indefinite_;
  }

  /// Goes along an eigenvector of a negative eigenvalue as long as that lowers the energy.
  bool leave_saddle() {
    {
      const ScopedTimer timer(summary_.assembly_seconds);
      system_.assemble(energy_, x_, PsdProjection::none, dofs_, motion_, workspace_);
    }
    VectorX direction;
    double curvature = 0;
    {
      const ScopedTimer timer(summary_.linear_seconds);
      curvature = find_negative_curvature(system_, dofs_.num_unknowns, direction);
    }
    if (!(curvature < 0)) return false;
    step_.setZero();
    for (Eigen::Index i = 0; i < x_.size(); ++i)
      if (dofs_.unknown[i] != kNone) step_[i] = direction[dofs_.unknown[i]];
    // Begins with the shortest step whose change of energy exceeds round-off, down the slope. If the slope is round-off, the
    // sign of the eigenvector decides, which is the same for all linear solvers; the other branch may be as low.
    step_ *= std::max(options_.step_tolerance, std::sqrt(2 * kRoundOff * std::abs(value_) / -curvature));
    if (step_.dot(gradient_) > kRoundOff * std::abs(value_)) step_ = -step_;
    for (int k = 0; k < kMostDoublings; ++k, step_ *= 2) {
      {
        const ScopedTimer timer(summary_.ccd_seconds);
        if (energy_.max_step(x_, step_, workspace_) < 1) return false;
      }
      candidate_ = x_ + step_;
      const double value = timed_value(candidate_);
      if (!(value < value_)) continue;
      accept(value);
      go_on();
      return true;
    }
    return false;
  }

  ConstVectorView right_hand_side() {
    VectorView rhs = buffers_.rhs.resize(dofs_.num_unknowns);
    rhs.setZero();
    if (motion_.coupling.size() > 0) rhs -= motion_.coupling;
    for (Eigen::Index i = 0; i < x_.size(); ++i)
      if (dofs_.unknown[i] != kNone) rhs[dofs_.unknown[i]] -= gradient_[i];
    return rhs;
  }

  /// Solves for the full step; true where it is one of descent.
  bool factor_and_solve(double shift) {
    shift_ = shift;
    is_loose_ = false;
    const ScopedTimer timer(summary_.linear_seconds);
    if (dofs_.num_unknowns == 0) {
      begin_step();
      summary_.step_norm = 0;
      model_curvature_ = motion_.curvature;
      return true;
    }
    const ConstVectorView rhs = right_hand_side();
    VectorView solution = buffers_.solution.resize(rhs.size());
    outcome_ = system_.prepare(shift, rhs, asked_);
    if (outcome_ != linear::Outcome::ok) return give_reason();
    // L D L^T factorises an indefinite Hessian, too. Its solution must not be used: along eigenvectors of negative
    // eigenvalues, Newton's step goes up to a saddle.
    if (options_.indefinite == IndefiniteHessian::project && system_.negative_pivots() > 0) {
      outcome_ = linear::Outcome::not_positive_definite;
      failure_ = " (linear solve: " + std::to_string(system_.negative_pivots()) + " negative eigenvalues)";
      return false;
    }
    const auto report = system_.solve(rhs, solution);
    outcome_ = report.outcome;
    if ((outcome_ != linear::Outcome::ok && outcome_ != linear::Outcome::not_converged) || !solution.allFinite())
      return give_reason();
    is_loose_ = report.relative_residual > kTightResidual && report.relative_residual <= asked_;
    if (!is_loose_) summary_.linear_residual = std::max(summary_.linear_residual, report.relative_residual);
    const double descent = solution.dot(rhs);  // of no minimiser of a convex model where it is not positive
    if (!(descent > 0) && !rhs.isZero(0)) return false;
    begin_step();
    // step^T H step over all dofs, with H_ff step_f = rhs.
    model_curvature_ = descent;
    if (motion_.coupling.size() > 0) model_curvature_ += 2 * solution.dot(motion_.coupling);
    model_curvature_ += motion_.curvature;
    for (Eigen::Index i = 0; i < x_.size(); ++i)
      if (dofs_.unknown[i] != kNone) step_[i] = solution[dofs_.unknown[i]];
    summary_.step_norm = norms_.of_step(step_);
    return true;
  }

  /// Sets the step to the prescribed motion of the held dofs, and to zero elsewhere.
  void begin_step() {
    has_step_ = true;
    if (motion_.step.size() > 0)
      step_ = motion_.step;
    else
      step_.setZero();
  }

  bool give_reason() {
    if (extras_.is_brief) return false;
    failure_ = std::string(" (linear solve: ") + to_string(outcome_) + ", " + system_.message() + ")";
    return false;
  }

  /// Whether a shift of the Hessian may help.
  static bool is_curable(linear::Outcome outcome) {
    return outcome != linear::Outcome::non_finite && outcome != linear::Outcome::out_of_memory &&
           outcome != linear::Outcome::failed;
  }

  /// A failed search along the true Newton direction is tried once more along the projected one.
  bool retry_projected() {
    if (projected_ || !options_.project_to_psd) return false;
    psd_iterations_ = options_.projected_iterations - 1;
    projected_ = true;
    return try_direction(projection(), 0) && line_search();
  }

  bool line_search() {
    double step = 1;
    const bool advancing = motion_.step.size() > 0;
    bool has_single_ways = false;
    {
      const ScopedTimer timer(summary_.ccd_seconds);
      step = energy_.max_step(x_, step_, workspace_);
      if (step < kBlockedBelow && !advancing && may_turn())
        step = turn_blocked_step({energy_, x_, dofs_, gradient_, system_, workspace_}, step_, step);
      if (step < kSingleWaysBelow && !advancing && options_.indefinite == IndefiniteHessian::project)
        has_single_ways = energy_.get_single_ways(x_, step_, buffers_.ways.resize(x_.size()), workspace_);
    }
    if (advancing && step < kRelaxBelow) relax_next_ = true;
    if (step < kBlockedBelow) note_blocked();
    const double slope = gradient_.dot(step_);
    // The penalty is so large that the full step lowers the merit function of the quadratic model by at least half of the
    // penalty.
    if (advancing)
      penalty_ = std::max({penalty_, kLeastPenalty * system_.diagonal_scale() * remaining_l1_,
                           2 * std::max(0.0, slope + 0.5 * std::max(0.0, model_curvature_)) / remaining_l1_});
    const double merit_slope = advancing ? slope - penalty_ * remaining_l1_ : slope;
    const int limit = options_.line_search == LineSearch::backtracking ? 30 : 40;
    for (int i = 0; i < limit && step > 1e-14; ++i, step /= 2) {
      candidate_ = x_ + step * step_;
      if (advancing && step == 1) move_to_targets(candidate_);  // exactly there, not to round-off
      double value = timed_value(candidate_);
      if (!std::isfinite(value)) continue;
      const double merit_change = value - value_ - (advancing ? penalty_ * step * remaining_l1_ : 0);
      if (!acceptable(merit_change, value, step, merit_slope, advancing)) continue;
      // The slope at the end has to confirm a straight fall: values alone are unreliable near round-off.
      const bool straight = options_.extend_steps && !advancing && step == 1 && value - value_ < kStraight * slope &&
                            slope_at_candidate() < kStraight / 2 * slope;
      if (advancing) blocked_ = step < 1e-6 ? blocked_ + 1 : 0;
      if (has_single_ways) try_single_ways(buffers_.ways.view(), value);
      accept(value);
      if (straight) go_on();
      return true;
    }
    return false;
  }

  /// Whether blocked steps may be turned. Not in patches, which end after a few iterations in any case, and not with
  /// PolyFEM's way, which is kept as it is.
  bool may_turn() const { return !extras_.is_brief && options_.indefinite == IndefiniteHessian::project; }

  void note_blocked() {
    ++summary_.blocked;
    if (extras_.is_brief || summary_.iterations < kLong) return;
    summary_.blocked_from = x_;
    summary_.blocked_step = step_;
  }

  /// Moves each vertex as far as it can go alone, if the energy falls by much more there. Called if the whole step is cut to
  /// less than `kSingleWaysBelow`. Not if cells invert on the way: this leads to squeezed cells, which take more iterations
  /// than it saves.
  void try_single_ways(ConstVectorView ways, double& value) {
    {
      const ScopedTimer timer(summary_.ccd_seconds);
      if (energy_.max_step(x_, ways, workspace_) < 1) return;
    }
    other_ = x_ + ways;
    const double there = timed_value(other_);
    if (!(there - value_ < kMuchMore * (value - value_))) return;
    candidate_ = other_;
    value = there;
  }

  void accept(double value) {
    x_ = candidate_;
    value_ = value;
    is_known_here_ = false;
  }

  /// After a full step over which the energy fell in a straight line, takes steps of twice the length as long as they lower
  /// it. Near a saddle the projected Hessian is much stiffer than the true one, and Newton would need hundreds of equal
  /// steps.
  void go_on() {
    other_ = step_;
    for (int k = 0; k < kMostDoublings; ++k) {
      other_ *= 2;
      {
        const ScopedTimer timer(summary_.ccd_seconds);
        if (energy_.max_step(x_, other_, workspace_) < 1) return;
      }
      candidate_ = x_ + other_;
      const double value = timed_value(candidate_);
      if (!(value < value_)) return;
      accept(value);
    }
  }

  bool acceptable(double change, double value, double step, double slope, bool advancing) {
    if (options_.line_search == LineSearch::backtracking && !advancing) return change < 0;
    if (change <= kArmijo * step * slope) return true;
    if (advancing || options_.line_search == LineSearch::armijo) return false;
    // PolyFEM's "RobustArmijo" (CONVENTIONS.md, "Tolerances"; Hager & Zhang): if the energy changes little, in either
    // direction, a slope that still falls at the end suffices. This rule refuses full steps to the minimum of a quadratic.
    // So, where the promised decrease is below round-off, a slope that shrinks to half suffices, too.
    const double change_of_energy = std::abs(value - value_);
    if (change_of_energy > 0.1 * std::abs(value_)) return false;
    const double after = slope_at_candidate();
    const double resolved = kRoundOff * std::abs(value_);
    return after <= kArmijo * slope ||
           (change_of_energy <= resolved && (value <= value_ || -step * slope <= resolved) && after <= -0.5 * slope);
  }

  const Energy& energy_;
  VectorView x_;
  const DofMap& dofs_;
  const VectorX& target_;
  NewtonSystem& system_;
  const NewtonOptions& options_;
  Workspace& workspace_;
  const NewtonExtras& extras_;

  NewtonSummary summary_;
  linear::Outcome outcome_ = linear::Outcome::ok;  ///< of the last linear solve
  std::string failure_;                            ///< why the last one failed that did
  double value_ = 0, first_value_ = 0, gradient_of_decrement_ = 0;
  const Norms norms_;
  Buffers& buffers_;
  VectorView gradient_, step_, candidate_, other_;
  bool has_gradient_ = false, has_step_ = false;  ///< whether they are set
  PrescribedMotion motion_;                       ///< asked of the held dofs in this iteration
  double model_curvature_ = 0;
  double remaining_l1_ = 0;
  double remaining_before_ = std::numeric_limits<double>::infinity();  ///< kMaxBlocked iterations ago
  double penalty_ = 0;
  bool moving_ = false;    ///< held dofs are not yet at their targets
  bool relaxing_ = false;  ///< this iteration leaves them where they are
  bool relax_next_ = false;
  bool projected_ = false;
  bool is_indefinite_ = false;                 ///< the true Hessian that was factorised last
  bool is_known_here_ = false;                 ///< that one was of x
  double asked_ = kTightResidual, shift_ = 0;  ///< of the last direction
  double previous_gradient_ = 0;               ///< norm, when the last direction was asked for
  bool is_loose_ = false;                      ///< the last direction has not all digits, its Hessian may be indefinite
  bool is_tight_ = false;                      ///< all directions from now on have them
  int psd_iterations_ = 0;
  int blocked_ = 0;
  double first_gradient_ = -1, first_step_ = -1;  ///< norms with the held dofs in place; below 0: not there yet
  int unresolved_ = 0;                            ///< steps in a row that promised less than round-off
  int stalled_ = 0;
};

}  // namespace

NewtonSummary minimize(const Energy& energy, VectorView x, const DofMap& dofs, const VectorX& target, NewtonSystem& system,
                       const NewtonOptions& options, Workspace& workspace, const NewtonExtras& extras) {
  return Minimizer(energy, x, dofs, target, system, options, workspace, extras).run();
}

}  // namespace itr
