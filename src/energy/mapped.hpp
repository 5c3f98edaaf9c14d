// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>

#include "energy/blocking.hpp"
#include "energy/energy.hpp"
#include "fem/vertex_map.hpp"

namespace itr {

/// E(y(x)) for a term E over vertices y that follow linearly from those of the problem: gradient A^T g, Hessian A^T H A.
/// Along a straight way of x also y goes straight, so that what bounds a step of y bounds that of x.
template <int Dim>
class MappedEnergy : public Energy {
 public:
  MappedEnergy(std::shared_ptr<const Energy> energy, std::shared_ptr<const VertexMap<Dim>> map)
      : energy_(std::move(energy)), map_(std::move(map)) {}
  std::string_view name() const override { return energy_->name(); }
  double value(ConstVectorView x, Workspace& workspace) const override {
    return energy_->value(map_->positions(x), workspace);
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override {
    const VectorX y = map_->positions(x);
    VectorX gradient_in_y = VectorX::Zero(y.size());
    energy_->add_gradient(y, gradient_in_y, workspace);
    map_->add_gradient(gradient_in_y, gradient);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override {
    std::vector<int> sources;
    MatrixX A, HA, product;  // A of one stencil: from the dofs of its sources to its own
    HessianSink mapped([&](std::span<const int> vertices, const double* block) {
      sources.clear();
      for (const int v : vertices) sources.insert(sources.end(), map_->sources(v).begin(), map_->sources(v).end());
      std::sort(sources.begin(), sources.end());
      sources.erase(std::unique(sources.begin(), sources.end()), sources.end());
      const auto rows = Dim * static_cast<Eigen::Index>(vertices.size());
      A.setZero(rows, Dim * static_cast<Eigen::Index>(sources.size()));
      for (std::size_t i = 0; i < vertices.size(); ++i)
        for (std::size_t k = 0; k < map_->sources(vertices[i]).size(); ++k) {
          const auto j = std::lower_bound(sources.begin(), sources.end(), map_->sources(vertices[i])[k]) - sources.begin();
          A.block<Dim, Dim>(Dim * static_cast<Eigen::Index>(i), Dim * j)
              .diagonal()
              .setConstant(map_->weights(vertices[i])[k]);
        }
      HA.noalias() = Eigen::Map<const MatrixX>(block, rows, rows) * A;
      product.noalias() = A.transpose() * HA;
      sink.add<Dim>(sources, product.data());
    });
    energy_->add_hessian(map_->positions(x), psd, mapped, workspace);
  }
  void add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes,
                              Workspace& workspace) const override {
    const VectorX y = map_->positions(x);
    VectorX gradient_in_y = VectorX::Zero(y.size()), sizes_in_y = gradient_in_y;
    energy_->add_gradient_and_sizes(y, gradient_in_y, sizes_in_y, workspace);
    map_->add_gradient(gradient_in_y, gradient);
    add_sizes(sizes_in_y, sizes);
  }
  double value_round_off(ConstVectorView x, Workspace& workspace) const override {
    return energy_->value_round_off(map_->positions(x), workspace);
  }
  void add_gradient_round_off(ConstVectorView x, VectorView round_off, Workspace& workspace) const override {
    const VectorX y = map_->positions(x);
    VectorX in_y = VectorX::Zero(y.size());
    energy_->add_gradient_round_off(y, in_y, workspace);
    add_sizes(in_y, round_off);
  }
  void add_rank_ones(ConstVectorView x, std::vector<RankOne>& parts) const override {
    std::vector<RankOne> in_y;
    energy_->add_rank_ones(map_->positions(x), in_y);
    for (const RankOne& part : in_y) {
      parts.push_back({VectorX::Zero(x.size()), part.factor});
      map_->add_gradient(part.vector, parts.back().vector);
    }
  }
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override {
    return energy_->max_step(map_->positions(x), map_->motion(dx), workspace);
  }
  bool find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                     Workspace& workspace) const override {
    if (!energy_->find_blocking(map_->positions(x), map_->motion(dx), fraction, blocking, workspace)) return false;
    for (BlockingPairs::Bound& bound : blocking.bounds) {
      BlockingPairs::Bound mapped;
      mapped.missing = bound.missing;
      for (std::size_t i = 0; i < bound.dofs.size(); ++i) {
        const int vertex = bound.dofs[i] / Dim, component = bound.dofs[i] % Dim;
        for (std::size_t k = 0; k < map_->sources(vertex).size(); ++k) {
          mapped.dofs.push_back(Dim * map_->sources(vertex)[k] + component);
          mapped.coefficients.push_back(map_->weights(vertex)[k] * bound.coefficients[i]);
        }
      }
      bound = std::move(mapped);
    }
    return true;
  }

 private:
  /// Adds to the sizes of forces on x those of forces on y.
  void add_sizes(const VectorX& sizes, VectorView result) const {
    for (int i = 0; Dim * i < sizes.size(); ++i)
      for (std::size_t k = 0; k < map_->sources(i).size(); ++k)
        result.segment<Dim>(Dim * map_->sources(i)[k]) +=
            std::abs(map_->weights(i)[k]) * sizes.template segment<Dim>(Dim * i);
  }

  std::shared_ptr<const Energy> energy_;
  std::shared_ptr<const VertexMap<Dim>> map_;
};

}  // namespace itr
