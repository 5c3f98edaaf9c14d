// SPDX-License-Identifier: MIT
#include "stretch_response.hpp"

#include <cmath>

#include "strain.hpp"

namespace itr {

double sinh_ratio(double x) {
  constexpr double kSeries = 1e-2;  ///< where four terms reach round-off
  const double square = x * x;
  if (std::abs(x) < kSeries) return 1 + square / 6 * (1 + square / 20 * (1 + square / 42));
  return std::sinh(x) / x;
}

VolumeResponse square_bulk(double bulk, double log_J) {
  const double y = 2 * log_J;
  return {bulk / 4 * minus_expm1(y), bulk / 2 * std::expm1(y), bulk * std::exp(y)};
}

/// The sum of exp(y) - 1 - y with y = alpha times a strain: isochoric strains add up to 0.
StretchSum StretchResponse::powers_of(double alpha, const Vec<3>& strains) const {
  StretchSum S;
  for (int i = 0; i < dimension_; ++i) {
    const double y = alpha * strains[i], change = std::expm1(y);
    S.value += minus_expm1(y);
    S.first[i] = alpha * change;
    S.second(i, i) = alpha * alpha * (1 + change);
    for (int j = 0; j < i; ++j)
      S.divided[3 - i - j] = alpha * alpha * std::exp(alpha * (strains[i] + strains[j]) / 2) *
                             sinh_ratio(alpha * (strains[i] - strains[j]) / 2);
  }
  return S;
}

/// Adds alpha times the sum of the strains, which powers_of leaves out.
StretchSum StretchResponse::powers_by_volume(double alpha, double share) const {
  const double left = alpha * (1 - share);
  Vec<3> strains = strains_;
  strains.head(dimension_).array() -= share * log_J_ / dimension_;
  StretchSum S = powers_of(alpha, strains);
  Mat<3> deviator = Mat<3>::Zero();
  deviator.topLeftCorner(dimension_, dimension_).setConstant(-share / dimension_);
  deviator.diagonal().head(dimension_).array() += 1;
  S.value += left * log_J_;
  S.first = deviator * S.first;
  S.first.head(dimension_).array() += left;
  S.second = deviator * S.second * deviator;
  return S;
}

StretchSum StretchResponse::isochoric_powers(double alpha) const { return powers_by_volume(alpha, 1); }

StretchSum StretchResponse::powers(double alpha) const { return powers_of(alpha, strains_); }

void StretchResponse::add_squares(double factor) {
  StretchSum S;
  S.value = strains_.head(dimension_).squaredNorm();
  S.first.head(dimension_) = 2 * strains_.head(dimension_);
  S.second.diagonal().head(dimension_).setConstant(2);
  S.divided.setConstant(2);
  add(factor, S);
  const double k = 2 * factor / dimension_ * (bulk_ - deviator_);
  if (k != 0) add_to_cell({k / 2 * log_J_ * log_J_, k * log_J_, k});
}

void StretchResponse::add(double f, double d1, double d2, const StretchSum& S) {
  f *= deviator_;
  d1 *= deviator_;
  d2 *= deviator_;
  sum_.value += f;
  sum_.first += d1 * S.first;
  sum_.second += d1 * S.second + d2 * S.first * S.first.transpose();
  sum_.divided += d1 * S.divided;
}

void StretchResponse::add_volume(double U, double d1, double d2) {
  volume_ = {volume_.value + U, volume_.first + d1, volume_.second + d2};
  if (!is_split_) add_to_cell({U, d1, d2});
}

void StretchResponse::add_to_cell(const VolumeResponse& by_log_J) {
  sum_.value += by_log_J.value;
  sum_.first.head(dimension_).array() += by_log_J.first;
  sum_.second.topLeftCorner(dimension_, dimension_).array() += by_log_J.second;
}

}  // namespace itr
