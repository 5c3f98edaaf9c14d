// SPDX-License-Identifier: MIT
// Solution of one step's problem, in rounds for the terms that are lagged: friction, damping, pressure without a potential.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/timer.hpp"
#include "diagnosis.hpp"
#include "energy/least_motion.hpp"
#include "energy/polyfem/lagged_regularization.hpp"
#include "fem/hessian_sink.hpp"
#include "flight_guard.hpp"
#include "itr/core.hpp"
#include "itr/types.hpp"
#include "lagging_rounds.hpp"
#include "newton/corrected_system.hpp"
#include "newton/iterate.hpp"
#include "simulation/constraint_rounds.hpp"
#include "simulation/rigid_solve.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

namespace {

constexpr std::size_t kLongestCycle = 16;      ///< rounds that are remembered
constexpr int kPressureRounds = 50;            ///< most, where pressure has no potential
constexpr int kMostRounds = 1000;              ///< where no number limits them
constexpr double kLoadsWorthSaying = 1e-2;     ///< of what loads may be off: less is not said
constexpr double kFrictionWorthSaying = 1e-2;  ///< of friction's forces: less is not said
constexpr int kPatience = 30;                  ///< rounds without a smaller residual after which lagging will not converge
constexpr double kLooseForce = 1e-2;           ///< of the forces that act: to which the first round is solved
constexpr double kProximalForce = 1e-3;        ///< of the forces that act: to which proximal steps are solved
constexpr int kLooseRounds = 4;                ///< at most: what goes on for longer may do so because rounds are not exact
constexpr int kPlainRounds = 10;               ///< after which rounds are relaxed
constexpr double kLooseByChange = 0.1;         ///< of what lagged forces change by: to which the next one is

constexpr double kDigits = 1e-3;  ///< of the tolerance: to which rounds of bodies that land go on while they gain,
constexpr int kIdleRounds = 3;    ///< until so many in a row did not, so that all solvers end alike
constexpr double kAnywhere = std::numeric_limits<double>::infinity();

constexpr auto is_friction = [](const auto& term) { return term.kind == TermKind::friction; };

}  // namespace

/// Solves a problem and leaves in it the solution, its lagged terms and the barrier stiffness.
template <int Dim>
class LaggedSolve {
 public:
  LaggedSolve(StepProblem<Dim>& problem, bool must_settle) : problem_(problem), must_settle_(must_settle) {}
  /// Solves as StepProblem::solve says.
  NewtonSummary solve(VectorX& x, const VectorX& lagged_x, const VectorX& expected) {
    double lagging_seconds = 0;
    VectorX step_to_start;
    {
      const ScopedTimer timer(lagging_seconds);
      VectorX start = with_held_at_targets(expected.size() > 0 ? expected : x);
      if (rigid_) start = by_coordinates().along_arcs(start);
      if (potential_.contact())
        potential_.contact()->predict_motion(surface_.positions(x), surface_.motion(start - x), workspace_);
      const bool is_first_step = std::isinf(stiffness_.largest);
      if (adaptive_ && !is_first_step)
        problem_.initialize_stiffness(x);  // what the friction of the first round is lagged with
      const double motion = relative_motion<Dim>(with_held_at_targets(lagged_x) - base_);
      problem_.smooth_friction_by(lagged_x == base_ ? std::max(motion, problem_.last_motion_) : motion);
      lagged_ = potential_.lag(lagged_x, workspace_);
      // PolyFEM begins where the step does: so it is in the regression values of peers' scenes.
      const bool may_move = !adaptive_ && setup_.newton.indefinite == IndefiniteHessian::project;
      if (expected.size() > 0 && may_move && is_better_start(start, x)) {
        if (terms_.has_inertia) step_to_start = start - x;
        x = start;
      }
    }
    problem_.rounds_ = 0;
    regularized_about_ = lagged_x;
    NewtonSummary summary = minimize_first(x, std::move(step_to_start));
    problem_.rounds_ = 1;
    summary.assembly_seconds += lagging_seconds;
    const int rounds = most_rounds();
    const double tolerance = setup_.contact.friction_tolerance * setup_.time.dt;
    std::vector<VectorX> previous = {lagged_x};  // newest last
    VectorX best = x;
    Lagged best_lagged = lagged_;
    BarrierStiffness best_stiffness = stiffness_;
    bool is_best_loose = loose_force_ > 0;
    double least = std::numeric_limits<double>::infinity();
    int best_round = 0, round = 1;
    RoundsEnd end = rounds > 1 ? RoundsEnd::most : RoundsEnd::asked;
    std::optional<Lagged> now;  // what is lagged at x, where the last round made it
    Relaxation relaxation;
    Mixing mixing;
    VectorX pressed_x = lagged_x;  // where pressure is lagged
    const auto solve_again = [&] {
      regularized_about_ = x;
      NewtonSummary next = minimize_lagged(x);
      ++problem_.rounds_;
      const bool is_fixed_point = next.converged() && next.iterations == 0 && loose_force_ == 0;
      next.add_effort(summary);
      summary = std::move(next);
      return is_fixed_point;
    };
    for (; summary.converged() && round < rounds; ++round) {
      Lagged next_lagged;
      double residual, factor = 1;
      bool is_settled;
      {
        const ScopedTimer timer(summary.assembly_seconds);
        problem_.smooth_friction_by(relative_motion<Dim>(problem_.increment_of(x)));
        next_lagged = potential_.lag(x, workspace_);
        if (setup_.lagging_tolerance > 0) {
          residual = largest_change(x, next_lagged);
          const bool gains_digits =
              has_landed_ && residual > kDigits * setup_.lagging_tolerance && round - best_round <= kIdleRounds;
          is_settled = residual <= setup_.lagging_tolerance && loose_force_ == 0 && !gains_digits;
          if (round > kPlainRounds && lagged_.friction && next_lagged.friction)
            factor = relaxation.factor(residual_of_lagging(x, next_lagged));
        } else {
          residual = residual_of(x, next_lagged);
          is_settled = (potential_.has_friction() || lagged_.adhesive_friction) && residual <= tolerance;
        }
      }
      if (is_settled) {
        end = RoundsEnd::asked;
        break;
      }
      if (residual < least) {
        least = residual;
        best = x;
        best_lagged = lagged_;
        best_stiffness = stiffness_;
        is_best_loose = loose_force_ > 0;
        best_round = round;
      } else if (round - best_round >= kPatience) {
        x = best;
        lagged_ = best_lagged;
        if (adaptive_) {
          stiffness_ = best_stiffness;
          potential_.contact()->set_stiffness(stiffness_.value);
        }
        end = RoundsEnd::stalled;
        if (is_best_loose) solve_again();
        break;
      }
      if (const auto recurred = has_recurred(x, previous, setup_.newton.step_tolerance, problem_.scope_->diagonal);
          recurred && loose_force_ == 0) {
        end = *recurred;
        now = std::move(next_lagged);
        break;
      }
      if (previous.size() == kLongestCycle) previous.erase(previous.begin());
      previous.push_back(x);
      if (lagged_.pressure && lagged_.pressure->is_lagged(dofs_)) {
        pressed_x = mixing.next(pressed_x, x);
        next_lagged.pressure = std::make_shared<PressureEnergy<Dim>>(cells_, terms_.loads, pressed_x, terms_.scaling);
      }
      if (factor != 1) next_lagged.friction_of_surface->relax(*lagged_.friction_of_surface, factor);
      lagged_ = std::move(next_lagged);
      loose_force_ = round < std::min(kLooseRounds, rounds - 1) ? asked_of_round(residual) : 0;
      if (solve_again()) {
        end = RoundsEnd::settled;
        break;
      }
    }
    const bool is_open = end == RoundsEnd::most || end == RoundsEnd::cycle || end == RoundsEnd::stalled;
    if (summary.converged() && is_open) judge_lagging(x, std::move(now), to_string(end), round, summary);
    if (summary.converged()) tell_of_jump(x, summary);
    return summary;
  }

 private:
  using Lagged = typename IncrementalPotential<Dim>::Lagged;
  using Traits = TermTraits<Dim>;
  /// The solve of the first round. Bodies that only contact and friction hold begin a step without the contact that will
  /// hold them, and would slide off before friction is lagged where contact forces are new. So where these become more than
  /// `change` times as large or small, the way is taken again by proximal steps (Rockafellar 1976), each with friction
  /// lagged where it begins: as bodies move in thick oil.
  NewtonSummary minimize_first(VectorX& x, VectorX step_to_start) {
    loose_force_ = asked_of_round(1);  // of proximal steps less
    if (!least_motion_ || !potential_.has_friction()) return minimize_lagged(x, std::move(step_to_start));
    constexpr int kMostSteps = 400, kMostAtTheEnd = 20;
    constexpr double kLeastReach = 1e-3, kGrowth = 4, kLargestReach = 1;
    const double change = setup_.lagging_tolerance > 0 ? 4 : 2;
    const auto is_near = [change](double a, double b) { return a <= change * b && b <= change * a; };
    NewtonSummary all;
    for (int steps = 0, before_longer = 0, at_the_end = 0;; ++steps) {
      const VectorX begin = x;
      const std::vector<double> forces = contact_forces_on_loose_parts(begin);
      bool has_changed = false;
      const auto changes = [&](const VectorX& iterate) {
        if (!moves_loose_parts(iterate - begin, kLeastReach)) return false;
        const std::vector<double> now = contact_forces_on_loose_parts(iterate);
        return has_changed = !std::equal(now.begin(), now.end(), forces.begin(), is_near);
      };
      const bool may_be_shorter = reach_ > kLeastReach && steps < kMostSteps;
      loose_force_ = std::isinf(reach_) ? asked_of_round(1) : std::min(asked_of_round(1), kProximalForce);
      NewtonSummary summary = minimize_lagged(x, std::exchange(step_to_start, {}),
                                              may_be_shorter ? changes : std::function<bool(const VectorX&)>());
      summary.add_effort(all);
      all = std::move(summary);
      if (has_changed) {
        x = begin;
        reach_ = std::isinf(reach_) ? kLeastReach : std::max(kLeastReach, reach_ / kGrowth);
        before_longer = static_cast<int>(kGrowth);
        has_landed_ = true;
        continue;
      }
      const bool is_last = !least_motion_->is_holding();
      // A proximal step only chooses the way: where it fails, the way is that of one solve.
      if (!all.converged() && !is_last && all.termination != Termination::cancelled) {
        x = begin;
        reach_ = kAnywhere;
        steps = kMostSteps;
        continue;
      }
      Lagged next = lagged_;
      if (all.converged()) potential_.lag_friction(x, workspace_, next);
      if (!all.converged() ||
          (is_last && (at_the_end == kMostAtTheEnd || change_of(x, next, is_friction) <= 1 - 1 / change))) {
        reach_ = kAnywhere;
        return all;
      }
      lagged_ = std::move(next);
      if (is_last)
        ++at_the_end;
      else if (steps >= kMostSteps)
        reach_ = kAnywhere;
      else if (changes(x))
        before_longer = 0;
      else if (--before_longer <= 0)
        reach_ = kGrowth * reach_ > kLargestReach ? kAnywhere : kGrowth * reach_;
    }
  }
  /// Whether a node of a loose part moves by more than `fraction` of the part's size.
  bool moves_loose_parts(const VectorX& motion, double fraction) const {
    return std::ranges::any_of(least_motion_->parts(), [&](const LoosePart<Dim>& part) {
      return std::ranges::any_of(
          part.nodes, [&](int node) { return motion.template segment<Dim>(Dim * node).norm() > fraction * part.size; });
    });
  }
  /// The largest coordinate of what may move [m]; obstacles may reach much farther.
  double farthest_unknown() const {
    double farthest = 0;
    for (Eigen::Index i = 0; i < base_.size(); ++i)
      if (dofs_.unknown[i] != kNone) farthest = std::max(farthest, std::abs(base_[i]));
    return farthest;
  }
  /// Says where friction has fallen from static to kinetic within the step, which then depends on its length.
  void tell_of_jump(const VectorX& x, NewtonSummary& summary) const {
    const VectorX& v = problem_.start_velocity_;
    if (v.size() == 0 || !lagged_.friction_of_surface) return;
    const VectorX of_surface = surface_.motion(v);
    const int pairs = lagged_.friction_of_surface->count_let_go(of_surface, potential_.on_surface(x));
    if (pairs > 0)
      summary.message += fmt::format(
          "{}{} to slide, where friction falls from static to kinetic within the step: when is known to a step (/time/dt)",
          summary.message.empty() ? "" : "; ", pairs == 1 ? "a contact begins" : fmt::format("{} contacts begin", pairs));
  }
  /// Norm of the gradient at x, with terms as they are lagged, scaled.
  double residual_of(const VectorX& x, const Lagged& lagged) {
    VectorX gradient = VectorX::Zero(x.size());
    EnergyOfIncrement(potential_.sum(lagged), base_).add_gradient(problem_.increment_of(x), gradient, workspace_);
    if (rigid_) gradient = rigid_->without_reactions(std::move(gradient));
    return Norms(dofs_, NewtonNorm::euclidean, {}).of_gradient(gradient);
  }
  /// One solve with `lagged_`, which `ends_at(x)`, if given, ends at an iterate. Adaptive stiffness balances the terms
  /// before held dofs move: so it is in the regression values of peers' scenes.
  NewtonSummary minimize_lagged(VectorX& x, VectorX step_to_start = {},
                                const std::function<bool(const VectorX& x)>& ends_at = {}) {
    const EnergySum sum = potential_.sum(lagged_);
    if (norm_weights_.size() == 0 && setup_.newton.norm != NewtonNorm::euclidean) {
      norm_weights_ = unit_mass_diagonal(cells_);
      if (rigid_) norm_weights_ = rigid_->weights_of(norm_weights_);
    }
    NewtonExtras extras{.norm_weights = {norm_weights_.data(), static_cast<std::size_t>(norm_weights_.size())},
                        .on_iteration = setup_.on_iteration,
                        .must_be_minimum = !terms_.has_inertia,
                        .position_round_off = std::numeric_limits<double>::epsilon() * farthest_unknown()};
    if (step_to_start.size() > 0) {
      extras.gradient_of_step = VectorX::Zero(x.size());
      potential_.inertia()->add_mass_product(step_to_start, extras.gradient_of_step);
      extras.step_to_start = std::move(step_to_start);
    }
    if (terms_.has_inertia && !rigid_ && loose_force_ == 0)
      extras.add_inertia_of_motion = [this](ConstVectorView d, VectorView gradient) {
        potential_.inertia()->add_mass_product(d, gradient);
      };
    if (cells_.has_curved()) {
      potential_.elastic()->refine_quadrature(x);
      extras.after_step = [&](const VectorX& d) { return potential_.elastic()->refine_quadrature(base_ + d); };
    }
    if (!adaptive_) return minimize_from(x, sum, std::move(extras), ends_at);
    problem_.initialize_stiffness(x);
    x = start_of_solve(x);
    bool is_first = true;
    extras.after_step = [&](const VectorX& d) {
      const VectorX iterate = base_ + d;
      const bool refined = potential_.elastic()->refine_quadrature(iterate);
      if (std::exchange(is_first, false) || setup_.time.is_static) return refined;
      const bool changed = adaptive_->update(surface_.positions(iterate), stiffness_, workspace_);
      if (changed) potential_.contact()->set_stiffness(stiffness_.value);
      return changed || refined;
    };
    return minimize_from(x, sum, std::move(extras), ends_at);
  }
  /// Norms of the contact forces, scaled.
  std::vector<double> contact_forces_on_loose_parts(const VectorX& x) {
    VectorX gradient = VectorX::Zero(x.size());
    EnergySum sum;
    potential_.add_to(sum, lagged_, [](const Traits& term) { return term.kind == TermKind::contact; });
    sum.add_gradient(x, gradient, workspace_);
    std::vector<double> forces;
    for (const auto& part : least_motion_->parts()) {
      double squared = 0;
      for (const int node : part.nodes) squared += gradient.template segment<Dim>(Dim * node).squaredNorm();
      forces.push_back(std::sqrt(squared));
    }
    return forces;
  }
  /// Minimises over the increment from the positions at the start of the step.
  NewtonSummary minimize_from(VectorX& x, const EnergySum& sum, NewtonExtras extras,
                              const std::function<bool(const VectorX& x)>& ends_at) {
    VectorX d = problem_.increment_of(x);
    const VectorX target = held_.target - base_;
    EnergySum all = regularized(sum);
    if (least_motion_) {
      all.add(least_motion_);
      follow_least_motion(sum, d);
      least_motion_->hold(base_ + d, reach_);
      if (least_motion_->is_holding()) extras.must_be_minimum = false;
      extras.after_step = [&, before = extras.after_step](const VectorX& iterate) {
        const bool changed = before && before(iterate);
        follow_least_motion(sum, iterate);
        return changed;
      };
    }
    if (setup_.lagging_tolerance > 0 && lagged_.friction) follow_friction(d, extras);
    enum class EndedBy { solver, flight, caller } ended_by = EndedBy::solver;
    std::optional<FlightGuard<Dim>> guard;
    if (!terms_.has_inertia)
      guard.emplace(base_, dofs_, held_.target,
                    least_motion_ ? std::span(least_motion_->parts()) : std::span<const LoosePart<Dim>>());
    extras.on_iteration = [&, before = extras.on_iteration](const NewtonProgress& progress) {
      if (guard && guard->has_flown(d))
        ended_by = EndedBy::flight;
      else if (ends_at && ends_at(base_ + d))
        ended_by = EndedBy::caller;
      return ended_by == EndedBy::solver && (!before || before(progress));
    };
    constexpr std::size_t kMostParts = 16;  ///< whose motions are solved for to all digits
    const bool is_corrected = least_motion_ && least_motion_->parts().size() <= kMostParts;
    CorrectedSystem corrected(problem_.newton_system(),
                              [&](ConstVectorView iterate, const DofMap&) { return loose_motions(iterate); });
    NewtonSystem& in_use = is_corrected ? static_cast<NewtonSystem&>(corrected) : problem_.newton_system();
    NewtonOptions options = setup_.newton;
    if (loose_force_ > 0) {
      options.force_tolerance = std::max(options.force_tolerance, loose_force_);
      extras.must_be_minimum = false;
    }
    const auto solve = [&] {
      return rigid_ ? by_coordinates().minimize(all, d, target, in_use, options, extras, workspace_)
                    : minimize(EnergyOfIncrement(all, base_), d, dofs_, target, in_use, options, workspace_, extras);
    };
    NewtonSummary summary = solve();
    if (!problem_.constraints_.empty() && ended_by == EndedBy::solver) {
      extras.step_to_start.resize(0);
      close_constraints(problem_.constraints_, base_, d, solve, setup_.units, summary);
    }
    x = positions_at(d, target);
    if (summary.blocked_from.size() > 0) summary.blocked_from += base_;
    problem_.solution_ = {x, std::move(d)};
    if (ended_by == EndedBy::caller) return summary;
    if (ended_by == EndedBy::flight) {
      summary.termination = Termination::no_descent;
      summary.message = describe_turn<Dim>(scope_, terms_.loads, dofs_, base_, held_.target, x);
      if (summary.message.empty()) summary.message = guard->describe(setup_.units);
      return summary;
    }
    return explained(std::move(summary), sum, x);
  }
  EnergySum regularized(const EnergySum& sum) const {
    EnergySum all = sum;
    if (const LaggedRegularization& options = setup_.lagged_regularization;
        setup_.time.is_static && options.weight > 0 && problem_.rounds_ < options.rounds)
      all.add(std::make_shared<LaggedRegularizationEnergy<Dim>>(regularized_about_, options.weight));
    return all;
  }
  /// Adds up base and increment; held dofs that have reached their targets are there without round-off.
  VectorX positions_at(const VectorX& d, const VectorX& target) const {
    VectorX x = base_ + d;
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] == kNone && d[i] == target[i]) x[i] = held_.target[i];
    return x;
  }
  /// Where there are rigid bodies.
  RigidSolve<Dim> by_coordinates() const { return {*rigid_, base_, problem_.solve_dofs_}; }
  /// The motions of loose parts at an iterate, by coordinates.
  MatrixX loose_motions(ConstVectorView iterate) const {
    if (!rigid_) return least_motion_->rigid_motions(base_ + iterate, dofs_);
    return by_coordinates().free_motions(least_motion_->rigid_motions(base_ + rigid_->map()->motion(iterate), dofs_));
  }
  /// Lets a solve from the increment d be primal-dual in friction.
  void follow_friction(const VectorX& d, NewtonExtras& extras) {
    lagged_.friction_of_surface->begin_solve(potential_.on_surface(base_ + d), problem_.rounds_ > 0);
    extras.on_iteration = [&, before = extras.on_iteration, weights = extras.norm_weights,
                           last = VectorX(d)](const NewtonProgress& progress) mutable {
      const VectorX change = rigid_ ? rigid_->of_motion(d - last) : VectorX(d - last);
      const double step = Norms(problem_.solve_dofs_, setup_.newton.norm, weights).of_step(change);
      const double fraction = progress.step_norm > 0 ? std::min(1.0, step / progress.step_norm) : 1;
      lagged_.friction_of_surface->follow(potential_.on_surface(base_ + d), fraction);
      last = d;
      return !before || before(progress);
    };
  }
  void follow_least_motion(const EnergySum& sum, const VectorX& d) {
    VectorX gradient = VectorX::Zero(d.size()), sizes = gradient;
    EnergyOfIncrement(sum, base_).add_gradient_and_sizes(d, gradient, sizes, workspace_);
    if (rigid_) gradient = rigid_->without_reactions(std::move(gradient));
    least_motion_->follow(gradient, sizes, dofs_);
  }
  /// `summary` with the reason of a failure.
  NewtonSummary explained(NewtonSummary summary, const EnergySum& sum, const VectorX& x) {
    if (is_crushed<Dim>(scope_, summary, x)) summary.termination = Termination::no_descent;
    if (summary.converged()) return summary;
    if (const std::string turn = describe_turn<Dim>(scope_, terms_.loads, dofs_, base_, held_.target, x); !turn.empty())
      summary.message = turn + "; " + summary.message;
    summary.message += diagnosis<Dim>(scope_, summary, sum, x, workspace_);
    return summary;
  }
  /// x with held dofs at their targets.
  VectorX with_held_at_targets(VectorX x) const {
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] == kNone) x[i] = held_.target[i];
    return x;
  }
  /// Whether a solve from x had better begin at `start`: the way there is free, and the energy lower than where only what is
  /// held moves.
  bool is_better_start(const VectorX& start, const VectorX& x) {
    const EnergySum sum = potential_.sum(lagged_);
    return sum.max_step(x, start - x, workspace_) == 1 &&
           sum.value(start, workspace_) < sum.value(with_held_at_targets(x), workspace_);
  }
  /// x with held dofs at their targets, where the straight way there is free.
  VectorX start_of_solve(const VectorX& x) {
    const VectorX start = with_held_at_targets(x);
    const bool free = std::isfinite(potential_.elastic()->value(start, workspace_)) &&
                      (!cells_.has_curved() || potential_.elastic()->max_step(x, start - x, workspace_) == 1) &&
                      potential_.contact_of_cells()->max_step(x, start - x, workspace_) == 1;
    return free ? start : x;
  }
  /// How often the step may be solved, each time with what is lagged at the solution before.
  int most_rounds() const {
    int rounds = 1;
    if (potential_.has_friction())
      rounds = setup_.contact.friction_iterations < 0 ? kMostRounds : setup_.contact.friction_iterations;
    if (lagged_.adhesive_friction) {
      const int asked = setup_.contact.adhesion.iterations;
      rounds = std::max(rounds, asked < 0 ? kMostRounds : asked);
    }
    if (setup_.time.is_static && setup_.lagged_regularization.weight > 0)
      rounds = std::max(rounds, setup_.lagged_regularization.rounds);
    if (!lagged_.damping.empty() || !lagged_.contact_damping.empty())
      for (const DampingOptions& options : setup_.damping)
        rounds = std::max(rounds, setup_.lagging_tolerance > 0 ? kMostRounds : options.lagging_rounds);
    if (has_lagged_loads()) rounds = std::max(rounds, kPressureRounds);
    return rounds;
  }
  /// Loads that depend on the positions and have no potential.
  bool has_lagged_loads() const {
    return !lagged_.follower.empty() || (lagged_.pressure && lagged_.pressure->is_lagged(dofs_));
  }
  /// Forces on unknowns at x of the terms of which `is_asked(traits)` holds, scaled.
  template <typename F>
  VectorX forces_of(const VectorX& x, const Lagged& lagged, const F& is_asked) {
    EnergySum sum;
    potential_.add_to(sum, lagged, is_asked);
    VectorX gradient = VectorX::Zero(x.size());
    sum.add_gradient(x, gradient, workspace_);
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] == kNone) gradient[i] = 0;
    return gradient;
  }
  /// By which fraction of themselves, of the larger, terms of which `is_asked(traits)` holds change from `lagged_` to `now`,
  /// in their forces on unknowns at x.
  template <typename F>
  double change_of(const VectorX& x, const Lagged& now, const F& is_asked) {
    const VectorX after = forces_of(x, now, is_asked), before = forces_of(x, lagged_, is_asked);
    const double size = std::max(after.norm(), before.norm()), change = (after - before).norm();
    if (!std::isfinite(change)) return std::numeric_limits<double>::infinity();
    return size > 0 ? change / size : 0;
  }
  /// By which part of the largest force at a vertex lagged terms change there from `lagged_` to `now`, in the worst case.
  /// Where friction is small beside what it may be, that counts.
  double largest_change(const VectorX& x, const Lagged& now) {
    const auto is_lagged = [](const Traits& term) { return term.needs_velocities || term.has_no_potential; };
    const auto largest = [](const VectorX& force) {
      return std::sqrt(force.reshaped(Dim, force.size() / Dim).colwise().squaredNorm().maxCoeff());
    };
    const VectorX before = forces_of(x, lagged_, is_lagged), after = forces_of(x, now, is_lagged);
    double size = std::max(largest(before), largest(after));
    if (potential_.has_friction())
      size =
          std::max(size, setup_.contact.largest_friction() *
                             largest(forces_of(x, now, [](const Traits& term) { return term.kind == TermKind::contact; })));
    return size > 0 ? largest(after - before) / size : 0;
  }
  /// Lagged forces on unknowns at x, `now` less those of `lagged_`, scaled.
  VectorX residual_of_lagging(const VectorX& x, const Lagged& now) {
    const auto is_lagged = [](const Traits& term) { return term.needs_velocities || term.has_no_potential; };
    return forces_of(x, now, is_lagged) - forces_of(x, lagged_, is_lagged);
  }
  /// Forces to which to solve a round, as NewtonOptions::force_tolerance, after one that changed lagged ones by `change`: as
  /// inexact Newton methods do (Dembo, Eisenstat & Steihaug 1982). 0: as exactly as the last round.
  double asked_of_round(double change) const {
    const bool may_be_loose = setup_.lagging_tolerance > 0 && potential_.has_friction() && most_rounds() > 1;
    return may_be_loose && change > setup_.lagging_tolerance ? std::min(kLooseForce, kLooseByChange * change) : 0;
  }
  /// Warns or fails where rounds of lagging ended unsettled after `rounds`. `now`: lagged at x, or nothing.
  void judge_lagging(const VectorX& x, std::optional<Lagged> now, std::string_view how, int rounds, NewtonSummary& summary) {
    if (!now) now = potential_.lag(x, workspace_);
    const double asked = setup_.lagging_tolerance, change = asked > 0 ? largest_change(x, *now) : 0;
    if (change > asked) {
      summary.message = fmt::format(
          "friction, pressure or damping changes by {:.2g} of the largest force, {} after {} solves; expected at most {:g} "
          "(/solver/lagging_tolerance)",
          change, how, rounds, asked);
      if (must_settle_) {
        summary.termination = Termination::lagging;
        return;
      }
    }
    if (has_lagged_loads()) {
      const double off = change_of(x, *now, [](const Traits& term) { return term.has_no_potential; });
      if (off > setup_.lagged_load_tolerance) {
        summary.termination = Termination::lagging;
        summary.message = fmt::format(
            "pressure or follower forces are {:.2g} of themselves off those of the positions reached, {} after {} solves; "
            "expected at most {:g} (/solver/advanced/lagged_load_tolerance): a smaller time step, or a stiffness with the "
            "forces, may settle them",
            off, how, rounds, setup_.lagged_load_tolerance);
        return;
      }
      if (asked == 0 && off > kLoadsWorthSaying * setup_.lagged_load_tolerance)
        summary.message = fmt::format(
            "pressure or follower forces are {:.2g} of themselves off those of the positions reached, {} after {} solves",
            off, how, rounds);
    }
    if (asked > 0 || !lagged_.friction || !now->friction) return;
    const double off = change_of(x, *now, is_friction);
    if (off > kFrictionWorthSaying)
      summary.message += fmt::format(
          "{}friction is {:.2g} of itself off that of the contact forces reached, {} after {} solves "
          "(/solver/contact/friction_iterations)",
          summary.message.empty() ? "" : "; ", off, how, rounds);
  }

  StepProblem<Dim>& problem_;
  bool must_settle_;
  double loose_force_ = 0;    ///< of the forces that act: to which a round is solved that is not the last; 0: as the last
  bool has_landed_ = false;   ///< a loose part, by proximal steps
  double reach_ = kAnywhere;  ///< of its size, how far the loads at the start of a solve carry a loose part
  const StepSetup<Dim>& setup_ = problem_.setup_;
  const PotentialTerms<Dim>& terms_ = problem_.terms_;
  const CellSet<Dim>& cells_ = problem_.cells_;
  const ContactSurface<Dim>& surface_ = problem_.surface_;
  Workspace& workspace_ = problem_.workspace_;
  const HeldDofs<Dim>& held_ = problem_.held_;
  const DofMap& dofs_ = problem_.dofs_;
  const RigidCoordinates<Dim>* const rigid_ = problem_.rigid_;  ///< null without rigid bodies
  IncrementalPotential<Dim>& potential_ = problem_.potential_;
  const VectorX& base_ = problem_.base_;
  const std::shared_ptr<LeastMotion<Dim>>& least_motion_ = problem_.least_motion_;
  const std::unique_ptr<AdaptiveStiffness<Dim>>& adaptive_ = problem_.adaptive_;
  BarrierStiffness& stiffness_ = problem_.stiffness_;
  Lagged& lagged_ = problem_.lagged_;
  const SolveScope<Dim> scope_{cells_,         potential_,   surface_,        static_cast<int>(setup_.obstacles.rest.size()),
                               terms_.scaling, setup_.units, terms_.materials};
  VectorX regularized_about_;
  VectorX norm_weights_;  ///< of NewtonNorm, once needed
};

template <int Dim>
NewtonSummary StepProblem<Dim>::solve(VectorX& x, const VectorX& lagged_x, const VectorX& expected, bool must_settle) {
  return LaggedSolve<Dim>(*this, must_settle).solve(x, lagged_x, expected);
}

#define ITR_INSTANTIATE(Dim) template NewtonSummary StepProblem<Dim>::solve(VectorX&, const VectorX&, const VectorX&, bool);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
