// SPDX-License-Identifier: MIT
// Cells with a vertex numbering of their own: the whole mesh, or the patch around an edit. Every energy term is built from
// one, so global and local problems share all their code.
#pragma once

#include <vector>

#include "itr/fem/quadratic.hpp"
#include "itr/mesh/mesh.hpp"

namespace itr {

template <int Dim>
struct CellSet {
  struct Element {
    std::array<int, Dim + 1> vertices;  ///< local ids
    int body;
    double volume;           ///< rest volume [m^Dim]
    Mat<Dim> inverse_edges;  ///< inverse of the matrix of rest edges
    int part = kNone;        ///< Mesh::part
  };
  struct BoundaryFacet {
    std::array<int, Dim> vertices;  ///< local ids
    int tag;
    int part = kNone;  ///< of its cell
  };
  /// A cell with at least one curved edge.
  struct CurvedElement {
    std::array<int, kQuadraticNodes<Dim>> nodes;  ///< local ids; at a straight edge its first vertex, of shape function 0
    CurvedEdges curved;
    int body;
    double volume;           ///< rest volume [m^Dim]
    Mat<Dim> inverse_edges;  ///< inverse of the matrix of rest edges
    CellId cell;             ///< in the mesh
    int part = kNone;        ///< Mesh::part
  };
  /// A boundary facet with at least one curved edge.
  struct CurvedFacet {
    std::array<int, kQuadraticNodes<Dim - 1>> nodes;  ///< as those of a curved element
    CurvedEdges curved;
    int tag;
    int part = kNone;  ///< of its cell
  };
  int num_vertices = 0;        ///< length of fields / Dim; may exceed the cells' vertices (obstacles)
  std::vector<Vec<Dim>> rest;  ///< per local vertex
  std::vector<Element> elements;
  std::vector<BoundaryFacet> facets;
  std::vector<CurvedElement> curved_elements;
  std::vector<CurvedFacet> curved_facets;
};

/// Calls f(node) for the vertices of a simplex of the mesh, then for the nodes of its curved edges.
template <int Dim, std::size_t N, typename F>
void for_each_node(const Mesh<Dim>& mesh, const std::array<VertexId, N>& simplex, const F& f) {
  for (const VertexId v : simplex) f(v);
  for_each_edge<static_cast<int>(N) - 1>([&](int, int i, int j) {
    if (const int node = mesh.node_of(simplex[i], simplex[j]); node != kNone) f(node);
  });
}

/// The whole of a compact mesh with its own numbering: vertices, the nodes of curved edges, then `extra` vertices without
/// cells.
template <int Dim>
CellSet<Dim> whole_mesh(const Mesh<Dim>& mesh, const std::vector<Vec<Dim>>& extra);

/// Nodes of the elements of one kind, `size` each.
struct Stencils {
  std::vector<int> vertices;
  int size = 1;
  std::size_t count() const { return vertices.size() / size; }
  bool operator==(const Stencils&) const = default;
};

/// Kinds of elements, in their order in a CellSet.
enum ElementKind { kStraight, kCurved };
template <int Dim>
std::vector<Stencils> element_stencils(const CellSet<Dim>& cells) {
  std::vector<Stencils> stencils{{{}, Dim + 1}, {{}, kQuadraticNodes<Dim>}};
  auto &straight = stencils[kStraight].vertices, &curved = stencils[kCurved].vertices;
  straight.reserve(cells.elements.size() * (Dim + 1));
  for (const auto& element : cells.elements)
    straight.insert(straight.end(), element.vertices.begin(), element.vertices.end());
  curved.reserve(cells.curved_elements.size() * kQuadraticNodes<Dim>);
  for (const auto& element : cells.curved_elements) curved.insert(curved.end(), element.nodes.begin(), element.nodes.end());
  return stencils;
}

/// The body and measure of all cells, those with curved edges last: f(body, rest volume).
template <int Dim, typename F>
void for_each_cell(const CellSet<Dim>& cells, const F& f) {
  for (const auto& element : cells.elements) f(element.body, element.volume);
  for (const auto& element : cells.curved_elements) f(element.body, element.volume);
}

template <int Dim>
Vec<Dim> rest_barycenter(const CellSet<Dim>& cells, const typename CellSet<Dim>::CurvedElement& element) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (int k = 0; k <= Dim; ++k) sum += cells.rest[element.nodes[k]];
  return sum / (Dim + 1);
}

/// Rest position of a point of the cell by its barycentric coordinates.
template <int Dim>
Vec<Dim> rest_position(const CellSet<Dim>& cells, const typename CellSet<Dim>::CurvedElement& element,
                       const std::array<double, Dim + 1>& weights) {
  Vec<Dim> X = Vec<Dim>::Zero();
  for (int k = 0; k <= Dim; ++k) X += weights[k] * cells.rest[element.nodes[k]];
  return X;
}

/// Values of an interleaved field at the nodes, as columns; at a straight edge that of its first vertex.
template <int Dim, std::size_t N>
Eigen::Matrix<double, Dim, static_cast<int>(N)> at_nodes(const std::array<int, N>& nodes, ConstVectorView x) {
  Eigen::Matrix<double, Dim, static_cast<int>(N)> values;
  for (std::size_t k = 0; k < N; ++k) values.col(static_cast<int>(k)) = x.segment<Dim>(Dim * nodes[k]);
  return values;
}

/// Gradients of barycentric coordinates as columns.
template <int Dim>
Eigen::Matrix<double, Dim, Dim + 1> barycentric_gradients(const Mat<Dim>& inverse_edges) {
  Eigen::Matrix<double, Dim, Dim + 1> gradients;
  gradients.template rightCols<Dim>() = inverse_edges.transpose();
  gradients.col(0) = -inverse_edges.transpose().rowwise().sum();
  return gradients;
}

/// Gradient of the barycentric coordinate of corner k.
template <int Dim>
Vec<Dim> barycentric_gradient(const Mat<Dim>& inverse_edges, int k) {
  if (k == 0) return -inverse_edges.colwise().sum().transpose();
  return inverse_edges.row(k - 1).transpose();
}

/// Gradients of the shape functions at a point of a cell with curved edges, as columns.
template <int Dim>
Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>> shape_gradients(const typename CellSet<Dim>::CurvedElement& element,
                                                                 const std::array<double, Dim + 1>& weights) {
  return quadratic_gradients<Dim, Dim>(element.curved, weights, barycentric_gradients<Dim>(element.inverse_edges));
}

/// Values of an interleaved field at all nodes as columns: on straight edges the mean of the ends.
template <int Dim>
Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>> at_all_nodes(const typename CellSet<Dim>::CurvedElement& element,
                                                              ConstVectorView x) {
  auto values = at_nodes<Dim>(element.nodes, x);
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (!(element.curved >> edge & 1)) values.col(Dim + 1 + edge) = (values.col(i) + values.col(j)) / 2;
  });
  return values;
}

template <int Dim>
Vec<Dim> rest_barycenter(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const int v : element.vertices) sum += cells.rest[v];
  return sum / (Dim + 1);
}

/// A straight cell of a mesh with the ids of its vertices there.
template <int Dim>
typename CellSet<Dim>::Element element_of(const Mesh<Dim>& mesh, CellId c) {
  return {mesh.cell(c), mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c), mesh.part(c)};
}
/// Deformation gradient of an element at interleaved positions x.
template <int Dim>
Mat<Dim> deformation_gradient(const typename CellSet<Dim>::Element& element, ConstVectorView x) {
  Mat<Dim> edges;
  const Vec<Dim> x0 = x.segment<Dim>(Dim * element.vertices[0]);
  for (int k = 0; k < Dim; ++k) edges.col(k) = x.segment<Dim>(Dim * element.vertices[k + 1]) - x0;
  return edges * element.inverse_edges;
}

}  // namespace itr
