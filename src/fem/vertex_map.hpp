// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/SparseCore>
#include <span>

#include "itr/types.hpp"

namespace itr {

/// Vertices that follow linearly from others: y_i = sum_j w_ij x_j + c_i, with one weight for all components.
template <int Dim>
class VertexMap {
 public:
  using Weights = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  /// `weights`: a row for each vertex of y, a column for each of x; zeros in it are dropped. `offset`: c, interleaved [m].
  VertexMap(const Weights& weights, VectorX offset);

  VectorX positions(ConstVectorView x) const;  ///< y(x)
  VectorX motion(ConstVectorView dx) const;    ///< y(x + dx) - y(x)
  /// Adds to the gradient with respect to x of a function of y its gradient with respect to y.
  void add_gradient(ConstVectorView gradient, VectorView result) const;

  /// Vertices of x that a vertex of y follows from, and their weights.
  std::span<const int> sources(int vertex) const { return {weights_.innerIndexPtr() + first(vertex), count(vertex)}; }
  std::span<const double> weights(int vertex) const { return {weights_.valuePtr() + first(vertex), count(vertex)}; }

 private:
  int first(int vertex) const { return weights_.outerIndexPtr()[vertex]; }
  std::size_t count(int vertex) const { return static_cast<std::size_t>(first(vertex + 1) - first(vertex)); }

  Weights weights_;
  VectorX offset_;
};

}  // namespace itr
