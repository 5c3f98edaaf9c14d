// SPDX-License-Identifier: MIT
// Random operations of all kinds on meshes with curved edges, with contact and without: by themselves through the gate, and
// as the remesher does them. Everything is checked exactly after each block.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <span>

#include "curved_scene.hpp"
#include "remesh/contact/gate.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"
#include "simulation/invariants.hpp"

namespace itr {
namespace {

template <typename T>
class CurvedLong : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CurvedLong, Dimensions);

template <int Dim>
struct LongScene : CurvedScene<Dim> {
  using CurvedScene<Dim>::random, CurvedScene<Dim>::mesh, CurvedScene<Dim>::fields, CurvedScene<Dim>::strata;
  Setup<Dim> setup;
  StepContext<Dim> context;
  std::map<int, double> volume;
  int most_cells;

  LongScene(unsigned seed, bool contact) : CurvedScene<Dim>(seed, 0.4, Dim == 2 ? 0.02 : 0.01, !contact) {
    for (int body = 1; body <= 3; ++body)
      context.materials[body] = {.youngs_modulus = 10.0 * body, .poisson_ratio = 0.1 * body, .density = 1.0 + body};
    context.scaling = 0.01;
    context.newton.step_tolerance = 1e-6;
    context.shortest_edge = 0.1;
    context.longest_edge = 0.5;
    context.contact.enabled = contact;
    context.contact.dhat = 5e-3;
    context.contact.barrier_stiffness = 100;
    context.obstacles.past_x.resize(1);
    fields.velocity_reference = VectorX();
    if (contact) add_floor();
    setup.materials = context.materials;
    setup.contact = context.contact;
    setup.obstacles.rest = context.obstacles.rest;
    setup.obstacles.edges = context.obstacles.edges;
    setup.obstacles.triangles = context.obstacles.triangles;
    volume = volumes();
    most_cells = 3 * mesh.num_cells();
  }
  /// A simplex a little below each configuration.
  void add_floor() {
    auto& obstacles = context.obstacles;
    const auto floor_of = [&](const VectorX& x) {
      double least = 1e9;
      for (Eigen::Index i = Dim - 1; i < x.size(); i += Dim) least = std::min(least, x[i]);
      std::vector<Vec<Dim>> points;
      if constexpr (Dim == 2)
        points = {{-9, least - 1e-3}, {9, least - 2e-3}};
      else
        points = {{-20, -20, least - 1e-3}, {20, -20, least - 1e-3}, {0, 20, least - 1e-3}};
      return points;
    };
    obstacles.rest = obstacles.x = obstacles.velocity_reference = floor_of(fields.x);
    obstacles.past_x = {floor_of(fields.past_positions[0])};
    obstacles.edges = {{0, 1}};
    if constexpr (Dim == 3) {
      obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
      obstacles.triangles = {{0, 1, 2}};
    }
  }
  std::map<int, double> volumes() const {
    std::map<int, double> sums;
    for (CellId c = 0; c < mesh.cell_slots(); ++c)
      if (mesh.is_cell_alive(c)) sums[mesh.body(c)] += mesh.volume(c);
    return sums;
  }
  /// Nothing where mesh, strata, volumes and both configurations are as they have to be; removes dead slots.
  std::string find_defect() {
    this->compact();
    if (std::string defect = mesh.find_defect(); !defect.empty()) return defect;
    if (std::string defect = strata.find_defect(mesh); !defect.empty()) return defect;
    for (const auto& [body, sum] : volumes())
      if (std::abs(sum - volume.at(body)) > 1e-11) return "volume of body " + std::to_string(body);
    const auto violation = [&](const VectorX& x, const std::vector<Vec<Dim>>& obstacles) {
      VectorX all(Dim * (mesh.node_slots() + static_cast<int>(obstacles.size())));
      all.head(Dim * mesh.node_slots()) = x.head(Dim * mesh.node_slots());
      for (std::size_t i = 0; i < obstacles.size(); ++i)
        all.template segment<Dim>(Dim * (mesh.node_slots() + static_cast<int>(i))) = obstacles[i];
      return find_violation(setup, mesh, all);
    };
    const std::string now = violation(fields.x, context.obstacles.x);
    return now.empty() ? violation(fields.past_positions[0], context.obstacles.past_x[0]) : now;
  }
  /// Moves a vertex or a node inside of the bodies a little, where all cells at it stay positive.
  void stir() {
    const EdgeKey edge = this->any_edge();
    const VertexId node = mesh.node_of(edge[0], edge[1]);
    const bool of_edge = node != kNone && random() % 2;
    if (of_edge ? !mesh.facets_of_edge(edge).empty() : mesh.is_boundary(edge[0])) return;
    const VertexId moved = of_edge ? node : edge[0];
    const auto around =
        of_edge ? mesh.cells_of_edge(edge) : std::vector<CellId>(mesh.cells_of(moved).begin(), mesh.cells_of(moved).end());
    const double size = 0.1 * (mesh.rest(edge[0]) - mesh.rest(edge[1])).norm();
    for (VectorX* x : {&fields.x, &fields.past_positions[0]}) {
      const Vec<Dim> before = x->template segment<Dim>(Dim * moved);
      for (int k = 0; k < Dim; ++k) (*x)[Dim * moved + k] += std::uniform_real_distribution<double>(-size, size)(random);
      const bool fine = std::all_of(around.begin(), around.end(), [&](CellId c) {
        const auto cell = curved_cell<Dim>(mesh.cell(c), [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
        return is_positive_everywhere<Dim>(cell.values(*x, Edit<Dim>{.kind = Edit<Dim>::Kind::split}));
      });
      if (!fine) x->template segment<Dim>(Dim * moved) = before;
    }
  }
};

/// Operations in all: a million in 2D, a hundred thousand in 3D, or what ITR_LONG_OPERATIONS says.
template <int Dim>
int num_operations() {
  const char* given = std::getenv("ITR_LONG_OPERATIONS");
  return given ? std::atoi(given) : Dim == 2 ? 1000000 : 100000;
}

constexpr int kKinds = 6, kEdits = 7;  // a report counts chords as straightened
template <int Dim>
void expect_all_kinds(std::span<const long> done, long least) {
  for (std::size_t kind = 0; kind < done.size(); ++kind) {
    EXPECT_GT(done[kind], least) << "kind " << kind;
    ::testing::Test::RecordProperty("kind" + std::to_string(kind), std::to_string(done[kind]));
  }
}

TYPED_TEST(CurvedLong, RandomOperationsKeepEverythingValid) {
  constexpr int Dim = TypeParam::value, kScenes = 20, kBlock = 500;
  std::array<long, kEdits> done{};
  long refused = 0;
  for (unsigned seed = 0; seed < kScenes; ++seed) {
    LongScene<Dim> scene(seed, seed % 2);
    ASSERT_EQ(scene.find_defect(), "") << seed;
    for (int i = 0; i < num_operations<Dim>() / kScenes;) {
      Gate<Dim> gate(scene.mesh, scene.fields, scene.context);
      GateScratch<Dim> scratch;
      for (int end = i + kBlock; i < end;) {
        const auto proposal = propose_any(scene);
        if (!proposal) continue;
        const Edit<Dim>& edit = *proposal.edit;
        using Kind = typename Edit<Dim>::Kind;
        const bool splits = edit.kind == Kind::split || edit.kind == Kind::chords;
        if (splits && scene.mesh.num_cells() > scene.most_cells) continue;
        if (!gate.passes(edit, scratch)) {
          ++refused;
          continue;
        }
        const FacetId first_facet = scene.mesh.facet_slots();
        const VertexId created = scene.mesh.apply(edit);
        scene.fields.follow(edit, created, scene.mesh.node_slots() - static_cast<int>(edit.inserted_nodes.size()));
        scene.strata.follow(edit, created);
        gate.follow(edit, first_facet);
        scene.stir();
        ++done[static_cast<int>(edit.kind)];
        ++i;
      }
      ASSERT_EQ(scene.find_defect(), "") << "seed " << seed << ", after " << i;
    }
  }
  expect_all_kinds<Dim>(done, num_operations<Dim>() / 200);
  EXPECT_GT(refused, num_operations<Dim>() / 1000);
}

/// Tolerances that let nearly everything pass, in turn for what refines and for what coarsens.
TYPED_TEST(CurvedLong, TheRemesherKeepsEverythingValid) {
  constexpr int Dim = TypeParam::value, kScenes = 20;
  std::array<long, kKinds> done{};
  for (unsigned seed = 0; seed < kScenes; ++seed) {
    LongScene<Dim> scene(seed, seed % 2);
    RemeshOptions options = remesh_options();
    options.curve.enabled = options.straighten.enabled = options.swap.enabled = options.smooth.enabled = true;
    options.collapse.rel_max_edge_length = 100;
    options.split.max_depth = 1;
    scene.context.has_inertia = seed % 4 < 2;
    long left = num_operations<Dim>() / kScenes / 10;
    for (int round = 0; left > 0 && round < 100000; ++round) {
      const double lenient = std::pow(10.0, -1.0 - static_cast<int>(scene.random() % 7));
      const bool refines = scene.mesh.num_cells() < scene.most_cells;
      options.split.enabled = refines;
      options.collapse.enabled = !refines || scene.random() % 2;
      options.straighten.enabled = scene.random() % 2;
      options.split.acceptance_tolerance = options.curve.acceptance_tolerance = refines ? -lenient : lenient;
      options.collapse.acceptance_tolerance = options.swap.acceptance_tolerance = options.smooth.acceptance_tolerance =
          -lenient;
      RemeshMemory memory;
      const RemeshReport report = remesh(scene.mesh, scene.fields, scene.context, options, memory, scene.strata);
      const std::array<int, kKinds> counts{report.splits.accepted,  report.collapses.accepted, report.swaps.accepted,
                                           report.smooths.accepted, report.curves.accepted,    report.straightens.accepted};
      for (int kind = 0; kind < kKinds; ++kind) {
        done[kind] += counts[kind];
        left -= counts[kind];
      }
      ASSERT_EQ(scene.find_defect(), "") << "seed " << seed << ", round " << round;
      for (int i = 0; i < 200; ++i) scene.stir();
    }
  }
  expect_all_kinds<Dim>(done, num_operations<Dim>() / 5000);
}

}  // namespace
}  // namespace itr
