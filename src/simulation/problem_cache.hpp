// SPDX-License-Identifier: MIT
#pragma once

#include <memory>

#include "newton/newton.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

/// Data that depend on the mesh alone: problems share them while the mesh stays.
template <int Dim>
struct MeshScope {
  /// The mesh must be compact.
  MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords = {});
  /// Whether this is of such a mesh, obstacles and levels of chords.
  bool is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords) const;

  std::uint64_t mesh_revision;
  ChordLevels chords;
  CellSet<Dim> cells;
  ContactSurface<Dim> surface;  ///< empty without contact
  double diagonal;              ///< of the bodies at rest [m]
  Workspace workspace;          ///< search trees of the surface
};

/// Data that a simulation keeps from step to step, so that they are not made again: they change no result, only the time.
template <int Dim>
struct ProblemCache {
  /// `solver`, a linear::Solver or linear::ReusingSolver, must outlive this.
  template <typename Solver>
  explicit ProblemCache(Solver& solver) : system(solver) {}
  /// The newest scope, where it is of that mesh; else a new one.
  std::shared_ptr<MeshScope<Dim>> scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                           const ChordLevels& chords = {});

  SparseSystem system;       ///< with its pattern, analysis and factors
  unsigned long served = 0;  ///< problems that the system was reset for, so many; it is the last one's
  std::shared_ptr<MeshScope<Dim>> scope;
};

}  // namespace itr
