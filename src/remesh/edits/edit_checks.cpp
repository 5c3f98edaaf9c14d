// SPDX-License-Identifier: MIT
#include "edit_checks.hpp"

namespace itr {

std::string_view name(Refusal refusal) {
  static constexpr std::string_view kNames[] = {"none",       "not_asked", "depth",        "length",   "dhat",
                                                "prediction", "gone",      "non_manifold", "held",     "link",
                                                "exists",     "long_ring", "shape",        "overhang", "outside",
                                                "cost",       "invalid",   "bound",        "energy",   "no_unknowns"};
  static_assert(std::size(kNames) == kRefusals);
  return kNames[static_cast<int>(refusal)];
}

template <int Dim>
bool extends_tags(const Mesh<Dim>& mesh, const Edit<Dim>& edit) {
  return std::any_of(edit.inserted_facets.begin(), edit.inserted_facets.end(), [&](const auto& facet) {
    int tagged = 0;
    for (int i = 0; i < Dim; ++i) {
      const EdgeKey side{facet.vertices[i], facet.vertices[(i + 1) % Dim]};
      if (!has_tag(mesh, side)) continue;
      ++tagged;
      if (mesh.facets_of_edge(side).empty()) return true;
    }
    return tagged == Dim;
  });
}

template <int Dim>
std::vector<typename Mesh<Dim>::Facet> interfaces_among(const Mesh<Dim>& mesh, std::span<const CellId> cells) {
  std::vector<typename Mesh<Dim>::Facet> found;
  if (std::all_of(cells.begin(), cells.end(), [&](CellId c) { return mesh.body(c) == mesh.body(cells[0]); })) return found;
  std::vector<std::pair<typename Mesh<Dim>::Facet, int>> faces;
  for (const CellId c : cells)
    for (int k = 0; k <= Dim; ++k) faces.emplace_back(ascending(opposite_facet<Dim>(mesh.cell(c), k)), mesh.body(c));
  std::sort(faces.begin(), faces.end());
  for (std::size_t i = 1; i < faces.size(); ++i)
    if (faces[i].first == faces[i - 1].first && faces[i].second != faces[i - 1].second) found.push_back(faces[i].first);
  return found;
}

template bool extends_tags(const Mesh<2>&, const Edit<2>&);
template bool extends_tags(const Mesh<3>&, const Edit<3>&);
template std::vector<Mesh<2>::Facet> interfaces_among(const Mesh<2>&, std::span<const CellId>);
template std::vector<Mesh<3>::Facet> interfaces_among(const Mesh<3>&, std::span<const CellId>);

}  // namespace itr
