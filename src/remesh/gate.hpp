// SPDX-License-Identifier: MIT
// The one gate for changes of connectivity: an edit passes where the state stays valid in every stored configuration, at
// interpolated values. Energies are not asked.
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

/// Memory of its questions, for the next one.
template <int Dim>
struct GateScratch {
  typename SurfaceIndex<Dim>::Hits hits;
  std::vector<std::array<Vec<Dim>, Dim + 1>> swept;
  std::vector<SurfacePiece<Dim>> inserted;
};

template <int Dim>
class Gate {
 public:
  /// All configurations of `fields`, which (as the rest) must outlive this.
  Gate(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context);

  /// Cells that the edit inserts keep their orientation; facets that it inserts touch no other ones (they may share
  /// vertices), and on the way there sweep over no vertex of the surface and no obstacle point; swaps too. Decided exactly.
  bool passes(const Edit<Dim>& edit, GateScratch<Dim>& scratch) const;

  const SurfaceIndex<Dim>& present() const { return configurations_.front().surface; }
  /// After an edit was applied.
  void follow(const Edit<Dim>& edit, FacetId first_new);
  /// After a vertex has moved in the present configuration.
  void move(VertexId v) { configurations_.front().surface.move(v); }

 private:
  bool keeps_orientation(const Edit<Dim>& edit, const VectorX& x) const;
  bool stays_free(const Edit<Dim>& edit, const Configuration<Dim>& at, GateScratch<Dim>& scratch) const;

  const Mesh<Dim>& mesh_;
  bool has_contact_;
  ObstaclePrimitives primitives_;
  std::vector<Configuration<Dim>> configurations_;  ///< the present one first
};

extern template class Gate<2>;
extern template class Gate<3>;

}  // namespace itr
