// SPDX-License-Identifier: MIT
// The formats behind read_mesh_file; indices and coordinates are checked by it.
#pragma once

#include <string_view>

#include "itr/core.hpp"
#include "mesh/mesh_file.hpp"

namespace itr {

/// How quadrilaterals, hexahedra, prisms and pyramids become simplices.
std::string split_advice(const std::filesystem::path& file);

MeshFile read_msh(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_obj(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_ply(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_medit(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_inp(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_stl(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_vtk(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_vtu(std::string_view bytes, const std::filesystem::path& file);

}  // namespace itr
