// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include "energy/contact/surface.hpp"
#include "energy/energy.hpp"

namespace itr {

/// The geometric contact potential of Huang et al. 2025 in 2D (docs/theory.md, "Geometric contact").
struct GeometricContactOptions {
  double dhat = 1e-3;    ///< distance below which it acts [m]
  double stiffness = 1;  ///< kappa [Pa]
  double tangent = 0.5;  ///< alpha_t, in (0, 1]: sine of the slope at which what is not the nearest point still counts
  double normal = 0.5;   ///< alpha_n, in (0, 1]: sine of the turn at which the inner side still counts
};

/// Contact of the boundary of straight cells. CCD of ContactEnergy sees to it that nothing touches.
class GeometricContact final : public Energy {
 public:
  /// `scale` is alpha h^2 [s^2].
  GeometricContact(const CellSet<2>& cells, const GeometricContactOptions& options, double scale);
  std::string_view name() const override { return "geometric contact"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;

 private:
  /// Two vertices, or a vertex and an edge with its nearest point inside, and the vertices beside them.
  struct Pair {
    static constexpr int kMost = 6;
    int size = kMost;  ///< 5: an edge, then a vertex with its next and its last; 6: two such vertices
    std::array<int, kMost> vertices{kNone, kNone, kNone, kNone, kNone, kNone};
    auto operator<=>(const Pair&) const = default;
  };
  std::vector<Pair> pairs(ConstVectorView x, Workspace& workspace) const;
  template <typename T>
  T energy(const Pair& pair, const std::array<std::array<T, 2>, Pair::kMost>& at) const;

  GeometricContactOptions options_;
  double factor_;  ///< kappa times scale
  CollisionSurface surface_;
  std::vector<std::array<int, 2>> adjacent_;  ///< by vertex, along the boundary, the body to the left: the next and the last
};

}  // namespace itr
