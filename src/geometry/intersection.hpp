// SPDX-License-Identifier: MIT
// Intersections of simplices, for exact integration on the common refinement of two meshes.
#pragma once

#include <array>
#include <vector>

#include "geometry/measures.hpp"
#include "itr/types.hpp"

namespace itr {

/// A simplex of positive volume with its barycentric coordinates at hand.
template <int Dim>
struct Simplex {
  std::array<Vec<Dim>, Dim + 1> corners;
  Mat<Dim> inverse_edges;
  double volume;

  explicit Simplex(const std::array<Vec<Dim>, Dim + 1>& p)
      : corners(p), inverse_edges(edge_matrix<Dim>(p).inverse()), volume(simplex_volume<Dim>(p)) {}
  Vec<Dim + 1> barycentric(const Vec<Dim>& X) const {
    Vec<Dim + 1> weights;
    weights.template tail<Dim>() = inverse_edges * (X - corners[0]);
    weights[0] = 1 - weights.template tail<Dim>().sum();
    return weights;
  }
};

/// Integrals over the intersection of two simplices a and b of the products of their linear shape functions.
template <int Dim>
struct OverlapIntegrals {
  Mat<Dim + 1> aa, ab, bb;  ///< [m^Dim]; ab(i, j): of shape function i of a times j of b
  double volume() const { return ab.sum(); }
};

/// Exact to round-off and free of allocation: a is clipped by the planes of b into simplices, on which the integrands are
/// quadratic. Returns false, with zeros, where a plane of either separates the two or what is left is round-off.
template <int Dim>
bool integrate_overlap(const Simplex<Dim>& a, const Simplex<Dim>& b, OverlapIntegrals<Dim>& integrals);

/// A simplex of the intersection of two, by barycentric coordinates of its corners in both.
template <int Dim>
struct OverlapPiece {
  std::array<Vec<Dim + 1>, Dim + 1> in_a, in_b;
  double volume = 0;
};

/// For integrands of a higher degree: the simplices that integrate_overlap integrates over, in its order. Empty where it
/// returns false.
template <int Dim>
void list_overlap(const Simplex<Dim>& a, const Simplex<Dim>& b, std::vector<OverlapPiece<Dim>>& pieces);

}  // namespace itr
