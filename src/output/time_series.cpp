// SPDX-License-Identifier: MIT
#include "time_series.hpp"

#include <fmt/format.h>

#include "files.hpp"
#include "hdf5.hpp"
#include "itr/core/timer.hpp"

namespace itr::output {

namespace {

constexpr double kLongestDelay = 5;  // [s] an index may lag behind by, where frames are rare
constexpr std::size_t kGrowth = 16;  // rewrite when a 16th of the frames is new: O(n log n) bytes in all

std::string data_item(const FrameEntry& entry, const char* set, const std::string& shape, const char* type) {
  return fmt::format("<DataItem Dimensions=\"{}\" NumberType=\"{}\" Precision=\"8\" Format=\"HDF\">{}:{}</DataItem>", shape,
                     type, entry.file, set);
}

std::string attribute(const char* name, const char* type, const char* center, const std::string& data) {
  return fmt::format("        <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", name, type,
                     center, data);
}

/// Component `k` of a vertex field as a scalar: readers of XDMF expect three components of a vector, a plane one has two.
std::string component(const FrameEntry& entry, const char* name, const char* set, int k) {
  const std::string slab = fmt::format(
      "<DataItem ItemType=\"HyperSlab\" Dimensions=\"{0}\"><DataItem Dimensions=\"3 2\" Format=\"XML\">0 {1} 1 1 {0} 1"
      "</DataItem>{2}</DataItem>",
      entry.vertices, k, data_item(entry, set, fmt::format("{} {}", entry.vertices, entry.dim), "Float"));
  return attribute(fmt::format("{}_{}", name, "xyz"[k]).c_str(), "Scalar", "Node", slab);
}

std::string vector_field(const FrameEntry& entry, const char* name, const char* set) {
  const std::string shape = fmt::format("{} {}", entry.vertices, entry.dim);
  if (entry.dim == 3) return attribute(name, "Vector", "Node", data_item(entry, set, shape, "Float"));
  return component(entry, name, set, 0) + component(entry, name, set, 1);
}

std::string grid(const FrameEntry& entry) {
  const bool is_plane = entry.dim == 2;
  const std::string cells = std::to_string(entry.cells);
  std::string text =
      fmt::format("      <Grid Name=\"{}\" GridType=\"Uniform\">\n        <Time Value=\"{}\"/>\n", entry.file, entry.t);
  text += fmt::format("        <Topology TopologyType=\"{}\" NumberOfElements=\"{}\">{}</Topology>\n",
                      is_plane ? "Triangle" : "Tetrahedron", cells,
                      data_item(entry, "/mesh/simplices", fmt::format("{} {}", cells, entry.dim + 1), "Int"));
  text += fmt::format("        <Geometry GeometryType=\"{}\">{}</Geometry>\n", is_plane ? "XY" : "XYZ",
                      data_item(entry, "/fields/x", fmt::format("{} {}", entry.vertices, entry.dim), "Float"));
  text += vector_field(entry, "u", "/fields/u") + vector_field(entry, "v", "/fields/v");
  text += attribute("elastic_density", "Scalar", "Cell", data_item(entry, "/fields/elastic_density", cells, "Float"));
  text += attribute("body", "Scalar", "Cell", data_item(entry, "/mesh/body", cells, "Int"));
  return text + "      </Grid>\n";
}

std::string xdmf(const std::vector<FrameEntry>& entries) {
  std::string text =
      "<?xml version=\"1.0\" ?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
      "    <Grid Name=\"simulation\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (const FrameEntry& entry : entries) text += grid(entry);
  return text + "    </Grid>\n  </Domain>\n</Xdmf>\n";
}

void write_links(const std::filesystem::path& path, const std::vector<FrameEntry>& entries) {
  const hdf5::Session session;
  hdf5::File file = hdf5::File::create(temporary_name(path));
  for (const FrameEntry& entry : entries) {
    file.link_file("/frames/" + std::filesystem::path(entry.file).stem().string(), entry.file);
  }
  file.close();
  publish(path);
}

}  // namespace

bool TimeSeries::is_due() const {
  const std::size_t waiting = entries_.size() - num_written_;
  return waiting * kGrowth >= entries_.size() || seconds_now() - last_write_ > kLongestDelay;
}

void TimeSeries::add(FrameEntry entry) {
  entries_.push_back(std::move(entry));
  if (is_due()) write();
}

void TimeSeries::write() {
  if (num_written_ == entries_.size() && !entries_.empty()) return;
  write_links(directory_ / "sim.h5", entries_);
  write_text(directory_ / "sim.xdmf", xdmf(entries_));
  num_written_ = entries_.size();
  last_write_ = seconds_now();
}

}  // namespace itr::output
