// SPDX-License-Identifier: MIT
// In-timestep remeshing (paper Algorithm 1): splits, collapses, swaps and smooths a mesh where that lowers the incremental
// potential of the step, relaxing the neighbourhood of each operation before judging it.
#pragma once

#include "itr/remesh/fields.hpp"

namespace itr {

struct TrialCount {
  int tried = 0, accepted = 0;
};

struct RemeshReport {
  TrialCount splits, collapses, swaps, smooths;
  bool changed() const { return splits.accepted + collapses.accepted + swaps.accepted + smooths.accepted > 0; }
  /// Whether the new space lacks functions of the old one, so that the history has to be projected.
  bool coarsened() const { return collapses.accepted + swaps.accepted + smooths.accepted > 0; }
  double trial_seconds = 0;
  int bound_by_activation_distance = 0;  ///< surface edges not split because they are shorter than 2 dhat
};

/// Remeshes in place. The fields follow: x by local relaxation, all others interpolated at the vertices that edits set.
/// On entry x is the solution on the mesh; on return it is feasible and no higher in energy than the operations' tolerances
/// allow. Cells of ids below the entry's cell_slots() that are still alive were not touched.
RemeshReport remesh(Mesh<2>& mesh, RemeshFields<2>& fields, const StepContext<2>& context, const RemeshOptions& options);

}  // namespace itr
