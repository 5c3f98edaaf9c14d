// SPDX-License-Identifier: MIT
// An upper bound of what remeshing can gain, from the state alone. If it is too little, as in free flight, remeshing is not
// set up.
#pragma once

#include "itr/mesh.hpp"
#include "remesh/fields.hpp"

namespace itr {

/// Upper bound of the gain of any split [J s^2]: the available energy of each connected part of the mesh, and the largest of
/// these. The incremental potential, with its loads completed to squares, is a sum of terms that are never negative, also
/// after a split. Infinite if this is not known of some term.
template <int Dim>
double available_energy(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context);

/// Edges up to this length may collapse [m] ...
template <int Dim>
double longest_collapse(const CollapseOptions& options, const StepContext<Dim>& context);
/// ... if a cell at the edge is no larger than a cell whose edges are that long (docs/theory.md).
template <int Dim>
bool is_small(const Mesh<Dim>& mesh, CellId cell, double longest);
/// Whether there is such an edge.
template <int Dim>
bool any_may_collapse(const Mesh<Dim>& mesh, const CollapseOptions& options, const StepContext<Dim>& context);

}  // namespace itr
