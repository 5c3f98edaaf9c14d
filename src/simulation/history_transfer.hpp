// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core.hpp"
#include "itr/setup.hpp"
#include "itr/solver.hpp"
#include "itr/transfer.hpp"
#include "time/integrator.hpp"

namespace itr {

struct HistoryTransferReport {
  double loss = 0;            ///< 1/2 ||xhat_old - xhat_new||^2 of the predictor [kg m^2]; 0 where there is no inertia
  int with_barriers = 0;      ///< past positions that barriers had to keep valid
  int not_converged = 0;      ///< of these, those whose solve stopped early: valid, but not the nearest
  double lost_positions = 0;  ///< most that a past position lost of the integral of rho x, a component [kg m]
};

/// Whether a step depends on more of the past than where it begins: on inertia, friction or damping, or on what a program
/// adds.
template <int Dim>
bool depends_on_past(const StepSetup<Dim>& setup);

/// Replaces the bodies' part of `history`, carried along by interpolation onto the compact `mesh`, by its L2 projection from
/// `old_mesh`: positions safely, velocities and accelerations freely. `touched` are the cells by which the meshes differ;
/// values change on these and some rings around them only. The integrals of rho x, rho v and rho a over each connected part
/// of that are kept to round-off. Prescribed components of positions stay what they are. Does nothing where no step depends
/// on the past.
template <int Dim>
HistoryTransferReport transfer_history(const StepSetup<Dim>& setup, const Mesh<Dim>& old_mesh, const History& old_history,
                                       const Mesh<Dim>& mesh, const TouchedCells& touched, linear::Solver& solver,
                                       History& history);

}  // namespace itr
