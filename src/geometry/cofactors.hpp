// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>

#include "itr/types.hpp"

namespace itr {

/// Derivatives of det A by A.
inline Mat<2> cofactors(const Mat<2>& A) {
  Mat<2> C;
  C << A(1, 1), -A(1, 0), -A(0, 1), A(0, 0);
  return C;
}
inline Mat<3> cofactors(const Mat<3>& A) {
  Mat<3> C;
  C << A.col(1).cross(A.col(2)), A.col(2).cross(A.col(0)), A.col(0).cross(A.col(1));
  return C;
}

}  // namespace itr
