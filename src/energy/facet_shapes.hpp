// SPDX-License-Identifier: MIT
#pragma once

#include "energy/load_points.hpp"
#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"

namespace itr {

/// f(X, part, shapes) at the points of a rule on a facet at rest: its part of the measure times the turn, and the values of
/// the shape functions of facet.nodes(). Exact for products of two of them.
template <int Dim, typename F>
void for_each_facet_point(const CellSet<Dim>& cells, const typename CellSet<Dim>::BoundaryFacet& facet, const F& f) {
  std::array<Vec<Dim>, Dim> rest;
  for (int k = 0; k < Dim; ++k) rest[k] = cells.rest[facet.vertices[k]];
  const double area = facet_area(rest);
  for (const auto& point : quadrature<Dim - 1>(degree_with_turn(kMassDegree, cells.axisymmetric))) {
    Vec<Dim> X = Vec<Dim>::Zero();
    for (int k = 0; k < Dim; ++k) X += point.weights[k] * rest[k];
    f(X, point.fraction * area * cells.turn(X), quadratic_shapes<Dim - 1>(facet.curved, point.weights));
  }
}

}  // namespace itr
