// SPDX-License-Identifier: MIT
#include "file_parts.hpp"

#include <algorithm>

namespace itr::scene {

namespace {

template <int Dim>
const std::vector<std::array<int, Dim>>& facets_of(const MeshFile& file) {
  if constexpr (Dim == 2)
    return file.edges;
  else
    return file.triangles;
}

/// The number and the name of a group, as far as it has them.
std::vector<Label> labels_of(const MeshGroup& group) {
  std::vector<Label> labels;
  if (group.number > 0) labels.push_back({group.number});
  if (!group.name.empty()) labels.push_back({0, group.name});
  return labels;
}

}  // namespace

template <int Dim>
FileParts<Dim>::FileParts(const MeshFile& file, const References& references, Sets& sets)
    : file_(file), references_(references), sets_(sets) {
  for (const MeshGroup& group : file.groups)
    for (const Label& label : labels_of(group)) {
      const bool is_of_cells = group.dim == Dim;
      sets.bodies.explain(label, is_of_cells ? "" : "a group of the mesh file that holds no cells");
      sets.surfaces.explain(label, is_of_cells ? "a group of cells of the mesh file" : "");
    }
}

template <int Dim>
std::vector<int> FileParts<Dim>::cell_parts() {
  std::vector<int> parts = Dim == 2 ? file_.triangle_body : file_.tetrahedron_body;
  for (int& part : parts) part = with_number(part);
  for (std::size_t g = 0; g < file_.groups.size(); ++g) {
    const MeshGroup& group = file_.groups[g];
    if (group.dim != Dim || group.name.empty() || !references_.bodies.contains({0, group.name})) continue;
    for (const int cell : group.members) parts[cell] = with(parts[cell], static_cast<int>(g));
  }
  return parts;
}

template <int Dim>
std::vector<std::string> FileParts<Dim>::tag(Mesh<Dim>& mesh, const std::vector<int>& renumbered) {
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

template <int Dim>
void FileParts<Dim>::tag_facets(Mesh<Dim>& mesh, const std::vector<int>& renumbered, int group) {
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

template <int Dim>
void FileParts<Dim>::tag_vertices(Mesh<Dim>& mesh, const std::vector<char>& is_in, int group,
                                  std::vector<std::string>& notes) {
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

template <int Dim>
bool FileParts<Dim>::asks_for(const MeshGroup& group, const std::set<Label>& labels) const {
  const std::vector<Label> own = labels_of(group);
  return std::any_of(own.begin(), own.end(), [&](const Label& label) { return labels.contains(label); });
}

template <int Dim>
int FileParts<Dim>::with_number(int number) {
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

template <int Dim>
int FileParts<Dim>::with(int part, int group) {
  const auto [found, is_new] = with_.try_emplace({part, group}, static_cast<int>(parts_.size()));
  if (!is_new) return found->second;
  const MeshGroup& added = file_.groups[group];
  FilePart both = part == kNoTag ? FilePart() : parts_[part];
  if (both.number == 0) both.number = added.number, both.name = added.name;
  if (both.labels.empty()) both.preferred = added.number;
  const bool is_of_cells = added.dim == Dim;
  for (const Label& label : labels_of(added)) {
    const bool counts = !(is_of_cells && label.name.empty());  // the number of cells is that of their first group
    if (counts && (is_of_cells ? references_.bodies : references_.surfaces).contains(label)) both.labels.insert(label);
  }
  parts_.push_back(std::move(both));
  return found->second;
}

template class FileParts<2>;
template class FileParts<3>;

}  // namespace itr::scene
