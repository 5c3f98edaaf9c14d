// SPDX-License-Identifier: MIT
// Cells and arrays of VTK's files, text or XML, as elements and groups.
#pragma once

#include <string>
#include <vector>

#include "mesh_builder.hpp"

namespace itr {

class VtkCells {
 public:
  explicit VtkCells(const std::filesystem::path& file) : mesh_(file), file_(file) {}

  /// Three coordinates a point. Points of cells are counted from the first of these.
  void begin_piece(const std::vector<double>& coordinates);
  /// Adds cells as VTK's files have them: all `points`, one cell after another, and by cell where its points end and VTK's
  /// type. Throws InputError for types that are not read, and for counts, ends and points that do not fit.
  void add(const std::vector<double>& points, const std::vector<double>& ends, const std::vector<double>& types);

  /// Numbers of cells become groups where the array is one that says so (`body`, `gmsh:physical`, ...), and those other than
  /// 0 a named set where it is called "set:NAME".
  void add_cell_data(const std::string& name, const std::vector<double>& values);
  /// Points other than 0 in an array called "set:NAME" become that set.
  void add_point_data(const std::string& name, const std::vector<double>& values);

  MeshFile finish() { return mesh_.finish(); }

 private:
  void add_cell(int type, std::span<const double> points);
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const;

  struct Element {
    std::size_t cell;  ///< of this piece
    int dim;
    std::int64_t member;  ///< see MeshBuilder::add_member
  };

  MeshBuilder mesh_;
  const std::filesystem::path& file_;
  std::size_t num_points_ = 0, num_cells_ = 0;
  std::int64_t first_ = 0, all_cells_ = 0;
  std::vector<Element> elements_;  ///< of this piece
};

}  // namespace itr
