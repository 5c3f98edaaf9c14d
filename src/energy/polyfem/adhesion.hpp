// SPDX-License-Identifier: MIT
#pragma once

#include "energy/contact/contact.hpp"

namespace itr {

/// Pull between surfaces that are near (docs/theory.md, "Adhesion"). Its pairs reach farther than the barrier's, so their
/// search has a workspace of its own inside of the caller's. Contact sees to it that nothing touches.
template <int Dim>
class AdhesionEnergy final : public Energy {
 public:
  /// `surface` must outlive this.
  AdhesionEnergy(const CollisionSurface& surface, const ContactOptions& options, double scale)
      : pairs_(surface, options, 1, scale, ContactLaw::adhesion) {}
  std::string_view name() const override { return "adhesion"; }
  double value(ConstVectorView x, Workspace& workspace) const override { return pairs_.value(x, inner(workspace)); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override {
    pairs_.add_gradient(x, gradient, inner(workspace));
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override {
    pairs_.add_hessian(x, psd, sink, inner(workspace));
  }
  const ContactEnergy<Dim>& pairs() const { return pairs_; }
  /// The workspace of the pairs.
  static Workspace& inner(Workspace& workspace) { return workspace.get<Inner>().workspace; }

 private:
  struct Inner {
    Workspace workspace;
  };
  ContactEnergy<Dim> pairs_;
};

}  // namespace itr
