// SPDX-License-Identifier: MIT
// The part of a frame from which a run goes on with the same bits (docs/theory.md, "Output"): group /checkpoint beside
// /mesh.
#pragma once

#include <string_view>

#include "core/hdf5.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"

namespace itr::output {

/// Counts and texts of a run when it saves a state.
struct Progress {
  std::string_view scene, backend;  ///< what a resumed run has to have in common with the saved one
  std::string_view totals;          ///< of Totals::save
  std::size_t log_bytes;            ///< length of steps.jsonl, the line of this step included
};

/// Adds to a frame that has /mesh of `state` already. All is in SI units, so where `units` are others rest positions and
/// time are saved again.
template <int Dim>
void write_checkpoint(hdf5::File& file, const State<Dim>& state, const Progress& progress, const Units& units = {});

}  // namespace itr::output
