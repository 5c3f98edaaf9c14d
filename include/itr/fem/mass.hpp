// SPDX-License-Identifier: MIT
// The mass matrix of a simplex with linear shape functions: the one place where its entries are written down.
#pragma once

#include <array>

#include "itr/core/types.hpp"

namespace itr {

enum class MassKind { consistent, lumped };

/// Of an element of mass m = rho |e| [kg]: consistent m (1 + delta_ij) / ((d + 1) (d + 2)), lumped m delta_ij / (d + 1).
template <int Dim>
struct ElementMass {
  double off;    ///< entries off the diagonal
  double extra;  ///< what those on the diagonal have more

  ElementMass(MassKind kind, double mass)
      : off(kind == MassKind::lumped ? 0 : mass / ((Dim + 1) * (Dim + 2))),
        extra(kind == MassKind::lumped ? mass / (Dim + 1) : mass / ((Dim + 1) * (Dim + 2))) {}

  /// y += M x, for nodal values that are the rows of x and y.
  template <typename X, typename Y>
  void add_product(const std::array<int, Dim + 1>& vertices, const X& x, Y& y) const {
    Eigen::Matrix<double, 1, X::ColsAtCompileTime> total = x.row(vertices[0]);
    for (int k = 1; k <= Dim; ++k) total += x.row(vertices[k]);
    for (const int v : vertices) y.row(v) += off * total + extra * x.row(v);
  }
};

}  // namespace itr
