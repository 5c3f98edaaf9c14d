// SPDX-License-Identifier: MIT
#include "time_series.hpp"

#include <fmt/format.h>

namespace itr::output {

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
  if (name != "von_mises") return vector_field(entry, name, group + name);
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
