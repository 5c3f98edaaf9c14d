// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include "local_problem.hpp"

namespace itr {

/// Factor by which a relaxed patch is taken to gain more than the new vertex alone, without contact. It grows towards
/// incompressibility. In 2D nine of ten patches gain less, in 3D 19 of 20. A wrongly refused edit is examined again when its
/// gain grows (verification/paper).
template <int Dim>
double patch_over_vertex(double poisson_ratio) {
  constexpr double kLeast = Dim == 2 ? 1.5 : 2, kGrowth = Dim == 2 ? 0.6 : 0.2;
  return std::max(kLeast, kGrowth / (1 - 2 * poisson_ratio));
}
/// Factor of a patch over the vertex and nodes that a split or a curve sets together, where edges are curved. In 2D nine of
/// ten patches gain less, in 3D 19 of 20 (verification/paper); there they take three times as long.
template <int Dim>
double patch_over_nodes(double poisson_ratio) {
  constexpr double kLeast = Dim == 2 ? 1.5 : 1.7, kGrowth = Dim == 2 ? 0.35 : 0.17;
  return std::max(kLeast, kGrowth / (1 - 2 * poisson_ratio));
}
/// Factor where the surface changes in contact: relaxing vertices beside the new one gain more there.
template <int Dim>
inline constexpr double kPatchOverVertexInContact = Dim == 2 ? 30 : 10;

/// Factor where a split or a curve in contact is predicted without it. Of 3 000 such edges in the paper's masticators none
/// was accepted that was predicted to gain less than a tenth of the tolerance; in 3D one, less than a third.
template <int Dim>
inline constexpr double kPatchOverPredictionInContact = Dim == 2 ? 10 : 5;

/// Predicts the gain of an edit by elasticity, inertia (history interpolated) and dead loads when only the vertex that it
/// sets relaxes, to second order: a microsecond [J, times the scaling]. Infinite where the scene has viscoelasticity,
/// pressure, damping or terms of the program; at curved edges an estimate, in which each node relaxes by itself and history
/// is left out.
template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit);

/// Lower estimate of what an edit that sets a vertex forgets of the history: a fraction of the square of the gap between the
/// old and the new predictor at the place of each vertex that goes or moves, times its hat function on the old cells. It is
/// below the exact value of forgotten_history, which takes much longer, in each of 815 random collapses and in all but 2 of
/// 922 moves from x = x-hat. [J, times the scaling]
template <int Dim>
double least_forgotten(const RemeshState<Dim>& state, const Edit<Dim>& edit);

/// The prediction for the split of an edge, up to round-off: in one evaluation a cell around it, where moduli are constant
/// in cells and mass is consistent.
template <int Dim>
double predict_split(const RemeshState<Dim>& state, const EdgeKey& edge);

/// Predicts the gain of a split at cells with curved edges by the vertex and the nodes that it adds, together: ½ r^T A^-1 r,
/// and the change by finer quadrature. NaN where moduli or density vary in space, a facet is loaded or A is indefinite.
template <int Dim>
double predict_split_at_curves(const RemeshState<Dim>& state, const EdgeKey& edge);

/// The decrease of energy by making an edge curved, by the new node alone: ½ r^T A^-1 r. NaN where moduli vary in space.
template <int Dim>
double predict_curve(const RemeshState<Dim>& state, const EdgeKey& edge);

/// The decrease of energy, negative in most cases, if a curved edge becomes straight and nothing else moves. The new mesh
/// pays for the motion that it forgets. NaN where moduli or density vary in space, history is interpolated or a facet at
/// the edge is loaded. Contact is left out. [J, times the scaling]
template <int Dim>
double predict_straighten(const RemeshState<Dim>& state, const EdgeKey& edge);

/// Elasticity, inertia and body forces of a cell on vertices of the mesh, whether it is there or not, at present positions.
/// Its curved edges are those after the edit. [J, times the scaling]
template <int Dim>
double cell_energy(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell, int body,
                   const Edit<Dim>& edit);

/// Upper estimate of what an edit gains that has this lower bound.
inline double at_most(double gain_of_vertex, double factor) {
  return gain_of_vertex > 0 ? factor * gain_of_vertex : gain_of_vertex / factor;
}

}  // namespace itr
