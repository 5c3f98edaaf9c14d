// SPDX-License-Identifier: MIT
#include "geometric_contact.hpp"

#include <algorithm>
#include <string>

#include "../defaults.hpp"
#include "energy/polyfem/geometric_contact.hpp"

namespace itr::scene {

namespace {

/// Refuses keys that it does not go with.
template <int Dim>
void refuse_others(const Node& root, const Setup<Dim>& setup) {
  const Node asked = root["contact"]["use_gcp_formulation"];
  const auto refuse_if = [&](bool is_there, const char* what) {
    if (is_there) asked.fail(std::string("true ") + what, "false there");
  };
  refuse_if(!is_polyfem_set(root), "with other defaults than PolyFEM's, which have IPC's contact");
  refuse_if(Dim == 3, "in 3D, where faces and edges have other terms");
  refuse_if(setup.mesh.is_axisymmetric(), "in an axisymmetric scene");
  refuse_if(setup.remesh.enabled, "where the mesh changes");
  refuse_if(std::ranges::any_of(setup.order, [](const auto& e) { return e.second > 1; }), "with quadratic elements");
  refuse_if(!setup.obstacles.rest.empty(), "with obstacles, which have no inside; bodies that are held do");
  refuse_if(setup.proxy.has_value(), "with a collision mesh");
  refuse_if(setup.contact.has_friction(), "with friction");
  refuse_if(setup.contact.has_adhesion(), "with adhesion");
  refuse_if(setup.contact.convergent, "with use_convergent_formulation");
  refuse_if(setup.contact.resolve_overlap, "with overlaps to resolve");
  refuse_if(setup.contact.adaptive_stiffness, "without a number for /solver/contact/barrier_stiffness");
  refuse_if(setup.fields.error_bars, "with error bars");
}

}  // namespace

template <int Dim>
void read_geometric_contact(const Node& root, Setup<Dim>& setup) {
  constexpr double kGuard = 1e-9;
  const Node contact = root["contact"], adaptive = contact["use_adaptive_dhat"];
  if (!setup.contact.enabled || !contact["use_gcp_formulation"].boolean(false)) return;
  refuse_others(root, setup);
  if (adaptive.boolean(false)) adaptive.fail("false: all surfaces have one dhat");
  GeometricContactOptions options{.dhat = setup.contact.dhat};
  options.stiffness = root.document().units.factor("Pa") * root["solver"]["contact"]["barrier_stiffness"].positive(1);
  const auto read_sine = [&](const char* key, double& sine) {
    sine = contact[key].positive(sine);
    if (!(sine <= 1)) contact[key].fail("a number of (0, 1]");
  };
  read_sine("alpha_t", options.tangent);
  read_sine("alpha_n", options.normal);
  // IPC's barrier stays behind it where it does not act, a billionth of its forces.
  setup.contact.barrier_stiffness = kGuard * options.stiffness / (options.dhat * options.dhat);
  if constexpr (Dim == 2)
    setup.terms.push_back([options](const CellSet<2>& cells, double, double scale) {
      return std::make_shared<const GeometricContact>(cells, options, scale);
    });
}

template void read_geometric_contact(const Node&, Setup<2>&);
template void read_geometric_contact(const Node&, Setup<3>&);

}  // namespace itr::scene
