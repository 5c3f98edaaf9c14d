// SPDX-License-Identifier: MIT
#include "unsupported.hpp"

#include <algorithm>
#include <span>

#include "energy/elastic/law_table.hpp"
#include "energy/polyfem/ideal_cell.hpp"
#include "energy/rigid_body.hpp"
#include "energy/support.hpp"
#include "itr/core.hpp"

namespace itr {

namespace {

/// Whether edges may be curved, now or later.
template <int Dim>
bool may_curve(const Setup<Dim>& setup) {
  return std::any_of(setup.order.begin(), setup.order.end(), [](const auto& e) { return e.second == 2; }) ||
         (setup.remesh.enabled && setup.remesh.curve.enabled);
}

template <int Dim>
bool has_patches(const Setup<Dim>& setup) {
  return std::ranges::any_of(setup.materials, [](const auto& e) { return e.second.volume == VolumeForm::patches; });
}

template <int Dim>
bool has_ideal_cells(const Setup<Dim>& setup) {
  return std::ranges::any_of(setup.materials, [](const auto& e) { return is_of_ideal_cell(e.second); });
}

template <int Dim>
bool has_springs(const Setup<Dim>& setup) {
  return !springs_of<Dim>(setup.nodal_loads).empty();
}
template <int Dim>
bool has_couplings(const Setup<Dim>& setup) {
  return !couplings_of<Dim>(setup.nodal_loads).empty();
}

template <int Dim>
bool is_periodic(const Setup<Dim>& setup) {
  return std::ranges::any_of(setup.ties, [](const Tie& tie) { return static_cast<bool>(tie.jump); });
}

template <int Dim>
struct Check {
  UnsupportedCombination combination;
  bool (*applies)(const Setup<Dim>&, bool);
};

constexpr const char* kAverages = "/contact/average_gaps";

/// Reasons for which gaps are not averaged.
template <int Dim>
constexpr Check<Dim> kAverageChecks[] = {
    {{kAverages, "averaged gaps in 3D"}, [](const Setup<Dim>&, bool) { return Dim == 3; }},
    {{kAverages, "averaged gaps around an axis"},
     [](const Setup<Dim>& setup, bool) { return setup.mesh.is_axisymmetric(); }},
    {{kAverages, "averaged gaps where the mesh changes"},
     [](const Setup<Dim>& setup, bool) { return setup.remesh.enabled; }},
    {{kAverages, "averaged gaps of quadratic elements"}, [](const Setup<Dim>&, bool curves) { return curves; }},
    {{kAverages, "averaged gaps with obstacles; bodies whose motion is prescribed serve"},
     [](const Setup<Dim>& setup, bool) { return !setup.obstacles.rest.empty(); }},
    {{kAverages, "averaged gaps with a collision mesh"},
     [](const Setup<Dim>& setup, bool) { return setup.proxy && !setup.proxy->retraction; }},
    {{kAverages, "averaged gaps with friction by pair"},
     [](const Setup<Dim>& setup, bool) { return !setup.contact.friction_pairs.empty(); }},
    {{kAverages, "averaged gaps with overlaps to resolve"},
     [](const Setup<Dim>& setup, bool) { return setup.contact.resolve_overlap; }},
    {{kAverages, "averaged gaps with ties"}, [](const Setup<Dim>& setup, bool) { return !setup.ties.empty(); }},
    {{kAverages, "averaged gaps with adhesion"}, [](const Setup<Dim>& setup, bool) { return setup.contact.has_adhesion(); }},
    {{kAverages, "averaged gaps with damping of contact"},
     [](const Setup<Dim>& setup, bool) {
       return std::ranges::any_of(
           setup.damping, [](const DampingOptions& options) { return options.term == DampingOptions::Term::contact; });
     }},
    {{kAverages, "averaged gaps with rigid bodies"},
     [](const Setup<Dim>& setup, bool) { return has_rigid_bodies(setup.materials); }},
    {{kAverages, "averaged gaps with fluids that penetrate"},
     [](const Setup<Dim>& setup, bool) { return !setup.fluids.empty(); }},
    {{kAverages, "averaged gaps with the plain form of contact"},
     [](const Setup<Dim>& setup, bool) { return !setup.contact.convergent; }},
};

template <int Dim>
constexpr Check<Dim> kChecks[] = {
    {{"/contact/collision_mesh", "a collision mesh where the bodies' mesh changes"},
     [](const Setup<Dim>& setup, bool) { return setup.remesh.enabled && setup.proxy; }},
    {{"/contact/initial_overlap", "\"resolve\" with a collision mesh, whose surface has no inside"},
     [](const Setup<Dim>& setup, bool) { return setup.contact.resolve_overlap && setup.proxy; }},
    {{"/contact/initial_overlap", "\"resolve\" with adhesion, which pulls on what is at rest"},
     [](const Setup<Dim>& setup, bool) { return setup.contact.resolve_overlap && setup.contact.has_adhesion(); }},
    {{"/contact/initial_overlap", "\"resolve\" with displacements at the start, /initial_conditions/solution"},
     [](const Setup<Dim>& setup, bool) { return setup.contact.resolve_overlap && !setup.initial_displacement.empty(); }},
    {{"/contact/friction_pairs", "friction by pair where a collision mesh touches"},
     [](const Setup<Dim>& setup, bool) { return !setup.contact.friction_pairs.empty() && setup.proxy; }},
    {{"/output/error_bars", "error bars where the pressure of a cavity follows its volume"},
     [](const Setup<Dim>& setup, bool) { return !setup.cavities.empty() && setup.fields.error_bars; }},
    {{"/output/error_bars", "error bars where surfaces are tied"},
     [](const Setup<Dim>& setup, bool) { return !setup.ties.empty() && setup.fields.error_bars; }},
    {{"/output/error_bars", "error bars where springs or coupled points act"},
     [](const Setup<Dim>& setup, bool) { return setup.fields.error_bars && (has_springs(setup) || has_couplings(setup)); }},
    {{"/contact/initial_overlap", "\"resolve\" with springs or coupled points, which are no part of a start without loads"},
     [](const Setup<Dim>& setup, bool) {
       return setup.contact.resolve_overlap && (has_springs(setup) || has_couplings(setup));
     }},
    {{"/couplings", "coupled points of axisymmetric bodies, whose surfaces only move along the axis in the mean"},
     [](const Setup<Dim>& setup, bool) { return setup.mesh.is_axisymmetric() && has_couplings(setup); }},
    {{"/time/dt", "steps that choose their lengths where there are coupled points"},
     [](const Setup<Dim>& setup, bool) { return setup.time.adaptive.enabled && has_couplings(setup); }},
    {{"/initial_conditions/acceleration", "\"consistent\" where there are coupled points"},
     [](const Setup<Dim>& setup, bool) { return setup.consistent_initial_acceleration && has_couplings(setup); }},
    {{"/ties", "ties where a collision mesh touches"},
     [](const Setup<Dim>& setup, bool) { return !setup.ties.empty() && setup.contact.enabled && setup.proxy; }},
    {{"/ties", "periodic cells with inertia"},
     [](const Setup<Dim>& setup, bool) { return is_periodic(setup) && setup.time.has_inertia(); }},
    {{"/ties", "periodic cells that are axisymmetric"},
     [](const Setup<Dim>& setup, bool) { return is_periodic(setup) && setup.mesh.is_axisymmetric(); }},
    {{"/initial_conditions/acceleration", "\"consistent\" accelerations of bodies that are tied"},
     [](const Setup<Dim>& setup, bool) { return !setup.ties.empty() && setup.consistent_initial_acceleration; }},
    {{"/solver/advanced/lump_mass_matrix",
      "lumped mass with remeshing of quadratic elements (discr_order 2 or curve/enabled)"},
     [](const Setup<Dim>& setup, bool curves) { return setup.remesh.enabled && curves && setup.lump_mass; }},
    {{"/space/remesh/curve/enabled", "curved edges with a sizing field"},
     [](const Setup<Dim>& setup, bool curves) {
       return setup.remesh.enabled && curves && setup.remesh.sizing_field.enabled;
     }},
    {{"terms", "terms of a program's own on quadratic elements"},
     [](const Setup<Dim>& setup, bool curves) { return (!setup.terms.empty() || setup.follower.forces) && curves; }},
    {{"/contact/adhesion", "adhesion where the bodies' mesh changes"},
     [](const Setup<Dim>& setup, bool) { return setup.remesh.enabled && setup.contact.has_adhesion(); }},
    {{"/contact/adhesion", "adhesion in an axisymmetric scene: its pull on a pair is not by the area around the axis"},
     [](const Setup<Dim>& setup, bool) { return setup.mesh.is_axisymmetric() && setup.contact.has_adhesion(); }},
    {{"/materials/*/volume",
      "\"patches\" of quadratic elements where the mesh changes: edits carry constants in cells only"},
     [](const Setup<Dim>& setup, bool curves) { return setup.remesh.enabled && curves && has_patches(setup); }},
    {{"/materials/*/volume", "\"patches\" where a sizing field or energies in cells choose the edits"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && has_patches(setup) &&
              (setup.remesh.sizing_field.enabled || setup.remesh.screening == Screening::energy_percentile);
     }},
    {{"/materials/*/volume", "\"patches\" for a law without a part U(det F), with moduli that vary, or in plane stress"},
     [](const Setup<Dim>& setup, bool) {
       return std::any_of(setup.materials.begin(), setup.materials.end(), [&](const auto& e) {
         return e.second.volume == VolumeForm::patches &&
                !may_average_volume(e.second, setup.mesh.is_axisymmetric() ? 3 : Dim);
       });
     }},
    {{"/materials/*/use_rest_pose", "AMIPS without a rest pose where the mesh changes: its energy depends on the mesh"},
     [](const Setup<Dim>& setup, bool) { return setup.remesh.enabled && has_ideal_cells(setup); }},
    {{"/materials/*/use_rest_pose", "AMIPS without a rest pose in an axisymmetric scene: its ideal cell is no ring"},
     [](const Setup<Dim>& setup, bool) { return setup.mesh.is_axisymmetric() && has_ideal_cells(setup); }},
    {{"/output/error_bars", "error bars where AMIPS has no rest pose: its energy depends on the mesh"},
     [](const Setup<Dim>& setup, bool) { return setup.fields.error_bars && has_ideal_cells(setup); }},
    {{"/axisymmetric", "remeshing of axisymmetric bodies with lumped mass, or by the paper's screening and sizing field"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && setup.mesh.is_axisymmetric() &&
              (setup.lump_mass || setup.remesh.sizing_field.enabled ||
               setup.remesh.screening == Screening::energy_percentile);
     }},
    {{"/materials", "an elasticity_tensor, or a law of a program's own, where axisymmetric bodies are remeshed"},
     [](const Setup<Dim>& setup, bool) {
       return setup.mesh.is_axisymmetric() && setup.remesh.enabled &&
              std::ranges::any_of(setup.materials,
                                  [](const auto& e) { return e.second.law == MaterialLaw::own && !sum_of(e.second); });
     }},
    {{"/materials", "plane stress, or invariants of a plane, in an axisymmetric scene"},
     [](const Setup<Dim>& setup, bool) {
       return setup.mesh.is_axisymmetric() && std::ranges::any_of(setup.materials, [](const auto& e) {
                const LawSum* sum = sum_of(e.second);
                return sum && (sum->is_plane_stress || sum->dimension == 2);
              });
     }},
    {{"/materials/*/prony", "viscoelasticity in plane stress, or of a law of which no part is known to be the deviator's"},
     [](const Setup<Dim>& setup, bool) {
       return std::ranges::any_of(setup.materials, [&](const auto& e) {
         return !e.second.prony.empty() && !why_not_viscous(e.second, setup.mesh.is_axisymmetric() ? 3 : Dim).empty();
       });
     }},
    {{"/materials/*/mullins",
      "softening beside prony or an eigenstrain, in plane stress, or of a law of which no part is known to be isochoric"},
     [](const Setup<Dim>& setup, bool) {
       return std::ranges::any_of(setup.materials, [&](const auto& e) {
         return e.second.mullins && !why_not_softening(e.second, setup.mesh.is_axisymmetric() ? 3 : Dim).empty();
       });
     }},
    {{"/geometry/*/rigid", "a rigid body in an axisymmetric scene"},
     [](const Setup<Dim>& setup, bool) { return setup.mesh.is_axisymmetric() && has_rigid_bodies(setup.materials); }},
    {{"/geometry/*/rigid", "a rigid body with quadratic elements (discr_order 2 of its id)"},
     [](const Setup<Dim>& setup, bool) {
       return std::ranges::any_of(setup.order, [&](const auto& entry) {
         const auto material = setup.materials.find(entry.first);
         return entry.second == 2 && material != setup.materials.end() && rigid_body_of(material->second);
       });
     }},
    {{"/output/error_bars", "error bars where there are rigid bodies"},
     [](const Setup<Dim>& setup, bool) { return setup.fields.error_bars && has_rigid_bodies(setup.materials); }},
    {{"/time/dt", "steps that choose their lengths where there are rigid bodies"},
     [](const Setup<Dim>& setup, bool) { return setup.time.adaptive.enabled && has_rigid_bodies(setup.materials); }},
    {{"/initial_conditions/acceleration", "\"consistent\" where there are rigid bodies"},
     [](const Setup<Dim>& setup, bool) {
       return setup.consistent_initial_acceleration && has_rigid_bodies(setup.materials);
     }},
    {{"/shapes", "shapes where bodies are viscoelastic or soften: their state has none for new material"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && !setup.shapes.empty() &&
              std::ranges::any_of(setup.materials, [](const auto& e) { return has_memory(e.second); });
     }},
    {{"/materials", "a density that varies in space where the mesh changes"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && std::any_of(setup.materials.begin(), setup.materials.end(),
                                                  [](const auto& e) { return bool(e.second.density_at); });
     }},
};

template <int Dim>
void refuse(const Setup<Dim>& setup, bool curves) {
  const auto refuse_any = [&](std::span<const Check<Dim>> checks) {
    for (const auto& [combination, applies] : checks)
      if (applies(setup, curves))
        throw InputError({"", combination.place, combination.words, "something that this version supports"});
  };
  if (setup.contact.average_gaps) refuse_any(kAverageChecks<Dim>);
  refuse_any(kChecks<Dim>);
}

}  // namespace

std::vector<UnsupportedCombination> unsupported_combinations() {
  std::vector<UnsupportedCombination> combinations;
  for (const auto& check : kAverageChecks<2>) combinations.push_back(check.combination);
  for (const auto& check : kChecks<2>) combinations.push_back(check.combination);
  return combinations;
}

template <int Dim>
bool can_average_gaps(const Setup<Dim>& setup) {
  return std::ranges::none_of(kAverageChecks<Dim>,
                              [&](const Check<Dim>& check) { return check.applies(setup, may_curve(setup)); });
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup) {
  refuse(setup, may_curve(setup));
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup, const State<Dim>& state) {
  refuse(setup, state.mesh.has_nodes());
}

template bool can_average_gaps(const Setup<2>&);
template bool can_average_gaps(const Setup<3>&);
template void refuse_unsupported(const Setup<2>&);
template void refuse_unsupported(const Setup<3>&);
template void refuse_unsupported(const Setup<2>&, const State<2>&);
template void refuse_unsupported(const Setup<3>&, const State<3>&);

}  // namespace itr
