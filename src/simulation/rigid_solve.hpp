// SPDX-License-Identifier: MIT
#pragma once

#include "energy/energy.hpp"
#include "newton/newton.hpp"
#include "simulation/rigid_coordinates.hpp"

namespace itr {

/// Solves over the coordinates of rigid bodies, for callers that know increments of nodes from `base` on.
template <int Dim>
class RigidSolve {
 public:
  /// All must outlive this. `dofs`: those of coordinates.
  RigidSolve(const RigidCoordinates<Dim>& rigid, const VectorX& base, const DofMap& dofs)
      : rigid_(rigid), base_(base), dofs_(dofs) {}

  /// Minimises `sum` over the coordinates of d, which follows the iterates. `target`: of held dofs. What `extras` calls and
  /// `step_to_start` are of increments, weights and `system` of coordinates.
  NewtonSummary minimize(const EnergySum& sum, VectorX& d, VectorX target, NewtonSystem& system,
                         const NewtonOptions& options, NewtonExtras extras, Workspace& workspace) const;
  /// x where bodies that turn have come along arcs; rigid ones keep their shape there.
  VectorX along_arcs(const VectorX& x) const;
  /// Motions of nodes, as columns, by coordinates; those of rigid bodies with held components are left out.
  MatrixX free_motions(MatrixX motions) const;

 private:
  const RigidCoordinates<Dim>& rigid_;
  const VectorX& base_;
  const DofMap& dofs_;
};

}  // namespace itr
