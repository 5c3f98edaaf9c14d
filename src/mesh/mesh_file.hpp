// SPDX-License-Identifier: MIT
// Mesh files: Gmsh .msh (2.2 and 4.1), Abaqus and CalculiX .inp, VTK .vtk, .vtu and .vtp, .stl, Wavefront .obj and Stanford
// .ply.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "itr/types.hpp"

namespace itr {

/// Elements of one dimension, or vertices, that a file gives a number or a name: a physical group, an NSET, a surface.
struct MeshGroup {
  int dim = 0;                 ///< of its elements; 0: vertices
  int number = 0;              ///< above 0; 0: the file has a name only
  std::string name{};          ///< may be empty
  std::vector<int> members{};  ///< ascending: into vertices, edges, triangles or tetrahedra
};

/// Contents of a mesh file before anything is made of it: what each reader returns. Coordinates are always three, ids
/// 0-based; of elements of second order only the corners are here.
struct MeshFile {
  std::vector<Vec<3>> vertices;
  std::vector<std::array<int, 2>> edges;      ///< line elements / `l` polylines / `edge`
  std::vector<std::array<int, 3>> triangles;  ///< faces of .obj and .ply with more corners are an error
  std::vector<std::array<int, 4>> tetrahedra;
  std::vector<int> triangle_body, tetrahedron_body;  ///< number of the first group; 0 if none
  std::vector<MeshGroup> groups;                     ///< in the order of the file
  double sag = 0;                  ///< largest distance of a second-order node from the middle of its edge, by its length
  int sagging_edges = 0;           ///< edges whose node is off the middle by more than rounding
  std::string sag_place;           ///< "node 7": the one of that distance
  std::vector<std::string> notes;  ///< sentences on what is legal and suspicious
};

/// By the ending of the name. Throws InputError naming file, line, byte or element, found and expected: missing, truncated,
/// unknown version, unknown element type, index out of range, non-finite coordinate.
MeshFile read_mesh_file(const std::filesystem::path& file);

}  // namespace itr
