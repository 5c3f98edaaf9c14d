// SPDX-License-Identifier: MIT
// Fields at a place of the mesh before an edit, as weighted sums over its nodes.
#pragma once

#include <cmath>
#include <limits>
#include <span>

#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"

namespace itr {

/// Sets the parents and weights of `target` (an Edit's Value or NewNode) to the nodes and shape functions of that one of
/// these cells in which `place` is deepest. Returns false if the least barycentric coordinate there is below `least_depth`.
template <int Dim, typename Target>
bool find_parents(const Mesh<Dim>& mesh, std::span<const CellId> cells, const Vec<Dim>& place, double least_depth,
                  Target& target) {
  constexpr double kNothing = 1e-12;  // what a place on a facet may have by round-off
  double deepest = least_depth;
  CellId found = kNone;
  std::array<double, Dim + 1> l{};
  for (const CellId c : cells) {
    const Vec<Dim> tail = mesh.inverse_rest_edges(c) * (place - mesh.rest(mesh.cell(c)[0]));
    const double first = 1 - tail.sum(), depth = std::min(first, tail.minCoeff());
    if (!(depth > deepest)) continue;
    deepest = depth;
    found = c;
    l[0] = first;
    for (int k = 0; k < Dim; ++k) l[k + 1] = tail[k];
  }
  target.num_parents = 0;
  if (found == kNone) return false;
  double sum = 0;
  const auto add = [&](VertexId v, double weight) {
    if (std::abs(weight) < kNothing) return;
    target.parents[target.num_parents] = v;
    target.weights[target.num_parents++] = weight;
    sum += weight;
  };
  const CurvedCell<Dim> cell = cell_before(mesh, found);
  if (cell.edges) {
    const auto shapes = quadratic_shapes<Dim>(cell.edges, l);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k) add(cell.nodes[k], shapes[k]);  // 0 at straight edges
  } else {
    for (int k = 0; k <= Dim; ++k)
      if (l[k] > 0) add(mesh.cell(found)[k], l[k]);
  }
  for (int k = 0; k < target.num_parents; ++k) target.weights[k] /= sum;
  return target.num_parents > 0;
}

/// Curves an edge between two vertices of the mesh that the edit inserts or of which it sets one end. The node has what the
/// old functions have at its place, which lies in the cells that the edit removes.
template <int Dim>
void insert_node(const Mesh<Dim>& mesh, VertexId a, VertexId b, Edit<Dim>& edit) {
  typename Edit<Dim>::NewNode node{edge_key(a, b)};
  constexpr double kAnywhere = -std::numeric_limits<double>::infinity();  // flat surfaces are so up to a tolerance
  find_parents<Dim>(mesh, edit.removed_cells, (rest_after(mesh, edit, a) + rest_after(mesh, edit, b)) / 2, kAnywhere, node);
  edit.inserted_nodes.push_back(node);
}

}  // namespace itr
