// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "itr/types.hpp"

namespace itr {

/// Displacements u = x - X of nodes, with x = base + d where an increment is given. Differences of them keep the relative
/// precision of the increment.
template <int Dim>
class Displacement {
 public:
  Displacement(const std::vector<Vec<Dim>>& rest, ConstVectorView x) : rest_(rest.data()), x_(x.data()), d_(nullptr) {}
  Displacement(const std::vector<Vec<Dim>>& rest, ConstVectorView base, ConstVectorView d)
      : rest_(rest.data()), x_(base.data()), d_(d.data()) {}

  Vec<Dim> of(int a) const {
    using Column = Eigen::Map<const Vec<Dim>>;
    Vec<Dim> displacement = Column(x_ + Dim * a) - rest_[a];
    if (d_) displacement += Column(d_ + Dim * a);
    return displacement;
  }
  /// u_b - u_a
  Vec<Dim> difference(int a, int b) const {
    using Column = Eigen::Map<const Vec<Dim>>;
    Vec<Dim> difference = (Column(x_ + Dim * b) - rest_[b]) - (Column(x_ + Dim * a) - rest_[a]);
    if (d_) difference += Column(d_ + Dim * b) - Column(d_ + Dim * a);
    return difference;
  }

 private:
  const Vec<Dim>* rest_;
  const double* x_;
  const double* d_;  ///< null: x is the positions
};

}  // namespace itr
