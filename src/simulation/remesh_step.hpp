// SPDX-License-Identifier: MIT
// The middle of a time step: remesh where that lowers the step's energy, carry the state over to the new mesh.
#pragma once

#include "simulation/step.hpp"

namespace itr {

/// Fraction of RemeshOptions::relative_tolerance where the split tolerance follows the energy that is stored so far: that is
/// less than the energy that bodies can hold, of which the other tolerance is a part.
inline constexpr double kStoredFraction = 0.1;

/// Remeshes state.mesh, around the solution x of `problem`, and carries state.history and x over to the new mesh; `before`
/// is the state as it is, at the end of the step but for x. Returns what became of its ids; nothing where nothing changed.
/// `report` has the energies of x; it gets operations, forgotten history and seconds. No edge is curved unless `may_curve`.
template <int Dim>
std::optional<MeshRenumbering> remesh_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                  const State<Dim>& before, State<Dim>& state, VectorX& x,
                                                  StepReport& report, bool may_curve);

/// Curves these edges around the solution x of `problem`, as far as they may be; else as remesh_and_project.
template <int Dim>
std::optional<MeshRenumbering> curve_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                 std::span<const EdgeKey> edges, const State<Dim>& before, State<Dim>& state,
                                                 VectorX& x, StepReport& report);

/// Makes the curved edges of cells straight in the state between two steps, whatever it costs, and carries it over. `x` gets
/// its positions interpolated on the new mesh: those that are projected may be nearly inverted, and no solve can start
/// there. `least_volume`: see straighten_cells.
template <int Dim>
std::optional<MeshRenumbering> straighten_and_project(const StepTools<Dim>& tools, std::span<const CellId> cells,
                                                      double least_volume, const State<Dim>& before, State<Dim>& state,
                                                      VectorX& x, StepReport& report);

}  // namespace itr
