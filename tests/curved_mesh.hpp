// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

/// The mesh with these edges curved, ascending.
template <int Dim>
Mesh<Dim> curved(Mesh<Dim> mesh, const std::vector<EdgeKey>& edges) {
  mesh.set_curved_edges(edges);
  return mesh;
}

/// The mesh with cells of these orders by body.
template <int Dim>
Mesh<Dim> of_orders(const Mesh<Dim>& mesh, const std::map<int, int>& order) {
  return curved(mesh, edges_of_order_2(mesh, order));
}

template <int Dim>
bool is_all_curved(const Mesh<Dim>& mesh) {
  return mesh.has_nodes() && mesh.edges() == mesh.curved_edges();
}

}  // namespace itr
