// SPDX-License-Identifier: MIT
#include "vtk_cells.hpp"

#include <algorithm>
#include <cmath>

#include "itr/core.hpp"
#include "readers.hpp"

namespace itr {

namespace {

struct CellType {
  int type, dim;
  bool is_second_order;
};
constexpr CellType kTypes[] = {{1, 0, false}, {2, 0, false},  {3, 1, false}, {4, 1, false}, {5, 2, false},
                               {7, 2, false}, {10, 3, false}, {21, 1, true}, {22, 2, true}, {24, 3, true}};
constexpr const char* kNumbered[] = {"body", "gmsh:physical", "medit:ref", "MaterialIDs", "CellEntityIds"};
constexpr std::string_view kSet = "set:";

const char* name_of(int type) {
  constexpr std::pair<int, const char*> kNames[] = {
      {6, "triangle strip"}, {8, "pixel"},       {9, "quadrilateral"}, {11, "voxel"},
      {12, "hexahedron"},    {13, "prism"},      {14, "pyramid"},      {23, "quadrilateral"},
      {25, "hexahedron"},    {26, "prism"},      {27, "pyramid"},      {28, "quadrilateral"},
      {29, "hexahedron"},    {42, "polyhedron"}, {69, "triangle"},     {71, "tetrahedron"}};
  for (const auto& [known, name] : kNames)
    if (known == type) return name;
  return "unknown";
}

bool is_numbered(const std::string& name) {
  return std::find(std::begin(kNumbered), std::end(kNumbered), name) != std::end(kNumbered);
}

}  // namespace

void VtkCells::begin_piece(const std::vector<double>& coordinates) {
  first_ += static_cast<std::int64_t>(num_points_);
  num_points_ = coordinates.size() / 3;
  num_cells_ = 0;
  elements_.clear();
  for (std::size_t p = 0; p < num_points_; ++p)
    mesh_.add_node(first_ + static_cast<std::int64_t>(p) + 1,
                   Vec<3>(coordinates[3 * p], coordinates[3 * p + 1], coordinates[3 * p + 2]));
}

void VtkCells::fail(const std::string& found, const std::string& expected) const {
  throw InputError({file_.string(), "cell " + std::to_string(all_cells_), found, expected});
}

void VtkCells::add(const std::vector<double>& points, const std::vector<double>& ends, const std::vector<double>& types) {
  if (types.size() != ends.size())
    fail(std::to_string(types.size()) + " types of cells", std::to_string(ends.size()) + ", one a cell");
  double begin = 0;
  for (std::size_t c = 0; c < ends.size(); ++c) {
    if (!(ends[c] >= begin && ends[c] <= static_cast<double>(points.size())))
      fail("an offset of " + std::to_string(ends[c]), "ascending ones, up to " + std::to_string(points.size()));
    const auto first = static_cast<std::size_t>(begin), last = static_cast<std::size_t>(ends[c]);
    add_cell(types[c] >= 0 && types[c] < 256 ? static_cast<int>(types[c]) : -1,
             std::span(points).subspan(first, last - first));
    begin = ends[c];
  }
}

void VtkCells::add_cell(int type, std::span<const double> points) {
  const auto known = std::find_if(std::begin(kTypes), std::end(kTypes), [&](const CellType& t) { return t.type == type; });
  if (known == std::end(kTypes))
    fail("VTK's type " + std::to_string(type) + ", " + name_of(type),
         "vertices, lines, triangles and tetrahedra, linear or quadratic; " + split_advice(file_));
  std::vector<std::int64_t> nodes;
  for (const double point : points) {
    if (!(point >= 0 && point < static_cast<double>(num_points_)))
      fail("point " + std::to_string(std::llround(point)), "0 to " + std::to_string(num_points_) + " - 1");
    nodes.push_back(first_ + static_cast<std::int64_t>(point) + 1);
  }
  const std::size_t cell = num_cells_++;
  if (known->dim == 0) {
    for (const std::int64_t node : nodes) elements_.push_back({cell, 0, node});
  } else if (type == 4) {
    for (std::size_t i = 0; i + 1 < nodes.size(); ++i)
      elements_.push_back({cell, 1, mesh_.add_element(1, std::span(nodes).subspan(i, 2), all_cells_)});
  } else {
    const std::size_t expected = MeshBuilder::num_nodes_of(known->dim, known->is_second_order);
    if (nodes.size() != expected)
      fail(std::to_string(nodes.size()) + " points", std::to_string(expected) + (type == 7 ? ": triangles only" : ""));
    elements_.push_back({cell, known->dim, mesh_.add_element(known->dim, nodes, all_cells_)});
  }
  ++all_cells_;
}

void VtkCells::add_cell_data(const std::string& name, const std::vector<double>& values) {
  if (values.size() != num_cells_ || !(is_numbered(name) || name.starts_with(kSet))) return;
  const bool is_set = name.starts_with(kSet);
  for (const auto& [cell, dim, member] : elements_) {
    const double value = values[cell];
    const bool is_integer = value == std::floor(value) && std::abs(value) < 2147483647;
    if (!is_integer || value == 0 || (!is_set && value < 0)) continue;
    mesh_.add_member(is_set ? mesh_.group(dim, 0, name.substr(kSet.size())) : mesh_.group(dim, static_cast<int>(value), ""),
                     member);
  }
}

void VtkCells::add_point_data(const std::string& name, const std::vector<double>& values) {
  if (values.size() != num_points_ || !name.starts_with(kSet)) return;
  const int group = mesh_.group(0, 0, name.substr(kSet.size()));
  for (std::size_t p = 0; p < values.size(); ++p)
    if (values[p] != 0) mesh_.add_member(group, first_ + static_cast<std::int64_t>(p) + 1);
}

}  // namespace itr
