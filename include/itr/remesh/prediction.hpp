// SPDX-License-Identifier: MIT
#pragma once

#include "itr/remesh/fields.hpp"

namespace itr {

/// What splitting an edge is predicted to gain [J, times the scaling], contact left out; infinite where it cannot tell.
struct SplitPrediction {
  double of_vertex;  ///< the decrease 1/2 g^T H^-1 g that the new vertex alone brings (one 2 x 2 system)
  double at_most;    ///< times the factor by which a whole patch was seen to gain more: it grows towards incompressibility
};

SplitPrediction predict_split(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                              const EdgeKey& edge);

}  // namespace itr
