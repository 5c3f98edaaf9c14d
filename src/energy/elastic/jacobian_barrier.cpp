// SPDX-License-Identifier: MIT
#include "jacobian_barrier.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/quadratic_bernstein.hpp"
#include "growth.hpp"

namespace itr {

namespace {

template <int Dim>
constexpr int kRefinements = Dim == 2 ? 4 : 3;  ///< d
template <int Dim>
constexpr double kFraction = 1.0 / (1 << kRefinements<Dim>);
template <int Dim>
constexpr std::size_t kCoefficients = Dim == 2 ? 6 : 20;

template <int Dim>
const auto& coefficients() {
  return BernsteinTable<Dim, 1>::get().coefficients;
}

/// The derivative of a determinant by one of its columns.
Vec<2> cofactor(const std::array<Vec<2>, 2>& c, int column) {
  return column == 0 ? Vec<2>(c[1][1], -c[1][0]) : Vec<2>(-c[0][1], c[0][0]);
}
Vec<3> cofactor(const std::array<Vec<3>, 3>& c, int column) { return c[(column + 1) % 3].cross(c[(column + 2) % 3]); }

/// The determinant's derivative by `column` and the next one, S_rs = sum_c e_crs v_c with the permutation symbol e, as v.
std::array<double, 1> second_cofactor(const std::array<Vec<2>, 2>&, int) { return {1}; }
std::array<double, 3> second_cofactor(const std::array<Vec<3>, 3>& c, int column) {
  const Vec<3>& last = c[(column + 2) % 3];
  return {last[0], last[1], last[2]};
}

/// The columns of F that a determinant takes, each from one corner.
template <int Dim, typename Term>
std::array<Vec<Dim>, Dim> columns_of(const Term& term, const std::array<Mat<Dim>, Dim + 1>& F) {
  std::array<Vec<Dim>, Dim> columns;
  for (int i = 0; i < Dim; ++i) columns[i] = F[term[i].corner].col(i);
  return columns;
}

/// Whether F = M (I + E) with |E| < 1/2 at all corners, M its mean. A coefficient is a mean of determinants with columns
/// from corners, each at least 0.11 det M, and m is at most 1.9 det M: so that no coefficient is below s0 m.
template <int Dim>
bool varies_little(const std::array<Mat<Dim>, Dim + 1>& F) {
  Mat<Dim> mean = Mat<Dim>::Zero();
  for (const auto& at_corner : F) mean += at_corner / (Dim + 1);
  if (!(mean.determinant() > 0)) return false;
  const Mat<Dim> inverse = mean.inverse();
  return std::all_of(F.begin(), F.end(), [&](const Mat<Dim>& at_corner) {
    return (inverse * at_corner - Mat<Dim>::Identity()).squaredNorm() < 0.25;
  });
}

}  // namespace

BarrierPhi barrier_phi(double s, double s0) {
  const double r = s / s0, u = r - 1, log = std::log(r);
  return {-u * u * log, (-2 * u * log - u * u / r) / s0, (-2 * log - 4 * u / r + u * u / (r * r)) / (s0 * s0)};
}

template <int Dim>
double JacobianBarrier<Dim>::Part::coefficient(std::size_t k) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  double sum = 0;
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, F);
    sum += cofactor(columns, 0).dot(columns[0]);
  }
  return sum / static_cast<double>(terms.size());
}

template <int Dim>
typename JacobianBarrier<Dim>::Shapes JacobianBarrier<Dim>::shapes_of(const Part& part) const {
  Shapes shapes;
  for (int c = 0; c <= Dim; ++c) shapes[c] = quadratic_gradients<Dim, Dim>(curved_, part.corners[c], linear_);
  return shapes;
}

template <int Dim>
void JacobianBarrier<Dim>::add_gradient(const Part& part, const Shapes& shapes, std::size_t k, double factor,
                                        Nodal& gradient) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  factor /= static_cast<double>(terms.size());
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, part.F);
    for (int i = 0; i < Dim; ++i) gradient.noalias() += (factor * cofactor(columns, i)) * shapes[term[i].corner].row(i);
  }
}

template <int Dim>
void JacobianBarrier<Dim>::add_hessian(const Part& part, const Shapes& shapes, std::size_t k, double factor,
                                       SkewBlocks& blocks) const {
  const auto& terms = coefficients<Dim>()[k].terms;
  factor /= static_cast<double>(terms.size());
  for (const auto& term : terms) {
    const auto columns = columns_of<Dim>(term, part.F);
    for (int i = 0; i < (Dim == 2 ? 1 : Dim); ++i) {
      const int j = (i + 1) % Dim;
      const auto entries = second_cofactor(columns, i);
      const Eigen::Matrix<double, kQuadraticNodes<Dim>, 1> of_i = factor * shapes[term[i].corner].row(i).transpose();
      const Eigen::Matrix<double, kQuadraticNodes<Dim>, 1> of_j = shapes[term[j].corner].row(j).transpose();
      for (std::size_t c = 0; c < entries.size(); ++c) blocks[c].noalias() += (entries[c] * of_i) * of_j.transpose();
    }
  }
}

template <int Dim>
JacobianBarrier<Dim>::JacobianBarrier(CurvedEdges curved, const Eigen::Matrix<double, Dim, Dim + 1>& linear,
                                      const Nodal& positions)
    : curved_(curved), linear_(linear) {
  // With the offset o of an edge's node from the middle of its ends, F has 4 o grad^T of the barycentric coordinate of the
  // other end at each end.
  whole_.F.fill(positions.template leftCols<Dim + 1>() * linear.transpose());
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (!(curved >> edge & 1)) return;
    const Vec<Dim> offset = 4 * positions.col(Dim + 1 + edge) - 2 * (positions.col(i) + positions.col(j));
    whole_.F[i].noalias() += offset * linear.col(j).transpose();
    whole_.F[j].noalias() += offset * linear.col(i).transpose();
  });
  if (varies_little<Dim>(whole_.F)) return;
  for (int c = 0; c <= Dim; ++c) {
    whole_.corners[c] = {};
    whole_.corners[c][c] = 1;
  }
  const std::size_t count = coefficients<Dim>().size();
  for (std::size_t k = 0; k < count; ++k) mean_ += whole_.coefficient(k) / static_cast<double>(count);
  if (mean_ > 0)
    search(whole_, kRefinements<Dim>);
  else
    least_ratio_ = 0;
}

template <int Dim>
void JacobianBarrier<Dim>::search(const Part& part, int refinements_left) {
  const auto& all = coefficients<Dim>();
  std::array<double, kCoefficients<Dim>> ratios;
  double least = 1;
  for (std::size_t k = 0; k < all.size(); ++k) {
    ratios[k] = part.coefficient(k) / mean_;
    least = std::min(least, ratios[k]);
    if (!(ratios[k] > 0) && (all[k].is_value || refinements_left == 0)) {
      least_ratio_ = 0;
      return;
    }
  }
  if (least >= kActive || refinements_left == 0) {
    least_ratio_ = std::min(least_ratio_, least);
    if (least >= kActive) return;
    for (std::size_t k = 0; k < all.size(); ++k)
      if (ratios[k] < kActive) active_.push_back({parts_.size(), k, ratios[k]});
    parts_.push_back(part);
    return;
  }
  for (const auto& child : child_corners<Dim>()) {
    Part finer;
    for (int v = 0; v <= Dim; ++v) {
      const auto [i, j] = child[v];
      for (int k = 0; k <= Dim; ++k) finer.corners[v][k] = (part.corners[i][k] + part.corners[j][k]) / 2;
      finer.F[v] = (part.F[i] + part.F[j]) / 2;
    }
    search(finer, refinements_left - 1);
    if (least_ratio_ == 0) return;
  }
}

template <int Dim>
double JacobianBarrier<Dim>::value() const {
  if (least_ratio_ == 0) return std::numeric_limits<double>::infinity();
  double sum = 0;
  for (const Active& active : active_) sum += barrier_phi(active.ratio, kActive).value;
  return kFraction<Dim> * sum;
}

template <int Dim>
typename JacobianBarrier<Dim>::Nodal JacobianBarrier<Dim>::mean_gradient() const {
  Nodal gradient = Nodal::Zero();
  const Shapes shapes = shapes_of(whole_);
  for (std::size_t k = 0; k < kCoefficients<Dim>; ++k)
    add_gradient(whole_, shapes, k, 1.0 / static_cast<double>(kCoefficients<Dim>), gradient);
  return gradient;
}

template <int Dim>
typename JacobianBarrier<Dim>::Nodal JacobianBarrier<Dim>::gradient() const {
  Nodal gradient = Nodal::Zero();
  if (active_.empty()) return gradient;
  double of_mean = 0;
  for (std::size_t p = 0, next = 0; p < parts_.size(); ++p) {
    const Shapes shapes = shapes_of(parts_[p]);
    for (; next < active_.size() && active_[next].part == p; ++next) {
      const double slope = kFraction<Dim> / mean_ * barrier_phi(active_[next].ratio, kActive).first;
      add_gradient(parts_[p], shapes, active_[next].coefficient, slope, gradient);
      of_mean -= slope * active_[next].ratio;
    }
  }
  return gradient + of_mean * mean_gradient();
}

// With s = b/m: ds = (db - s dm)/m and d2s = (d2b - s d2m)/m - (ds dm^T + dm ds^T)/m.
template <int Dim>
typename JacobianBarrier<Dim>::Block JacobianBarrier<Dim>::hessian() const {
  using Column = Eigen::Matrix<double, Dim * kQuadraticNodes<Dim>, 1>;
  Block block = Block::Zero();
  if (active_.empty()) return block;
  SkewBlocks second;
  for (auto& entries : second) entries.setZero();
  const Nodal of_mean = mean_gradient();
  const Eigen::Map<const Column> dm(of_mean.data());
  Column mixed = Column::Zero();
  double mean_factor = 0;
  for (std::size_t p = 0, next = 0; p < parts_.size(); ++p) {
    const Shapes shapes = shapes_of(parts_[p]);
    for (; next < active_.size() && active_[next].part == p; ++next) {
      const auto [part, k, ratio] = active_[next];
      const BarrierPhi value = barrier_phi(ratio, kActive);
      Nodal of_ratio = -ratio / mean_ * of_mean;
      add_gradient(parts_[p], shapes, k, 1 / mean_, of_ratio);
      const Eigen::Map<const Column> ds(of_ratio.data());
      block.noalias() += (kFraction<Dim> * value.second * ds) * ds.transpose();
      const double slope = kFraction<Dim> / mean_ * value.first;
      add_hessian(parts_[p], shapes, k, slope, second);
      mixed -= slope * ds;
      mean_factor -= slope * ratio;
    }
  }
  block.noalias() += mixed * dm.transpose();
  block.noalias() += dm * mixed.transpose();
  const Shapes shapes = shapes_of(whole_);
  for (std::size_t k = 0; k < kCoefficients<Dim>; ++k)
    add_hessian(whole_, shapes, k, mean_factor / static_cast<double>(kCoefficients<Dim>), second);
  for (int a = 0; a < kQuadraticNodes<Dim>; ++a)
    for (int b = 0; b < kQuadraticNodes<Dim>; ++b)
      for (std::size_t c = 0; c < second.size(); ++c) {
        // Both orders of a term's two columns; of the other one rows and columns are exchanged.
        const double entry = second[c](a, b) - second[c](b, a);
        const int row = Dim == 2 ? 0 : static_cast<int>(c + 1) % 3, column = Dim == 2 ? 1 : static_cast<int>(c + 2) % 3;
        block(Dim * a + row, Dim * b + column) += entry;
        block(Dim * a + column, Dim * b + row) -= entry;
      }
  return block;
}

template <int Dim>
double stiffness_at_rest(const ElasticModuli& moduli) {
  const auto values = elastic_eigensystem<Dim>(Mat<Dim>::Identity(), without_growth(moduli)).values;
  return *std::max_element(values.begin(), values.end());
}

template class JacobianBarrier<2>;
template class JacobianBarrier<3>;
template double stiffness_at_rest<2>(const ElasticModuli&);
template double stiffness_at_rest<3>(const ElasticModuli&);

}  // namespace itr
