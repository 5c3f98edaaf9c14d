// SPDX-License-Identifier: MIT
// Checks that the files of edits share.
#pragma once

#include <algorithm>
#include <limits>

#include "geometry/measures.hpp"
#include "geometry/predicates.hpp"
#include "mesh/cell_of_facet.hpp"
#include "remesh/edits.hpp"

namespace itr {

template <std::size_t N>
std::array<int, N> replaced(std::array<int, N> ids, int from, int to) {
  std::replace(ids.begin(), ids.end(), from, to);
  return ids;
}

/// Whether both ends have the same tag: where the edge is on the boundary, all of it is held by conditions with that tag.
template <int Dim>
bool has_tag(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  return mesh.vertex_tag(edge[0]) != kNoTag && mesh.vertex_tag(edge[0]) == mesh.vertex_tag(edge[1]);
}

/// Whether a collapse makes an edge or a facet of the boundary that is held by its vertices' tags and was not.
template <int Dim>
bool extends_tags(const Mesh<Dim>& mesh, const Edit<Dim>& edit);

/// Facets between two of these cells that are of different bodies, vertices ascending.
template <int Dim>
std::vector<typename Mesh<Dim>::Facet> interfaces_among(const Mesh<Dim>& mesh, std::span<const CellId> cells);

/// Quality of a cell of which one vertex (kNone: none) is at another place; 0 where it is not positively oriented, by the
/// exact predicate where round-off could decide.
template <int Dim>
double quality_with(const Mesh<Dim>& mesh, const typename Mesh<Dim>::Cell& cell, VertexId moved, const Vec<Dim>& place) {
  constexpr double kCertain = 1e-9;
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = cell[k] == moved ? place : mesh.rest(cell[k]);
  const double quality = simplex_quality<Dim>(p);
  if (quality > kCertain) return quality;
  const bool positive = [&] {
    if constexpr (Dim == 2)
      return orientation(p[0], p[1], p[2]) > 0;
    else
      return orientation(p[0], p[1], p[2], p[3]) > 0;
  }();
  return positive && simplex_volume<Dim>(p) > 0 ? std::max(quality, std::numeric_limits<double>::min()) : 0;
}

/// Worst quality of these cells, at most 1.
template <int Dim>
double worst_quality(const Mesh<Dim>& mesh, std::span<const CellId> cells) {
  double worst = 1;
  for (const CellId c : cells) worst = std::min(worst, mesh.quality(c));
  return worst;
}

}  // namespace itr
