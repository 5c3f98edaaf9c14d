// SPDX-License-Identifier: MIT
// Makes edits from a const mesh: the combinatorial and rest-shape half of an operation. What the edit does to the energy is
// decided in trial.hpp.
#pragma once

#include <optional>

#include "itr/mesh/mesh.hpp"

namespace itr {

/// Splits an edge at its midpoint: every incident cell and boundary facet becomes two. Fields of the new vertex are the
/// means of the ends.
template <int Dim>
Edit<Dim> make_split(const Mesh<Dim>& mesh, const EdgeKey& edge);

/// Collapses an edge of a triangle mesh where that keeps the domain, its tags and material interfaces: an edge with one end
/// on the boundary or an interface goes to that end, an interior edge to its midpoint, a boundary edge only along straight
/// stretches of one tag. Empty where the topology or the rest shape forbids it.
std::optional<Edit<2>> make_collapse(const Mesh<2>& mesh, const EdgeKey& edge);

/// Swaps the diagonal of the two triangles at an interior edge of one body; empty where a new triangle has less than a tenth
/// of their area.
std::optional<Edit<2>> make_swap(const Mesh<2>& mesh, const EdgeKey& edge);

/// Moves an interior vertex of one body to `target`; empty where a cell of its ring would lose its orientation or `target`
/// lies outside the ring.
std::optional<Edit<2>> make_move(const Mesh<2>& mesh, VertexId vertex, const Vec<2>& target);

/// The rest position that makes the triangles around an interior vertex as equilateral as possible (least sum of the AMIPS
/// measure tr(J^T J) / det J), by damped Newton.
Vec<2> best_shaped_position(const Mesh<2>& mesh, VertexId vertex, int max_iterations);

/// Whether an interior vertex lies on the interface of two bodies.
template <int Dim>
bool is_on_interface(const Mesh<Dim>& mesh, VertexId vertex);

}  // namespace itr
