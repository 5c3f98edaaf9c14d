// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "fem/volume_patches.hpp"
#include "itr/energy.hpp"

namespace itr {

/// Integrals of a function over an element [m^Dim times its unit]: of itself, and times the last Dim barycentric coordinates
/// less their means.
template <int Dim>
struct ElementMoments {
  double whole = 0;
  Vec<Dim> first = Vec<Dim>::Zero();
};

/// Patches whose weights in each element are constant or, where elements are turned about an axis, linear: what edits of a
/// mesh carry on (docs/theory.md, "Patches under remeshing"). Elements are straight. `patch_of` is empty; the part of a
/// member is the number of its share.
template <int Dim>
struct SharedPatches : VolumePatches<Dim> {
  struct Share {
    int patch;
    double weight;                     ///< mean over the element
    Vec<Dim> lean = Vec<Dim>::Zero();  ///< derivatives by the last Dim barycentric coordinates; 0 where nothing is turned

    double at(const std::array<double, Dim + 1>& barycentric) const {
      double value = weight;
      for (int k = 0; k < Dim; ++k) value += lean[k] * (barycentric[k + 1] - 1.0 / (Dim + 1));
      return value;
    }
    /// The integral of the weight times a function by the integrals of this.
    double integral(const ElementMoments<Dim>& of) const { return weight * of.whole + lean.dot(of.first); }
  };
  std::vector<std::size_t> first_share{0};  ///< by element, and the end
  std::vector<Share> shares;                ///< in elements of bodies with patches weights add up to 1
  std::vector<double> outside;              ///< by patch: integral of w_i (J - 1) over cells that are not here [m^Dim]

  /// Returns the same patches, or null where they have no shares.
  static const SharedPatches* of(const VolumePatches<Dim>* patches) {
    return patches && patches->patch_of.empty() ? static_cast<const SharedPatches*>(patches) : nullptr;
  }
  std::span<const Share> shares_of(std::size_t element) const {
    return std::span(shares).subspan(first_share[element], first_share[element + 1] - first_share[element]);
  }
  /// Lists members and nodes of the patches that have a volume, when all shares are there.
  void list_members(const CellSet<Dim>& cells) {
    std::vector<std::vector<typename VolumePatches<Dim>::Member>> of_patch(this->count());
    for (std::size_t e = 0; e + 1 < first_share.size(); ++e)
      for (std::size_t s = first_share[e]; s < first_share[e + 1]; ++s)
        of_patch[shares[s].patch].push_back({static_cast<int>(e), static_cast<int>(s)});
    for (const auto& list : of_patch) {
      this->first_member.push_back(this->members.size());
      this->first_node.push_back(this->nodes.size());
      std::vector<int> around;
      for (const auto& member : list) {
        const auto& vertices = cells.elements[member.element].vertices;
        around.insert(around.end(), vertices.begin(), vertices.end());
      }
      std::sort(around.begin(), around.end());
      around.erase(std::unique(around.begin(), around.end()), around.end());
      this->members.insert(this->members.end(), list.begin(), list.end());
      this->nodes.insert(this->nodes.end(), around.begin(), around.end());
    }
    this->first_member.push_back(this->members.size());
    this->first_node.push_back(this->nodes.size());
  }
};

}  // namespace itr
