// SPDX-License-Identifier: MIT
// U U^T beside a symmetric matrix K, U of a few columns: never assembled.
#pragma once

#include <Eigen/LU>
#include <span>
#include <utility>

#include "itr/types.hpp"

namespace itr::linear {

inline Eigen::Map<const VectorX> as_vector(std::span<const double> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}
inline Eigen::Map<VectorX> as_vector(std::span<double> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

template <typename Vector>
auto as_span(Vector&& vector) {
  return std::span(vector.data(), static_cast<std::size_t>(vector.size()));
}

/// y += U U^T x.
inline void add_low_rank(const MatrixX& U, ConstVectorView x, VectorView y) { y += U * (U.transpose() * x); }

/// Makes solutions with K ones with K + U U^T (Woodbury; Golub & Van Loan 2013, §2.1.4).
class LowRankCorrection {
 public:
  /// `solve` maps a column u to K^-1 u, and is false where it fails: then this is too.
  template <typename Solve>
  bool compute(const MatrixX& U, const Solve& solve) {
    MatrixX Z(U.rows(), U.cols());
    for (Eigen::Index k = 0; k < U.cols(); ++k)
      if (!solve(U.col(k), Z.col(k))) return false;
    set_columns(U, std::move(Z));
    return true;
  }
  /// Takes Z = K^-1 U as it is.
  void set_columns(const MatrixX& U, MatrixX Z) {
    Z_ = std::move(Z);
    U_ = U;
    small_.compute(MatrixX::Identity(U.cols(), U.cols()) + U.transpose() * Z_);
  }
  void clear() { Z_.resize(0, 0); }
  Eigen::Index columns() const { return Z_.cols(); }
  void correct(VectorView solution) const { solution -= Z_ * small_.solve(U_.transpose() * solution); }

 private:
  MatrixX U_, Z_;
  Eigen::PartialPivLU<MatrixX> small_;  ///< of 1 + U^T Z
};

}  // namespace itr::linear
