// SPDX-License-Identifier: MIT
#include "itr/remesh/remesher.hpp"

#include "ranking.hpp"
#include "session.hpp"

namespace itr {

RemeshReport remesh(Mesh<2>& mesh, RemeshFields<2>& fields, const StepContext<2>& context, const RemeshOptions& options,
                    RemeshMemory& memory) {
  RemeshSession<2> session(mesh, fields, context, options, memory);
  RemeshReport& report = session.report();
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    const int before = report.accepted();
    EdgeRanks ranks;
    if (options.screening == Screening::energy_percentile) ranks = rank_edges(mesh, fields, context, options);
    if (options.split.enabled) split_edges(session, ranks);
    if (options.collapse.enabled) collapse_edges(session, ranks);
    if (options.swap.enabled) swap_edges(session);
    if (options.smooth.enabled) smooth_vertices(session);
    if (report.accepted() == before) break;
  }
  report.trial_seconds = session.median_trial_seconds();
  memory = session.memory();
  return report;
}

}  // namespace itr
