// SPDX-License-Identifier: MIT
#include "time_series.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/timer.hpp"

namespace itr::output {

namespace {

constexpr double kPeriod = 30;      // [s] between replacements of the file that are due to time
constexpr double kFraction = 1e-3;  // of the time, that these may take at most

std::string without_end(std::string text) {
  if (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

}  // namespace

SeriesText::SeriesText(std::filesystem::path path, const std::string& head, std::string tail)
    : path_(std::move(path)),
      part_path_(part_name(path_.string())),
      tail_(std::move(tail)),
      parts_(part_path_, 0),
      last_write_(seconds_now()) {
  parts_.append(without_end(head));
}

SeriesText::~SeriesText() {
  std::error_code none;
  std::filesystem::remove(part_path_, none);
}

void SeriesText::append(std::string part) {
  const std::size_t length = parts_.size();
  parts_.append(without_end(std::move(part)));
  length_before_ = length;
  ++count_;
}

void SeriesText::add(std::string part) {
  append(std::move(part));
  const double pause = std::max(kPeriod, write_seconds_ / kFraction);
  if (count_ >= 2 * written_ || seconds_now() - last_write_ >= pause) write();
}

void SeriesText::drop_last() {
  parts_.shorten(length_before_);
  --count_;
  written_ = 0;  // the file names what is taken back: the next part replaces it
}

void SeriesText::write() {
  const double start = seconds_now();
  Successor file(path_);
  file.copy(part_path_, parts_.size());
  file.write(tail_);
  file.replace();
  written_ = count_;
  last_write_ = seconds_now();
  write_seconds_ = last_write_ - start;
}

namespace {

std::string data_item(const FrameEntry& entry, const std::string& set, const std::string& shape, const char* type) {
  return fmt::format("<DataItem Dimensions=\"{}\" NumberType=\"{}\" Precision=\"8\" Format=\"HDF\">{}:{}</DataItem>", shape,
                     type, entry.file, set);
}

std::string attribute(const std::string& name, const char* type, const char* center, const std::string& data) {
  return fmt::format("        <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", name, type,
                     center, data);
}

/// In the plane a matrix of 2 columns: readers take vectors of XDMF for those of space.
std::string vector_field(const FrameEntry& entry, const std::string& name, const std::string& set) {
  const std::string shape = fmt::format("{} {}", entry.vertices, entry.dim);
  return attribute(name, entry.dim == 3 ? "Vector" : "Matrix", "Node", data_item(entry, set, shape, "Float"));
}

std::string tensor_field(const FrameEntry& entry, const std::string& name, const std::string& set) {
  const std::string shape = fmt::format("{} {}", entry.cells, entry.dim * entry.dim);
  return attribute(name, entry.dim == 3 ? "Tensor" : "Matrix", "Cell", data_item(entry, set, shape, "Float"));
}

/// `group`: where fields of nodes are.
std::string asked_field(const FrameEntry& entry, const std::string& group, const std::string& name) {
  const std::string set = "/fields/" + name;
  if (name == "stress") return tensor_field(entry, name, set);
  if (name.ends_with("_force")) return vector_field(entry, name, group + name);
  if (name == "contact_pressure")
    return attribute(name, "Scalar", "Node", data_item(entry, group + name, std::to_string(entry.vertices), "Float"));
  if (name == "principal_stretches")
    return attribute(name, "Vector", "Cell", data_item(entry, set, std::to_string(entry.cells) + " 3", "Float"));
  return attribute(name, "Scalar", "Cell", data_item(entry, set, std::to_string(entry.cells), "Float"));
}

std::string grid(const FrameEntry& entry) {
  const bool is_plane = entry.dim == 2;
  const std::string cells = std::to_string(entry.cells);
  std::string text =
      fmt::format("      <Grid Name=\"{}\" GridType=\"Uniform\">\n        <Time Value=\"{}\"/>\n", entry.file, entry.t);
  const char* linear = is_plane ? "Triangle" : "Tetrahedron";
  const char* quadratic = is_plane ? "Triangle_6" : "Tetrahedron_10";
  const int nodes = entry.is_quadratic ? (entry.dim + 1) * (entry.dim + 2) / 2 : entry.dim + 1;
  text += fmt::format("        <Topology TopologyType=\"{}\" NumberOfElements=\"{}\">{}</Topology>\n",
                      entry.is_quadratic ? quadratic : linear, cells,
                      data_item(entry, entry.is_quadratic ? "/mesh/quadratic_cells" : "/mesh/simplices",
                                fmt::format("{} {}", cells, nodes), "Int"));
  const bool is_mixed = entry.drawn_nodes > 0;
  FrameEntry drawn = entry;
  if (is_mixed) drawn.vertices = entry.drawn_nodes;
  const std::string group = is_mixed ? "/drawn/" : "/fields/";
  text += fmt::format("        <Geometry GeometryType=\"{}\">{}</Geometry>\n", is_plane ? "XY" : "XYZ",
                      data_item(entry, group + "x", fmt::format("{} {}", drawn.vertices, entry.dim), "Float"));
  text += vector_field(drawn, "u", group + "u") + vector_field(drawn, "v", group + "v");
  text += attribute("elastic_density", "Scalar", "Cell", data_item(entry, "/fields/elastic_density", cells, "Float"));
  text += attribute("body", "Scalar", "Cell", data_item(entry, "/mesh/body", cells, "Int"));
  for (const std::string& name : entry.asked) text += asked_field(drawn, group, name);
  return text + "      </Grid>\n";
}

constexpr const char* kHead =
    "<?xml version=\"1.0\" ?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
    "    <Grid Name=\"simulation\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
constexpr const char* kTail = "    </Grid>\n  </Domain>\n</Xdmf>\n";

std::vector<std::string> names_of(const std::vector<FrameEntry>& entries) {
  std::vector<std::string> names;
  for (const FrameEntry& entry : entries) names.push_back(entry.file);
  return names;
}

}  // namespace

TimeSeries::TimeSeries(const std::filesystem::path& directory, const std::vector<FrameEntry>& stored)
    : links_(directory / "sim.h5", names_of(stored)), text_(directory / "sim.xdmf", kHead, kTail) {
  for (const FrameEntry& entry : stored) text_.append(grid(entry));
  if (!stored.empty()) text_.write();
}

void TimeSeries::add(const FrameEntry& entry) {
  links_.append(entry.file);
  text_.add(grid(entry));
}

void TimeSeries::drop_last() {
  links_.drop_last();
  text_.drop_last();
}

void TimeSeries::write() { text_.write(); }

}  // namespace itr::output
