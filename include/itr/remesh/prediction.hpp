// SPDX-License-Identifier: MIT
#pragma once

#include "itr/remesh/fields.hpp"

namespace itr {

/// An estimate from above of what splitting an edge can gain [J, times the scaling], for leaving out trials that cannot be
/// accepted: the decrease 1/2 g^T H^-1 g of the new vertex alone (one 2 x 2 system; contact left out), times a factor by
/// which a whole patch was seen to gain more, which grows towards incompressibility (design §4). Infinity where it cannot
/// tell.
double predicted_split_gain(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                            const EdgeKey& edge);

}  // namespace itr
