// SPDX-License-Identifier: MIT
#pragma once

#include "energy/contact/friction.hpp"

namespace itr {

/// Adhesion against sliding in PolyFEM's way, which leaves its Hessian out where nothing has moved. So the first step from
/// rest takes a body past the slip that would be held: of two solutions, one that sticks and one that slides, PolyFEM finds
/// the second.
template <int Dim>
class AdhesiveFriction final : public Energy {
 public:
  /// `at_rest`: positions of no velocity [m].
  AdhesiveFriction(FrictionEnergy<Dim> friction, VectorX at_rest)
      : friction_(std::move(friction)), at_rest_(std::move(at_rest)) {}
  std::string_view name() const override { return friction_.name(); }
  double value(ConstVectorView x, Workspace& workspace) const override { return friction_.value(x, workspace); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override {
    friction_.add_gradient(x, gradient, workspace);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override {
    if (x != at_rest_) friction_.add_hessian(x, psd, sink, workspace);
  }

 private:
  FrictionEnergy<Dim> friction_;
  VectorX at_rest_;
};

}  // namespace itr
