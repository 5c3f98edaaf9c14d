// SPDX-License-Identifier: MIT
// The whole mesh as a CellSet (itr/energy.hpp), and what is asked of its cells.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "fem/quadratic.hpp"
#include "fem/volume_patches.hpp"
#include "itr/energy.hpp"

namespace itr {

/// Calls f(node) for the vertices of an element or a facet, then for the nodes of its curved edges.
template <typename Simplex, typename F>
void for_each_node(const Simplex& simplex, const F& f) {
  for (const int v : simplex.vertices) f(v);
  for (std::size_t edge = 0; edge < simplex.edge_nodes.size(); ++edge)
    if (simplex.curved >> edge & 1) f(simplex.edge_nodes[edge]);
}

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

/// Kinds of elements, in their order in a CellSet. Pairs of nodes of one volume patch follow them.
enum ElementKind : int { kStraight, kCurved };
template <int Dim>
std::vector<Stencils> element_stencils(const CellSet<Dim>& cells) {
  std::vector<Stencils> stencils{{{}, Dim + 1}, {{}, kQuadraticNodes<Dim>}};
  const auto fill = [](std::vector<int>& stencil, const auto& elements, std::size_t size, const auto& nodes_of) {
    stencil.reserve(elements.size() * size);
    for (const auto& element : elements) {
      const auto nodes = nodes_of(element);
      stencil.insert(stencil.end(), nodes.begin(), nodes.end());
    }
  };
  fill(stencils[kStraight].vertices, cells.straight(), Dim + 1, [](const auto& element) { return element.vertices; });
  fill(stencils[kCurved].vertices, cells.curved(), kQuadraticNodes<Dim>,
       [](const auto& element) { return element.nodes(); });
  if (!cells.patches) return stencils;
  Stencils& pairs = stencils.emplace_back(Stencils{{}, 2});
  for (std::size_t patch = 0; patch < cells.patches->count(); ++patch) {
    const std::span<const int> nodes = cells.patches->nodes_of(patch);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) pairs.vertices.insert(pairs.vertices.end(), {nodes[j], nodes[i]});
  }
  return stencils;
}

/// Rest positions of all vertices, interleaved.
template <int Dim>
VectorX rest_positions(const CellSet<Dim>& cells) {
  return Eigen::Map<const VectorX>(cells.rest[0].data(), Dim * static_cast<Eigen::Index>(cells.rest.size()));
}

template <int Dim>
Vec<Dim> rest_barycenter(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const int v : element.vertices) sum += cells.rest[v];
  return sum / (Dim + 1);
}

/// Rest position of a point of the cell by its barycentric coordinates.
template <int Dim>
Vec<Dim> rest_position(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element,
                       const std::array<double, Dim + 1>& weights) {
  Vec<Dim> X = Vec<Dim>::Zero();
  for (int k = 0; k <= Dim; ++k) X += weights[k] * cells.rest[element.vertices[k]];
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
Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>> shape_gradients(const typename CellSet<Dim>::Element& element,
                                                                 const std::array<double, Dim + 1>& weights) {
  return quadratic_gradients<Dim, Dim>(element.curved, weights, barycentric_gradients<Dim>(element.inverse_edges));
}

/// Values of an interleaved field at all nodes as columns: on straight edges the mean of the ends.
template <int Dim>
Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>> at_all_nodes(const typename CellSet<Dim>::Element& element,
                                                              ConstVectorView x) {
  auto values = at_nodes<Dim>(element.nodes(), x);
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (!(element.curved >> edge & 1)) values.col(Dim + 1 + edge) = (values.col(i) + values.col(j)) / 2;
  });
  return values;
}

/// A cell of a mesh with the ids of its nodes there.
template <int Dim>
typename CellSet<Dim>::Element element_of(const Mesh<Dim>& mesh, CellId c) {
  typename CellSet<Dim>::Element element{
      mesh.cell(c), mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c), mesh.part(c), c};
  if (mesh.has_nodes() || mesh.is_axisymmetric())
    element.curved = find_edge_nodes<Dim>(mesh.cell(c), nodes_of_edges(mesh), element.edge_nodes);
  return element;
}
/// Deformation gradient of an element without curved edges at interleaved positions x.
template <int Dim>
Mat<Dim> deformation_gradient(const typename CellSet<Dim>::Element& element, ConstVectorView x) {
  Mat<Dim> edges;
  const Vec<Dim> x0 = x.segment<Dim>(Dim * element.vertices[0]);
  for (int k = 0; k < Dim; ++k) edges.col(k) = x.segment<Dim>(Dim * element.vertices[k + 1]) - x0;
  return edges * element.inverse_edges;
}

}  // namespace itr
