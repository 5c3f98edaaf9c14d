// SPDX-License-Identifier: MIT
#pragma once

#include <memory>

#include "energy/energy.hpp"
#include "fem/vertex_map.hpp"

namespace itr {

/// E(y(x)) for a term E over vertices y that follow linearly from those of the problem: gradient A^T g, Hessian A^T H A.
/// Along a straight way of x also y goes straight, so that what bounds a step of y bounds that of x.
template <int Dim>
class MappedEnergy final : public Energy {
 public:
  MappedEnergy(std::shared_ptr<const Energy> energy, std::shared_ptr<const VertexMap<Dim>> map)
      : energy_(std::move(energy)), map_(std::move(map)) {}
  std::string_view name() const override { return energy_->name(); }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override;

 private:
  std::shared_ptr<const Energy> energy_;
  std::shared_ptr<const VertexMap<Dim>> map_;
};

}  // namespace itr
