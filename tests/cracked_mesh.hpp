// SPDX-License-Identifier: MIT
// Meshes with random cracks: faces that coincide at rest and share no vertex.
#pragma once

#include <algorithm>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

/// Cuts a mesh along inner facets (ascending vertices): each vertex is there once for each group of its cells that facets at
/// it connect which are not cut.
template <int Dim>
Mesh<Dim> cut(const Mesh<Dim>& mesh, const std::set<typename MeshTypes<Dim>::Facet>& facets) {
  using Facet = typename MeshTypes<Dim>::Facet;
  std::vector<Vec<Dim>> rest;
  std::vector<typename Mesh<Dim>::Cell> cells;
  std::vector<int> bodies;
  for (VertexId v = 0; v < mesh.node_slots(); ++v) rest.push_back(mesh.rest(v));
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    cells.push_back(mesh.cell(c));
    bodies.push_back(mesh.body(c));
  }
  for (VertexId v = 0; v < mesh.node_slots(); ++v) {
    const auto around = mesh.cells_of(v);
    std::vector<int> group(around.size(), kNone);
    const auto fraction = [&](CellId a, CellId b) {
      std::vector<int> common;
      for (const int w : mesh.cell(a))
        if (std::ranges::count(mesh.cell(b), w)) common.push_back(w);
      if (common.size() != Dim) return false;
      Facet facet{};
      std::copy(common.begin(), common.end(), facet.begin());
      return !facets.contains(ascending(facet));
    };
    int groups = 0;
    for (std::size_t i = 0; i < around.size(); ++i) {
      if (group[i] != kNone) continue;
      std::vector<std::size_t> stack{i};
      group[i] = groups;
      while (!stack.empty()) {
        const std::size_t at = stack.back();
        stack.pop_back();
        for (std::size_t j = 0; j < around.size(); ++j)
          if (group[j] == kNone && fraction(around[at], around[j])) {
            group[j] = groups;
            stack.push_back(j);
          }
      }
      ++groups;
    }
    for (int g = 1; g < groups; ++g) {
      for (std::size_t i = 0; i < around.size(); ++i)
        if (group[i] == g) std::ranges::replace(cells[around[i]], v, static_cast<int>(rest.size()));
      rest.push_back(Vec<Dim>(rest[v]));
    }
  }
  Mesh<Dim> result(rest, cells, bodies);
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    for (FacetId g = 0; g < result.facet_slots(); ++g) {
      const auto same = [&](int k) { return result.rest(result.facet(g)[k]) == mesh.rest(mesh.facet(f)[k]); };
      if (same(0) && same(1) && same(Dim - 1)) result.set_facet_tag(g, mesh.facet_tag(f));
    }
  return result;
}

/// Facets between two cells, ascending vertices.
template <int Dim>
std::vector<typename MeshTypes<Dim>::Facet> inner_facets(const Mesh<Dim>& mesh) {
  std::set<typename MeshTypes<Dim>::Facet> found;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    for (int k = 0; k <= Dim; ++k)
      if (const auto facet = ascending(opposite_facet<Dim>(mesh.cell(c), k)); mesh.find_facet(facet) == kNone)
        found.insert(facet);
  return {found.begin(), found.end()};
}

/// Cracks that grow from some facets over neighbouring ones, in whatever direction: plane or not, through the body or not.
template <int Dim>
Mesh<Dim> cracked_at_random(const Mesh<Dim>& mesh, int seeds, int size, std::mt19937& random) {
  using Facet = typename MeshTypes<Dim>::Facet;
  const std::vector<Facet> inner = inner_facets(mesh);
  std::set<Facet> cracks;
  for (int s = 0; s < seeds; ++s) {
    std::vector<Facet> grown{inner[random() % inner.size()]};
    for (int tries = 0; static_cast<int>(grown.size()) < size && tries < 20 * size; ++tries) {
      const Facet& at = grown[random() % grown.size()];
      std::vector<Facet> next;
      for (const Facet& facet : inner) {
        int shared = 0;
        for (const int v : facet) shared += static_cast<int>(std::ranges::count(at, v));
        if (shared == Dim - 1) next.push_back(facet);
      }
      if (!next.empty()) grown.push_back(next[random() % next.size()]);
    }
    cracks.insert(grown.begin(), grown.end());
  }
  return cut(mesh, cracks);
}

/// How many vertices lie where another one does.
template <int Dim>
int num_doubled(const Mesh<Dim>& mesh) {
  int count = 0;
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    for (VertexId w = 0; w < mesh.node_slots(); ++w)
      if (w != v && mesh.rest(w) == mesh.rest(v)) {
        ++count;
        break;
      }
  return count;
}

}  // namespace itr
