// SPDX-License-Identifier: MIT
#include "itr/energy/damping.hpp"

namespace itr {

template <int Dim>
DampingEnergy<Dim>::DampingEnergy(const Energy& damped, ConstVectorView lagged_x, double coefficient, VelocityRule velocity,
                                  Workspace& workspace)
    : coefficient_(coefficient), velocity_(std::move(velocity)) {
  HessianSink sink([this](std::span<const int> vertices, const double* block) { damped_.add(vertices, block); });
  damped.add_hessian(lagged_x, PsdProjection::clamp, sink, workspace);
}

// v = rate (x - reference), so that v^T K v / rate has the square of the distance times the rate.
template <int Dim>
double DampingEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  return coefficient_ * velocity_.rate * damped_.value(x, velocity_.reference);
}

template <int Dim>
void DampingEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  damped_.add_gradient(x, velocity_.reference, coefficient_ * velocity_.rate, gradient);
}

template <int Dim>
double DampingEnergy<Dim>::value_at(const Increment& at, Workspace&) const {
  return coefficient_ * velocity_.rate * damped_.value(at.d, velocity_.reference - at.base);
}

template <int Dim>
void DampingEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const {
  damped_.add_gradient(at.d, velocity_.reference - at.base, coefficient_ * velocity_.rate, gradient);
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
