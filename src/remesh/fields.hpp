// SPDX-License-Identifier: MIT
// Inputs of a remesher beside the mesh: nodal fields that follow its edits, and the definition of the step's energy.
#pragma once

#include <limits>
#include <map>
#include <vector>

#include "energy/incremental_potential.hpp"
#include "itr/mesh.hpp"
#include "itr/options.hpp"

namespace itr {

/// Interleaved fields over the vertex slots of a mesh.
template <int Dim>
struct RemeshFields {
  VectorX x;                   ///< positions [m]
  VectorX predictor;           ///< x-hat [m]; empty where there is no inertia
  VectorX velocity_reference;  ///< positions of no velocity [m], for friction and damping; empty where there is none
  std::vector<VectorX> past_positions;  ///< must stay free of inversion and intersection
  std::vector<VectorX> past_rates;      ///< velocities and accelerations
  QuadratureLevels levels;              ///< of the elastic energy, by cell slot; empty: all 0

  /// Calls f(field) on each field that is there.
  template <typename F>
  void for_each(F&& f) {
    for (VectorX* field : {&x, &predictor, &velocity_reference})
      if (field->size() > 0) f(*field);
    for (auto& field : past_positions) f(field);
    for (auto& field : past_rates) f(field);
  }
  /// Interpolated value of a field at the vertex that an edit sets, or at a node that it creates.
  template <typename Parents>
  static Vec<Dim> interpolate(const VectorX& field, const Parents& value) {
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (int k = 0; k < value.num_parents; ++k) sum += value.weights[k] * field.segment<Dim>(Dim * value.parents[k]);
    return sum;
  }
  /// Value of a field of the mesh before an edit at a vertex or node of the mesh after it.
  static Vec<Dim> after(const VectorX& field, const Edit<Dim>& edit, VertexId v) {
    if (edit.sets(v)) return interpolate(field, *edit.value);
    const auto* node = edit.created_node(v);
    return node ? interpolate(field, *node) : Vec<Dim>(field.segment<Dim>(Dim * v));
  }
  /// Extends or updates all fields for an edit that was just applied and created `created` (or kNone); its
  /// nodes have the slots from `first_node` on.
  void follow(const Edit<Dim>& edit, VertexId created, VertexId first_node = kNone);
  /// Level of quadrature of the i-th cell that an edit inserts: that of the removed cell that holds it, else 0.
  std::uint8_t level_of_new_cell(const Edit<Dim>& edit, std::size_t i) const;
  /// Makes all fields as long as so many vertices need, and longer where they grow: edits then seldom copy them.
  void make_room(int vertices);
  /// Ends them behind so many vertices.
  void trim(int vertices);
};

/// The terms of the step, as every local problem needs them, and what else the remesher asks of a scene.
template <int Dim>
struct StepContext : PotentialTerms<Dim> {
  std::map<int, std::array<bool, Dim>> held_components;  ///< by tag of facets and vertices
  NewtonOptions newton;
  double shortest_edge = 0, longest_edge = 0;  ///< of the initial mesh [m]
  std::vector<int> kept_surfaces{};            ///< tags of boundary facets that no edit changes
  /// Energy of the terms between bodies, contact and friction, in the solution that is remeshed [J s^2]; infinity: not
  /// known.
  double coupling = std::numeric_limits<double>::infinity();

  struct ObstacleGeometry {
    std::vector<Vec<Dim>> rest;
    std::vector<Vec<Dim>> x;                    ///< now [m]
    std::vector<Vec<Dim>> velocity_reference;   ///< [m]
    std::vector<std::vector<Vec<Dim>>> past_x;  ///< one a past position
    std::vector<std::array<int, 2>> edges;      ///< as in Obstacles
    std::vector<std::array<int, 3>> triangles;  ///< 3D only
  } obstacles;
};

}  // namespace itr
