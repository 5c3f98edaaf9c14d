// SPDX-License-Identifier: MIT
// Random tetrahedral bodies in contact, as a remesher sees them, and their energy without any patch.
#pragma once

#include <limits>
#include <random>

#include "random_tets.hpp"
#include "remesh/remesher.hpp"

namespace itr {

/// A turned cube with holes and bodies over an obstacle triangle, within dhat of its lowest vertex.
struct TetScene {
  std::mt19937 random;
  Mesh<3> mesh;
  RemeshFields<3> fields;
  StepContext<3> context;
  explicit TetScene(unsigned seed, int n = 3) : random(seed), mesh(random_tets(n, random, false)) {
    for (const int body : {1, 2, 3}) context.materials[body] = {.youngs_modulus = 1000, .poisson_ratio = 0.3, .density = 2};
    context.scaling = 0.01;
    context.contact = {.enabled = true, .dhat = 0.02, .convergent = true, .barrier_stiffness = 50};
    context.contact.friction_coefficient = 0.2;
    context.newton.step_tolerance = 1e-9;
    context.shortest_edge = 0.1;
    context.loads.acceleration = [](const Vec<3>&) { return Vec<3>(0, 0, -5); };
    std::uniform_real_distribution<double> noise(-0.006, 0.006);
    fields.x.resize(3 * mesh.node_slots());
    double lowest = std::numeric_limits<double>::infinity();
    for (int v = 0; v < mesh.node_slots(); ++v)
      for (int c = 0; c < 3; ++c) fields.x[3 * v + c] = mesh.rest(v)[c] + noise(random);
    for (int v = 0; v < mesh.node_slots(); ++v) lowest = std::min(lowest, fields.x[3 * v + 2]);
    fields.predictor = fields.velocity_reference = fields.x;
    for (double& x : fields.predictor) x += noise(random);
    fields.past_positions = {fields.x};
    auto& obstacles = context.obstacles;
    const double z = lowest - 0.01;
    obstacles.rest = obstacles.x = obstacles.velocity_reference = {{-9, -9, z}, {9, -9, z}, {0, 9, z}};
    obstacles.triangles = {{0, 1, 2}};
    obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
    obstacles.past_x = {obstacles.x};
  }
};

/// All terms on the whole of a mesh, built without any patch.
inline double whole_energy(const Mesh<3>& slots, const RemeshFields<3>& slot_fields, const StepContext<3>& context) {
  Mesh<3> mesh = slots;
  const auto map = mesh.compact();
  const int bodies = mesh.node_slots();
  const auto& obstacles = context.obstacles;
  const auto compacted = [&](const VectorX& field, const std::vector<Vec<3>>& extra) {
    VectorX kept(3 * (bodies + extra.size()));
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) kept.segment<3>(3 * map.vertex[v]) = field.segment<3>(3 * static_cast<int>(v));
    for (std::size_t o = 0; o < extra.size(); ++o) kept.segment<3>(3 * (bodies + static_cast<int>(o))) = extra[o];
    return kept;
  };
  const CellSet<3> cells = whole_mesh(mesh, obstacles.rest);
  std::vector<std::array<int, 3>> triangles;
  std::vector<char> counts(cells.num_vertices, 0);
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    triangles.push_back(mesh.facet(f));
    for (const int v : mesh.facet(f)) counts[v] = 1;
  }
  for (const auto& [a, b, c] : obstacles.triangles) triangles.push_back({bodies + a, bodies + b, bodies + c});
  const CollisionSurface surface = make_collision_surface<3>({}, triangles, {}, cells.rest, counts);
  IncrementalPotential<3> potential(context, cells,
                                    {compacted(slot_fields.predictor, obstacles.x),
                                     compacted(slot_fields.velocity_reference, obstacles.velocity_reference)});
  potential.add_contact(surface, context.contact.barrier_stiffness);
  const VectorX x = compacted(slot_fields.x, obstacles.x);
  Workspace workspace;
  return potential.sum(potential.lag(x, workspace)).value(x, workspace);
}

}  // namespace itr
