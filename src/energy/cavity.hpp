// SPDX-License-Identifier: MIT
// Gas or fluid in a closed cavity: an energy of the volume that facets enclose. Its Hessian has a part of rank one, which
// couples all nodes of the cavity and is never assembled (RankOne).
#pragma once

#include <limits>

#include "energy/cone_sum.hpp"
#include "energy/load.hpp"

namespace itr {

/// scale * V0 * CavityLoad::energy_at(V / V0), infinite where no volume is left.
template <int Dim>
class CavityEnergy final : public Energy {
 public:
  /// `load` acts on the facets of `cells` with its tags; facets look outward. V0 is the volume at rest. `cells` need not
  /// outlive this.
  CavityEnergy(const CellSet<Dim>& cells, CavityLoad load, double scale);
  std::string_view name() const override { return "cavity"; }
  double value(ConstVectorView x, Workspace&) const override {
    const double ratio = ratio_at(x);
    return ratio > 0 ? scale_ * rest_volume_ * load_.energy_at(ratio) : std::numeric_limits<double>::infinity();
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    cones_.add_gradient(x, -scale_ * pressure(x), gradient);
  }
  /// Adds that of a constant pressure.
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override {
    cones_.add_hessian(x, -scale_ * pressure(x), psd, sink);
  }
  void add_rank_ones(ConstVectorView x, std::vector<RankOne>& parts) const override;

  double volume(ConstVectorView x) const { return cones_.add_value(x, 0); }            ///< [m^Dim]
  double pressure(ConstVectorView x) const { return load_.pressure_at(ratio_at(x)); }  ///< [Pa]

 private:
  double ratio_at(ConstVectorView x) const { return volume(x) / rest_volume_; }

  ConeSum<Dim> cones_;  ///< of pressure -1, since facets look into the cavity
  CavityLoad load_;
  double rest_volume_ = 0, scale_;
};

}  // namespace itr
