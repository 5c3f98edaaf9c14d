// SPDX-License-Identifier: MIT
// The vocabulary of the library: small fixed-size vectors, views of long ones, and ids.
//
// A field of `n` vertices is one vector of length Dim * n, interleaved: component c of vertex v is entry Dim * v + c.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "itr/core.hpp"

namespace itr {

template <int N>
using Vec = Eigen::Matrix<double, N, 1>;
template <int Rows, int Cols = Rows>
using Mat = Eigen::Matrix<double, Rows, Cols>;
using VectorX = Eigen::VectorXd;
using MatrixX = Eigen::MatrixXd;
using ConstVectorView = Eigen::Ref<const Eigen::VectorXd>;
using VectorView = Eigen::Ref<Eigen::VectorXd>;

using VertexId = int;                     ///< index of a vertex slot of a mesh, or of a vertex of a local problem
using CellId = int;                       ///< index of a cell (triangle in 2D, tetrahedron in 3D)
using FacetId = int;                      ///< index of a boundary facet (edge in 2D, triangle in 3D)
using EdgeKey = std::array<VertexId, 2>;  ///< an edge by its vertices, smaller id first

inline constexpr int kNone = -1;  ///< "no such id", "not an unknown"

/// Instantiates by a macro of the dimension; for the library's sources.
#define ITR_BOTH_DIMENSIONS(INSTANTIATE) INSTANTIATE(2) INSTANTIATE(3)

/// The `v`-th vertex of an interleaved field.
template <int Dim, typename Vector>
auto vertex_of(Vector&& field, int v) {
  return field.template segment<Dim>(Dim * v);
}

/// Vertices first, then edges 01, 02, (03,) 12, (13, 23).
template <int Dim>
inline constexpr int kQuadraticNodes = (Dim + 1) * (Dim + 2) / 2;
template <int Dim>
inline constexpr int kSimplexEdges = Dim*(Dim + 1) / 2;
/// Which edges of a simplex are curved: a bit each, in the order of its nodes.
using CurvedEdges = std::uint8_t;
template <int Dim>
inline constexpr CurvedEdges kAllCurved = (1 << kSimplexEdges<Dim>)-1;

/// Pairs of primitives, in the order of their positions: (p, q), (p, a, b), (p, a, b, c), (a0, a1, b0, b1).
enum class PairKind : unsigned char { vertex_vertex, edge_vertex, face_vertex, edge_edge };

constexpr int pair_size(PairKind kind) {
  return kind == PairKind::vertex_vertex ? 2 : kind == PairKind::edge_vertex ? 3 : 4;
}

/// The closest features of a pair: of `kind`, between the positions `local` of the pair (pair_size(kind) of them).
struct ClosestFeatures {
  PairKind kind;
  std::array<signed char, 4> local;
  bool operator==(const ClosestFeatures&) const = default;
};

/// A pair whose own features are closest: distance between point, line or plane.
template <int Dim>
struct PairDistance {
  double squared = 0;               ///< [m^2]
  Vec<Dim> separation;              ///< r = sum of coefficient * position: from one closest point to the other [m]
  Vec<4> coefficients{0, 0, 0, 0};  ///< they sum to 0; the gradient of the squared distance is 2 * coefficient * r
};

}  // namespace itr
