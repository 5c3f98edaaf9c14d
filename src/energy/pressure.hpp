// SPDX-License-Identifier: MIT
// Follower pressure: forces -p n da on the deformed boundary. On a closed surface, or one whose rim is held, a constant p is
// the gradient of p times the enclosed volume. What else there is (a free rim, a p that varies) has no potential: it is
// lagged, so that the forces are exact at the positions where the term was made.
// On facets that are turned about the axis V is pi times the integral of r^2 dz over the facet, and c that of its ends.
#pragma once

#include "energy/energy.hpp"
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
  bool empty() const { return facets_.empty() && curves_.empty(); }
  /// Whether any force on an unknown was lagged: then the forces are exact only where this was made.
  bool is_lagged(const DofMap& dofs) const;

 private:
  struct LoadedFacet {
    std::array<int, Dim> vertices;
    double pressure;  ///< [N/m^(Dim-1)], at the rest barycentre
  };
  struct CurvedLoadedFacet {
    std::array<int, kQuadraticNodes<Dim - 1>> nodes;
    CurvedEdges curved;
    double pressure;
  };
  using Corners = Mat<Dim>;  ///< corners of a facet as columns, from the origin
  Corners corners(const LoadedFacet& facet, ConstVectorView x) const;
  /// f(facet, pressure times the point's share, weights of its nodes, corners of the cone) at points of all curved facets.
  template <typename F>
  void for_each_cone(ConstVectorView x, const F& f) const;

  /// f(facet, pressure times the point's share, what is turned there) at points of all facets of an axisymmetric mesh.
  template <typename F>
  void for_each_turned(ConstVectorView x, const F& f) const;

  bool axisymmetric_;
  std::vector<LoadedFacet> facets_;  ///< straight ones, unless they are turned
  std::vector<CurvedLoadedFacet> curves_;
  Vec<Dim> origin_ = Vec<Dim>::Zero();  ///< near the facets: less round-off
  VectorX correction_;                  ///< sum of p c [N]
  double rest_work_ = 0;                ///< sum of p (V(X) + c . X) [J]
  double largest_force_ = 0;            ///< on a corner, without correction [N]
  double scale_;
};

}  // namespace itr
