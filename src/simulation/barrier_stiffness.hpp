// SPDX-License-Identifier: MIT
#pragma once

#include "itr/simulation/setup.hpp"

namespace itr {

/// Barrier stiffness that suits bodies of a modulus [Pa]: gaps of about dhat / 2 where they are strained by a tenth.
template <int Dim>
double barrier_stiffness_for(const Setup<Dim>& setup, const ContactOptions& contact, double modulus);

}  // namespace itr
