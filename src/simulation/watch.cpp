// SPDX-License-Identifier: MIT
#include "watch.hpp"
#include "energy/rigid_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.hpp"
#include "mesh/rest_box.hpp"
#include "mesh/turn.hpp"
#include "simulation/chord_bound.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/named.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

namespace {

constexpr double kMostRotation = 5;        ///< of linear elasticity [degrees]: strains are off by 4e-3 there
constexpr double kForceError = 0.01;       ///< relative, from which it is said
constexpr double kReactionLeft = 0.3;      ///< of the largest reaction: less is left where reactions are right to 1 %
constexpr double kNoForce = 1e-12;         ///< of what strains of 1 take: less is round-off of bodies that nothing presses
constexpr int kLooseSteps = 3;             ///< in a row
constexpr double kGapFraction = 0.03;      ///< of the way that bodies are compressed, from which gaps are told of
constexpr double kNoStrain = 1e-6;         ///< below it the energy of bodies is taken for none
constexpr double kResidualFraction = 0.1;  ///< of the split tolerance, from which a residual hides what splits gain

/// Energy of the bodies by the square of a strain that is everywhere, sum(E V) [J]: of those that deform, if any do.
template <int Dim>
double stiffness(const Setup<Dim>& setup) {
  double deformable = 0, rigid = 0;
  for (const CellId c : setup.mesh.live_cells()) {
    const Material& material = setup.materials.at(setup.mesh.body(c));
    (rigid_body_of(material) ? rigid : deformable) +=
        material.youngs_modulus * setup.mesh.volume(c) * turn_at(setup.mesh, setup.mesh.barycenter(c));
  }
  return deformable > 0 ? deformable : rigid;
}

template <int Dim>
bool are_all_rigid(const Setup<Dim>& setup) {
  return std::ranges::all_of(setup.materials, [](const auto& entry) { return rigid_body_of(entry.second) != nullptr; });
}

}  // namespace

template <int Dim>
void Watch<Dim>::look(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report, const NodalForces& forces,
                      const Logger& logger) {
  if (!has_said_rotation_) find_rotation(setup, state, logger);
  if (!has_said_remeshing_) find_starved_remeshing(setup, report, logger);
  if (!has_said_forces_) find_loose_forces(setup, state, report, logger);
  find_wide_gaps(setup, state, report, logger);
  if (!has_said_reactions_) find_unbalanced_reactions(setup, report, forces, logger);
  find_long_chords(setup, state, logger);
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
                  state.step, set_text(setup.names.bodies, body), most));
}

template <int Dim>
void Watch<Dim>::find_starved_remeshing(const Setup<Dim>& setup, const StepReport& report, const Logger& logger) {
  if (!setup.remesh.enabled || setup.remesh.sizing_field.enabled) return;
  if (!(report.residual_worth > kResidualFraction * report.split_tolerance)) return;
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
  if (loose_steps_ < kLooseSteps && !(loose_steps_ > 0 && setup.time.is_over(state.step, state.t))) return;
  has_said_forces_ = true;
  logger.warning(fmt::format(
      "step {}: Newton ended where one more iteration would gain {} of {}: forces may be off by about "
      "{:.2g} %; a smaller /solver/nonlinear/x_delta, or none of these tolerances",
      report.step, setup.units.text(report.residual_worth, "J", 2), setup.units.text(energy, "J", 2), 100 * error));
}

/// Forces f across gaps g do the work sum(f g), and bodies store about half of f times the way that they are compressed.
/// Where a prescribed motion presses bodies together, without inertia and without loads that matter, gaps add to this way.
/// The end of the run tells of the step with the most elastic energy.
template <int Dim>
void Watch<Dim>::find_wide_gaps(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report,
                                const Logger& logger) {
  constexpr double kSmallWeight = 0.1, kLeastRest = 0.1;
  if (!setup.contact.enabled || setup.time.has_inertia() || !setup.neumann.empty() || !setup.pressure.empty() ||
      !setup.cavities.empty() || !setup.nodal_loads.empty() || !setup.terms.empty() || setup.follower.forces ||
      are_all_rigid(setup))
    return;
  if (report.energy.elastic > most_elastic_) {
    most_elastic_ = report.energy.elastic;
    const ContactSurface<Dim> contact = contact_surface(setup, state.mesh, state.chords);
    const VectorX x = contact.positions(state.history.x[0]);
    VectorX gradient = VectorX::Zero(x.size());
    Workspace workspace;
    ContactEnergy<Dim>(contact.surface, setup.contact, state.stiffness.value, 1).add_gradient(x, gradient, workspace);
    double force = 0, weight = 0;
    for (Eigen::Index i = 0; i < gradient.size(); i += Dim) force += gradient.segment<Dim>(i).norm() / 2;
    if (setup.body_acceleration)
      for (const CellId c : state.mesh.live_cells()) {
        const Vec<Dim> X = state.mesh.barycenter(c), a = setup.body_acceleration(X, state.t);
        weight += setup.materials.at(state.mesh.body(c)).density * state.mesh.volume(c) * a.norm() * turn_at(state.mesh, X);
      }
    const bool counts = most_elastic_ > kNoStrain * kNoStrain * stiffness(setup) && weight < kSmallWeight * force;
    const double work = counts ? -x.dot(gradient) : 0;  // distances are homogeneous in x
    gap_ = counts ? work / force : 0;
    gap_fraction_ = work / std::max(2 * most_elastic_ - work, kLeastRest * work);
  }
  if (!setup.time.is_over(state.step, state.t) || !(gap_fraction_ > kGapFraction)) return;
  logger.warning(fmt::format(
      "surfaces that press each other stand off by about {}, {:.2g} % of the way that bodies would be compressed by without "
      "gaps: forces may be too large by as much; a smaller /contact/dhat than {} helps",
      setup.units.text(gap_, "m", 2), 100 * gap_fraction_, setup.units.text(setup.contact.dhat, "m", 2)));
}

/// Reactions are off by what the balance of forces lacks at free vertices.
template <int Dim>
void Watch<Dim>::find_unbalanced_reactions(const Setup<Dim>& setup, const StepReport& report, const NodalForces& forces,
                                           const Logger& logger) {
  const auto largest = [](const VectorX& force) {
    return force.size() > 0 ? std::sqrt(force.reshaped(Dim, force.size() / Dim).colwise().squaredNorm().maxCoeff()) : 0;
  };
  largest_reaction_ = std::max(largest_reaction_, largest(forces.reaction));
  const double left = largest(forces.residual);
  const double least = kNoForce * stiffness(setup) / rest_box(setup.mesh).sizes().norm();
  const bool counts = left > std::max(least, kReactionLeft * largest_reaction_) && largest_reaction_ > 0;
  unbalanced_steps_ = counts ? unbalanced_steps_ + 1 : 0;
  if (unbalanced_steps_ < kLooseSteps && !(unbalanced_steps_ > 0 && setup.time.is_over(report.step, report.t))) return;
  has_said_reactions_ = true;
  logger.warning(fmt::format(
      "step {}: {} are left of the balance of forces at a vertex, {:.2g} % of the largest reaction: reactions may be off by "
      "as much; over steps of {} positions may have too few digits for accelerations, which a longer /time/dt mends, or a "
      "tolerance is too large",
      report.step, setup.units.text(left, "N", 2), 100 * left / largest_reaction_, setup.units.text(setup.time.dt, "s", 3)));
}

template <int Dim>
void Watch<Dim>::find_long_chords(const Setup<Dim>& setup, const State<Dim>& state, const Logger& logger) {
  const double excess = find_chord_demand(setup, state.mesh, state.chords, state.history.x[0]).excess;
  if (excess <= 1) return;
  logger.warning(fmt::format(
      "step {}: curved edges leave the chords that contact acts on by {:.2g} times of what they may (a quarter of "
      "d-hat, half of the gap) and can have no shorter chords: a finer mesh helps",
      state.step, excess));
}

template class Watch<2>;
template class Watch<3>;

}  // namespace itr
