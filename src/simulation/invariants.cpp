// SPDX-License-Identifier: MIT
#include "simulation/invariants.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "fem/inverted.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

namespace {

/// `overlap`: by how much where, or infinitely much of edges.
template <int Dim>
std::string pressed_faces(const Overlap<Dim>& overlap, double dhat, const Units& units) {
  const Vec<Dim> place = overlap.place / units.factor("m");
  return fmt::format(
      "faces that coincide at rest are pressed into each other, by {}more than d-hat, {}, at ({:.4g}): contact acts between "
      "them only once they have been apart by d-hat; where they are to be pressed together, leave a gap between them, "
      "or take \"contact\": {{\"initial_overlap\": \"resolve\"}} if they are of two bodies",
      std::isfinite(overlap.depth) ? units.text(overlap.depth, "m", 3) + ", " : "", units.text(dhat, "m", 3),
      fmt::join(place, ", "));
}

template <int Dim>
bool is_closed_pair(const CollisionSurface& surface, const std::array<int, 2>& pair) {
  const auto& edge = surface.edges[pair[0]];
  if constexpr (Dim == 2)
    return surface.closed.exclude<2>(edge, surface.edges[pair[1]]);
  else
    return surface.closed.exclude<3>(edge, surface.triangles[pair[1]]);
}

}  // namespace

template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x, const ChordLevels& chords,
                           int age) {
  if (const CellId c = find_inverted(mesh, x); c != kNone) return "cell " + std::to_string(c) + " is inverted";
  if (!setup.contact.enabled) return {};
  const ContactSurface<Dim> contact = contact_surface(setup, mesh, chords, age);
  const VectorX y = contact.positions(x);
  if (setup.proxy)  // where that is, bodies may overlap
    return has_intersection<Dim>(contact.surface, y) ? "surfaces intersect" : "";
  const ClosedSurface<Dim> boundary = body_boundary(mesh, x, chords);
  const double dhat = setup.contact.reach_of_closed();
  const bool has_closed = !contact.surface.closed.empty();
  const auto overlap = has_closed ? boundary.find_overlap(contact.surface.closed) : Overlap<Dim>{};
  if (overlap.depth > dhat && std::isfinite(overlap.depth)) return pressed_faces(overlap, dhat, setup.units);
  if (!setup.ties.empty() && !has_only_tied_faces(setup, mesh))  // which may not reach as far as ties
    if (const auto untied = find_overlap(setup, mesh, contact, boundary);
        untied.depth > setup.contact.dhat && std::isfinite(untied.depth))
      return pressed_faces(untied, setup.contact.dhat, setup.units);
  if (const auto pairs = find_intersections<Dim>(contact.surface, y, 1); !pairs.empty()) {
    if (!is_closed_pair<Dim>(contact.surface, pairs[0])) return "surfaces intersect";
    const int vertex = contact.surface.edges[pairs[0][0]][0];
    return pressed_faces<Dim>({std::numeric_limits<double>::infinity(), y.segment<Dim>(Dim * vertex)}, dhat, setup.units);
  }
  if (has_closed ? overlap.depth > dhat : !boundary.nested().empty()) return "a body is inside of another";
  for (Eigen::Index i = Dim * mesh.num_nodes(); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0)
      return "an obstacle is inside of a body";
  return {};
}

template std::string find_violation(const StepSetup<2>&, const Mesh<2>&, const VectorX&, const ChordLevels&, int);
template std::string find_violation(const StepSetup<3>&, const Mesh<3>&, const VectorX&, const ChordLevels&, int);

}  // namespace itr
