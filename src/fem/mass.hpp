// SPDX-License-Identifier: MIT
// The mass matrix of a simplex: the one place where its entries are written down.
#pragma once

#include <array>
#include <numbers>
#include <span>
#include <vector>

#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"
#include "itr/types.hpp"

namespace itr {

enum class MassKind { consistent, lumped };

/// Mass matrix of an element of mass m = rho |e| [kg]: consistent m (1 + delta_ij) / ((d + 1) (d + 2)), lumped m delta_ij /
/// (d + 1).
template <int Dim>
struct ElementMass {
  double off;    ///< entries off the diagonal
  double extra;  ///< what those on the diagonal have more

  ElementMass(MassKind kind, double mass)
      : off(kind == MassKind::lumped ? 0 : mass / ((Dim + 1) * (Dim + 2))),
        extra(kind == MassKind::lumped ? mass / (Dim + 1) : mass / ((Dim + 1) * (Dim + 2))) {}

  /// 1/2 d . M d of nodal vectors d with this sum and these squared norms.
  double energy(const Vec<Dim>& total, double squares) const { return 0.5 * (off * total.squaredNorm() + extra * squares); }
  /// M d at a node of value d.
  Vec<Dim> product(const Vec<Dim>& total, const Vec<Dim>& d) const { return off * total + extra * d; }
  double diagonal() const { return off + extra; }

  /// y += M x, for nodal values that are the rows of x and y.
  template <typename X, typename Y>
  void add_product(const std::array<int, Dim + 1>& vertices, const X& x, Y& y) const {
    Eigen::Matrix<double, 1, X::ColsAtCompileTime> total = x.row(vertices[0]);
    for (int k = 1; k <= Dim; ++k) total += x.row(vertices[k]);
    for (const int v : vertices) y.row(v) += off * total + extra * x.row(v);
  }
};

/// Mass by unit mass of a simplex with curved edges. Lumped: the consistent diagonal, scaled to the simplex' mass (Hinton,
/// Rock and Zienkiewicz 1976), since row sums are negative at vertices in 3D. `density` is relative, by point of the
/// quadrature of `degree`; empty: constant.
template <int Dim>
Mat<kQuadraticNodes<Dim>> quadratic_mass(MassKind kind, CurvedEdges curved, std::span<const double> density = {},
                                         int degree = kMassDegree) {
  Mat<kQuadraticNodes<Dim>> mass = Mat<kQuadraticNodes<Dim>>::Zero();
  const auto& rule = quadrature<Dim>(degree);
  double total = 0;
  for (std::size_t q = 0; q < rule.size(); ++q) {
    const double weight = rule[q].fraction * (density.empty() ? 1 : density[q]);
    const auto shapes = quadratic_shapes<Dim>(curved, rule[q].weights);
    mass += weight * shapes * shapes.transpose();
    total += weight;
  }
  if (kind == MassKind::consistent) return mass;
  const Vec<kQuadraticNodes<Dim>> diagonal = mass.diagonal();
  return Mat<kQuadraticNodes<Dim>>((total / diagonal.sum() * diagonal).asDiagonal());
}

/// Mass by unit of density and of volume of a simplex with these corners that is turned about the axis (CellSet::turn).
template <int Dim>
Mat<kQuadraticNodes<Dim>> turned_mass(MassKind kind, CurvedEdges curved, const std::array<Vec<Dim>, Dim + 1>& corners) {
  const int degree = degree_with_turn(kMassDegree, true);
  std::vector<double> turns;
  for (const auto& point : quadrature<Dim>(degree)) {
    double R = 0;
    for (int k = 0; k <= Dim; ++k) R += point.weights[k] * corners[k][0];
    turns.push_back(2 * std::numbers::pi * R);
  }
  return quadratic_mass<Dim>(kind, curved, turns, degree);
}

/// Mass matrix of constant density, integrated once in a program.
template <int Dim>
const Mat<kQuadraticNodes<Dim>>& constant_quadratic_mass(MassKind kind, CurvedEdges curved) {
  using Matrices = std::array<Mat<kQuadraticNodes<Dim>>, kAllCurved<Dim> + 1>;
  const auto integrate = [](MassKind of_kind) {
    Matrices all;
    for (int edges = 0; edges <= kAllCurved<Dim>; ++edges)
      all[edges] = quadratic_mass<Dim>(of_kind, static_cast<CurvedEdges>(edges));
    return all;
  };
  static const Matrices consistent = integrate(MassKind::consistent), lumped = integrate(MassKind::lumped);
  return (kind == MassKind::consistent ? consistent : lumped)[curved];
}

}  // namespace itr
