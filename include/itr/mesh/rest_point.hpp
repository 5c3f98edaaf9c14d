// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/types.hpp"

namespace itr {

/// A rest position [m] and the body that it is a point of. Points of the two faces of a crack, or of bodies that touch, have
/// one position; `inward` and `part` tell them apart.
template <int Dim>
struct RestPoint : Vec<Dim> {
  Vec<Dim> inward = Vec<Dim>::Zero();  ///< a direction from the point into its body; 0: unknown
  int part = kNone;                    ///< its connected part, Mesh::part; kNone: unknown

  template <typename Derived>
  RestPoint(const Eigen::MatrixBase<Derived>& X) : Vec<Dim>(X) {}
  RestPoint(double x, double y) requires(Dim == 2) : Vec<Dim>(x, y) {}
  RestPoint(double x, double y, double z) requires(Dim == 3) : Vec<Dim>(x, y, z) {}
  RestPoint(const Vec<Dim>& X, const Vec<Dim>& direction, int connected_part)
      : Vec<Dim>(X), inward(direction), part(connected_part) {}
};

}  // namespace itr
