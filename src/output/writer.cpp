// SPDX-License-Identifier: MIT
#include "itr/output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "checkpoint.hpp"
#include "core/timer.hpp"
#include "file_list.hpp"
#include "files.hpp"
#include "force_file.hpp"
#include "frame_file.hpp"
#include "itr/core.hpp"
#include "report_json.hpp"
#include "simulation/state.hpp"
#include "time_series.hpp"
#include "units.hpp"
#include "vtu_file.hpp"
#include "warnings.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

const std::string kSeries = "sim.xdmf", kVtuSeries = "sim.pvd";

/// Names of all files that a run writes beside its frames.
std::vector<std::string> files_of_run(const OutputOptions& options, const RunInfo& info) {
  std::vector<std::string> names = {"sim.h5", kSeries, SeriesText::part_name(kSeries), "steps.jsonl", "summary.json"};
  if (options.vtu) names.insert(names.end(), {kVtuSeries, SeriesText::part_name(kVtuSeries)});
  names.insert(names.end(), info.files.begin(), info.files.end());
  return names;
}

}  // namespace

struct Writer::Impl {
  /// Keeps frames up to `last_step` (-1: none) and the first `log_bytes` of steps.jsonl.
  Impl(Folder output_folder, OutputOptions output_options, RunInfo run_info, int last_step, std::size_t log_bytes)
      : folder(std::move(output_folder)),
        directory(folder.path()),
        options(output_options),
        info(std::move(run_info)),
        stored(begin(last_step)),
        steps(directory / "steps.jsonl", log_bytes),
        forces(directory / kForceFile, folder.owns(kForceFile) ? last_step : -1),
        points(directory / kPointFile, folder.owns(kPointFile) ? last_step : -1),
        series(directory, stored) {
    if (options.vtu) begin_vtu_series();
    if (last_step >= 0) removed_files = folder.remove_after(last_step);  // nothing names these frames any more
    stored = {};
    last_checkpoint = seconds_now();
    if (last_step >= 0) warnings.restore(directory / "steps.jsonl");
  }

  /// Returns the frames to go on from.
  std::vector<FrameEntry> begin(int last_step) {
    const std::vector<std::string> names = files_of_run(options, info);
    std::vector<FrameEntry> entries;
    if (last_step < 0) {
      removed_files = folder.begin(names);
      return entries;
    }
    folder.resume(names, last_step);
    for (const fs::path& path : stored_frames(directory)) {
      if (step_of_frame(path) > last_step) break;
      const FrameSizes sizes = read_frame_sizes(path);
      last_stored = step_of_frame(path);
      entries.push_back({frame_name(last_stored), sizes.t, sizes.dim, sizes.vertices, sizes.cells, sizes.is_quadratic,
                         sizes.drawn_nodes, sizes.asked});
    }
    return entries;
  }

  void begin_vtu_series() {
    vtu_series.emplace(directory / kVtuSeries, kVtuSeriesHead, kVtuSeriesTail);
    for (const FrameEntry& entry : stored)
      if (const int step = step_of_name(entry.file); fs::exists(directory / vtu_name(step)))
        vtu_series->append(vtu_series_entry(step, entry.t));
    if (!stored.empty()) vtu_series->write();
  }

  static std::string frame_name(int step) { return fmt::format("frames/{:06}.h5", step); }
  bool is_due(int step, double t) const {
    return options.times.output_dt > 0 ? options.times.is_asked(t) : step % std::max(options.skip_frames, 1) == 0;
  }

  /// Seconds of all steps become those of the whole run so far, and of what it was resumed from.
  void count_wall_time() {
    if (info.start) totals.set_seconds(seconds_before + seconds_now() - *info.start);
  }

  /// A state that was saved at a step which is not to be stored gives way to the next frame: a run that was interrupted
  /// leaves what one that was not leaves.
  void drop_unasked_frame() {
    if (last_stored < 0 || is_last_due) return;
    series.drop_last();
    fs::remove(directory / frame_name(last_stored));
    if (vtu_series && fs::remove(directory / vtu_name(last_stored))) vtu_series->drop_last();
  }

  template <int Dim>
  void store(const FrameView<Dim>& frame, int step, double t, const State<Dim>* checkpoint) {
    const std::string name = frame_name(step);
    if (vtu_series && step != last_stored) {  // before the frame: a run that goes on from that would not write it
      folder.claim(vtu_name(step));
      write_vtu(directory, frame, step, options.units);
    }
    folder.claim(name);
    if (checkpoint) {
      sync_frames();
      count_wall_time();
      const std::string saved_totals = totals.save();
      const Progress progress{info.scene_identity, info.backend, saved_totals, steps.size()};
      const auto add = [&](hdf5::File& file) { write_checkpoint(file, *checkpoint, progress, options.units); };
      write_frame(directory / name, frame, step, t, Durability::power, add, options.units);
      sync(directory / "frames");
      last_checkpoint = seconds_now();
    } else {
      frames.write(directory / name, frame, step, t, options.units);
      unsynced.push_back(step);
    }
  }

  /// Takes a stored frame into the series. Where that fails the frame is there all the same.
  template <int Dim>
  void index(const FrameView<Dim>& frame, int step, double t) {
    if (step == last_stored) return;
    drop_unasked_frame();
    last_stored = step;
    is_last_due = is_due(step, t);
    std::vector<std::string> asked;
    if (frame.asked) {
      const NodalForces& forces = frame.asked->forces;
      if (forces.contact.size()) asked.push_back("contact_force");
      if (forces.friction.size()) asked.push_back("friction_force");
      if (forces.reaction.size()) asked.push_back("reaction_force");
      if (!frame.asked->von_mises.empty()) asked.push_back("von_mises");
      if (!frame.asked->stress.empty()) asked.push_back("stress");
      if (frame.asked->contact_pressure.size()) asked.push_back("contact_pressure");
      if (!frame.asked->pressure.empty()) asked.push_back("hydrostatic_pressure");
      if (!frame.asked->stretches.empty()) asked.push_back("principal_stretches");
    }
    const int nodes = static_cast<int>(frame.x.size()) / Dim;
    if (vtu_series) vtu_series->add(vtu_series_entry(step, options.units.from_si(t, "s")));
    const bool is_quadratic = frame.mesh.has_nodes();
    series.add({frame_name(step), options.units.from_si(t, "s"), Dim, nodes, frame.mesh.num_cells(), is_quadratic,
                drawn_nodes(frame), std::move(asked)});
  }

  /// Brings frames to the disk before the checkpoint that relies on them.
  void sync_frames() {
    constexpr std::size_t kFew = 32;
    if (unsynced.size() > kFew)
      sync_file_system(directory / "frames");
    else
      for (const int step : unsynced) sync(directory / frame_name(step));
    sync(directory / "steps.jsonl");
    unsynced.clear();
  }

  Folder folder;
  fs::path directory;
  OutputOptions options;
  RunInfo info;
  int last_stored = kNone;
  bool is_last_due = true;  ///< whether its frame was asked for
  int removed_files = 0;
  std::vector<FrameEntry> stored;  ///< while the series are begun
  LineFile steps;
  CurveFile forces, points;
  TimeSeries series;
  std::optional<SeriesText> vtu_series;
  FrameFiles frames;
  Totals totals;
  DisplacementNorms norms;
  WarningList warnings;
  double seconds_before = 0;  ///< of the runs before --resume
  std::vector<int> unsynced;  ///< steps of frames that may not be on the disk
  double last_checkpoint = 0;
};

Writer::Writer(Folder folder, OutputOptions options, RunInfo info)
    : impl_(std::make_unique<Impl>(std::move(folder), options, std::move(info), -1, 0)) {}

Writer::Writer(fs::path directory, OutputOptions options, RunInfo info)
    : Writer(Folder(std::move(directory)), options, std::move(info)) {}

template <int Dim>
Writer::Writer(Folder folder, OutputOptions options, RunInfo info, const Checkpoint<Dim>& checkpoint)
    : impl_(std::make_unique<Impl>(std::move(folder), options, std::move(info), checkpoint.state->step,
                                   checkpoint.log_bytes)) {
  impl_->totals.restore(checkpoint.totals);
  impl_->seconds_before = impl_->totals.report().seconds.total;
  const State<Dim>& state = *checkpoint.state;
  impl_->norms = displacement_norms(state.mesh, state.history.x[0]);
  impl_->is_last_due = impl_->is_due(state.step, state.t);
}

Writer::~Writer() = default;

int Writer::removed_files() const { return impl_->removed_files; }

bool Writer::is_checkpoint_due(int step, double t) const {
  return impl_->is_due(step, t) && (step == 0 || seconds_now() - impl_->last_checkpoint >= impl_->options.checkpoint_period);
}

template <int Dim>
void Writer::write(const FrameView<Dim>& frame, const StepReport& report, const State<Dim>* checkpoint) {
  const std::size_t length = impl_->steps.size();
  const Units& units = impl_->options.units;
  Json line = step_json(in_units(report, units));
  if (Json warnings = impl_->warnings.take_new(); !warnings.empty()) line["warnings"] = std::move(warnings);
  impl_->steps.append(text_of(line));
  const AskedFields none, &asked = frame.asked ? *frame.asked : none;
  const double t = units.from_si(report.t, "s");
  if (!asked.curves.empty()) impl_->folder.claim(kForceFile);
  if (!asked.points.empty()) impl_->folder.claim(kPointFile);
  const bool has_rows = impl_->options.times.is_asked(report.t);
  if (has_rows) {
    impl_->forces.add(report.step, t, in_units(asked.curves, units));
    impl_->points.add(report.step, t, in_units(asked.points, units));
  }
  impl_->totals.add(report);
  impl_->norms = displacement_norms(frame.mesh, frame.x);
  if (!checkpoint && !impl_->is_due(report.step, report.t)) return;
  try {
    impl_->store(frame, report.step, report.t, checkpoint);
  } catch (const InputError&) {
    impl_->steps.shorten(length);  // a step whose frame is not there was not done
    if (has_rows && !asked.curves.empty()) impl_->forces.drop_last();
    if (has_rows && !asked.points.empty()) impl_->points.drop_last();
    throw;
  }
  impl_->index(frame, report.step, report.t);
}

template <int Dim>
void Writer::save(const FrameView<Dim>& frame, const State<Dim>& state) {
  impl_->store(frame, state.step, state.t, &state);
  impl_->index(frame, state.step, state.t);
}

void Writer::warn(const std::string& text) { impl_->warnings.add(text); }

int Writer::warnings() const { return impl_->warnings.count(); }

const StepReport& Writer::totals() const { return impl_->totals.report(); }

void Writer::add_output(double seconds) { impl_->totals.add_output(seconds); }

void Writer::finish(const std::string& outcome, const std::string& solver) {
  impl_->series.write();
  if (impl_->vtu_series) impl_->vtu_series->write();
  impl_->count_wall_time();
  const std::string& used = solver.empty() ? impl_->info.backend : solver;
  write_file(impl_->directory / "summary.json", impl_->totals.summary_json(impl_->info, impl_->options.units, outcome, used,
                                                                           impl_->norms, impl_->warnings.summary_members()));
}

#define ITR_INSTANTIATE(Dim)                                                                     \
  template Writer::Writer(Folder, OutputOptions, RunInfo, const Checkpoint<Dim>&);               \
  template void Writer::write<Dim>(const FrameView<Dim>&, const StepReport&, const State<Dim>*); \
  template void Writer::save<Dim>(const FrameView<Dim>&, const State<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::output
