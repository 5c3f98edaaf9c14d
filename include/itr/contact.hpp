// SPDX-License-Identifier: MIT
// Contact barrier of IPC (Li et al. 2020) between surface primitives, in both forms of docs/theory.md, "Contact". Pairs are
// a vertex and an edge in 2D, a vertex and a triangle or two edges in 3D. For a program that has
// its own model; a Simulation has it inside.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "itr/energy.hpp"
#include "itr/options.hpp"

namespace itr {

struct CollisionSurface;  // opaque

/// An active pair of primitives, reduced to its closest features. Nearly parallel edges stay edges.
struct ContactStencil {
  PairKind kind = PairKind::vertex_vertex;
  std::array<int, 4> vertices{kNone, kNone, kNone, kNone};
  double weight = 0;  ///< area weights and corrections included; may be negative
  /// For nearly parallel edges: |u x v|^2 below which the pair fades out [m^4], and the features whose distance counts.
  double mollifier_threshold = 0;
  ClosestFeatures closest{};

  int size() const { return pair_size(kind); }
  bool is_mollified() const { return mollifier_threshold > 0; }
};

/// The surface with these primitives (edges of the triangles are added) and codimensional `points`. `rest`: positions of all
/// vertices of the problem [m]; `counts` by vertex: whether pairs with it count, which is false for obstacles.
template <int Dim>
ITR_EXPORT std::shared_ptr<const CollisionSurface> collision_surface(std::vector<std::array<int, 2>> edges,
                                                                     std::vector<std::array<int, 3>> triangles,
                                                                     std::span<const int> points,
                                                                     std::span<const Vec<Dim>> rest,
                                                                     std::vector<char> counts);

/// Law of the pairs: the barrier, or the pull of AdhesionOptions.
enum class ContactLaw { barrier, adhesion };

/// The energy scale * kappa * sum of weight * m * b(D). b(D) = -(D - dhat^2)^2 ln(D / dhat^2) for squared distances D below
/// dhat^2, and m is the mollifier of nearly parallel edges. With ContactLaw::adhesion b is the energy of its pull, dhat its
/// reach and kappa 1.
template <int Dim>
class ITR_EXPORT ContactEnergy final : public Energy {
 public:
  /// `surface` must outlive this object. `scale` is alpha h^2 [s^2]. A workspace serves one surface; another surface needs a
  /// new workspace or a new revision.
  ContactEnergy(const CollisionSurface& surface, const ContactOptions& options, double stiffness, double scale,
                ContactLaw law = ContactLaw::barrier);
  /// Resets this object as if it were constructed anew.
  void renew(const CollisionSurface& surface, const ContactOptions& options, double stiffness, double scale,
             ContactLaw law = ContactLaw::barrier);
  std::string_view name() const override { return "contact"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  /// Largest fraction of dx without impact, by conservative CCD. Positions are feasible if no pair touches. Where dx brings
  /// too many pairs into question at a time, it is walked in parts, and less of it told if these are many.
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override;
  /// Fractions of dx by vertex, from planar bounds of each pair; of its first part where it is walked in
  /// parts.
  bool get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const override;
  /// The pairs that block a step along dx before `fraction` of it; in its first part where it is walked in parts.
  bool find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                     Workspace& workspace) const override;
  /// Finds candidate pairs for a solve that begins at x and is expected to move by dx. One search then serves its start and
  /// its first step. The search is always made, so that its result does not depend on earlier solves.
  void predict_motion(ConstVectorView x, const VectorX& dx, Workspace& workspace) const;
  /// The pair with the earliest time of impact.
  StepLimit step_limit(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const;

  /// Active pairs at x, merged and sorted. Valid until the next call with this workspace.
  const std::vector<ContactStencil>& active(ConstVectorView x, Workspace& workspace) const;
  /// Smallest distance [m] of the pairs nearer than dhat; infinity if there are none.
  double min_distance(ConstVectorView x, Workspace& workspace) const;
  /// Energy of one pair for `scale` 1 [J].
  double pair_energy(const ContactStencil& stencil, ConstVectorView x) const;
  /// Distance of the closest features of a pair.
  PairDistance<Dim> distance(const ContactStencil& stencil, ConstVectorView x) const;
  /// b(D) and its derivatives with respect to D.
  double barrier(double squared_distance) const;
  double barrier_first(double squared_distance) const;
  double barrier_second(double squared_distance) const;
  ContactLaw law() const { return law_; }
  double stiffness() const { return stiffness_; }
  void set_stiffness(double stiffness) { stiffness_ = stiffness; }
  const CollisionSurface& surface() const { return *surface_; }

 private:
  struct Active;
  struct ActiveCache;
  struct HessianBlocks;
  const Active& active_set(ConstVectorView x, Workspace& workspace) const;
  void find_active(ConstVectorView x, Workspace& workspace, Active& active) const;

  const CollisionSurface* surface_;
  double dhat_;
  double passing_ratio_;  ///< of CcdOptions: adaptive stiffness depends on the way to a solution, and so do peers' values
  bool convergent_;
  double stiffness_;
  double scale_;
  ContactLaw law_;
  double peak_, slope_;  ///< of adhesion: squared distance of its largest pull, a2
};

}  // namespace itr
