// SPDX-License-Identifier: MIT
// Writes what a simulation shows into a folder: frames/NNNNNN.h5, sim.h5, sim.xdmf, steps.jsonl, summary.json (design §5).
// Reads state, never changes it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "itr/output/options.hpp"
#include "itr/simulation/frame.hpp"

namespace itr::output {

/// Norms of the final displacement as scene-format §9 defines them (rest integrals, one centroid point a cell; linf_grad is
/// the true maximum).
struct DisplacementNorms {
  double l2 = 0, h1 = 0, h1_semi = 0, linf = 0, linf_grad = 0, lp = 0;
};
template <int Dim>
DisplacementNorms displacement_norms(const Mesh<Dim>& mesh, ConstVectorView x);

struct RunInfo {
  std::string scene;    ///< path of the scene file
  std::string backend;  ///< solver that was used
  int threads = 1;
};

/// One a run. Every file is either complete or absent; steps.jsonl is flushed a line at a time. Throws InputError where the
/// folder cannot be written.
class Writer {
 public:
  Writer(std::filesystem::path directory, OutputOptions options, RunInfo info);
  ~Writer();
  /// Stores the frame if its step is due, and the step's line always. `report.seconds.output` is what the caller measured
  /// for the *previous* call's writing, so the caller passes it in.
  template <int Dim>
  void write(const FrameView<Dim>& frame, const StepReport& report);
  /// `outcome` is "finished" or the reason why the simulation stopped. Writes summary.json with totals, threads, versions
  /// and norms of the last frame.
  void finish(const std::string& outcome);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace itr::output
