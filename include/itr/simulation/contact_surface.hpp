// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include "itr/energy/contact/surface.hpp"
#include "itr/fem/vertex_map.hpp"
#include "itr/simulation/setup.hpp"

namespace itr {

/// The surface of a compact mesh and of the obstacles, whose vertices follow the mesh's.
template <int Dim>
CollisionSurface collision_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles);

/// What can touch in a simulation, and where it is.
template <int Dim>
struct ContactSurface {
  CollisionSurface surface;  ///< its vertices: those of the mesh or of the proxy, then those of the obstacles
  /// See proxy_map; null without a proxy: the vertices of `surface` are those of mesh and obstacles.
  std::shared_ptr<const VertexMap<Dim>> map;

  VectorX positions(ConstVectorView x) const { return map ? map->positions(x) : VectorX(x); }
  VectorX motion(ConstVectorView dx) const { return map ? map->motion(dx) : VectorX(dx); }
};

/// From the vertices of mesh and obstacles to those of the setup's proxy and obstacles.
template <int Dim>
std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// The proxy's surface where the setup has one, else the boundary of the compact mesh; with the obstacles.
template <int Dim>
ContactSurface<Dim> contact_surface(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

}  // namespace itr
