// SPDX-License-Identifier: MIT
// Terms, loads and held dofs of one time step, as functions of the setup and the time.
#pragma once

#include <map>
#include <vector>

#include "energy/mortar.hpp"
#include "energy/softening.hpp"
#include "energy/terms.hpp"
#include "energy/viscous.hpp"
#include "fem/held_rule.hpp"
#include "itr/setup.hpp"
#include "time/integrator.hpp"

namespace itr {

/// Loads of a setup at time t.
template <int Dim>
Loads<Dim> loads_at(const StepSetup<Dim>& setup, double t);

/// Materials of a setup at time t.
template <int Dim>
std::map<int, Material> materials_at(const StepSetup<Dim>& setup, double t);

/// The part that the past of viscoelastic bodies has in the step that ends at time t; null where there are none. In statics
/// all that relaxes has done so.
template <int Dim>
std::shared_ptr<const ViscousStep<Dim>> viscous_step(const StepSetup<Dim>& setup, const History& history, double t);

/// The step of softening bodies; null where there are none.
template <int Dim>
std::shared_ptr<const SofteningStep<Dim>> softening_step(const StepSetup<Dim>& setup, const History& history);

/// Terms that act in the step that ends at time t, as every scope of it sees them.
template <int Dim>
PotentialTerms<Dim> potential_terms(const StepSetup<Dim>& setup, const History& history, double t, bool is_axisymmetric);

/// Which dofs of nodes are held (Dirichlet and obstacles) and where they are to be at time t. HeldRule says which condition
/// counts where there are several.
template <int Dim>
struct HeldDofs {
  std::vector<char> held;
  VectorX target;  ///< only entries of held dofs mean anything
};
/// The first condition of each tag.
template <int Dim>
using ConditionsByTag = std::map<int, const DirichletCondition<Dim>*>;
template <int Dim>
ConditionsByTag<Dim> conditions_by_tag(const StepSetup<Dim>& setup);
/// The components that each of these holds.
template <int Dim>
typename HeldRule<Dim>::Components held_components(const StepSetup<Dim>& setup);

template <int Dim>
HeldDofs<Dim> held_dofs(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, double t);

/// The mortars of a setup's ties on `cells`, those of the mesh.
template <int Dim>
std::vector<Mortar<Dim>> mortars_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const CellSet<Dim>& cells);

/// Diagonal of the box of all motions, of bodies and obstacles [m].
template <int Dim>
double relative_motion(const VectorX& motions);

/// Diagonal of the bounding box of the bodies at rest [m].
template <int Dim>
double rest_diagonal(const Mesh<Dim>& mesh);

}  // namespace itr
