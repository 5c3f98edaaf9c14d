// SPDX-License-Identifier: MIT
// The one way in which an edit gets into the mesh, and what a wave has to know about earlier commits.
#pragma once

#include <vector>

#include "change_log.hpp"
#include "itr/remesh/report.hpp"
#include "remesh/decide/trial.hpp"

namespace itr {

template <int Dim>
class Committer {
 public:
  Committer(const Mesh<Dim>& mesh, const Gate<Dim>& gate, ChangeLog<Dim>& log) : mesh_(mesh), gate_(gate), log_(log) {}

  /// Begins a wave: the next two functions answer for commits after this call.
  void begin_wave() { wave_began_ = log_.now(); }
  /// Whether a commit of this wave replaced cells at an edge or a vertex, or moved their vertices. All trials of
  /// the place depend on these.
  bool has_changed_around(const Place& place) const { return log_.has_changed_around(place, wave_began_); }
  /// Whether something else that a trial of the wave read has changed.
  bool was_overtaken(const Trial<Dim>& trial) const;
  /// Counts a judged trial, and commits it where it was accepted; the verdict's patch then has the new cells too. Returns
  /// whether it did.
  bool commit(Trial<Dim>& trial, OperationCount& count);
  /// Commits an edit without relaxing, if the gate lets it pass. Returns whether it did, and counts it.
  bool commit_unjudged(const Edit<Dim>& edit, GateScratch<Dim>& scratch, OperationCount& count);

  double median_trial_seconds();

 private:
  const Mesh<Dim>& mesh_;
  const Gate<Dim>& gate_;
  ChangeLog<Dim>& log_;
  unsigned wave_began_ = 0;
  std::vector<double> trial_seconds_;
};

}  // namespace itr
