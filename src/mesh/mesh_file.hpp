// SPDX-License-Identifier: MIT
// Mesh files: Gmsh .msh (2.2 and 4.1, text and binary), Wavefront .obj and Stanford .ply.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

/// Contents of a mesh file before anything is made of it. Coordinates are always three, ids 0-based.
struct MeshFile {
  std::vector<Vec<3>> vertices;
  std::vector<std::array<int, 2>> edges;      ///< line elements / `l` polylines / `edge`
  std::vector<std::array<int, 3>> triangles;  ///< faces of .obj and .ply with more corners are an error
  std::vector<std::array<int, 4>> tetrahedra;
  std::vector<int> triangle_body, tetrahedron_body;  ///< first physical tag; 0 if none
};

/// By the ending of the name. Throws InputError naming file, line or byte, found and expected: missing, truncated, unknown
/// version, unknown or higher-order element type, index out of range, non-finite coordinate.
MeshFile read_mesh_file(const std::filesystem::path& file);

}  // namespace itr
