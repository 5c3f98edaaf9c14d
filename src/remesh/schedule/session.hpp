// SPDX-License-Identifier: MIT
// State that all operations of one call of the remesher share: queries, memory, committer.
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <vector>

#include "committer.hpp"
#include "itr/core/parallel.hpp"
#include "itr/mesh/strata.hpp"
#include "itr/remesh/remesher.hpp"
#include "remesh/paper/baseline.hpp"
#include "remesh/decide/queries.hpp"
#include "session_memory.hpp"

namespace itr {

template <int Dim>
class RemeshSession {
 public:
  RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context, const RemeshOptions& options,
                std::unique_ptr<Baseline<Dim>> baseline, const RemeshMemory& memory, Strata<Dim>& strata);
  RemeshSession(const RemeshSession&) = delete;
  RemeshSession& operator=(const RemeshSession&) = delete;

  const RemeshQueries<Dim>& ask() const { return ask_; }
  SessionMemory<Dim>& memory() { return memory_; }
  const SessionMemory<Dim>& memory() const { return memory_; }
  Committer<Dim>& commits() { return commits_; }
  /// Null where options choose none.
  Baseline<Dim>* baseline() { return baseline_.get(); }
  const Baseline<Dim>* baseline() const { return baseline_.get(); }
  RemeshReport& report() { return report_; }

  /// Whether badly shaped cells at an edge or a vertex do harm. They do where the fields vary enough, where an
  /// edit nearby gained energy, and where a shape is so bad that rules only allow it to improve. Elsewhere swaps and moves
  /// for better shapes would be wasted work.
  bool shape_matters(const Place& place, double roughness) const;
  /// Whether bulk terms at an entry's place are as they were when it was stamped.
  bool is_unchanged(const PlaceQueue::Entry& entry) const { return !log_.has_changed_around(entry.place, entry.since); }
  PlaceQueue::Entry stamped(PlaceQueue::Entry entry) const {
    entry.since = log_.now();
    return entry;
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
  /// For calls from the thread that owns this.
  LocalScratch<Dim>& scratch() { return lanes_.front(); }

 private:
  std::unique_ptr<Baseline<Dim>> baseline_;
  Gate<Dim> gate_;
  ChangeLog<Dim> log_;
  RemeshQueries<Dim> ask_;
  SessionMemory<Dim> memory_;
  Committer<Dim> commits_;
  std::deque<LocalScratch<Dim>> lanes_;
  RemeshReport report_;
};

/// The operations, one file each; splits and curves share one queue, and so do collapses and straightenings. They count what
/// they do in session.report().
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
