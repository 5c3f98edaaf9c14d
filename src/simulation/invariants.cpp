// SPDX-License-Identifier: MIT
#include "itr/simulation/invariants.hpp"

#include "itr/mesh/validate.hpp"
#include "itr/simulation/contact_surface.hpp"

namespace itr {

template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x) {
  if (const CellId c = find_inverted<Dim>(mesh, x); c != kNone) return "cell " + std::to_string(c) + " is inverted";
  if (!setup.contact.enabled) return {};
  const ContactSurface<Dim> contact = contact_surface(setup, mesh);
  if (has_intersection<Dim>(contact.surface, contact.positions(x))) return "surfaces intersect";
  if (setup.proxy) return {};  // where that is, bodies may overlap
  const ClosedSurface<Dim> boundary = boundary_at(mesh, x);
  if (!boundary.nested().empty()) return "a body is inside of another";
  for (Eigen::Index i = Dim * mesh.vertex_slots(); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0)
      return "an obstacle is inside of a body";
  return {};
}

template std::string find_violation(const StepSetup<2>&, const Mesh<2>&, const VectorX&);
template std::string find_violation(const StepSetup<3>&, const Mesh<3>&, const VectorX&);

}  // namespace itr
