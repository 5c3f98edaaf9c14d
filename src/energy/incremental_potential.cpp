// SPDX-License-Identifier: MIT
#include "energy/incremental_potential.hpp"

#include <utility>

#include "energy/cavity.hpp"
#include "energy/mapped.hpp"
#include "energy/polyfem/adhesive_friction.hpp"
#include "energy/rigid_body.hpp"

namespace itr {

namespace {

/// Makes a term what a new one would be, in the memory of the one that is there; null where the scene has none.
template <typename Term, typename... Arguments>
void renew_term(std::shared_ptr<Term>& term, bool is_needed, const auto& cells, const Arguments&... arguments) {
  if (!is_needed)
    term.reset();
  else if (term)
    term->renew(arguments...);
  else
    term = std::make_shared<Term>(cells, arguments...);
}

/// Elasticity without the cells of rigid bodies, to be damped.
template <int Dim>
class WithoutRigidBodies final : public Energy {
 public:
  WithoutRigidBodies(const Energy& elastic, const CellSet<Dim>& cells, const std::map<int, Material>& materials)
      : elastic_(elastic), is_rigid_(cells.rest.size(), 0) {
    for (const auto& element : cells.elements)
      if (rigid_body_of(materials.at(element.body)))
        for (const int v : element.vertices) is_rigid_[v] = 1;
  }
  std::string_view name() const override { return elastic_.name(); }
  double value(ConstVectorView x, Workspace& workspace) const override { return elastic_.value(x, workspace); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override {
    elastic_.add_gradient(x, gradient, workspace);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override {
    HessianSink others([&](std::span<const int> vertices, const double* block) {
      if (!is_rigid_[vertices[0]]) sink.add<Dim>(vertices, block);
    });
    elastic_.add_hessian(x, psd, others, workspace);
  }

 private:
  const Energy& elastic_;
  std::vector<char> is_rigid_;
};

/// The friction that was lagged last: made anew where nothing refers to it any more.
template <int Dim>
struct FrictionScratch {
  std::shared_ptr<FrictionEnergy<Dim>> last;
};

}  // namespace

template <int Dim>
IncrementalPotential<Dim>::IncrementalPotential(const PotentialTerms<Dim>& terms, const CellSet<Dim>& cells,
                                                const PotentialHistory& history)
    : terms_(&terms), cells_(cells) {
  renew(terms, history);
}

template <int Dim>
void IncrementalPotential<Dim>::renew(const PotentialTerms<Dim>& terms, const PotentialHistory& history) {
  terms_ = &terms;
  velocity_reference_ = history.velocity_reference;
  renew_term(inertia_, is_in(TermKind::inertia, terms), cells_, terms.materials, terms.mass, history.predictor);
  renew_term(elastic_, is_in(TermKind::elastic, terms), cells_, terms.materials, terms.scaling, terms.quadrature_degree);
  viscous_.reset();
  if (terms.viscous)
    viscous_ = std::make_shared<ViscousEnergy<Dim>>("viscous", cells_, *terms.viscous, terms.scaling,
                                                    degree_with_turn(terms.quadrature_degree, cells_.axisymmetric));
  softening_.reset();
  if (terms.softening)
    softening_ = std::make_shared<SofteningEnergy<Dim>>("softening", cells_, *terms.softening, terms.scaling, kStateDegree);
  renew_term(loads_, is_in(TermKind::loads, terms), cells_, terms.materials, terms.loads, terms.scaling);
  cavities_.clear();
  for (const CavityLoad& cavity : terms.loads.cavities)
    cavities_.push_back(std::make_shared<CavityEnergy<Dim>>(cells_, cavity, terms.scaling));
  map_.reset();
  contact_of_cells_.reset();
  averaged_.reset();
  averaged_of_cells_.reset();
  adhesion_.reset();
  adhesion_of_cells_.reset();
  if (contact_) spare_contact_ = std::move(contact_);
  host_.clear();
  for (const auto& make : terms.host)
    if (auto term = make(cells_, terms.t, terms.scaling)) host_.push_back(std::move(term));
}

template <int Dim>
void IncrementalPotential<Dim>::add_contact(const CollisionSurface& surface, double stiffness,
                                            std::shared_ptr<const VertexMap<Dim>> map) {
  map_ = std::move(map);
  if (spare_contact_ && spare_contact_.use_count() == 1) {
    contact_ = std::move(spare_contact_);
    contact_->renew(surface, terms_->contact, stiffness, terms_->scaling);
  } else {
    contact_ = std::make_shared<ContactEnergy<Dim>>(surface, terms_->contact, stiffness, terms_->scaling);
  }
  contact_of_cells_ = of_cells(contact_);
  if (surface.retraction) {
    averaged_ = std::make_shared<AveragedContact>(surface, terms_->scaling);
    averaged_of_cells_ = of_cells(averaged_);
  }
  if (!is_in(TermKind::adhesion, *terms_)) return;
  adhesion_ = std::make_shared<AdhesionEnergy<Dim>>(surface, terms_->contact, adhesion_scaling());
  adhesion_of_cells_ = of_cells(adhesion_);
}

/// A term over the vertices of the surface as one over those of the cells.
template <int Dim>
std::shared_ptr<const Energy> IncrementalPotential<Dim>::of_cells(std::shared_ptr<const Energy> term) const {
  if (!map_) return term;
  return std::make_shared<MappedEnergy<Dim>>(std::move(term), map_);
}

template <int Dim>
bool IncrementalPotential<Dim>::has_friction() const {
  return contact_ && is_in(TermKind::friction, *terms_);
}

template <int Dim>
void IncrementalPotential<Dim>::lag_friction(ConstVectorView x, Workspace& workspace, Lagged& lagged) const {
  lagged.friction.reset();
  lagged.friction_of_surface.reset();
  if (!has_friction()) return;
  auto& friction = workspace.get<FrictionScratch<Dim>>().last;
  if (!friction || friction.use_count() > 1) friction = std::make_shared<FrictionEnergy<Dim>>();
  const auto lag = [&](ConstVectorView at, ConstVectorView reference) {
    friction->renew(*contact_, at, workspace, terms_->contact, terms_->velocity_rate, reference, terms_->scaling,
                    terms_->slips_from_touch);
  };
  if (map_)
    lag(on_surface(x), on_surface(velocity_reference_.view()));
  else
    lag(x, velocity_reference_.view());
  if constexpr (Dim == 2)
    if (averaged_) friction->add(averaged_->pressed_points(on_surface(x), workspace), terms_->contact.friction_coefficient);
  if (friction->empty()) return;
  lagged.friction_of_surface = friction;
  lagged.friction = of_cells(friction);
}

template <int Dim>
typename IncrementalPotential<Dim>::Lagged IncrementalPotential<Dim>::lag(ConstVectorView x, Workspace& workspace) const {
  Lagged lagged;
  lag_friction(x, workspace, lagged);
  if (adhesion_ && is_in(TermKind::adhesive_friction, *terms_)) {
    const VelocityRule velocity = velocity_of_surface();
    FrictionEnergy<Dim> held(adhesion_->pairs(), on_surface(x), AdhesionEnergy<Dim>::inner(workspace), terms_->contact,
                             velocity, adhesion_scaling());
    if (terms_->contact.adhesion.is_by_step)
      lagged.adhesive_friction = of_cells(std::make_shared<AdhesiveFriction<Dim>>(std::move(held), velocity.reference));
    else
      lagged.adhesive_friction = of_cells(std::make_shared<FrictionEnergy<Dim>>(std::move(held)));
  }
  if (is_in(TermKind::pressure, *terms_)) {
    lagged.pressure = std::make_shared<PressureEnergy<Dim>>(cells_, terms_->loads, x, terms_->scaling);
    if (lagged.pressure->empty()) lagged.pressure.reset();
  }
  for (const DampingOptions& options : terms_->damping) {
    if (options.term != DampingOptions::Term::contact)
      lagged.damping.push_back(
          has_rigid_bodies(terms_->materials)
              ? std::make_shared<DampingEnergy<Dim>>(WithoutRigidBodies<Dim>(*elastic_, cells_, terms_->materials), x,
                                                     options.coefficient, velocity(), workspace)
              : std::make_shared<DampingEnergy<Dim>>(*elastic_, x, options.coefficient, velocity(), workspace));
    else if (contact_)
      lagged.contact_damping.push_back(of_cells(std::make_shared<DampingEnergy<Dim>>(
          *contact_, on_surface(x), options.coefficient, velocity_of_surface(), workspace)));
  }
  if (is_in(TermKind::follower, *terms_)) lagged.follower = terms_->follower(x);
  return lagged;
}

template <int Dim>
EnergySum IncrementalPotential<Dim>::sum(const Lagged& lagged) const {
  EnergySum sum;
  add_to(sum, lagged);
  return sum;
}

template <int Dim>
void IncrementalPotential<Dim>::add_to(EnergySum& sum, const Lagged& lagged) const {
  add_to(sum, lagged, [](const TermTraits<Dim>&) { return true; });
}

template class IncrementalPotential<2>;
template class IncrementalPotential<3>;

}  // namespace itr
