// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/setup.hpp"

namespace itr {

/// Adds a sentence for each two Dirichlet conditions that ask for different displacements of a vertex which both hold: that
/// of the larger id counts, and that of points before that of surfaces (see HeldRule).
template <int Dim>
void find_contradictions(const Setup<Dim>& setup, std::vector<std::string>& found);

}  // namespace itr
