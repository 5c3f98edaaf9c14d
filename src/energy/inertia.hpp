// SPDX-License-Identifier: MIT
#pragma once

#include <map>

#include "core/scratch_vector.hpp"
#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "fem/cell_set.hpp"
#include "fem/mass.hpp"
#include "itr/options.hpp"

namespace itr {

/// 1/2 (x - xhat)^T M (x - xhat): the body's distance to where it would fly without forces, as a function on the body.
template <int Dim>
class InertiaEnergy final : public Energy, public IncrementalTerm {
 public:
  /// `predictor` is xhat at the vertices of `cells`, which must outlive this.
  InertiaEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, MassKind kind,
                ConstVectorView predictor);
  /// Makes it what a new one on the same `cells`, of which the content may be another, would be. Memory is used again.
  void renew(const std::map<int, Material>& materials, MassKind kind, ConstVectorView predictor);

  /// Adds residual . (x - xhat) + loss, by which the functional becomes 1/2 ||x - xhat_old||^2 for an xhat_old that the
  /// mesh cannot represent (docs/theory.md, "The rules", rule b): see projection/forgotten_history.hpp.
  void set_unrepresented_history(ConstVectorView residual, double loss);

  /// Gives xhat - base for increments from `base`, where xhat itself would round it away.
  void set_predicted_increment(ConstVectorView increment) { predicted_increment_ = increment; }

  ConstVectorView predictor() const { return predictor_.view(); }
  std::string_view name() const override { return "inertia"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;
  /// y += M x.
  void add_mass_product(ConstVectorView x, VectorView y) const;
  /// Calls f(body, nodes, mass matrix of a component) for each cell.
  template <typename F>
  void for_each_mass(const F& f) const {
    for (std::size_t e = 0; e < mass_.size(); ++e) {
      const ElementMass<Dim> mass(kind_, mass_[e]);
      Mat<Dim + 1> matrix = Mat<Dim + 1>::Constant(mass.off);
      matrix.diagonal().array() += mass.extra;
      f(cells_.elements[e].body, cells_.elements[e].vertices, matrix);
    }
    for (std::size_t e = 0; e < curved_mass_.size(); ++e) {
      const auto& element = cells_.curved()[e];
      f(element.body, element.nodes(), (curved_mass_[e].mass * matrices_[curved_mass_[e].matrix]).eval());
    }
  }

 private:
  const CellSet<Dim>& cells_;
  struct CurvedMass {
    double mass;  ///< rho |e|
    std::size_t matrix;
  };
  void renew_curved(const std::map<int, Material>& materials);
  /// At x = xhat + `distance`.
  double value_of(ConstVectorView distance) const;
  ConstVectorView distance_at(const Increment& at, Workspace& workspace) const;

  std::vector<double> mass_;                         ///< rho |e| by element
  std::vector<Mat<kQuadraticNodes<Dim>>> matrices_;  ///< by unit mass: one a set of curved edges, or one an element
  std::vector<CurvedMass> curved_mass_;
  MassKind kind_ = MassKind::consistent;
  ScratchVector predictor_, predicted_increment_;  ///< the second is empty where none is given
  ScratchVector residual_;                         ///< empty: none
  double loss_ = 0;
};

/// Diagonal of the consistent mass matrix of unit density, by dof. Where it is zero, its mean. `diagonal` has Dim *
/// cells.num_vertices entries.
template <int Dim>
void get_unit_mass_diagonal(const CellSet<Dim>& cells, VectorView diagonal);
template <int Dim>
VectorX unit_mass_diagonal(const CellSet<Dim>& cells) {
  VectorX diagonal(Dim * cells.num_vertices);
  get_unit_mass_diagonal(cells, diagonal);
  return diagonal;
}

}  // namespace itr
