// SPDX-License-Identifier: MIT
// Whether an edit lowers the energy by enough: previewed on a const mesh, so that nothing has to be taken back.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "local_problem.hpp"
#include "remesh/contact/gate.hpp"
#include "remesh/edits.hpp"
#include "remesh/schedule/queue.hpp"

namespace itr {

/// Result of a preview, and the edit to commit.
template <int Dim>
struct Verdict {
  Refusal refusal = Refusal::not_asked;
  bool was_relaxed = false;  ///< whether it took the relaxation of a patch to decide
  double gain = 0;           ///< decrease of the energy that was found [J, times the scaling]; negative: increase
  double required = 0;       ///< what it had to be
  bool touches_contact = false;
  Box<Dim> surface_read{};      ///< holds what was read of the surface as it is now, beside the patch's own vertices
  std::vector<CellId> patch{};  ///< that was read, where the star of the edit did not do
  std::vector<typename LocalProblem<Dim>::Position> positions{};  ///< where accepted
  bool accepted() const { return refusal == Refusal::none; }
  /// Back to none; the memory of lists stays.
  void clear() {
    patch.clear();
    positions.clear();
    *this = Verdict{.patch = std::move(patch), .positions = std::move(positions)};
  }
};

/// Findings about a candidate on the mesh as it was when its batch began.
template <int Dim>
struct Trial {
  CandidateQueue::Entry entry;
  std::optional<Edit<Dim>> edit{};
  double key = 0;        ///< of a refusal, see RemeshMemory
  double gain = 0;       ///< predicted [J, times the scaling]
  double tolerance = 0;  ///< least gain [J]
  bool in_contact = false;
  bool was_previewed = false;
  Box<Dim> surface_read{};  ///< of the present one
  double seconds = 0;       ///< of the preview
  Verdict<Dim> verdict{};

  const Candidate& candidate() const { return entry.candidate; }
  EdgeKey edge() const { return entry.candidate.edge(); }
  void refuse(Refusal reason) { verdict.refusal = reason; }
  /// Takes the edit of a proposal, or the reason why there is none. Returns whether there is one.
  bool take(Proposal<Dim> proposal) {
    edit = std::move(proposal.edit);
    if (!edit) refuse(proposal.refusal);
    return edit.has_value();
  }
  /// As before it was evaluated; the memory of lists stays.
  void clear() {
    verdict.clear();
    *this = Trial{.entry = entry, .verdict = std::move(verdict)};
  }
};

struct TrialOptions {
  double required = 0;                ///< least gain [J, times the scaling]
  double patch_over_vertex = 0;       ///< see prediction.hpp; 0: bounds decide nothing
  std::optional<double> predicted{};  ///< gain of the vertex and nodes that the edit sets, where it is as good as the bound
  double least_volume = 0;            ///< of the patch at rest [m^Dim]
  LocalRelaxationOptions local;
};

/// Computes the decrease of the energy by the edit (theory.md, "The rules", rules a-d; paper eq. 11). Both sides have one
/// support and get the same number of Newton iterations. First the cells of the edit alone relax, where hardly more than the
/// vertex that the edit sets is free. Their gain is real, so it may accept the edit; if even `patch_over_vertex` times this
/// gain is too little, it refuses. A trial on a patch decides the rest. Once scratch and verdict have served for similar
/// edits, only the history that an edit forgets, damping, pressure and terms of the program allocate memory.
template <int Dim>
void preview(const RemeshState<Dim>& state, const Gate<Dim>& gate, const Edit<Dim>& edit, const TrialOptions& options,
             LocalScratch<Dim>& scratch, Verdict<Dim>& verdict);

/// Returns only the lower bound: the gain of the edit if the only vertices that move have all their cells among the edit's
/// own or around the vertex that it sets. `surface_read`, unless null, grows by what was read of the surface.
/// [J, times the scaling]
template <int Dim>
double gain_of_vertex(const RemeshState<Dim>& state, const Edit<Dim>& edit, LocalScratch<Dim>& scratch,
                      Box<Dim>* surface_read = nullptr);

}  // namespace itr
