// SPDX-License-Identifier: MIT
// Writes the results of a simulation into a folder: frames/NNNNNN.h5, sim.h5, sim.xdmf, steps.jsonl, summary.json
// (docs/theory.md, "Output"). Reads state, never changes it.
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/options.hpp"
#include "itr/simulation.hpp"

namespace itr::output {

// The folder of a run: one run at a time is at work in it, and removes and replaces only files that runs wrote there.

/// A folder of results, locked while this lives; the lock ends with the process, however that ends. The file itr-files.txt
/// there has the names of the files that runs wrote.
class ITR_EXPORT Folder {
 public:
  /// Makes the folder where there is none. Throws InputError where it cannot be written or another run is at work in it.
  explicit Folder(std::filesystem::path directory);
  Folder(Folder&& other) noexcept;
  /// Leaves no trace of itself where no run has begun.
  ~Folder();

  const std::filesystem::path& path() const;
  /// Whether files of an earlier run are there.
  bool has_results() const;
  /// Begins a new run that writes `names` beside frames: removes all files of earlier runs. Throws InputError, and removes
  /// nothing, where a file stands there that no run wrote. Returns how many files were removed.
  int begin(const std::vector<std::string>& names);
  /// Goes on with a run, as `begin`, but removes nothing.
  void resume(const std::vector<std::string>& names, int last_step);
  /// Removes what runs wrote of steps after this one, and what is written at the end of a run. Returns how many files.
  int remove_after(int last_step);
  /// Whether the run that has begun writes a file of this name, or wrote it before it went on. Not for frames.
  bool owns(const std::string& name) const;
  /// Lists a file before it is written. Throws InputError where it is there and no run wrote it.
  void claim(const std::string& name);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Saved states, from which a run goes on with the same bits as if it had never stopped. They are frames with a group more.

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
ITR_EXPORT std::optional<SavedState> find_saved_state(const std::filesystem::path& directory,
                                                      int before = std::numeric_limits<int>::max());

template <int Dim>
struct Checkpoint {
  std::shared_ptr<const State<Dim>> state;
  std::string totals;         ///< of the output so far, JSON text
  std::size_t log_bytes = 0;  ///< length of steps.jsonl then
};

/// Throws InputError where the file is unreadable, inconsistent, or not as it was written.
template <int Dim>
ITR_EXPORT Checkpoint<Dim> read_checkpoint(const SavedState& saved);

/// Norms of the final displacement as docs/theory.md, "Norms" defines them (rest integrals, one centroid point a cell;
/// linf_grad is the true maximum).
struct DisplacementNorms {
  double l2 = 0, h1 = 0, h1_semi = 0, linf = 0, linf_grad = 0, lp = 0;
};
template <int Dim>
ITR_EXPORT DisplacementNorms displacement_norms(const Mesh<Dim>& mesh, ConstVectorView x);

struct RunInfo {
  std::string scene;    ///< path of the scene file
  std::string backend;  ///< solver that was used
  int threads = 1;
  std::string scene_identity{};   ///< the part of the scene that a resumed run must share
  std::optional<double> start{};  ///< when the run began, by its monotonic clock [s]; empty: only steps are timed
  /// Names that the folder gets too: forces.csv, report.html. Where one is taken, the run is refused before it begins.
  std::vector<std::string> files{};
  std::string defaults{};          ///< the scene's set of them, with its version; empty: a program sets all
  double interference_energy = 0;  ///< Simulation::interference_energy [J]; told unless it is 0
};

/// The writer of a run. Every file is complete or absent; steps.jsonl is flushed after each line. Throws InputError if the
/// folder is unwritable or full. Files that were written before stay readable.
class ITR_EXPORT Writer {
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

  /// Whether the step to the time t [s] is stored, and it is time for a checkpoint.
  bool is_checkpoint_due(int step, double t) const;
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
