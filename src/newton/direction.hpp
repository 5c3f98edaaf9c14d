// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "convergence.hpp"

namespace itr {

/// Newton's step: of the true Hessian where that is known to be positive definite, else of the projected one, else of one
/// that is shifted until it is. As few digits are asked of it as the iteration can use.
class Direction {
 public:
  Direction(const Task& task, const Iterate& at, HeldMotion& held, const Convergence& convergence);

  /// False where no Hessian gives a step of descent; failure() says why.
  bool find();
  /// The step of the projected Hessian, once the one of the true Hessian has led nowhere. False if it has been tried.
  bool find_projected();
  /// Solves this step and later ones with all digits, so that convergence is certain.
  bool tighten();

  Step& step() { return step_; }
  const Step& step() const { return step_; }
  /// The step has not all digits, and its Hessian may be indefinite.
  bool is_loose() const { return is_loose_; }
  /// Whether the true Hessian at x is indefinite. It is factorised only if the last one was, or if a loose solve left this
  /// open.
  bool is_hessian_indefinite();
  void assemble(PsdProjection psd);
  int indefinite() const { return indefinite_; }  ///< true Hessians found so
  const std::string& failure() const { return failure_; }

 private:
  struct Kept {
    KeptVector step, rhs, solution;
  };
  double digits_to_ask() const;
  bool find_with(PsdProjection psd);
  bool solve(const Shift& shift, bool goes_on = false);
  bool set_step(ConstVectorView rhs, ConstVectorView solution);
  void begin_step();
  ConstVectorView right_hand_side();
  void note_definiteness();
  bool was_long_step() const;
  bool fail(const std::string& reason);

  const Task& task_;
  const Iterate& at_;
  HeldMotion& held_;
  const Convergence& convergence_;
  Kept& kept_;
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
