// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include "itr/types.hpp"

namespace itr {

/// A quadratic form in displacements d = x - origin, kept as the symmetric blocks of its stencils: 1/2 d^T K d.
template <int Dim>
class QuadraticBlocks {
 public:
  /// Adds a symmetric block (column-major, side Dim * vertices.size()).
  void add(std::span<const int> vertices, const double* block) {
    const std::size_t side = Dim * vertices.size();
    blocks_.push_back({vertices_.size(), vertices.size(), values_.size()});
    vertices_.insert(vertices_.end(), vertices.begin(), vertices.end());
    values_.insert(values_.end(), block, block + side * side);
  }

  double value(ConstVectorView x, const VectorX& origin) const {
    double sum = 0;
    VectorX force;
    for_each_displacement(x, origin, [&](auto, const auto& K, const VectorX& d) {
      force.noalias() = K * d;
      sum += d.dot(force);
    });
    return sum / 2;
  }

  /// gradient += scale K d
  void add_gradient(ConstVectorView x, const VectorX& origin, double scale, VectorView gradient) const {
    VectorX force;
    for_each_displacement(x, origin, [&](std::span<const int> vertices, const auto& K, const VectorX& d) {
      force.noalias() = scale * (K * d);
      for (std::size_t k = 0; k < vertices.size(); ++k)
        gradient.segment<Dim>(Dim * vertices[k]) += force.segment<Dim>(Dim * static_cast<Eigen::Index>(k));
    });
  }

  /// f(vertices, block) for each.
  template <typename F>
  void for_each(F&& f) const {
    for (const Block& block : blocks_) {
      const auto side = static_cast<Eigen::Index>(Dim * block.size);
      f(std::span(vertices_).subspan(block.first_vertex, block.size),
        Eigen::Map<const MatrixX>(values_.data() + block.first_value, side, side));
    }
  }

 private:
  struct Block {
    std::size_t first_vertex, size, first_value;
  };

  template <typename F>
  void for_each_displacement(ConstVectorView x, const VectorX& origin, F&& f) const {
    VectorX d;
    for_each([&](std::span<const int> vertices, const auto& K) {
      d.resize(K.rows());
      for (std::size_t k = 0; k < vertices.size(); ++k) {
        const int dof = Dim * vertices[k];
        d.segment<Dim>(Dim * static_cast<Eigen::Index>(k)) = x.segment<Dim>(dof) - origin.segment<Dim>(dof);
      }
      f(vertices, K, d);
    });
  }

  std::vector<Block> blocks_;
  std::vector<int> vertices_;
  std::vector<double> values_;
};

}  // namespace itr
