// SPDX-License-Identifier: MIT
// Where points of the rest shape are in a mesh, and functions that are linear on its cells.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "fem/quadratic.hpp"
#include "itr/mesh.hpp"

namespace itr {

/// Weights of a rest position in a simplex, from its first vertex and the inverse of its edges; below 0 outside.
template <int Dim>
std::array<double, Dim + 1> barycentric_weights(const Vec<Dim>& origin, const Mat<Dim>& inverse_edges, const Vec<Dim>& X) {
  const Vec<Dim> local = inverse_edges * (X - origin);
  std::array<double, Dim + 1> weights{1 - local.sum()};
  for (int k = 0; k < Dim; ++k) weights[k + 1] = local[k];
  return weights;
}

/// How well a simplex has a point: cells that share the point differ in which of them lies at its inward side.
template <int Dim>
struct Fit {
  bool has = false;  ///< the point is in the closed simplex, to round-off; false without an inward direction
  /// Least cosine of the inward direction to the inner normals of the facets that the point is on; 0 inside, so that a cell
  /// with the point on its rim, at the right side, goes before one that overlaps it.
  double facing = -2;
  double depth = -std::numeric_limits<double>::infinity();  ///< least weight
  bool is_better_than(const Fit& other) const {
    if (has != other.has) return has;
    if (has && facing != other.facing) return facing > other.facing;
    return depth > other.depth;
  }
};
/// Fit of the simplex with these inverse edges, in which the point X has these weights. Without an inward direction of X the
/// depth decides.
template <int Dim>
Fit<Dim> fit_of(const RestPoint<Dim>& X, const std::array<double, Dim + 1>& weights, const Mat<Dim>& inverse_edges);

/// Moves weights into the simplex, and to exactly 1 and 0 at a vertex.
template <std::size_t N>
void tidy(std::array<double, N>& weights);

/// Finds cells by rest positions. It copies what it needs: the mesh may change afterwards.
template <int Dim>
class Locator {
 public:
  /// Indexes some cells, or all alive ones.
  Locator(const Mesh<Dim>& mesh, std::span<const CellId> cells);
  explicit Locator(const Mesh<Dim>& mesh);
  ~Locator();
  Locator(Locator&&) noexcept;

  struct Place {
    CellId cell = kNone;                                 ///< kNone: there are no cells (of that body)
    std::array<VertexId, kQuadraticNodes<Dim>> nodes{};  ///< of the cell, as CellSet::Element::nodes
    CurvedEdges curved = 0;
    std::array<double, Dim + 1> weights{};  ///< barycentric: >= 0, of sum 1; exactly 1 and 0 at a vertex
  };
  /// The cell that has X [m], of those that share it the one at its inward side; outside of all, a nearest one. Only cells
  /// of the point's connected part count if there are any, and of `body` unless this is kNone.
  Place find(const RestPoint<Dim>& X, int body = kNone) const;
  int num_nodes() const;  ///< length of nodal fields: the node slots of the mesh

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls visit(node, weight) for the nodes whose values make up that at a place: weights of shape functions that are linear
/// on cells or, along curved edges, quadratic.
template <int Dim, typename Visit>
void for_each_weight(const typename Locator<Dim>::Place& place, const Visit& visit) {
  for (int k = 0; k <= Dim; ++k)
    if (place.weights[k] > 0) visit(place.nodes[k], place.weights[k]);
  if (place.curved == 0) return;
  for_each_edge<Dim>([&](int edge, int i, int j) {
    const double product = place.weights[i] * place.weights[j];
    if (!(place.curved >> edge & 1) || !(product > 0)) return;
    visit(place.nodes[Dim + 1 + edge], 4 * product);
    visit(place.nodes[i], -2 * product);
    visit(place.nodes[j], -2 * product);
  });
}

/// The function of rest position with these values, of so many components each, interleaved: by node (on cells linear or,
/// along curved edges, quadratic) or by vertex (linear on cells). Several threads may call the result at a time.
template <int Dim>
std::function<VectorX(const RestPoint<Dim>& X)> nodal_function(std::shared_ptr<const Locator<Dim>> locator, VectorX values,
                                                               int components);

extern template class Locator<2>;
extern template class Locator<3>;

}  // namespace itr
