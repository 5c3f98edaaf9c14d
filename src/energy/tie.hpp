// SPDX-License-Identifier: MIT
// Bonded surfaces: the conditions of mortars (mortar.hpp), by an augmented Lagrangian. A solve is repeated with new
// multipliers, which are the tractions of the bond, until the gaps are nothing.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "energy/constraint.hpp"
#include "energy/increment.hpp"
#include "energy/mortar.hpp"

namespace itr {

/// By tag of facets, traction on a tied surface [N/m^(Dim-1)].
template <int Dim>
using TractionOfTie = std::pair<int, std::function<Vec<Dim>(const RestPoint<Dim>& X)>>;

/// scale * sum over rows of lambda . g + k |g|^2 / (2 A), with the gap g = sum of weights (x - X) less its target, and A the
/// measure of the row.
template <int Dim>
class TieEnergy final : public Energy, public IncrementalTerm, public Constraint {
 public:
  /// `mortars` and `cells` must outlive this. k is stiff beside the softer body's cells, and beside their inertia where
  /// `has_inertia`: `scale` then is alpha h^2 [s^2].
  TieEnergy(const CellSet<Dim>& cells, const std::vector<Mortar<Dim>>& mortars, const std::map<int, Material>& materials,
            bool has_inertia, double scale);
  std::string_view name() const override { return "tie"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;

  /// Lets the gaps of ties with a jump go to that at time t.
  void set_jumps(std::span<const Tie> ties, double t);
  /// Sets where increments begin: gaps there count as they are, whatever round-off others suppose of the base.
  void begin_at(ConstVectorView base);
  /// Lets the gaps go to `fraction` of these, of a field over nodes, instead of to none [m].
  void add_targets(double fraction, ConstVectorView field);
  double error_at(const Increment& at) const override;
  void update(const Increment& at) override;
  void stiffen(double factor) override { factor_ *= factor; }
  std::string describe(const Increment& at, const Units& units) const override;
  /// The largest mean gap of a row [m]: of a field over nodes, interleaved.
  double largest_gap(ConstVectorView field) const;
  /// Its tractions on both surfaces of each mortar, functions that outlive this.
  std::vector<TractionOfTie<Dim>> tractions() const;
  /// The nodes that each row bonds.
  std::vector<std::vector<int>> bonds() const;

 private:
  struct Row {
    const MortarRow<Dim>* of;
    const Mortar<Dim>* mortar;
    double stiffness;  ///< k [N/m^Dim]
    Vec<Dim> multiplier, target;
    Vec<Dim> start;  ///< gap where increments begin
  };
  static Vec<Dim> jump(const MortarRow<Dim>& row, ConstVectorView field);
  Vec<Dim> gap(const Row& row, ConstVectorView x) const;
  Vec<Dim> gap(const Row& row, const Increment& at) const;
  Vec<Dim> traction(const Row& row, const Vec<Dim>& gap) const {
    return row.multiplier + factor_ * row.stiffness / row.of->measure * gap;
  }
  double value_of(const Row& row, const Vec<Dim>& gap) const;
  void add_gradient_of(const Row& row, const Vec<Dim>& gap, VectorView gradient) const;

  const CellSet<Dim>& cells_;
  const std::vector<Mortar<Dim>>& mortars_;
  std::vector<Row> rows_;
  VectorX rest_;
  double extent_ = 0;  ///< of the positions at rest [m]
  double scale_, factor_ = 1;
};

}  // namespace itr
