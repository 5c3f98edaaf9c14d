// SPDX-License-Identifier: MIT
#include "trial.hpp"

#include <algorithm>
#include <limits>

#include "patch.hpp"
#include "prediction.hpp"

namespace itr {

namespace {

constexpr int kIterationsAfterAcceptance = 100;
constexpr double kSurelyTooLittle = 0.9;                          ///< fraction of the required gain, as a prediction
constexpr int kBoundIterations = 1, kBoundContactIterations = 2;  ///< of Newton, for a vertex alone

/// Fraction of the barrier's energy around an edit that its weights, which depend on the mesh, can feign as a gain.
constexpr double kBarrierNoise = 1;

/// Both sides of a comparison on one support.
template <int Dim>
struct Comparison {
  double gain = -std::numeric_limits<double>::infinity();
  double required = 0;  ///< of the gain, noise included
  bool touches_contact = false;
  bool has_unknowns = false;
  Box<Dim> surface_read{};
};

/// `accept`, called with the side after the edit where it gains `required` and `noise_share` of the barrier's energy, may go
/// on with it.
template <int Dim, typename Accept>
Comparison<Dim> compare(const RemeshState<Dim>& state, std::span<const CellId> patch, const Edit<Dim>& edit, double required,
                        double noise_fraction, int iterations, int contact_iterations, LocalScratch<Dim>& scratch,
                        const Accept& accept) {
  LocalProblem<Dim> before(state, patch, edit, false, scratch);
  LocalProblem<Dim> after(state, patch, edit, true, scratch);
  Comparison<Dim> result;
  result.touches_contact = before.touches_contact() || after.touches_contact();
  result.has_unknowns = after.has_unknowns();
  result.surface_read = before.surface_read();
  result.surface_read.include(after.surface_read());
  const int effort = result.touches_contact ? contact_iterations : iterations;
  const double energy_before = before.value();
  if (noise_fraction > 0) required += noise_fraction * before.contact_energy();
  result.required = required;
  const double energy_after = after.has_unknowns() ? after.relax(effort).energy : after.value();
  result.gain = energy_before - energy_after;
  // The side without the edit gets the same effort, so that residual left over elsewhere is not credited to the edit.
  if (result.gain >= required && before.has_unknowns()) result.gain = before.relax(effort).energy - energy_after;
  if (result.gain >= required) accept(after);
  return result;
}

/// The cells of an edit and those around the vertex that it sets.
template <int Dim>
void find_star(const Mesh<Dim>& mesh, const Edit<Dim>& edit, std::vector<CellId>& cells) {
  cells.assign(edit.removed_cells.begin(), edit.removed_cells.end());
  if (edit.value && edit.value->vertex != kNewVertex) {
    const auto around = mesh.cells_of(edit.value->vertex);
    cells.insert(cells.end(), around.begin(), around.end());
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

}  // namespace

template <int Dim>
double gain_of_vertex(const RemeshState<Dim>& state, const Edit<Dim>& edit, LocalScratch<Dim>& scratch,
                      Box<Dim>* surface_read) {
  find_star(state.mesh, edit, scratch.star);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto found =
      compare<Dim>(state, scratch.star, edit, kNever, 0, kBoundIterations, kBoundContactIterations, scratch, [](auto&) {});
  if (surface_read) surface_read->include(found.surface_read);
  return found.gain;
}

/// Patches of volume by vertex on random meshes: of 7 triangles, of 25 tetrahedra (docs/theory.md, "Patches under
/// remeshing").
template <int Dim>
inline constexpr double kPatchesPerVertex = Dim == 2 ? 2.0 / 7 : 2.0 / 9;

/// Whether a split gains more than the patches that it brings to the next solve are expected to take back. One of its own
/// takes what it does on the relaxed patch. Asked with inertia, and under pressure, which is lagged.
template <int Dim>
bool pays_for_patches(const RemeshState<Dim>& state, const Edit<Dim>& edit, const LocalRelaxationOptions& local,
                      LocalScratch<Dim>& scratch, Verdict<Dim>& verdict) {
  const bool is_asked = state.context.has_inertia || !state.context.loads.pressures.empty();
  if (!is_asked || edit.kind != Edit<Dim>::Kind::split || !state.patches || !state.patches->act_in(edit.removed_cells))
    return true;
  RemeshState<Dim> finer = state;
  finer.cuts_star = true;
  const auto energy = [&](const RemeshState<Dim>& by, bool is_after) {
    LocalProblem<Dim> problem(by, verdict.patch, edit, is_after, scratch);
    verdict.surface_read.include(problem.surface_read());
    const int effort = problem.touches_contact() ? local.max_contact_iterations : local.max_iterations;
    return problem.has_unknowns() ? problem.relax(effort).energy : problem.value();
  };
  const double before = energy(state, false), after = energy(state, true), ends = energy(finer, true);
  return before - after >= kPatchesPerVertex<Dim> * (ends - after);
}

template <int Dim>
void preview(const RemeshState<Dim>& state, const Gate<Dim>& gate, const Edit<Dim>& edit, const TrialOptions& options,
             LocalScratch<Dim>& scratch, Verdict<Dim>& verdict) {
  verdict.clear();
  verdict.refusal = Refusal::invalid;
  if (!gate.passes(edit, scratch.gate)) return;
  const auto note = [&](const Comparison<Dim>& found, Refusal refusal) {
    verdict.refusal = refusal;
    verdict.gain = found.gain;
    verdict.required = found.required;
    verdict.touches_contact = found.touches_contact;
    verdict.surface_read.include(found.surface_read);
  };
  // Relaxes an edit that gains enough, which may still make a distorted cell.
  const auto finish = [&](LocalProblem<Dim>& after) {
    if (!pays_for_patches(state, edit, options.local, scratch, verdict)) return Refusal::energy;
    if (after.has_unknowns()) after.relax(kIterationsAfterAcceptance);
    if (edit.kind == Edit<Dim>::Kind::curve && after.distorts()) return Refusal::shape;
    after.get_positions(verdict.positions);
    return Refusal::none;
  };
  bool is_enough = false;
  double required = options.required;
  // The bound is not asked where it is known to decide nothing.
  const bool is_bound_open = options.predicted && *options.predicted < kSurelyTooLittle * options.required &&
                             at_most(*options.predicted, options.patch_over_vertex) >= options.required;
  if (options.patch_over_vertex > 0 && !is_bound_open) {
    find_star(state.mesh, edit, scratch.star);
    // History that the new mesh cannot represent takes the longest to find, so the first of two checks leaves it out.
    const double noise_fraction = edit.is_nested() ? kBarrierNoise : 0;
    const bool is_nested = edit.is_nested() || state.history == HistoryRule::interpolated;
    for (int check = is_nested || options.predicted ? 1 : 0; check < 2; ++check) {
      const HistoryRule history = check == 0 ? HistoryRule::interpolated : state.history;
      const RemeshState<Dim> judged{state.mesh, state.fields, state.context, state.surface, history, state.patches};
      is_enough = false;
      const auto bound = compare<Dim>(judged, scratch.star, edit, options.required, noise_fraction, kBoundIterations,
                                      kBoundContactIterations, scratch, [&](auto&) { is_enough = true; });
      note(bound, Refusal::bound);
      const bool surface_touches = bound.touches_contact && !edit.inserted_facets.empty();
      const double factor = surface_touches ? kPatchOverVertexInContact<Dim> : options.patch_over_vertex;
      required = bound.required;
      const double noise = required - options.required;
      if (at_most(bound.gain, factor) < required + noise) return;  // patches multiply noise less than what they resolve
    }
  }
  select_patch<Dim>(state.mesh, edit, options.local, scratch.patch, verdict.patch);
  if (is_enough) {
    LocalProblem<Dim> after(state, verdict.patch, edit, true, scratch);
    verdict.touches_contact = after.touches_contact();
    verdict.surface_read.include(after.surface_read());
    verdict.refusal = finish(after);
    return;
  }
  std::optional<Refusal> finished;
  const auto found =
      compare<Dim>(state, verdict.patch, edit, required, 0, options.local.max_iterations,
                   options.local.max_contact_iterations, scratch, [&](auto& after) { finished = finish(after); });
  note(found, finished.value_or(found.has_unknowns ? Refusal::energy : Refusal::no_unknowns));
  verdict.was_relaxed = true;
}

#define ITR_INSTANTIATE(Dim)                                                                                     \
  template double gain_of_vertex<Dim>(const RemeshState<Dim>&, const Edit<Dim>&, LocalScratch<Dim>&, Box<Dim>*); \
  template void preview<Dim>(const RemeshState<Dim>&, const Gate<Dim>&, const Edit<Dim>&, const TrialOptions&,   \
                             LocalScratch<Dim>&, Verdict<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
