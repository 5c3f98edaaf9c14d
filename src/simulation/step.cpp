// SPDX-License-Identifier: MIT
// One time step: solve -> remesh -> project the history -> solve again (paper Algorithm 1).
#include "itr/simulation/step.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include "itr/core/check.hpp"
#include "itr/core/timer.hpp"
#include "itr/simulation/energy_guard.hpp"
#include "itr/simulation/invariants.hpp"
#include "itr/simulation/remesh_step.hpp"

namespace itr {

double peak_rss_mb() {
  // What getrusage knows has the memory of the program that started this one in it.
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::strtod(line.c_str() + 6, nullptr) / 1024;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

namespace {

double processor_seconds_now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

constexpr double kPoorResidual = 1e-6;  ///< of a linear solve, relative: a hundred times what Newton asks for

void add_solves(const linear::SolveCounts& from, const linear::SolveCounts& to, StepReport& report) {
  report.linear_solves += to.solves - from.solves;
  report.factorizations += to.factorizations - from.factorizations;
  report.reused_factors += to.reused - from.reused;
  report.linear_iterations += to.iterations - from.iterations;
}

void add_seconds(const NewtonSummary& summary, StepSeconds& seconds) {
  seconds.assembly += summary.assembly_seconds;
  seconds.linear_solve += summary.linear_seconds;
  seconds.line_search += summary.line_search_seconds;
  seconds.ccd += summary.ccd_seconds;
}

std::string reason_of(const NewtonSummary& summary) {
  return std::string(to_string(summary.termination)) + ": " + summary.message;
}

/// That of the present positions and of those that the history holds.
template <int Dim>
std::string find_violation(const Setup<Dim>& setup, const State<Dim>& state, const VectorX& x) {
  std::string violation = find_violation(setup, state.mesh, x);
  for (const VectorX& past : state.history.x)
    if (violation.empty()) violation = find_violation(setup, state.mesh, past);
  return violation;
}

/// take_step by the integrator of the setup or, `damped`, by implicit Euler. Where EnergyGuard forbids the step it is not
/// ok, and `creates_energy`.
template <int Dim>
StepResult attempt_step(const Setup<Dim>& setup, double shortest_edge, SparseSystem& system, linear::ReusingSolver& solver,
                        const Logger& logger, bool damped, bool& creates_energy, State<Dim>& state,
                        State<Dim>* start_of_step) {
  StepResult result;
  StepReport& report = result.report;
  const double start = seconds_now(), processor_start = processor_seconds_now();
  const auto stop_clocks = [&] {
    report.seconds.total = seconds_now() - start;
    report.processor_seconds = processor_seconds_now() - processor_start;
  };
  EnergyGuard<Dim> guard(setup, state);
  State<Dim> next = state;
  next.step = state.step + 1;
  next.history.damp_next = damped;
  next.t = setup.time.time_after(next.step);
  const double t = next.t;
  report.step = next.step;
  report.t = next.t;
  {
    const ScopedTimer timer(report.seconds.linear_solve);
    solver.restore(state.factor);
  }
  const linear::SolveCounts solves_before = solver.counts();
  const auto fail = [&](std::string reason) {
    result.renumbering = {};
    add_solves(solves_before, solver.counts(), report);
    result.ok = false;
    result.reason = std::move(reason);
    stop_clocks();
    return result;
  };
  const auto forbid = [&] {
    creates_energy = true;
    return fail("it would create energy");
  };

  VectorX x = next.history.x[0];
  const auto make_problem = [&] {
    const ScopedTimer timer(report.seconds.assembly);
    return std::make_unique<StepProblem<Dim>>(setup, next.mesh, next.history, t, system, next.stiffness);
  };
  auto problem = make_problem();
  const auto solve = [&](const VectorX& lagged) {
    NewtonSummary summary = problem->solve(x, lagged);
    add_seconds(summary, report.seconds);
    report.newton_iterations += summary.iterations;
    report.indefinite += summary.indefinite;
    if (summary.converged() && !summary.message.empty())
      logger.warning(fmt::format("step {}: {}", next.step, summary.message));
    if (summary.linear_residual > kPoorResidual)
      logger.warning(
          fmt::format("step {}: linear solves by {} reached a relative residual of {:.1e} only; another solver, or a "
                      "`fallback`, may do better",
                      next.step, system.solver().name(), summary.linear_residual));
    return summary;
  };
  NewtonSummary summary = solve(state.history.x[0]);
  result.cancelled = summary.termination == Termination::cancelled;
  if (!summary.converged()) return fail(reason_of(summary));
  if (!guard.allows(*problem, next.history, x)) return forbid();
  {
    const ScopedTimer timer(report.seconds.assembly);
    report.energy_before_remesh = problem->report(x).total;
  }

  if (setup.remesh.enabled) {
    next.stiffness = problem->stiffness();
    const State<Dim> unchanged = next;
    const VectorX solution = x;
    if (auto renumbering =
            remesh_and_project(setup, shortest_edge, *problem, t, unchanged, next, x, report, system.solver(), logger)) {
      result.renumbering = std::move(*renumbering);
      auto problem_before = std::move(problem);
      problem = make_problem();
      summary = solve(VectorX(x));
      result.cancelled = summary.termination == Termination::cancelled;
      if (result.cancelled) return fail(reason_of(summary));
      const std::string failure = summary.converged() ? find_violation(setup, next, x) : reason_of(summary);
      if (!failure.empty()) {
        logger.warning(fmt::format("step {}: keeping the mesh as it was, the remeshed step failed: {}", next.step, failure));
        next = unchanged;
        x = solution;
        problem = std::move(problem_before);
        report.forget_operations();
        result.renumbering = {};
      }
    }
  }

  if (setup.newton.is_cancelled()) {
    result.cancelled = true;
    summary.termination = Termination::cancelled;
    return fail(reason_of(summary));
  }
  if (setup.remesh.enabled && !guard.allows(*problem, next.history, x)) return forbid();  // as it ends
  next.created_energy = guard.created_energy();
  ITR_AUDIT(find_violation(setup, next, x).empty(), find_violation(setup, next, x));
  {
    const ScopedTimer timer(report.seconds.assembly);
    report.energy = problem->report(x);
    report.vertices = next.mesh.num_vertices();
    report.elements = next.mesh.num_cells();
    report.unknowns = problem->dofs().num_unknowns;
    report.min_distance = problem->min_distance(x);
    report.min_volume_ratio = min_volume_ratio(problem->cells(), x);
    if (setup.fields.any_forces()) result.forces = problem->forces(x);
  }
  add_solves(solves_before, solver.counts(), report);
  next.factor = solver.record();
  next.stiffness = problem->stiffness();
  if (start_of_step) {
    *start_of_step = next;
    start_of_step->step = state.step;
    start_of_step->t = state.t;
    start_of_step->stiffness = state.stiffness;
    start_of_step->created_energy = state.created_energy;
    start_of_step->history.damp_next = state.history.damp_next;
  }
  TimeIntegrator(setup.time).push(std::move(x), next.history);
  state = std::move(next);
  report.peak_rss_mb = peak_rss_mb();
  stop_clocks();
  return result;
}

}  // namespace

template <int Dim>
StepResult take_step(const Setup<Dim>& setup, double shortest_edge, SparseSystem& system, linear::ReusingSolver& solver,
                     const Logger& logger, State<Dim>& state, bool damped, State<Dim>* start) {
  bool creates_energy = false;
  StepResult result = attempt_step(setup, shortest_edge, system, solver, logger, damped, creates_energy, state, start);
  if (!creates_energy) return result;
  logger.warning(
      fmt::format("step {}: Newmark would create energy here, implicit Euler takes this step", result.report.step));
  StepReport effort = result.report;
  effort.forget_operations();
  result = attempt_step(setup, shortest_edge, system, solver, logger, true, creates_energy, state, start);
  result.report.add_effort(effort);
  result.report.damped_steps = 1;
  return result;
}

namespace {

/// The step from `state` on as two of half its length.
template <int Dim>
Setup<Dim> halved(const Setup<Dim>& setup, const State<Dim>& state) {
  Setup<Dim> half = setup;
  half.time.t0 = state.t;
  half.time.first_step = 0;
  half.time.dt = setup.time.dt / 2;
  half.time.steps = 2;
  --half.time.step_cuts;
  if (half.time.integrator == Integrator::bdf) half.time.integrator = Integrator::implicit_euler;
  if (half.newton.norm == NewtonNorm::euclidean && !half.time.is_static) {  // tolerances go with the step
    half.newton.step_tolerance /= 2;
    half.newton.gradient_tolerance /= 2;
    half.newton.first_gradient_tolerance /= 2;
  }
  return half;
}

}  // namespace

template <int Dim>
StepResult take_step_in_parts(const Setup<Dim>& setup, double shortest_edge, SparseSystem& system,
                              linear::ReusingSolver& solver, const Logger& logger, State<Dim>& state, bool damped) {
  StepResult whole = take_step(setup, shortest_edge, system, solver, logger, state, damped);
  if (whole.ok || whole.cancelled || setup.time.step_cuts == 0) return whole;
  const Setup<Dim> half = halved(setup, state);
  logger.warning("the step to t = " + std::to_string(whole.report.t) + " s failed (" + whole.reason +
                 "), cutting it into two of " + std::to_string(half.time.dt) + " s");
  State<Dim> part = state;
  part.step = 0;
  if (setup.time.integrator == Integrator::bdf) part.history.x.resize(1), part.history.v.resize(1);
  StepReport effort = whole.report;
  NodalForces forces;
  MeshRenumbering renumbering;
  int parts = 0;
  for (int i = 0; i < 2; ++i) {
    StepResult result = take_step_in_parts(half, shortest_edge, system, solver, logger, part, true);
    parts += std::max(1, result.report.cut_steps);
    result.report.add_effort(effort);
    if (!result.ok) return result;
    effort = result.report;
    forces = std::move(result.forces);
    if (!result.renumbering.empty())
      renumbering = renumbering.empty() ? std::move(result.renumbering) : compose(renumbering, result.renumbering);
  }
  whole = {.reason = {}, .report = effort, .forces = std::move(forces), .renumbering = std::move(renumbering)};
  whole.report.cut_steps = parts;
  whole.report.step = part.step = state.step + 1;
  whole.report.t = part.t = setup.time.time_after(part.step);
  state = std::move(part);
  return whole;
}

#define ITR_INSTANTIATE(Dim)                                                                                          \
  template StepResult take_step<Dim>(const Setup<Dim>&, double, SparseSystem&, linear::ReusingSolver&, const Logger&, \
                                     State<Dim>&, bool, State<Dim>*);                                                 \
  template StepResult take_step_in_parts<Dim>(const Setup<Dim>&, double, SparseSystem&, linear::ReusingSolver&,       \
                                              const Logger&, State<Dim>&, bool);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
