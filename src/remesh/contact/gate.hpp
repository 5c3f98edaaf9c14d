// SPDX-License-Identifier: MIT
// The one gate for changes of connectivity: an edit passes if the state stays valid in every stored configuration, with
// interpolated values at new vertices. The gate does not ask about energies.
#pragma once

#include <array>
#include <vector>

#include "surface_index.hpp"

namespace itr {

/// A stored configuration: the present positions or past ones.
template <int Dim>
struct Configuration {
  const VectorX* x;
  SurfaceIndex<Dim> surface;
};

/// Buffers of the gate's checks, which the next check uses again.
template <int Dim>
struct GateScratch {
  typename SurfaceIndex<Dim>::Hits hits;
  std::vector<std::array<Vec<Dim>, Dim + 1>> swept;
  std::vector<SurfacePiece<Dim>> removed, inserted;
};

template <int Dim>
class Gate {
 public:
  /// Takes all configurations of `fields`. The arguments must outlive the gate.
  Gate(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context);

  /// Whether an edit keeps the state valid, decided exactly. Inserted cells have to keep their orientation. Inserted facets
  /// (of swaps, too), and the chords of curved ones, must touch no other ones, except at shared vertices, and sweep over no
  /// vertex of the surface and no obstacle point on the way to their places.
  bool passes(const Edit<Dim>& edit, GateScratch<Dim>& scratch) const;

  /// Whether the surface that can touch is in another place after the edit, so that all of the configurations count.
  bool moves_surface(const Edit<Dim>& edit) const {
    return has_contact_ && !edit.inserted_facets.empty() && (!edit.is_nested() || is_any_removed_curved(edit));
  }

  const SurfaceIndex<Dim>& present() const { return configurations_.front().surface; }
  /// Takes over an edit that was applied.
  void follow(const Edit<Dim>& edit, FacetId first_new);
  /// After a vertex has moved in the present configuration.
  void move(VertexId v) { configurations_.front().surface.move(v); }

 private:
  bool is_any_removed_curved(const Edit<Dim>& edit) const;
  bool keeps_orientation(const Edit<Dim>& edit, const VectorX& x) const;
  void find_pieces(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const;
  void find_swept(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const;
  bool stays_free(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const;

  const Mesh<Dim>& mesh_;
  bool has_contact_;
  ObstaclePrimitives primitives_;
  std::vector<Configuration<Dim>> configurations_;  ///< the present one first
};

extern template class Gate<2>;
extern template class Gate<3>;

}  // namespace itr
