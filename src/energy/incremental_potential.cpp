// SPDX-License-Identifier: MIT
#include "itr/energy/incremental_potential.hpp"

#include <utility>

#include "itr/energy/mapped.hpp"

namespace itr {

template <int Dim>
IncrementalPotential<Dim>::IncrementalPotential(const PotentialTerms<Dim>& terms, const CellSet<Dim>& cells,
                                                PotentialHistory history)
    : terms_(terms), cells_(cells), history_(std::move(history)) {
  if (terms.has_inertia)
    inertia_ = std::make_shared<InertiaEnergy<Dim>>(cells, terms.materials, terms.mass, std::move(history_.predictor));
  elastic_ = std::make_shared<ElasticEnergy<Dim>>(cells, terms.materials, terms.scaling);
  if (terms.loads.has_dead_loads())
    loads_ = std::make_shared<LoadEnergy<Dim>>(cells, terms.materials, terms.loads, terms.scaling);
  for (const auto& make : terms.host)
    if (auto term = make(cells, terms.t, terms.scaling)) host_.push_back(std::move(term));
}

template <int Dim>
void IncrementalPotential<Dim>::add_contact(const CollisionSurface& surface, double stiffness,
                                            std::shared_ptr<const VertexMap<Dim>> map) {
  map_ = std::move(map);
  contact_ = std::make_shared<ContactEnergy<Dim>>(surface, terms_.contact, stiffness, terms_.scaling);
  contact_of_cells_ = of_cells(contact_);
}

/// A term over the vertices of the surface as one over those of the cells.
template <int Dim>
std::shared_ptr<const Energy> IncrementalPotential<Dim>::of_cells(std::shared_ptr<const Energy> term) const {
  if (!map_) return term;
  return std::make_shared<MappedEnergy<Dim>>(std::move(term), map_);
}

template <int Dim>
bool IncrementalPotential<Dim>::has_friction() const {
  return contact_ && terms_.contact.friction_coefficient > 0 && terms_.contact.friction_iterations != 0;
}

template <int Dim>
std::shared_ptr<const Energy> IncrementalPotential<Dim>::lag_friction(const VectorX& x, Workspace& workspace) const {
  if (!has_friction()) return nullptr;
  const auto friction = std::make_shared<FrictionEnergy<Dim>>(*contact_, on_surface(x), workspace, terms_.contact,
                                                              velocity_of_surface(), terms_.scaling);
  return friction->empty() ? nullptr : of_cells(friction);
}

template <int Dim>
typename IncrementalPotential<Dim>::Lagged IncrementalPotential<Dim>::lag(const VectorX& x, Workspace& workspace) const {
  Lagged lagged;
  lagged.friction = lag_friction(x, workspace);
  if (!terms_.loads.pressures.empty()) {
    lagged.pressure = std::make_shared<PressureEnergy<Dim>>(cells_, terms_.loads, x, terms_.scaling);
    if (lagged.pressure->empty()) lagged.pressure.reset();
  }
  for (const DampingOptions& options : terms_.damping) {
    if (options.term != DampingOptions::Term::contact)
      lagged.damping.push_back(
          std::make_shared<DampingEnergy<Dim>>(*elastic_, x, options.coefficient, velocity(), workspace));
    else if (contact_)
      lagged.damping.push_back(of_cells(std::make_shared<DampingEnergy<Dim>>(*contact_, on_surface(x), options.coefficient,
                                                                             velocity_of_surface(), workspace)));
  }
  if (terms_.follower) lagged.follower = terms_.follower(x);
  return lagged;
}

template <int Dim>
EnergySum IncrementalPotential<Dim>::sum(const Lagged& lagged) const {
  EnergySum sum;
  const auto add = [&](const auto& term) {
    if (term) sum.add(term);
  };
  add(inertia_);
  add(elastic_);
  add(loads_);
  for (const auto& term : host_) add(term);
  add(lagged.follower);
  add(contact_of_cells_);
  add(lagged.friction);
  add(lagged.pressure);
  for (const auto& term : lagged.damping) add(term);
  return sum;
}

template class IncrementalPotential<2>;
template class IncrementalPotential<3>;

}  // namespace itr
