// SPDX-License-Identifier: MIT
#include "energy/coupling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "energy/facet_shapes.hpp"
#include "energy/project_block.hpp"
#include "energy/round_off.hpp"
#include "fem/cell_set.hpp"

namespace itr {

namespace {

constexpr double kRoundOff = 1e-13;  ///< of sizes and positions: less is not open, and no arm

/// A block of the plane in a matrix of space.
template <int Dim>
Mat<3> in_space(const Mat<Dim>& block) {
  Mat<3> all = Mat<3>::Zero();
  all.topLeftCorner<Dim, Dim>() = block;
  return all;
}

/// By a held turn, the matrix of its condition <matrix, Q^T R> = 0 for the rotation R, held at Q. An axis that is free to
/// turn about stays where Q has it, or in the plane of that and the held axis.
Mat<3> condition_of(const std::array<bool, 3>& held, int axis) {
  const int next = (axis + 1) % 3, last = (axis + 2) % 3;
  Mat<3> matrix = Mat<3>::Zero();
  if (!held[next])
    matrix(last, next) = 1;
  else if (!held[last])
    matrix(next, last) = -1;
  else
    matrix(last, next) = 0.5, matrix(next, last) = -0.5;
  return matrix;
}

/// By axis, the part of k/2 |(R - Q) axis|^2 in the energy that holds R at Q: beside the condition it is k/2 of the squares
/// of these, and largest half a turn away, where squares are least again. One held turn alone has none.
Vec<3> parts_of_axes(const std::array<bool, 3>& held) {
  const auto count = std::ranges::count(held, true);
  Vec<3> parts = Vec<3>::Zero();
  for (int c = 0; c < 3; ++c) parts[c] = count == 3 ? 0.5 : count == 2 && !held[c] ? 1 : 0;
  return parts;
}

/// The means of products with X - centroid.
template <int Dim>
Mat<3> products_of(const Eigen::Matrix<double, Dim, Dim + 1>& means) {
  return in_space<Dim>(means.template rightCols<Dim>());
}

}  // namespace

template <int Dim>
SurfaceMean<Dim>::SurfaceMean(const CellSet<Dim>& cells, std::span<const int> surfaces) {
  std::map<int, double> sums;  // by node: integrals of its shape function
  std::vector<const typename CellSet<Dim>::BoundaryFacet*> facets;
  for (const auto& facet : cells.facets) {
    if (std::ranges::find(surfaces, facet.tag) == surfaces.end()) continue;
    facets.push_back(&facet);
    part = facet.part;
    for_each_facet_point<Dim>(cells, facet, [&](const Vec<Dim>& X, double measure, const auto&) {
      area += measure;
      centroid += measure * X;
    });
    for (const int node : facet.vertices) sums[node] = 0;
    if (facet.curved)
      for (const int node : facet.nodes()) sums[node] = 0;
  }
  centroid /= area;
  std::map<int, Eigen::Index> row;
  for (const auto& [node, zero] : sums) {
    row[node] = static_cast<Eigen::Index>(nodes.size());
    nodes.push_back(node);
  }
  weights = MatrixX::Zero(static_cast<Eigen::Index>(nodes.size()), Dim + 1);
  rest.resize(Dim, weights.rows());
  for (Eigen::Index i = 0; i < weights.rows(); ++i) rest.col(i) = cells.rest[nodes[i]];
  for (const auto* facet : facets)
    for_each_facet_point<Dim>(cells, *facet, [&](const Vec<Dim>& X, double measure, const auto& shapes) {
      const Vec<Dim> arm = X - centroid;
      const auto of = facet->nodes();
      moments += measure / area * in_space<Dim>(arm * arm.transpose());
      for (Eigen::Index k = 0; k < shapes.size(); ++k) {
        if (shapes[k] == 0) continue;
        auto sum = weights.row(row.at(of[k]));
        sum[0] += measure / area * shapes[k];
        sum.template tail<Dim>() += measure / area * shapes[k] * arm.transpose();
      }
    });
}

template <int Dim>
MatrixX SurfaceMean<Dim>::values(ConstVectorView field) const {
  MatrixX columns(Dim, rest.cols());
  for (Eigen::Index i = 0; i < columns.cols(); ++i) columns.col(i) = field.segment<Dim>(Dim * nodes[i]);
  return columns;
}

template <int Dim>
CoupledPoint<Dim>::CoupledPoint(const SurfaceMean<Dim>& mean, const Vec<3>& point) : mean_(mean) {
  arm_.head<Dim>() = point.head<Dim>() - mean.centroid;
  if (arm_.norm() <= kRoundOff * (point.norm() + std::sqrt(mean.moments.trace()))) arm_.setZero();
}

template <int Dim>
NearestRotation<Dim> CoupledPoint<Dim>::rotation(const Means& means) const {
  return NearestRotation<Dim>(mean_.moments + products_of<Dim>(means));
}

template <int Dim>
Vec<Dim> CoupledPoint<Dim>::displacement(ConstVectorView x) const {
  const Means means = means_of(mean_.displacements(x));
  return displacement(means, rotation(means).R());
}

template <int Dim>
Vec<Dim> CoupledPoint<Dim>::velocity(ConstVectorView x, ConstVectorView v) const {
  const Means rate = means_of(mean_.values(v));
  const auto rotation_at = rotation(means_of(mean_.displacements(x)));
  return rate.col(0) + (rotation_at.first(products_of<Dim>(rate)) * arm_).template head<Dim>();
}

template <int Dim>
Vec<Dim> CoupledPoint<Dim>::acceleration(ConstVectorView x, ConstVectorView v, ConstVectorView a) const {
  const auto rotation_at = rotation(means_of(mean_.displacements(x)));
  const Mat<3> H = products_of<Dim>(means_of(mean_.values(v)));
  const Vec<3> w = rotation_at.spin(H);
  const Mat<3> second = rotation_at.R() * (skew(w) * skew(w) + skew(rotation_at.second_spin(H, w, H, w)));
  return velocity(x, a) + (second * arm_).template head<Dim>();
}

template <int Dim>
CouplingEnergy<Dim>::CouplingEnergy(const CoupledPoint<Dim>& point, const PointTerms<Dim>& terms, HeldPoint<Dim> held,
                                    double scale)
    : point_(point), mean_(point.mean()), terms_(terms), held_(std::move(held)), scale_(scale) {
  multiplier_.nodes = MatrixX::Zero(Dim, held_.is_rigid ? mean_.rest.cols() : 0);
  arms_ = mean_.rest.colwise() - mean_.centroid;
  if (Dim == 2) held_.rotation.fill(held_.rotation[2]);  // surfaces turn about z only
}

template <int Dim>
typename CouplingEnergy<Dim>::Open CouplingEnergy<Dim>::open_at(const MatrixX& U, const Means& means,
                                                                const Mat<3>& R) const {
  Open open;
  open.nodes.resize(Dim, 0);
  const Vec<Dim> u = point_.displacement(means, R) - held_.displacement;
  const Mat<3> seen = held_.turned.transpose() * R;
  for (int c = 0; c < Dim; ++c)
    if (held_.position[c]) open.position[c] = u[c];
  for (int c = 0; c < 3; ++c)
    if (held_.rotation[c]) open.rotation[c] = condition_of(held_.rotation, c).cwiseProduct(seen).sum();
  if (held_.is_rigid) {
    const Mat<Dim> turned = (R - Mat<3>::Identity()).topLeftCorner<Dim, Dim>();
    open.nodes = (U - turned * arms_).colwise() - Vec<Dim>(means.col(0));
  }
  return open;
}

template <int Dim>
double CouplingEnergy<Dim>::value_of(const MatrixX& U) const {
  const Means means = point_.means_of(U);
  const Mat<3> R = point_.rotation(means).R();
  const Vec<Dim> u = point_.displacement(means, R), off = u - terms_.origin;
  double sum = -terms_.force.dot(u) + off.dot(terms_.stiffness * off) / 2 - terms_.couple.cwiseProduct(R).sum();
  if (terms_.moment != 0)
    sum -= terms_.moment * std::remainder(std::atan2(R(1, 0), R(0, 0)) - terms_.turn, 2 * std::numbers::pi);
  const Open open = open_at(U, means, R);
  sum += multiplier_.position.dot(open.position) + held_.stiffness / 2 * open.position.squaredNorm();
  const Vec<3> axes = parts_of_axes(held_.rotation);
  const Vec<3> off_axes = (R - held_.turned).colwise().squaredNorm();
  sum += multiplier_.rotation.dot(open.rotation) +
         rotation_stiffness() / 2 * (axes.isZero(0) ? open.rotation.squaredNorm() : axes.dot(off_axes));
  if (held_.is_rigid)
    sum += (multiplier_.nodes.cwiseProduct(open.nodes).sum() + held_.stiffness / 2 * open.nodes.squaredNorm()) /
           static_cast<double>(U.cols());
  return scale_ * sum;
}

/// Forces that work along displacements since rest, which may be large beside those of the step, and along turns.
template <int Dim>
double CouplingEnergy<Dim>::value_round_off_at(const Increment& at, Workspace& workspace) const {
  const MatrixX U = displacements_at(at);
  const Means means = point_.means_of(U);
  const Mat<3> R = point_.rotation(means).R();
  const Open open = open_at(U, means, R);
  const double way = U.colwise().norm().maxCoeff(), arms = arms_.colwise().norm().maxCoeff();
  const Vec<Dim> off = point_.displacement(means, R) - terms_.origin;
  const double forces = terms_.force.norm() + (terms_.stiffness * off).norm() + multiplier_.position.norm() +
                        held_.stiffness * open.position.norm();
  const double moments = terms_.couple.norm() + std::abs(terms_.moment) + multiplier_.rotation.norm() +
                         rotation_stiffness() * (open.rotation.norm() +
                                                 ((R - held_.turned) * parts_of_axes(held_.rotation).asDiagonal()).norm());
  double work = forces * (way + point_.arm().norm()) + std::numbers::pi * moments;
  if (held_.is_rigid)
    work += (multiplier_.nodes.colwise().norm().sum() + held_.stiffness * open.nodes.colwise().norm().sum()) * (way + arms) /
            static_cast<double>(U.cols());
  return IncrementalTerm::value_round_off_at(at, workspace) + kEpsilon * scale_ * work;
}

template <int Dim>
typename CouplingEnergy<Dim>::Forces CouplingEnergy<Dim>::forces_at(const MatrixX& U) const {
  const Means means = point_.means_of(U);
  const auto rotation = point_.rotation(means);
  const Open open = open_at(U, means, rotation.R());
  Forces forces;
  const Vec<Dim> off = point_.displacement(means, rotation.R()) - terms_.origin;
  forces.by_position = -terms_.force + terms_.stiffness * off + multiplier_.position + held_.stiffness * open.position;
  Vec<3> in_all = Vec<3>::Zero();
  in_all.head<Dim>() = forces.by_position;
  const Vec<3> axes = parts_of_axes(held_.rotation);
  forces.by_rotation = in_all * point_.arm().transpose() - terms_.couple +
                       rotation_stiffness() * (rotation.R() - held_.turned) * axes.asDiagonal();
  for (int c = 0; c < 3; ++c) {
    const double couple = multiplier_.rotation[c] + (axes.isZero(0) ? rotation_stiffness() * open.rotation[c] : 0);
    forces.by_rotation += couple * held_.turned * condition_of(held_.rotation, c);
  }
  forces.by_means.col(0) = forces.by_position;
  if (held_.is_rigid) {
    forces.by_nodes = (multiplier_.nodes + held_.stiffness * open.nodes) / static_cast<double>(U.cols());
    forces.by_means.col(0) -= forces.by_nodes.rowwise().sum();
    forces.by_rotation -= in_space<Dim>(forces.by_nodes * arms_.transpose());
  }
  const Vec<3> moment(0, 0, -terms_.moment);
  forces.by_means.template rightCols<Dim>() =
      rotation.gradient(forces.by_rotation, moment).template topLeftCorner<Dim, Dim>();
  forces.by_means *= scale_;
  forces.by_nodes *= scale_;
  return forces;
}

template <int Dim>
void CouplingEnergy<Dim>::add_gradient_of(const MatrixX& U, VectorView gradient) const {
  const Forces forces = forces_at(U);
  MatrixX nodal = forces.by_means * mean_.weights.transpose();
  if (held_.is_rigid) nodal += forces.by_nodes;
  for (Eigen::Index i = 0; i < nodal.cols(); ++i) gradient.segment<Dim>(Dim * mean_.nodes[i]) += nodal.col(i);
}

/// Whether forces do not depend on where the surface is.
template <int Dim>
bool CouplingEnergy<Dim>::is_linear() const {
  return terms_.stiffness.isZero(0) && terms_.couple.isZero(0) && terms_.moment == 0 && point_.arm().isZero(0) &&
         held_.position == std::array<bool, 3>{} && held_.rotation == std::array<bool, 3>{} && !held_.is_rigid;
}

// By entries j of the means, u and R have derivatives du_j and R skew(w_j). What is quadratic in these is never negative;
// the rest is projected.
template <int Dim>
void CouplingEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  if (is_linear()) return;
  constexpr int kMeans = Dim * (Dim + 1);
  const MatrixX U = mean_.displacements(x);
  const Forces forces = forces_at(U);
  const auto rotation = point_.rotation(point_.means_of(U));
  const Mat<3> C = rotation.R().transpose() * forces.by_rotation;
  const Mat<3> seen = held_.turned.transpose() * rotation.R();
  std::array<Mat<3>, kMeans> H;
  std::array<Vec<3>, kMeans> w;
  Eigen::Matrix<double, Dim, kMeans> du;
  Eigen::Matrix<double, 9, kMeans> turn = Eigen::Matrix<double, 9, kMeans>::Zero();  // what is held of turns
  const Vec<3> axes = parts_of_axes(held_.rotation);
  std::array<Mat<Dim>, kMeans> dR;
  for (int j = 0; j < kMeans; ++j) {
    H[j].setZero();
    if (j >= Dim) H[j](j % Dim, j / Dim - 1) = 1;
    w[j] = rotation.spin(H[j]);
    const Mat<3> change = rotation.R() * skew(w[j]);
    dR[j] = change.topLeftCorner<Dim, Dim>();
    du.col(j) = (change * point_.arm()).template head<Dim>();
    if (j < Dim) du(j, j) += 1;
    if (!axes.isZero(0)) turn.col(j) = Mat<3>(change * axes.cwiseSqrt().asDiagonal()).reshaped();
    for (int c = 0; axes.isZero(0) && c < 3; ++c)
      if (held_.rotation[c]) turn(c, j) = condition_of(held_.rotation, c).cwiseProduct(seen * skew(w[j])).sum();
  }
  Mat<Dim> K = terms_.stiffness;
  for (int c = 0; c < Dim; ++c) K(c, c) += held_.position[c] ? held_.stiffness : 0;
  MatrixX by_means = du.transpose() * K * du + rotation_stiffness() * turn.transpose() * turn;
  MatrixX curved(kMeans, kMeans);
  for (int j = 0; j < kMeans; ++j)
    for (int l = 0; l <= j; ++l) {
      const Mat<3> A = skew(w[j]), B = skew(w[l]);
      const Vec<3> v = rotation.second_spin(H[j], w[j], H[l], w[l]);
      curved(j, l) = curved(l, j) = C.cwiseProduct((A * B + B * A) / 2 + skew(v)).sum() - terms_.moment * v[2];
    }
  project_block(curved, psd);
  by_means += curved;
  const Eigen::Index n = U.cols();
  MatrixX to_means = MatrixX::Zero(Dim * n, kMeans);  // transposed
  for (Eigen::Index i = 0; i < n; ++i)
    for (int k = 0; k <= Dim; ++k) to_means.block<Dim, Dim>(Dim * i, Dim * k) = mean_.weights(i, k) * Mat<Dim>::Identity();
  MatrixX block = to_means * by_means * to_means.transpose();
  if (held_.is_rigid) {
    const double stiffness = held_.stiffness / static_cast<double>(n);
    MatrixX frame(Dim * n, kMeans);  // motions of nodes with the frame
    for (int j = 0; j < kMeans; ++j)
      for (Eigen::Index i = 0; i < n; ++i) {
        frame.block<Dim, 1>(Dim * i, j) = dR[j] * arms_.col(i);
        if (j < Dim) frame(Dim * i + j, j) += 1;
      }
    const MatrixX with_frame = to_means * (frame - to_means * (frame.transpose() * frame) / 2).transpose();
    block -= stiffness * (with_frame + with_frame.transpose());
    block.diagonal().array() += stiffness;
  }
  block *= scale_;
  sink.add<Dim>(mean_.nodes, block.data());
}

template <int Dim>
void CouplingEnergy<Dim>::add_product(ConstVectorView x, ConstVectorView v, VectorView product) const {
  const auto rotation = point_.rotation(point_.means_of(mean_.displacements(x)));
  Vec<3> force = Vec<3>::Zero();
  force.head<Dim>() = terms_.stiffness * point_.velocity(x, v);
  Means by_means;
  by_means.col(0) = force.head<Dim>();
  by_means.template rightCols<Dim>() =
      rotation.gradient(force * point_.arm().transpose(), Vec<3>::Zero()).template topLeftCorner<Dim, Dim>();
  const MatrixX nodal = scale_ * by_means * mean_.weights.transpose();
  for (Eigen::Index i = 0; i < nodal.cols(); ++i) product.segment<Dim>(Dim * mean_.nodes[i]) += nodal.col(i);
}

/// The farthest that anything held is from where it is to be [m].
template <int Dim>
double CouplingEnergy<Dim>::largest_open(const Open& open) const {
  const double of_nodes = open.nodes.size() > 0 ? open.nodes.colwise().norm().maxCoeff() : 0;
  return std::max({open.position.norm(), open.rotation.norm() * std::sqrt(mean_.moments.trace()), of_nodes});
}

template <int Dim>
double CouplingEnergy<Dim>::error_at(const Increment& at) const {
  const MatrixX U = displacements_at(at);
  const Means means = point_.means_of(U);
  const Open open = open_at(U, means, point_.rotation(means).R());
  const double radius = std::sqrt(mean_.moments.trace());
  const double extent = std::max(mean_.rest.cwiseAbs().maxCoeff(), at.base.lpNorm<Eigen::Infinity>());
  if (largest_open(open) <= kRoundOff * (radius + extent)) return 0;
  const auto size = [&](const Open& forces) {
    const double of_nodes = forces.nodes.size() > 0 ? forces.nodes.colwise().norm().maxCoeff() : 0;
    return std::max({forces.position.norm(), forces.rotation.norm() / radius, of_nodes});
  };
  Open change{held_.stiffness * open.position, rotation_stiffness() * open.rotation, held_.stiffness * open.nodes};
  Open now{multiplier_.position + change.position, multiplier_.rotation + change.rotation, multiplier_.nodes + change.nodes};
  const double largest = std::max(size(now), size(multiplier_));
  return largest == 0 ? 0 : size(change) / largest;
}

template <int Dim>
void CouplingEnergy<Dim>::update(const Increment& at) {
  const MatrixX U = displacements_at(at);
  const Means means = point_.means_of(U);
  const Open open = open_at(U, means, point_.rotation(means).R());
  multiplier_.position += held_.stiffness * open.position;
  multiplier_.rotation += rotation_stiffness() * open.rotation;
  if (held_.is_rigid) multiplier_.nodes += held_.stiffness * open.nodes;
}

template <int Dim>
std::string CouplingEnergy<Dim>::describe(const Increment& at, const Units& units) const {
  const MatrixX U = displacements_at(at);
  const Means means = point_.means_of(U);
  return fmt::format("the coupled point '{}' stays {} away from where it is held: other conditions may hold its surface",
                     held_.name, units.text(largest_open(open_at(U, means, point_.rotation(means).R())), "m", 3));
}

#define ITR_INSTANTIATE(Dim)        \
  template struct SurfaceMean<Dim>; \
  template class CoupledPoint<Dim>; \
  template class CouplingEnergy<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
