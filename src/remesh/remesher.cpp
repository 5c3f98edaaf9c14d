// SPDX-License-Identifier: MIT
#include "remesh/remesher.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "geometry/measures.hpp"
#include "geometry/quadratic_validity.hpp"
#include "remesh/decide/prospect.hpp"
#include "remesh/edits.hpp"
#include "remesh/placed_cell.hpp"
#include "remesh/schedule/session.hpp"

namespace itr {

namespace {

/// Least tolerance of what adds unknowns [J].
double least_gain_of_refining(const RemeshOptions& options) {
  const double split = options.split.acceptance_tolerance.value();
  if (!options.curve.enabled) return split;
  return options.split.enabled ? std::min(split, options.curve_tolerance()) : options.curve_tolerance();
}

/// Tolerances of all operations, by kind [J].
std::array<double, kOperationKinds> tolerances_of(const RemeshOptions& options) {
  const double split = options.split.acceptance_tolerance.value_or(0),
               collapse = options.collapse.acceptance_tolerance.value_or(0);
  const double swap = options.swap.acceptance_tolerance.value_or(0),
               smooth = options.smooth.acceptance_tolerance.value_or(0);
  return {split,
          collapse,
          swap,
          smooth,
          smooth,
          options.curve.acceptance_tolerance.value_or(split),
          options.straighten.acceptance_tolerance.value_or(collapse),
          swap};
}

/// Whether an edit makes no cell that is more compressed somewhere, now or in the past, than that fraction of what it
/// replaces.
template <int Dim>
bool keeps_volumes(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const Edit<Dim>& edit, double least_fraction) {
  constexpr double kTolerance = 0.1;
  const auto keeps = [&](const VectorX& x) {
    double before = std::numeric_limits<double>::infinity();
    for (const CellId c : edit.removed_cells)
      before = std::min(before, mean_jacobian<Dim>(cell_before(mesh, c).values(x, no_edit<Dim>())) *
                                    mesh.inverse_rest_edges(c).determinant());
    return std::all_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
      std::array<Vec<Dim>, Dim + 1> rest;
      for (int k = 0; k <= Dim; ++k) rest[k] = rest_after(mesh, edit, cell.vertices[k]);
      const auto nodes = cell_after(mesh, edit, cell.vertices).values(x, edit);
      return min_jacobian_bound<Dim>(nodes, kTolerance) >= least_fraction * before * edge_matrix<Dim>(rest).determinant();
    });
  };
  return keeps(fields.x) && std::all_of(fields.past_positions.begin(), fields.past_positions.end(), keeps);
}

}  // namespace

template <int Dim>
RemeshReport remesh(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata) {
  auto baseline = Baseline<Dim>::chosen_by(options);
  const bool by_size = baseline && baseline->decides_by_size();
  const bool may_stir = options.swap.enabled || options.smooth.enabled;
  const bool refines = options.split.enabled || options.curve.enabled;
  const bool asks_what_is_available = (refines && !by_size) || may_stir;
  // If the available energy is less than the least gain of one split, shapes do not matter either: a body in flight.
  const bool is_enough_there = !asks_what_is_available ||
                               available_energy(mesh, fields, context) >= context.scaling * least_gain_of_refining(options);
  const bool may_refine = refines && !by_size && is_enough_there;
  const bool has_to_stir = may_stir && is_enough_there;
  const bool may_collapse = options.collapse.enabled && any_may_collapse(mesh, options.collapse, context);
  const bool may_straighten = options.straighten.enabled && !by_size;
  if (!may_refine && !(may_straighten && mesh.has_nodes()) && !may_collapse && !has_to_stir && !by_size) return {};
  memory.begin(tolerances_of(options));
  RemeshSession<Dim> session(mesh, fields, context, options, std::move(baseline), memory, strata);
  if (session.baseline()) session.baseline()->rank(session.queries());
  if (by_size) {
    follow_sizing_field(session);
  } else {
    if (may_refine) refine_edges(session);
    if (options.collapse.enabled || (may_straighten && mesh.has_nodes())) coarsen_edges(session);
  }
  if (may_stir && (has_to_stir || session.report().accepted() > 0)) {
    session.memory().mark_gains();
    if (options.swap.enabled) swap_edges(session);
    if (options.smooth.enabled) smooth_vertices(session);
  }
  return session.finish();
}

template <int Dim>
RemeshReport curve_edges(std::span<const EdgeKey> edges, Mesh<Dim>& mesh, RemeshFields<Dim>& fields,
                         const StepContext<Dim>& context, const RemeshOptions& options, RemeshMemory& memory,
                         Strata<Dim>& strata) {
  RemeshSession<Dim> session(mesh, fields, context, options, nullptr, memory, strata);
  OperationCount& count = session.report().curves;
  for (const EdgeKey& edge : edges) {
    Refusal refusal = session.queries().refuse_curve(edge);
    if (refusal == Refusal::none && session.queries().may_touch(edge, session.scratch())) refusal = Refusal::overhang;
    if (refusal == Refusal::none)
      session.commit_unjudged(make_curve(mesh, edge), count);
    else
      count.note(refusal);
  }
  return session.finish();
}

template <int Dim>
RemeshReport straighten_cells(std::span<const CellId> cells, double least_volume, Mesh<Dim>& mesh, RemeshFields<Dim>& fields,
                              const StepContext<Dim>& context, const RemeshOptions& options, RemeshMemory& memory,
                              Strata<Dim>& strata) {
  RemeshSession<Dim> session(mesh, fields, context, options, nullptr, memory, strata);
  // The gate does not ask whether the energy of a new cell is finite.
  const auto is_finite = [&](const Edit<Dim>& edit) {
    return std::all_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
      return std::isfinite(session.queries().energy_of(cell.vertices, cell.body, edit));
    });
  };
  const auto commit = [&](const Edit<Dim>& edit) {
    return is_finite(edit) && (least_volume == 0 || keeps_volumes(mesh, fields, edit, least_volume)) &&
           session.commit_unjudged(edit, session.report().straightens);
  };
  const CellId first_new = mesh.cell_slots();
  const auto curved = [&mesh](const std::vector<EdgeKey>& edges) {
    std::vector<EdgeKey> found;
    std::copy_if(edges.begin(), edges.end(), std::back_inserter(found),
                 [&mesh](const EdgeKey& edge) { return mesh.node_of(edge[0], edge[1]) != kNone; });
    return found;
  };
  // Chords keep what the curves are; what lies between them is nearly straight.
  for (const EdgeKey& edge : curved(edges_of<Dim>(mesh, cells)))
    if (session.queries().refuse_chords(edge) != Refusal::none || !commit(make_chords(mesh, edge)))
      commit(make_straighten(mesh, edge));
  std::vector<CellId> made;
  for (CellId c = first_new; c < mesh.cell_slots(); ++c) made.push_back(c);
  for (const EdgeKey& edge : curved(edges_of<Dim>(mesh, made))) commit(make_straighten(mesh, edge));
  return session.finish();
}

#define ITR_INSTANTIATE(Dim)                                                                                           \
  template RemeshReport curve_edges(std::span<const EdgeKey>, Mesh<Dim>&, RemeshFields<Dim>&, const StepContext<Dim>&, \
                                    const RemeshOptions&, RemeshMemory&, Strata<Dim>&);                                \
  template RemeshReport straighten_cells(std::span<const CellId>, double, Mesh<Dim>&, RemeshFields<Dim>&,              \
                                         const StepContext<Dim>&, const RemeshOptions&, RemeshMemory&, Strata<Dim>&);  \
  template RemeshReport remesh(Mesh<Dim>&, RemeshFields<Dim>&, const StepContext<Dim>&, const RemeshOptions&,          \
                               RemeshMemory&, Strata<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
