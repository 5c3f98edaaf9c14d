// SPDX-License-Identifier: MIT
// Whether an edit lowers the energy by enough: previewed on a const mesh, so that nothing has to be taken back.
#pragma once

#include <utility>
#include <vector>

#include "gate.hpp"
#include "local_problem.hpp"

namespace itr {

enum class Decision : char {
  accepted,
  by_gate,     ///< some stored configuration would be invalid
  by_bound,    ///< the energy cannot fall by enough: the new vertex alone tells
  by_energy,   ///< a relaxed patch does not gain enough
  no_unknowns  ///< nothing of the patch is free
};

/// What a preview found, and what there is to commit.
template <int Dim>
struct Verdict {
  Decision decision = Decision::by_gate;
  bool was_relaxed = false;  ///< whether it took the relaxation of a patch to decide
  double gain = 0;           ///< decrease of the energy that was found [J, times the scaling]; negative: increase
  bool touches_contact = false;
  Box<Dim> surface_read{};      ///< holds what was read of the surface as it is now, beside the patch's own vertices
  std::vector<CellId> patch{};  ///< that was read, where the star of the edit did not do
  std::vector<typename LocalProblem<Dim>::Position> positions{};  ///< where accepted
  bool accepted() const { return decision == Decision::accepted; }
  /// Back to none; the memory of lists stays.
  void clear() {
    patch.clear();
    positions.clear();
    *this = Verdict{.patch = std::move(patch), .positions = std::move(positions)};
  }
};

struct TrialOptions {
  double required = 0;           ///< least gain [J, times the scaling]
  double patch_over_vertex = 0;  ///< see prediction.hpp; 0: bounds decide nothing
  LocalRelaxationOptions local;
};

/// Computes the decrease of the energy by the edit (REMESHING.md, "The rules", rules a-d; paper eq. 11). Both sides have one
/// support and get the same number of Newton iterations. First the cells of the edit alone relax, where hardly more than the
/// vertex that the edit sets is free. Their gain is real, so it may accept the edit; if even `patch_over_vertex` times this
/// gain is too little, it refuses. A trial on a patch decides the rest. Once scratch and verdict have served for similar
/// edits, only the history that an edit forgets, damping, pressure and terms of the program allocate memory.
template <int Dim>
void preview(const RemeshState<Dim>& state, const Gate<Dim>& gate, const Edit<Dim>& edit, const Vec<Dim>& center,
             double total_volume, const TrialOptions& options, LocalScratch<Dim>& scratch, Verdict<Dim>& verdict);

/// Returns only the lower bound: the gain of the edit if the only vertices that move have all their cells among the edit's
/// own or around the vertex that it sets. [J, times the scaling]
template <int Dim>
double gain_of_vertex(const RemeshState<Dim>& state, const Edit<Dim>& edit, LocalScratch<Dim>& scratch);

}  // namespace itr
