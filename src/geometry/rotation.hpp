// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "itr/types.hpp"

namespace itr {

/// Angle of the rotation that is nearest to F [degrees].
inline double rotation_angle(const Mat<2>& F) {
  return std::abs(std::atan2(F(1, 0) - F(0, 1), F(0, 0) + F(1, 1))) * 180 / std::numbers::pi;
}
inline double rotation_angle(const Mat<3>& F) {
  const Eigen::JacobiSVD<Mat<3>> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double cosine = ((svd.matrixU() * svd.matrixV().transpose()).trace() - 1) / 2;
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

}  // namespace itr
