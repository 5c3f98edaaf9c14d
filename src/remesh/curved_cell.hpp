// SPDX-License-Identifier: MIT
// Nodes of a cell of the mesh as an edit would make it, or as it is.
#pragma once

#include <Eigen/LU>
#include <algorithm>

#include "fem/cell_set.hpp"
#include "fem/chords.hpp"
#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"
#include "geometry/measures.hpp"
#include "remesh/fields.hpp"

namespace itr {

/// The node of an edge after an edit, new_node(i) of one that the edit creates; kNone where the edge is straight.
template <int Dim>
VertexId node_after(const Mesh<Dim>& mesh, const Edit<Dim>& edit, VertexId a, VertexId b) {
  const EdgeKey edge{std::min(a, b), std::max(a, b)};
  if (const VertexId created = edit.inserted_node(edge); created != kNone) return created;
  if (std::find(edit.removed_nodes.begin(), edit.removed_nodes.end(), edge) != edit.removed_nodes.end()) return kNone;
  return mesh.node_of(a, b);
}

/// Ids of the nodes of a simplex, and which of its edges are curved. A straight edge has its first vertex as a node.
template <int Dim>
struct CurvedCell {
  std::array<VertexId, kQuadraticNodes<Dim>> nodes{};
  CurvedEdges edges = 0;

  /// Values of a field after the edit, at straight edges the mean of the ends.
  QuadraticCell<Dim> values(const VectorX& field, const Edit<Dim>& edit) const {
    QuadraticCell<Dim> all;
    const auto at = [&](VertexId v) -> Vec<Dim> {
      if (edit.value && v == edit.value->vertex) return RemeshFields<Dim>::interpolate(field, *edit.value);
      const int node = kNewVertex - 1 - v;
      if (node < static_cast<int>(edit.inserted_nodes.size()))
        return RemeshFields<Dim>::interpolate(field, edit.inserted_nodes[node]);
      return field.segment<Dim>(Dim * v);
    };
    for (int k = 0; k <= Dim; ++k) all.col(k) = at(nodes[k]);
    for_each_edge<Dim>([&](int edge, int i, int j) {
      const int k = Dim + 1 + edge;
      all.col(k) = edges >> edge & 1 ? at(nodes[k]) : Vec<Dim>((all.col(i) + all.col(j)) / 2);
    });
    return all;
  }
};

/// `node_of(a, b)`: the node of an edge or kNone.
template <int Dim, typename NodeOf>
CurvedCell<Dim> curved_cell(const std::array<VertexId, Dim + 1>& vertices, const NodeOf& node_of) {
  CurvedCell<Dim> cell;
  std::array<VertexId, kSimplexEdges<Dim>> middles;
  cell.edges = find_edge_nodes<Dim>(vertices, node_of, middles);
  std::copy(middles.begin(), middles.end(), std::copy(vertices.begin(), vertices.end(), cell.nodes.begin()));
  return cell;
}

/// Whether any edge is curved before an edit, or by it.
template <int Dim>
bool has_curves(const Mesh<Dim>& mesh, const Edit<Dim>& edit) {
  return mesh.has_nodes() || !edit.inserted_nodes.empty();
}

/// The cell on these vertices as it is after an edit.
template <int Dim>
CurvedCell<Dim> cell_after(const Mesh<Dim>& mesh, const Edit<Dim>& edit, const std::array<VertexId, Dim + 1>& vertices) {
  if (has_curves(mesh, edit))
    return curved_cell<Dim>(vertices, [&](VertexId a, VertexId b) { return node_after(mesh, edit, a, b); });
  CurvedCell<Dim> cell;
  std::copy(vertices.begin(), vertices.end(), cell.nodes.begin());
  return cell;
}

template <int Dim>
CurvedCell<Dim> cell_before(const Mesh<Dim>& mesh, CellId c) {
  const auto element = element_of(mesh, c);
  return {element.nodes(), element.curved};
}

/// Calls f(gradient, fraction of the volume) at the points of a rule that integrates squares of the gradient of a field on a
/// cell.
template <int Dim, typename F>
void for_each_gradient(const typename CellSet<Dim>::Element& element, const VectorX& field, const F& f) {
  if (!element.curved) return f(deformation_gradient<Dim>(element, field), 1.0);
  const auto values = at_nodes<Dim>(element.nodes(), field);
  for (const auto& point : quadrature<Dim>(Dim))
    f(Mat<Dim>(values * shape_gradients<Dim>(element, point.weights).transpose()), point.fraction);
}

/// Calls visit(f) for the boundary facets at a vertex, or at the edge of a node.
template <int Dim, typename Visit>
void for_each_facet_at(const Mesh<Dim>& mesh, VertexId v, const Visit& visit) {
  if (mesh.is_vertex_alive(v)) {
    for (const FacetId f : mesh.facets_of(v)) visit(f);
  } else if (const EdgeKey edge = mesh.edge_of_node(v); edge[0] != kNone) {
    for (const FacetId f : mesh.facets_of(edge[0]))
      if (std::find(mesh.facet(f).begin(), mesh.facet(f).end(), edge[1]) != mesh.facet(f).end()) visit(f);
  }
}

/// Calls visit(v) for the nodes on a facet's edges.
template <int Dim, typename NodeOf, typename Visit>
void for_each_node_on(const typename MeshTypes<Dim>::Facet& facet, const NodeOf& node_of, const Visit& visit) {
  for (int k = 0; k < (Dim == 2 ? 1 : 3); ++k)
    if (const VertexId node = node_of(facet[k], facet[(k + 1) % Dim]); node != kNone) visit(node);
}

/// The mean of det dx/dxi over a cell.
template <int Dim>
double mean_jacobian(const QuadraticCell<Dim>& x) {
  Eigen::Matrix<double, Dim, Dim + 1> unit;
  unit.col(0).setConstant(-1);
  unit.template rightCols<Dim>().setIdentity();
  double mean = 0;
  for (const auto& point : quadrature<Dim>(Dim))
    mean +=
        point.fraction * (x * quadratic_gradients<Dim, Dim>(kAllCurved<Dim>, point.weights, unit).transpose()).determinant();
  return mean;
}

/// The least det dx/dxi in a cell over its mean: 1 where the cell is affine. Where it is small, the cell's quadratic
/// function oscillates, as it does in shocks and at singular corners, more than its energy tells.
template <int Dim>
double relative_jacobian(const QuadraticCell<Dim>& x) {
  constexpr double kTolerance = 0.1;
  return min_jacobian_bound<Dim>(x, kTolerance) / mean_jacobian<Dim>(x);
}
inline constexpr double kLeastRelativeJacobian = 0.2;  ///< below, a cell is distorted

}  // namespace itr
