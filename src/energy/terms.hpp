// SPDX-License-Identifier: MIT
// The terms of the incremental potential (paper eq. 4): what they are made of, and one table of what others ask of each.
// IncrementalPotential::for_each is the other list: it adds them.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "energy/energy.hpp"
#include "energy/load.hpp"
#include "fem/mass.hpp"
#include "fem/quadrature.hpp"
#include "itr/energy.hpp"
#include "itr/options.hpp"

namespace itr {

template <int Dim>
class ViscousStep;
template <int Dim>
class SofteningStep;

/// Options and loads of all terms of a step; the cells of the sum come from a CellSet.
template <int Dim>
struct PotentialTerms {
  std::map<int, Material> materials;                      ///< by body; of viscoelastic ones the moduli over the step
  std::shared_ptr<const ViscousStep<Dim>> viscous{};      ///< what their past adds to it; null: there are none
  std::shared_ptr<const SofteningStep<Dim>> softening{};  ///< the same of bodies that soften
  Loads<Dim> loads;                                       ///< at the end of the step
  bool has_inertia = true;
  bool axisymmetric = false;  ///< CellSet::axisymmetric of all cells
  MassKind mass = MassKind::consistent;
  int quadrature_degree = kElasticDegree;  ///< of elasticity on curved elements
  double scaling = 1;                      ///< alpha h^2 [s^2]
  ContactOptions contact;
  std::vector<DampingOptions> damping;  ///< empty in statics
  double velocity_rate = 1;             ///< of VelocityRule [1/s]
  bool slips_from_touch = false;        ///< friction counts no slip of the approach that ends nearer than dhat
  std::vector<TermFactory<Dim>> host;   ///< what the program adds
  double t = 0;                         ///< at the end of the step, for them [s]
  /// Forces of positions, lagged or linearised at those of the cells' vertices; empty: none. On the whole mesh only.
  std::function<std::vector<std::shared_ptr<const Energy>>(const VectorX& x)> follower;
  std::shared_ptr<const Energy> tie{};  ///< on the whole mesh only: in patches its forces are tractions; null: none
};

/// In the order in which they are summed.
enum class TermKind {
  inertia,
  elastic,
  viscous,
  softening,
  loads,
  host,
  follower,
  contact,
  averaged_contact,
  adhesion,
  friction,
  adhesive_friction,
  pressure,
  cavity,
  tie,
  damping,
  contact_damping
};
inline constexpr std::size_t kNumTermKinds = 17;

/// Entries of a report of energies, in the order in which its total is summed.
enum class EnergyEntry { inertia, elastic, body, contact, friction, damping, host };
inline constexpr std::size_t kNumEnergyEntries = 7;
/// Entries of a report of nodal forces.
enum class ForceEntry { none, contact, friction, applied };

/// Part of a term in predictions of an edit's gain (src/remesh/decide/prediction.hpp).
enum class InPredictions {
  unknown,   ///< nothing: no gain is predicted, and every edge is tried
  included,  ///< it is part of them
  left_out   ///< that it is left out: edits in its reach are tried
};

/// Properties of a term for those who handle terms without knowing them. The defaults are safe for any term.
template <int Dim>
struct TermTraits {
  using Question = bool (*)(const PotentialTerms<Dim>&);

  TermKind kind;
  Question is_in;  ///< whether it acts in such a step
  EnergyEntry energy;
  ForceEntry force = ForceEntry::none;
  InPredictions in_predictions = InPredictions::unknown;
  Question is_bounded = nullptr;  ///< whether it is never negative, a constant aside; null: not known
  Question needs_facets = [](const PotentialTerms<Dim>&) { return true; };  ///< of the boundary, with their tags
  bool needs_velocities = false;                                            ///< see PotentialHistory
  bool is_between_bodies = false;                                           ///< acts on the surface, where something is near
  bool is_stored = false;         ///< an energy that bodies get back: what a step creates of it is watched
  bool has_no_potential = false;  ///< its forces are those of an earlier iterate: rounds have to settle them
};

/// Whether W >= 0, with moduli and a density that are the same everywhere.
template <int Dim>
bool is_bounded(const Material& material) {
  return material.law != MaterialLaw::own && material.law != MaterialLaw::mooney_rivlin && !material.has_varying_moduli() &&
         !material.density_at && material.lame_lambda(Dim) >= 0;
}

/// Whether the Hessian of such a term is damped.
template <int Dim>
bool has_damping(const PotentialTerms<Dim>& terms, DampingOptions::Term damped) {
  return std::any_of(terms.damping.begin(), terms.damping.end(),
                     [&](const DampingOptions& options) { return options.term == damped; });
}

/// By kind.
template <int Dim>
inline constexpr std::array<TermTraits<Dim>, kNumTermKinds> kTerms{{
    {.kind = TermKind::inertia,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.has_inertia; },
     .energy = EnergyEntry::inertia,
     .in_predictions = InPredictions::included,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; }},
    {.kind = TermKind::elastic,
     .is_in = [](const PotentialTerms<Dim>&) { return true; },
     .energy = EnergyEntry::elastic,
     .in_predictions = InPredictions::included,
     .is_bounded =
         [](const PotentialTerms<Dim>& terms) {
           return std::all_of(terms.materials.begin(), terms.materials.end(),
                              [](const auto& entry) { return itr::is_bounded<Dim>(entry.second); });
         },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .is_stored = true},
    {.kind = TermKind::viscous,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.viscous != nullptr; },
     .energy = EnergyEntry::elastic,
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .is_stored = true},
    {.kind = TermKind::softening,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.softening != nullptr; },
     .energy = EnergyEntry::elastic,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .is_stored = true},
    {.kind = TermKind::loads,  // of its forces only tractions are reported: StepProblem::forces
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.loads.has_dead_loads(); },
     .energy = EnergyEntry::body,
     .in_predictions = InPredictions::included,
     .is_bounded =  // with inertia a body force completes it to a square
     [](const PotentialTerms<Dim>& terms) {
       return terms.loads.tractions.empty() && (!terms.loads.acceleration || terms.has_inertia);
     },
     .needs_facets = [](const PotentialTerms<Dim>& terms) { return !terms.loads.tractions.empty(); }},
    {.kind = TermKind::host,
     .is_in = [](const PotentialTerms<Dim>& terms) { return !terms.host.empty(); },
     .energy = EnergyEntry::host,
     .force = ForceEntry::applied,
     .is_stored = true},
    {.kind = TermKind::follower,
     .is_in = [](const PotentialTerms<Dim>& terms) { return static_cast<bool>(terms.follower); },
     .energy = EnergyEntry::host,
     .force = ForceEntry::applied,
     .has_no_potential = true},
    {.kind = TermKind::contact,  // StepContext::coupling says where it is negative
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.contact.enabled; },
     .energy = EnergyEntry::contact,
     .force = ForceEntry::contact,
     .in_predictions = InPredictions::left_out,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },  // the surface is its own
     .is_between_bodies = true,
     .is_stored = true},
    {.kind = TermKind::averaged_contact,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.contact.enabled && terms.contact.average_gaps; },
     .energy = EnergyEntry::contact,
     .force = ForceEntry::contact,
     .in_predictions = InPredictions::left_out,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .is_between_bodies = true,
     .is_stored = true},
    {.kind = TermKind::adhesion,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.contact.has_adhesion(); },
     .energy = EnergyEntry::contact,
     .force = ForceEntry::contact,
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .is_between_bodies = true,
     .is_stored = true},
    {.kind = TermKind::friction,
     .is_in = [](const PotentialTerms<Dim>& terms) { return terms.contact.has_friction(); },
     .energy = EnergyEntry::friction,
     .force = ForceEntry::friction,
     .in_predictions = InPredictions::left_out,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; },
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .needs_velocities = true,
     .is_between_bodies = true},
    {.kind = TermKind::adhesive_friction,
     .is_in =
         [](const PotentialTerms<Dim>& terms) {
           const AdhesionOptions& adhesion = terms.contact.adhesion;
           return terms.contact.has_adhesion() && adhesion.tangential_coefficient > 0 && adhesion.iterations != 0;
         },
     .energy = EnergyEntry::friction,
     .force = ForceEntry::friction,
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .needs_velocities = true,
     .is_between_bodies = true},
    {.kind = TermKind::pressure,
     .is_in = [](const PotentialTerms<Dim>& terms) { return !terms.loads.pressures.empty(); },
     .energy = EnergyEntry::body,
     .force = ForceEntry::applied,
     .has_no_potential = true},
    {.kind = TermKind::cavity,  // on the whole mesh; in patches it is a pressure
     .is_in = [](const PotentialTerms<Dim>& terms) { return !terms.loads.cavities.empty(); },
     .energy = EnergyEntry::body,
     .force = ForceEntry::applied},
    {.kind = TermKind::tie,  // quadratic in the gaps of what is bonded, less what its multipliers add
     .is_in = [](const PotentialTerms<Dim>& terms) { return static_cast<bool>(terms.tie); },
     .energy = EnergyEntry::elastic,
     .force = ForceEntry::contact,
     .is_bounded = [](const PotentialTerms<Dim>&) { return true; }},
    {.kind = TermKind::damping,
     .is_in = [](const PotentialTerms<Dim>& terms) { return has_damping(terms, DampingOptions::Term::elastic); },
     .energy = EnergyEntry::damping,
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .needs_velocities = true},
    {.kind = TermKind::contact_damping,  // bodies and obstacles exert it on each other, as they do contact
     .is_in =
         [](const PotentialTerms<Dim>& terms) {
           return terms.contact.enabled && has_damping(terms, DampingOptions::Term::contact);
         },
     .energy = EnergyEntry::damping,
     .force = ForceEntry::contact,
     .needs_facets = [](const PotentialTerms<Dim>&) { return false; },
     .needs_velocities = true,
     .is_between_bodies = true},
}};

static_assert([] {
  for (std::size_t i = 0; i < kNumTermKinds; ++i)
    if (kTerms<2>[i].kind != static_cast<TermKind>(i) || kTerms<3>[i].kind != static_cast<TermKind>(i)) return false;
  return true;
}());

template <int Dim>
constexpr const TermTraits<Dim>& traits(TermKind kind) {
  return kTerms<Dim>[static_cast<std::size_t>(kind)];
}
template <int Dim>
bool is_in(TermKind kind, const PotentialTerms<Dim>& terms) {
  return traits<Dim>(kind).is_in(terms);
}

/// Whether `f` holds for a term that acts. The loop is one expression of constants, which compilers reduce to a few tests.
template <int Dim, typename F>
bool any_term(const PotentialTerms<Dim>& terms, const F& f) {
  return [&]<std::size_t... I>(std::index_sequence<I...>) {
    return (... || (f(kTerms<Dim>[I]) && kTerms<Dim>[I].is_in(terms)));
  }
  (std::make_index_sequence<kNumTermKinds>());
}

/// Whether predictions of gains know of all terms that act.
template <int Dim>
bool is_predictable(const PotentialTerms<Dim>& terms) {
  return !terms.axisymmetric &&  // of which CellModel knows nothing
         !any_term(terms, [](const TermTraits<Dim>& term) { return term.in_predictions == InPredictions::unknown; });
}

/// Whether all terms that act are known to be never negative, constants aside.
template <int Dim>
bool is_bounded(const PotentialTerms<Dim>& terms) {
  return !any_term(terms, [&](const TermTraits<Dim>& term) { return !term.is_bounded || !term.is_bounded(terms); });
}

/// Whether a term needs the facets of the boundary.
template <int Dim>
bool needs_facets(const PotentialTerms<Dim>& terms) {
  return any_term(terms, [&](const TermTraits<Dim>& term) { return term.needs_facets(terms); });
}

/// Whether a term needs velocities; `has_surface`: whether terms between bodies count.
template <int Dim>
bool needs_velocities(const PotentialTerms<Dim>& terms, bool has_surface = true) {
  return any_term(
      terms, [&](const TermTraits<Dim>& term) { return term.needs_velocities && (has_surface || !term.is_between_bodies); });
}

}  // namespace itr
