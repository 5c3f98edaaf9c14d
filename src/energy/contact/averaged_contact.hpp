// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "energy/contact/contact_curve.hpp"
#include "energy/contact/retraction.hpp"
#include "energy/contact/surface.hpp"
#include "energy/energy.hpp"

namespace itr {

/// Contact in 2D of smooth surfaces by gaps that are averaged over the hats of a curve at each vertex, for a surface with a
/// Retraction (docs/theory.md, "Averaged gaps"): with y the average at a vertex, W the integral of its hat and w its width,
/// the energy is scale * kappa / 2 * sum of W w b(1 + y / w), b(s) = -(s - 1)^2 ln s. Gaps are those of the boundary behind
/// which the surface lies, and negative where it overlaps another.
class AveragedContact final : public Energy {
 public:
  /// `surface`, which has a retraction, must outlive this. `scale` is alpha h^2 [s^2].
  AveragedContact(const CollisionSurface& surface, double scale);
  std::string_view name() const override { return "averaged contact"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;

  /// A point that is pressed away from another curve, whose motion relative to the point there is sum of coefficient times
  /// motion of a vertex.
  struct PressedPoint {
    static constexpr int kMost = 2 * CurvePiece::kMost;
    int size = 0;
    std::array<int, kMost> vertices{};
    Eigen::Matrix<double, kMost, 1> coefficients = Eigen::Matrix<double, kMost, 1>::Zero();
    Vec<2> normal;     ///< towards the point
    double force = 0;  ///< [N/m]
  };
  std::vector<PressedPoint> pressed_points(ConstVectorView x, Workspace& workspace) const;

 private:
  struct Point {
    int piece;
    double t, weight;  ///< its share of the length at rest [m]
    Vec<3> hats;       ///< of the piece's owners
    double width;      ///< the largest of its owners
  };
  /// Distance of a point to other curves, as it enters the averages.
  struct Gap {
    double value = 0, first = 0, second = 0;  ///< bounded from above, and its derivatives by the distance
    double distance = 0;                      ///< negative behind the other curve [m]
    int foot = kNone;                         ///< the nearest piece; kNone: none is near
    double t = 0;                             ///< and where on it
    Vec<2> normal = Vec<2>::Zero();           ///< away from the other body
    bool acts() const { return first != 0; }
  };
  struct Averages {
    std::vector<double> value, first, second;  ///< by vertex: of kappa / 2 w b, and its derivatives by y
  };
  struct Cache;
  class GapFinder;
  static constexpr int kMostDofs = 2 * PressedPoint::kMost;
  using Curvature = Mat<kMostDofs>;  ///< of a point's dofs, in the leading rows and columns

  const Cache& at(ConstVectorView x, Workspace& workspace) const;
  void average(const std::vector<Gap>& gaps, Averages& averages) const;
  double slope(const Point& point, const Gap& gap, const Averages& averages) const;
  PressedPoint pressed(const Point& point, const Gap& gap) const;
  void add_hessian_of_averages(const Cache& now, HessianSink& sink) const;
  Curvature curvature(const Point& point, const Gap& gap, const PressedPoint& pressed, ConstVectorView x) const;

  const CollisionSurface* surface_;
  const Retraction* retraction_;
  double scale_;
  std::vector<CurvePiece> pieces_;
  std::vector<Point> points_;
  std::vector<double> measure_;  ///< by vertex: integral of its hat at rest [m]
};

}  // namespace itr
