// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

#include "itr/setup.hpp"

namespace itr {

/// Barrier stiffness that suits bodies of a modulus [Pa]: gaps of about dhat / 2 where they are strained by a tenth.
template <int Dim>
double barrier_stiffness_for(const Setup<Dim>& setup, const ContactOptions& contact, double modulus);

/// A scene's unit of barrier stiffness in SI units: the plain form's barrier is in m^4.
inline double barrier_unit(const Units& units, const ContactOptions& contact) {
  return contact.convergent ? units.factor("Pa") : units.factor("J") / std::pow(units.factor("m"), 4);
}

}  // namespace itr
