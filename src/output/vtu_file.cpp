// SPDX-License-Identifier: MIT
#include "vtu_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <set>
#include <span>

#include "drawn_cells.hpp"
#include "fem/quadratic.hpp"
#include "files.hpp"
#include "itr/core.hpp"
#include "set_members.hpp"
#include "units.hpp"

namespace itr::output {

namespace {

std::string base64(std::span<const unsigned char> bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

template <typename T>
std::string array(const char* name, const char* type, const std::vector<T>& values, int components) {
  std::vector<unsigned char> bytes(sizeof(std::uint64_t) + values.size() * sizeof(T));
  const std::uint64_t size = values.size() * sizeof(T);
  std::memcpy(bytes.data(), &size, sizeof(size));
  if (size > 0) std::memcpy(bytes.data() + sizeof(size), values.data(), size);
  return fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"binary\">{}</DataArray>\n", type,
                     name, components, base64(bytes));
}

/// Rows of Dim numbers as rows of 3.
template <int Dim>
std::vector<double> in_space(ConstVectorView values) {
  std::vector<double> result;
  result.reserve(values.size() / Dim * 3);
  for (Eigen::Index i = 0; i < values.size(); i += Dim)
    for (int c = 0; c < 3; ++c) result.push_back(c < Dim ? values[i + c] : 0);
  return result;
}

std::vector<double> tensors_in_space(const std::vector<double>& values, int dim) {
  std::vector<double> result;
  for (std::size_t i = 0; i < values.size(); i += dim * dim)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) result.push_back(r < dim && c < dim ? values[i + r * dim + c] : 0);
  return result;
}

template <int Dim>
std::string cells_text(const Mesh<Dim>& mesh, const DrawnCells<Dim>* drawn) {
  constexpr int kTriangle = 5, kTetrahedron = 10, kCurvedTriangle = 22, kCurvedTetrahedron = 24;
  const int linear = Dim == 2 ? kTriangle : kTetrahedron, curved = Dim == 2 ? kCurvedTriangle : kCurvedTetrahedron;
  std::vector<std::int64_t> nodes, ends;
  if (drawn) nodes = drawn->cells;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!drawn) nodes.insert(nodes.end(), mesh.cell(c).begin(), mesh.cell(c).end());
    ends.push_back(drawn ? kQuadraticNodes<Dim> * (c + 1) : static_cast<std::int64_t>(nodes.size()));
  }
  const std::vector<std::uint8_t> types(mesh.cell_slots(), static_cast<std::uint8_t>(drawn ? curved : linear));
  return "<Cells>\n" + array("connectivity", "Int64", nodes, 1) + array("offsets", "Int64", ends, 1) +
         array("types", "UInt8", types, 1) + "</Cells>\n";
}

std::string set_array(const std::string& name, const std::vector<std::uint8_t>& values) {
  return array(("set:" + plain_name(name)).c_str(), "UInt8", values, 1);
}

/// By point, whether it is in a set: of its facets all nodes.
template <int Dim>
std::vector<std::uint8_t> points_of(const SetMembers& set, const FrameView<Dim>& frame, const DrawnCells<Dim>& drawn,
                                    Eigen::Index count) {
  std::vector<std::uint8_t> values(static_cast<std::size_t>(count), 0);
  for (const std::int64_t v : set.vertices) values[v] = 1;
  std::set<EdgeKey> edges;
  for (const std::int64_t f : set.facets)
    for (const VertexId a : frame.mesh.facet(static_cast<FacetId>(f))) {
      values[a] = 1;
      for (const VertexId b : frame.mesh.facet(static_cast<FacetId>(f))) edges.insert(edge_key(a, b));
    }
  std::size_t node = frame.mesh.num_vertices();
  const auto mark = [&](const EdgeKey& edge) { values[node++] = edges.contains(edge); };
  for (const EdgeKey& edge : frame.mesh.curved_edges()) mark(edge);
  std::for_each(drawn.straight_edges.begin(), drawn.straight_edges.end(), mark);
  return values;
}

template <int Dim>
VectorX displacement(const FrameView<Dim>& frame) {
  const std::vector<Vec<Dim>>& rest = frame.mesh.rest();
  VectorX u = frame.x;
  for (std::size_t v = 0; v < rest.size(); ++v) u.template segment<Dim>(Dim * static_cast<Eigen::Index>(v)) -= rest[v];
  return u;
}

}  // namespace

std::string vtu_name(int step) { return fmt::format("vtu/{:06}.vtu", step); }

template <int Dim>
void write_vtu(const std::filesystem::path& directory, const FrameView<Dim>& frame, int step, const Units& units) {
  const Mesh<Dim>& mesh = frame.mesh;
  std::string points, cells;
  const bool is_curved = mesh.has_nodes();
  const DrawnCells<Dim> drawn = is_curved ? draw_cells(mesh) : DrawnCells<Dim>();
  const double length = units.factor("m");
  const VectorX x = drawn.at_nodes(frame.x) / length;
  const auto vectors = [&](const char* name, ConstVectorView values, double unit) {
    if (values.size() > 0) points += array(name, "Float64", in_space<Dim>(drawn.at_nodes(values) / unit), 3);
  };
  /// Forces belong to nodes: there are none on straight edges.
  const double force = units.factor("N");
  const auto forces = [&](const char* name, ConstVectorView values) {
    if (values.size() == 0) return;
    VectorX all = VectorX::Zero(x.size());
    all.head(values.size()) = values / force;
    points += array(name, "Float64", in_space<Dim>(all), 3);
  };
  vectors("u", displacement(frame), length);
  vectors("v", frame.v, units.factor("m/s"));
  const auto pressures = [&](const std::vector<double>& values) { return in_units(values, units, "Pa"); };
  std::vector<std::int64_t> body;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) body.push_back(mesh.body(c));
  cells += array("body", "Int64", body, 1) + array("elastic_density", "Float64", pressures(frame.elastic_density), 1);
  for (const SetMembers& set : set_members(frame)) {
    if (set.cells.empty() && !(set.facets.empty() && set.vertices.empty()))
      points += set_array(set.name, points_of(set, frame, drawn, x.size() / Dim));
    if (set.cells.empty()) continue;
    std::vector<std::uint8_t> is_in(mesh.cell_slots(), 0);
    for (const std::int64_t c : set.cells) is_in[c] = 1;
    cells += set_array(set.name, is_in);
  }
  if (frame.asked) {
    forces("contact_force", frame.asked->forces.contact);
    forces("friction_force", frame.asked->forces.friction);
    forces("reaction_force", frame.asked->forces.reaction);
    if (frame.asked->contact_pressure.size() > 0) {
      const VectorX all = numbers_at_nodes(drawn, frame.asked->contact_pressure);
      points += array("contact_pressure", "Float64", pressures({all.begin(), all.end()}), 1);
    }
    if (!frame.asked->pressure.empty())
      cells += array("hydrostatic_pressure", "Float64", pressures(frame.asked->pressure), 1);
    if (!frame.asked->stretches.empty()) cells += array("principal_stretches", "Float64", frame.asked->stretches, 3);
    if (!frame.asked->von_mises.empty()) cells += array("von_mises", "Float64", pressures(frame.asked->von_mises), 1);
    if (!frame.asked->stress.empty())
      cells += array("stress", "Float64", tensors_in_space(pressures(frame.asked->stress), Dim), 9);
  }
  const std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" "
      "NumberOfCells=\"{}\">\n<Points>\n{}</Points>\n"
      "{}<PointData>\n{}</PointData>\n<CellData>\n{}</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
      x.size() / Dim, mesh.cell_slots(), array("Points", "Float64", in_space<Dim>(x), 3),
      cells_text(mesh, is_curved ? &drawn : nullptr), points, cells);
  std::error_code error;
  std::filesystem::create_directories(directory / "vtu", error);
  if (error)
    throw InputError({(directory / "vtu").string(), "output folder", error.message(), "a folder that can be written"});
  write_file(directory / vtu_name(step), text);
}

const std::string kVtuSeriesHead = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n";
const std::string kVtuSeriesTail = "</Collection>\n</VTKFile>\n";

std::string vtu_series_entry(int step, double t) {
  return fmt::format("<DataSet timestep=\"{}\" file=\"{}\"/>\n", t, vtu_name(step));
}

template void write_vtu(const std::filesystem::path&, const FrameView<2>&, int, const Units&);
template void write_vtu(const std::filesystem::path&, const FrameView<3>&, int, const Units&);

}  // namespace itr::output
