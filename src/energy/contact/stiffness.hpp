// SPDX-License-Identifier: MIT
// Barrier stiffness that follows the scene (docs/theory.md, "Barrier stiffness", after IPC's supplement): large enough for
// gaps that round-off can resolve, small enough for Newton, and doubled while contacts close below a billionth of the scene.
#pragma once

#include <limits>

#include "energy/contact/contact.hpp"
#include "fem/vertex_map.hpp"

namespace itr {

/// State that the schedule carries from solve to solve and step to step.
struct BarrierStiffness {
  double value = 1;  ///< kappa
  double largest = std::numeric_limits<double>::infinity();
  double previous_squared_distance = -1;  ///< smallest one of the active pairs after the last Newton step [m^2]
};

template <int Dim>
class AdaptiveStiffness {
 public:
  /// `average_mass`: the sum of all entries of the mass matrix by its number of rows [kg]; 1 in statics. `scale`: alpha h^2.
  /// `map`: from the dofs to the vertices of the surface, null where they are the same. It and the surface must outlive
  /// this.
  AdaptiveStiffness(const CollisionSurface& surface, const ContactOptions& options, double average_mass, double scale,
                    const VertexMap<Dim>* map = nullptr);

  /// Balances the barrier at the positions x of the surface against `gradient`, that of all other terms there (of all dofs,
  /// also held ones).
  void initialize(ConstVectorView x, const VectorX& gradient, BarrierStiffness& stiffness, Workspace& workspace) const;
  /// After a Newton step to the positions x of the surface: whether the stiffness was doubled.
  bool update(ConstVectorView x, BarrierStiffness& stiffness, Workspace& workspace) const;

 private:
  double bounding_diagonal(ConstVectorView x) const;

  const CollisionSurface& surface_;
  ContactEnergy<Dim> plain_;   ///< both of stiffness and scale 1
  ContactEnergy<Dim> actual_;  ///< in the scene's form
  double dhat_;
  bool convergent_;
  double average_mass_;
  double scale_;
  const VertexMap<Dim>* map_;
};

}  // namespace itr
