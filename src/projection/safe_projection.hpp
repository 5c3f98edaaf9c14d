// SPDX-License-Identifier: MIT
// Safe projection of positions (paper eq. 8-10): the L2 projection where it can be reached without contact and inversion,
// otherwise the nearest positions that barriers allow. Past positions are not at an equilibrium: barriers are there to
// keep them valid, so they act nearer than what the interpolant has, and push nothing that is well where it is.
#pragma once

#include "energy/contact/surface.hpp"
#include "fem/cell_set.hpp"
#include "itr/options.hpp"
#include "itr/solver.hpp"

namespace itr {

template <int Dim>
struct SafeProjectionProblem {
  const CellSet<Dim>& cells;        ///< the patch; other vertices of the surface after its own
  const CollisionSurface* surface;  ///< what can touch around the patch; null: nothing
  const std::map<int, Material>& materials;
  double dhat;                  ///< contact is looked at below it [m]
  std::vector<char> held_dofs;  ///< prescribed ones and those that do not belong to the patch, by dof
  std::vector<int> part;        ///< by vertex of the patch: its connected part; the integral of rho x is kept on each
  int rings;                    ///< so many edges around what stops the straight way vertices may leave it
};

template <int Dim>
struct SafeProjectionReport {
  bool used_barriers = false;
  bool converged = true;
  int iterations = 0;
  Vec<Dim> lost = Vec<Dim>::Zero();  ///< integral of rho (x_projected - x) that barriers and held dofs did not let it keep
};

/// `interpolant` is feasible, `projected` the unconstrained minimiser (both over all vertices of the cells, equal at held
/// dofs). Returns positions that are free of inversion and intersection: `projected` where the straight way to it is and
/// no pair or cell comes nearer to touching than to half of the least that the interpolant has.
template <int Dim>
VectorX project_safely(const SafeProjectionProblem<Dim>& problem, const VectorX& interpolant, const VectorX& projected,
                       linear::Solver& solver, SafeProjectionReport<Dim>& report);

}  // namespace itr
