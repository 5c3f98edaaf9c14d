// SPDX-License-Identifier: MIT
// What a program that embeds the library adds to the incremental potential.
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

/// Makes a term for some cells: E(x) [J] times `scale` (alpha h^2 [s^2]) at the time t [s] of the end of a step; null where
/// it does not act. It is asked for the whole mesh in each step and, with remeshing, for the patches around edits, before
/// and after them: a sum over cells, facets or points at rest positions, not over vertex numbers. `cells` outlives the
/// energy.
template <int Dim>
using TermFactory = std::function<std::shared_ptr<const Energy>(const CellSet<Dim>& cells, double t, double scale)>;

/// Takes symmetric blocks (column-major, Dim * vertices.size() squared [N/m]) of the vertices of a mesh.
using StiffnessReceiver = std::function<void(std::span<const int> vertices, const double* block)>;

/// Forces that depend on present positions and need no potential. A step is solved with them, linearised, at the solution
/// before, until they are in balance; remeshing sees those at the solution of the step's first mesh.
template <int Dim>
struct FollowerForces {
  /// Adds forces [N] on the vertices of `mesh` at positions x [m] and the time t [s]; both interleaved. Empty: there are
  /// none.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, VectorView forces)> forces;
  /// Gives (the symmetric part of) minus their derivative, block by block: fewer rounds. Empty: none.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, const StiffnessReceiver& add)> stiffness;
};

}  // namespace itr
