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

/// Forces on vertices: a curved edge's node leaves its own to the ends.
template <int Dim>
VectorX at_vertices(const Mesh<Dim>& mesh, ConstVectorView force) {
  const int vertices = mesh.num_vertices();
  VectorX total = force.head(Dim * vertices);
  for (int node = vertices; node < mesh.num_nodes(); ++node)
    for (const VertexId v : mesh.edge_of_node(node)) vertex_of<Dim>(total, v) += vertex_of<Dim>(force, node) / 2;
  return total;
}

/// Calls visit(facet, its k-th corner, the corner's share, area times outward normal) for parts of all facets.
template <int Dim, typename Visit>
void for_each_part(const Mesh<Dim>& mesh, ConstVectorView x, const Visit& visit) {
  constexpr int kDegree = 4;
  constexpr double kOfSimplex = Dim == 2 ? 1 : 0.5;  // area of the facet where barycentric coordinates are orthogonal
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
      for (int k = 0; k < Dim; ++k) visit(f, k, point.weights[k], area);
    }
  }
}

}  // namespace

template <int Dim>
VectorX contact_pressure(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force) {
  const int vertices = mesh.num_vertices();
  const VectorX total = at_vertices(mesh, force);
  VectorX pushed = VectorX::Zero(vertices), pulled = pushed;
  for_each_part(mesh, x, [&](FacetId f, int k, double share, const Vec<Dim>& area) {
    const VertexId v = mesh.facet(f)[k];
    const double along = share * area.dot(vertex_of<Dim>(total, v));
    (along < 0 ? pushed : pulled)[v] += std::abs(along);
  });
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

template <int Dim>
VectorX force_on_boundary(const CollisionProxy<Dim>& retracted, const Mesh<Dim>& mesh, ConstVectorView force) {
  using Row = typename Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;
  std::vector<VertexId> boundary;
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.is_boundary(v)) boundary.push_back(v);
  std::vector<double> weight(mesh.num_nodes(), 0);  // of nodes inside, over all rows
  const auto for_each_inside = [&](const auto& visit) {
    for (int row = 0; row < retracted.weights.rows(); ++row)
      for (Row it(retracted.weights, row); it; ++it)
        if (const auto v = static_cast<VertexId>(it.col()); !mesh.is_boundary(v)) visit(row, v, it.value());
  };
  for_each_inside([&](int, VertexId v, double value) { weight[v] += value; });
  VectorX result = force;
  for_each_inside([&](int row, VertexId v, double value) {
    if (weight[v] == 0) return;
    vertex_of<Dim>(result, boundary[row]) += value / weight[v] * vertex_of<Dim>(force, v);
    vertex_of<Dim>(result, v).setZero();
  });
  return result;
}

template <int Dim>
VectorX contact_pressure(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force) {
  const bool is_retracted = setup.proxy && setup.proxy->retraction;
  return contact_pressure(mesh, x, is_retracted ? force_on_boundary(*setup.proxy, mesh, force) : VectorX(force));
}

template <int Dim>
std::vector<double> contact_pressure_on_facets(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force,
                                               const std::function<bool(FacetId)>& take) {
  constexpr double kLeastTaken = 0.1;  // of what all have: a side that is hardly turned to the contact takes nothing
  const int vertices = mesh.num_vertices();
  const VectorX total = at_vertices(mesh, force);
  std::vector<std::array<Vec<Dim>, Dim>> areas(mesh.facet_slots());
  for (auto& corners : areas) corners.fill(Vec<Dim>::Zero());
  for_each_part(mesh, x, [&](FacetId f, int k, double share, const Vec<Dim>& area) { areas[f][k] += share * area; });
  VectorX pushed = VectorX::Zero(vertices), taken = pushed;  // area times force
  const auto push = [&](FacetId f, int k) {
    return std::max(0.0, -areas[f][k].dot(vertex_of<Dim>(total, mesh.facet(f)[k])));
  };
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    for (int k = 0; k < Dim; ++k) {
      pushed[mesh.facet(f)[k]] += push(f, k);
      if (take(f)) taken[mesh.facet(f)[k]] += push(f, k);
    }
  std::vector<double> pressure(mesh.facet_slots(), 0);
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    double area = 0;
    for (int k = 0; k < Dim; ++k) {
      const VertexId v = mesh.facet(f)[k];
      area += areas[f][k].norm();
      const bool are_takers = taken[v] > kLeastTaken * pushed[v];
      if (push(f, k) > 0 && (!are_takers || take(f)))
        pressure[f] += push(f, k) * vertex_of<Dim>(total, v).norm() / (are_takers ? taken : pushed)[v];
    }
    if (area > 0) pressure[f] /= area;
  }
  return pressure;
}

#define ITR_INSTANTIATE(Dim)                                                                                    \
  template VectorX contact_pressure(const Mesh<Dim>&, ConstVectorView, ConstVectorView);                        \
  template VectorX contact_pressure(const StepSetup<Dim>&, const Mesh<Dim>&, ConstVectorView, ConstVectorView); \
  template VectorX force_on_boundary(const CollisionProxy<Dim>&, const Mesh<Dim>&, ConstVectorView);            \
  template std::vector<double> contact_pressure_on_facets(const Mesh<Dim>&, ConstVectorView, ConstVectorView,   \
                                                          const std::function<bool(FacetId)>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
