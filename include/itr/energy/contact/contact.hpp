// SPDX-License-Identifier: MIT
// Contact barrier of IPC (Li et al. 2020) between surface primitives, in both forms of CONVENTIONS.md, "Contact": vertices
// and edges in 2D, vertices and triangles, edges and edges in 3D.
#pragma once

#include "itr/energy/contact/options.hpp"
#include "itr/energy/contact/surface.hpp"
#include "itr/energy/energy.hpp"
#include "itr/energy/step_limit.hpp"
#include "itr/geometry/distance.hpp"

namespace itr {

/// One active pair of features, reduced to those that are closest (except for nearly parallel edges, which stay edges).
struct ContactStencil {
  PairKind kind = PairKind::vertex_vertex;
  std::array<int, 4> vertices{kNone, kNone, kNone, kNone};
  double weight = 0;  ///< area weights and corrections included; may be negative
  /// Nearly parallel edges only: |u x v|^2 below which the pair fades out [m^4], and the features whose distance counts.
  double mollifier_threshold = 0;
  ClosestFeatures closest{};

  int size() const { return pair_size(kind); }
  bool is_mollified() const { return mollifier_threshold > 0; }
};

/// scale * kappa * sum of weight * m * b(D), b(D) = -(D - dhat^2)^2 ln(D / dhat^2) of the squared distance D below dhat^2, m
/// the mollifier of nearly parallel edges.
template <int Dim>
class ContactEnergy final : public Energy {
 public:
  /// `surface` must outlive this. `scale` is alpha h^2. A workspace serves one surface: another one in its place needs a new
  /// workspace, or another revision.
  ContactEnergy(const CollisionSurface& surface, const ContactOptions& options, double stiffness, double scale);
  /// Makes it what a new one would be.
  void renew(const CollisionSurface& surface, const ContactOptions& options, double stiffness, double scale);
  std::string_view name() const override { return "contact"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  /// Time of impact by conservative CCD; feasible: no pair touches.
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override;
  /// By planar bounds of each pair (`planar_shares`).
  bool get_single_ways(ConstVectorView x, ConstVectorView dx, VectorView ways, Workspace& workspace) const override;
  bool find_blocking(ConstVectorView x, ConstVectorView dx, double share, BlockingPairs& blocking,
                     Workspace& workspace) const override;
  /// Looks for pairs where a solve that begins at x is expected to go by dx, so that one search serves its start and its
  /// first step. It always looks: what is found then does not depend on earlier solves.
  void foresee(ConstVectorView x, const VectorX& dx, Workspace& workspace) const;
  /// The pair with the earliest time of impact.
  StepLimit step_limit(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const;

  /// Active pairs at x, merged and sorted. Valid until the next call with this workspace.
  const std::vector<ContactStencil>& active(ConstVectorView x, Workspace& workspace) const;
  /// Smallest distance [m] over counted pairs nearer than dhat; infinity where there are none.
  double min_distance(ConstVectorView x, Workspace& workspace) const;
  /// What a pair adds to the energy of `scale` 1 [J].
  double pair_energy(const ContactStencil& stencil, ConstVectorView x) const;
  /// Distance of the pair's closest features.
  PairDistance<Dim> distance(const ContactStencil& stencil, ConstVectorView x) const;
  /// b(D) and its derivatives with respect to D.
  double barrier(double squared_distance) const;
  double barrier_first(double squared_distance) const;
  double barrier_second(double squared_distance) const;
  double stiffness() const { return stiffness_; }
  void set_stiffness(double stiffness) { stiffness_ = stiffness; }

 private:
  struct Active {
    std::vector<ContactStencil> stencils;
    double least_squared = 0;  ///< distance over counted pairs nearer than dhat; infinity where there are none
  };
  struct ActiveCache;
  struct HessianBlocks;
  const Active& active_set(ConstVectorView x, Workspace& workspace) const;
  void find_active(ConstVectorView x, Workspace& workspace, Active& active) const;

  const CollisionSurface* surface_;
  double dhat_;
  bool convergent_;
  double stiffness_;
  double scale_;
};

}  // namespace itr
