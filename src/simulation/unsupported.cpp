// SPDX-License-Identifier: MIT
#include "unsupported.hpp"

#include <algorithm>
#include <string>

#include "itr/core/error.hpp"

namespace itr {

namespace {

/// Where edges are curved now or may be later.
struct Curves {
  bool anywhere, on_surface;
};

template <int Dim>
Curves curves_of(const Setup<Dim>& setup) {
  const bool is_quadratic = std::any_of(setup.order.begin(), setup.order.end(), [](const auto& e) { return e.second == 2; });
  return {is_quadratic || (setup.remesh.enabled && setup.remesh.curve.enabled), is_quadratic};
}

template <int Dim>
bool has_curved_surface(const State<Dim>& state) {
  for (FacetId f = 0; f < state.mesh.facet_slots(); ++f)
    for (const VertexId a : state.mesh.facet(f))
      for (const VertexId b : state.mesh.facet(f))
        if (a < b && state.space.find(a, b) != kNone) return true;
  return false;
}

template <int Dim>
struct Check {
  UnsupportedCombination combination;
  bool (*applies)(const Setup<Dim>&, const Curves&);
};

template <int Dim>
constexpr Check<Dim> kChecks[] = {
    {{"/contact/collision_mesh", "a collision mesh where the bodies' mesh changes"},
     [](const Setup<Dim>& setup, const Curves&) { return setup.remesh.enabled && setup.proxy; }},
    {{"/space/remesh/enabled", "remeshing of quadratic elements (discr_order 2) in a scene with contact"},
     [](const Setup<Dim>& setup, const Curves& curves) {
       return setup.remesh.enabled && curves.on_surface && setup.contact.enabled;
     }},
    {{"/solver/advanced/lump_mass_matrix",
      "lumped mass with remeshing of quadratic elements (discr_order 2 or curve/enabled)"},
     [](const Setup<Dim>& setup, const Curves& curves) {
       return setup.remesh.enabled && curves.anywhere && setup.lump_mass;
     }},
    {{"/space/remesh/curve/enabled", "curved edges with a sizing field"},
     [](const Setup<Dim>& setup, const Curves&) {
       return setup.remesh.enabled && setup.remesh.curve.enabled && setup.remesh.sizing_field.enabled;
     }},
    {{"terms", "terms of a program's own on quadratic elements"},
     [](const Setup<Dim>& setup, const Curves& curves) {
       return (!setup.terms.empty() || setup.follower.forces) && curves.anywhere;
     }},
    {{"/materials", "a density that varies in space where the mesh changes"},
     [](const Setup<Dim>& setup, const Curves&) {
       return setup.remesh.enabled && std::any_of(setup.materials.begin(), setup.materials.end(),
                                                  [](const auto& e) { return bool(e.second.density_at); });
     }},
};

template <int Dim>
void refuse(const Setup<Dim>& setup, const Curves& curves) {
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
  refuse(setup, curves_of(setup));
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup, const State<Dim>& state) {
  refuse(setup, {!state.space.is_linear(), has_curved_surface(state)});
}

template void refuse_unsupported(const Setup<2>&);
template void refuse_unsupported(const Setup<3>&);
template void refuse_unsupported(const Setup<2>&, const State<2>&);
template void refuse_unsupported(const Setup<3>&, const State<3>&);

}  // namespace itr
