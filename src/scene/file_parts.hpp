// SPDX-License-Identifier: MIT
// Groups of a mesh file that a scene asks for, on the mesh that is made of the file.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mesh/mesh_file.hpp"
#include "sets.hpp"

namespace itr::scene {

/// Cells, facets or vertices that are in the same groups.
struct FilePart {
  int number = 0;            ///< that of the first group with one
  std::set<Label> labels{};  ///< that the scene asks for
  std::string name{};        ///< that of the group with the number
  int preferred = 0;         ///< the number of the first group that it asks for
};

template <int Dim>
class FileParts {
 public:
  FileParts(const MeshFile& file, const References& references, Sets& sets);

  /// By cell of the file, its part; for a Mesh to hold as body.
  std::vector<int> cell_parts();
  /// Sets the tags of the boundary's facets and vertices to their parts. A group of vertices holds the facets that have all
  /// vertices in it, and besides vertices that no such facet has. `renumbered`: vertices of the mesh by those of the file.
  /// Returns a sentence on each group that holds vertices inside of the mesh.
  std::vector<std::string> tag(Mesh<Dim>& mesh, const std::vector<int>& renumbered);

  const FilePart& part(int index) const { return parts_[index]; }
  /// Boundary facets of the group with a number, which a selection may give others.
  bool has_number(int part, int number) const { return part != kNoTag && parts_[part].labels.contains({number}); }

 private:
  int with_number(int number);
  int with(int part, int group);
  bool asks_for(const MeshGroup& group, const std::set<Label>& labels) const;
  void tag_facets(Mesh<Dim>& mesh, const std::vector<int>& renumbered, int group);
  void tag_vertices(Mesh<Dim>& mesh, const std::vector<char>& is_in, int group, std::vector<std::string>& notes);
  void mark_facet(Mesh<Dim>& mesh, FacetId f, int group) { mesh.set_facet_tag(f, with(mesh.facet_tag(f), group)); }

  const MeshFile& file_;
  const References& references_;
  Sets& sets_;
  std::vector<FilePart> parts_;
  std::map<int, int> with_number_;
  std::map<std::pair<int, int>, int> with_;  ///< by part, kNoTag for none, and group
};

}  // namespace itr::scene
