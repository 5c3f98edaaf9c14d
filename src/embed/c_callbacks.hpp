// SPDX-License-Identifier: MIT
// Functions of itr.h as those of the facade, for C and for what hands in compiled functions (Python).
#pragma once

#include <memory>

#include "itr/itr.h"
#include "itr/itr.hpp"

namespace itr {

/// Both throw InputError where a function is missing. `user` comes back with each call.
std::shared_ptr<const OwnLaw> law_of(const itr_law& law, void* user);
HostTerm term_of(const itr_term& term, void* user);
/// Null where the function is. Forces and positions have `dimension` numbers a vertex.
AnySimulation::ForceFunction forces_of(itr_force_function forces, int dimension, void* user);
AnySimulation::StiffnessFunction stiffness_of(itr_stiffness_function stiffness, int dimension, void* user);

}  // namespace itr
