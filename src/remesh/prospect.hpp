// SPDX-License-Identifier: MIT
// What remeshing can come to at most, told from the state alone: where that is nothing, as in free flight, nothing is set
// up.
#pragma once

#include "itr/mesh/mesh.hpp"
#include "itr/remesh/fields.hpp"

namespace itr {

/// What any split can gain at most [J s^2]: of each connected part of the mesh the energy that is there to be lowered, the
/// largest. With its loads completed to squares the incremental potential is a sum of terms that are never negative, on
/// the mesh after a split too. Infinity where it has terms of which that is not known.
template <int Dim>
double available_energy(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context);

/// Edges up to this length may collapse [m] ...
template <int Dim>
double longest_collapse(const CollapseOptions& options, const StepContext<Dim>& context);
/// ... where a cell around is not larger than one whose edges are that long (REMESHING.md).
template <int Dim>
bool is_small(const Mesh<Dim>& mesh, CellId cell, double longest);
/// Whether there is such an edge.
template <int Dim>
bool any_may_collapse(const Mesh<Dim>& mesh, const CollapseOptions& options, const StepContext<Dim>& context);

}  // namespace itr
