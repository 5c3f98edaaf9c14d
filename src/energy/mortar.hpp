// SPDX-License-Identifier: MIT
// Mortar conditions that bond surfaces whose meshes do not match (Bernardi, Maday & Patera 1994; Puso & Laursen 2004): means
// of the jump of positions, with functions that are linear on the facets of one side, integrated over the common refinement
// of both sides at rest.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "itr/energy.hpp"
#include "itr/options.hpp"

namespace itr {

/// One condition: sum of weights x positions of the nodes is what it is at rest, in some components.
template <int Dim>
struct MortarRow {
  int vertex = kNone;  ///< of the function
  std::array<bool, Dim> components{};
  std::vector<int> nodes;       ///< ascending
  std::vector<double> weights;  ///< of both sides [m^(Dim-1), times the turn]; their sum is 0
  double measure = 0;           ///< integral of the function [as the weights]
  double length = 0;            ///< of facets [m]
  std::array<int, 2> bodies{};  ///< one of each side
  int against = kNone;          ///< of a jump that is free: vertex of the function whose mean is the jump
  double share = 0;             ///< of that function's weights, which were taken from these
};

/// A Tie on one mesh. Side 0 has the functions: of the sides that the other covers the finer one.
template <int Dim>
struct Mortar {
  std::array<std::vector<int>, 2> tags;  ///< by side
  std::vector<MortarRow<Dim>> rows;
  /// Facets of side 0 that side 1 covers or touches, and cells that they are of.
  std::vector<std::array<int, Dim>> facets;
  std::vector<const typename CellSet<Dim>::Element*> elements;
  std::vector<int> vertices;           ///< of facets of both sides that overlap, ascending
  double covered = 0;                  ///< of side 0's area
  double longest_edge = 0;             ///< of those facets [m]
  int tie = 0;                         ///< its index
  bool is_own_b = false;               ///< whether side 0 is the tie's b
  Vec<Dim> to_own = Vec<Dim>::Zero();  ///< from points of side 1 to those of side 0, of periodic cells [m]
};

inline constexpr double kLeastCovered = 0.9;   ///< of a side, for a tie
inline constexpr double kLargestTieGap = 0.1;  ///< at rest, of the edges there

/// Makes the mortars of ties on `cells`, which have to outlive them. `is_held(node, c)`: whether a condition holds the
/// node's component c. Functions at such vertices, at those where two ties meet and at those that hardly overlap have no
/// conditions of their own: the functions beside them take their place. Of ties with a jump all functions have conditions,
/// in a free component (NaN) all but one, which measures the jump that the others follow.
template <int Dim>
std::vector<Mortar<Dim>> make_mortars(const CellSet<Dim>& cells, std::span<const Tie> ties,
                                      const std::function<bool(int node, int c)>& is_held);

/// The least distance of vertices of a tie's sides from the facets of the other [m].
template <int Dim>
double distance_of_sides(const CellSet<Dim>& cells, const Tie& tie);

}  // namespace itr
