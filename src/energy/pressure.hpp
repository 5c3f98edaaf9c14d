// SPDX-License-Identifier: MIT
// Follower pressure: forces -p n da on the deformed boundary. On a closed surface, or one whose rim is held, a constant p is
// the gradient of p times the enclosed volume. What else there is (a free rim, a p that varies) has no potential: it is
// lagged, so that the forces are exact at the positions where the term was made.
// On facets that are turned about the axis V is pi times the integral of r^2 dz over the facet, and c that of its ends.
#pragma once

#include "energy/cone_sum.hpp"
#include "energy/load.hpp"

namespace itr {

/// scale * sum over facets of p (V(x) - V(X) + c . (x - X)): V the signed volume of the cone from a fixed point to the
/// facet, c what makes the gradient at the lagged positions that of a pressure.
template <int Dim>
class PressureEnergy final : public Energy {
 public:
  /// `loads.pressures` act on the facets of `cells` with their tags; facets look outward. `cells` need not outlive this.
  PressureEnergy(const CellSet<Dim>& cells, const Loads<Dim>& loads, ConstVectorView lagged_x, double scale);
  std::string_view name() const override { return "pressure"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  bool empty() const { return cones_.empty(); }
  /// Whether any force on an unknown was lagged: then the forces are exact only where this was made.
  bool is_lagged(const DofMap& dofs) const;

 private:
  ConeSum<Dim> cones_;
  VectorX correction_;        ///< sum of p c [N]
  double rest_work_ = 0;      ///< sum of p (V(X) + c . X) [J]
  double largest_force_ = 0;  ///< on a corner, without correction [N]
  double scale_;
};

}  // namespace itr
