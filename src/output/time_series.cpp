// SPDX-License-Identifier: MIT
#include "time_series.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/hdf5.hpp"
#include "core/timer.hpp"
#include "files.hpp"

namespace itr::output {

namespace {

constexpr double kMostShare = 0.02;  // of the time, that replacing sim.xdmf may take
constexpr std::size_t kGrowth = 16;  // or it is replaced when a 16th of the frames is new: O(n log n) bytes in all

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

std::string asked_field(const FrameEntry& entry, const std::string& name) {
  const std::string set = "/fields/" + name;
  if (name == "stress") return tensor_field(entry, name, set);
  if (name != "von_mises") return vector_field(entry, name, set);
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
  for (const std::string& name : entry.asked)
    if (const bool is_on_cells = name == "von_mises" || name == "stress"; is_on_cells || !is_mixed)
      text += asked_field(entry, name);
  return text + "      </Grid>\n";
}

constexpr const char* kHead =
    "<?xml version=\"1.0\" ?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
    "    <Grid Name=\"simulation\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
constexpr const char* kTail = "    </Grid>\n  </Domain>\n</Xdmf>\n";

std::string link_name(const std::string& file) { return "/frames/" + std::filesystem::path(file).stem().string(); }

}  // namespace

/// sim.h5 as it is made in memory: a frame adds one link.
struct TimeSeries::Links {
  explicit Links(const std::filesystem::path& path) : file(hdf5::File::create(path)) {}
  hdf5::File file;
};

TimeSeries::TimeSeries(std::filesystem::path directory) : directory_(std::move(directory)) {
  const hdf5::Session session;
  links_ = std::make_unique<Links>(directory_ / "sim.h5");
}

TimeSeries::~TimeSeries() {
  const hdf5::Session session;
  links_.reset();
}

void TimeSeries::append(const FrameEntry& entry) {
  const hdf5::Session session;
  links_->file.link_file(link_name(entry.file), entry.file);
  files_.push_back(entry.file);
  text_ += grid(entry);
  text_ends_.push_back(text_.size());
}

void TimeSeries::add(const FrameEntry& entry) {
  append(entry);
  write_links();
  const bool is_far_behind = (files_.size() - num_written_) * kGrowth >= files_.size();
  if (is_far_behind || write_seconds_ <= kMostShare * (seconds_now() - last_write_)) write_text();
}

void TimeSeries::drop_last() {
  const hdf5::Session session;
  links_->file.unlink(link_name(files_.back()));
  files_.pop_back();
  num_written_ = std::min(num_written_, files_.size());
  text_ends_.pop_back();
  text_.resize(text_ends_.empty() ? 0 : text_ends_.back());
}

void TimeSeries::write_text() {
  const double start = seconds_now();
  write_file(directory_ / "sim.xdmf", kHead + text_ + kTail);
  num_written_ = files_.size();
  last_write_ = seconds_now();
  write_seconds_ = last_write_ - start;
}

void TimeSeries::write_links() {
  const hdf5::Session session;
  write_file(directory_ / "sim.h5", links_->file.image());
}

void TimeSeries::write() {
  write_links();
  write_text();
}

}  // namespace itr::output
