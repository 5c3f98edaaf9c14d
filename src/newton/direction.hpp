// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "convergence.hpp"
#include "core/timer.hpp"

namespace itr {

/// Whether a shift of the Hessian may help.
inline bool is_curable(linear::Outcome outcome) {
  return outcome != linear::Outcome::non_finite && outcome != linear::Outcome::out_of_memory &&
         outcome != linear::Outcome::failed;
}

/// Newton's step: of the true Hessian where that is known to be positive definite, else of the projected one, else of one
/// that is shifted until it is. As few digits are asked of it as the iteration can use.
class Direction {
 public:
  Direction(const Task& task, const Iterate& at, DirichletContinuation& held, const Convergence& convergence)
      : task_(task),
        at_(at),
        held_(held),
        convergence_(convergence),
        scratch_(task.workspace.get<Scratch>()),
        step_{scratch_.step.resize(at.x().size())} {}

  /// False where no Hessian gives a step of descent; failure() says why.
  bool find() {
    const NewtonOptions& options = task_.options;
    asked_ = digits_to_ask();
    gradient_before_ = at_.gradient_norm();
    // A direction of the true Hessian is only taken where it is known to lead to a minimum, not to a saddle.
    const bool may_be_true = options.indefinite == IndefiniteHessian::accept || task_.system.tells_definiteness();
    is_projected_ =
        options.project_to_psd && (projected_iterations_ > 0 || options.projected_iterations == 0 || !may_be_true);
    if (projected_iterations_ > 0) --projected_iterations_;
    if (!is_projected_ && find_with(PsdProjection::none)) return true;
    if (options.project_to_psd) {
      if (!is_projected_) projected_iterations_ = options.projected_iterations - 1;
      is_projected_ = true;
      if (find_with(PsdProjection::clamp)) return true;
    }
    for (int attempt = 0; attempt < kMostFractions && is_curable(solved_.outcome); ++attempt)
      if (solve(Shift::fraction_of_diagonal(kFirstFraction * std::pow(10, attempt)))) return true;
    const double scale = std::max(task_.system.diagonal_scale(), 1e-300);
    for (int attempt = 0; attempt < kMostShifts && is_curable(solved_.outcome); ++attempt)
      if (solve(kFirstShift * std::pow(10, attempt) * scale)) return true;
    return false;
  }
  /// The step of the projected Hessian, once the one of the true Hessian has led nowhere. False if it has been tried.
  bool find_projected() {
    if (is_projected_ || !task_.options.project_to_psd) return false;
    projected_iterations_ = task_.options.projected_iterations - 1;
    is_projected_ = true;
    return find_with(PsdProjection::clamp);
  }
  /// Solves this step and later ones with all digits, so that convergence is certain.
  bool tighten() {
    is_tight_ = true;
    asked_ = kTightResidual;
    const bool found = solve(shift_, true);
    if (!is_projected_ && shift_.value == 0) note_definiteness();
    return found || find();
  }

  Step& step() { return step_; }
  const Step& step() const { return step_; }
  /// The step has not all digits, and its Hessian may be indefinite.
  bool is_loose() const { return is_loose_; }
  /// Whether the true Hessian at x is indefinite. It is factorised only if the last one was, or if a loose solve left this
  /// open.
  bool is_hessian_indefinite() {
    if (task_.options.indefinite == IndefiniteHessian::accept || !task_.has_unknowns()) return false;
    const bool is_open = is_loose_ || (task_.extras.must_be_minimum && (known_at_ == kNone || was_long_step()));
    if (!was_indefinite_ && !is_open) return false;
    if (was_indefinite_ && known_at_ == at_.revision()) return true;
    assemble(PsdProjection::none);
    const ScopedTimer timer(task_.summary.linear_seconds);
    VectorX none;
    solved_ = was_indefinite_ || !is_loose_ ? task_.system.factorize(0)
                                            : task_.system.solve(0, right_hand_side(), {kTightResidual}, none);
    is_loose_ = false;
    note_definiteness();
    return was_indefinite_;
  }
  void assemble(PsdProjection psd) {
    const ScopedTimer timer(task_.summary.assembly_seconds);
    task_.system.assemble(task_.energy, at_.x(), psd, task_.dofs, held_.motion(), task_.workspace);
  }
  int indefinite() const { return indefinite_; }  ///< true Hessians found so
  const std::string& failure() const { return failure_; }

 private:
  static constexpr double kLoosest = 1e-4;         ///< residual of a direction
  static constexpr int kMostLoose = 8;             ///< iterations of a solve that may be loose
  static constexpr double kFirstFraction = 1e-13;  ///< of each diagonal entry
  static constexpr int kMostFractions = 12;        ///< each ten times the one before
  static constexpr double kFirstShift = 1e-10;     ///< of the largest: where an entry is 0 or below
  static constexpr int kMostShifts = 12;
  static constexpr double kMostOfShift = 0.1;  ///< of the curvature along a step that may be the last

  struct Scratch {
    ScratchVector step, rhs, solution;
  };
  /// Relative residual to which a step is solved. The gradient after a Newton step is at best of second order in the one
  /// before, so more digits are wasted (Eisenstat & Walker 1996). Only steps that may end the solve get all digits.
  double digits_to_ask() const {
    if (is_tight_ || !held_.is_done() || task_.options.indefinite == IndefiniteHessian::accept) return kTightResidual;
    // Loose solves may overlook negative curvature; Newton then creeps.
    if (indefinite_ > 0 || task_.summary.iterations >= kMostLoose) return kTightResidual;
    const double left = gradient_before_ > 0 ? at_.gradient_norm() / gradient_before_ : 1;
    const double asked = std::clamp(0.1 * left * left, kTightResidual, kLoosest);
    const bool may_be_last = 0.1 * at_.gradient_norm() * std::max(left * left, asked) < convergence_.gradient_asked();
    return may_be_last ? kTightResidual : asked;
  }
  bool find_with(PsdProjection psd) {
    assemble(psd);
    const bool found = solve(0);
    if (psd == PsdProjection::none) note_definiteness();
    return found;
  }
  /// Solves for the full step; true where it is one of descent. `goes_on`: from the solution that is there.
  bool solve(const Shift& shift, bool goes_on = false) {
    shift_ = shift;
    is_loose_ = false;
    const ScopedTimer timer(task_.summary.linear_seconds);
    if (!task_.has_unknowns()) {
      begin_step();
      step_.norm = 0;
      step_.curvature = held_.motion().curvature;
      return true;
    }
    const ConstVectorView rhs = right_hand_side();
    VectorView solution = scratch_.solution.resize(rhs.size());
    // The solution of an indefinite Hessian must not be used: along eigenvectors of negative eigenvalues, Newton's step goes
    // up to a saddle.
    const bool if_indefinite = task_.options.indefinite == IndefiniteHessian::accept;
    solved_ = task_.system.solve(shift, rhs, {kTightResidual, asked_, if_indefinite, goes_on}, solution);
    if (solved_.negative_eigenvalues > 0 && !if_indefinite)
      return fail(std::to_string(solved_.negative_eigenvalues) + " negative eigenvalues");
    const bool has_solution = solved_.outcome == linear::Outcome::ok || solved_.outcome == linear::Outcome::not_converged;
    if (!has_solution || !std::isfinite(solved_.residual) || !solution.allFinite())
      return fail(std::string(to_string(solved_.outcome)) + ", " + task_.system.message());
    is_loose_ = solved_.residual > kTightResidual && solved_.residual <= asked_;
    if (!is_loose_) task_.summary.linear_residual = solved_.residual;  // errors of earlier ones are made good
    if (!set_step(rhs, solution)) return false;
    step_.is_of_shift = shift.value > 0 && task_.system.curvature_of(shift, solution) > kMostOfShift * solution.dot(rhs);
    return true;
  }
  bool set_step(ConstVectorView rhs, ConstVectorView solution) {
    const double descent = solution.dot(rhs);  // of no minimiser of a convex model where it is not positive
    if (!(descent > 0) && !rhs.isZero(0)) return false;
    begin_step();
    // p^T H p over all dofs, with H_ff p_f = rhs.
    const PrescribedMotion& motion = held_.motion();
    step_.curvature = descent;
    if (motion.coupling.size() > 0) step_.curvature += 2 * solution.dot(motion.coupling);
    step_.curvature += motion.curvature;
    for (Eigen::Index i = 0; i < step_.direction.size(); ++i)
      if (task_.dofs.unknown[i] != kNone) step_.direction[i] = solution[task_.dofs.unknown[i]];
    step_.norm = task_.norms.of_step(step_.direction);
    return true;
  }
  /// Sets the step to the prescribed motion of the held dofs, and to zero elsewhere.
  void begin_step() {
    step_.is_set = true;
    step_.is_of_shift = false;
    if (held_.is_advancing())
      step_.direction = held_.motion().step;
    else
      step_.direction.setZero();
  }
  ConstVectorView right_hand_side() {
    VectorView rhs = scratch_.rhs.resize(task_.dofs.num_unknowns);
    rhs.setZero();
    if (held_.motion().coupling.size() > 0) rhs -= held_.motion().coupling;
    for (Eigen::Index i = 0; i < at_.x().size(); ++i)
      if (task_.dofs.unknown[i] != kNone) rhs[task_.dofs.unknown[i]] -= at_.gradient()[i];
    return rhs;
  }
  /// Records whether the true Hessian at x is indefinite. It has to be the last matrix that was solved with.
  void note_definiteness() {
    was_indefinite_ = solved_.definiteness == linear::Definiteness::indefinite;
    known_at_ = at_.revision();
    indefinite_ += was_indefinite_;
  }
  /// Whether the Hessian may have become another one since it was assembled: in the first step of a solve, for example.
  bool was_long_step() const {
    constexpr double kLong = 1e-3;  ///< of the whole way
    return known_at_ != at_.revision() && step_.is_set && step_.direction.norm() > kLong * at_.x().norm();
  }
  bool fail(const std::string& reason) {
    if (!task_.extras.is_brief) failure_ = " (linear solve: " + reason + ")";
    return false;
  }

  const Task& task_;
  const Iterate& at_;
  DirichletContinuation& held_;
  const Convergence& convergence_;
  Scratch& scratch_;
  Step step_;
  linear::SystemReport solved_;  ///< the last system
  std::string failure_;          ///< why the last one failed that did

  bool is_projected_ = false;     ///< the step is of the projected Hessian
  int projected_iterations_ = 0;  ///< that are still to come before the true one is tried again
  Shift shift_;                   ///< of the step's Hessian

  double asked_ = kTightResidual;  ///< residual of the step
  double gradient_before_ = 0;     ///< norm, when the step before was asked for
  bool is_loose_ = false;
  bool is_tight_ = false;  ///< all steps from now on have all digits

  bool was_indefinite_ = false;  ///< the true Hessian that was factorised last
  int known_at_ = kNone;         ///< revision of x where that was
  int indefinite_ = 0;
};

}  // namespace itr
