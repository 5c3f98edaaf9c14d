// SPDX-License-Identifier: MIT
// In rational numbers, where floating point does not decide.
#include <CGAL/Gmpq.h>

#include "quadratic_bernstein.hpp"

namespace itr {

namespace {
constexpr int kExactDepth = 8;
}

template <int Dim>
bool is_positive_everywhere_exact(const QuadraticCell<Dim>& x) {
  if (is_positive_everywhere<Dim>(x)) return true;
  using Number = CGAL::Gmpq;
  const JacobianCorners<Number, Dim, 1> corners{jacobians<Number, Dim>(x)};
  return is_above<Number, Dim, 1>(corners, Number(0), kExactDepth);
}

template bool is_positive_everywhere_exact<2>(const QuadraticCell<2>&);
template bool is_positive_everywhere_exact<3>(const QuadraticCell<3>&);

}  // namespace itr
