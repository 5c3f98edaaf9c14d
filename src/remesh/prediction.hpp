// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include "local_problem.hpp"

namespace itr {

/// By what factor a relaxed patch is taken to gain more than the new vertex alone, without contact: nine of ten gain less,
/// and what is refused wrongly comes up again when its gain grows (verification/paper). Grows towards incompressibility.
inline double patch_over_vertex(double poisson_ratio) { return std::max(1.5, 0.6 / (1 - 2 * poisson_ratio)); }
/// The same where the surface changes in contact: the vertices beside the new one find room there.
inline constexpr double kPatchOverVertexInContact = 30;

/// What an edit is predicted to gain when only the vertex that it sets relaxes, to second order: a microsecond. Elasticity,
/// inertia (history interpolated) and dead loads; contact and friction left out. [J, times the scaling]
/// Infinite where the scene has pressure or damping, of which it knows nothing.
template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit);

/// Upper estimate of what an edit gains that has this lower bound.
inline double at_most(double gain_of_vertex, double factor) {
  return gain_of_vertex > 0 ? factor * gain_of_vertex : gain_of_vertex / factor;
}

}  // namespace itr
