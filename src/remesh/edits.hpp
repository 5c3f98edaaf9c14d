// SPDX-License-Identifier: MIT
// Makes edits from a const mesh: the combinatorial and rest-shape half of an operation. What the edit does to the energy,
// and whether positions stay valid, is decided in a trial.
#pragma once

#include <array>
#include <functional>
#include <optional>

#include "itr/frame.hpp"
#include "itr/mesh.hpp"
#include "mesh/strata.hpp"

namespace itr {

/// An edit, or why there is none.
template <int Dim>
struct Proposal {
  std::optional<Edit<Dim>> edit{};
  Refusal refusal = Refusal::none;

  explicit operator bool() const { return edit.has_value(); }
};
template <int Dim>
Proposal<Dim> refused(Refusal refusal) {
  return {.refusal = refusal};
}

/// Rest position of a vertex of the mesh after an edit.
template <int Dim>
Vec<Dim> rest_after(const Mesh<Dim>& mesh, const Edit<Dim>& edit, VertexId v) {
  return edit.sets(v) ? edit.value->rest : mesh.rest(v);
}

/// Least quality (simplex_quality of the rest shape: 1 regular, 0 flat) of a new cell, relative to the worst cell that it
/// replaces: at least `fraction` of it, and where it is above `floor` not below `floor`. What is worse than `floor` may only
/// improve, so that no sequence of edits makes a mesh worse than `floor` or what it was.
struct QualityRule {
  double fraction = 0.3;
  double floor = 0.1;
  double least(double worst_before) const { return std::max(fraction * worst_before, std::min(floor, worst_before)); }
};

/// Splits an edge at its midpoint: every incident cell and boundary facet becomes two. Fields keep their values everywhere:
/// the new vertex takes the node of its edge or the mean of the ends, halves of a curved edge are curved, and so is an edge
/// from the new vertex along which the old functions are quadratic.
template <int Dim>
Edit<Dim> make_split(const Mesh<Dim>& mesh, const EdgeKey& edge);

/// By how many nodes, the new vertex among them, a split enlarges the space.
template <int Dim>
int nodes_of_split(const Mesh<Dim>& mesh, const EdgeKey& edge);

/// Makes an edge curved. Its node is at the mean of the ends at rest and in all fields. The cells and boundary facets at the
/// edge are replaced by themselves, so that whoever looks for changed ones finds them.
template <int Dim>
Edit<Dim> make_curve(const Mesh<Dim>& mesh, const EdgeKey& edge);

/// Makes a curved edge straight: its node goes, and fields keep their values at all other nodes.
template <int Dim>
Edit<Dim> make_straighten(const Mesh<Dim>& mesh, const EdgeKey& edge);

/// Replaces a curved edge by its chords: a split with the node as the new vertex and straight halves. All that it inserts
/// beside them is that of the split.
template <int Dim>
Edit<Dim> make_chords(const Mesh<Dim>& mesh, const EdgeKey& edge);

// Operations below replace edges. A new edge takes over whether it is curved from those that it replaces. Its node has what
// the old functions have at its place, so that fields are their interpolants. Edges that are there before and after, with
// both ends where they were, keep their nodes.

/// Collapses an edge where that keeps every stratum's topology (the link conditions of Dey, Edelsbrunner, Guha & Nekhayev
/// 1999 in the volume, on patches and along features) and the rest shape exactly: an end may go where the edge is of its own
/// stratum (in the volume, within its patch, along its straight feature). Where both may, the midpoint is tried first, then
/// either end. An edge at the vertex that stays is curved if one of those that it replaces was, on the boundary one there.
template <int Dim>
Proposal<Dim> propose_collapse(const Mesh<Dim>& mesh, const Strata<Dim>& strata, const EdgeKey& edge,
                               const QualityRule& rule = {});

/// Cost of a tetrahedron that an edit would insert, by its vertices (positively oriented) and body; infinite: never. The
/// edit has the nodes of its edges.
using CellCost = std::function<double(const MeshTypes<3>::Cell& vertices, int body, const Edit<3>& edit)>;

/// The longest ring whose triangulations are searched.
inline constexpr int kLongestRing = 7;

/// Swaps the diagonal of the two triangles at an edge inside a body. The new one is curved if the old one is.
Proposal<2> propose_diagonal_swap(const Mesh<2>& mesh, const Strata<2>& strata, const EdgeKey& edge,
                                  const QualityRule& rule = {});

/// Removes an edge: the ring around it is triangulated such that the sum of the new cells' costs is least (Klincsek 1980;
/// the 3-2 and 4-4 swaps are rings of 3 and 4), each of them by the rule. Also within a patch of the surface (2-2 and on) or
/// of an interface, where the facets at the edge swap in their plane. New edges are curved if the edge is.
Proposal<3> propose_edge_removal(const Mesh<3>& mesh, const Strata<3>& strata, const EdgeKey& edge, const CellCost& cost,
                                 const QualityRule& rule = {});

/// Replaces the two cells at an inner facet by three around the edge between their other vertices (2-3 swap), which is
/// curved if all edges of the facet are.
Proposal<3> propose_facet_removal(const Mesh<3>& mesh, const MeshTypes<3>::Facet& facet, const QualityRule& rule = {});

/// Moves a vertex's rest position as far towards `target` as its stratum goes: in the volume to it, otherwise to its
/// projection onto the patch or the feature. Fields are those of the old mesh at that place.
template <int Dim>
Proposal<Dim> propose_move(const Mesh<Dim>& mesh, const Strata<Dim>& strata, VertexId vertex, const Vec<Dim>& target,
                           const QualityRule& rule = {});

/// The rest position, within the vertex's stratum, that makes the cells around as regular as possible (least sum of the
/// AMIPS measure tr(J^T J) / det(J)^(2/Dim)), by damped Newton.
template <int Dim>
Vec<Dim> best_shaped_position(const Mesh<Dim>& mesh, const Strata<Dim>& strata, VertexId vertex, int max_iterations);

}  // namespace itr
