// SPDX-License-Identifier: MIT
// Steps that begin with straight edges: quadratic functions may oscillate where a shock or a fold is finer than the cells,
// and linear ones go on.
#pragma once

#include <optional>
#include <vector>

#include "simulation/step.hpp"

namespace itr {

/// The state that attempts start from, where that is not the one before the step.
template <int Dim>
struct StartOfStep {
  Straightening straightening = Straightening::none;
  State<Dim> state;
  VectorX x;
  StepReport effort;
  std::optional<MeshRenumbering> renumbering;  ///< empty: no edge could become straight
};

/// Curved cells of a failed step at x where det F is small somewhere, and those that share a vertex with one. Where there
/// are none, all cells of a mesh with curved edges: those may have stopped the linear cells beside them.
template <int Dim>
std::vector<CellId> find_nearly_inverted(const State<Dim>& state, const VectorX& x);

/// Makes curved edges straight in the state before the step that has failed, and says so.
template <int Dim>
StartOfStep<Dim> straighten(const StepTools<Dim>& tools, Straightening where, const StepFailure& failure,
                            const State<Dim>& before);

}  // namespace itr
