// SPDX-License-Identifier: MIT
#include "force_file.hpp"

#include <fmt/format.h>

#include <fstream>

#include "frame_file.hpp"
#include "itr/core/error.hpp"

namespace itr::output {

namespace {

constexpr const char* kKinds[] = {"contact", "friction", "reaction", "all", "body", "residual", "remeshing"};

/// Of the columns that a curve has.
std::string header(const ForceCurvePoint& curve) {
  const std::size_t columns = curve.kinds.front().size();
  const std::vector<const char*> names = columns == 3 ? std::vector<const char*>{"x", "y", "moment"}
                                                      : std::vector<const char*>{"x", "y", "z", "mx", "my", "mz"};
  std::string text = "step,t,name";
  for (std::size_t k = 0; k < curve.kinds.size(); ++k)
    for (std::size_t c = 0; c < curve.kinds[k].size(); ++c) text += fmt::format(",{}_{}", kKinds[k], names[c]);
  return text;
}

/// A line for each curve.
std::vector<std::string> lines_of(int step, double t, const std::vector<ForceCurvePoint>& curves) {
  std::vector<std::string> lines;
  for (const ForceCurvePoint& curve : curves) {
    std::string& line = lines.emplace_back(fmt::format("{},{},{}", step, t, curve.name));
    for (const auto& kind : curve.kinds)
      for (const double value : kind) line += fmt::format(",{}", value == 0 ? 0.0 : value);
  }
  return lines;
}

/// Bytes of the lines up to a step.
std::size_t length_until(const std::filesystem::path& path, int last_step) {
  std::ifstream file(path, std::ios::binary);
  std::size_t length = 0;
  for (std::string line; last_step >= 0 && std::getline(file, line) && !file.eof(); length += line.size() + 1)
    if (length > 0 && std::atoi(line.c_str()) > last_step) break;
  return length;
}

}  // namespace

ForceFile::ForceFile(std::filesystem::path directory, int last_step) : path_(std::move(directory) / kForceFile) {
  if (last_step < 0) return;
  const std::size_t keep = length_until(path_, last_step);
  if (keep > 0)
    file_.emplace(path_, keep);
  else
    std::filesystem::remove(path_);
}

void ForceFile::add(int step, double t, const std::vector<ForceCurvePoint>& curves) {
  if (curves.empty()) return;
  if (!file_) {
    file_.emplace(path_, 0);
    file_->append(header(curves.front()));
  }
  size_before_ = file_->size();
  for (std::string& line : lines_of(step, t, curves)) file_->append(std::move(line));
}

void ForceFile::drop_last() {
  if (file_) file_->shorten(size_before_);
}

int rewrite_forces(const std::filesystem::path& directory) {
  std::vector<StoredForces> stored;
  for (const auto& path : stored_frames(directory))
    if (StoredForces forces = read_frame_forces(path); !forces.curves.empty()) stored.push_back(std::move(forces));
  if (stored.empty())
    throw InputError({directory.string(), "frames", "none with forces", "a run of a scene with /output/forces"});
  ForceFile file(directory, -1);
  for (const StoredForces& forces : stored) file.add(forces.step, forces.t, forces.curves);
  return static_cast<int>(stored.size());
}

std::string stored_forces(const std::filesystem::path& directory) {
  std::ifstream file(directory / kForceFile, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  text.resize(text.rfind('\n') + 1);  // a run that goes on may be writing the next line
  if (!text.empty()) return text;
  for (const auto& path : stored_frames(directory)) {
    const StoredForces forces = read_frame_forces(path);
    if (forces.curves.empty()) break;  // all frames of a run have them, or none: the others need not be opened
    if (text.empty()) text = header(forces.curves.front()) + '\n';
    for (const std::string& line : lines_of(forces.step, forces.t, forces.curves)) text += line + '\n';
  }
  return text;
}

}  // namespace itr::output
