// SPDX-License-Identifier: MIT
// Certifies the curved edges of a frame's surface as curves, not as chords through their nodes.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "certify.hpp"
#include "frame_surface.hpp"
#include "geometry/closed_surface.hpp"
#include "geometry/quadratic_patch.hpp"

namespace itr::output {

/// The true boundary of the bodies, then the obstacles, whose edges and vertices are triangles without an area in 3D.
template <int Dim>
struct Patches {
  std::vector<std::array<int, Dim>> facets;
  std::vector<QuadraticPatch<Dim>> patches;
  std::vector<char> is_curved;
};

template <int Dim>
Patches<Dim> true_surface(const FrameSurface<Dim>& surface);

/// By vertex of `closed`: whether chords and curves of other parts may have it on different sides, as in the box of a
/// curve's control points.
template <int Dim>
std::vector<char> find_doubtful(const FrameSurface<Dim>& surface, const Patches<Dim>& all, const ClosedSurface<Dim>& closed);

/// Obstacles' vertices that curves have on another side than the chords through the nodes; in 2D those that chords have
/// inside of a body and curves have not, since check_curves finds the others.
template <int Dim>
std::set<int> find_beyond_chords(const FrameSurface<Dim>& surface, const Patches<Dim>& all);

/// Proves by Bernstein bounds that true curves meet nothing. Neighbours in the surface are left to the cells.
template <int Dim>
void check_curves(const FrameSurface<Dim>& surface, const Patches<Dim>& all, const std::string& name,
                  std::vector<Violation>& violations);

/// Fills in what curved edges do beyond their chords. Pieces of the surface around an edge do not count as something else.
template <int Dim>
void measure_overhangs(const FrameSurface<Dim>& surface, Certificate& certificate);

}  // namespace itr::output
