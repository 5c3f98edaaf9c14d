// SPDX-License-Identifier: MIT
#include "itr/projection/safe_projection.hpp"

#include <algorithm>
#include <cmath>

#include "itr/energy/elastic/elastic.hpp"
#include "itr/newton/newton.hpp"
#include "itr/projection/volume_barrier.hpp"

namespace itr {

namespace {
constexpr double kVolumeActivation = 1e-2;   ///< volume ratio below which the barrier acts
constexpr double kVolumeStiffness = 0.1;     ///< of the largest Young's modulus (the paper's kappa_v)
constexpr double kRelativeTolerance = 1e-9;  ///< of the way from the interpolant to the unconstrained minimiser
}  // namespace

template <int Dim>
VectorX project_safely(const SafeProjectionProblem<Dim>& problem, const VectorX& interpolant, const VectorX& projected,
                       linear::Solver& solver, SafeProjectionReport& report) {
  Workspace workspace;
  const VectorX way = projected - interpolant;
  std::shared_ptr<ContactEnergy<Dim>> contact;
  if (problem.surface)
    contact = std::make_shared<ContactEnergy<Dim>>(*problem.surface, problem.contact, problem.contact.barrier_stiffness,
                                                   problem.scaling);
  const ElasticEnergy<Dim> inversion(problem.cells, problem.materials, 1);
  const VolumeBarrier<Dim> volume(problem.cells, kVolumeActivation, 1);
  const bool reachable =
      inversion.max_step(interpolant, way, workspace) == 1 && volume.value(projected, workspace) == 0 &&
      (!contact || (contact->max_step(interpolant, way, workspace) == 1 && contact->active(projected, workspace).empty()));
  if (reachable) return projected;

  report.used_barriers = true;
  std::vector<char> held = problem.held_dofs;
  for (std::size_t v = 0; v < problem.free_vertices.size(); ++v)
    if (!problem.free_vertices[v])
      for (int c = 0; c < Dim; ++c) held[Dim * v + c] = 1;
  const DofMap dofs = DofMap::from_held(held);
  double stiffness = 0;
  for (const auto& [body, material] : problem.materials) stiffness = std::max(stiffness, material.youngs_modulus);
  EnergySum energy;
  energy.add(std::make_shared<InertiaEnergy<Dim>>(problem.cells, problem.materials, MassKind::consistent, projected));
  energy.add(std::make_shared<VolumeBarrier<Dim>>(problem.cells, kVolumeActivation,
                                                  kVolumeStiffness * stiffness * problem.scaling));
  if (contact) energy.add(contact);
  SparseSystem system(solver);
  system.reset(dofs, Dim, stencil_vertices(problem.cells), Dim + 1);
  NewtonOptions options;
  options.max_iterations = 100;
  options.step_tolerance = kRelativeTolerance * way.norm();
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  VectorX x = interpolant;
  const NewtonSummary summary = minimize(energy, x, dofs, VectorX(), system, options, workspace);
  report.converged = summary.converged();
  report.iterations = summary.iterations;
  return x;
}

template VectorX project_safely<2>(const SafeProjectionProblem<2>&, const VectorX&, const VectorX&, linear::Solver&,
                                   SafeProjectionReport&);
template VectorX project_safely<3>(const SafeProjectionProblem<3>&, const VectorX&, const VectorX&, linear::Solver&,
                                   SafeProjectionReport&);

}  // namespace itr
