// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "itr/types.hpp"

namespace itr {

inline Mat<3> skew(const Vec<3>& w) {
  Mat<3> W;
  W << 0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0;
  return W;
}
/// axial(skew(w)) = 2 w.
inline Vec<3> axial(const Mat<3>& A) { return {A(2, 1) - A(1, 2), A(0, 2) - A(2, 0), A(1, 0) - A(0, 1)}; }

/// The rotation R that is nearest to G, the largest of tr(R^T G), as a function of G; G has at least rank 2, in the plane 1.
/// All matrices are 3 x 3: those of the plane have 0 in their third rows and columns, and R turns about z.
template <int Dim>
class NearestRotation {
 public:
  explicit NearestRotation(const Mat<3>& G) : R_(Mat<3>::Identity()) {
    Mat<3> filled = G;
    if constexpr (Dim == 2) {
      const double turn = std::atan2(G(1, 0) - G(0, 1), G(0, 0) + G(1, 1));
      R_ = Eigen::AngleAxisd(turn, Vec<3>::UnitZ()).toRotationMatrix();
      filled(2, 2) = G.norm();  // nothing in the plane depends on it
    } else {
      const Eigen::JacobiSVD<Mat<3>> svd(G, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Vec<3> signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
      R_ = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
    }
    const Mat<3> product = R_.transpose() * filled;
    S_ = (product + product.transpose()) / 2;
    inverse_ = (S_.trace() * Mat<3>::Identity() - S_).inverse();
  }
  const Mat<3>& R() const { return R_; }
  /// w of dR = R skew(w) for dG = H.
  Vec<3> spin(const Mat<3>& H) const { return inverse_ * axial(R_.transpose() * H); }
  Mat<3> first(const Mat<3>& H) const { return R_ * skew(spin(H)); }
  /// v of the second derivative R ((skew(a) skew(b) + skew(b) skew(a)) / 2 + skew(v)) for H and K, with their spins a and b.
  Vec<3> second_spin(const Mat<3>& H, const Vec<3>& a, const Mat<3>& K, const Vec<3>& b) const {
    const Mat<3> A = skew(a), B = skew(b), both = (A * B + B * A) / 2;
    return inverse_ * (axial(both * S_) - axial(A * R_.transpose() * K) - axial(B * R_.transpose() * H));
  }
  /// The gradient by G of a function with the gradient C by R, and `moment` by the spin in the body's axes.
  Mat<3> gradient(const Mat<3>& C, const Vec<3>& moment) const {
    return R_ * skew(inverse_ * (axial(R_.transpose() * C) + moment));
  }

 private:
  Mat<3> R_, S_, inverse_;
};

}  // namespace itr
