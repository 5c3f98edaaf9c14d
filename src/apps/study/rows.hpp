// SPDX-License-Identifier: MIT
// Boxes meshed by rows of cells: what uniform refinement can do at best where a body is one. `n_refs` cuts tetrahedra into
// ones of worse shape.
#pragma once

#include <array>
#include <filesystem>
#include <optional>

#include "itr/mesh/mesh.hpp"

namespace itr::cli::study {

struct RowsOfBox {
  Vec<3> low, high;
  /// Numbers of cubes an axis that make about so many tetrahedra, six a cube.
  std::array<int, 3> counts(double cells) const;
};

/// Finds the rows of a mesh that fills its bounding box; none for others.
std::optional<RowsOfBox> find_box(const Mesh<3>& mesh);

/// As Gmsh 2.2, all cells of the body `id`. Throws InputError where the file cannot be written.
void write_rows(const RowsOfBox& box, const std::array<int, 3>& counts, int id, const std::filesystem::path& file);

}  // namespace itr::cli::study
