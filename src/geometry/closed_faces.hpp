// SPDX-License-Identifier: MIT
// Faces that coincide at rest: those of a crack, and of bodies that touch. They are closed, and no contact, until they have
// been apart by d-hat.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "itr/types.hpp"

namespace itr {

/// Least squared distance [m^2] of the primitives of two simplices, of a vertex and an edge (2D) or a triangle, or
/// of two edges (3D). Where the simplices cross, it is how far they overlap.
template <int Dim, std::size_t N, std::size_t M>
double simplex_distance_squared(const std::array<Vec<Dim>, N>& a, const std::array<Vec<Dim>, M>& b);

/// The one rule for which pairs of simplices of a surface are no contact yet.
struct ClosedFaces {
  std::vector<char> is_closed;  ///< by vertex of the surface's problem; empty: no face is closed
  VectorX rest;                 ///< of these vertices, interleaved [m]
  double dhat = 0;              ///< what they may overlap by: d-hat, or the reach of ties [m]
  double coincident = 0;        ///< what is as near as that at rest coincides there, but for round-off [m]

  bool empty() const { return is_closed.empty(); }
  template <std::size_t N>
  bool has_any(const std::array<int, N>& simplex) const {
    return !empty() && std::any_of(simplex.begin(), simplex.end(), [&](int v) { return is_closed[v] != 0; });
  }
  /// Whether the pair is no contact: both simplices have closed vertices, and at rest they are nearer than d-hat.
  template <int Dim, std::size_t N, std::size_t M>
  bool exclude(const std::array<int, N>& a, const std::array<int, M>& b) const {
    return has_any(a) && has_any(b) && are_within<Dim>(a, b, rest, std::max(dhat, coincident));
  }
  /// Whether the two may intersect at x: a pair that is no contact, as long as they overlap by no more than d-hat.
  template <int Dim, std::size_t N, std::size_t M>
  bool excuse(const std::array<int, N>& a, const std::array<int, M>& b, ConstVectorView x) const {
    return exclude<Dim>(a, b) && are_within<Dim>(a, b, x, dhat);
  }
  /// Whether primitives of the two are as near as `distance` at x.
  template <int Dim, std::size_t N, std::size_t M>
  static bool are_within(const std::array<int, N>& a, const std::array<int, M>& b, ConstVectorView x, double distance) {
    const auto corners_of = [&]<std::size_t K>(const std::array<int, K>& ids) {
      std::array<Vec<Dim>, K> corners;
      for (std::size_t k = 0; k < K; ++k) corners[k] = x.segment<Dim>(Dim * ids[k]);
      return corners;
    };
    return simplex_distance_squared<Dim>(corners_of(a), corners_of(b)) <= distance * distance;
  }
};

/// ClosedFaces::coincident of bodies between these corners of a box, as positions there are rounded [m].
template <int Dim>
double coincidence(const Vec<Dim>& least, const Vec<Dim>& most) {
  const double farthest = std::max(least.cwiseAbs().maxCoeff(), most.cwiseAbs().maxCoeff());
  return 1e-12 * std::max((most - least).norm(), 1e-3 * farthest);
}

/// Finds the closed faces of a problem whose vertices are at `rest` [m]. `is_closed(i)`: whether the i-th of them is.
template <int Dim, typename IsClosed>
ClosedFaces closed_faces(const std::vector<Vec<Dim>>& rest, double dhat, double coincident, const IsClosed& is_closed) {
  ClosedFaces faces;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (!is_closed(static_cast<int>(i))) continue;
    faces.is_closed.resize(rest.size(), 0);
    faces.is_closed[i] = 1;
  }
  if (faces.empty()) return faces;
  faces.rest = Eigen::Map<const VectorX>(rest[0].data(), Dim * static_cast<Eigen::Index>(rest.size()));
  faces.dhat = dhat;
  faces.coincident = coincident;
  return faces;
}

}  // namespace itr
