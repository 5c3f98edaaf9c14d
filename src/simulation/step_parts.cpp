// SPDX-License-Identifier: MIT
#include <Eigen/SparseCore>
#include <algorithm>
#include <utility>
#include <vector>

#include "fem/locator.hpp"
#include "simulation/step.hpp"
#include "time/integrator.hpp"

namespace itr {

namespace {

/// Newton's tolerances go with the length of the step where they are Euclidean.
template <int Dim>
void scale_tolerances(StepSetup<Dim>& setup, double factor) {
  if (setup.newton.norm != NewtonNorm::euclidean || setup.time.is_static) return;
  setup.newton.step_tolerance *= factor;
  setup.newton.gradient_tolerance *= factor;
  setup.newton.first_gradient_tolerance *= factor;
}

/// The step from `state` on as two of half its length.
template <int Dim>
StepSetup<Dim> halved(const StepSetup<Dim>& setup, const State<Dim>& state) {
  StepSetup<Dim> half = setup;
  half.time.t0 = state.t;
  half.time.first_step = 0;
  half.time.dt = setup.time.dt / 2;
  half.time.steps = 2;
  if (half.time.integrator == Integrator::bdf) half.time.integrator = Integrator::implicit_euler;
  scale_tolerances(half, 0.5);
  return half;
}

/// Weights of the nodes of one mesh, as columns, at the nodes of another.
template <int Dim>
Eigen::SparseMatrix<double> weights_between(const State<Dim>& of, const State<Dim>& now) {
  const Locator<Dim> locator(now.mesh);
  std::vector<Eigen::Triplet<double>> entries;
  for (int node = 0; node < of.mesh.num_nodes(); ++node) {
    for_each_weight<Dim>(locator.find(of.mesh.point_of_node(node)),
                         [&](int other, double weight) { entries.emplace_back(other, node, weight); });
  }
  Eigen::SparseMatrix<double> weights(now.mesh.num_nodes(), of.mesh.num_nodes());
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

/// Adds forces, half of them, to those on another mesh of the bodies; they stay at their points.
template <int Dim>
void add_half(const NodalForces& forces, const State<Dim>& of, const State<Dim>& now, NodalForces& sum) {
  const bool same = of.mesh.num_vertices() == now.mesh.num_vertices() && of.mesh.rest() == now.mesh.rest() &&
                    of.mesh.curved_edges() == now.mesh.curved_edges();
  const Eigen::SparseMatrix<double> weights = same ? Eigen::SparseMatrix<double>() : weights_between(of, now);
  for (const auto kind : kForcesOnBodies) {
    const VectorX& field = forces.*kind;
    if (field.size() == 0) continue;
    if (same)
      sum.*kind += field / 2;
    else
      (sum.*kind).reshaped(Dim, weights.rows()) += 0.5 * field.reshaped(Dim, weights.cols()) * weights.transpose();
  }
  for (const auto kind : kForcesOnObstacles) sum.*kind += forces.*kind / 2;
}

/// Forces of two halves of a step: of their impulses over the whole. Without inertia there are none, and those at the end
/// balance.
template <int Dim>
NodalForces mean_forces(const StepSetup<Dim>& setup, const NodalForces& first, const State<Dim>& middle,
                        const NodalForces& second, const State<Dim>& end) {
  if (!setup.time.has_inertia()) return second;
  NodalForces mean = second;
  for (const auto kind : kForcesOnBodies) mean.*kind /= 2;
  for (const auto kind : kForcesOnObstacles) mean.*kind /= 2;
  add_half(first, middle, end, mean);
  return mean;
}

}  // namespace

template <int Dim>
StepResult take_step_in_halves(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after,
                               const Attempt& attempt, StepResult failed) {
  const StepSetup<Dim>& setup = tools.setup;
  const StepSetup<Dim> half = halved(setup, before);
  tools.logger.warning("the step to t = " + setup.units.text(failed.report.t, "s", 6) + " failed (" + failed.reason +
                       "), cutting it into two of " + setup.units.text(half.time.dt, "s", 6));
  State<Dim> part = before;
  part.step = 0;
  if (setup.time.integrator == Integrator::bdf) part.history.x.resize(1), part.history.v.resize(1);
  StepReport effort = std::move(failed.report);
  NodalForces forces;
  ErrorFields errors;
  State<Dim> middle;
  MeshRenumbering renumbering;
  int parts = 0;
  for (int i = 0; i < 2; ++i) {
    StepResult result = take_step<Dim>(tools.with(half), part, part, nullptr, attempt);
    parts += std::max(1, result.report.cut_steps);
    result.report.add_effort(effort);
    if (!result.ok) return result;
    effort = result.report;
    errors = std::move(result.errors);
    forces = i == 0 ? std::move(result.forces) : mean_forces(setup, forces, middle, result.forces, part);
    if (i == 0 && setup.fields.any_forces()) middle = part;
    if (!result.renumbering.empty())
      renumbering = renumbering.empty() ? std::move(result.renumbering) : compose(renumbering, result.renumbering);
  }
  StepResult whole{.reason = {},
                   .report = effort,
                   .forces = std::move(forces),
                   .errors = std::move(errors),
                   .renumbering = std::move(renumbering)};
  whole.report.cut_steps = parts;
  whole.report.step = part.step = before.step + 1;
  whole.report.t = part.t = setup.time.time_after(part.step);
  after = std::move(part);
  return whole;
}

template <int Dim>
StepResult take_shorter_step(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, State<Dim>* start,
                             const Attempt& attempt, StepResult failed) {
  StepSetup<Dim> shorter = tools.setup;
  TimeOptions& time = shorter.time;
  time.dt *= attempt.trial.part;
  time.adaptive.step_end = time.t0 + time.dt;
  scale_tolerances(shorter, attempt.trial.part);
  StepResult result = take_step<Dim>(tools.with(shorter), before, after, start, attempt);
  add_dropped(std::move(failed.report), result.report);
  return result;
}

template <int Dim>
VectorX expected_positions(const StepSetup<Dim>& setup, const State<Dim>& step, const VectorX& x) {
  const TimeOptions& time = setup.time;
  if (time.is_static) return {};
  if (!time.has_inertia()) {
    const bool has_rate = step.step > 1 && !TimeIntegrator(time).uses_acceleration();
    return has_rate && !setup.remesh.enabled ? VectorX(x + time.dt * step.history.v[0]) : VectorX();
  }
  VectorX expected = TimeIntegrator(time).predictor(step.history);
  if (time.adaptive.enabled && !step.history.a.empty())
    expected += TimeIntegrator(time).scaling(step.history) * step.history.a[0];  // steps may differ in length
  else if (step.deviation.size() == expected.size())
    expected += step.deviation;
  return expected;
}

void add_dropped(StepReport dropped, StepReport& report) {
  dropped.forget_operations();
  dropped.damped_steps = 0;
  report.add_effort(dropped);
}

template VectorX expected_positions(const StepSetup<2>&, const State<2>&, const VectorX&);
template VectorX expected_positions(const StepSetup<3>&, const State<3>&, const VectorX&);
template StepResult take_shorter_step<2>(const StepTools<2>&, const State<2>&, State<2>&, State<2>*, const Attempt&,
                                         StepResult);
template StepResult take_shorter_step<3>(const StepTools<3>&, const State<3>&, State<3>&, State<3>*, const Attempt&,
                                         StepResult);
template StepResult take_step_in_halves<2>(const StepTools<2>&, const State<2>&, State<2>&, const Attempt&, StepResult);
template StepResult take_step_in_halves<3>(const StepTools<3>&, const State<3>&, State<3>&, const Attempt&, StepResult);

}  // namespace itr
