// SPDX-License-Identifier: MIT
// Shape functions of simplices with curved edges. With barycentric coordinates l_i, a curved edge ij has 4 l_i l_j, and the
// vertex i has l_i - sum over its curved edges ij of 2 l_i l_j; a straight edge has none (Lagrange's where all are curved).
#pragma once

#include <algorithm>
#include <array>

#include "geometry/quadratic_validity.hpp"
#include "itr/types.hpp"

namespace itr {

/// Calls f(edge, i, j) for the edges of a simplex, i < j.
template <int Dim, typename F>
void for_each_edge(const F& f) {
  for (int i = 0, edge = 0; i <= Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j, ++edge) f(edge, i, j);
}

/// Whether a simplex with these curved edges has its k-th node: all vertices, and the nodes of curved edges.
template <int Dim>
bool has_node(CurvedEdges curved, int k) {
  return k <= Dim || curved >> (k - Dim - 1) & 1;
}

/// Sets the nodes of a simplex's edges, at a straight edge its first vertex, and returns which edges are curved. `node_of(a,
/// b)`: the node of an edge or kNone.
template <int Dim, typename NodeOf>
CurvedEdges find_edge_nodes(const std::array<int, Dim + 1>& vertices, const NodeOf& node_of,
                            std::array<int, kSimplexEdges<Dim>>& nodes) {
  CurvedEdges curved = 0;
  for_each_edge<Dim>([&](int edge, int i, int j) {
    const int node = node_of(vertices[i], vertices[j]);
    nodes[edge] = node == kNone ? vertices[i] : node;
    if (node != kNone) curved = static_cast<CurvedEdges>(curved | 1 << edge);
  });
  return curved;
}

/// Values of the shape functions at barycentric coordinates l; zero at straight edges.
template <int Dim>
Vec<kQuadraticNodes<Dim>> quadratic_shapes(CurvedEdges curved, const std::array<double, Dim + 1>& l) {
  Vec<kQuadraticNodes<Dim>> shapes = Vec<kQuadraticNodes<Dim>>::Zero();
  for (int i = 0; i <= Dim; ++i) shapes[i] = l[i];
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (!(curved >> edge & 1)) return;
    const double product = l[i] * l[j];
    shapes[Dim + 1 + edge] = 4 * product;
    shapes[i] -= 2 * product;
    shapes[j] -= 2 * product;
  });
  return shapes;
}

/// Gradients of the shape functions as columns; `linear` has those of l as columns. Zero at straight edges.
template <int Dim, int Rows>
Eigen::Matrix<double, Rows, kQuadraticNodes<Dim>> quadratic_gradients(CurvedEdges curved,
                                                                      const std::array<double, Dim + 1>& l,
                                                                      const Eigen::Matrix<double, Rows, Dim + 1>& linear) {
  Eigen::Matrix<double, Rows, kQuadraticNodes<Dim>> gradients = Eigen::Matrix<double, Rows, kQuadraticNodes<Dim>>::Zero();
  if (curved == kAllCurved<Dim>) {  // the same, since the gradients of l sum to zero
    for (int i = 0; i <= Dim; ++i) gradients.col(i) = (4 * l[i] - 1) * linear.col(i);
    for_each_edge<Dim>([&](int edge, int i, int j) {
      gradients.col(Dim + 1 + edge) = (4 * l[i]) * linear.col(j) + (4 * l[j]) * linear.col(i);
    });
    return gradients;
  }
  gradients.template leftCols<Dim + 1>() = linear;
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (!(curved >> edge & 1)) return;
    const Vec<Rows> of_product = l[i] * linear.col(j) + l[j] * linear.col(i);
    gradients.col(Dim + 1 + edge) = 4 * of_product;
    gradients.col(i) -= 2 * of_product;
    gradients.col(j) -= 2 * of_product;
  });
  return gradients;
}

}  // namespace itr
