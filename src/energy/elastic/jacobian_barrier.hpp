// SPDX-License-Identifier: MIT
// A barrier that keeps det F above zero all over a curved cell. No quadrature rule does: between its points det F may
// vanish, and validity (quadratic_validity.hpp) then stops Newton's step at a place that the energy does not see.
//
// On a part of the cell, det F lies between the least and the greatest of its Bernstein coefficients b_k. Over the 2^(Dim d)
// equal parts of d uniform refinements, with the mean m of det F over the cell, the barrier is
//   2^-d sum over parts and k of phi(b_k / m),   phi(s) = -(s/s0 - 1)^2 ln(s/s0) where s < s0 = 0.05, else 0.
// The barrier is infinite where a coefficient is not positive, and zero with two derivatives where none is far below the
// mean. The weight 2^-d is that of parts along a line. Coefficients of a part bound those of its refinement, so that parts
// in which none is below s0 m are not refined.
#pragma once

#include <vector>

#include "energy/elastic/laws.hpp"
#include "fem/cell_set.hpp"

namespace itr {

/// phi and its derivatives by s.
struct BarrierPhi {
  double value, first, second;
};
BarrierPhi barrier_phi(double s, double s0);

/// At one cell's positions.
template <int Dim>
class JacobianBarrier {
 public:
  using Nodal = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>;  ///< columns
  using Block = Mat<Dim * kQuadraticNodes<Dim>>;
  static constexpr double kActive = 0.05;  ///< s0

  /// `linear`: gradients of barycentric coordinates as columns. `positions` are those of at_nodes.
  JacobianBarrier(CurvedEdges curved, const Eigen::Matrix<double, Dim, Dim + 1>& linear, const Nodal& positions);
  JacobianBarrier(const typename CellSet<Dim>::Element& element, const Nodal& positions)
      : JacobianBarrier(element.curved, barycentric_gradients<Dim>(element.inverse_edges), positions) {}

  /// Whether it is not zero.
  bool is_active() const { return least_ratio_ < kActive; }
  /// The least b_k / m of parts that are not refined; one that is not positive ends the search.
  double least_ratio() const { return least_ratio_; }
  double value() const;
  /// By the positions of nodes.
  Nodal gradient() const;
  Block hessian() const;

 private:
  struct Part {
    std::array<std::array<double, Dim + 1>, Dim + 1> corners;  ///< barycentric
    std::array<Mat<Dim>, Dim + 1> F;                           ///< there

    double coefficient(std::size_t k) const;
  };
  /// A coefficient below s0 m.
  struct Active {
    std::size_t part, coefficient;
    double ratio;
  };
  /// Shape gradients at a part's corners.
  using Shapes = std::array<Nodal, Dim + 1>;
  /// By pairs of nodes a, b, the independent entries of d2b / dx_a dx_b, which is skew.
  using SkewBlocks = std::array<Mat<kQuadraticNodes<Dim>>, Dim == 2 ? 1 : 3>;

  void search(const Part& part, int refinements_left);
  Shapes shapes_of(const Part& part) const;
  void add_gradient(const Part& part, const Shapes& shapes, std::size_t k, double factor, Nodal& gradient) const;
  void add_hessian(const Part& part, const Shapes& shapes, std::size_t k, double factor, SkewBlocks& blocks) const;
  Nodal mean_gradient() const;

  CurvedEdges curved_;
  Eigen::Matrix<double, Dim, Dim + 1> linear_;
  Part whole_;
  double mean_ = 0;  ///< of det F, where it may be small
  double least_ratio_ = 1;
  std::vector<Part> parts_;  ///< those with active coefficients
  std::vector<Active> active_;
};

/// Its factor in the elastic energy for each unit of rest volume [Pa]: the law's greatest stiffness at rest.
template <int Dim>
double stiffness_at_rest(const ElasticModuli& moduli);

/// Its energy in a cell over the cell's rest volume [Pa]. `moduli` are those at the cell's barycentre.
template <int Dim>
double barrier_density(const JacobianBarrier<Dim>& barrier, const ElasticModuli& moduli) {
  return barrier.is_active() ? stiffness_at_rest<Dim>(moduli) * barrier.value() : 0;
}

}  // namespace itr
