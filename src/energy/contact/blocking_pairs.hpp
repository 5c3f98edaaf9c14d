// SPDX-License-Identifier: MIT
#pragma once

#include "candidates.hpp"
#include "energy/blocking.hpp"

namespace itr {

/// Adds to `blocking` the pairs that stop `fraction` of a motion dx from x, and bounds the gaps of all of its pairs at the
/// end of dx. `candidates` are those of that fraction. Returns false where pairs are too many, and `blocking` takes none
/// then.
template <int Dim>
bool find_blocking_pairs(const CollisionSurface& surface, const ContactCandidates<Dim>& candidates, ConstVectorView x,
                         ConstVectorView dx, double fraction, double dhat, BlockingPairs& blocking);

}  // namespace itr
