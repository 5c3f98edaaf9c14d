// SPDX-License-Identifier: MIT
// Cells with a vertex numbering of their own: the whole mesh, or the patch around an edit. Every energy term is built from
// one, so global and local problems share all their code.
#pragma once

#include <vector>

#include "itr/mesh/mesh.hpp"

namespace itr {

template <int Dim>
struct CellSet {
  struct Element {
    std::array<int, Dim + 1> vertices;  ///< local ids
    int body;
    double volume;           ///< rest volume [m^Dim]
    Mat<Dim> inverse_edges;  ///< inverse of the matrix of rest edges
  };
  struct BoundaryFacet {
    std::array<int, Dim> vertices;  ///< local ids
    int tag;
  };
  int num_vertices = 0;        ///< length of fields / Dim; may exceed the cells' vertices (obstacles)
  std::vector<Vec<Dim>> rest;  ///< per local vertex
  std::vector<Element> elements;
  std::vector<BoundaryFacet> facets;
};

/// The whole of a compact mesh with its own numbering, followed by `extra` vertices without cells.
template <int Dim>
CellSet<Dim> whole_mesh(const Mesh<Dim>& mesh, const std::vector<Vec<Dim>>& extra);

/// Vertices of all elements, Dim + 1 each.
template <int Dim>
std::vector<int> stencil_vertices(const CellSet<Dim>& cells) {
  std::vector<int> vertices;
  vertices.reserve(cells.elements.size() * (Dim + 1));
  for (const auto& element : cells.elements)
    vertices.insert(vertices.end(), element.vertices.begin(), element.vertices.end());
  return vertices;
}

template <int Dim>
Vec<Dim> rest_barycenter(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const int v : element.vertices) sum += cells.rest[v];
  return sum / (Dim + 1);
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
