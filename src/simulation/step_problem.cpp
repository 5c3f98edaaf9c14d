// SPDX-License-Identifier: MIT
#include "simulation/step_problem.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/timer.hpp"
#include "diagnosis.hpp"
#include "energy/follower.hpp"
#include "flight_guard.hpp"
#include "held_turn.hpp"
#include "itr/core/error.hpp"
#include "itr/geometry/quadratic_validity.hpp"
#include "lagging_rounds.hpp"
#include "newton/corrected_system.hpp"
#include "newton/curvature.hpp"

namespace itr {

namespace {

constexpr std::size_t kLongestCycle = 16;       ///< rounds that are remembered
constexpr int kPressureRounds = 50;             ///< most, where pressure has no potential
constexpr double kLoadsWorthSaying = 1e-2;      ///< of what loads may be off: less is not said
constexpr double kFrictionWorthSaying = 1e-2;   ///< of friction's forces: less is not said
constexpr int kPatience = 30;                   ///< rounds without a smaller residual after which lagging will not converge
constexpr double kEnergyResolution = 1e-14;     ///< of moduli times volume
constexpr double kVolumeRatioTolerance = 1e-3;  ///< relative, of the bound that is reported

double& entry_of(EnergyReport& report, EnergyEntry entry) {
  const std::array<double*, kNumEnergyEntries> by_entry{&report.inertia,  &report.elastic, &report.body, &report.contact,
                                                        &report.friction, &report.damping, &report.host};
  return *by_entry[static_cast<std::size_t>(entry)];
}

}  // namespace

template <int Dim>
StepProblem<Dim>::StepProblem(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const Space& space, const History& history,
                              double t, ProblemCache<Dim>& cache, const BarrierStiffness& stiffness,
                              const QuadratureLevels& levels, const ChordLevels& chords)
    : setup_(setup),
      terms_(potential_terms(setup, history, t)),
      scope_(cache.scope_of(setup, mesh, space, chords)),
      cells_(scope_->cells),
      surface_(scope_->surface),
      workspace_(scope_->workspace),
      held_(held_dofs(setup, mesh, t, space)),
      dofs_(DofMap::from_held(held_.held)),
      potential_(terms_, cells_,
                 {.predictor = terms_.has_inertia ? TimeIntegrator(setup.time).predictor(history) : VectorX(),
                  .velocity_reference = TimeIntegrator(setup.time).velocity_reference(history)}),
      base_(history.x[0]),
      stiffness_(stiffness),
      cache_(cache) {
  if (terms_.has_inertia)
    potential_.inertia()->set_predicted_increment(TimeIntegrator(setup.time).predicted_increment(history));
  if (setup.follower.forces)
    terms_.follower = [this, &mesh, t](const VectorX& x) {
      return lag_follower(setup_.follower, mesh, x, t, terms_.scaling);
    };
  if (setup.contact.enabled) {
    if (!setup.contact.adaptive_stiffness) stiffness_.value = setup.contact.barrier_stiffness;
    potential_.add_contact(surface_.surface, stiffness_.value, surface_.map);
    if (setup.contact.adaptive_stiffness)
      adaptive_ = std::make_unique<AdaptiveStiffness<Dim>>(surface_.surface, setup.contact, average_mass(), terms_.scaling,
                                                           surface_.map.get());
  }
  potential_.elastic()->set_quadrature_levels(levels);
  if (!terms_.has_inertia && setup.newton.indefinite == IndefiniteHessian::project)
    if (auto loose = find_loose_parts<Dim>(cells_, base_, held_.held, setup.materials); !loose.empty())
      least_motion_ = std::make_shared<LeastMotion<Dim>>(cells_, std::move(loose), terms_.scaling);
  reset_system();
}

template <int Dim>
void StepProblem<Dim>::reset_system() {
  cache_.system.reset(dofs_, Dim, element_stencils(cells_));
  turn_ = ++cache_.served;
}

/// The cache's, for this problem: another one may have had it since.
template <int Dim>
SparseSystem& StepProblem<Dim>::system() {
  if (turn_ != cache_.served) reset_system();
  return cache_.system;
}

/// Sum of all entries of the mass matrix by its number of rows, obstacles' included; 1 where there is none [kg].
template <int Dim>
double StepProblem<Dim>::average_mass() const {
  const Eigen::Index rows = held_.target.size();
  return potential_.inertia() ? momentum(VectorX::Ones(rows)).sum() / static_cast<double>(rows) : 1;
}

/// Balances the barrier against the other terms at x, dissipation aside. At obstacles the reference implementation's
/// gradient is their prescribed displacement (docs/theory.md, "Barrier stiffness"): it is part of its schedule.
template <int Dim>
void StepProblem<Dim>::initialize_stiffness(const VectorX& x) {
  VectorX gradient = VectorX::Zero(x.size());
  EnergySum others;
  potential_.add_to(others, lagged_, [](const Traits& term) { return !term.is_between_bodies && !term.needs_velocities; });
  others.add_gradient(x, gradient, workspace_);
  const Eigen::Index bodies = x.size() - Dim * static_cast<Eigen::Index>(setup_.obstacles.rest.size());
  for (Eigen::Index o = 0; bodies + Dim * o < x.size(); ++o)
    gradient.template segment<Dim>(bodies + Dim * o) =
        -terms_.scaling * (held_.target.template segment<Dim>(bodies + Dim * o) - setup_.obstacles.rest[o]);
  adaptive_->initialize(surface_.positions(x), gradient, stiffness_, workspace_);
  potential_.contact()->set_stiffness(stiffness_.value);
}

/// x with held dofs at their targets, where the straight way there is free.
template <int Dim>
VectorX StepProblem<Dim>::start_of_solve(const VectorX& x) {
  const VectorX start = with_held_at_targets(x);
  const bool free = std::isfinite(potential_.elastic()->value(start, workspace_)) &&
                    (cells_.curved_elements.empty() || potential_.elastic()->max_step(x, start - x, workspace_) == 1) &&
                    potential_.contact_of_cells()->max_step(x, start - x, workspace_) == 1;
  return free ? start : x;
}

/// `summary` with the reason of a failure.
template <int Dim>
NewtonSummary StepProblem<Dim>::explained(NewtonSummary summary, const EnergySum& sum, const VectorX& x) {
  if (summary.converged()) return summary;
  const int num_obstacles = static_cast<int>(setup_.obstacles.rest.size());
  if (const std::string turn = describe_large_turn<Dim>(cells_, dofs_, base_, held_.target); !turn.empty())
    summary.message = turn + "; " + summary.message;
  summary.message += diagnosis<Dim>({cells_, potential_, surface_, num_obstacles, terms_.scaling, setup_.units}, summary,
                                    sum, x, workspace_);
  return summary;
}

template <int Dim>
std::string StepProblem<Dim>::describe_effort(const NewtonSummary& summary) {
  const int num_obstacles = static_cast<int>(setup_.obstacles.rest.size());
  return itr::describe_effort<Dim>({cells_, potential_, surface_, num_obstacles, terms_.scaling, setup_.units}, summary,
                                   rounds_, workspace_);
}

/// One solve with `lagged_`, which `ends_at(x)`, if given, ends at an iterate. Adaptive stiffness balances the terms before
/// held dofs move: so it is in the regression values of peers' scenes.
template <int Dim>
NewtonSummary StepProblem<Dim>::minimize_lagged(VectorX& x, VectorX way_to_start,
                                                const std::function<bool(const VectorX& x)>& ends_at) {
  const EnergySum sum = potential_.sum(lagged_);
  if (norm_weights_.size() == 0 && setup_.newton.norm != NewtonNorm::euclidean) norm_weights_ = unit_mass_diagonal(cells_);
  NewtonExtras extras{.norm_weights = {norm_weights_.data(), static_cast<std::size_t>(norm_weights_.size())},
                      .on_iteration = setup_.on_iteration,
                      .must_be_minimum = !terms_.has_inertia};
  if (way_to_start.size() > 0) {
    extras.gradient_of_way = VectorX::Zero(x.size());
    potential_.inertia()->add_mass_product(way_to_start, extras.gradient_of_way);
    extras.way_to_start = std::move(way_to_start);
  }
  if (!cells_.curved_elements.empty()) {
    potential_.elastic()->refine_quadrature(x);
    extras.after_step = [&](const VectorX& d) { return potential_.elastic()->refine_quadrature(base_ + d); };
  }
  if (!adaptive_) return minimize_from(x, sum, std::move(extras), ends_at);
  initialize_stiffness(x);
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

/// The solve of the first round. Bodies that only contact and friction hold begin a step without the contact that will hold
/// them, and slide off before the next round unless friction is lagged where contact forces are new: here it is lagged
/// again as often as those on a body double or halve on the way.
template <int Dim>
NewtonSummary StepProblem<Dim>::minimize_first(VectorX& x, VectorX way_to_start) {
  constexpr int kMostLags = 200;
  constexpr double kChange = 2;
  NewtonSummary all;
  const auto is_near = [](double a, double b) { return a <= kChange * b && b <= kChange * a; };
  for (int lags = least_motion_ && potential_.has_friction() ? kMostLags : 0;; --lags) {
    bool is_outdated = false;
    std::function<bool(const VectorX&)> ends_at;
    if (lags > 0)
      ends_at = [&, lagged = contact_forces_on_loose_parts(x)](const VectorX& iterate) {
        const std::vector<double> now = contact_forces_on_loose_parts(iterate);
        return is_outdated = !std::equal(now.begin(), now.end(), lagged.begin(), is_near);
      };
    NewtonSummary summary = minimize_lagged(x, std::exchange(way_to_start, {}), ends_at);
    summary.add_effort(all);
    all = std::move(summary);
    if (!is_outdated) return all;
    lagged_.friction = potential_.lag_friction(x, workspace_);
  }
}

/// Norms of the contact forces, scaled.
template <int Dim>
std::vector<double> StepProblem<Dim>::contact_forces_on_loose_parts(const VectorX& x) {
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
template <int Dim>
NewtonSummary StepProblem<Dim>::minimize_from(VectorX& x, const EnergySum& sum, NewtonExtras extras,
                                              const std::function<bool(const VectorX& x)>& ends_at) {
  VectorX d = increment_of(x);
  const VectorX target = held_.target - base_;
  EnergySum all = sum;
  if (least_motion_) {
    all.add(least_motion_);
    follow_least_motion(sum, d);
    extras.after_step = [&, before = extras.after_step](const VectorX& iterate) {
      const bool changed = before && before(iterate);
      follow_least_motion(sum, iterate);
      return changed;
    };
  }
  enum class EndedBy { solver, flight, caller } ended_by = EndedBy::solver;
  std::optional<FlightGuard<Dim>> guard;
  if (!terms_.has_inertia && !setup_.time.allow_jumps)
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
  CorrectedSystem corrected(system(), [&](ConstVectorView iterate, const DofMap& dofs) {
    return least_motion_->rigid_motions(base_ + iterate, dofs);
  });
  NewtonSystem& in_use = is_corrected ? static_cast<NewtonSystem&>(corrected) : system();
  NewtonSummary summary =
      minimize(EnergyOfIncrement(all, base_), d, dofs_, target, in_use, setup_.newton, workspace_, extras);
  x = base_ + d;
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (dofs_.unknown[i] == kNone && d[i] == target[i]) x[i] = held_.target[i];
  if (summary.blocked_from.size() > 0) summary.blocked_from += base_;
  solution_ = {x, std::move(d)};
  if (ended_by == EndedBy::caller) return summary;
  if (ended_by == EndedBy::flight) {
    summary.termination = Termination::no_descent;
    const std::string turn = describe_large_turn<Dim>(cells_, dofs_, base_, held_.target);
    summary.message = turn.empty() ? guard->describe(setup_.units) : turn;
    return summary;
  }
  return explained(std::move(summary), sum, x);
}

template <int Dim>
void StepProblem<Dim>::follow_least_motion(const EnergySum& sum, const VectorX& d) {
  VectorX gradient = VectorX::Zero(d.size()), sizes = gradient;
  EnergyOfIncrement(sum, base_).add_gradient_and_sizes(d, gradient, sizes, workspace_);
  least_motion_->follow(gradient, sizes, dofs_);
}

/// x minus the positions at the start of the step; of the last solution without the round-off of x.
template <int Dim>
VectorX StepProblem<Dim>::increment_of(const VectorX& x) const {
  return solution_.x.size() == x.size() && solution_.x == x ? solution_.increment : VectorX(x - base_);
}

/// How often the step may be solved, each time with what is lagged at the solution before.
template <int Dim>
int StepProblem<Dim>::most_rounds() const {
  int rounds = 1;
  if (potential_.has_friction())
    rounds = setup_.contact.friction_iterations < 0 ? std::numeric_limits<int>::max() : setup_.contact.friction_iterations;
  if (!lagged_.damping.empty() || !lagged_.contact_damping.empty())
    for (const DampingOptions& options : setup_.damping) rounds = std::max(rounds, options.lagging_rounds);
  if (has_lagged_loads()) rounds = std::max(rounds, kPressureRounds);
  return rounds;
}

/// Loads that depend on the positions and have no potential.
template <int Dim>
bool StepProblem<Dim>::has_lagged_loads() const {
  return lagged_.follower || (lagged_.pressure && lagged_.pressure->is_lagged(dofs_));
}

/// By which share of themselves, of the larger, terms of which `is_asked(traits)` holds change from `lagged_` to `now`, in
/// their forces on unknowns at x.
template <int Dim>
template <typename F>
double StepProblem<Dim>::change_of(const VectorX& x, const Lagged& now, const F& is_asked) {
  const auto gradient_of = [&](const Lagged& lagged) {
    EnergySum sum;
    potential_.add_to(sum, lagged, is_asked);
    VectorX gradient = VectorX::Zero(x.size());
    sum.add_gradient(x, gradient, workspace_);
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] == kNone) gradient[i] = 0;
    return gradient;
  };
  const VectorX after = gradient_of(now), before = gradient_of(lagged_);
  const double size = std::max(after.norm(), before.norm()), change = (after - before).norm();
  if (!std::isfinite(change)) return std::numeric_limits<double>::infinity();
  return size > 0 ? change / size : 0;
}

/// Warns or fails where rounds of lagging ended unsettled after `rounds`. `now`: lagged at x, or nothing.
template <int Dim>
void StepProblem<Dim>::judge_lagging(const VectorX& x, std::optional<Lagged> now, const char* how, int rounds,
                                     NewtonSummary& summary) {
  if (!now) now = potential_.lag(x, workspace_);
  if (has_lagged_loads()) {
    const double off = change_of(x, *now, [](const Traits& term) { return term.has_no_potential; });
    if (off > setup_.lagged_load_tolerance) {
      summary.termination = Termination::lagging;
      summary.message = fmt::format(
          "pressure or follower forces are {:.2g} of themselves off those of the positions reached, {} after {} solves; "
          "expected "
          "at most {:g} (/solver/advanced/lagged_load_tolerance): a smaller time step, or a stiffness with the forces, may "
          "settle "
          "them",
          off, how, rounds, setup_.lagged_load_tolerance);
      return;
    }
    if (off > kLoadsWorthSaying * setup_.lagged_load_tolerance)
      summary.message = fmt::format(
          "pressure or follower forces are {:.2g} of themselves off those of the positions reached, {} after {} solves", off,
          how, rounds);
  }
  if (!lagged_.friction || !now->friction) return;
  const double off = change_of(x, *now, [](const Traits& term) { return term.kind == TermKind::friction; });
  if (off > kFrictionWorthSaying)
    summary.message += fmt::format(
        "{}friction is {:.2g} of itself off that of the contact forces reached, {} after {} solves "
        "(/solver/contact/friction_iterations)",
        summary.message.empty() ? "" : "; ", off, how, rounds);
}

/// x with held dofs at their targets.
template <int Dim>
VectorX StepProblem<Dim>::with_held_at_targets(VectorX x) const {
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (dofs_.unknown[i] == kNone) x[i] = held_.target[i];
  return x;
}

/// Whether a solve from x had better begin at `start`: the way there is free, and the energy lower than where only what is
/// held moves.
template <int Dim>
bool StepProblem<Dim>::is_better_start(const VectorX& start, const VectorX& x) {
  const EnergySum sum = potential_.sum(lagged_);
  return sum.max_step(x, start - x, workspace_) == 1 &&
         sum.value(start, workspace_) < sum.value(with_held_at_targets(x), workspace_);
}

template <int Dim>
NewtonSummary StepProblem<Dim>::solve(VectorX& x, const VectorX& lagged_x, const VectorX& expected) {
  double lagging_seconds = 0;
  VectorX way_to_start;
  {
    const ScopedTimer timer(lagging_seconds);
    const VectorX start = with_held_at_targets(expected.size() > 0 ? expected : x);
    if (potential_.contact()) potential_.contact()->foresee(surface_.positions(x), surface_.motion(start - x), workspace_);
    const bool is_first_step = std::isinf(stiffness_.largest);
    if (adaptive_ && !is_first_step) initialize_stiffness(x);  // what the friction of the first round is lagged with
    lagged_ = potential_.lag(lagged_x, workspace_);
    // PolyFEM begins where the step does: so it is in the regression values of peers' scenes.
    const bool may_move = !adaptive_ && setup_.newton.indefinite == IndefiniteHessian::project;
    if (expected.size() > 0 && may_move && is_better_start(start, x)) {
      if (terms_.has_inertia) way_to_start = start - x;
      x = start;
    }
  }
  NewtonSummary summary = minimize_first(x, std::move(way_to_start));
  rounds_ = 1;
  summary.assembly_seconds += lagging_seconds;
  const int rounds = most_rounds();
  const double tolerance = setup_.contact.friction_tolerance * setup_.time.dt;
  std::vector<VectorX> previous = {lagged_x};  // newest last
  VectorX best = x;
  Lagged best_lagged = lagged_;
  BarrierStiffness best_stiffness = stiffness_;
  double least = std::numeric_limits<double>::infinity();
  int best_round = 0, round = 1;
  RoundsEnd end = rounds > 1 ? RoundsEnd::most : RoundsEnd::asked;
  std::optional<Lagged> now;  // what is lagged at x, where the last round made it
  for (; summary.converged() && round < rounds; ++round) {
    Lagged next_lagged;
    VectorX gradient = VectorX::Zero(x.size());
    {
      const ScopedTimer timer(summary.assembly_seconds);
      next_lagged = potential_.lag(x, workspace_);
      EnergyOfIncrement(potential_.sum(next_lagged), base_).add_gradient(increment_of(x), gradient, workspace_);
    }
    double norm = 0;
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (dofs_.unknown[i] != kNone) norm += gradient[i] * gradient[i];
    norm = std::sqrt(norm);
    if (potential_.has_friction() && norm <= tolerance) {
      end = RoundsEnd::asked;
      break;
    }
    if (norm < least) {
      least = norm;
      best = x;
      best_lagged = lagged_;
      best_stiffness = stiffness_;
      best_round = round;
    } else if (round - best_round >= kPatience) {
      x = best;
      lagged_ = best_lagged;
      if (adaptive_) {
        stiffness_ = best_stiffness;
        potential_.contact()->set_stiffness(stiffness_.value);
      }
      end = RoundsEnd::stalled;
      break;
    }
    if (const auto recurred = has_recurred(x, previous, setup_.newton.step_tolerance, scope_->diagonal)) {
      end = *recurred;
      now = std::move(next_lagged);
      break;
    }
    if (previous.size() == kLongestCycle) previous.erase(previous.begin());
    previous.push_back(x);
    lagged_ = std::move(next_lagged);
    NewtonSummary next = minimize_lagged(x);
    ++rounds_;
    const bool is_fixed_point = next.converged() && next.iterations == 0;
    next.add_effort(summary);
    summary = next;
    if (is_fixed_point) {
      end = RoundsEnd::settled;
      break;
    }
  }
  const bool is_open = end == RoundsEnd::most || end == RoundsEnd::cycle || end == RoundsEnd::stalled;
  if (summary.converged() && is_open) judge_lagging(x, std::move(now), to_string(end), round, summary);
  return summary;
}

template <int Dim>
VectorX StepProblem<Dim>::find_instability(const VectorX& x) {
  lagged_ = potential_.lag(x, workspace_);
  EnergySum sum = potential_.sum(lagged_);
  if (least_motion_) sum.add(least_motion_);
  PrescribedMotion none;
  const auto assemble = [&](PsdProjection psd) { system().assemble(sum, x, psd, dofs_, none, workspace_); };
  const int unknowns = dofs_.num_unknowns;
  VectorX by_unknown;
  double curvature = 0;
  if (unknowns == 0) return {};
  if (system().sees_all_directions()) {
    assemble(PsdProjection::none);
    const bool is_indefinite = system().factorize(0).definiteness == linear::Definiteness::indefinite;
    if (is_indefinite) curvature = find_negative_curvature(system(), unknowns, by_unknown);
  } else {
    curvature = find_negative_curvature_by_products(system(), assemble, unknowns, by_unknown).value_or(0);
  }
  if (!(curvature < 0)) return {};
  VectorX direction = VectorX::Zero(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (dofs_.unknown[i] != kNone) direction[i] = by_unknown[dofs_.unknown[i]];
  return direction;
}

template <int Dim>
EnergyReport StepProblem<Dim>::report(const VectorX& x) {
  EnergyReport report;
  Lagged shown = lagged_;
  shown.friction = potential_.lag_friction(x, workspace_);
  potential_.for_each(shown, [&](TermKind kind, const auto& term) {
    entry_of(report, traits<Dim>(kind).energy) += term->value(x, workspace_) / terms_.scaling;
  });
  for (std::size_t i = 0; i < kNumEnergyEntries; ++i) report.total += entry_of(report, static_cast<EnergyEntry>(i));
  return report;
}

template <int Dim>
NodalForces StepProblem<Dim>::forces(const VectorX& x) {
  const Eigen::Index bodies = x.size() - Dim * static_cast<Eigen::Index>(setup_.obstacles.rest.size());
  const VectorX increment = increment_of(x);
  NodalForces forces;
  const FieldOptions& asked = setup_.fields;
  const bool all = !asked.curves.empty();
  const auto get = [&](const EnergySum& sum, VectorX& of_bodies, VectorX* of_obstacles) {
    VectorX gradient = VectorX::Zero(x.size());
    EnergyOfIncrement(sum, base_).add_gradient(increment, gradient, workspace_);
    of_bodies = -gradient.head(bodies) / terms_.scaling;
    if (of_obstacles) *of_obstacles = -gradient.tail(x.size() - bodies) / terms_.scaling;
  };
  const auto add = [&](ForceEntry entry, EnergySum& sum) {
    potential_.add_to(sum, lagged_, [&](const Traits& term) { return term.force == entry; });
  };
  EnergySum contact, friction, applied;
  add(ForceEntry::contact, contact);
  add(ForceEntry::friction, friction);
  if (asked.contact_forces || all) get(contact, forces.contact, &forces.obstacle_contact);
  if (asked.friction_forces || all) get(friction, forces.friction, &forces.obstacle_friction);
  if (asked.applied_forces || all) {
    const Loads<Dim> tractions{{}, terms_.loads.tractions, {}};
    applied.add(std::make_shared<LoadEnergy<Dim>>(cells_, setup_.materials, tractions, terms_.scaling));
    add(ForceEntry::applied, applied);
    get(applied, forces.applied, nullptr);
    EnergySum body;
    body.add(std::make_shared<LoadEnergy<Dim>>(cells_, setup_.materials, Loads<Dim>{terms_.loads.acceleration, {}, {}},
                                               terms_.scaling));
    get(body, forces.body, nullptr);
  }
  if (!asked.reaction_forces && !all) return forces;
  get(potential_.sum(lagged_), forces.residual, nullptr);
  forces.reaction = VectorX::Zero(bodies);
  for (Eigen::Index i = 0; i < bodies; ++i)
    if (dofs_.unknown[i] == kNone) forces.reaction[i] = -std::exchange(forces.residual[i], 0.0);
  return forces;
}

template <int Dim>
NodalForces StepProblem<Dim>::forces_at_start(const VectorX& x) {
  Lagged at_x = potential_.lag(x, workspace_);
  lagged_ = {};
  lagged_.pressure = std::move(at_x.pressure);
  lagged_.follower = std::move(at_x.follower);
  NodalForces result = forces(x);
  result.reaction.setZero();
  result.residual.setZero();
  return result;
}

template <int Dim>
VectorX StepProblem<Dim>::total_force(const VectorX& x, const VectorX& v) {
  potential_.set_velocity_reference(x - v / terms_.velocity_rate);
  if (adaptive_) initialize_stiffness(x);
  lagged_ = potential_.lag(x, workspace_);
  EnergySum sum;
  potential_.add_to(sum, lagged_, [](const Traits& term) { return term.kind != TermKind::inertia; });
  VectorX gradient = VectorX::Zero(x.size());
  sum.add_gradient(x, gradient, workspace_);
  return -gradient / terms_.scaling;
}

template <int Dim>
double StepProblem<Dim>::created_energy(const History& history, const VectorX& x) {
  const VectorX &x0 = history.x[0], &v0 = history.v[0];
  const bool trapezoidal = TimeIntegrator(setup_.time).is_trapezoidal(history);
  double rise = 0;
  VectorX gradient = VectorX::Zero(x.size());  // twice the mean over the step
  EnergySum stored;
  potential_.add_to(stored, lagged_, [](const Traits& term) { return term.is_stored; });
  for (const auto& term : stored.terms()) {
    rise += term->value(x, workspace_) - term->value(x0, workspace_);
    term->add_gradient(x, gradient, workspace_);
    term->add_gradient(trapezoidal ? x0 : x, gradient, workspace_);
  }
  const double created = (rise - 0.5 * gradient.dot(x - x0)) / terms_.scaling;
  if (trapezoidal) return created;
  const VectorX change = TimeIntegrator(setup_.time).velocity(x, history) - v0;
  return created - 0.5 * change.dot(momentum(change));
}

template <int Dim>
VectorX StepProblem<Dim>::momentum(const VectorX& v) const {
  VectorX result = VectorX::Zero(v.size());
  if (potential_.inertia()) potential_.inertia()->add_mass_product(v, result);
  return result;
}

template <int Dim>
double StepProblem<Dim>::mechanical_energy(const VectorX& x, const VectorX& v) {
  double energy = 0;
  potential_.for_each(lagged_, [&](TermKind kind, const auto& term) {
    if (traits<Dim>(kind).is_stored && kind != TermKind::host) energy += term->value(x, workspace_) / terms_.scaling;
  });
  return energy + 0.5 * v.dot(momentum(v));
}

/// Densities are differences of terms as large as the moduli.
template <int Dim>
double StepProblem<Dim>::energy_resolution() const {
  double stiffness = 0;
  for_each_cell(cells_, [&](int body, double volume) { stiffness += volume * setup_.materials.at(body).youngs_modulus; });
  return kEnergyResolution * stiffness;
}

template <int Dim>
double StepProblem<Dim>::min_distance(const VectorX& x) {
  return potential_.contact() ? potential_.contact()->min_distance(surface_.positions(x), workspace_)
                              : std::numeric_limits<double>::infinity();
}

template <int Dim>
double min_volume_ratio(const CellSet<Dim>& cells, ConstVectorView x) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& element : cells.elements) least = std::min(least, deformation_gradient<Dim>(element, x).determinant());
  for (const auto& element : cells.curved_elements)
    least = std::min(least, min_jacobian_bound<Dim>(at_all_nodes<Dim>(element, x), kVolumeRatioTolerance) *
                                element.inverse_edges.determinant());
  return least;
}

#define ITR_INSTANTIATE(Dim)       \
  template class StepProblem<Dim>; \
  template double min_volume_ratio<Dim>(const CellSet<Dim>&, ConstVectorView);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
