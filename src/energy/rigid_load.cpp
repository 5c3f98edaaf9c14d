// SPDX-License-Identifier: MIT
#include "energy/rigid_load.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "energy/project_block.hpp"

namespace itr {

namespace {

/// The angle of the rotation that is nearest to the vectors of a frame is that of (c, s), linear functions of them.
template <typename Frame>
Vec<2> turn_vector(const Frame& frame) {
  return {frame(0, 1) + frame(1, 2), frame(1, 1) - frame(0, 2)};
}

/// Rows: the derivatives of c and s by the frame's entries, column by column.
Eigen::Matrix<double, 2, 6> turn_gradient() {
  Eigen::Matrix<double, 2, 6> by_frame = Eigen::Matrix<double, 2, 6>::Zero();
  by_frame(0, 2) = by_frame(0, 5) = by_frame(1, 3) = 1;
  by_frame(1, 4) = -1;
  return by_frame;
}

/// Forces by which a couple acts on vectors along the axes of a body, all as long: f_k with sum f_k . (w x a_k) = M . w.
Eigen::Matrix<double, 3, 4> forces_of_couple(const Vec<3>& moment, const Eigen::Matrix<double, 3, 4>& frame) {
  Eigen::Matrix<double, 3, 4> forces = Eigen::Matrix<double, 3, 4>::Zero();
  const double squared = frame.rightCols<3>().squaredNorm() / 3;
  for (int k = 1; k <= 3; ++k) forces.col(k) = moment.cross(Vec<3>(frame.col(k))) / (2 * squared);
  return forces;
}

}  // namespace

template <int Dim>
RigidLoad<Dim>::RigidLoad(const Anchors& anchors, const Mat<Dim + 1>& coefficients, const Vec<Dim>& force,
                          const Vec<3>& moment, ConstVectorView lagged_x, double scale)
    : anchors_(anchors), coefficients_(coefficients), lagged_(at_anchors(lagged_x)), scale_(scale) {
  const Frame frame = lagged_ * coefficients_.transpose();
  Frame forces = Frame::Zero();
  if constexpr (Dim == 2) {
    moment_ = moment[2];
    lagged_turn_ = turn(frame);
  } else {
    forces = forces_of_couple(moment, frame);
    lagged_turn_ = 0;
  }
  forces.col(0) += force;
  forces_ = forces * coefficients_;
}

template <int Dim>
typename RigidLoad<Dim>::Frame RigidLoad<Dim>::at_anchors(ConstVectorView field) const {
  Frame values;
  for (int k = 0; k <= Dim; ++k) values.col(k) = field.segment<Dim>(Dim * anchors_[k]);
  return values;
}

template <int Dim>
double RigidLoad<Dim>::turn(const Frame& frame) const {
  if constexpr (Dim == 3) return 0;
  const Vec<2> of = turn_vector(frame);
  return std::atan2(of[1], of[0]);
}

template <int Dim>
double RigidLoad<Dim>::value(ConstVectorView x, Workspace&) const {
  const Frame now = at_anchors(x);
  double work = forces_.cwiseProduct(now - lagged_).sum();
  if (moment_ != 0)
    work += moment_ * std::remainder(turn(now * coefficients_.transpose()) - lagged_turn_, 2 * std::numbers::pi);
  return -scale_ * work;
}

template <int Dim>
void RigidLoad<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  Frame forces = forces_;
  if constexpr (Dim == 2) {
    if (moment_ != 0) {
      const Vec<2> of = turn_vector(Frame(at_anchors(x) * coefficients_.transpose()));
      const Vec<2> by_of = Vec<2>(-of[1], of[0]) / of.squaredNorm();
      const Vec<6> by_frame = moment_ * turn_gradient().transpose() * by_of;
      forces += by_frame.reshaped(2, 3) * coefficients_;
    }
  }
  for (int k = 0; k <= Dim; ++k) gradient.segment<Dim>(Dim * anchors_[k]) -= scale_ * forces.col(k);
}

template <int Dim>
void RigidLoad<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  if constexpr (Dim == 2) {
    if (moment_ == 0) return;
    const Vec<2> of = turn_vector(Frame(at_anchors(x) * coefficients_.transpose()));
    const double c = of[0], s = of[1], r2 = of.squaredNorm();
    Mat<2> by_of;
    by_of << 2 * s * c, s * s - c * c, s * s - c * c, -2 * s * c;
    const Mat<6> by_frame = -scale_ * moment_ / (r2 * r2) * turn_gradient().transpose() * by_of * turn_gradient();
    Mat<6> to_frame = Mat<6>::Zero();  // from the anchors
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) to_frame.block<2, 2>(2 * k, 2 * j).diagonal().setConstant(coefficients_(k, j));
    Mat<6> block = to_frame.transpose() * by_frame * to_frame;
    project_block(block, psd);
    sink.add<2>(anchors_, block.data());
  }
}

template <int Dim>
double RigidLoad<Dim>::value_at(const Increment& at, Workspace& workspace) const {
  if (moment_ != 0) return value(at.base + at.d, workspace);
  return -scale_ * forces_.cwiseProduct(at_anchors(at.d)).sum();
}

template <int Dim>
void RigidLoad<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const {
  add_gradient(moment_ != 0 ? VectorX(at.base + at.d) : VectorX(at.base), gradient, workspace);
}

template class RigidLoad<2>;
template class RigidLoad<3>;

}  // namespace itr
