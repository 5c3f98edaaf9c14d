// SPDX-License-Identifier: MIT
// State that all operations of one call of the remesher share: queries, memory and the one way in which edits get into the
// mesh.
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <unordered_map>
#include <vector>

#include "change_log.hpp"
#include "core/parallel.hpp"
#include "core/profile.hpp"
#include "mesh/strata.hpp"
#include "remesh/decide/queries.hpp"
#include "remesh/memory.hpp"
#include "remesh/paper/baseline.hpp"
#include "remesh/remesher.hpp"
#include "remesh/report.hpp"

namespace itr {

/// Collapses or swaps of one edge a step.
inline constexpr int kMostGenerations = 3;

/// Change of a refusal key by which a refusal no longer holds.
inline constexpr double kSameKey = 1.2;

/// Memory of operations during one call of the remesher; refusals also from step to step.
template <int Dim>
class SessionMemory {
 public:
  /// `remembers`: refusals.
  SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log);
  /// Forgets refusals at the edges and facets of new cells.
  void follow(const Mesh<Dim>& mesh, const Change<Dim>& change);
  /// Refusals of candidates that are still there.
  std::vector<RemeshMemory::Entry> remembered(const RemeshQueries<Dim>& queries) const;

  /// Whether the candidate was refused before and its refusal key is still in the refusal's range.
  bool was_refused(const Candidate& candidate, double key, bool in_contact) const {
    if (!remembers_) return false;
    const auto it = refused_.find(candidate);
    return it != refused_.end() && it->second.holds(key, in_contact);
  }
  void remember(const Candidate& candidate, const RemeshMemory::KeyRange& range) {
    if (remembers_) refused_[candidate] = range;
  }

  /// Generations of an edge in this pass.
  int depth(const EdgeKey& edge) const {
    const auto it = depth_.find(edge);
    return it == depth_.end() ? 0 : it->second;
  }
  void set_depth(const EdgeKey& edge, int generation) { depth_[edge] = generation; }
  void forget_depths() { depth_.clear(); }

  /// Marks the surroundings of all commits so far as gains: cells there may be badly shaped.
  void mark_gains() { gains_until_ = log_.now(); }
  bool was_gain(const Candidate& candidate) const { return log_.had_changed_around(candidate, gains_until_); }

 private:
  const ChangeLog<Dim>& log_;
  bool remembers_;
  std::unordered_map<Candidate, RemeshMemory::KeyRange, Candidate::Hash> refused_;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> depth_;
  unsigned gains_until_ = 0;
};

template <int Dim>
class RemeshSession {
 public:
  RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context, const RemeshOptions& options,
                std::unique_ptr<Baseline<Dim>> baseline, RemeshMemory& memory, Strata<Dim>& strata);
  RemeshSession(const RemeshSession&) = delete;
  RemeshSession& operator=(const RemeshSession&) = delete;

  const RemeshQueries<Dim>& queries() const { return queries_; }
  SessionMemory<Dim>& memory() { return memory_; }
  ChangeLog<Dim>& log() { return log_; }
  const Gate<Dim>& gate() const { return gate_; }
  /// Null where options choose none.
  Baseline<Dim>* baseline() { return baseline_.get(); }
  const Baseline<Dim>* baseline() const { return baseline_.get(); }
  RemeshReport& report() { return report_; }
  std::vector<double>& trial_seconds() { return trial_seconds_; }
  /// Commits an edit without relaxing, if the gate lets it pass. Returns whether it did, and counts it.
  bool commit_unjudged(const Edit<Dim>& edit, OperationCount& count);
  /// Ends the fields behind the mesh's vertices, stores the refusals and returns the report.
  RemeshReport finish();

  /// Whether badly shaped cells at an edge or a vertex do harm. They do where the fields vary enough, where an
  /// edit nearby gained energy, and where a shape is so bad that rules only allow it to improve. Elsewhere swaps and moves
  /// for better shapes would be wasted work.
  bool shape_matters(const Candidate& candidate, double roughness) const;
  /// Threads that evaluate candidates at the same time.
  int num_lanes() const { return static_cast<int>(lanes_.size()); }
  /// Calls f(i, scratch) for all i below n, on all of them.
  template <typename F>
  void for_each(std::size_t n, const F& f) {
    std::atomic<std::size_t> next = 0;
    const auto phase = ScopedPhase::coarse("local trials");
    LoopTimer timer;
    parallel_blocks(std::min(n, lanes_.size()), 1, [&](std::size_t lane, std::size_t) {
      for (std::size_t i = next++; i < n; i = next++) timer.run([&] { f(i, lanes_[lane]); });
    });
  }
  /// For calls from the thread that owns this.
  LocalScratch<Dim>& scratch() { return lanes_.front(); }

 private:
  void carry_patches(const Mesh<Dim>& mesh);

  std::unique_ptr<Baseline<Dim>> baseline_;
  RemeshFields<Dim>& fields_;
  RemeshMemory& stored_;
  Gate<Dim> gate_;
  ChangeLog<Dim> log_;
  std::unique_ptr<CarriedPatches<Dim>> patches_;              ///< null: no body averages its volume
  std::vector<typename CarriedPatches<Dim>::Shares> shares_;  ///< in the cells of the edit that is committed
  RemeshQueries<Dim> queries_;
  SessionMemory<Dim> memory_;
  std::deque<LocalScratch<Dim>> lanes_;
  RemeshReport report_;
  std::vector<double> trial_seconds_;
};

/// The operations, by their queues. They count what they do in session.report().
template <int Dim>
void refine_edges(RemeshSession<Dim>& session);
template <int Dim>
void coarsen_edges(RemeshSession<Dim>& session);
/// In 3D: edges are removed such that the energy of the new cells is least, then facets (2-3 swaps).
void swap_edges(RemeshSession<2>& session);
void swap_edges(RemeshSession<3>& session);
template <int Dim>
void smooth_vertices(RemeshSession<Dim>& session);
/// The baseline: splits and collapses by a sizing field instead of energies.
template <int Dim>
void follow_sizing_field(RemeshSession<Dim>& session);

}  // namespace itr
