// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include "energy/contact/surface.hpp"
#include "fem/chord_levels.hpp"
#include "fem/vertex_map.hpp"
#include "geometry/closed_surface.hpp"
#include "itr/setup.hpp"

namespace itr {

/// The surface of a compact mesh through all of its nodes (add_chord_facets), and of the obstacles, whose vertices
/// follow the nodes.
template <int Dim>
CollisionSurface collision_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles);

/// The boundary of the bodies through all nodes and the points of refined chords, at positions x of the nodes [m].
template <int Dim>
ClosedSurface<Dim> body_boundary(const Mesh<Dim>& mesh, ConstVectorView x, const ChordLevels& levels = {});

/// Surface that can touch in a simulation, and its positions.
template <int Dim>
struct ContactSurface {
  /// Its vertices: the nodes and the points of refined chords, or those of the proxy, then those of the obstacles.
  CollisionSurface surface;
  /// From nodes and obstacles to these. Null where they are the same: without a proxy and refined chords.
  std::shared_ptr<const VertexMap<Dim>> map;
  bool is_proxy = false;

  VectorX positions(ConstVectorView x) const { return map ? map->positions(x) : VectorX(x); }
  VectorX motion(ConstVectorView dx) const { return map ? map->motion(dx) : VectorX(dx); }
};

/// From the nodes of the bodies and the vertices of obstacles to those of the setup's proxy and obstacles.
template <int Dim>
std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// The proxy's surface where the setup has one, else the boundary of the compact mesh with its chords; with the obstacles.
/// `age`: how many steps ago positions were that it is for, of the faces that were closed then.
template <int Dim>
ContactSurface<Dim> contact_surface(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels = {},
                                    int age = 0);

}  // namespace itr
