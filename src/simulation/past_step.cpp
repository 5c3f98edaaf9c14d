// SPDX-License-Identifier: MIT
#include "simulation/past_step.hpp"

#include <utility>

#include "simulation/step_terms.hpp"

namespace itr {

namespace {

/// Ends one past, with step_at(time); returns what was dissipated [J].
template <int Dim, typename StepAt>
double end_past(std::shared_ptr<const CellHistory> History::*past, const StepAt& step_at, const VectorX& x, double t,
                State<Dim>& next, State<Dim>* start, StepReport& report) {
  if (start) start->history.*past = step_at(t)->end(next.mesh, next.history.x[0], t).state;
  HistoryEnd end = step_at(next.t)->end(next.mesh, x, next.t);
  next.history.*past = std::move(end.state);
  report.history_loss += end.loss;
  return end.dissipation;
}

}  // namespace

template <int Dim>
void end_pasts(const StepSetup<Dim>& setup, const VectorX& x, double t, State<Dim>& next, State<Dim>* start,
               StepReport& report) {
  const auto viscous_at = [&](double time) { return viscous_step(setup, next.history, time); };
  const auto softening_at = [&](double) { return softening_step(setup, next.history); };
  if (next.history.viscous) report.viscous_dissipation = end_past(&History::viscous, viscous_at, x, t, next, start, report);
  if (next.history.softening) report.softening = end_past(&History::softening, softening_at, x, t, next, start, report);
}

template void end_pasts(const StepSetup<2>&, const VectorX&, double, State<2>&, State<2>*, StepReport&);
template void end_pasts(const StepSetup<3>&, const VectorX&, double, State<3>&, State<3>*, StepReport&);

}  // namespace itr
