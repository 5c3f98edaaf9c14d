// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include "itr/remesh/fields.hpp"

namespace itr {

/// What splitting an edge is predicted to gain [J, times the scaling], contact left out; infinite where it cannot tell.
/// By what factor a relaxed patch was seen to gain more than the new vertex alone, without contact: 99 of 100 times less
/// (verification/paper); it grows towards incompressibility.
inline double patch_over_vertex(double poisson_ratio) { return std::max(3.0, 1 / (1 - 2 * poisson_ratio)); }
/// The same where contact acts: the vertices beside the new one find room there.
inline constexpr double kPatchOverVertexInContact = 30;

struct SplitPrediction {
  double of_vertex;  ///< the decrease 1/2 g^T H^-1 g that the new vertex alone brings (one 2 x 2 system)
  double at_most;    ///< times patch_over_vertex
};

SplitPrediction predict_split(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                              const EdgeKey& edge);

}  // namespace itr
