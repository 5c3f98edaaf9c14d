// SPDX-License-Identifier: MIT
#include "mesh/mesh_file.hpp"

#include <algorithm>
#include <utility>

#include "core/quoted.hpp"
#include "core/read_file.hpp"
#include "readers.hpp"

namespace itr {

namespace fs = std::filesystem;

namespace {

template <std::size_t N>
void check_indices(const std::vector<std::array<int, N>>& elements, std::size_t num_vertices, const std::string& kind,
                   const fs::path& file) {
  for (std::size_t i = 0; i < elements.size(); ++i)
    for (const int v : elements[i])
      if (v < 0 || static_cast<std::size_t>(v) >= num_vertices)
        throw InputError({file.string(), kind + " " + std::to_string(i), "vertex " + std::to_string(v) + " (0-based)",
                          "0 to " + std::to_string(num_vertices) + " - 1"});
}

void check(const MeshFile& mesh, const fs::path& file) {
  if (mesh.vertices.empty()) throw InputError({file.string(), "", "no vertices", "a mesh"});
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      throw InputError({file.string(), "vertex " + std::to_string(v), "a coordinate that is not finite", "finite ones"});
  check_indices(mesh.edges, mesh.vertices.size(), "edge", file);
  check_indices(mesh.triangles, mesh.vertices.size(), "triangle", file);
  check_indices(mesh.tetrahedra, mesh.vertices.size(), "tetrahedron", file);
}

}  // namespace

std::string split_advice(const fs::path& file) {
  return "`python3 -m itr.simplices " + file.filename().string() + " new.msh` splits other cells into these";
}

MeshFile read_mesh_file(const fs::path& file) {
  constexpr std::pair<const char*, MeshFile (*)(std::string_view, const fs::path&)> kReaders[] = {
      {".msh", read_msh}, {".inp", read_inp}, {".obj", read_obj}, {".ply", read_ply},   {".stl", read_stl},
      {".vtk", read_vtk}, {".vtu", read_vtu}, {".vtp", read_vtu}, {".mesh", read_medit}};
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto reader =
      std::find_if(std::begin(kReaders), std::end(kReaders), [&](const auto& known) { return ending == known.first; });
  if (reader == std::end(kReaders))
    throw InputError(
        {file.string(), "", "a name that ends in " + quoted(std::string_view(ending)),
         ".msh, .mesh, .inp, .vtu, .vtp, .vtk, .stl, .obj or .ply (geometry of CAD is meshed by Gmsh, other meshes are "
         "converted by `meshio convert`: docs/user-guide.md, \"Mesh files\")"});
  const std::optional<std::string> bytes = read_file(file);
  if (!bytes) throw InputError({file.string(), "", "no readable file", "a mesh file"});
  MeshFile mesh = reader->second(*bytes, file);
  check(mesh, file);
  mesh.triangle_body.resize(mesh.triangles.size());
  return mesh;
}

}  // namespace itr
