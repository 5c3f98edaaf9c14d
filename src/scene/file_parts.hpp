// SPDX-License-Identifier: MIT
// Groups of a mesh file that a scene asks for, on the mesh that is made of the file.
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mesh/mesh_file.hpp"
#include "sets.hpp"

namespace itr::scene {

template <int Dim>
const std::vector<std::array<int, Dim>>& facets_of(const MeshFile& file) {
  if constexpr (Dim == 2)
    return file.edges;
  else
    return file.triangles;
}

/// The number and the name of a group, as far as it has them.
inline std::vector<Label> labels_of(const MeshGroup& group) {
  std::vector<Label> labels;
  if (group.number > 0) labels.push_back({group.number});
  if (!group.name.empty()) labels.push_back({0, group.name});
  return labels;
}

/// Cells, facets or vertices that are in the same groups.
struct FilePart {
  int number = 0;            ///< that of the first group with one
  std::set<Label> labels{};  ///< that the scene asks for
  std::string name{};        ///< that of the group with the number
  int preferred = kNone;     ///< the number of the first group that it asks for, if it has one
};

template <int Dim>
class FileParts {
 public:
  FileParts(const MeshFile& file, const References& references, Sets& sets)
      : file_(file), references_(references), sets_(sets) {
    for (const MeshGroup& group : file.groups)
      for (const Label& label : labels_of(group)) {
        const bool is_of_cells = group.dim == Dim;
        sets.bodies.explain(label, is_of_cells ? "" : "a group of the mesh file that holds no cells");
        sets.surfaces.explain(label, is_of_cells ? "a group of cells of the mesh file" : "");
      }
  }

  /// By cell of the file, its part; for a Mesh to hold as body.
  std::vector<int> cell_parts() {
    std::vector<int> parts = Dim == 2 ? file_.triangle_body : file_.tetrahedron_body;
    for (int& part : parts) part = with_number(part);
    for (std::size_t g = 0; g < file_.groups.size(); ++g) {
      const MeshGroup& group = file_.groups[g];
      if (group.dim != Dim || group.name.empty() || !references_.bodies.contains({0, group.name})) continue;
      for (const int cell : group.members) parts[cell] = with(parts[cell], static_cast<int>(g));
    }
    return parts;
  }
  /// Sets the tags of the boundary's facets and vertices to their parts. A group of vertices holds the facets that have all
  /// vertices in it, and besides vertices that no such facet has. `renumbered`: vertices of the mesh by those of the file.
  /// Returns a sentence on each group that holds vertices inside of the mesh.
  std::vector<std::string> tag(Mesh<Dim>& mesh, const std::vector<int>& renumbered) {
    std::vector<std::string> notes;
    for (std::size_t g = 0; g < file_.groups.size(); ++g) {
      const MeshGroup& group = file_.groups[g];
      if (group.dim >= Dim || !asks_for(group, references_.surfaces)) continue;
      if (group.dim == Dim - 1) {
        tag_facets(mesh, renumbered, static_cast<int>(g));
        continue;
      }
      std::vector<char> is_in(mesh.num_vertices(), 0);
      for (const int member : group.members) {
        if (group.dim == 0 && renumbered[member] != kNone) is_in[renumbered[member]] = 1;
        if (group.dim == 1)
          for (const int v : file_.edges[member])
            if (renumbered[v] != kNone) is_in[renumbered[v]] = 1;
      }
      tag_vertices(mesh, is_in, static_cast<int>(g), notes);
    }
    return notes;
  }

  const FilePart& part(int index) const { return parts_[index]; }
  /// Boundary facets of the group with a number, which a selection may give others.
  bool has_number(int part, int number) const { return part != kNoTag && parts_[part].labels.contains({number}); }

 private:
  int with_number(int number) {
    const auto [found, is_new] = with_number_.try_emplace(number, static_cast<int>(parts_.size()));
    if (!is_new) return found->second;
    const auto group = std::find_if(file_.groups.begin(), file_.groups.end(), [&](const MeshGroup& other) {
      return other.dim == Dim && number > 0 && other.number == number;
    });
    FilePart part{number};
    if (group != file_.groups.end()) part.name = group->name;
    parts_.push_back(std::move(part));
    return found->second;
  }
  int with(int part, int group) {
    const auto [found, is_new] = with_.try_emplace({part, group}, static_cast<int>(parts_.size()));
    if (!is_new) return found->second;
    const MeshGroup& added = file_.groups[group];
    FilePart both = part == kNoTag ? FilePart() : parts_[part];
    if (both.number == 0) both.number = added.number, both.name = added.name;
    if (both.labels.empty()) both.preferred = added.number > 0 ? added.number : kNone;
    const bool is_of_cells = added.dim == Dim;
    for (const Label& label : labels_of(added)) {
      const bool counts = !(is_of_cells && label.name.empty());  // the number of cells is that of their first group
      if (counts && (is_of_cells ? references_.bodies : references_.surfaces).contains(label)) both.labels.insert(label);
    }
    parts_.push_back(std::move(both));
    return found->second;
  }
  bool asks_for(const MeshGroup& group, const std::set<Label>& labels) const {
    const std::vector<Label> own = labels_of(group);
    return std::any_of(own.begin(), own.end(), [&](const Label& label) { return labels.contains(label); });
  }
  void tag_facets(Mesh<Dim>& mesh, const std::vector<int>& renumbered, int group) {
    const auto& facets = facets_of<Dim>(file_);
    bool is_on_boundary = false;
    for (const int member : file_.groups[group].members) {
      typename Mesh<Dim>::Facet facet = facets[member];
      for (int& v : facet) v = renumbered[v];
      if (std::find(facet.begin(), facet.end(), kNone) != facet.end()) continue;
      if (const FacetId f = mesh.find_facet(facet); f != kNone) {
        is_on_boundary = true;
        mark_facet(mesh, f, group);
      }
    }
    if (!is_on_boundary)
      for (const Label& label : labels_of(file_.groups[group]))
        sets_.surfaces.explain(label, "a group of facets of the mesh file, none of which is on the boundary");
  }
  void tag_vertices(Mesh<Dim>& mesh, const std::vector<char>& is_in, int group, std::vector<std::string>& notes) {
    std::vector<char> is_of_facet(is_in.size(), 0);
    const bool is_of_points = file_.groups[group].dim == 0;
    for (FacetId f = 0; is_of_points && f < mesh.num_facets(); ++f) {
      const auto& facet = mesh.facet(f);
      if (!std::all_of(facet.begin(), facet.end(), [&](int v) { return is_in[v]; })) continue;
      mark_facet(mesh, f, group);
      for (const int v : facet) is_of_facet[v] = 1;
    }
    int inner = 0;
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
      if (!is_in[v] || is_of_facet[v]) continue;
      if (mesh.is_boundary(v))
        mesh.set_vertex_tag(v, with(mesh.vertex_tag(v), group));
      else
        ++inner;
    }
    if (inner > 0)
      notes.push_back(std::to_string(inner) + " vertices of \"" + text_of(labels_of(file_.groups[group]).back()) +
                      "\" are inside of the mesh, where no condition holds them");
  }
  void mark_facet(Mesh<Dim>& mesh, FacetId f, int group) { mesh.set_facet_tag(f, with(mesh.facet_tag(f), group)); }

  const MeshFile& file_;
  const References& references_;
  Sets& sets_;
  std::vector<FilePart> parts_;
  std::map<int, int> with_number_;
  std::map<std::pair<int, int>, int> with_;  ///< by part, kNoTag for none, and group
};

}  // namespace itr::scene
