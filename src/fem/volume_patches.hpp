// SPDX-License-Identifier: MIT
// Patches of cells over which nearly incompressible bodies average det F (docs/theory.md, "Near-incompressible materials"):
// disjoint stars of vertices, and linear hat functions of vertices at which all cells have curved edges only.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "itr/energy.hpp"

namespace itr {

/// Weights w_i >= 0 that add up to 1 everywhere in bodies whose volume is averaged. Elements have their numbers in the
/// CellSet.
template <int Dim>
struct VolumePatches {
  static constexpr int kLeft = Dim + 1;  ///< of an element: what the hats of its corners leave of 1
  static constexpr int kParts = Dim + 2;
  /// A part of an element: the hat of a corner, or kLeft.
  struct Member {
    int element, part;
  };

  std::vector<std::array<int, kParts>> patch_of;      ///< by element and part; kNone where there is none
  std::vector<double> volume;                         ///< integral of w_i at rest, by patch [m^Dim]
  std::vector<int> body;                              ///< by patch
  std::vector<std::size_t> first_member, first_node;  ///< by patch, and the end
  std::vector<Member> members;                        ///< of elements ascending
  std::vector<int> nodes;                             ///< ascending

  std::size_t count() const { return volume.size(); }
  std::span<const Member> members_of(std::size_t patch) const {
    return std::span(members).subspan(first_member[patch], first_member[patch + 1] - first_member[patch]);
  }
  std::span<const int> nodes_of(std::size_t patch) const {
    return std::span(nodes).subspan(first_node[patch], first_node[patch + 1] - first_node[patch]);
  }
  /// The weight of a part at barycentric coordinates.
  double weight(int element, int part, const std::array<double, Dim + 1>& at) const {
    if (part != kLeft) return at[part];
    double left = 1;
    for (int k = 0; k <= Dim; ++k)
      if (patch_of[element][k] != kNone) left -= at[k];
    return left;
  }
};

/// Patches of the bodies for which `is_averaged` holds. They follow from the elements and their order alone: centres of
/// stars are the vertices that see no centre of a smaller number.
template <int Dim>
std::shared_ptr<const VolumePatches<Dim>> volume_patches(const CellSet<Dim>& cells,
                                                         const std::function<bool(int body)>& is_averaged);

}  // namespace itr
