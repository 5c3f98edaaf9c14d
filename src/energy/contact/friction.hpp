// SPDX-License-Identifier: MIT
#pragma once

#include "core/scratch_vector.hpp"
#include "energy/contact/averaged_contact.hpp"
#include "energy/contact/contact.hpp"
#include "energy/velocity_rule.hpp"

namespace itr {

/// Which sides of friction pairs a node of the mesh is of, by the boundary facets there, or a vertex of obstacles: bit 2 i
/// for side a of pair i, bit 2 i + 1 for its side b.
template <int Dim>
std::uint64_t friction_sides_of_node(const Mesh<Dim>& mesh, VertexId node, const std::vector<FrictionPair>& pairs);
std::uint64_t friction_sides_of_obstacle(int vertex, const std::vector<FrictionPair>& pairs);

/// Friction by slip speed y, of the most that a pair resists. Smoothed below eps, where f1 is a quadratic polynomial; from
/// there on it goes from 1 to `kinetic` by a cubic one. That of adhesion lets go: its polynomial goes on to 0 at 2 eps.
struct SlipLaw {
  static constexpr double kSlides = 3;  ///< by eps: the speed from which on friction is kinetic
  double eps, kinetic;
  bool lets_go;
  double potential(double y) const;   ///< f0
  double by_speed(double y) const;    ///< f1 by y
  double derivative(double y) const;  ///< of f1

 private:
  double on_fall(double y) const;
};

/// Smoothed Coulomb friction with normal forces, tangents and closest points lagged at the positions where it was made
/// (docs/theory.md, "Friction"). Of a contact energy of ContactLaw::adhesion: what holds against sliding, of its largest
/// pull.
template <int Dim>
class FrictionEnergy final : public Energy {
 public:
  FrictionEnergy() = default;  ///< of no pair
  FrictionEnergy(const ContactEnergy<Dim>& contact, ConstVectorView lagged_x, Workspace& workspace,
                 const ContactOptions& options, const VelocityRule& velocity, double scale);
  /// Makes it what a new one with this `velocity_rate` and `velocity_reference` (see VelocityRule) would be, where nobody
  /// else goes on with it. `slips_from_touch`: of pairs that are farther than dhat at the reference, their approach along
  /// the normal there is no slip; tangents where they are lagged may be tilted against it.
  void renew(const ContactEnergy<Dim>& contact, ConstVectorView lagged_x, Workspace& workspace,
             const ContactOptions& options, double velocity_rate, ConstVectorView velocity_reference, double scale,
             bool slips_from_touch = false);
  std::string_view name() const override { return "friction"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  /// Adds friction of points that averaged gaps press, of this coefficient.
  void add(const std::vector<AveragedContact::PressedPoint>& points, double coefficient);
  bool empty() const { return pairs_.empty(); }
  /// Number of pairs that stuck while vertices moved with `v` [m/s], and slide at x, with less friction.
  int count_let_go(ConstVectorView v, ConstVectorView x) const;

  /// Begins a solve at x by the primal-dual Newton method (docs/theory.md, "Friction"): Hessians from here on are those of
  /// the law of friction linearised in slip and force, so that few iterations find what sticks, however small eps_v is.
  /// `is_near`: forces at x are nearly those of the solution; else nothing is known of them.
  void begin_solve(ConstVectorView x, bool is_near);
  /// Follows that solve to x, which is `fraction` of a Newton step away.
  void follow(ConstVectorView x, double fraction);
  /// Moves the normal forces from those of `before` by `factor` times the way to its own: less or more than that.
  void relax(const FrictionEnergy& before, double factor);

 private:
  static constexpr int kTangents = Dim - 1;
  static constexpr int kMost = Dim == 2 ? AveragedContact::PressedPoint::kMost : 4;  ///< vertices of a pair
  static constexpr double kLeastPart = 0.01;
  struct Pair {
    std::array<int, kMost> vertices;
    int size;
    Vec<kMost> coefficients;  ///< relative velocity = sum of coefficient * vertex velocity
    /// Each times its coefficient's part of the larger one, where there are two; so are slip velocities.
    Eigen::Matrix<double, Dim, kTangents> tangents;
    double force;                          ///< mu_s * normal force * weight [N], of the larger mu_s
    double kinetic = 1;                    ///< mu_k by mu_s
    double least = 1;                      ///< the smaller coefficient by the larger one, at least kLeastPart
    Vec<Dim> approach = Vec<Dim>::Zero();  ///< relative motion that is no slip [m]
    /// Slip velocity at the iterate [m/s], and friction by the most that it can be: as linearised, the second unknown.
    Vec<kTangents> slip = Vec<kTangents>::Zero(), ratio = Vec<kTangents>::Zero();
  };
  Vec<Dim> approach_of(const Pair& pair, const Vec<Dim>& normal, double dhat) const;
  Vec<kTangents> slip_velocity(const Pair& pair, ConstVectorView x) const;
  void set_directions(Pair& pair, const Vec<3>& direction, const Vec<3>& normal, const FrictionPair& by_direction) const;
  /// No direction of slip sticks up to more than eps_v.
  SlipLaw law_of(const Pair& pair) const { return {pair.least * epsv_, pair.kinetic, lets_go_}; }

  std::vector<Pair> pairs_;
  double rate_ = 1;  ///< and the reference of VelocityRule
  ScratchVector reference_;
  double epsv_ = 0;
  bool is_primal_dual_ = false;
  bool lets_go_ = false;  ///< of adhesion
  double scale_ = 1;
};

}  // namespace itr
