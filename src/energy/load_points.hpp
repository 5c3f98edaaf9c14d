// SPDX-License-Identifier: MIT
// The quadrature of a load on one simplex: the nodal forces of LoadEnergy and the work in predictions of gains are made of
// it.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "energy/load.hpp"
#include "geometry/facet_area.hpp"
#include "geometry/measures.hpp"

namespace itr {

/// Barycentric coordinates of the points: this at the vertex of the point's number, and at the others.
template <std::size_t Vertices>
struct LoadPoint {
  static constexpr double kNear = near_vertex<Vertices>(), kFar = (1 - kNear) / (Vertices - 1);
  /// Value of a linear function with these values at the vertices, of which `sum` is the sum.
  template <typename Value>
  static Value at(std::size_t point, const std::array<Value, Vertices>& values, const Value& sum) {
    return kFar * sum + (kNear - kFar) * values[point];
  }
};

/// Calls visit(point, force) with the fraction of the total `weight * load` that acts at each point of a cell or a facet of
/// a connected part.
template <int Dim, std::size_t Vertices, typename Load, typename Visit>
void for_each_load_point(const std::array<Vec<Dim>, Vertices>& rest, int part, double weight, const Load& load,
                         const Visit& visit) {
  using Point = LoadPoint<Vertices>;
  Vec<Dim> inward = Vec<Dim>::Zero();  // of a cell not needed: the points are inside
  if constexpr (Vertices == Dim) inward = inward_normal(rest);
  for (std::size_t q = 0; q < Vertices; ++q) {
    Vec<Dim> X = Vec<Dim>::Zero();
    for (std::size_t k = 0; k < Vertices; ++k) X += (k == q ? Point::kNear : Point::kFar) * rest[k];
    visit(q, Vec<Dim>(weight / Vertices * load(RestPoint<Dim>(X, inward, part))));
  }
}

}  // namespace itr
