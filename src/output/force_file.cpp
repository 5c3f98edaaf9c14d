// SPDX-License-Identifier: MIT
#include "force_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <utility>

#include "frame_file.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"

namespace itr::output {

namespace {

constexpr const char* kKinds[] = {"contact", "friction", "reaction", "all", "body", "residual", "remeshing"};

/// Names the columns that a curve has. Those of errors follow, of the first four kinds by source.
std::string header(const ForceCurvePoint& curve) {
  const std::size_t columns = curve.kinds.front().size();
  const std::vector<const char*> names = columns == 3 ? std::vector<const char*>{"x", "y", "moment"}
                                                      : std::vector<const char*>{"x", "y", "z", "mx", "my", "mz"};
  std::string text = "step,t,name";
  for (std::size_t k = 0; k < curve.kinds.size(); ++k)
    for (std::size_t c = 0; c < curve.kinds[k].size(); ++c) text += fmt::format(",{}_{}", kKinds[k], names[c]);
  if (!curve.cavity.empty()) text += ",volume,pressure";
  for (std::size_t s = 0; s < curve.errors.size(); ++s)
    for (std::size_t k = 0; k < curve.errors[s].size(); ++k)
      for (std::size_t c = 0; c < columns; ++c)
        text += fmt::format(",{}_{}_error_{}", kKinds[k], names[c], name(static_cast<ErrorSource>(s)));
  return text;
}

std::string header(const PointValue& point) {
  constexpr std::array kAxes{"x", "y", "z"};
  const std::size_t dim = point.x.size();
  std::string text = "step,t,name";
  for (const char* what : {"", "u_"})
    for (std::size_t c = 0; c < dim; ++c) text += fmt::format(",{}{}", what, kAxes[c]);
  for (std::size_t s = 0; s < point.errors.size(); ++s)
    for (std::size_t c = 0; c < dim; ++c) text += fmt::format(",u_{}_error_{}", kAxes[c], name(static_cast<ErrorSource>(s)));
  return text;
}

/// Adds numbers, of which those that are not known (NaN) are empty.
void add_values(const std::vector<double>& values, std::string& line) {
  for (const double value : values) line += std::isnan(value) ? "," : fmt::format(",{}", value == 0 ? 0.0 : value);
}

std::vector<std::string> lines_of(int step, double t, const std::vector<PointValue>& points) {
  std::vector<std::string> lines;
  for (const PointValue& point : points) {
    std::string& line = lines.emplace_back(fmt::format("{},{},{}", step, t, point.name));
    add_values(point.x, line);
    add_values(point.u, line);
    for (const auto& source : point.errors) add_values(source, line);
  }
  return lines;
}

/// A line for each curve.
std::vector<std::string> lines_of(int step, double t, const std::vector<ForceCurvePoint>& curves) {
  std::vector<std::string> lines;
  for (const ForceCurvePoint& curve : curves) {
    std::string& line = lines.emplace_back(fmt::format("{},{},{}", step, t, curve.name));
    for (const auto& kind : curve.kinds) add_values(kind, line);
    add_values(curve.cavity, line);
    for (const auto& source : curve.errors)
      for (const auto& kind : source) add_values(kind, line);
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

struct Row {
  std::string name, line;
};
using RowList = std::map<int, std::vector<Row>>;  ///< by step

/// The row that a line is, by its step; none where it has other columns than the header.
std::optional<std::pair<int, Row>> parse_row(const std::string& line, const std::string& head) {
  const std::size_t first = line.find(','), second = line.find(',', first + 1), third = line.find(',', second + 1);
  if (std::count(line.begin(), line.end(), ',') != std::count(head.begin(), head.end(), ',')) return std::nullopt;
  int step = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + first, step);
  if (error != std::errc() || end != line.data() + first || step < 0) return std::nullopt;
  return std::pair{step, Row{line.substr(second + 1, third - second - 1), line}};
}

/// Gives the header those columns of errors that a file has and frames have not. Returns their number.
std::size_t extend_header(const std::filesystem::path& path, std::string& head) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  if (!std::getline(file, line) || file.eof() || !line.starts_with(head + ',')) return 0;
  const std::string errors = line.substr(head.size());
  head = line;
  return static_cast<std::size_t>(std::count(errors.begin(), errors.end(), ','));
}

/// The last columns of a line, each with the comma before it.
std::string last_columns(const std::string& line, std::size_t columns) {
  std::size_t begin = line.size();
  for (; columns > 0; --columns) begin = line.rfind(',', begin - 1);
  return line.substr(begin);
}

/// The rows of a folder's forces.csv, none without one. Throws InputError where a line is none: to write the file anew would
/// lose it.
RowList read_rows(const std::filesystem::path& directory, const std::string& head) {
  const std::filesystem::path path = directory / kForceFile;
  const bool was_killed = !std::filesystem::exists(directory / "summary.json");
  RowList rows;
  std::ifstream file(path, std::ios::binary);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (file.eof() && was_killed) break;  // a part of a row
    if (number == 1 && line == head) continue;
    auto row = number == 1 ? std::nullopt : parse_row(line, head);
    if (!row)
      throw InputError({path.string(), fmt::format("line {}", number), line,
                        number == 1 ? head : "a row of the columns of line 1, or that this file is moved away"});
    rows[row->first].push_back(std::move(row->second));
  }
  return rows;
}

}  // namespace

CurveFile::CurveFile(std::filesystem::path path, int last_step) : path_(std::move(path)) {
  if (last_step < 0) return;
  const std::size_t keep = length_until(path_, last_step);
  if (keep > 0)
    file_.emplace(path_, keep);
  else
    std::filesystem::remove(path_);
}

void CurveFile::add(const std::string& header, std::vector<std::string> lines) {
  if (!file_) {
    file_.emplace(path_, 0);
    file_->append(header);
  }
  size_before_ = file_->size();
  for (std::string& line : lines) file_->append(std::move(line));
}

void CurveFile::add(int step, double t, const std::vector<ForceCurvePoint>& curves) {
  if (!curves.empty()) add(header(curves.front()), lines_of(step, t, curves));
}

void CurveFile::add(int step, double t, const std::vector<PointValue>& points) {
  if (!points.empty()) add(header(points.front()), lines_of(step, t, points));
}

void CurveFile::drop_last() {
  if (file_) file_->shorten(size_before_);
}

ForceRows rewrite_forces(const std::filesystem::path& directory) {
  Folder folder(directory);
  ForceRows count;
  RowList from_frames;
  std::string head;
  for (const auto& path : stored_frames(directory)) {
    const StoredForces forces = read_frame_forces(path);
    if (forces.curves.empty()) continue;
    ++count.frames;
    head = header(forces.curves.front());
    std::vector<std::string> lines = lines_of(forces.step, forces.t, forces.curves);
    for (std::size_t i = 0; i < lines.size(); ++i)
      from_frames[forces.step].push_back({forces.curves[i].name, std::move(lines[i])});
  }
  if (from_frames.empty())
    throw InputError({directory.string(), "frames", "none with forces", "a run of a scene with /output/forces"});
  folder.resume({kForceFile}, from_frames.rbegin()->first);
  const std::size_t errors = extend_header(directory / kForceFile, head);
  RowList rows = read_rows(directory, head);
  for (auto& [step, of_step] : from_frames) {
    for (Row& row : of_step) {
      const auto same = std::find_if(rows[step].begin(), rows[step].end(), [&](const Row& r) { return r.name == row.name; });
      if (same != rows[step].end()) {
        same->line = row.line + last_columns(same->line, errors);
      } else {
        row.line.append(errors, ',');
        rows[step].push_back(std::move(row));
        ++count.added;
      }
    }
  }
  std::string text = head + '\n';
  for (const auto& [step, of_step] : rows) {
    for (const Row& row : of_step) text += row.line + '\n';
    count.rows += static_cast<int>(of_step.size());
  }
  write_file(directory / kForceFile, text);
  return count;
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
