// SPDX-License-Identifier: MIT
// One time step: solve -> remesh -> project the history -> solve again (paper Algorithm 1).
#include "simulation/step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/check.hpp"
#include "core/profile.hpp"
#include "core/timer.hpp"
#include "remesh/carried_patches.hpp"
#include "simulation/accuracy_guard.hpp"
#include "simulation/chord_bound.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/effort_clock.hpp"
#include "simulation/energy_guard.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/invariants.hpp"
#include "simulation/past_step.hpp"
#include "simulation/remesh_step.hpp"
#include "simulation/shape_step.hpp"
#include "simulation/stability.hpp"
#include "simulation/step_terms.hpp"
#include "simulation/straightening.hpp"

namespace itr {

namespace {

constexpr int kManyIterations = 100;    ///< of a solve, from which on the reason is told
constexpr double kPoorResidual = 1e-6;  ///< of a linear solve, relative: a hundred times what Newton asks for

void add_seconds(const NewtonSummary& summary, StepSeconds& seconds) {
  seconds.assembly += summary.assembly_seconds;
  seconds.linear_solve += summary.linear_seconds;
  seconds.line_search += summary.line_search_seconds;
  seconds.ccd += summary.ccd_seconds;
}

std::string reason_of(const NewtonSummary& summary) {
  return std::string(to_string(summary.termination)) + ": " + summary.message;
}

/// Finds what is violated by the present positions, or by those that the history holds.
template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const State<Dim>& state, const VectorX& x) {
  std::string violation = find_violation(setup, state.mesh, x, state.chords);
  for (int age = 0; age < static_cast<int>(state.history.x.size()) && violation.empty(); ++age)
    violation = find_violation(setup, state.mesh, state.history.x[age], state.chords, age);
  return violation;
}

/// A step by one integrator from one state.
template <int Dim>
class StepSolver {
 public:
  /// The first solve starts at `x_start`; empty: at the positions before. It must settle what is lagged if the step may be
  /// cut.
  StepSolver(const StepTools<Dim>& tools, const State<Dim>& before, const Attempt& attempt, const VectorX& x_start,
             bool may_cut)
      : tools_(tools),
        setup_(tools.setup),
        before_(before),
        next_(before),
        x_(x_start),
        guard_(tools.setup, before),
        accuracy_(tools.setup, before, attempt),
        must_settle_(may_cut && tools.setup.lagging_tolerance > 0) {
    next_.step = before.step + 1;
    next_.t = setup_.time.time_after(next_.step);
    next_.history.damp_next = attempt.method != StepMethod::of_setup;
    report_.step = next_.step;
    report_.t = next_.t;
    report_.order = TimeIntegrator(setup_.time).accuracy(next_.history);
  }

  /// Solves, remeshes and solves again. If it has failed by its mesh, another call goes on from the first solve.
  std::optional<StepFailure> solve(Remeshing remeshing) {
    if (first_)
      go_back_to_first_solve();
    else if (auto failure = solve_first())
      return failure;
    if (setup_.remesh.enabled) {
      if (auto failure = remesh(remeshing)) return failure;
      first_.reset();
      if (const auto cancelled = let_buckle()) return failed(*cancelled);
      if (!guard_.allows(*problem_, next_.history, x_)) return forbidden();  // as it ends
    }
    if (setup_.newton.is_cancelled()) {
      first_summary_.termination = Termination::cancelled;
      return failed(first_summary_);
    }
    ITR_AUDIT(find_violation(setup_, next_, x_).empty(), find_violation(setup_, next_, x_));
    return std::nullopt;
  }

  /// Once solve() has led to a step, `after` is the state after it, and `start` (unless null) that before it, on its mesh.
  StepResult finish(State<Dim>& after, State<Dim>* start) {
    StepResult result;
    next_.created_energy = guard_.created_energy();
    {
      const ScopedTimer timer(report_.seconds.assembly);
      const auto phase = ScopedPhase::coarse("report");
      if (!setup_.remesh.enabled || !renumbering_.empty()) report_.energy = problem_->report(x_);
      if (!setup_.remesh.enabled) report_.energy_before_remesh = report_.energy.total;
      report_.vertices = next_.mesh.num_vertices();
      report_.elements = next_.mesh.num_cells();
      report_.unknowns = problem_->dofs().num_unknowns;
      report_.min_distance = problem_->min_distance(x_);
      report_.min_volume_ratio = min_volume_ratio(problem_->cells(), x_);
      if (setup_.fields.any_forces()) result.forces = problem_->forces(x_);
    }
    for (const auto& warning : report_fluids(setup_, before_.mesh, next_.mesh, next_.t, report_)) warn(warning);
    next_.stored_energy = std::max(before_.stored_energy, report_.energy.elastic + report_.energy.contact);
    if (accuracy_.is_on()) {
      report_.dt = setup_.time.dt;
      report_.time_error = accuracy_.error();
      next_.control = accuracy_.control();
    }
    if (tools_.errors) {
      const ScopedTimer timer(report_.errors.seconds);
      const auto phase = ScopedPhase::coarse("error bars");
      result.errors = tools_.errors->estimate(setup_, next_, *problem_, x_, report_.errors);
    }
    next_.factor = tools_.solver.record();
    next_.stiffness = problem_->stiffness();
    next_.quadrature = problem_->quadrature_levels();
    report_.refined_quadrature = static_cast<int>(
        std::count_if(next_.quadrature.begin(), next_.quadrature.end(), [](int level) { return level > 0; }));
    if (start) {
      *start = next_;
      start->step = before_.step;
      start->t = before_.t;
      start->stiffness = before_.stiffness;
      if (renumbering_.empty()) start->quadrature = before_.quadrature;  // else that of the new cells
      start->created_energy = before_.created_energy;
      start->stored_energy = before_.stored_energy;
      start->history.damp_next = before_.history.damp_next;
      if (!renumbering_.empty()) start->deviation.resize(0);  // of another mesh
    }
    end_pasts<Dim>(setup_, x_, before_.t, next_, renumbering_.empty() ? nullptr : start, report_);
    if (setup_.contact.enabled) tell_of_closed_faces();
    if (setup_.time.has_inertia()) next_.deviation = x_ - TimeIntegrator(setup_.time).predictor(next_.history);
    const VectorX increment = problem_->increment_of(x_);
    TimeIntegrator(setup_.time).push(std::move(x_), increment, next_.history);
    open_faces(setup_, next_.chords, next_.history.x[0], next_.mesh);
    next_.chords = lowered_chords<Dim>(setup_, next_.mesh, next_.chords, next_.history.x);
    after = std::move(next_);  // before_ may be the same, and is not needed any more
    clock_.tell(report_);
    report_.peak_rss_mb = peak_rss_mb();
    result.report = report_;
    result.renumbering = std::move(renumbering_);
    return result;
  }

  /// Ends a step that has failed.
  StepResult drop(const StepFailure& failure) {
    clock_.tell(report_);
    if (accuracy_.is_on()) {
      report_.rejected_steps = 1;
      report_.rejections = {accuracy_.rejection(failure)};
    }
    StepResult result{
        .ok = false, .reason = failure.reason, .report = report_, .forces = {}, .errors = {}, .renumbering = {}};
    result.cancelled = failure.kind == StepFailure::Kind::cancelled;
    return result;
  }

 private:
  /// The solution on the mesh before the step.
  struct Solution {
    State<Dim> state;
    VectorX x;
    std::unique_ptr<StepProblem<Dim>> problem;
    double excess;
  };

  std::optional<StepFailure> solve_first() {
    {
      const ScopedTimer timer(report_.seconds.linear_solve);
      tools_.solver.restore(before_.factor);
    }
    if (x_.size() > 0)
      settle_chords();
    else
      x_ = next_.history.x[0];
    first_summary_ = solve_with_fluids(expected_positions(setup_, next_, x_));
    must_settle_ = false;  // a cut would not help what remeshing does
    if (!first_summary_.converged()) {
      // Infeasible: det F > 0 where the barrier in curved cells cannot prove it.
      const bool is_stuck = first_summary_.termination == Termination::no_descent ||
                            first_summary_.termination == Termination::iterations ||
                            first_summary_.termination == Termination::infeasible;
      StepFailure failure = failed(first_summary_);
      if (is_stuck && setup_.remesh.enabled) failure.nearly_inverted = find_nearly_inverted(next_, x_);
      return failure;
    }
    if (has_closed_faces(next_.mesh))
      if (std::string reason = find_violation(setup_, next_, x_); !reason.empty())
        return StepFailure{.kind = StepFailure::Kind::unsolved, .reason = std::move(reason), .nearly_inverted = {}};
    if (!guard_.allows(*problem_, next_.history, x_)) return forbidden();
    if (auto failure = find_inaccuracy()) return failure;
    if (!setup_.remesh.enabled) return std::nullopt;
    {
      const ScopedTimer timer(report_.seconds.assembly);
      report_.energy = problem_->report(x_);
      report_.energy_before_remesh = report_.energy.total;
    }
    next_.stiffness = problem_->stiffness();
    next_.quadrature = problem_->quadrature_levels();
    first_.emplace(next_, x_, std::move(problem_), excess_);
    return std::nullopt;
  }

  /// Judges an adaptive step after its first solve.
  std::optional<StepFailure> find_inaccuracy() {
    if (!accuracy_.is_on()) return std::nullopt;
    const ScopedTimer timer(report_.seconds.assembly);
    const auto phase = ScopedPhase::coarse("error in time");
    return accuracy_.find_inaccuracy(*problem_, next_.history, x_, first_summary_.iterations > 0);
  }

  void go_back_to_first_solve() {
    next_ = first_->state;
    x_ = first_->x;
    report_.forget_operations();
    renumbering_ = {};
  }

  void make_problem() {
    const ScopedTimer timer(report_.seconds.assembly);
    const auto phase = ScopedPhase::coarse("problem");
    problem_ = std::make_unique<StepProblem<Dim>>(setup_, next_.mesh, next_.history, next_.t, tools_.cache, next_.stiffness,
                                                  next_.quadrature, next_.chords);
  }

  /// Solves from x, and again from there as long as fluids come or go.
  NewtonSummary solve_with_fluids(const VectorX& expected = {}) {
    NewtonSummary summary = solve_between_chords(expected);
    FluidFront<Dim> front(setup_, next_.t);
    while (!setup_.fluids.empty() && summary.converged()) {
      const Eigen::Index bodies = Dim * Eigen::Index{next_.mesh.num_nodes()};
      const VectorX force = -problem_->gradients(x_).contact.head(bodies) / problem_->scaling();
      if (!front.move(next_.mesh, x_.head(bodies), force)) break;
      next_.strata = {};  // which know tags
      next_.stiffness = problem_->stiffness();
      next_.quadrature = problem_->quadrature_levels();
      summary = solve_between_chords();
    }
    return summary;
  }

  /// Solves from x, and again from there as long as curves leave their chords too far: with more chords, and where there are
  /// no more, with a stiffer barrier, since gaps of a soft one are next to nothing where bodies are pressed hard. Where
  /// curves reach into what they touch all the same, this is no solution.
  NewtonSummary solve_between_chords(const VectorX& expected = {}) {
    constexpr int kMostSolves = 12;
    constexpr double kLessByStiffness = 0.75;  ///< of the excess, that a stiffer barrier has to leave at most
    const VectorX start = x_;
    make_problem();
    NewtonSummary summary = solve(expected);
    ChordDemand demand{{}, 0};
    double excess = std::numeric_limits<double>::infinity();
    for (int solves = 1; summary.converged(); ++solves) {
      demand = find_chord_demand(setup_, next_.mesh, next_.chords, x_);
      const bool has_more = demand.levels != next_.chords;
      if (demand.excess <= 1 || solves == kMostSolves || (has_more && !may_have(demand.levels, start)) ||
          (!has_more && (demand.excess > kLessByStiffness * excess || !may_stiffen())))
        break;  // Watch tells of what is left
      ChordLevels fewer = std::exchange(next_.chords, demand.levels);
      const BarrierStiffness softer = next_.stiffness;
      if (!has_more) stiffen();
      excess = has_more ? std::numeric_limits<double>::infinity() : demand.excess;
      VectorX solution = std::exchange(x_, start);  // where the next solve begins, if the way there is free
      auto problem_before = std::move(problem_);
      make_problem();
      NewtonSummary again = solve(solution);
      if (!again.converged() && again.termination != Termination::cancelled) {
        tools_.logger.info(fmt::format("step {}: keeping the chords of curved edges, the step with {} failed: {}",
                                       next_.step, has_more ? "more of them" : "a stiffer barrier", reason_of(again)));
        next_.chords = std::move(fewer);
        next_.stiffness = softer;
        x_ = std::move(solution);
        problem_ = std::move(problem_before);
        break;
      }
      summary = again;
      if (!has_more) tell_of_stiffness();
    }
    excess_ = demand.excess;
    if (summary.converged() && demand.excess > 1 && !are_curves_apart(setup_, next_.mesh, next_.chords, x_)) {
      summary.termination = Termination::infeasible;
      summary.message = fmt::format(
          "curved edges reach into what they touch, since they leave their shortest chords by {:.2g} times of what they "
          "may: a stiffer barrier, with wider gaps, or a finer mesh helps",
          demand.excess);
    }
    return summary;
  }

  static constexpr double kStiffer = 4, kMostStiffer = 4096;  ///< times a barrier stiffness, at once and in all
  bool may_stiffen() const {
    return !setup_.contact.adaptive_stiffness &&
           kStiffer * problem_->stiffness().value <= kMostStiffer * setup_.contact.barrier_stiffness;
  }
  void stiffen() {
    const double stiffness = kStiffer * problem_->stiffness().value;
    next_.stiffness = {.value = stiffness, .largest = stiffness};
  }
  void tell_of_stiffness() const {
    warn(
        fmt::format("the barrier is {:g} times as stiff now as at the start, so that gaps are wide enough for the chords of "
                    "curved edges; a larger /solver/contact/barrier_stiffness or a finer mesh does without",
                    next_.stiffness.value / setup_.contact.barrier_stiffness));
  }

  /// Whether surfaces with these levels of chords are apart at x, and at past positions.
  bool may_have(const ChordLevels& levels, const VectorX& x) const {
    const ContactSurface<Dim> contact =
        contact_surface(setup_, next_.mesh, levels, static_cast<int>(next_.history.x.size()));
    const auto is_free = [&](const VectorX& at) { return !has_intersection<Dim>(contact.surface, contact.positions(at)); };
    return is_free(x) && std::all_of(next_.history.x.begin(), next_.history.x.end(), is_free);
  }

  /// Why the solution on another mesh is no state to go on from; empty where it is one. Curves that leave their chords too
  /// far may do so if they did on the mesh before.
  std::string find_invalid() const {
    std::string violation = find_violation(setup_, next_, x_);
    if (!violation.empty() || excess_ <= std::max(1.0, first_ ? first_->excess : 1)) return violation;
    return "curved edges leave their chords too far";
  }

  /// Gives the curves of another mesh the chords that they ask for. Remeshing lets chords touch, not curves: where more
  /// chords would meet something, the solve begins where the step does, or is left with those that remeshing saw.
  void settle_chords() {
    const auto settled = [&](const ChordLevels& levels, std::span<const VectorX> positions) {
      return settled_chords<Dim>(setup_, next_.mesh, levels, positions);
    };
    const ChordLevels of_history = settled(next_.chords, next_.history.x), of_all = settled(of_history, {&x_, 1});
    if (of_all.empty()) return next_.chords.clear();
    if (may_have(of_all, x_)) {
      next_.chords = of_all;
    } else if (may_have(of_history, next_.history.x[0])) {
      next_.chords = of_history;
      x_ = next_.history.x[0];
    } else {
      next_.chords.clear();
    }
  }

  /// Warns where faces that are no contact begin to be pressed into each other.
  void tell_of_closed_faces() const {
    if (has_only_tied_faces(setup_, next_.mesh)) return;
    const auto depth_of = [&](const State<Dim>& state, const VectorX& x) {
      return find_overlap(setup_, state.mesh, contact_surface(setup_, state.mesh, state.chords),
                          body_boundary(state.mesh, x, state.chords))
          .depth;
    };
    const double depth = depth_of(next_, x_);
    if (depth == 0 || depth_of(before_, before_.history.x[0]) > 0) return;
    warn(fmt::format(
        "faces that coincide at rest begin to be pressed into each other, by {}: they pass through each other as "
        "if there were no contact, up to d-hat, until they have been apart by d-hat once; a gap between them at "
        "rest makes them contact",
        setup_.units.text(depth, "m", 3)));
  }

  /// From x, where what is lagged is lagged first.
  NewtonSummary solve(const VectorX& expected = {}) {
    NewtonSummary summary = problem_->solve(x_, VectorX(x_), expected, must_settle_);
    add_seconds(summary, report_.seconds);
    report_.newton_iterations += summary.iterations;
    report_.residual_worth = std::max(report_.residual_worth, summary.decrement / problem_->scaling());
    report_.indefinite += summary.indefinite;
    if (summary.converged() && !summary.message.empty())
      warn(summary.message);
    else if (summary.termination == Termination::round_off || summary.termination == Termination::saddle)
      tools_.logger.debug(fmt::format("step {}: {}", next_.step, to_string(summary.termination)));
    if (summary.iterations > kManyIterations)
      tools_.logger.info(fmt::format("step {}: {}", next_.step, problem_->describe_effort(summary)));
    if (summary.linear_residual > kPoorResidual)
      warn(fmt::format("linear solves by {} reached a relative residual of {:.1e} only: {}",
                       tools_.cache.system.solver().name(), summary.linear_residual,
                       tools_.cache.system.solver().capabilities().iterative
                           ? "a direct solver, or a `fallback`, may do better"
                           : "the system is nearly singular, and other solvers will hardly do better; what makes it so are "
                             "bodies that little holds, slivers, a nu near 0.5 or moduli far apart"));
    return summary;
  }

  /// Remeshes after the first solve, carries the history over and solves again.
  std::optional<StepFailure> remesh(Remeshing remeshing) {
    std::optional<MeshRenumbering> renumbering;
    if (remeshing == Remeshing::none)
      ++report_.reverted_remeshes;
    else
      renumbering = remesh_and_project(tools_, *first_->problem, first_->state, next_, x_, report_,
                                       remeshing == Remeshing::with_new_curves);
    if (remeshing != Remeshing::none && !setup_.shapes.empty()) take_shapes(renumbering);
    if (!renumbering) {
      problem_ = std::move(first_->problem);
      return std::nullopt;
    }
    renumbering_ = std::move(*renumbering);
    settle_chords();
    const NewtonSummary summary = solve_with_fluids();
    if (summary.termination == Termination::cancelled) return failed(summary);
    std::string reason = summary.converged() ? find_invalid() : reason_of(summary);
    if (reason.empty()) return std::nullopt;
    return StepFailure{.kind = StepFailure::Kind::remeshed_unsolved,
                       .reason = std::move(reason),
                       .nearly_inverted = {},
                       .has_new_curves = report_.curves.accepted > 0};
  }

  /// Puts surfaces onto their shapes around x, and adds to what became of ids. The energy of x jumps as material comes or
  /// goes.
  void take_shapes(std::optional<MeshRenumbering>& renumbering) {
    if (renumbering) settle_chords();
    const State<Dim> unchanged = next_;
    const VectorX solution = x_;
    std::optional<StepProblem<Dim>> problem;
    const auto make = [&] {
      problem.emplace(setup_, unchanged.mesh, unchanged.history, unchanged.t, tools_.cache, unchanged.stiffness,
                      unchanged.quadrature, unchanged.chords);
    };
    if (renumbering) make();
    StepReport effort;
    effort.energy = report_.energy;
    const auto again = shape_and_project(tools_, problem ? *problem : *first_->problem, unchanged, next_, x_, effort);
    if (again) {
      if (!problem) make();
      const double before = problem->report(solution).total;
      settle_chords();
      make_problem();
      effort.shape_energy = problem_->report(x_).total - before;
      renumbering = renumbering ? compose(*renumbering, *again) : *again;
    }
    report_.add_effort(effort);
  }

  /// Whether edges become curved where straight ones keep up what would buckle.
  bool may_curve_for_stability() const {
    return !setup_.time.has_inertia() && setup_.remesh.curve.for_stability && !setup_.remesh.sizing_field.enabled &&
           !(setup_.remesh.enabled && any_averages_volume(setup_.materials)) && !setup_.lump_mass && setup_.terms.empty() &&
           !setup_.follower.forces && setup_.newton.indefinite == IndefiniteHessian::project;
  }

  /// Curves edges and solves again as long as the solution is stable only because edges are straight. The last solve, if it
  /// was cancelled.
  std::optional<NewtonSummary> let_buckle() {
    constexpr int kMostRounds = 5;
    if (!may_curve_for_stability()) return std::nullopt;
    for (int round = 0; round < kMostRounds; ++round) {
      const std::vector<EdgeKey> edges = find_edges_that_lock(tools_, next_, x_);
      if (edges.empty()) return std::nullopt;
      next_.stiffness = problem_->stiffness();
      next_.quadrature = problem_->quadrature_levels();
      const State<Dim> unchanged = next_;
      const VectorX solution = x_;
      StepReport effort;
      effort.energy = problem_->report(x_);
      auto problem_before = std::move(problem_);
      auto renumbering =
          curve_and_project(tools_, *problem_before, std::span<const EdgeKey>(edges), unchanged, next_, x_, effort);
      std::string failure = "contact lets no edge become curved";
      if (renumbering) {
        settle_chords();
        const NewtonSummary summary = solve_with_fluids();
        if (summary.termination == Termination::cancelled) return summary;
        failure = summary.converged() ? find_invalid() : reason_of(summary);
      }
      if (!failure.empty()) {
        next_ = unchanged;
        x_ = solution;
        problem_ = std::move(problem_before);
        warn("linear elements keep up what would buckle with quadratic ones, and stay: " + failure);
        return std::nullopt;
      }
      renumbering_ = renumbering_.empty() ? std::move(*renumbering) : compose(renumbering_, *renumbering);
      report_.add_effort(effort);
    }
    return std::nullopt;
  }

  static StepFailure failed(const NewtonSummary& summary) {
    const bool is_cancelled = summary.termination == Termination::cancelled;
    return {.kind = is_cancelled ? StepFailure::Kind::cancelled : StepFailure::Kind::unsolved,
            .reason = reason_of(summary),
            .nearly_inverted = {}};
  }
  static StepFailure forbidden() {
    return {.kind = StepFailure::Kind::creates_energy, .reason = "it would create energy", .nearly_inverted = {}};
  }

  void warn(const std::string& what) const { tools_.logger.warning(fmt::format("step {}: {}", next_.step, what)); }

  const StepTools<Dim>& tools_;
  const StepSetup<Dim>& setup_;
  const State<Dim>& before_;
  State<Dim> next_;
  VectorX x_;  ///< the solution, on next_.mesh; before the first solve its start
  std::unique_ptr<StepProblem<Dim>> problem_;
  double excess_ = 0;  ///< of the curves of the last solution over what they may leave their chords by
  EnergyGuard<Dim> guard_;
  AccuracyGuard<Dim> accuracy_;
  bool must_settle_;  ///< rounds of lagging, or the step is cut
  MeshRenumbering renumbering_;
  StepReport report_;
  NewtonSummary first_summary_;
  std::optional<Solution> first_;  ///< while remeshing may still be taken back
  EffortClock clock_{tools_.solver};
};

/// Says that the step is taken by `next`. Straightening and cuts say so themselves: they tell more.
void tell(const Attempt& next, const StepFailure& failure, int step, const Logger& logger) {
  if (failure.kind == StepFailure::Kind::inaccurate) return;
  std::string what = "Newmark would create energy here, implicit Euler takes this step";
  if (failure.kind == StepFailure::Kind::remeshed_unsolved)
    what = (next.remeshing == Remeshing::none ? "keeping the mesh as it was" : "remeshed again without curving edges") +
           (", the remeshed step failed: " + failure.reason);
  else if (failure.kind != StepFailure::Kind::creates_energy)
    return;
  logger.warning(fmt::format("step {}: {}", step, what));
}

}  // namespace

template <int Dim>
StepResult take_step(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, State<Dim>* start,
                     Attempt attempt) {
  const TimeOptions& time = tools.setup.time;
  StepLadder ladder{.most_halvings = start || time.adaptive.enabled ? 0 : time.step_cuts};
  if (time.adaptive.enabled) ladder.least_part = time.adaptive.dt_min / time.dt;
  StartOfStep<Dim> from;
  std::optional<StepSolver<Dim>> solver;
  StepFailure failure;
  StepResult failed;  // of the last attempt, with the effort of all before it
  for (;;) {
    if (attempt.straightening != from.straightening) {
      add_dropped(from.effort, failed.report);
      from = straighten(tools, attempt.straightening, failure, before);
    }
    if (from.straightening != Straightening::none && !from.renumbering) {
      failure.kind = StepFailure::Kind::nothing_straightened;
    } else {
      const bool may_cut = attempt.halvings < ladder.most_halvings || ladder.least_part < 1;
      if (!solver) solver.emplace(tools, from.renumbering ? from.state : before, attempt, from.x, may_cut);
      auto now = solver->solve(attempt.remeshing);
      if (!now) break;
      failure = std::move(*now);
    }
    const std::optional<Attempt> next = ladder.next(attempt, failure);
    if (next) tell(*next, failure, before.step + 1, tools.logger);
    if (solver && failure.kind != StepFailure::Kind::remeshed_unsolved) {
      StepResult dropped = solver->drop(failure);
      add_dropped(std::move(failed.report), dropped.report);
      failed = std::move(dropped);
      solver.reset();
    }
    if (!next || next->halvings > attempt.halvings || next->trial.length < attempt.trial.length) {
      add_dropped(std::move(from.effort), failed.report);
      failed.report.forget_operations();
      if (!next) return failed;
      return next->halvings > attempt.halvings ? take_step_in_halves(tools, before, after, *next, std::move(failed))
                                               : take_shorter_step(tools, before, after, start, *next, std::move(failed));
    }
    attempt = *next;
  }
  StepResult result = solver->finish(after, start);
  result.report.add_effort(from.effort);
  add_dropped(std::move(failed.report), result.report);
  if (attempt.method == StepMethod::implicit_euler && attempt.halvings == 0) result.report.damped_steps = 1;
  if (auto& first = from.renumbering)
    result.renumbering = result.renumbering.empty() ? std::move(*first) : compose(*first, result.renumbering);
  return result;
}

#define ITR_INSTANTIATE(Dim) \
  template StepResult take_step<Dim>(const StepTools<Dim>&, const State<Dim>&, State<Dim>&, State<Dim>*, Attempt);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
