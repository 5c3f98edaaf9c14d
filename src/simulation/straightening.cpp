// SPDX-License-Identifier: MIT
#include "simulation/straightening.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <numeric>

#include "simulation/effort_clock.hpp"
#include "simulation/remesh_step.hpp"

namespace itr {

template <int Dim>
std::vector<CellId> find_nearly_inverted(const State<Dim>& state, const VectorX& x) {
  constexpr double kSmall = 0.1, kTolerance = 0.1;
  const CellSet<Dim> cells = whole_mesh(state.mesh, {});
  std::vector<CellId> found;
  for (const auto& element : cells.curved()) {
    const double least = min_jacobian_bound<Dim>(at_all_nodes<Dim>(element, x), kTolerance);
    if (least * element.inverse_edges.determinant() >= kSmall) continue;
    for (const VertexId v : element.vertices) {
      const auto around = state.mesh.cells_of(v);
      found.insert(found.end(), around.begin(), around.end());
    }
  }
  if (found.empty() && cells.has_curved()) {
    found.resize(state.mesh.cell_slots());
    std::iota(found.begin(), found.end(), 0);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

template <int Dim>
StartOfStep<Dim> straighten(const StepTools<Dim>& tools, Straightening where, const StepFailure& failure,
                            const State<Dim>& before) {
  constexpr double kLeastVolume = 0.2;  // see straighten_cells
  std::vector<CellId> cells = failure.nearly_inverted;
  if (where != Straightening::around_failure) {
    cells.resize(before.mesh.cell_slots());
    std::iota(cells.begin(), cells.end(), 0);
  }
  StartOfStep<Dim> from;
  from.straightening = where;
  const EffortClock clock(tools.solver);
  from.renumbering = straighten_and_project<Dim>(tools, cells, where == Straightening::at_any_volume ? 0 : kLeastVolume,
                                                 before, from.state, from.x, from.effort);
  clock.tell(from.effort);
  if (from.renumbering)
    tools.logger.warning(fmt::format("step {}: taken again with {} curved edges made straight: {}", before.step + 1,
                                     before.mesh.num_curved() - from.state.mesh.num_curved(), failure.reason));
  return from;
}

#define ITR_INSTANTIATE(Dim)                                                                 \
  template std::vector<CellId> find_nearly_inverted<Dim>(const State<Dim>&, const VectorX&); \
  template StartOfStep<Dim> straighten<Dim>(const StepTools<Dim>&, Straightening, const StepFailure&, const State<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
