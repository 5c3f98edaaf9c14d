// SPDX-License-Identifier: MIT
#include "simulation/invariants.hpp"

#include "itr/fem/cell_set.hpp"
#include "itr/geometry/quadratic_validity.hpp"
#include "mesh/validate.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

namespace {

/// The first cell that is not positively oriented everywhere; kNone: none.
template <int Dim>
CellId find_inverted(const Mesh<Dim>& mesh, ConstVectorView x, const Space& space) {
  if (space.is_linear()) return find_inverted(mesh, x);
  const CellSet<Dim> cells = whole_mesh(mesh, {}, space);
  std::vector<char> is_curved(mesh.cell_slots(), 0);
  for (const auto& element : cells.curved_elements) {
    is_curved[element.cell] = 1;
    if (!is_positive_everywhere_exact<Dim>(at_all_nodes<Dim>(element, x))) return element.cell;
  }
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (!is_curved[c] && !is_positively_oriented<Dim>(mesh.cell(c), x)) return c;
  return kNone;
}

}  // namespace

template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x, const Space& space) {
  if (const CellId c = find_inverted(mesh, x, space); c != kNone) return "cell " + std::to_string(c) + " is inverted";
  if (!setup.contact.enabled) return {};
  const ContactSurface<Dim> contact = contact_surface(setup, mesh, space);
  if (has_intersection<Dim>(contact.surface, contact.positions(x))) return "surfaces intersect";
  if (setup.proxy) return {};  // where that is, bodies may overlap
  const ClosedSurface<Dim> boundary = body_boundary(mesh, x, space);
  if (!boundary.nested().empty()) return "a body is inside of another";
  for (Eigen::Index i = Dim * num_nodes(mesh, space); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0)
      return "an obstacle is inside of a body";
  return {};
}

template std::string find_violation(const StepSetup<2>&, const Mesh<2>&, const VectorX&, const Space&);
template std::string find_violation(const StepSetup<3>&, const Mesh<3>&, const VectorX&, const Space&);

}  // namespace itr
