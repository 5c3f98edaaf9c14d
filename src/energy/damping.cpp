// SPDX-License-Identifier: MIT
#include "itr/energy/damping.hpp"

#include <algorithm>

#include "itr/core/check.hpp"

namespace itr {

template <int Dim>
DampingEnergy<Dim>::DampingEnergy(const Energy& damped, ConstVectorView lagged_x, double coefficient, VelocityRule velocity,
                                  Workspace& workspace)
    : coefficient_(coefficient), velocity_(std::move(velocity)) {
  HessianSink sink([this](std::span<const int> vertices, const double* values) {
    Block block{{}, static_cast<int>(vertices.size()), values_.size()};
    ITR_CHECK(vertices.size() <= block.vertices.size(), vertices.size());
    std::copy(vertices.begin(), vertices.end(), block.vertices.begin());
    blocks_.push_back(block);
    values_.insert(values_.end(), values, values + Dim * Dim * vertices.size() * vertices.size());
  });
  damped.add_hessian(lagged_x, PsdProjection::clamp, sink, workspace);
}

template <int Dim>
template <typename F>
void DampingEnergy<Dim>::for_each(ConstVectorView x, F&& f) const {
  VectorX v;
  for (const Block& block : blocks_) {
    const int n = Dim * block.size;
    v.resize(n);
    for (int k = 0; k < block.size; ++k) {
      const int dof = Dim * block.vertices[k];
      v.segment<Dim>(Dim * k) = velocity_.rate * (x.segment<Dim>(dof) - velocity_.reference.template segment<Dim>(dof));
    }
    f(block, Eigen::Map<const MatrixX>(values_.data() + block.first, n, n), v);
  }
}

template <int Dim>
double DampingEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = 0;
  VectorX force;
  for_each(x, [&](const auto&, const auto& K, const VectorX& v) {
    force.noalias() = K * v;
    sum += v.dot(force);
  });
  return 0.5 * coefficient_ / velocity_.rate * sum;
}

template <int Dim>
void DampingEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  VectorX force;
  for_each(x, [&](const auto& block, const auto& K, const VectorX& v) {
    force.noalias() = coefficient_ * (K * v);
    for (int k = 0; k < block.size; ++k) gradient.segment<Dim>(Dim * block.vertices[k]) += force.segment<Dim>(Dim * k);
  });
}

template <int Dim>
void DampingEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  MatrixX scaled;
  for (const Block& block : blocks_) {
    const int n = Dim * block.size;
    scaled = coefficient_ * velocity_.rate * Eigen::Map<const MatrixX>(values_.data() + block.first, n, n);
    sink.add<Dim>(vertices(block), scaled.data());
  }
}

template class DampingEnergy<2>;
template class DampingEnergy<3>;

}  // namespace itr
