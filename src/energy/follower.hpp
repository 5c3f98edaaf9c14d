// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "energy/energy.hpp"
#include "energy/quadratic_blocks.hpp"
#include "itr/energy.hpp"

namespace itr {

/// scale * (-f . d + 1/2 d^T K d) with d = x - lagged x: forces f, linearised at the lagged positions by K = -df/dx.
template <int Dim>
class LinearizedForces final : public Energy {
 public:
  /// `forces` [N] may be shorter than `lagged_x`: there are none on the vertices after.
  LinearizedForces(VectorX forces, VectorX lagged_x, double scale);
  /// Adds the symmetric part of a block of K.
  void add_stiffness(std::span<const int> vertices, const double* block);

  std::string_view name() const override { return "host forces"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;

 private:
  VectorX forces_, lagged_x_;
  QuadraticBlocks<Dim> stiffness_;
  double scale_;
};

/// Makes the energy of the program's forces at x: positions of the mesh's vertices and of others after them.
template <int Dim>
std::shared_ptr<const Energy> lag_follower(const FollowerForces<Dim>& follower, const Mesh<Dim>& mesh, const VectorX& x,
                                           double t, double scale);

}  // namespace itr
