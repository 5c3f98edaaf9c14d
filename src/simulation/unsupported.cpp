// SPDX-License-Identifier: MIT
#include "unsupported.hpp"

#include <algorithm>

#include "energy/elastic/law_table.hpp"
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
struct Check {
  UnsupportedCombination combination;
  bool (*applies)(const Setup<Dim>&, bool);
};

template <int Dim>
constexpr Check<Dim> kChecks[] = {
    {{"/contact/collision_mesh", "a collision mesh where the bodies' mesh changes"},
     [](const Setup<Dim>& setup, bool) { return setup.remesh.enabled && setup.proxy; }},
    {{"/contact/friction_pairs", "friction by pair where a collision mesh touches"},
     [](const Setup<Dim>& setup, bool) { return !setup.contact.friction_pairs.empty() && setup.proxy; }},
    {{"/output/error_bars", "error bars where the pressure of a cavity follows its volume"},
     [](const Setup<Dim>& setup, bool) { return !setup.cavities.empty() && setup.fields.error_bars; }},
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
    {{"/materials/*/volume", "\"patches\" where the mesh changes: a gain by fewer patches would not be one of the mesh"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && std::any_of(setup.materials.begin(), setup.materials.end(),
                                                  [](const auto& e) { return e.second.volume == VolumeForm::patches; });
     }},
    {{"/materials/*/volume", "\"patches\" for a law without a part U(det F), with moduli that vary, or in plane stress"},
     [](const Setup<Dim>& setup, bool) {
       return std::any_of(setup.materials.begin(), setup.materials.end(), [](const auto& e) {
         return e.second.volume == VolumeForm::patches && !may_average_volume(e.second, Dim);
       });
     }},
    {{"/materials", "a density that varies in space where the mesh changes"},
     [](const Setup<Dim>& setup, bool) {
       return setup.remesh.enabled && std::any_of(setup.materials.begin(), setup.materials.end(),
                                                  [](const auto& e) { return bool(e.second.density_at); });
     }},
};

template <int Dim>
void refuse(const Setup<Dim>& setup, bool curves) {
  for (const auto& [combination, applies] : kChecks<Dim>)
    if (applies(setup, curves))
      throw InputError({"", combination.place, combination.words, "something that this version supports"});
}

}  // namespace

std::vector<UnsupportedCombination> unsupported_combinations() {
  std::vector<UnsupportedCombination> combinations;
  for (const auto& check : kChecks<2>) combinations.push_back(check.combination);
  return combinations;
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup) {
  refuse(setup, may_curve(setup));
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup, const State<Dim>& state) {
  refuse(setup, state.mesh.has_nodes());
}

template void refuse_unsupported(const Setup<2>&);
template void refuse_unsupported(const Setup<3>&);
template void refuse_unsupported(const Setup<2>&, const State<2>&);
template void refuse_unsupported(const Setup<3>&, const State<3>&);

}  // namespace itr
