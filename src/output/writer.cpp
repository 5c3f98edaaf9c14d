// SPDX-License-Identifier: MIT
#include "itr/output/writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <system_error>
#include <vector>

#include "files.hpp"
#include "frame_file.hpp"
#include "itr/core/error.hpp"
#include "report_json.hpp"
#include "time_series.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

bool is_frame_name(const fs::path& path) {
  const std::string stem = path.stem().stem().string();  // also of "000000.h5.tmp"
  const bool is_number =
      !stem.empty() && std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c); });
  return is_number && (path.extension() == ".h5" || path.extension() == ".tmp");
}

/// A folder may hold an earlier, longer run; its frames must not pass for ours. Only files that a run writes are removed.
void clear(const fs::path& directory) {
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(directory / "frames")) {
    if (is_frame_name(entry.path())) stale.push_back(entry.path());
  }
  for (const char* name : {"sim.h5", "sim.xdmf", "steps.jsonl", "summary.json"}) stale.push_back(directory / name);
  for (const fs::path& path : stale) fs::remove(path);
}

void prepare(const fs::path& directory) {
  try {
    fs::create_directories(directory / "frames");
    clear(directory);
  } catch (const fs::filesystem_error& error) {
    throw InputError({directory.string(), "output folder", error.code().message(), "a folder that can be written"});
  }
}

}  // namespace

struct Writer::Impl {
  Impl(fs::path folder, OutputOptions output_options, RunInfo run_info)
      : directory(std::move(folder)), options(output_options), info(std::move(run_info)), series(directory) {
    prepare(directory);
    steps.open(directory / "steps.jsonl", std::ios::trunc);
    require_steps();
  }

  void require_steps() const {
    if (!steps) throw InputError({(directory / "steps.jsonl").string(), "file", "writing failed", "a writable folder"});
  }

  template <int Dim>
  void store(const FrameView<Dim>& frame, const StepReport& report) {
    const std::string name = fmt::format("frames/{:06}.h5", report.step);
    write_frame(directory / name, frame, report.step, report.t);
    series.add({name, report.t, Dim, frame.mesh.num_vertices(), frame.mesh.num_cells()});
  }

  fs::path directory;
  OutputOptions options;
  RunInfo info;
  TimeSeries series;
  std::ofstream steps;
  Totals totals;
  DisplacementNorms norms;
};

Writer::Writer(fs::path directory, OutputOptions options, RunInfo info)
    : impl_(std::make_unique<Impl>(std::move(directory), options, std::move(info))) {}

Writer::~Writer() = default;

template <int Dim>
void Writer::write(const FrameView<Dim>& frame, const StepReport& report) {
  if (report.step % std::max(impl_->options.skip_frames, 1) == 0) impl_->store(frame, report);
  impl_->steps << step_json(report) + '\n' << std::flush;  // one write, so that a reader sees whole lines
  impl_->require_steps();
  impl_->totals.add(report);
  impl_->norms = displacement_norms(frame.mesh, frame.x);
}

void Writer::finish(const std::string& outcome) {
  impl_->series.write();
  write_text(impl_->directory / "summary.json", impl_->totals.summary_json(impl_->info, outcome, impl_->norms));
}

template void Writer::write<2>(const FrameView<2>&, const StepReport&);
template void Writer::write<3>(const FrameView<3>&, const StepReport&);

}  // namespace itr::output
