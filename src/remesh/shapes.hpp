// SPDX-License-Identifier: MIT
// Surfaces whose geometry is known: their vertices are put onto it.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "geometry/shape.hpp"
#include "remesh/remesher.hpp"

namespace itr {

/// Material that comes where vertices are put onto a shape, and goes where the shape is concave.
template <int Dim>
struct AddedMaterial {
  /// A simplex between the surfaces before and after, of negative volume where material goes. Corners: a facet before, then
  /// the place of its vertex that moves.
  struct Piece {
    int body = 0;
    std::array<Vec<Dim>, Dim + 1> rest{}, x{};           ///< at rest, and at the past position [m]
    std::vector<std::array<Vec<Dim>, Dim + 1>> rates{};  ///< as RemeshFields::past_rates
  };
  std::vector<Piece> pieces;
  std::vector<VertexId> moved;
  int compressed = 0;   ///< of these, vertices whose new material begins compressed, as something was in the way
  int off = 0;          ///< vertices that stay off their shape
  double farthest = 0;  ///< of these, at most [m]
};

using Shapes = std::vector<std::shared_ptr<const Shape>>;

/// Moves vertices of surfaces with a shape onto it at rest, and splits edges along which it turns far, or that contact may
/// see to be straight: within a step it may act on them, and their middles are farther off than a quarter of dhat. Fields at
/// a moved vertex are those of the nearest cell, extrapolated as far as that inverts and meets nothing; else as `remesh`.
template <int Dim>
RemeshReport put_on_shapes(const Shapes& shapes, Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                           const RemeshOptions& options, RemeshMemory& memory, Strata<Dim>& strata,
                           AddedMaterial<Dim>& added);

}  // namespace itr
