// SPDX-License-Identifier: MIT
// In words, what stopped a solve.
#pragma once

#include <map>
#include <string>

#include "energy/incremental_potential.hpp"
#include "newton/newton.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

/// Mesh, terms and names that a solve was of.
template <int Dim>
struct SolveScope {
  const CellSet<Dim>& cells;
  const IncrementalPotential<Dim>& potential;
  const ContactSurface<Dim>& surface;
  int num_obstacles;   ///< vertices of obstacles, the last ones
  double scaling;      ///< of energies (alpha h^2) [s^2]
  const Units& units;  ///< of what is said
  const std::map<int, Material>& materials;
};

/// Describes a solve that ended at x: the cell or pair that limits its last step, and the cell, the pair and the term at the
/// largest residual. `sum`: the terms that were minimised.
template <int Dim>
std::string diagnosis(const SolveScope<Dim>& scope, const NewtonSummary& summary, const EnergySum& sum, const VectorX& x,
                      Workspace& workspace);

/// Whether a solve that has converged at x did so since a cell has no volume left, which its law lets be: that is round-off.
template <int Dim>
bool is_crushed(const SolveScope<Dim>& scope, const NewtonSummary& summary, const VectorX& x);

/// Which turn a solve did not get through that ended at x: of what is held on its way `from` `to`, or of a body of linear
/// elasticity, which pressure stretches by turning it. Empty: there is none.
template <int Dim>
std::string describe_turn(const SolveScope<Dim>& scope, const Loads<Dim>& loads, const DofMap& dofs, ConstVectorView from,
                          ConstVectorView to, const VectorX& x);

/// Why a solve took many iterations, the most frequent reason first; `rounds` of lagging were solved in it.
template <int Dim>
std::string describe_effort(const SolveScope<Dim>& scope, const NewtonSummary& summary, int rounds, Workspace& workspace);

}  // namespace itr
