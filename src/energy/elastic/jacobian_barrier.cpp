// SPDX-License-Identifier: MIT
#include "jacobian_barrier.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/quadratic_bernstein.hpp"
#include "itr/fem/quadrature.hpp"

namespace itr {

namespace {

/// phi and its derivatives by s.
struct Phi {
  double value, first, second;
};
Phi phi(double s, double s0) {
  const double r = s / s0, u = r - 1, log = std::log(r);
  return {-u * u * log, (-2 * u * log - u * u / r) / s0, (-2 * log - 4 * u / r + u * u / (r * r)) / (s0 * s0)};
}

template <int Dim>
const auto& coefficients() {
  return BernsteinTable<Dim, 1>::get().coefficients;
}

/// The derivative of a determinant by one of its columns.
Vec<2> cofactor(const std::array<Vec<2>, 2>& c, int column) {
  return column == 0 ? Vec<2>(c[1][1], -c[1][0]) : Vec<2>(-c[0][1], c[0][0]);
}
Vec<3> cofactor(const std::array<Vec<3>, 3>& c, int column) { return c[(column + 1) % 3].cross(c[(column + 2) % 3]); }

/// And by one column, then by the next one.
Mat<2> second_cofactor(const std::array<Vec<2>, 2>&, int column) {
  return (Mat<2>() << 0, 1, -1, 0).finished() * (column == 0 ? 1 : -1);
}
Mat<3> second_cofactor(const std::array<Vec<3>, 3>& c, int column) {
  const Vec<3>& last = c[(column + 2) % 3];
  return (Mat<3>() << 0, last[2], -last[1], -last[2], 0, last[0], last[1], -last[0], 0).finished();
}

/// The columns of F that a determinant takes, each from one corner.
template <int Dim, typename Term>
std::array<Vec<Dim>, Dim> columns_of(const Term& term, const std::array<Mat<Dim>, Dim + 1>& F) {
  std::array<Vec<Dim>, Dim> columns;
  for (int i = 0; i < Dim; ++i) columns[i] = F[term[i].corner].col(i);
  return columns;
}

}  // namespace

template <int Dim>
const std::vector<typename JacobianBarrier<Dim>::Part>& JacobianBarrier<Dim>::parts(int depth) {
  static const auto all = [] {
    std::array<std::vector<Part>, kMostBarrierDepth> by_depth;
    Part whole{};
    for (int k = 0; k <= Dim; ++k) whole[k][k] = 1;
    by_depth[0] = {whole};
    for (int d = 1; d < kMostBarrierDepth; ++d)
      for (const Part& part : by_depth[d - 1])
        for (const auto& child : child_corners<Dim>()) {
          Part& finer = by_depth[d].emplace_back();
          for (int v = 0; v <= Dim; ++v)
            for (int k = 0; k <= Dim; ++k) finer[v][k] = (part[child[v][0]][k] + part[child[v][1]][k]) / 2;
        }
    return by_depth;
  }();
  return all[depth - 1];
}

template <int Dim>
JacobianBarrier<Dim>::PartState::PartState(const Element& element, const Nodal& positions, const Part& corners) {
  for (int c = 0; c <= Dim; ++c) {
    shapes[c] = shape_gradients<Dim>(element, corners[c]);
    F[c] = positions * shapes[c].transpose();
  }
}

template <int Dim>
double JacobianBarrier<Dim>::PartState::coefficient(std::size_t k) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  double sum = 0;
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, F);
    sum += cofactor(columns, 0).dot(columns[0]);
  }
  return sum / static_cast<double>(terms.size());
}

template <int Dim>
void JacobianBarrier<Dim>::PartState::add_gradient(std::size_t k, double factor, Nodal& gradient) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  factor /= static_cast<double>(terms.size());
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, F);
    for (int i = 0; i < Dim; ++i) gradient.noalias() += (factor * cofactor(columns, i)) * shapes[term[i].corner].row(i);
  }
}

template <int Dim>
void JacobianBarrier<Dim>::PartState::add_hessian(std::size_t k, double factor, Block& block) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  factor /= static_cast<double>(terms.size());
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, F);
    for (int i = 0; i < (Dim == 2 ? 1 : Dim); ++i) {
      const int j = (i + 1) % Dim;
      const Mat<Dim> by_columns = factor * second_cofactor(columns, i);
      const auto of_i = shapes[term[i].corner].row(i), of_j = shapes[term[j].corner].row(j);
      for (int a = 0; a < kQuadraticNodes<Dim>; ++a)
        for (int b = 0; b < kQuadraticNodes<Dim>; ++b) {
          const Mat<Dim> entries = of_i[a] * of_j[b] * by_columns;
          block.template block<Dim, Dim>(Dim * a, Dim * b) += entries;
          block.template block<Dim, Dim>(Dim * b, Dim * a) += entries.transpose();
        }
    }
  }
}

template <int Dim>
JacobianBarrier<Dim>::JacobianBarrier(const Element& element, const Nodal& positions, int depth)
    : element_(element), positions_(positions), depth_(depth) {
  const std::size_t count = coefficients<Dim>().size();
  const PartState whole(element, positions, parts(1)[0]);
  for (std::size_t k = 0; k < count; ++k) mean_ += whole.coefficient(k) / static_cast<double>(count);
  is_positive_ = mean_ > 0;
  for (std::size_t p = 0; is_positive_ && p < parts(depth).size(); ++p) {
    const PartState part = state_of(p);
    for (std::size_t k = 0; is_positive_ && k < count; ++k) {
      const double ratio = part.coefficient(k) / mean_;
      is_positive_ = ratio > 0;
      least_ratio_ = std::min(least_ratio_, ratio);
      if (is_positive_ && ratio < kActive) active_.push_back({p, k, ratio});
    }
  }
}

template <int Dim>
double JacobianBarrier<Dim>::value() const {
  if (!is_positive_) return std::numeric_limits<double>::infinity();
  double sum = 0;
  for (const Active& active : active_) sum += phi(active.ratio, kActive).value;
  return sum / static_cast<double>(parts(depth_).size());
}

template <int Dim>
typename JacobianBarrier<Dim>::Nodal JacobianBarrier<Dim>::mean_gradient() const {
  Nodal gradient = Nodal::Zero();
  const std::size_t count = coefficients<Dim>().size();
  const PartState whole(element_, positions_, parts(1)[0]);
  for (std::size_t k = 0; k < count; ++k) whole.add_gradient(k, 1.0 / static_cast<double>(count), gradient);
  return gradient;
}

template <int Dim>
typename JacobianBarrier<Dim>::Nodal JacobianBarrier<Dim>::gradient() const {
  Nodal gradient = Nodal::Zero();
  if (active_.empty()) return gradient;
  const double share = 1 / (mean_ * static_cast<double>(parts(depth_).size()));
  double of_mean = 0;
  for (const Active& active : active_) {
    const double slope = share * phi(active.ratio, kActive).first;
    state_of(active.part).add_gradient(active.coefficient, slope, gradient);
    of_mean -= slope * active.ratio;
  }
  return gradient + of_mean * mean_gradient();
}

// With s = b/m: ds = (db - s dm)/m and d2s = (d2b - s d2m)/m - (ds dm^T + dm ds^T)/m.
template <int Dim>
typename JacobianBarrier<Dim>::Block JacobianBarrier<Dim>::hessian() const {
  using Column = Eigen::Matrix<double, Dim * kQuadraticNodes<Dim>, 1>;
  Block block = Block::Zero();
  if (active_.empty()) return block;
  const double share = 1 / static_cast<double>(parts(depth_).size());
  const Nodal of_mean = mean_gradient();
  const Eigen::Map<const Column> dm(of_mean.data());
  double mean_factor = 0;
  for (const Active& active : active_) {
    const Phi value = phi(active.ratio, kActive);
    const PartState part = state_of(active.part);
    Nodal of_ratio = -active.ratio / mean_ * of_mean;
    part.add_gradient(active.coefficient, 1 / mean_, of_ratio);
    const Eigen::Map<const Column> ds(of_ratio.data());
    block.noalias() += share * value.second * ds * ds.transpose();
    const double slope = share * value.first / mean_;
    block.noalias() -= slope * (ds * dm.transpose());
    block.noalias() -= slope * (dm * ds.transpose());
    part.add_hessian(active.coefficient, slope, block);
    mean_factor -= slope * active.ratio;
  }
  const std::size_t count = coefficients<Dim>().size();
  const PartState whole(element_, positions_, parts(1)[0]);
  for (std::size_t k = 0; k < count; ++k) whole.add_hessian(k, mean_factor / static_cast<double>(count), block);
  return block;
}

template class JacobianBarrier<2>;
template class JacobianBarrier<3>;

}  // namespace itr
