// SPDX-License-Identifier: MIT
#include "watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

namespace {

constexpr double kMostRotation = 5;     ///< of linear elasticity [degrees]: strains are off by 4e-3 there
constexpr double kForceError = 0.01;    ///< relative, from which it is said
constexpr int kLooseSteps = 3;          ///< in a row
constexpr double kNoStrain = 1e-6;      ///< below it the energy of bodies is taken for none
constexpr double kResidualShare = 0.1;  ///< of the split tolerance, from which a residual hides what splits gain

/// Energy of the bodies by the square of a strain that is everywhere, sum(E V) [J].
template <int Dim>
double stiffness(const Setup<Dim>& setup) {
  double sum = 0;
  for (const CellId c : setup.mesh.live_cells())
    sum += setup.materials.at(setup.mesh.body(c)).youngs_modulus * setup.mesh.volume(c);
  return sum;
}

}  // namespace

template <int Dim>
void Watch<Dim>::look(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report, const Logger& logger) {
  if (!has_said_rotation_) find_rotation(setup, state, logger);
  if (!has_said_remeshing_) find_starved_remeshing(setup, report, logger);
  if (!has_said_forces_) find_loose_forces(setup, state, report, logger);
}

template <int Dim>
void Watch<Dim>::find_rotation(const Setup<Dim>& setup, const State<Dim>& state, const Logger& logger) {
  const auto is_linear = [](const auto& entry) { return entry.second.law == MaterialLaw::linear; };
  if (std::none_of(setup.materials.begin(), setup.materials.end(), is_linear)) return;
  const Mesh<Dim>& mesh = state.mesh;
  double most = 0;
  int body = 0;
  for (const CellId c : mesh.live_cells()) {
    if (setup.materials.at(mesh.body(c)).law != MaterialLaw::linear) continue;
    const auto element = element_of(mesh, c);
    const double angle = rotation_angle(deformation_gradient<Dim>(element, state.history.x[0]));
    if (angle > most) most = angle, body = mesh.body(c);
  }
  if (most <= kMostRotation) return;
  has_said_rotation_ = true;
  logger.warning(
      fmt::format("step {}: body {} is linear elastic and turns by {:.3g} degrees: rotations stretch it; NeoHookean or "
                  "SaintVenant do not mind them",
                  state.step, body, most));
}

template <int Dim>
void Watch<Dim>::find_starved_remeshing(const Setup<Dim>& setup, const StepReport& report, const Logger& logger) {
  if (!setup.remesh.enabled || setup.remesh.sizing_field.enabled) return;
  if (!(report.residual_worth > kResidualShare * report.split_tolerance)) return;
  has_said_remeshing_ = true;
  logger.warning(fmt::format(
      "step {}: Newton ended where one more iteration would gain {}, and a split is made for {}: "
      "refinement sees the residual, not the solution; a smaller /solver/nonlinear/x_delta, or none of these "
      "tolerances",
      report.step, setup.units.text(report.residual_worth, "J", 2), setup.units.text(report.split_tolerance, "J", 2)));
}

/// A residual that is worth a part e of the energy stands for forces off by about sqrt(e). A first touch is passed over, and
/// energies that are nothing beside those of strains of a millionth.
template <int Dim>
void Watch<Dim>::find_loose_forces(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report,
                                   const Logger& logger) {
  const double energy = std::max(state.stored_energy, report.energy.inertia);
  const double error = std::sqrt(report.residual_worth / energy);
  loose_steps_ = energy > kNoStrain * kNoStrain * stiffness(setup) && error > kForceError ? loose_steps_ + 1 : 0;
  if (loose_steps_ < kLooseSteps && !(loose_steps_ > 0 && state.step >= setup.time.steps)) return;
  has_said_forces_ = true;
  logger.warning(fmt::format(
      "step {}: Newton ended where one more iteration would gain {} of {}: forces may be off by about "
      "{:.2g} %; a smaller /solver/nonlinear/x_delta, or none of these tolerances",
      report.step, setup.units.text(report.residual_worth, "J", 2), setup.units.text(energy, "J", 2), 100 * error));
}

template class Watch<2>;
template class Watch<3>;

}  // namespace itr
