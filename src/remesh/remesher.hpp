// SPDX-License-Identifier: MIT
// In-timestep remeshing (paper Algorithm 1): splits, collapses, swaps and smooths a mesh where that lowers the incremental
// potential of the step, relaxing the neighbourhood of each operation before judging it.
#pragma once

#include <span>

#include "mesh/strata.hpp"
#include "remesh/fields.hpp"
#include "remesh/memory.hpp"
#include "remesh/report.hpp"

namespace itr {

/// Remeshes in place. On entry x is the solution on the mesh. On return x is feasible, and its energy exceeds that on entry
/// by at most the tolerances of the accepted operations and by what curved edges that touch had gained beyond their chords.
/// Patches relax x; all other fields are interpolated at the vertices
/// that edits set. A living cell whose id is below the entry's cell_slots() was not touched. `memory` holds earlier refusals
/// and is updated. So are the `strata` of the mesh, which are found first if they are empty.
template <int Dim>
RemeshReport remesh(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata);

/// Curves these edges, whatever that gains, where contact and the shape of cells allow it; else as `remesh`.
template <int Dim>
RemeshReport curve_edges(std::span<const EdgeKey> edges, Mesh<Dim>& mesh, RemeshFields<Dim>& fields,
                         const StepContext<Dim>& context, const RemeshOptions& options, RemeshMemory& memory,
                         Strata<Dim>& strata);

/// Replaces curved edges of these cells by their chords or makes them straight, whatever it costs, where that inverts and
/// meets nothing; else as `remesh`. New cells keep `least_volume` everywhere, a fraction of the least mean volume ratio of
/// those that they replace, now and in the past.
template <int Dim>
RemeshReport straighten_cells(std::span<const CellId> cells, double least_volume, Mesh<Dim>& mesh, RemeshFields<Dim>& fields,
                              const StepContext<Dim>& context, const RemeshOptions& options, RemeshMemory& memory,
                              Strata<Dim>& strata);

}  // namespace itr
