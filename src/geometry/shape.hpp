// SPDX-License-Identifier: MIT
// Geometries of surfaces: how far points are off them.
#pragma once

#include <array>
#include <memory>
#include <numbers>
#include <vector>

#include "itr/types.hpp"

namespace itr {

struct FittedSurface;

/// A geometry that surfaces of bodies have, so that remeshing puts their new vertices onto it. Planar scenes: in z = 0.
struct Shape {
  enum class Kind : char { plane, sphere, cylinder, cone, torus, fitted };
  std::vector<int> surfaces{};     ///< tags of boundary facets
  Kind kind = Kind::sphere;        ///< in 2D a sphere is a circle and a plane a line
  Vec<3> center = Vec<3>::Zero();  ///< of sphere and torus, of a cone its apex; of others a point on the axis or plane [m]
  Vec<3> axis = {0, 0, 1};         ///< unit vector; of a plane its normal
  double radius = 0;               ///< of a torus that of its middle circle [m]
  double tube_radius = 0;          ///< of a torus [m]
  double angle = 0;                ///< of a cone: between axis and surface; of a fitted one: features turn by more [rad]
  double sag = 0;                  ///< how far edges that may touch may be off it [m]; 0: a quarter of dhat
  std::shared_ptr<const FittedSurface> fitted{};  ///< by Setup::choose_defaults
};

/// The angle by which a shape may turn along an edge of a mesh on it [rad].
template <int Dim>
constexpr double kMostTurn = 2 * std::numbers::pi / (Dim == 2 ? 96 : 32);
/// How far the middle of an edge is off a shape that turns so far along it, by the length of the edge.
template <int Dim>
constexpr double kMostSag = kMostTurn<Dim> / 8;

/// The point less `distance` times `normal` lies on the shape, nearest to the point.
struct ShapeOffset {
  double distance;  ///< signed: positive on the side that `normal` points to [m]
  Vec<3> normal;    ///< gradient of the distance
};
ShapeOffset offset_from(const Shape& shape, const Vec<3>& point);

/// Cubic curves in z = 0, one from each place to the next, whose tangents agree at places that are no features.
struct FittedSurface {
  std::vector<std::array<Vec<3>, 4>> curves;  ///< points of control
};

/// Fits curves through the ends of segments, in any order and direction. Where segments meet under
/// more than `feature_angle` [rad], or not two of them do, stays a corner. Tangents elsewhere are those of the circle
/// through a place and its neighbours, so that polygons in circles get arcs up to the fourth power of their angles.
std::shared_ptr<const FittedSurface> fit_curves(const std::vector<std::array<Vec<3>, 2>>& segments, double feature_angle);

}  // namespace itr
