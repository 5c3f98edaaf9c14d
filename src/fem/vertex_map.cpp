// SPDX-License-Identifier: MIT
#include "fem/vertex_map.hpp"

#include <utility>

#include "core/check.hpp"

namespace itr {

namespace {

/// A vector over dofs as a matrix with a row for each vertex.
template <int Dim>
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Dim, Eigen::RowMajor>;
template <int Dim>
Eigen::Map<const Rows<Dim>> rows_of(ConstVectorView field) {
  return {field.data(), field.size() / Dim, Dim};
}

}  // namespace

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
  VectorX dy(offset_.size());
  Eigen::Map<Rows<Dim>>(dy.data(), weights_.rows(), Dim) = weights_ * rows_of<Dim>(dx);
  return dy;
}

template <int Dim>
void VertexMap<Dim>::add_gradient(ConstVectorView gradient, VectorView result) const {
  Eigen::Map<Rows<Dim>>(result.data(), weights_.cols(), Dim) += weights_.transpose() * rows_of<Dim>(gradient);
}

template class VertexMap<2>;
template class VertexMap<3>;

}  // namespace itr
