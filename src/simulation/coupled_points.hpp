// SPDX-License-Identifier: MIT
// The terms of coupled points in a step.
#pragma once

#include <memory>
#include <vector>

#include "energy/coupling.hpp"
#include "energy/terms.hpp"
#include "energy/tie.hpp"
#include "itr/setup.hpp"
#include "time/integrator.hpp"

namespace itr {

/// A coupling on a mesh.
template <int Dim>
struct CoupledSurface {
  std::shared_ptr<const Coupling> coupling;
  SurfaceMean<Dim> mean;
  double modulus;  ///< of the softest cells beside it [Pa]
  double density;  ///< likewise [kg/m^3]

  CoupledPoint<Dim> point() const { return {mean, coupling->point}; }
};
template <int Dim>
std::vector<CoupledSurface<Dim>> coupled_surfaces(const StepSetup<Dim>& setup, const CellSet<Dim>& cells);

/// The terms of all coupled points in the step to time t. Constraints among them keep their multipliers.
template <int Dim>
class CoupledPoints {
 public:
  /// `setup`, `terms` and `surfaces` must outlive this.
  CoupledPoints(const StepSetup<Dim>& setup, const PotentialTerms<Dim>& terms,
                const std::vector<CoupledSurface<Dim>>& surfaces, const History& history);
  bool empty() const { return surfaces_.empty(); }
  /// With loads that are lagged at x.
  std::vector<std::shared_ptr<const Energy>> terms(const VectorX& x) const;
  std::vector<Constraint*> constraints() const;
  /// By tag of facets, the tractions by which points act on their surfaces where the bodies are at x [N/m^(Dim-1)].
  std::vector<TractionOfTie<Dim>> tractions(const VectorX& x) const;
  /// Adds the product of their masses, where the bodies are at x, with velocities of nodes.
  void add_mass_product(const VectorX& x, const VectorX& v, VectorX& product) const;

 private:
  using Term = std::shared_ptr<CouplingEnergy<Dim>>;  ///< may be null
  Term support_of(const CoupledSurface<Dim>& surface, const History& history) const;
  Term mass_of(const CoupledSurface<Dim>& surface, const History& history) const;
  Term load_of(const CoupledSurface<Dim>& surface, const VectorX& x) const;
  std::vector<Term> terms_of(std::size_t i, const VectorX& x) const;

  const StepSetup<Dim>& setup_;
  const PotentialTerms<Dim>& terms_;
  const std::vector<CoupledSurface<Dim>>& surfaces_;
  std::vector<Term> supports_, masses_;  ///< by surface
};

}  // namespace itr
