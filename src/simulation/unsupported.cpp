// SPDX-License-Identifier: MIT
#include "unsupported.hpp"

#include <algorithm>
#include <string>

#include "itr/core/error.hpp"

namespace itr {

namespace {

template <int Dim>
bool is_quadratic(const Setup<Dim>& setup) {
  return std::any_of(setup.order.begin(), setup.order.end(), [](const auto& e) { return e.second == 2; });
}

/// Whether edges are curved now or may be later.
template <int Dim>
bool may_be_quadratic(const Setup<Dim>& setup) {
  return is_quadratic(setup) || (setup.remesh.enabled && setup.remesh.curve.enabled);
}

template <int Dim>
struct Check {
  UnsupportedCombination combination;
  bool (*applies)(const Setup<Dim>&);
};

template <int Dim>
constexpr Check<Dim> kChecks[] = {
    {{"/contact/collision_mesh", "a collision mesh where the bodies' mesh changes"},
     [](const Setup<Dim>& setup) { return setup.remesh.enabled && setup.proxy; }},
    {{"/solver/advanced/lump_mass_matrix", "lumped mass where remeshing splits or makes curved edges"},
     [](const Setup<Dim>& setup) { return setup.remesh.enabled && may_be_quadratic(setup) && setup.lump_mass; }},
    {{"/space/remesh/curve/enabled", "curved edges with a sizing field"},
     [](const Setup<Dim>& setup) {
       return setup.remesh.enabled && setup.remesh.curve.enabled && setup.remesh.sizing_field.enabled;
     }},
    {{"terms", "terms of a program's own on quadratic elements"},
     [](const Setup<Dim>& setup) { return (!setup.terms.empty() || setup.follower.forces) && may_be_quadratic(setup); }},
    {{"/materials", "a density that varies in space where the mesh changes"},
     [](const Setup<Dim>& setup) {
       return setup.remesh.enabled && std::any_of(setup.materials.begin(), setup.materials.end(),
                                                  [](const auto& e) { return bool(e.second.density_at); });
     }},
};

}  // namespace

std::vector<UnsupportedCombination> unsupported_combinations() {
  std::vector<UnsupportedCombination> combinations;
  for (const auto& check : kChecks<2>) combinations.push_back(check.combination);
  return combinations;
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup) {
  for (const auto& [combination, applies] : kChecks<Dim>)
    if (applies(setup)) throw InputError({"", combination.place, combination.words, "something that this version supports"});
}

template void refuse_unsupported(const Setup<2>&);
template void refuse_unsupported(const Setup<3>&);

}  // namespace itr
