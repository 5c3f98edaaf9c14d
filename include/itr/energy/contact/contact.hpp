// SPDX-License-Identifier: MIT
// Contact barrier of IPC between vertices and edges, in both forms of scene-format §6.3 and §6.4.
#pragma once

#include "itr/energy/contact/options.hpp"
#include "itr/energy/contact/surface.hpp"
#include "itr/energy/energy.hpp"
#include "itr/geometry/bvh.hpp"

namespace itr {

/// One active pair: vertex-vertex (b2 = kNone) or vertex-edge. Distances are to the closest feature.
struct ContactStencil {
  int a = kNone;               ///< vertex
  int b1 = kNone, b2 = kNone;  ///< the other vertex, or the edge, b1 < b2
  double weight = 0;           ///< area weights and corrections included; may be negative
  int size() const { return b2 == kNone ? 2 : 3; }
  std::array<int, 3> vertices() const { return {a, b1, b2}; }
};

/// Vertex-edge pairs that can come within reach while every vertex stays in its box: valid for many evaluations. A
/// workspace serves one surface: a new or changed surface needs a new workspace.
template <int Dim>
struct ContactCandidates {
  const CollisionSurface* surface = nullptr;
  std::vector<Box<Dim>> boxes;            ///< one a surface vertex
  std::vector<std::array<int, 3>> pairs;  ///< vertex, edge ends
};

/// scale * kappa * sum of weight * b(D), b(D) = -(D - dhat^2)^2 ln(D / dhat^2) of the squared distance D below dhat^2.
template <int Dim>
class ContactEnergy final : public Energy {
 public:
  /// `surface` must outlive this. `scale` is alpha h^2.
  ContactEnergy(const CollisionSurface& surface, const ContactOptions& options, double stiffness, double scale);
  std::string_view name() const override { return "contact"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  /// Time of impact by conservative CCD; feasible: no pair touches.
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override;

  /// Active pairs at x, merged and sorted.
  std::vector<ContactStencil> active(ConstVectorView x, Workspace& workspace) const;
  /// Smallest distance [m] over counted pairs nearer than the candidates reach; infinity where there are none.
  double min_distance(ConstVectorView x, Workspace& workspace) const;
  /// Whether any counted pair is near enough to x to be looked at.
  bool has_candidates(ConstVectorView x, Workspace& workspace) const { return !candidates(x, nullptr, workspace).empty(); }
  double squared_distance(const ContactStencil& stencil, ConstVectorView x) const;
  /// b(D) and its derivatives with respect to D.
  double barrier(double squared_distance) const;
  double barrier_first(double squared_distance) const;
  double barrier_second(double squared_distance) const;
  double stiffness() const { return stiffness_; }
  /// Factor on weights: 1 / dhat^3 in the convergent form.
  double weight_scale() const { return weight_scale_; }

 private:
  const std::vector<std::array<int, 3>>& candidates(ConstVectorView x, const VectorX* dx, Workspace& workspace) const;
  bool counts(int v, int e0, int e1) const { return surface_.counts[v] || surface_.counts[e0] || surface_.counts[e1]; }

  const CollisionSurface& surface_;
  double dhat_;
  bool convergent_;
  double stiffness_;
  double scale_;
  double weight_scale_;
};

}  // namespace itr
