// SPDX-License-Identifier: MIT
// Queries of operations about the mesh, the fields and the energy of the step, as they are now. Nothing here changes
// anything: several threads may ask, each with a scratch of its own.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "prediction.hpp"
#include "remesh/paper/baseline.hpp"
#include "trial.hpp"

namespace itr {

/// How far a curved edge that touches may leave its chords, in dhat.
inline constexpr double kMostOverhang = 0.25;

/// Edges of those cells that are alive, ascending.
template <int Dim>
std::vector<EdgeKey> edges_of(const Mesh<Dim>& mesh, std::span<const CellId> cells);

template <int Dim>
class RemeshQueries {
 public:
  RemeshQueries(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                const RemeshOptions& options, const Strata<Dim>& strata, const Gate<Dim>& gate,
                const Baseline<Dim>* baseline, const CarriedPatches<Dim>* patches)
      : mesh_(mesh),
        fields_(fields),
        context_(context),
        options_(options),
        strata_(strata),
        gate_(gate),
        baseline_(baseline),
        patches_(patches) {}

  const Mesh<Dim>& mesh() const { return mesh_; }
  const RemeshFields<Dim>& fields() const { return fields_; }
  /// Null where no body averages its volume.
  const CarriedPatches<Dim>* patches() const { return patches_; }
  const StepContext<Dim>& context() const { return context_; }
  const Strata<Dim>& strata() const { return strata_; }
  const RemeshOptions& options() const { return options_; }
  const SurfaceIndex<Dim>& surface() const { return gate_.present(); }
  bool has_contact() const { return context_.contact.enabled; }
  bool is_cancelled() const { return context_.newton.is_cancelled(); }

  double rest_length(const EdgeKey& e) const { return (mesh_.rest(e[0]) - mesh_.rest(e[1])).norm(); }
  bool exists(const Candidate& candidate) const;
  bool is_surface(const EdgeKey& e) const {
    return any_facet_at(e, [](FacetId) { return true; });
  }
  /// Returns why an edge, by its lengths, cannot be split or may not collapse.
  Refusal refuse_split(const EdgeKey& e) const;
  Refusal refuse_collapse(const EdgeKey& e) const;
  /// Returns why an edge cannot be curved, as far as its cells and lengths tell.
  Refusal refuse_curve(const EdgeKey& e) const;
  /// Whether a curve of a surface edge would be in reach of something else.
  bool may_touch(const EdgeKey& e, LocalScratch<Dim>& scratch) const {
    return has_contact() && is_surface(e) && touches_within(e, reach(e), scratch);
  }
  /// Why a curved edge cannot be replaced by its chords.
  Refusal refuse_chords(const EdgeKey& e) const;
  /// How far a curved edge of the surface leaves its chords [m]; 0 where it is straight or nothing can touch it.
  double overhang(const EdgeKey& e) const;
  /// Whether that is too much for what is near.
  bool overhangs(const EdgeKey& e, LocalScratch<Dim>& scratch) const;
  /// Whether one of these cells is curved and distorted.
  bool is_distorted(std::span<const CellId> cells) const;
  /// Whether contact acts on the surface at an edge, so that the bulk terms alone do not tell what an edit gains.
  bool is_in_contact(const Candidate& candidate, LocalScratch<Dim>& scratch) const {
    return has_contact() && candidate.is_edge() && touches_within(candidate.edge(), context_.contact.dhat, scratch);
  }
  /// Finds out whether a trial is in contact, and notes that the surface around its edge was read.
  void find_contact(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const;
  /// Returns how much the deformation and the history vary over the cells around a candidate. No edit gains or loses energy
  /// where both are linear. [J, times the scaling, up to a factor]
  double roughness(const Candidate& candidate) const;

  /// Gain [J] below which a swap or a move only stirs the mesh: a small fraction of what a split has to gain.
  double least_worthwhile() const { return 0.05 * options_.split.acceptance_tolerance.value(); }
  /// See prediction.hpp.
  double predict(const Edit<Dim>& edit) const { return predict_gain<Dim>(state(), edit); }
  /// `surface_read`, unless null, grows by what was read of the surface: what was evaluated beside edits that move it there
  /// is evaluated again.
  double predict_split(const EdgeKey& edge, LocalScratch<Dim>& scratch, Box<Dim>* surface_read = nullptr) const;
  double predict_curve(const EdgeKey& edge, LocalScratch<Dim>& scratch, Box<Dim>* surface_read = nullptr) const;
  double predict_straighten(const EdgeKey& edge, LocalScratch<Dim>& scratch, Box<Dim>* surface_read = nullptr) const;
  /// At curved edges by what the vertex and the nodes that it sets gain together, history included.
  /// Without the history where it is hopeless, for the tolerance [J], without.
  double predict_collapse(const Edit<Dim>& edit, double tolerance, LocalScratch<Dim>& scratch,
                          Box<Dim>* surface_read = nullptr) const;
  bool any_is_curved(std::span<const CellId> cells) const {
    return std::any_of(cells.begin(), cells.end(), [&](CellId c) { return mesh_.is_curved(c); });
  }
  /// Energy of a cell, which need not be in the mesh, on the nodes of an edit at present positions. [J, times the scaling]
  double energy_of(const typename MeshTypes<Dim>::Cell& cell, int body, const Edit<Dim>& edit) const {
    return cell_energy<Dim>(state(), cell, body, edit);
  }
  /// Whether the prediction of an edit tells that a patch, which gains at most `factor` as much, cannot gain the tolerance
  /// [J] either.
  bool is_hopeless(double predicted, double factor, double tolerance) const {
    return at_most(predicted, factor) < context_.scaling * tolerance;
  }
  /// Factors of prediction.hpp for a trial.
  double patch_over_vertex(const Trial<Dim>& trial) const {
    return itr::patch_over_vertex<Dim>(largest_poisson_ratio(cells_of(trial)));
  }
  /// Factor of a split or a curve. In contact trials tell, since the prediction knows nothing of it; but where edges are
  /// curved far too little can be promised even there.
  std::optional<double> patch_over_refinement(const Trial<Dim>& trial) const;
  /// Decides about the edit of a trial.
  void judge(Trial<Dim>& trial, const LocalRelaxationOptions& local, LocalScratch<Dim>& scratch) const;

 private:
  template <typename Condition>
  bool any_facet_at(const EdgeKey& e, const Condition& holds) const {
    const auto facets = mesh_.facets_of(e[0]);
    return std::any_of(facets.begin(), facets.end(), [&](FacetId f) {
      return std::find(mesh_.facet(f).begin(), mesh_.facet(f).end(), e[1]) != mesh_.facet(f).end() && holds(f);
    });
  }
  /// Whether the surface at an edge is nearer than this distance to something else.
  bool touches_within(const EdgeKey& e, double distance, LocalScratch<Dim>& scratch) const;
  /// How near the surface at an edge comes within a step to what stands still [m].
  double reach(const EdgeKey& e) const;
  /// Whether halves of an edge would be shorter than dhat, at rest or now.
  bool has_short_halves(const EdgeKey& e) const;
  /// Tells whether the chords that the split of an edge would bring to the surface beside those halves are shorter than
  /// dhat.
  bool makes_short_chords(const EdgeKey& e) const;
  RemeshState<Dim> state(HistoryRule history = HistoryRule::function) const {
    return {mesh_, fields_, context_, gate_.present(), history, patches_};
  }
  double largest_poisson_ratio(std::span<const CellId> cells) const;
  /// Cells that a trial's edit replaces, or that it will.
  std::vector<CellId> cells_of(const Trial<Dim>& trial) const {
    return trial.edit ? trial.edit->removed_cells : mesh_.cells_of_edge(trial.edge());
  }

  const Mesh<Dim>& mesh_;
  const RemeshFields<Dim>& fields_;
  const StepContext<Dim>& context_;
  const RemeshOptions& options_;
  const Strata<Dim>& strata_;
  const Gate<Dim>& gate_;
  const Baseline<Dim>* baseline_;       ///< or null
  const CarriedPatches<Dim>* patches_;  ///< or null
};

}  // namespace itr
