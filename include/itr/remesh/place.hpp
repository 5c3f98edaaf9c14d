// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <compare>
#include <cstddef>
#include <span>

#include "itr/mesh/mesh.hpp"

namespace itr {

/// An edge, the node of an edge (that the edge has or may get), or a vertex: a candidate of an operation of remeshing.
class Place {
 public:
  Place() = default;                                                                            ///< none
  Place(const EdgeKey& edge) : ids_{std::min(edge[0], edge[1]), std::max(edge[0], edge[1])} {}  // NOLINT: an edge is one
  static Place node_of(const EdgeKey& edge) { return of_ids(std::max(edge[0], edge[1]), std::min(edge[0], edge[1])); }
  static Place at_vertex(VertexId vertex) { return of_ids(vertex, kNone); }

  bool is_vertex() const { return ids_[1] == kNone; }
  bool is_node() const { return !is_vertex() && ids_[0] > ids_[1]; }
  VertexId vertex() const { return ids_[0]; }
  /// Smaller id first.
  EdgeKey edge() const { return is_node() ? EdgeKey{ids_[1], ids_[0]} : ids_; }
  /// The vertex, or the ends of the edge.
  std::span<const VertexId> vertices() const { return {ids_.data(), is_vertex() ? std::size_t{1} : std::size_t{2}}; }

  bool operator==(const Place&) const = default;
  auto operator<=>(const Place&) const = default;
  struct Hash {
    std::size_t operator()(const Place& place) const { return EdgeKeyHash()(place.ids_); }
  };

 private:
  static Place of_ids(VertexId a, VertexId b) {
    Place place;
    place.ids_ = {a, b};
    return place;
  }
  EdgeKey ids_{kNone, kNone};  ///< {vertex, kNone}; of a node the larger one first
};

}  // namespace itr
