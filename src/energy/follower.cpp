// SPDX-License-Identifier: MIT
#include "energy/follower.hpp"

#include "project_block.hpp"

namespace itr {

template <int Dim>
LinearizedForces<Dim>::LinearizedForces(VectorX forces, VectorX lagged_x, double scale)
    : forces_(std::move(forces)), lagged_x_(std::move(lagged_x)), scale_(scale) {
  const Eigen::Index given = forces_.size();
  forces_.conservativeResize(lagged_x_.size());
  forces_.tail(lagged_x_.size() - given).setZero();
}

template <int Dim>
void LinearizedForces<Dim>::add_stiffness(std::span<const int> vertices, const double* block) {
  const auto size = Dim * static_cast<Eigen::Index>(vertices.size());
  const Eigen::Map<const MatrixX> K(block, size, size);
  const MatrixX symmetric = 0.5 * (K + K.transpose());
  stiffness_.add(vertices, symmetric.data());
}

template <int Dim>
double LinearizedForces<Dim>::value(ConstVectorView x, Workspace&) const {
  return scale_ * (stiffness_.value(x, lagged_x_) - forces_.dot(x - lagged_x_));
}

template <int Dim>
void LinearizedForces<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  gradient -= scale_ * forces_;
  stiffness_.add_gradient(x, lagged_x_, scale_, gradient);
}

template <int Dim>
void LinearizedForces<Dim>::add_hessian(ConstVectorView, PsdProjection psd, HessianSink& sink, Workspace&) const {
  stiffness_.for_each([&](std::span<const int> vertices, const auto& K) {
    MatrixX H = scale_ * K;
    project_block(H, psd);
    sink.add<Dim>(vertices, H.data());
  });
}

template <int Dim>
std::shared_ptr<const Energy> lag_follower(const FollowerForces<Dim>& follower, const Mesh<Dim>& mesh, const VectorX& x,
                                           double t, double scale) {
  const Eigen::Index bodies = Dim * mesh.num_nodes();
  VectorX forces = VectorX::Zero(bodies);
  follower.forces(mesh, x.head(bodies), t, forces);
  auto energy = std::make_shared<LinearizedForces<Dim>>(std::move(forces), x, scale);
  if (follower.stiffness)
    follower.stiffness(mesh, x.head(bodies), t,
                       [&](std::span<const int> vertices, const double* block) { energy->add_stiffness(vertices, block); });
  return energy;
}

#define ITR_INSTANTIATE(Dim)                                                                                             \
  template class LinearizedForces<Dim>;                                                                                  \
  template std::shared_ptr<const Energy> lag_follower<Dim>(const FollowerForces<Dim>&, const Mesh<Dim>&, const VectorX&, \
                                                           double, double);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
