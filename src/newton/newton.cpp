// SPDX-License-Identifier: MIT
#include "newton/newton.hpp"

#include <cmath>
#include <sstream>
#include <string_view>

#include "saddle.hpp"

namespace itr {

namespace {

/// Newton's method: in each iteration a direction, a search along it, and the tests of convergence. Each part is a class
/// that keeps what it has to remember; only the iterate is shared.
class Minimizer {
 public:
  Minimizer(const Energy& energy, VectorView x, const DofMap& dofs, const VectorX& target, NewtonSystem& system,
            const NewtonOptions& options, Workspace& workspace, const NewtonExtras& extras)
      : task_{energy, dofs, system, options, extras, workspace, Norms(dofs, options.norm, extras.norm_weights), summary_},
        at_(task_, x),
        held_(task_, at_, target) {}

  NewtonSummary run() {
    if (!std::isfinite(at_.value())) return stop(Termination::infeasible, "the energy at the start is not finite");
    for (; summary_.iterations < task_.options.max_iterations; ++summary_.iterations) {
      if (task_.options.is_cancelled()) return stop(Termination::cancelled);
      held_.plan();
      at_.update_gradient();
      if (held_.is_stuck()) return stop(Termination::no_descent, held_.describe_distance_left());
      if (convergence_.has_small_gradient()) {
        if (saddle_.leave()) continue;
        convergence_.predict_decrement();
        return finish(Termination::gradient);
      }
      if (!find_direction()) return stop(Termination::no_descent, kNoDirection + direction_.failure());
      if (const auto passed = convergence_.test(direction_.step())) {
        if (saddle_.leave()) continue;
        return finish(*passed);
      }
      const double value_before = at_.value();
      if (!search()) {
        const bool at_round_off = convergence_.is_at_round_off();
        if (held_.takes_turns(at_round_off)) {
          if (held_.is_blocked_for_good()) return stop(Termination::no_descent, held_.describe_distance_left());
          continue;
        }
        if (!at_round_off) return stop(Termination::no_descent, "the line search found no step");
        if (saddle_.leave()) continue;
        return finish(Termination::round_off);
      }
      const bool stalled = convergence_.has_stalled(value_before);
      if (!report_progress()) return stop(Termination::cancelled, "as the program asked");
      if (stalled) {
        ++summary_.iterations;
        return stop(Termination::energy);
      }
    }
    return stop(Termination::iterations, describe_end_of_iterations());
  }

 private:
  static constexpr const char* kNoDirection = "the Newton system has no descent direction";

  /// A loose direction is tightened where its step may be the last one.
  bool find_direction() {
    if (!direction_.find()) return false;
    convergence_.note_decrement(direction_.step());
    return !direction_.is_loose() || !convergence_.is_near(direction_.step()) || direction_.tighten();
  }

  /// A failed search along a loose direction, then one along the true Newton direction, is tried once more along a better
  /// one.
  bool search() {
    Step& step = direction_.step();
    return search_.along(step) || (direction_.is_loose() && direction_.tighten() && search_.along(step)) ||
           (direction_.find_projected() && search_.along(step));
  }

  /// Returns false where the program ends the solve.
  bool report_progress() {
    const NewtonExtras& extras = task_.extras;
    if (extras.after_step && extras.after_step(at_.x())) at_.update_value();
    return !extras.on_iteration ||
           extras.on_iteration({summary_.iterations + 1, at_.value(), at_.gradient_norm(), direction_.step().norm});
  }

  /// Ends a solve that has converged, if not at a saddle.
  NewtonSummary finish(Termination termination) {
    if (termination == Termination::round_off && !convergence_.is_at_round_off())
      return stop(Termination::no_descent, describe_residual());
    return stop(
        saddle_.is_here() ? Termination::saddle : termination,
        termination == Termination::round_off && convergence_.is_creeping() ? describe_inexact_solves() : std::string());
  }

  NewtonSummary stop(Termination termination, std::string_view message = {}) {
    const Step& step = direction_.step();
    summary_.termination = termination;
    summary_.energy = at_.value();
    summary_.gradient_norm = at_.gradient_norm();
    summary_.step_norm = step.norm;
    summary_.decrement = convergence_.decrement();
    summary_.indefinite = direction_.indefinite();
    if (task_.extras.is_brief) return summary_;
    summary_.message = message;
    if (summary_.converged()) return summary_;
    if (step.is_set) summary_.failed_step = step.direction;
    if (at_.has_gradient()) summary_.worst_dof = find_worst_dof();
    return summary_;
  }

  int find_worst_dof() const {
    int worst = kNone;
    double largest = 0;
    for (Eigen::Index i = 0; i < at_.gradient().size(); ++i) {
      if (task_.dofs.unknown[i] == kNone || !(std::abs(at_.gradient()[i]) > largest)) continue;
      largest = std::abs(at_.gradient()[i]);
      worst = static_cast<int>(i);
    }
    return worst;
  }

  std::string describe_residual() const {
    std::ostringstream text;
    text << "no step lowers the forces that are left, which are " << convergence_.residual_by_round_off()
         << " times their round-off";
    return text.str();
  }

  std::string describe_inexact_solves() const {
    std::ostringstream text;
    text << "linear solves of a nearly singular system were inexact, and left forces of "
         << convergence_.residual_by_round_off() << " times their round-off; another linear solver may come nearer";
    return text.str();
  }

  std::string describe_end_of_iterations() const {
    if (task_.extras.is_brief) return {};
    return "no convergence in " + std::to_string(task_.options.max_iterations) + " iterations" +
           (held_.is_done() ? "" : ", " + held_.describe_distance_left());
  }

  NewtonSummary summary_;
  const Task task_;
  Iterate at_;
  DirichletContinuation held_;
  Convergence convergence_{task_, at_, held_};
  Direction direction_{task_, at_, held_, convergence_};
  Search search_{task_, at_, held_};
  Saddle saddle_{task_, at_, direction_, search_};
};

}  // namespace

NewtonSummary minimize(const Energy& energy, VectorView x, const DofMap& dofs, const VectorX& target, NewtonSystem& system,
                       const NewtonOptions& options, Workspace& workspace, const NewtonExtras& extras) {
  return Minimizer(energy, x, dofs, target, system, options, workspace, extras).run();
}

}  // namespace itr
