// SPDX-License-Identifier: MIT
// Writes the results of a simulation into a folder: frames/NNNNNN.h5, sim.h5, sim.xdmf, steps.jsonl, summary.json
// (docs/theory.md, "Output"). Reads state, never changes it.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "itr/output/checkpoint.hpp"
#include "itr/output/folder.hpp"
#include "itr/output/options.hpp"
#include "itr/simulation/frame.hpp"

namespace itr::output {

/// Norms of the final displacement as docs/theory.md, "Norms" defines them (rest integrals, one centroid point a cell;
/// linf_grad is the true maximum).
struct DisplacementNorms {
  double l2 = 0, h1 = 0, h1_semi = 0, linf = 0, linf_grad = 0, lp = 0;
};
template <int Dim>
DisplacementNorms displacement_norms(const Mesh<Dim>& mesh, ConstVectorView x);

struct RunInfo {
  std::string scene;    ///< path of the scene file
  std::string backend;  ///< solver that was used
  int threads = 1;
  std::string scene_identity{};   ///< the part of the scene that a resumed run must share
  std::optional<double> start{};  ///< when the run began, by its monotonic clock [s]; empty: only steps are timed
  /// Names that the folder gets too: forces.csv, report.html. Where one is taken, the run is refused before it begins.
  std::vector<std::string> files{};
  std::string defaults{};  ///< the scene's set of them, with its version; empty: a program sets all
};

/// The writer of a run. Every file is complete or absent; steps.jsonl is flushed after each line. Throws InputError if the
/// folder is unwritable or full. Files that were written before stay readable.
class Writer {
 public:
  /// Begins a new run and removes files of an earlier one, no others.
  Writer(Folder folder, OutputOptions options, RunInfo info);
  /// As above, in the folder that is or will be there.
  Writer(std::filesystem::path directory, OutputOptions options, RunInfo info);
  /// Goes on after a saved state of this folder. Files that were written after that state are removed.
  template <int Dim>
  Writer(Folder folder, OutputOptions options, RunInfo info, const Checkpoint<Dim>& checkpoint);
  ~Writer();

  /// How many files of an earlier run, or of steps after the saved state, were removed.
  int removed_files() const;

  /// Whether it is time for the next stored step to be a checkpoint.
  bool is_checkpoint_due(int step) const;
  /// Stores the step's line always; the frame if its step is due, or if there is a `checkpoint`, the state to be saved.
  /// `report.seconds.output` is what the caller measured for the *previous* call's writing, so the caller passes it in.
  template <int Dim>
  void write(const FrameView<Dim>& frame, const StepReport& report, const State<Dim>* checkpoint = nullptr);
  /// Saves the state after the step that was written last.
  template <int Dim>
  void save(const FrameView<Dim>& frame, const State<Dim>& state);
  /// Goes into the line of the next step and into summary.json, which counts those of one kind.
  void warn(const std::string& text);
  int warnings() const;  ///< how many there were, before --resume too
  /// Sums over the run as in summary.json, steps before --resume included.
  const StepReport& totals() const;
  /// Counts time that was spent on output after the last line.
  void add_output(double seconds);
  /// `outcome` is "finished" or the reason why the simulation stopped, `solver` who solved at the end (empty: the backend).
  /// Writes summary.json with totals, threads, versions and norms of the last frame.
  void finish(const std::string& outcome, const std::string& solver = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace itr::output
