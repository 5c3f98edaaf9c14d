// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <span>

#include "itr/mesh.hpp"

namespace itr {

/// Kinds of operations of remeshing, in the order in which states store their tolerances.
enum class OperationKind : char { split, collapse, swap, smooth, reshape, curve, straighten, remove_facet };
inline constexpr int kOperationKinds = static_cast<int>(OperationKind::remove_facet) + 1;
inline constexpr std::array<const char*, kOperationKinds> kOperationNames{
    "split", "collapse", "swap", "smooth", "reshape", "curve", "straighten", "remove_facet"};

/// An operation at a vertex, an edge or a facet, which has not been decided yet.
class Candidate {
 public:
  Candidate() = default;  ///< none
  Candidate(OperationKind kind, VertexId vertex) : ids_{vertex, kNone, kNone}, kind_(kind) {}
  Candidate(OperationKind kind, const EdgeKey& edge)
      : ids_{std::min(edge[0], edge[1]), std::max(edge[0], edge[1]), kNone}, kind_(kind) {}
  Candidate(OperationKind kind, const MeshTypes<3>::Facet& facet) : ids_(facet), kind_(kind) {
    std::sort(ids_.begin(), ids_.end());
  }

  OperationKind kind() const { return kind_; }
  bool is_edge() const { return ids_[1] != kNone && ids_[2] == kNone; }
  VertexId vertex() const { return ids_[0]; }
  EdgeKey edge() const { return {ids_[0], ids_[1]}; }
  const MeshTypes<3>::Facet& facet() const { return ids_; }
  /// The vertex, or those of the edge or the facet, ascending.
  std::span<const VertexId> vertices() const { return {ids_.data(), ids_[1] == kNone ? 1u : ids_[2] == kNone ? 2u : 3u}; }
  /// With other numbers of vertices.
  Candidate renumbered(std::span<const VertexId> number) const {
    Candidate other = *this;
    const auto end = other.ids_.begin() + static_cast<std::ptrdiff_t>(vertices().size());
    std::transform(other.ids_.begin(), end, other.ids_.begin(), [&](VertexId v) { return number[v]; });
    std::sort(other.ids_.begin(), end);
    return other;
  }

  bool operator==(const Candidate&) const = default;
  /// By vertices, then by kind.
  auto operator<=>(const Candidate&) const = default;
  struct Hash {
    std::size_t operator()(const Candidate& c) const {
      constexpr std::size_t kPrime = 1000003;
      return (EdgeKeyHash()(c.edge()) * kPrime + static_cast<std::size_t>(c.ids_[2] + 1)) * kPrime +
             static_cast<std::size_t>(c.kind_);
    }
  };

 private:
  std::array<VertexId, 3> ids_{kNone, kNone, kNone};  ///< ascending; kNone behind those of a vertex or an edge
  OperationKind kind_ = OperationKind::split;
};

}  // namespace itr
