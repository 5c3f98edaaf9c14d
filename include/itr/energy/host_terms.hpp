// SPDX-License-Identifier: MIT
// Terms and forces that a program adds to the incremental potential.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "itr/core/types.hpp"
#include "itr/mesh/mesh.hpp"

namespace itr {

class Energy;
template <int Dim>
struct CellSet;

/// Makes a term for some cells: E(x) [J] times `scale` (alpha h^2 [s^2]) at the time t [s] of the end of a step, or null if
/// it does not act there. It is called for the whole mesh in each step and, with remeshing, for patches before and after an
/// edit. So E must be a sum over cells, facets or points at rest positions, because vertex numbers change. `cells` outlives
/// the energy.
template <int Dim>
using TermFactory = std::function<std::shared_ptr<const Energy>(const CellSet<Dim>& cells, double t, double scale)>;

/// Receives the symmetric block of some vertices, column-major, (Dim * vertices.size())^2 numbers [N/m].
using StiffnessReceiver = std::function<void(std::span<const int> vertices, const double* block)>;

/// Forces that depend on present positions and need no potential. A step linearises them at the last solution and solves
/// again until they balance. Remeshing uses those at the solution on the step's first mesh.
template <int Dim>
struct FollowerForces {
  /// Adds forces [N] on the vertices of `mesh` at positions x [m] and the time t [s], both interleaved. Empty: no forces.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, VectorView forces)> forces;
  /// Passes blocks of the symmetric part of -df/dx, which saves rounds. Empty: no blocks.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, const StiffnessReceiver& add)> stiffness;
};

}  // namespace itr
