// SPDX-License-Identifier: MIT
#include "simulation/contact_pressure.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "fem/cell_set.hpp"
#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"

namespace itr {

namespace {

/// Normal of a facet with these tangents; its length is that of the area which they span.
Vec<2> normal_of(const Mat<2, 1>& tangent) { return {tangent[1], -tangent[0]}; }
Vec<3> normal_of(const Mat<3, 2>& tangents) { return tangents.col(0).cross(tangents.col(1)); }

}  // namespace

template <int Dim>
VectorX contact_pressure(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force) {
  constexpr int kDegree = 4;
  constexpr double kOfSimplex = Dim == 2 ? 1 : 0.5;  // area of the facet where barycentric coordinates are orthogonal
  const int vertices = mesh.num_vertices();
  VectorX total = force.head(Dim * vertices);
  for (int node = vertices; node < mesh.num_nodes(); ++node)
    for (const VertexId v : mesh.edge_of_node(node)) vertex_of<Dim>(total, v) += vertex_of<Dim>(force, node) / 2;
  VectorX pushed = VectorX::Zero(vertices), pulled = pushed;
  Eigen::Matrix<double, Dim - 1, Dim> linear;
  linear.col(0).setConstant(-1);
  linear.template rightCols<Dim - 1>().setIdentity();
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    std::array<int, kSimplexEdges<Dim - 1>> edge_nodes{};
    const auto& facet = mesh.facet(f);
    const CurvedEdges curved = find_edge_nodes<Dim - 1>(facet, nodes_of_edges(mesh), edge_nodes);
    typename CellSet<Dim>::BoundaryFacet element{facet, kNoTag, kNone, curved, edge_nodes};
    const auto positions = at_nodes<Dim>(element.nodes(), x);
    for (const auto& point : quadrature<Dim - 1>(kDegree)) {
      const auto gradients = quadratic_gradients<Dim - 1, Dim - 1>(curved, point.weights, linear);
      const Vec<Dim> at = positions * quadratic_shapes<Dim - 1>(curved, point.weights);
      const double turn = mesh.is_axisymmetric() ? 2 * std::numbers::pi * at[0] : 1;
      const Vec<Dim> area =
          point.fraction * kOfSimplex * turn * normal_of(Mat<Dim, Dim - 1>(positions * gradients.transpose()));
      for (int k = 0; k < Dim; ++k) {
        const double along = point.weights[k] * area.dot(vertex_of<Dim>(total, facet[k]));
        (along < 0 ? pushed : pulled)[facet[k]] += std::abs(along);
      }
    }
  }
  VectorX pressure = VectorX::Zero(mesh.num_nodes());
  for (VertexId v = 0; v < vertices; ++v) {
    const double most = std::max(pushed[v], pulled[v]);  // area times force
    if (most > 0) pressure[v] = (pushed[v] >= pulled[v] ? 1 : -1) * vertex_of<Dim>(total, v).squaredNorm() / most;
  }
  for (int node = vertices; node < mesh.num_nodes(); ++node) {
    const auto [a, b] = mesh.edge_of_node(node);
    pressure[node] = (pressure[a] + pressure[b]) / 2;
  }
  return pressure;
}

template VectorX contact_pressure<2>(const Mesh<2>&, ConstVectorView, ConstVectorView);
template VectorX contact_pressure<3>(const Mesh<3>&, ConstVectorView, ConstVectorView);

}  // namespace itr
