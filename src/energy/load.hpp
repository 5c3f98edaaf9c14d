// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <map>

#include "core/scratch_vector.hpp"
#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "fem/cell_set.hpp"
#include "itr/options.hpp"

namespace itr {

/// Points of the quadrature of loads, in barycentric coordinates with equal weights, exact for degree 2: this share at one
/// vertex of a simplex, the rest evenly at the others.
template <std::size_t Vertices>
constexpr double near_vertex() {
  if constexpr (Vertices == 2) return 0.5 + 0.28867513459481287;  // Gauss points of an edge
  if constexpr (Vertices == 3) return 2.0 / 3.0;
  return 0.5854101966249685;
}

/// A Cavity at one time.
struct CavityLoad {
  std::vector<int> surfaces;  ///< tags of facets
  double pressure = 0;        ///< p0 [Pa]
  double external_pressure = 0, exponent = 1, bulk_modulus = 0;

  double pressure_at(double volume_ratio) const;  ///< p(V / V0) [Pa]
  /// Minus the work of the overpressure from V0 on, by V0 [J/m^Dim].
  double energy_at(double volume_ratio) const;
  double stiffness_at(double volume_ratio) const;  ///< -V0 dp/dV [Pa]
};

/// Loads on a body at one time: functions of rest position, which several threads may call at once.
template <int Dim>
struct Loads {
  std::function<Vec<Dim>(const RestPoint<Dim>& X)> acceleration;  ///< body force by mass [m/s^2]; empty: none
  std::vector<std::pair<int, std::function<Vec<Dim>(const RestPoint<Dim>& X)>>> tractions;  ///< by facet tag [N/m^(Dim-1)]
  std::vector<std::pair<int, std::function<double(const RestPoint<Dim>& X)>>> pressures;    ///< the same, see PressureEnergy
  std::vector<CavityLoad> cavities{};
  bool has_dead_loads() const { return acceleration || !tractions.empty(); }
};

/// -scale * f . (x - X) with the consistent nodal forces f of body force and tractions, the dead loads: minus the work done
/// from rest.
template <int Dim>
class LoadEnergy final : public Energy, public IncrementalTerm {
 public:
  /// `cells` must outlive this.
  LoadEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, const Loads<Dim>& loads, double scale);
  /// Makes it what a new one on the same `cells`, of which the content may be another, would be. Memory is used again.
  void renew(const std::map<int, Material>& materials, const Loads<Dim>& loads, double scale);
  std::string_view name() const override { return "body"; }
  double value(ConstVectorView x, Workspace&) const override { return -(scale_ * (forces_.view().dot(x) - rest_work_)); }
  void add_gradient(ConstVectorView, VectorView gradient, Workspace&) const override { gradient -= scale_ * forces_.view(); }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double value_at(const Increment& at, Workspace&) const override { return -scale_ * forces_.view().dot(at.d); }
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const override {
    add_gradient(at.base, gradient, workspace);
  }
  ConstVectorView forces() const { return forces_.view(); }  ///< [N]

 private:
  const CellSet<Dim>& cells_;
  ScratchVector forces_;
  double rest_work_ = 0;  ///< f . X
  double scale_ = 1;
};

}  // namespace itr
