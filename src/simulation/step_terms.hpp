// SPDX-License-Identifier: MIT
// Terms, loads and held dofs of one time step, as functions of the setup and the time.
#pragma once

#include <vector>

#include "itr/energy/terms.hpp"
#include "itr/fem/space.hpp"
#include "itr/simulation/setup.hpp"
#include "itr/time/integrator.hpp"

namespace itr {

/// Loads of a setup at time t.
template <int Dim>
Loads<Dim> loads_at(const StepSetup<Dim>& setup, double t);

/// Terms that act in the step that ends at time t, as every scope of it sees them.
template <int Dim>
PotentialTerms<Dim> potential_terms(const StepSetup<Dim>& setup, const History& history, double t);

/// Which dofs of nodes are held (Dirichlet and obstacles) and where they are to be at time t. At vertices shared by two
/// conditions the one with the larger tag wins.
template <int Dim>
struct HeldDofs {
  std::vector<char> held;
  VectorX target;  ///< only entries of held dofs mean anything
};
/// The first condition of each tag, in the order in which later ones win.
template <int Dim>
std::vector<const DirichletCondition<Dim>*> conditions_by_tag(const StepSetup<Dim>& setup);

template <int Dim>
HeldDofs<Dim> held_dofs(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, double t, const Space& space = {});

/// Diagonal of the bounding box of the bodies at rest [m].
template <int Dim>
double rest_diagonal(const Mesh<Dim>& mesh);

}  // namespace itr
