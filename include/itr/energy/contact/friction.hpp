// SPDX-License-Identifier: MIT
#pragma once

#include "itr/energy/contact/contact.hpp"
#include "itr/energy/velocity_rule.hpp"

namespace itr {

/// Smoothed Coulomb friction with normal forces, tangents and closest points lagged at the positions where it was made
/// (CONVENTIONS.md, "Friction"). A new lag is a new object.
template <int Dim>
class FrictionEnergy final : public Energy {
 public:
  FrictionEnergy(const ContactEnergy<Dim>& contact, ConstVectorView lagged_x, Workspace& workspace,
                 const ContactOptions& options, VelocityRule velocity, double scale);
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
  VelocityRule velocity_;
  double epsv_;
  double scale_;
};

}  // namespace itr
