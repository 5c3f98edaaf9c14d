// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include "energy/energy.hpp"
#include "energy/increment.hpp"

namespace itr {

/// Minus the work, times `scale`, of a force and a couple on a rigid body, whose frame (a point and Dim vectors) is a linear
/// function of some of its vertices. The couple does the work of its moment by the turn of the frame since the lagged
/// positions: in 2D exactly, in 3D to first order in that turn.
template <int Dim>
class RigidLoad final : public Energy, public IncrementalTerm {
 public:
  using Frame = Eigen::Matrix<double, Dim, Dim + 1>;
  using Anchors = std::array<int, Dim + 1>;

  /// The frame is `coefficients` times the positions of the vertices `anchors`. `force` acts on its point [N], `moment`
  /// about z in 2D [N m].
  RigidLoad(const Anchors& anchors, const Mat<Dim + 1>& coefficients, const Vec<Dim>& force, const Vec<3>& moment,
            ConstVectorView lagged_x, double scale);

  std::string_view name() const override { return "rigid loads"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const override;

 private:
  Frame at_anchors(ConstVectorView field) const;
  double turn(const Frame& frame) const;

  Anchors anchors_;
  Mat<Dim + 1> coefficients_;
  Frame forces_;        ///< on the anchors, that stay as they are
  double moment_ = 0;   ///< in 2D
  double lagged_turn_;  ///< of the frame in 2D
  Frame lagged_;        ///< anchors
  double scale_;
};

}  // namespace itr
