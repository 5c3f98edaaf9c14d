// SPDX-License-Identifier: MIT
#pragma once

#include "core/scratch_vector.hpp"
#include "energy/contact/contact.hpp"
#include "energy/velocity_rule.hpp"

namespace itr {

/// Smoothed Coulomb friction with normal forces, tangents and closest points lagged at the positions where it was made
/// (docs/theory.md, "Friction").
template <int Dim>
class FrictionEnergy final : public Energy {
 public:
  FrictionEnergy() = default;  ///< of no pair
  FrictionEnergy(const ContactEnergy<Dim>& contact, ConstVectorView lagged_x, Workspace& workspace,
                 const ContactOptions& options, const VelocityRule& velocity, double scale);
  /// Makes it what a new one with this `velocity_rate` and `velocity_reference` (see VelocityRule) would be, where nobody
  /// else goes on with it.
  void renew(const ContactEnergy<Dim>& contact, ConstVectorView lagged_x, Workspace& workspace,
             const ContactOptions& options, double velocity_rate, ConstVectorView velocity_reference, double scale);
  std::string_view name() const override { return "friction"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  bool empty() const { return pairs_.empty(); }

 private:
  static constexpr int kTangents = Dim - 1;
  struct Pair {
    std::array<int, 4> vertices;
    int size;
    Vec<4> coefficients;  ///< relative velocity = sum of coefficient * vertex velocity
    Eigen::Matrix<double, Dim, kTangents> tangents;
    double force;  ///< mu * normal force * weight [N]
  };
  Vec<kTangents> slip_velocity(const Pair& pair, ConstVectorView x) const;

  std::vector<Pair> pairs_;
  double rate_ = 1;  ///< and the reference of VelocityRule
  ScratchVector reference_;
  double epsv_ = 0;
  double scale_ = 1;
};

}  // namespace itr
