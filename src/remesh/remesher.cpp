// SPDX-License-Identifier: MIT
#include "itr/remesh/remesher.hpp"

#include "prospect.hpp"
#include "ranking.hpp"
#include "session.hpp"

namespace itr {

template <int Dim>
RemeshReport remesh(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata) {
  const bool may_split =
      options.split.enabled && !options.sizing_field.enabled &&
      available_energy(mesh, fields, context) >= context.scaling * options.split.acceptance_tolerance.value();
  const bool may_collapse = options.collapse.enabled && any_may_collapse(mesh, options.collapse, context);
  if (!may_split && !may_collapse && !options.swap.enabled && !options.smooth.enabled && !options.sizing_field.enabled)
    return {};
  RemeshSession<Dim> session(mesh, fields, context, options, memory, strata);
  RemeshReport& report = session.report();
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    const int before = report.accepted();
    EdgeRanks ranks;
    if (options.screening == Screening::energy_percentile) ranks = rank_edges(mesh, fields, context, options);
    if (options.sizing_field.enabled) {
      follow_sizing_field(session);
    } else {
      if (may_split) split_edges(session, ranks);
      if (options.collapse.enabled) collapse_edges(session, ranks);
    }
    if (options.swap.enabled) swap_edges(session);
    if (options.smooth.enabled) smooth_vertices(session);
    if (report.accepted() == before) break;
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
