// SPDX-License-Identifier: MIT
// Patches of nearly incompressible bodies while edits change the mesh (docs/theory.md, "Patches under remeshing"): those of
// the mesh that remeshing begins with, as functions on the bodies. A cell has one weight for each of them, or, where it is
// turned about an axis, a linear function.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "fem/cell_set.hpp"
#include "fem/shared_patches.hpp"
#include "itr/mesh.hpp"
#include "itr/options.hpp"

namespace itr {

/// Whether a material asks for patches.
bool any_averages_volume(const std::map<int, Material>& materials);

template <int Dim>
class CarriedPatches {
 public:
  using Share = typename SharedPatches<Dim>::Share;
  using Shares = std::vector<Share>;

  /// The patches of a compact mesh without curved edges, of bodies whose materials ask for some, at positions x [m].
  CarriedPatches(const Mesh<Dim>& mesh, const VectorX& x, const std::map<int, Material>& materials);

  /// Whether patches act in one of these alive cells.
  bool act_in(std::span<const CellId> cells) const;
  /// Returns those of an alive cell; none outside of these bodies.
  const Shares& shares(CellId c) const { return shares_[c]; }
  /// Weights in the cells that an edit of the mesh inserts: their means over these cells, or their projections where cells
  /// are turned. Those of a split stay the functions that they were.
  std::vector<Shares> shares_after(const Mesh<Dim>& mesh, const Edit<Dim>& edit) const;
  /// Patches of cells, of which those without an id have `inserted` in their order. `before`: cells of the mesh in the same
  /// place. What is outside of that stays as it is. Null: none of the cells has any.
  /// Those `star` cells of the mesh, and the ones inserted, are patches of their own then, one a body.
  std::shared_ptr<const SharedPatches<Dim>> in(const CellSet<Dim>& cells, const std::vector<Shares>& inserted,
                                               std::span<const CellId> before, std::span<const CellId> star = {}) const;

  /// Follows an edit with `inserted` shares of its new cells, and vertices of the mesh that have moved to x. Commits have
  /// ascending numbers.
  void follow(const Mesh<Dim>& mesh, const Edit<Dim>& edit, std::vector<Shares> inserted, std::span<const CellId> new_cells,
              std::span<const VertexId> moved, const VectorX& x, unsigned commit);
  /// Whether a commit after `since` changed the mean of a patch of the cell.
  bool was_written(CellId c, unsigned since) const;

 private:
  void add(CellId c, double sign, unsigned commit);
  Shares halved(const Mesh<Dim>& mesh, const Edit<Dim>& edit, std::size_t i) const;

  std::vector<Shares> shares_;               ///< by cell slot
  std::vector<ElementMoments<Dim>> change_;  ///< by cell slot: of J - 1
  std::vector<ElementMoments<Dim>> size_;    ///< by cell slot: of 1
  std::vector<int> body_;                    ///< by patch
  std::vector<double> volume_;               ///< by patch [m^Dim]
  std::vector<double> total_;                ///< by patch: integral of w (J - 1) [m^Dim]
  std::vector<unsigned> written_;
};

extern template class CarriedPatches<2>;
extern template class CarriedPatches<3>;

}  // namespace itr
