// SPDX-License-Identifier: MIT
#include "turned.hpp"

#include <limits>

namespace itr {

HoopBarrier::HoopBarrier(const CellSet<2>& cells, const CellSet<2>::Element& element) {
  const auto add = [&](const Row& coefficient, double at_rest) {
    if (at_rest > 0) rows_[static_cast<std::size_t>(count_++)] = coefficient / at_rest;
  };
  const auto R = [&](int k) { return cells.rest[element.vertices[static_cast<std::size_t>(k)]][0]; };
  for (int k = 0; k < 3; ++k) add(Row::Unit(k), R(k));
  for_each_edge<2>([&](int edge, int i, int j) {
    if (element.curved >> edge & 1) add(2 * Row::Unit(3 + edge) - (Row::Unit(i) + Row::Unit(j)) / 2, (R(i) + R(j)) / 2);
  });
  for (int k = 0; k < count_; ++k) mean_ += rows_[static_cast<std::size_t>(k)] / count_;
}

double HoopBarrier::least_ratio(const Nodal<2>& x) const {
  const double mean = mean_.dot(x.row(0));
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < count_; ++k) least = std::min(least, rows_[static_cast<std::size_t>(k)].dot(x.row(0)));
  return least > 0 ? least / mean : 0;
}

double HoopBarrier::value(const Nodal<2>& x) const {
  const double least = least_ratio(x), mean = mean_.dot(x.row(0));
  if (!(least > 0)) return std::numeric_limits<double>::infinity();
  if (least >= JacobianBarrier<2>::kActive) return 0;
  double sum = 0;
  for (int k = 0; k < count_; ++k)
    if (const double ratio = rows_[static_cast<std::size_t>(k)].dot(x.row(0)) / mean; ratio < JacobianBarrier<2>::kActive)
      sum += barrier_phi(ratio, JacobianBarrier<2>::kActive).value;
  return kWeight * sum;
}

void HoopBarrier::add_gradient(const Nodal<2>& x, double weight, Nodal<2>& gradient) const {
  const double mean = mean_.dot(x.row(0));
  for (int k = 0; k < count_; ++k) {
    const Row& row = rows_[static_cast<std::size_t>(k)];
    const double ratio = row.dot(x.row(0)) / mean;
    if (ratio >= JacobianBarrier<2>::kActive) continue;
    gradient.row(0) +=
        (weight * kWeight * barrier_phi(ratio, JacobianBarrier<2>::kActive).first / mean) * (row - ratio * mean_);
  }
}

// With s = b/m: ds = (db - s dm)/m and d2s = -(ds dm^T + dm ds^T)/m.
void HoopBarrier::add_hessian(const Nodal<2>& x, JacobianBarrier<2>::Block& hessian) const {
  const double mean = mean_.dot(x.row(0));
  Mat<kQuadraticNodes<2>> by_radii = Mat<kQuadraticNodes<2>>::Zero();
  for (int k = 0; k < count_; ++k) {
    const Row& row = rows_[static_cast<std::size_t>(k)];
    const double ratio = row.dot(x.row(0)) / mean;
    if (ratio >= JacobianBarrier<2>::kActive) continue;
    const BarrierPhi phi = barrier_phi(ratio, JacobianBarrier<2>::kActive);
    const Row change = (row - ratio * mean_) / mean;
    by_radii += kWeight * (phi.second * change.transpose() * change -
                           phi.first / mean * (change.transpose() * mean_ + mean_.transpose() * change));
  }
  for (int a = 0; a < kQuadraticNodes<2>; ++a)
    for (int b = 0; b < kQuadraticNodes<2>; ++b) hessian(2 * a, 2 * b) += by_radii(a, b);
}

double HoopBarrier::free_step(const Nodal<2>& x, const Nodal<2>& way, double margin) const {
  double t = 1;
  for (int k = 0; k < count_; ++k) {
    const Row& row = rows_[static_cast<std::size_t>(k)];
    const double now = row.dot(x.row(0)), change = row.dot(way.row(0));
    if (now + change * t <= (1 - margin) * now) t = std::min(t, margin * now / -change);
  }
  return t;
}

}  // namespace itr
