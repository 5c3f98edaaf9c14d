// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "fem/chord_levels.hpp"
#include "fem/chords.hpp"

namespace itr {

/// The boundary as simplices between nodes and further points of its curves, which are fixed combinations of nodes.
/// Simplices of neighbours meet at common points whatever their levels.
template <int Dim>
struct RefinedChords {
  using Facet = typename MeshTypes<Dim>::Facet;
  using Coordinates = std::array<double, Dim>;  ///< barycentric, in a facet of the mesh
  using Weights = std::vector<std::pair<int, double>>;

  std::vector<Facet> facets;                              ///< oriented as the boundary; ids of nodes, then of points
  std::vector<FacetId> parents;                           ///< by facet: the facet of the mesh that it is a part of
  std::vector<std::array<Coordinates, Dim>> coordinates;  ///< by facet: of its corners in the parent
  std::vector<Weights> points;                            ///< nodes that a point combines, with their weights
};

/// Adds a boundary facet's part of the surface that can touch: simplices through all of its nodes (for_each_chord).
template <int Dim>
void add_chord_facets(const Mesh<Dim>& mesh, FacetId f, std::vector<typename MeshTypes<Dim>::Facet>& chords) {
  const auto node_of = nodes_of_edges(mesh);
  for_each_chord<Dim>(mesh.facet(f), node_of, [&](const auto& ids) { chords.push_back(ids); });
}

/// The chords of all boundary facets (see add_chord_facets), in the order of these.
template <int Dim>
std::vector<typename MeshTypes<Dim>::Facet> boundary_chords(const Mesh<Dim>& mesh) {
  std::vector<typename MeshTypes<Dim>::Facet> chords;
  for (const FacetId f : mesh.live_facets()) add_chord_facets(mesh, f, chords);
  return chords;
}

/// A weighted sum of the values at(node) of nodes.
template <int Dim, typename Weights, typename At>
Vec<Dim> combined(const Weights& weights, const At& at) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const auto& [node, weight] : weights) sum += weight * at(node);
  return sum;
}

/// Returns the boundary of the mesh in simplices, with the chords of each curved edge halved by its level.
template <int Dim>
RefinedChords<Dim> refine_chords(const Mesh<Dim>& mesh, const ChordLevels& levels);

}  // namespace itr
