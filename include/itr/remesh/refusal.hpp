// SPDX-License-Identifier: MIT
// Why an operation was not done.
#pragma once

#include <string_view>

namespace itr {

enum class Refusal : char {
  none,
  not_asked,  ///< it was left out before anything was computed: it is not counted
  // No trial was worth its time.
  depth,       ///< as many generations of the edge as a step may have are there
  length,      ///< the edge is too short for a split, too long for a collapse, or a move too short
  dhat,        ///< halves of a surface edge would be shorter than dhat
  prediction,  ///< derivatives at the present positions promise too little
  // No edit can be made.
  gone,          ///< no such edge, facet or vertex in the mesh
  non_manifold,  ///< the cells around it are neither a ball nor a half ball
  held,       ///< whatever would have to go or move is on a feature, corner or patch that it may not leave: the shape would
              ///< change
  link,       ///< a collapse that would change the topology of the bodies, their surfaces or features (link condition)
  exists,     ///< the edge that a swap makes is there already
  long_ring,  ///< an edge to be removed has too many cells around it
  shape,      ///< a cell would be inverted, flat, or much worse than the worst that is there now
  overhang,   ///< a surface edge that touches would be farther out than its chords
  outside,    ///< the target of a move lies outside of the cells around
  cost,       ///< infinite cost of each triangulation of the ring
  // A trial refused the edit.
  invalid,     ///< some stored configuration would have inversions or intersections
  bound,       ///< the energy cannot fall by enough: the new vertex alone tells
  energy,      ///< a relaxed patch does not gain enough
  no_unknowns  ///< nothing of the patch is free
};
inline constexpr int kRefusals = static_cast<int>(Refusal::no_unknowns) + 1;
/// As in `steps.jsonl`.
std::string_view name(Refusal refusal);

}  // namespace itr
