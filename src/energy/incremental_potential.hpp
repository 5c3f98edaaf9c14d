// SPDX-License-Identifier: MIT
// The incremental potential (paper eq. 4) of a scope: the whole mesh, a patch, one vertex.
#pragma once

#include <memory>
#include <vector>

#include "core/scratch_vector.hpp"
#include "energy/contact/averaged_contact.hpp"
#include "energy/contact/contact.hpp"
#include "energy/contact/friction.hpp"
#include "energy/damping.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "energy/polyfem/adhesion.hpp"
#include "energy/pressure.hpp"
#include "energy/softening.hpp"
#include "energy/terms.hpp"
#include "energy/viscous.hpp"
#include "fem/vertex_map.hpp"

namespace itr {

/// Where the vertices of a scope come from: interleaved over its vertices, obstacles included. Refers to what is handed in.
struct PotentialHistory {
  ConstVectorView predictor;           ///< x-hat [m]; needed with inertia
  ConstVectorView velocity_reference;  ///< positions of no velocity [m]; needed with friction or damping
};

template <int Dim>
class IncrementalPotential {
 public:
  /// Terms of the scene on `cells`. These two must outlive this.
  IncrementalPotential(const PotentialTerms<Dim>& terms, const CellSet<Dim>& cells, const PotentialHistory& history);
  /// Makes it what a new one on the same `cells`, of which the content may be another, would be. Memory is used again.
  void renew(const PotentialTerms<Dim>& terms, const PotentialHistory& history);

  /// Adds contact among the vertices of `surface`: those of the cells, or (with a `map` from theirs) of its own.
  void add_contact(const CollisionSurface& surface, double stiffness, std::shared_ptr<const VertexMap<Dim>> map = nullptr);

  /// Lagged terms from here on are of velocities that vanish at these positions [m].
  void set_velocity_reference(ConstVectorView x) { velocity_reference_ = x; }

  /// Terms that depend on an earlier iterate; null or empty where the scene has none.
  struct Lagged {
    std::shared_ptr<const Energy> friction;
    std::shared_ptr<FrictionEnergy<Dim>> friction_of_surface;  ///< the same, over the surface's vertices
    std::shared_ptr<const Energy> adhesive_friction;
    std::shared_ptr<PressureEnergy<Dim>> pressure;
    std::vector<std::shared_ptr<const Energy>> damping, contact_damping, follower;
  };
  /// Makes the terms that are lagged at x.
  Lagged lag(ConstVectorView x, Workspace& workspace) const;
  /// Makes friction of contact alone anew, lagged at x.
  void lag_friction(ConstVectorView x, Workspace& workspace, Lagged& lagged) const;
  bool has_friction() const;
  VectorX on_surface(ConstVectorView x) const { return map_ ? map_->positions(x) : VectorX(x); }

  /// Calls f(kind, term) for all terms that there are, with these lagged ones: the only list of them.
  template <typename F>
  void for_each(const Lagged& lagged, const F& f) const {
    const auto visit = [&](TermKind kind, const auto& term) {
      if (term) f(kind, term);
    };
    visit(TermKind::inertia, inertia_);
    visit(TermKind::elastic, elastic_);
    visit(TermKind::viscous, viscous_);
    visit(TermKind::softening, softening_);
    visit(TermKind::loads, loads_);
    for (const auto& term : host_) visit(TermKind::host, term);
    for (const auto& term : lagged.follower) visit(TermKind::follower, term);
    visit(TermKind::contact, contact_of_cells_);
    visit(TermKind::averaged_contact, averaged_of_cells_);
    visit(TermKind::adhesion, adhesion_of_cells_);
    visit(TermKind::friction, lagged.friction);
    visit(TermKind::adhesive_friction, lagged.adhesive_friction);
    visit(TermKind::pressure, lagged.pressure);
    for (const auto& term : cavities_) visit(TermKind::cavity, term);
    visit(TermKind::tie, terms_->tie);
    for (const auto& term : lagged.damping) visit(TermKind::damping, term);
    for (const auto& term : lagged.contact_damping) visit(TermKind::contact_damping, term);
  }
  /// Adds those to a sum of which `is_asked(traits)` holds.
  template <typename F>
  void add_to(EnergySum& sum, const Lagged& lagged, const F& is_asked) const {
    for_each(lagged, [&](TermKind kind, const auto& term) {
      if (is_asked(traits<Dim>(kind))) sum.add(term);
    });
  }
  /// Adds everything to it.
  void add_to(EnergySum& sum, const Lagged& lagged) const;
  EnergySum sum(const Lagged& lagged) const;

  /// Null where the scene has no such term.
  const std::shared_ptr<InertiaEnergy<Dim>>& inertia() const { return inertia_; }
  const std::shared_ptr<ElasticEnergy<Dim>>& elastic() const { return elastic_; }
  const std::shared_ptr<ContactEnergy<Dim>>& contact() const { return contact_; }  ///< over the surface's vertices
  const std::shared_ptr<const Energy>& contact_of_cells() const { return contact_of_cells_; }  ///< over the cells' vertices

 private:
  std::shared_ptr<const Energy> of_cells(std::shared_ptr<const Energy> term) const;
  double adhesion_scaling() const { return terms_->contact.adhesion.is_by_step ? 1 : terms_->scaling; }
  VelocityRule velocity() const { return {terms_->velocity_rate, velocity_reference_.view()}; }
  VelocityRule velocity_of_surface() const { return {terms_->velocity_rate, on_surface(velocity_reference_.view())}; }

  const PotentialTerms<Dim>* terms_;
  const CellSet<Dim>& cells_;
  ScratchVector velocity_reference_;  ///< as in PotentialHistory
  std::shared_ptr<const VertexMap<Dim>> map_;
  std::shared_ptr<InertiaEnergy<Dim>> inertia_;
  std::shared_ptr<ElasticEnergy<Dim>> elastic_;
  std::shared_ptr<ViscousEnergy<Dim>> viscous_;
  std::shared_ptr<SofteningEnergy<Dim>> softening_;
  std::shared_ptr<LoadEnergy<Dim>> loads_;
  std::vector<std::shared_ptr<const Energy>> cavities_;
  std::shared_ptr<ContactEnergy<Dim>> contact_, spare_contact_;  ///< the second: to be renewed
  std::shared_ptr<const Energy> contact_of_cells_;
  std::shared_ptr<AveragedContact> averaged_;  ///< over the surface's vertices
  std::shared_ptr<const Energy> averaged_of_cells_;
  std::shared_ptr<AdhesionEnergy<Dim>> adhesion_;  ///< over the surface's vertices
  std::shared_ptr<const Energy> adhesion_of_cells_;
  std::vector<std::shared_ptr<const Energy>> host_;
};

extern template class IncrementalPotential<2>;
extern template class IncrementalPotential<3>;

}  // namespace itr
