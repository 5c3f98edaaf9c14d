// SPDX-License-Identifier: MIT
// In-timestep remeshing (paper Algorithm 1): splits, collapses, swaps and smooths a mesh where that lowers the incremental
// potential of the step, relaxing the neighbourhood of each operation before judging it.
#pragma once

#include "itr/mesh/strata.hpp"
#include "itr/remesh/fields.hpp"
#include "itr/remesh/memory.hpp"
#include "itr/remesh/report.hpp"

namespace itr {

/// Remeshes in place. The fields follow: x by local relaxation, all others interpolated at the vertices that edits set.
/// On entry x is the solution on the mesh; on return it is feasible and no higher in energy than the operations' tolerances
/// allow. Cells of ids below the entry's cell_slots() that are still alive were not touched.
/// `memory` has what was refused before, and is brought up to date. So are `strata` of the mesh; where they are empty they
/// are found (in 3D; 2D does without).
template <int Dim>
RemeshReport remesh(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata);

}  // namespace itr
