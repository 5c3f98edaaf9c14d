// SPDX-License-Identifier: MIT
// Saved states, from which a run goes on with the same bits as if it had never stopped. They are frames with a group more.
#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "itr/simulation/simulation.hpp"

namespace itr::output {

/// The newest saved state of a folder, and what it belongs to.
struct SavedState {
  std::filesystem::path file;
  std::string scene;    ///< RunInfo::scene_identity of the run that saved it
  std::string backend;  ///< solver of that run
  int dim = 0;
  int step = 0;
  Units units{};                           ///< of that run's results
  std::vector<std::string> passed_over{};  ///< what is wrong with newer ones, a sentence each
};

/// The newest state in DIR/frames, of a step before `before`, that can be read; none where there are no frames. Throws
/// InputError where there are frames but none of them has a state that can be read (another version wrote them, or they are
/// damaged). Its arrays are read by read_checkpoint, which may find damage still.
std::optional<SavedState> find_saved_state(const std::filesystem::path& directory,
                                           int before = std::numeric_limits<int>::max());

template <int Dim>
struct Checkpoint {
  State<Dim> state;
  std::string totals;         ///< of the output so far, JSON text
  std::size_t log_bytes = 0;  ///< length of steps.jsonl then
};

/// Throws InputError where the file is unreadable, inconsistent, or not as it was written.
template <int Dim>
Checkpoint<Dim> read_checkpoint(const SavedState& saved);

}  // namespace itr::output
