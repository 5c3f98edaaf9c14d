// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <map>

#include "itr/mesh.hpp"
#include "mesh/turn.hpp"
#include "simulation/sizes.hpp"

namespace itr::cli {

constexpr double kSliver = 0.1;  ///< quality below which an element is one

/// Sizes and qualities of a mesh at rest.
template <int Dim>
struct MeshFigures {
  struct Body {
    int cells = 0;
    double volume = 0;
  };
  std::map<int, Body> bodies;
  EdgeLengths edges;
  double worst_quality = 1;
  CellId worst_cell = 0;
  int slivers = 0;
  double size = 0;                     ///< longest side of the bodies' box [m]
  Vec<Dim> center = Vec<Dim>::Zero();  ///< the vertex nearest to the box's, where loads are defined in any case

  explicit MeshFigures(const Mesh<Dim>& mesh) : edges(edge_lengths(mesh)) {
    Eigen::AlignedBox<double, Dim> box;
    for (const CellId c : mesh.live_cells()) {
      Body& body = bodies[mesh.body(c)];
      ++body.cells;
      body.volume += mesh.volume(c) * turn_at(mesh, mesh.barycenter(c));
      for (const VertexId v : mesh.cell(c)) box.extend(mesh.rest(v));
      slivers += mesh.quality(c) < kSliver;
      if (mesh.quality(c) < worst_quality) worst_quality = mesh.quality(c), worst_cell = c;
    }
    size = box.sizes().maxCoeff();
    const Vec<Dim> middle = box.center();
    center = mesh.rest(0);
    for (const VertexId v : mesh.live_vertices())
      if ((mesh.rest(v) - middle).norm() < (center - middle).norm()) center = mesh.rest(v);
  }
};

}  // namespace itr::cli
