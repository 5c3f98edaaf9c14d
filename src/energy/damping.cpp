// SPDX-License-Identifier: MIT
#include "energy/damping.hpp"

namespace itr {

template <int Dim>
DampingEnergy<Dim>::DampingEnergy(const Energy& damped, ConstVectorView lagged_x, double coefficient, VelocityRule velocity,
                                  Workspace& workspace)
    : coefficient_(coefficient), velocity_(std::move(velocity)) {
  HessianSink sink([this](std::span<const int> vertices, const double* block) { damped_.add(vertices, block); });
  damped.add_hessian(lagged_x, PsdProjection::clamp, sink, workspace);
}

namespace {

/// Calls f(vertices, K, d) for each block, with displacements d from `origin` less their mean, which K takes no notice of:
/// its round-off would not be the opposite at the other vertices. Forces lose their mean for the same reason.
template <int Dim, typename F>
void for_each_motion(const QuadraticBlocks<Dim>& blocks, ConstVectorView x, const VectorX& origin, const F& f) {
  Eigen::Matrix<double, Dim, Eigen::Dynamic> d;
  blocks.for_each([&](std::span<const int> vertices, const auto& K) {
    d.resize(Dim, static_cast<Eigen::Index>(vertices.size()));
    for (std::size_t k = 0; k < vertices.size(); ++k)
      d.col(static_cast<Eigen::Index>(k)) =
          x.segment<Dim>(Dim * vertices[k]) - origin.template segment<Dim>(Dim * vertices[k]);
    const Vec<Dim> mean = d.rowwise().mean();
    d.colwise() -= mean;
    f(vertices, K, d.reshaped());
  });
}

template <int Dim>
double work(const QuadraticBlocks<Dim>& blocks, ConstVectorView x, const VectorX& origin) {
  double sum = 0;
  VectorX force;
  for_each_motion<Dim>(blocks, x, origin, [&](auto, const auto& K, const auto& d) {
    force.noalias() = K * d;
    sum += d.dot(force);
  });
  return sum / 2;
}

template <int Dim>
void add_forces(const QuadraticBlocks<Dim>& blocks, ConstVectorView x, const VectorX& origin, double scale,
                VectorView gradient) {
  VectorX force;
  for_each_motion<Dim>(blocks, x, origin, [&](std::span<const int> vertices, const auto& K, const auto& d) {
    force.noalias() = scale * (K * d);
    auto by_vertex = force.template reshaped<Eigen::ColMajor>(Dim, static_cast<Eigen::Index>(vertices.size()));
    const Vec<Dim> mean = by_vertex.rowwise().mean();
    by_vertex.colwise() -= mean;
    for (std::size_t k = 0; k < vertices.size(); ++k)
      gradient.segment<Dim>(Dim * vertices[k]) += force.segment<Dim>(Dim * static_cast<Eigen::Index>(k));
  });
}

}  // namespace

// v = rate (x - reference), so that v^T K v / rate has the square of the distance times the rate.
template <int Dim>
double DampingEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  return coefficient_ * velocity_.rate * work(damped_, x, velocity_.reference);
}

template <int Dim>
void DampingEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  add_forces(damped_, x, velocity_.reference, coefficient_ * velocity_.rate, gradient);
}

template <int Dim>
double DampingEnergy<Dim>::value_at(const Increment& at, Workspace&) const {
  return coefficient_ * velocity_.rate * work(damped_, at.d, velocity_.reference - at.base);
}

template <int Dim>
void DampingEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const {
  add_forces(damped_, at.d, velocity_.reference - at.base, coefficient_ * velocity_.rate, gradient);
}

template <int Dim>
void DampingEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  MatrixX scaled;
  damped_.for_each([&](std::span<const int> vertices, const auto& K) {
    scaled = coefficient_ * velocity_.rate * K;
    sink.add<Dim>(vertices, scaled.data());
  });
}

template class DampingEnergy<2>;
template class DampingEnergy<3>;

}  // namespace itr
