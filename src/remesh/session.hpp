// SPDX-License-Identifier: MIT
// What all operations of one call of the remesher share: the mesh with its fields, the gate, memories, and the one way in
// which an edit is tried and committed.
#pragma once

#include <atomic>
#include <deque>
#include <limits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "itr/core/parallel.hpp"
#include "itr/mesh/strata.hpp"
#include "itr/remesh/remesher.hpp"
#include "prediction.hpp"
#include "queue.hpp"
#include "ranking.hpp"
#include "refusals.hpp"
#include "trial.hpp"

namespace itr {

/// Whether predictions may leave out trials.
inline bool screens(const RemeshOptions& options) { return options.screening != Screening::none; }
/// Gain [J] below which a swap or a move only stirs the mesh: a small share of what a split has to gain.
inline double least_worthwhile(const RemeshOptions& options) {
  return screens(options) ? 0.05 * options.split.acceptance_tolerance.value() : 0;
}

/// What was found about a candidate on the mesh as it was when its wave began.
template <int Dim>
struct Trial {
  EdgeQueue::Entry candidate;
  std::optional<Edit<Dim>> edit{};
  double signal = 0;  ///< see RemeshMemory
  bool in_contact = false;
  bool is_asked = false;  ///< a refusal is to be remembered
  bool was_previewed = false;
  bool is_bound_by_dhat = false;  ///< see RemeshReport
  Box<Dim> surface_read{};        ///< of the present one
  double seconds = 0;             ///< of the preview
  Verdict<Dim> verdict{};

  const EdgeKey& edge() const { return candidate.edge; }
  /// As before it was looked at; the memory of lists stays.
  void clear() {
    verdict.clear();
    *this = Trial{.candidate = candidate, .verdict = std::move(verdict)};
  }
};

/// All operations of one call share it. What is const may be called by several threads, each with a scratch of its own.
template <int Dim>
class RemeshSession {
 public:
  RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context, const RemeshOptions& options,
                const RemeshMemory& memory, Strata<Dim>& strata);

  const Mesh<Dim>& mesh() const { return mesh_; }
  const RemeshFields<Dim>& fields() const { return fields_; }
  const StepContext<Dim>& context() const { return context_; }
  const Strata<Dim>& strata() const { return strata_; }
  const RemeshOptions& options() const { return options_; }
  RemeshReport& report() { return report_; }
  bool has_contact() const { return context_.contact.enabled; }
  bool is_cancelled() const { return context_.newton.is_cancelled(); }

  double rest_length(const EdgeKey& e) const { return (mesh_.rest(e[0]) - mesh_.rest(e[1])).norm(); }
  double length(const EdgeKey& e) const {
    return (fields_.x.template segment<Dim>(Dim * e[0]) - fields_.x.template segment<Dim>(Dim * e[1])).norm();
  }
  bool exists(const EdgeKey& e) const {  ///< also of a vertex {v, kNone}
    if (e[1] == kNone) return mesh_.is_vertex_alive(e[0]);
    return mesh_.is_vertex_alive(e[0]) && mesh_.is_vertex_alive(e[1]) && mesh_.are_joined(e[0], e[1]);
  }
  bool is_surface(const EdgeKey& e) const;
  /// Whether an edge is there and as long as it has to be for a split; if not, whether because of the activation distance.
  bool may_be_split(const EdgeKey& e, bool& is_bound_by_dhat) const;
  /// Whether an edge is there, straight, and may be curved: the surface stays straight where contact is enabled, and cells
  /// that coarsening has made in this step stay straight until the history is projected onto them.
  bool may_be_curved(const EdgeKey& e) const;
  /// Whether an edge is there and short enough for a collapse.
  bool may_be_collapsed(const EdgeKey& e) const;
  /// Whether contact acts on the surface at an edge of it, so that the bulk terms alone do not tell what an edit gains.
  bool is_in_contact(const EdgeKey& e, LocalScratch<Dim>& scratch) const;
  /// The same of a trial's edge.
  void find_contact(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const;

  /// Generations of an edge in this pass.
  int depth(const EdgeKey& edge) const {
    const auto it = depth_.find(edge);
    return it == depth_.end() ? 0 : it->second;
  }
  void set_depth(const EdgeKey& edge, int generation) { depth_[edge] = generation; }
  void forget_depths() { depth_.clear(); }

  /// How much the deformation and the history vary over the cells around an edge (a vertex {v, kNone}). No edit gains or
  /// loses energy where both are linear. [J, times the scaling, up to a factor]
  double roughness(const EdgeKey& edge) const;
  /// Whether the same edit was refused before and its signal is still in the refusal's range. Only with screening by bounds.
  bool was_refused(RemeshMemory::Kind kind, const EdgeKey& edge, double signal, bool in_contact) const {
    return options_.screening == Screening::bounds && refusals_.holds(kind, edge, signal, in_contact);
  }
  void remember(RemeshMemory::Kind kind, const EdgeKey& edge, const RemeshMemory::Refusal& refusal) {
    if (options_.screening == Screening::bounds) refusals_.add(kind, edge, refusal);
  }
  RemeshMemory memory() const { return refusals_.remembered(mesh_); }

  /// Whether predictions may leave out trials.
  bool screens() const { return itr::screens(options_); }
  double least_worthwhile() const { return itr::least_worthwhile(options_); }
  /// Marks the places of all commits so far as gains: cells there may be badly shaped.
  void mark_gains();
  /// Whether badly shaped cells at an edge (a vertex {v, kNone}) do harm. They do where the fields vary enough, where an
  /// edit nearby gained energy, and where a shape is so bad that rules only allow it to improve. Elsewhere swaps and moves
  /// for better shapes would be wasted work.
  bool shape_matters(const EdgeKey& e, double roughness) const;
  /// See prediction.hpp.
  double predict(const Edit<Dim>& edit) const { return predict_gain<Dim>(state(), edit); }
  double predict_split(const EdgeKey& edge, LocalScratch<Dim>& scratch) const;
  double predict_curve(const EdgeKey& edge, LocalScratch<Dim>& scratch) const;
  /// Energy of a cell, which need not be in the mesh, at present positions. [J, times the scaling]
  double energy_of(const typename MeshTypes<Dim>::Cell& cell, int body) const {
    return cell_energy<Dim>(state(), cell, body);
  }
  /// Whether the prediction of an edit of these cells tells that its patch cannot gain the tolerance [J] either.
  bool is_hopeless(std::span<const CellId> cells, double predicted, double tolerance) const {
    return screens() &&
           at_most(predicted, patch_over_vertex<Dim>(largest_poisson_ratio(cells))) < context_.scaling * tolerance;
  }
  bool is_hopeless(const Edit<Dim>& edit, double predicted, double tolerance) const {
    return is_hopeless(edit.removed_cells, predicted, tolerance);
  }

  /// Threads that look at candidates at the same time.
  int num_lanes() const { return static_cast<int>(lanes_.size()); }
  /// Calls f(i, scratch) for all i below n, on all of them.
  template <typename F>
  void for_each(std::size_t n, const F& f) {
    std::atomic<std::size_t> next = 0;
    parallel_blocks(std::min(n, lanes_.size()), 1, [&](std::size_t lane, std::size_t) {
      for (std::size_t i = next++; i < n; i = next++) f(i, lanes_[lane]);
    });
  }

  /// Whether bulk terms at an entry's edge are as they were when it was stamped.
  bool is_unchanged(const EdgeQueue::Entry& entry) const { return !changed_after(entry.edge, entry.since); }
  EdgeQueue::Entry stamped(EdgeQueue::Entry entry) const {
    entry.since = commits_;
    return entry;
  }

  /// Decides about the edit of a trial that has to gain `tolerance` [J].
  void judge(Trial<Dim>& trial, const Vec<Dim>& center, double tolerance, const LocalRelaxationOptions& local,
             LocalScratch<Dim>& scratch) const;
  /// Begins a wave: the next two functions answer for commits after this call.
  void begin_wave();
  /// Whether a commit of this wave replaced cells at an edge (a vertex {v, kNone}) or moved their vertices. All trials of
  /// the edge depend on these.
  bool has_changed_around(const EdgeKey& e) const { return changed_after(e, commits_before_wave_); }
  /// Whether something else that a trial of the wave read has changed.
  bool was_overtaken(const Trial<Dim>& trial) const;
  /// Counts a judged trial, and commits it where it was accepted; the verdict's patch then has the new cells too. Returns
  /// whether it did.
  bool commit(Trial<Dim>& trial, OperationCount& count);

  /// Commits an edit without relaxing, if the gate lets it pass. Returns whether it did.
  bool apply_if_valid(const Edit<Dim>& edit);

  /// Facets and obstacles at present nearer than dhat to a facet of the surface, each also as it is at rest.
  struct PieceInContact {
    SurfacePiece<Dim> now, rest;
  };
  std::vector<PieceInContact> pieces_in_contact(FacetId f, LocalScratch<Dim>& scratch) const;
  /// A facet, now and at rest.
  PieceInContact piece(FacetId f) const;

  /// Edges of those cells that are alive, ascending.
  std::vector<EdgeKey> edges_of(std::span<const CellId> cells) const;
  double median_trial_seconds();
  /// For calls from the thread that owns this.
  LocalScratch<Dim>& scratch() { return lanes_.front(); }

 private:
  RemeshState<Dim> state() const { return {mesh_, fields_, context_, gate_.present(), options_.history}; }
  void commit(const Edit<Dim>& edit, Verdict<Dim>& verdict);
  void mark_written(VertexId v);
  bool changed_after(const EdgeKey& e, unsigned commit) const {
    return changed_at_[e[0]] > commit || (e[1] != kNone && changed_at_[e[1]] > commit);
  }
  double largest_poisson_ratio(std::span<const CellId> cells) const;

  Mesh<Dim>& mesh_;
  RemeshFields<Dim>& fields_;
  const StepContext<Dim>& context_;
  const RemeshOptions& options_;
  double total_volume_;
  Gate<Dim> gate_;
  Strata<Dim>& strata_;
  std::deque<LocalScratch<Dim>> lanes_;
  Refusals refusals_;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> depth_;
  RemeshReport report_;
  std::vector<double> trial_seconds_;
  unsigned commits_ = 0, commits_before_wave_ = 0;
  CellId first_coarsened_ = std::numeric_limits<CellId>::max();  ///< cells from here on were made after the first coarsening
  Marks gained_;                                                 ///< vertices of cells that splits and collapses changed
  std::vector<unsigned> changed_at_;       ///< by vertex: the last commit that changed a cell around it or a vertex of one
  Marks written_;                          ///< vertices that commits of the wave moved or gave other cells
  std::vector<Box<Dim>> surface_written_;  ///< by the same, in the present configuration
};

/// Change of a signal by which a refusal no longer holds.
inline constexpr double kSameSignal = 1.2;

/// The operations, one file each; splits and curves share one queue. They count what they do in session.report(). `ranks`
/// (of the paper's culling; empty where it is not asked for) are inherited by the edges that splits make.
template <int Dim>
void refine_edges(RemeshSession<Dim>& session, EdgeRanks& ranks);
template <int Dim>
void collapse_edges(RemeshSession<Dim>& session, const EdgeRanks& ranks);
/// In 3D: edges are removed such that the energy of the new cells is least, then facets (2-3 swaps).
void swap_edges(RemeshSession<2>& session);
void swap_edges(RemeshSession<3>& session);
template <int Dim>
void smooth_vertices(RemeshSession<Dim>& session);
/// The baseline: splits and collapses by a sizing field instead of energies.
template <int Dim>
void follow_sizing_field(RemeshSession<Dim>& session);

}  // namespace itr
