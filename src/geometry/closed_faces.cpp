// SPDX-License-Identifier: MIT
#include "geometry/closed_faces.hpp"

#include <limits>

#include "geometry/distance.hpp"

namespace itr {

namespace {

double primitive_distance_squared(const Vec<2>& p, const std::array<Vec<2>, 2>& edge) {
  return point_edge_distance_squared<2>(p, edge[0], edge[1]);
}
double primitive_distance_squared(const Vec<3>& p, const std::array<Vec<3>, 3>& triangle) {
  return point_triangle_distance_squared(p, triangle[0], triangle[1], triangle[2]);
}
}  // namespace

template <int Dim, std::size_t N, std::size_t M>
double simplex_distance_squared(const std::array<Vec<Dim>, N>& p, const std::array<Vec<Dim>, M>& q) {
  double least = std::numeric_limits<double>::infinity();
  if constexpr (M == Dim)
    for (const Vec<Dim>& point : p) least = std::min(least, primitive_distance_squared(point, q));
  if constexpr (N == Dim)
    for (const Vec<Dim>& point : q) least = std::min(least, primitive_distance_squared(point, p));
  if constexpr (Dim == 3 && N > 1)
    for (std::size_t i = 0; i < (N == 2 ? 1 : N); ++i)
      for (std::size_t k = 0; k < (M == 2 ? 1 : M); ++k)
        least = std::min(least, edge_edge_distance_squared(p[i], p[(i + 1) % N], q[k], q[(k + 1) % M]));
  return least;
}

#define ITR_INSTANTIATE(Dim, N, M) \
  template double simplex_distance_squared<Dim>(const std::array<Vec<Dim>, N>&, const std::array<Vec<Dim>, M>&);
ITR_INSTANTIATE(2, 1, 2)
ITR_INSTANTIATE(2, 2, 2)
ITR_INSTANTIATE(3, 1, 3)
ITR_INSTANTIATE(3, 2, 2)
ITR_INSTANTIATE(3, 2, 3)
ITR_INSTANTIATE(3, 3, 3)
#undef ITR_INSTANTIATE

}  // namespace itr
