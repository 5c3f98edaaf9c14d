// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string>
#include <utility>

#include "simulation/step.hpp"

namespace itr {

namespace {

/// The step from `state` on as two of half its length.
template <int Dim>
StepSetup<Dim> halved(const StepSetup<Dim>& setup, const State<Dim>& state) {
  StepSetup<Dim> half = setup;
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
StepResult take_step_in_parts(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, bool damped) {
  const StepSetup<Dim>& setup = tools.setup;
  StepResult whole = take_step(tools, before, after, damped);
  if (whole.ok || whole.cancelled || setup.time.step_cuts == 0) return whole;
  const StepSetup<Dim> half = halved(setup, before);
  const StepTools<Dim> tools_of_half{half, tools.initial_edges, tools.cache, tools.solver, tools.logger};
  tools.logger.warning("the step to t = " + setup.units.text(whole.report.t, "s", 6) + " failed (" + whole.reason +
                       "), cutting it into two of " + setup.units.text(half.time.dt, "s", 6));
  State<Dim> part = before;
  part.step = 0;
  if (setup.time.integrator == Integrator::bdf) part.history.x.resize(1), part.history.v.resize(1);
  StepReport effort = whole.report;
  NodalForces forces;
  MeshRenumbering renumbering;
  int parts = 0;
  for (int i = 0; i < 2; ++i) {
    StepResult result = take_step_in_parts(tools_of_half, part, part, true);
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
  whole.report.step = part.step = before.step + 1;
  whole.report.t = part.t = setup.time.time_after(part.step);
  after = std::move(part);
  return whole;
}

template StepResult take_step_in_parts<2>(const StepTools<2>&, const State<2>&, State<2>&, bool);
template StepResult take_step_in_parts<3>(const StepTools<3>&, const State<3>&, State<3>&, bool);

}  // namespace itr
