// SPDX-License-Identifier: MIT
// A barrier that keeps det F above zero all over a curved cell. No quadrature rule does: between its points det F may
// vanish, and validity (quadratic_validity.hpp) then stops Newton's step at a place that the energy does not see.
//
// det F is a polynomial in the cell. It lies between the least and the greatest of its Bernstein coefficients b_k, on the
// cell or on each of its equal parts. With their mean m over the cell, the barrier is the mean over parts of
//   sum_k phi(b_k / m),   phi(s) = -(s/s0 - 1)^2 ln(s/s0) where s < s0 = 0.05, else 0,
// zero with two derivatives where no coefficient is far below the mean, and infinite where one vanishes.
#pragma once

#include <vector>

#include "itr/fem/cell_set.hpp"

namespace itr {

/// At one cell's positions.
template <int Dim>
class JacobianBarrier {
 public:
  using Element = typename CellSet<Dim>::CurvedElement;
  using Nodal = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>;  ///< columns
  using Block = Mat<Dim * kQuadraticNodes<Dim>>;
  static constexpr double kActive = 0.05;  ///< s0

  /// `positions` are those of at_nodes. Depth 1: the whole cell; each more refines it uniformly once. At most
  /// kMostBarrierDepth.
  JacobianBarrier(const Element& element, const Nodal& positions, int depth);
  /// Of det F in the cell.
  double mean() const { return mean_; }
  /// Of those looked at: none is, after one that is not positive.
  double least_coefficient() const { return least_ratio_ * mean_; }
  /// Infinite unless all coefficients are positive, which proves that det F is.
  double value() const;
  /// By the positions of nodes.
  Nodal gradient() const;
  Block hessian() const;

 private:
  using Corner = std::array<double, Dim + 1>;  ///< barycentric
  using Part = std::array<Corner, Dim + 1>;
  /// A part with shape gradients and F at its corners.
  struct PartState {
    PartState(const Element& element, const Nodal& positions, const Part& corners);
    double coefficient(std::size_t k) const;
    void add_gradient(std::size_t k, double factor, Nodal& gradient) const;
    void add_hessian(std::size_t k, double factor, Block& block) const;

    std::array<Nodal, Dim + 1> shapes;
    std::array<Mat<Dim>, Dim + 1> F;
  };
  /// A coefficient below s0 times the mean.
  struct Active {
    std::size_t part, coefficient;
    double ratio;
  };

  static const std::vector<Part>& parts(int depth);
  PartState state_of(std::size_t part) const { return {element_, positions_, parts(depth_)[part]}; }
  Nodal mean_gradient() const;

  const Element& element_;
  const Nodal positions_;
  int depth_;
  double mean_ = 0;
  double least_ratio_ = 1;
  bool is_positive_ = true;
  std::vector<Active> active_;
};

}  // namespace itr
