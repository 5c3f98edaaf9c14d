// SPDX-License-Identifier: MIT
#include "itr/remesh/remesher.hpp"

#include "prospect.hpp"
#include "ranking.hpp"
#include "session.hpp"

namespace itr {

template <int Dim>
RemeshReport remesh(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata) {
  const bool by_size = options.sizing_field.enabled, may_stir = options.swap.enabled || options.smooth.enabled;
  const bool asks_what_is_available = (options.split.enabled && !by_size) || (may_stir && screens(options));
  // If the available energy is less than the least gain of one split, shapes do not matter either: a body in flight.
  const bool is_enough_there = !asks_what_is_available || available_energy(mesh, fields, context) >=
                                                              context.scaling * options.split.acceptance_tolerance.value();
  const bool may_split = options.split.enabled && !by_size && is_enough_there;
  const bool has_to_stir = may_stir && (is_enough_there || !screens(options));
  const bool may_collapse = options.collapse.enabled && any_may_collapse(mesh, options.collapse, context);
  if (!may_split && !may_collapse && !has_to_stir && !by_size) return {};
  RemeshSession<Dim> session(mesh, fields, context, options, memory, strata);
  RemeshReport& report = session.report();
  EdgeRanks ranks;
  if (options.screening == Screening::energy_percentile) ranks = rank_edges(mesh, fields, context, options);
  if (by_size) {
    follow_sizing_field(session);
  } else {
    if (may_split) split_edges(session, ranks);
    if (options.collapse.enabled) collapse_edges(session, ranks);
  }
  if (may_stir && (has_to_stir || report.accepted() > 0)) {
    session.mark_gains();
    if (options.swap.enabled) swap_edges(session);
    if (options.smooth.enabled) smooth_vertices(session);
  }
  fields.trim(mesh.vertex_slots());
  report.trial_seconds = session.median_trial_seconds();
  memory = session.memory();
  return report;
}

template RemeshReport remesh(Mesh<2>&, RemeshFields<2>&, const StepContext<2>&, const RemeshOptions&, RemeshMemory&,
                             Strata<2>&);
template RemeshReport remesh(Mesh<3>&, RemeshFields<3>&, const StepContext<3>&, const RemeshOptions&, RemeshMemory&,
                             Strata<3>&);

}  // namespace itr
