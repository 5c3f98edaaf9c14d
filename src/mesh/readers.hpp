// SPDX-License-Identifier: MIT
// The formats behind read_mesh_file; indices and coordinates are checked by it.
#pragma once

#include <string_view>

#include "itr/core/error.hpp"
#include "mesh/mesh_file.hpp"

namespace itr {

MeshFile read_msh(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_obj(std::string_view bytes, const std::filesystem::path& file);
MeshFile read_ply(std::string_view bytes, const std::filesystem::path& file);

}  // namespace itr
