// SPDX-License-Identifier: MIT
#include "itr/fem/vertex_map.hpp"

#include <utility>

#include "itr/core/check.hpp"

namespace itr {

template <int Dim>
VertexMap<Dim>::VertexMap(const Weights& weights, VectorX offset) : weights_(weights), offset_(std::move(offset)) {
  ITR_CHECK(offset_.size() == Dim * weights_.rows(), offset_.size(), weights_.rows());
  weights_.prune([](Eigen::Index, Eigen::Index, double weight) { return weight != 0; });
  weights_.makeCompressed();
}

template <int Dim>
VectorX VertexMap<Dim>::positions(ConstVectorView x) const {
  return offset_ + motion(x);
}

template <int Dim>
VectorX VertexMap<Dim>::motion(ConstVectorView dx) const {
  VectorX dy = VectorX::Zero(offset_.size());
  for (int i = 0; i < weights_.rows(); ++i)
    for (std::size_t k = 0; k < count(i); ++k) vertex_of<Dim>(dy, i) += weights(i)[k] * vertex_of<Dim>(dx, sources(i)[k]);
  return dy;
}

template <int Dim>
void VertexMap<Dim>::add_gradient(ConstVectorView gradient, VectorView result) const {
  for (int i = 0; i < weights_.rows(); ++i)
    for (std::size_t k = 0; k < count(i); ++k)
      vertex_of<Dim>(result, sources(i)[k]) += weights(i)[k] * vertex_of<Dim>(gradient, i);
}

template class VertexMap<2>;
template class VertexMap<3>;

}  // namespace itr
