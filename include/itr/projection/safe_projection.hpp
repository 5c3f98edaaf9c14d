// SPDX-License-Identifier: MIT
// Safe projection of positions (paper eq. 8-10): the L2 projection where it can be reached without contact and inversion,
// otherwise the minimiser of its quadratic plus contact and volume barriers around the touched cells.
#pragma once

#include "itr/energy/contact/contact.hpp"
#include "itr/energy/inertia.hpp"
#include "itr/linear/solver.hpp"
#include "itr/newton/options.hpp"
#include "itr/projection/transfer.hpp"

namespace itr {

template <int Dim>
struct SafeProjectionProblem {
  const CellSet<Dim>& cells;        ///< the new mesh, obstacles' vertices after the bodies'
  const CollisionSurface* surface;  ///< null: no contact in the scene
  const std::map<int, Material>& materials;
  ContactOptions contact;
  double scaling;                   ///< alpha h^2 [s^2]
  std::vector<char> free_vertices;  ///< those around the touched cells, by vertex of `cells`
  std::vector<char> held_dofs;      ///< Dirichlet and obstacle dofs, by dof
};

struct SafeProjectionReport {
  bool used_barriers = false;
  bool converged = true;
  int iterations = 0;
};

/// `interpolant` is feasible, `projected` the unconstrained minimiser (both over all vertices of the cells). Returns
/// positions that are free of inversion and intersection.
template <int Dim>
VectorX project_safely(const SafeProjectionProblem<Dim>& problem, const VectorX& interpolant, const VectorX& projected,
                       linear::Solver& solver, SafeProjectionReport& report);

}  // namespace itr
