// SPDX-License-Identifier: MIT
// Trials of edits on meshes with curved edges: a context for them, what they ask, and the whole mesh to compare with.
#pragma once

#include <vector>

#include "remesh/contact/gate.hpp"
#include "remesh/decide/local_problem.hpp"
#include "remesh/decide/trial.hpp"

namespace itr {

/// Bodies of different laws, inertia, weight, tractions and a held part, by turns.
template <int Dim>
StepContext<Dim> context_of(unsigned seed) {
  StepContext<Dim> context;
  for (int body = 1; body <= 3; ++body)
    context.materials[body] = {.youngs_modulus = 10.0 * body, .poisson_ratio = 0.1 * body, .density = 1.0 + body};
  if (seed % 3 == 1)
    for (auto& [body, material] : context.materials) material.law = MaterialLaw::linear;
  context.scaling = 0.01;
  context.has_inertia = seed % 2 == 0;
  context.newton.step_tolerance = 1e-9;
  context.shortest_edge = 0.1;
  context.loads.acceleration = [](const Vec<Dim>&) { return Vec<Dim>(Vec<Dim>::Unit(Dim - 1) * -0.2); };
  context.loads.tractions.emplace_back(1, [](const Vec<Dim>&) { return Vec<Dim>(Vec<Dim>::Unit(0) * 0.03); });
  context.held_components[Dim == 2 ? 2 : 0].fill(true);
  context.obstacles.past_x.resize(1);  // of the one past position
  return context;
}

/// View of a scene, which has a mesh and fields, for a trial of an edit.
template <int Dim>
struct View {
  Gate<Dim> gate;
  LocalScratch<Dim> scratch;
  RemeshState<Dim> state;
  template <typename Scene>
  View(const Scene& scene, const StepContext<Dim>& context, HistoryRule history = HistoryRule::function)
      : gate(scene.mesh, scene.fields, context), state{scene.mesh, scene.fields, context, gate.present(), history} {}
};

/// A mesh without dead slots; fields in its numbering.
template <int Dim>
struct Compact {
  Mesh<Dim> mesh;
  std::vector<int> slots;  ///< by node

  explicit Compact(const Mesh<Dim>& with_slots) : mesh(with_slots) {
    const auto map = mesh.compact();
    slots.resize(mesh.num_nodes());
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) slots[map.vertex[v]] = static_cast<int>(v);
  }
  VectorX field(const VectorX& of_slots, const std::vector<Vec<Dim>>& of_obstacles = {}) const {
    VectorX all(Dim * static_cast<Eigen::Index>(slots.size() + of_obstacles.size()));
    for (std::size_t i = 0; i < slots.size(); ++i)
      all.segment<Dim>(Dim * static_cast<int>(i)) = of_slots.segment<Dim>(Dim * slots[i]);
    for (std::size_t o = 0; o < of_obstacles.size(); ++o)
      all.segment<Dim>(Dim * static_cast<int>(slots.size() + o)) = of_obstacles[o];
    return all;
  }
};

}  // namespace itr
