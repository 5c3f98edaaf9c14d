// SPDX-License-Identifier: MIT
// Random meshes, edits and scenes for the tests of remeshing.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <random>
#include <vector>

#include "energy/contact/contact.hpp"
#include "energy/elastic/elastic.hpp"
#include "remesh/decide/trial.hpp"
#include "remesh/edits.hpp"
#include "remesh/fields.hpp"
#include "square_mesh.hpp"

namespace itr {

/// A unit square of n x n perturbed quadrilaterals with random diagonals; body 1 left of the middle, body 2 right of it;
/// facet tags 1 to 4 by side.
inline Mesh<2> random_mesh(int n, std::mt19937& random) {
  std::uniform_real_distribution<double> noise(-0.25 / n, 0.25 / n);
  const auto place = [&](int i, int j) {
    const bool inside = i > 0 && i < n && 2 * i != n && j > 0 && j < n;
    return Vec<2>(double(i) / n + (inside ? noise(random) : 0), double(j) / n + (inside ? noise(random) : 0));
  };
  const Grid grid = make_grid(n, place, [&](int, int) { return random() % 2; });
  std::vector<int> body;
  for (const auto& cell : grid.cells)
    body.push_back(grid.rest[cell[0]][0] + grid.rest[cell[1]][0] + grid.rest[cell[2]][0] < 1.5 ? 1 : 2);
  Mesh<2> mesh(grid.rest, grid.cells, body);
  tag_sides(mesh, 1);
  return mesh;
}

struct Totals {
  std::map<int, double> area, length;
  explicit Totals(const Mesh<2>& mesh) {
    for (int c = 0; c < mesh.cell_slots(); ++c)
      if (mesh.is_cell_alive(c)) area[mesh.body(c)] += mesh.volume(c);
    for (int f = 0; f < mesh.facet_slots(); ++f)
      if (mesh.is_facet_alive(f))
        length[mesh.facet_tag(f)] += (mesh.rest(mesh.facet(f)[1]) - mesh.rest(mesh.facet(f)[0])).norm();
  }
};

/// The edit of a kind (0 to 3) at edge `which`, modulo their number; empty where there is none.
inline std::optional<Edit<2>> edit_at(const Mesh<2>& mesh, unsigned kind, unsigned which) {
  const auto edges = mesh.edges();
  const EdgeKey edge = edges[which % edges.size()];
  switch (kind) {
    case 0:
      return make_split(mesh, edge);
    case 1:
      return propose_collapse(mesh, Strata<2>(mesh), edge).edit;
    case 2:
      return propose_diagonal_swap(mesh, Strata<2>(mesh), edge).edit;
    default: {
      const Strata<2> strata(mesh);
      return propose_move(mesh, strata, edge[0], best_shaped_position(mesh, strata, edge[0], 3)).edit;
    }
  }
}

inline std::optional<Edit<2>> random_edit(const Mesh<2>& mesh, std::mt19937& random) {
  const unsigned which = random();
  return edit_at(mesh, random() % 4, which);
}

inline std::ostream& operator<<(std::ostream& out, Edit<2>::Kind kind) {
  constexpr const char* kNames[] = {"split", "collapse", "swap", "smooth", "curve", "straighten"};
  return out << kNames[static_cast<int>(kind)];
}
inline std::ostream& operator<<(std::ostream& out, Screening screening) {
  constexpr const char* kNames[] = {"energy-percentile", "bounds"};
  return out << kNames[static_cast<int>(screening)];
}

/// Terms of a TrialScene beside elasticity, inertia, dead loads and contact with an obstacle at rest.
struct Terms {
  bool friction = false, held = false, pressure = false, damping = false, second_body = false, lumped = false,
       moving_obstacle = false;
};
inline std::ostream& operator<<(std::ostream& out, const Terms& terms) {
  return out << "friction " << terms.friction << ", held " << terms.held << ", pressure " << terms.pressure << ", damping "
             << terms.damping << ", second body " << terms.second_body << ", lumped " << terms.lumped << ", moving obstacle "
             << terms.moving_obstacle;
}

/// Adds body 3, of facet tag 5, right of the mesh: apart by less than the reach of TrialScene's contact.
inline Mesh<2> with_second_body(const Mesh<2>& first, std::mt19937& random) {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> body;
  for (int v = 0; v < first.node_slots(); ++v) rest.push_back(first.rest(v));
  for (int c = 0; c < first.cell_slots(); ++c) cells.push_back(first.cell(c)), body.push_back(first.body(c));
  const Grid second = make_grid(
      3, [](int i, int j) { return Vec<2>(1.02 + 0.15 * i, 0.23 + 0.15 * j); }, [&](int, int) { return random() % 2; });
  const int offset = static_cast<int>(rest.size());
  rest.insert(rest.end(), second.rest.begin(), second.rest.end());
  for (const auto& [i, j, k] : second.cells) cells.push_back({offset + i, offset + j, offset + k}), body.push_back(3);
  Mesh<2> mesh(rest, cells, body);
  tag_sides(mesh, 1);
  for (int f = 0; f < mesh.facet_slots(); ++f)
    if (mesh.facet(f)[0] >= offset) mesh.set_facet_tag(f, 5);
  return mesh;
}

/// A body above an obstacle line, within dhat of it, with a random state.
struct TrialScene {
  std::mt19937 random;
  Mesh<2> mesh;
  RemeshFields<2> fields;
  StepContext<2> context;
  explicit TrialScene(unsigned seed, int n = 6, const Terms& terms = {}) : random(seed), mesh(random_mesh(n, random)) {
    if (terms.second_body) mesh = with_second_body(mesh, random);
    context.materials[1] = {.youngs_modulus = 10, .poisson_ratio = 0.3, .density = 2};
    context.materials[2] = {.youngs_modulus = 1000, .poisson_ratio = 0.4, .density = 5};
    context.scaling = 0.01;
    context.contact = {.enabled = true, .dhat = 0.03, .convergent = true, .barrier_stiffness = 5};
    context.newton.step_tolerance = 1e-9;
    context.shortest_edge = 0.1;
    context.loads.acceleration = [](const Vec<2>&) { return Vec<2>(0, -1); };
    context.loads.tractions.emplace_back(4, [](const Vec<2>& X) { return Vec<2>(X[0], 1); });
    auto& obstacles = context.obstacles;
    obstacles.rest = obstacles.x = obstacles.velocity_reference = {{-0.5, -0.03}, {0.4, -0.02}, {1.5, -0.03}};
    obstacles.edges = {{0, 1}, {1, 2}};
    obstacles.past_x = {obstacles.x};
    std::uniform_real_distribution<double> noise(-0.008, 0.008);
    fields.x.resize(2 * mesh.node_slots());
    for (int v = 0; v < mesh.node_slots(); ++v)
      for (int c = 0; c < 2; ++c) fields.x[2 * v + c] = mesh.rest(v)[c] + noise(random);
    fields.predictor = fields.velocity_reference = fields.x;
    for (Eigen::Index i = 0; i < fields.x.size(); ++i) fields.predictor[i] += noise(random);
    fields.past_positions = {fields.predictor};
    add(terms);
  }

 private:
  void add(const Terms& terms) {
    context.materials[3] = {.youngs_modulus = 50, .poisson_ratio = 0.3, .density = 1};
    if (terms.friction) context.contact.friction_coefficient = 0.4, context.contact.friction_velocity = 0.02;
    if (terms.held) context.held_components = {{1, {true, false}}, {4, {true, true}}};
    if (terms.pressure) context.loads.pressures.emplace_back(3, [](const Vec<2>& X) { return 0.5 + X[1]; });
    if (terms.damping)
      context.damping = {{.term = DampingOptions::Term::elastic, .coefficient = 0.03},
                         {.term = DampingOptions::Term::contact, .coefficient = 0.03}};
    if (terms.lumped) context.mass = MassKind::lumped;
    if (terms.moving_obstacle)
      for (std::size_t o = 0; o < context.obstacles.x.size(); ++o) {
        context.obstacles.velocity_reference[o] -= Vec<2>(0.01, 0.005);
        context.obstacles.past_x[0][o] -= Vec<2>(0.01, 0.005);
      }
    if (!terms.friction && !terms.damping) return;
    context.velocity_rate = 10;
    std::uniform_real_distribution<double> noise(-0.003, 0.003);
    for (Eigen::Index i = 0; i < fields.x.size(); ++i)
      fields.velocity_reference[i] += noise(random) - (i % 2 == 0 ? 0.004 : 0);
  }
};

/// Inputs of local problems on a scene's mesh as it is.
struct LocalView {
  Gate<2> gate;
  LocalScratch<2> scratch;
  RemeshState<2> state;
  explicit LocalView(const TrialScene& scene, HistoryRule history = HistoryRule::function)
      : gate(scene.mesh, scene.fields, scene.context),
        state{scene.mesh, scene.fields, scene.context, gate.present(), history} {}
  std::unique_ptr<LocalProblem<2>> problem(const std::vector<CellId>& patch, const Edit<2>& edit, bool is_after) {
    return std::make_unique<LocalProblem<2>>(state, patch, edit, is_after, scratch);
  }
};

/// Positions of a problem into those of the mesh that its edit made.
inline void write_back(const LocalProblem<2>& problem, VertexId created, VectorX& x) {
  std::vector<LocalProblem<2>::Position> positions;
  problem.get_positions(positions);
  for (const auto& [v, position] : positions) x.segment<2>(2 * (v == kNewVertex ? created : v)) = position;
}

/// All terms on the whole mesh, built without any patch.
inline double global_energy(const Mesh<2>& slots, const RemeshFields<2>& slot_fields, const StepContext<2>& context) {
  Mesh<2> mesh = slots;
  const auto map = mesh.compact();
  const int bodies = mesh.node_slots();
  const auto compacted = [&](const VectorX& field, const std::vector<Vec<2>>& extra) {
    VectorX kept(2 * (bodies + extra.size()));
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) kept.segment<2>(2 * map.vertex[v]) = field.segment<2>(2 * v);
    for (std::size_t o = 0; o < extra.size(); ++o) kept.segment<2>(2 * (bodies + o)) = extra[o];
    return kept;
  };
  const VectorX x = compacted(slot_fields.x, context.obstacles.x);
  const CellSet<2> cells = whole_mesh(mesh, context.obstacles.rest);
  CollisionSurface surface;
  const int total = cells.num_vertices;
  surface.area.assign(total, 0);
  surface.degree.assign(total, 0);
  surface.counts.assign(total, 0);
  const auto add = [&](int a, int b) {
    surface.edges.push_back({std::min(a, b), std::max(a, b)});
    for (const int v : {a, b}) {
      surface.area[v] += (cells.rest[a] - cells.rest[b]).norm() / 2;
      ++surface.degree[v];
    }
  };
  for (const auto& facet : cells.facets) add(facet.vertices[0], facet.vertices[1]);
  for (int v = 0; v < total; ++v)
    if (surface.degree[v] > 0) surface.vertices.push_back(v), surface.counts[v] = 1;
  for (const auto& [a, b] : context.obstacles.edges) add(bodies + a, bodies + b);
  for (std::size_t o = 0; o < context.obstacles.x.size(); ++o) surface.vertices.push_back(bodies + static_cast<int>(o));
  std::sort(surface.edges.begin(), surface.edges.end());
  Workspace workspace;
  const VectorX predictor = compacted(slot_fields.predictor, context.obstacles.x);
  return InertiaEnergy<2>(cells, context.materials, MassKind::consistent, predictor).value(x, workspace) +
         ElasticEnergy<2>(cells, context.materials, context.scaling).value(x, workspace) +
         LoadEnergy<2>(cells, context.materials, context.loads, context.scaling).value(x, workspace) +
         ContactEnergy<2>(surface, context.contact, context.contact.barrier_stiffness, context.scaling).value(x, workspace);
}

}  // namespace itr
