// SPDX-License-Identifier: MIT
#include "simulation/invariants.hpp"

#include "fem/inverted.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x, const ChordLevels& chords) {
  if (const CellId c = find_inverted(mesh, x); c != kNone) return "cell " + std::to_string(c) + " is inverted";
  if (!setup.contact.enabled) return {};
  const ContactSurface<Dim> contact = contact_surface(setup, mesh, chords);
  if (has_intersection<Dim>(contact.surface, contact.positions(x))) return "surfaces intersect";
  if (setup.proxy) return {};  // where that is, bodies may overlap
  const ClosedSurface<Dim> boundary = body_boundary(mesh, x, chords);
  if (!boundary.nested().empty()) return "a body is inside of another";
  for (Eigen::Index i = Dim * mesh.num_nodes(); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0)
      return "an obstacle is inside of a body";
  return {};
}

template std::string find_violation(const StepSetup<2>&, const Mesh<2>&, const VectorX&, const ChordLevels&);
template std::string find_violation(const StepSetup<3>&, const Mesh<3>&, const VectorX&, const ChordLevels&);

}  // namespace itr
