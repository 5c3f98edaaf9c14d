// SPDX-License-Identifier: MIT
// The deformation at a point of a cell, and what cells of bodies of revolution have beside it (docs/theory.md,
// "Axisymmetry"): laws see F in space, with the hoop stretch r/R as F33.
#pragma once

#include <algorithm>

#include "energy/elastic/laws.hpp"
#include "fem/cell_set.hpp"
#include "fem/displacement.hpp"
#include "fem/quadrature.hpp"
#include "jacobian_barrier.hpp"

namespace itr {

template <int Dim>
using Nodal = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>;

/// Displacements of a cell's nodes: of the first one, and of all from that, which gradients depend on alone.
template <int Dim>
struct NodalDisplacements {
  Nodal<Dim> relative = Nodal<Dim>::Zero();
  Vec<Dim> first;

  NodalDisplacements(const typename CellSet<Dim>::Element& element, const Displacement<Dim>& u)
      : first(u.of(element.vertices[0])) {
    const auto nodes = element.nodes();
    for (int k = 1; k < kQuadraticNodes<Dim>; ++k)
      if (has_node<Dim>(element.curved, k)) relative.col(k) = u.difference(nodes[0], nodes[k]);
  }
};

/// A point of a cell, for laws in the plane or, where the cell is turned, in space.
template <int Dim, int LawDim>
struct ElasticSite {
  Nodal<Dim> gradients;                                 ///< of shape functions, as columns
  Eigen::Matrix<double, 1, kQuadraticNodes<Dim>> hoop;  ///< shape functions by R; where the cell is turned
  const QuadraturePoint<Dim>& point;
  double volume, turn;  ///< at rest; 2 pi R or 1

  ElasticSite(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, const QuadraturePoint<Dim>& point)
      : gradients(shape_gradients<Dim>(element, point.weights)), point(point), volume(element.volume), turn(1) {
    if constexpr (LawDim > Dim) {
      const Vec<Dim> X = rest_position<Dim>(cells, element, point.weights);
      turn = cells.turn(X);
      hoop = quadratic_shapes<Dim>(element.curved, point.weights).transpose() / X[0];
    }
  }
  double weight(double scale) const { return scale * point.fraction * volume * turn; }
  DisplacementGradient<LawDim> displacement_gradient(const NodalDisplacements<Dim>& u) const {
    if constexpr (LawDim == Dim)
      return {u.relative * gradients.transpose()};
    else
      return {in_space(u.relative, u.first[0])};
  }
  Mat<LawDim> deformation_gradient(const Nodal<Dim>& x) const {
    if constexpr (LawDim == Dim)
      return x * gradients.transpose();
    else
      return in_space(x, 0);
  }
  /// Adds a factor times the derivative of P : F by the nodes.
  template <typename Forces>
  void add_forces(double factor, const Mat<LawDim>& P, Forces& forces) const {
    forces.noalias() += factor * (P.template topLeftCorner<Dim, Dim>() * gradients);
    if constexpr (LawDim > Dim) forces.row(0) += (factor * P(Dim, Dim)) * hoop;
  }

 private:
  /// Shape functions are 1 in sum.
  Mat<LawDim> in_space(const Nodal<Dim>& values, double first) const {
    Mat<LawDim> G = Mat<LawDim>::Zero();
    G.template topLeftCorner<Dim, Dim>() = values * gradients.transpose();
    G(Dim, Dim) = first * hoop.sum() + hoop.dot(values.row(0));
    return G;
  }
};

/// f(point's number, site) for the points of a cell's rule that have a weight: in space where the cells are turned.
template <int Dim, typename F>
void for_each_site(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element,
                   const std::vector<QuadraturePoint<Dim>>& rule, const F& f) {
  for (std::size_t q = 0; q < rule.size(); ++q) {
    if constexpr (Dim == 2)
      if (cells.axisymmetric) {
        const ElasticSite<2, 3> site(cells, element, rule[q]);
        if (site.turn > 0) f(q, site);
        continue;
      }
    f(q, ElasticSite<Dim, Dim>(cells, element, rule[q]));
  }
}

/// Keeps the radius of a turned cell above zero where it is above zero at rest. It is at least the least of its Bernstein
/// coefficients, at vertices and on curved edges; with their ratios s_k to those at rest, of mean m, the barrier is
///   1/16 sum over k of phi(s_k / m),   phi that of JacobianBarrier.
/// The barrier is infinite where a coefficient is not positive. Quadrature alone sees little of a hole that closes on the
/// axis.
class HoopBarrier {
 public:
  HoopBarrier(const CellSet<2>& cells, const CellSet<2>::Element& element);

  bool is_active(const Nodal<2>& x) const { return least_ratio(x) < JacobianBarrier<2>::kActive; }
  double value(const Nodal<2>& x) const;
  /// Adds the derivatives by positions times a weight.
  void add_gradient(const Nodal<2>& x, double weight, Nodal<2>& gradient) const;
  void add_hessian(const Nodal<2>& x, JacobianBarrier<2>::Block& hessian) const;
  /// The part of the way on which no coefficient loses more than `margin` of itself; at most 1.
  double free_step(const Nodal<2>& x, const Nodal<2>& way, double margin) const;

 private:
  using Row = Eigen::Matrix<double, 1, kQuadraticNodes<2>>;
  static constexpr double kWeight = 1.0 / 16;
  double least_ratio(const Nodal<2>& x) const;

  std::array<Row, kQuadraticNodes<2>> rows_;  ///< the first count_: s_k by the nodes' radii
  int count_ = 0;
  Row mean_ = Row::Zero();
};

}  // namespace itr
