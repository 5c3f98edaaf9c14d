// SPDX-License-Identifier: MIT
#include "simulation/tie_rounds.hpp"

#include <fmt/format.h>

#include <utility>

namespace itr {

template <int Dim>
void close_ties(TieEnergy<Dim>& tie, const CellSet<Dim>& cells, const VectorX& base, const VectorX& d,
                const std::function<NewtonSummary()>& solve, const Units& units, NewtonSummary& summary) {
  constexpr double kTieTolerance = 1e-7;  // of the tractions
  constexpr double kSlow = 0.1, kFactor = 10;
  constexpr int kMostRounds = 20;
  double error = tie.error_at({base, d});
  for (int round = 0; summary.converged() && error > kTieTolerance; ++round) {
    if (round == kMostRounds) {
      summary.termination = Termination::lagging;
      summary.message = fmt::format("tied surfaces stay apart by {}: conditions may hold both sides in different places",
                                    units.text(tie.largest_gap(VectorX(base + d - rest_positions<Dim>(cells))), "m", 3));
      return;
    }
    tie.update({base, d});
    NewtonSummary next = solve();
    next.add_effort(summary);
    summary = std::move(next);
    const double before = std::exchange(error, tie.error_at({base, d}));
    if (error > kSlow * before && round % 2 == 1) tie.stiffen(kFactor);
  }
}

#define ITR_INSTANTIATE(Dim)                                                                          \
  template void close_ties<Dim>(TieEnergy<Dim>&, const CellSet<Dim>&, const VectorX&, const VectorX&, \
                                const std::function<NewtonSummary()>&, const Units&, NewtonSummary&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
