// SPDX-License-Identifier: MIT
// Bodies that touch or overlap at the start: press fits against Lame, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "advance.hpp"
#include "energy/rigid_body.hpp"
#include "itr/itr.hpp"
#include "rings.hpp"
#include "simulation/overlap.hpp"
#include "simulation/solids.hpp"

namespace itr {
namespace {

/// A box of n cells along each axis.
template <int Dim>
struct Block {
  Vec<Dim> low, high;
  int n;
};

template <int Dim>
void add_block(const Block<Dim>& block, int body, std::vector<Vec<Dim>>& rest,
               std::vector<typename MeshTypes<Dim>::Cell>& cells, std::vector<int>& bodies) {
  const int first = static_cast<int>(rest.size()), n = block.n, rows = n + 1;
  for (int k = 0; k <= (Dim == 3 ? n : 0); ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) {
        Vec<Dim> at;
        const std::array<int, 3> index{i, j, k};
        for (int c = 0; c < Dim; ++c)
          at[c] = index[c] == n ? block.high[c] : block.low[c] + (block.high[c] - block.low[c]) * index[c] / n;
        rest.push_back(at);
      }
  const auto id = [&](int i, int j, int k) { return first + (k * rows + j) * rows + i; };
  for (int k = 0; k < (Dim == 3 ? n : 1); ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        if constexpr (Dim == 2) {
          cells.push_back({id(i, j, 0), id(i + 1, j, 0), id(i + 1, j + 1, 0)});
          cells.push_back({id(i, j, 0), id(i + 1, j + 1, 0), id(i, j + 1, 0)});
        } else {
          const int a = id(i, j, k), b = id(i + 1, j, k), c = id(i, j + 1, k), d = id(i + 1, j + 1, k), e = id(i, j, k + 1),
                    f = id(i + 1, j, k + 1), g = id(i, j + 1, k + 1), h = id(i + 1, j + 1, k + 1);
          for (const auto& cell :
               {std::array{a, b, d, h}, {a, d, c, h}, {a, c, g, h}, {a, g, e, h}, {a, e, f, h}, {a, f, b, h}})
            cells.push_back(cell);
        }
        bodies.resize(cells.size(), body);
      }
}

/// Neo-Hookean bodies 1, 2, ..., and contact that resolves overlaps by defaults.
template <int Dim>
itr::Setup<Dim> blocks(const std::vector<Block<Dim>>& list) {
  itr::Setup<Dim> setup;
  std::vector<Vec<Dim>> rest;
  std::vector<typename MeshTypes<Dim>::Cell> cells;
  std::vector<int> bodies;
  for (std::size_t b = 0; b < list.size(); ++b) {
    const int body = static_cast<int>(b) + 1;
    add_block<Dim>(list[b], body, rest, cells, bodies);
    setup.materials[body] = {.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000, .plane_strain = Dim == 2};
  }
  setup.mesh = Mesh<Dim>(rest, cells, bodies);
  setup.contact = {.enabled = true, .resolve_overlap = true, .dhat = 0, .convergent = true};
  setup.time = {.integrator = Integrator::newmark, .dt = 1e-3, .steps = 3};
  return setup;
}

template <int Dim>
std::string refusal_of(const itr::Setup<Dim>& setup) {
  linear::Registry registry;
  try {
    Simulation<Dim> simulation(setup, registry);
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "/contact/initial_overlap");
    return error.parts().found;
  }
  return "";
}

double largest_speed(const Simulation<2>& simulation) { return simulation.velocities().cwiseAbs().maxCoeff(); }

constexpr double kA = 0.01, kB = 0.02, kC = 0.03, kE = 7e10, kNu = 0.33, kOverlap = 2e-5;

/// Two rings that overlap, on meshes that do not match.
itr::Setup<2> press_fit(int around, int through) {
  itr::Setup<2> setup =
      quarter_rings({{kA, kB + kOverlap / 2, around, through}, {kB - kOverlap / 2, kC, around + 13, through}});
  for (const int body : {1, 2})
    setup.materials[body] = {.law = MaterialLaw::linear, .youngs_modulus = kE, .poisson_ratio = kNu, .density = 2700};
  setup.contact = {.enabled = true, .resolve_overlap = true, .dhat = 0, .convergent = true};
  setup.time = {.is_static = true, .dt = 1, .steps = 1};
  return setup;
}

/// With a d-hat of 1e-4 of the overlap, too: at their corners the planes of symmetry, which are nearer, are no way out.
TEST(Overlap, RingsPressAsLameSays) {
  for (const double dhat : {0.0, 1e-4 * kOverlap}) {
    itr::Setup<2> setup = press_fit(300, 14);
    setup.contact.dhat = dhat;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    EXPECT_LE(simulation.setup().contact.dhat, 0.001 * kOverlap);
    const double p = press_fit_pressure(kA, kB, kC, kE, kNu, kOverlap);
    const double stored = simulation.interference_energy();
    EXPECT_NEAR(stored, p * kOverlap / 2 * std::numbers::pi / 2 * kB, 0.01 * stored);  // half of force times way
    const StepResult result = advance(simulation);
    EXPECT_NEAR(mean_radial_stress(simulation, 1, kB), -p, 0.004 * p);
    EXPECT_NEAR(mean_radial_stress(simulation, 2, kB), -p, 0.004 * p);
    EXPECT_GT(result.report.min_distance, 0);
  }
}

/// The soft side gives way, and rest shapes stay.
TEST(Overlap, KeepsRestShapesAndSharesByStiffness) {
  itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 3}, {{0, 0.98}, {1, 2}, 4}});
  setup.materials[1].youngs_modulus = 1e8;
  for (const FacetId f : setup.mesh.live_facets()) {
    double least = 3, most = -1;
    for (const VertexId v : setup.mesh.facet(f)) {
      least = std::min(least, setup.mesh.rest(v)[1]);
      most = std::max(most, setup.mesh.rest(v)[1]);
    }
    if (most < 1e-9 || least > 2 - 1e-9) setup.mesh.set_facet_tag(f, 1);
  }
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
  const Mesh<2> before = setup.mesh;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double stiff = 0, soft = 0;
  for (VertexId v = 0; v < simulation.mesh().num_vertices(); ++v) {
    EXPECT_EQ(simulation.mesh().rest(v), before.rest(v));
    const double u = (vertex_of<2>(simulation.positions(), v) - before.rest(v)).norm();
    double& largest = v < 16 ? stiff : soft;
    largest = std::max(largest, u);
  }
  EXPECT_LT(stiff, 0.1 * soft);
  EXPECT_NEAR(soft, 0.02, 0.003);
  EXPECT_GT(simulation.interference_energy(), 0);
}

/// Held at both ends, so that energy stays stored: nothing moves from there on. Viscoelastic bodies have relaxed there.
TEST(Overlap, DynamicRunsBeginAtRestAndStayThere) {
  itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 3}, {{0, 0.99}, {1, 2}, 4}});
  for (const FacetId f : setup.mesh.live_facets()) {
    const double y = setup.mesh.rest(setup.mesh.facet(f)[0])[1], z = setup.mesh.rest(setup.mesh.facet(f)[1])[1];
    if (y + z < 1e-9 || y + z > 4 - 1e-9) setup.mesh.set_facet_tag(f, 1);
  }
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
  for (const bool is_viscous : {false, true})
    for (const Integrator integrator : {Integrator::implicit_euler, Integrator::newmark, Integrator::bdf}) {
      setup.time.integrator = integrator;
      if (is_viscous) setup.materials[1].prony = {{0.5, 2e-3}};
      linear::Registry registry;
      Simulation<2> simulation(setup, registry);
      EXPECT_GT(simulation.interference_energy(), 10);
      const VectorX start = simulation.positions();
      while (!simulation.finished()) advance(simulation);
      EXPECT_LE((simulation.positions() - start).cwiseAbs().maxCoeff(), 1e-8);
      EXPECT_LE(largest_speed(simulation), 1e-5);
    }
}

/// Blocks that touch exactly, with nodes in common places or not, on a ground that they touch: apart by less than d-hat.
TEST(Overlap, TouchingBodiesBeginApart) {
  for (const int n : {3, 4}) {
    itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 3}, {{0, 1}, {1, 2}, n}});
    setup.obstacles.rest = {{-10, 0}, {10, 0}};
    setup.obstacles.edges = {{1, 0}};
    setup.obstacles.motion = {kNone, kNone};
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    EXPECT_NEAR(simulation.interference_energy(), 0, 1e-12);
    const double dhat = simulation.setup().contact.dhat;
    const VectorX start = simulation.positions();
    for (VertexId v = 0; v < simulation.mesh().num_vertices(); ++v)
      EXPECT_LE((vertex_of<2>(start, v) - simulation.mesh().rest(v)).norm(), 3 * dhat);
    while (!simulation.finished()) advance(simulation);
    EXPECT_LE(largest_speed(simulation), 1e-9);
  }
}

/// Bodies that lie askew: boxes around facets then are nearer than these.
TEST(Overlap, DepthsAreThoseOfTheNearestFacets) {
  const Eigen::Rotation2Dd turn(0.2);
  for (const double depth : {0.002, 0.005, 0.01, 0.02}) {
    itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 30}, {{0.21, 1 - depth}, {0.77, 1.5}, 17}});
    std::vector<Vec<2>> rest = setup.mesh.rest();
    std::vector<MeshTypes<2>::Cell> cells;
    std::vector<int> bodies;
    for (Vec<2>& X : rest) X = turn * X;
    for (const CellId c : setup.mesh.live_cells()) {
      cells.push_back(setup.mesh.cell(c));
      bodies.push_back(setup.mesh.body(c));
    }
    EXPECT_NEAR(least_overlap(setup, Mesh<2>(rest, cells, bodies)), depth, 1e-9) << depth;
  }
}

/// A block that nothing holds, on one that it touches, gives way to a third that overlaps both: it stores nothing.
TEST(Overlap, FreeBodiesGiveWay) {
  const auto stored_by = [](const std::vector<Block<2>>& list) {
    itr::Setup<2> setup = blocks<2>(list);
    for (const FacetId f : setup.mesh.live_facets()) {
      const Vec<2> middle = (setup.mesh.rest(setup.mesh.facet(f)[0]) + setup.mesh.rest(setup.mesh.facet(f)[1])) / 2;
      if (middle[0] > 2 - 1e-9 || (middle[0] < 1 && middle[1] < 1e-9)) setup.mesh.set_facet_tag(f, 1);
    }
    setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
    setup.time = {.is_static = true, .dt = 1, .steps = 1};
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    EXPECT_GT(advance(simulation).report.min_distance, 0);
    return simulation.interference_energy();
  };
  const Block<2> held{{0, 0}, {1, 1}, 4}, wall{{0.995, -0.5}, {2, 2.5}, 7}, loose{{0, 1}, {1, 2}, 5};
  const double without = stored_by({held, wall});
  EXPECT_NEAR(stored_by({held, wall, loose}), without, 1e-3 * without);
}

/// A rigid block that is held squeezes a soft one against the axis; one that may slide moves away from it.
TEST(Overlap, RigidBodiesStayRigidAndHeld) {
  for (const bool is_held : {true, false}) {
    itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 4}, {{0.99, -0.5}, {2, 1.5}, 3}});
    for (const FacetId f : setup.mesh.live_facets())
      if (std::ranges::all_of(setup.mesh.facet(f), [&](VertexId v) { return setup.mesh.rest(v)[0] == 0; }))
        setup.mesh.set_facet_tag(f, 1);
    setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
    const auto rigid = std::make_shared<RigidBody>();
    rigid->held_position = {is_held, true, false};
    rigid->held_rotation = {false, false, true};
    setup.materials[2].own = rigid;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    const double dhat = simulation.setup().contact.dhat;
    double farthest = 0;
    const auto& mesh = simulation.mesh();
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
      const Vec<2> x = vertex_of<2>(simulation.positions(), v), u = x - mesh.rest(v);
      if (mesh.body(mesh.cells_of(v)[0]) == 1)
        farthest = std::max(farthest, x[0]);
      else
        EXPECT_LE((u - Vec<2>(is_held ? 0 : 0.01, 0)).norm(), is_held ? 1e-12 : 2 * dhat);
    }
    EXPECT_NEAR(farthest, is_held ? 0.99 : 1, dhat);
  }
}

/// A box that is too large for its slot, in 3D, with friction: it is held by walls that do not move.
TEST(Overlap, BoxInASlotPressesOnItsWalls) {
  constexpr double kDepth = 1e-3;
  itr::Setup<3> setup = blocks<3>({{{0, 0, 0}, {1, 1, 1}, 2},
                                   {{1 - kDepth, -0.5, -0.5}, {2 - kDepth, 1.5, 1.5}, 3},
                                   {{-1 + kDepth, -0.5, -0.5}, {kDepth, 1.5, 1.5}, 3}});
  setup.contact.friction_coefficient = 0.3;
  for (const int body : {2, 3}) setup.materials[body].youngs_modulus = 1e9;
  for (const FacetId f : setup.mesh.live_facets()) {
    double least = 9, most = -9;
    for (const VertexId v : setup.mesh.facet(f)) {
      least = std::min(least, setup.mesh.rest(v)[0]);
      most = std::max(most, setup.mesh.rest(v)[0]);
    }
    if (least > 2 - kDepth - 1e-9 || most < -1 + kDepth + 1e-9) setup.mesh.set_facet_tag(f, 1);
  }
  setup.dirichlet = {{1, {true, true, true}, [](const Vec<3>&, double) { return Vec<3>(0, 0, 0); }}};
  setup.time = {.quasistatic = true, .dt = 1, .steps = 2};
  setup.fields.stress = true;
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  while (!simulation.finished()) advance(simulation);
  const auto stress = cell_stress(simulation).cauchy;
  double mean = 0, volume = 0;
  for (CellId c = 0; c < simulation.mesh().cell_slots(); ++c) {
    if (simulation.mesh().body(c) != 1) continue;
    mean += simulation.mesh().volume(c) * stress[static_cast<std::size_t>(9 * c)];
    volume += simulation.mesh().volume(c);
  }
  EXPECT_NEAR(mean / volume, -1e6 * 2 * kDepth, 0.02 * 1e6 * 2 * kDepth);  // strain 2 depth / size, walls 1e3 times as stiff
}

/// A run on a mesh that changes begins at the same place and stays certified; a restored one has the same bits.
TEST(Overlap, RemeshedAndRestoredRunsGoOn) {
  itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 3}, {{0.3, 0.97}, {0.8, 2}, 2}});
  setup.time = {.quasistatic = true, .dt = 1, .steps = 2};
  setup.remesh.enabled = true;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry), again(setup, registry);
  const double stored = simulation.interference_energy();
  EXPECT_GE(stored, 0);
  advance(simulation);
  again.restore(simulation.state());
  advance(simulation);
  advance(again);
  EXPECT_EQ(simulation.positions().size(), again.positions().size());
  EXPECT_TRUE((simulation.positions() - again.positions()).isZero(0));
  EXPECT_GT(simulation.report().min_distance, 0);
}

TEST(Overlap, RefusesWhatItCannotResolve) {
  EXPECT_NE(refusal_of(blocks<2>({{{0, 0}, {1, 1}, 3}, {{0.4, 0.4}, {0.6, 0.6}, 2}})).find("inside of"), std::string::npos);
  EXPECT_NE(refusal_of(blocks<2>({{{0, 0}, {1, 1}, 3}, {{0.1, 0.6}, {0.9, 1.6}, 2}})).find("an overlap of"),
            std::string::npos);
  itr::Setup<2> obstacles = blocks<2>({{{0, 0}, {1, 1}, 3}});
  const auto add_square = [&](double x, double y, double size) {
    const int first = static_cast<int>(obstacles.obstacles.rest.size());
    for (const Vec<2>& corner : {Vec<2>(x, y), Vec<2>(x + size, y), Vec<2>(x + size, y + size), Vec<2>(x, y + size)}) {
      obstacles.obstacles.rest.push_back(corner);
      obstacles.obstacles.motion.push_back(kNone);
    }
    for (int k = 0; k < 4; ++k) obstacles.obstacles.edges.push_back({first + k, first + (k + 1) % 4});
  };
  add_square(2, 0, 1);
  EXPECT_EQ(refusal_of(obstacles), "");
  add_square(2.5, 0.5, 1);
  EXPECT_NE(refusal_of(obstacles).find("obstacles that overlap"), std::string::npos);
  // Both sides are held where they overlap.
  itr::Setup<2> held = blocks<2>({{{0, 0}, {1, 1}, 1}, {{0, 0.9}, {1, 2}, 1}});
  for (const FacetId f : held.mesh.live_facets()) held.mesh.set_facet_tag(f, 1);
  held.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
  EXPECT_NE(refusal_of(held).find("however they are pushed"), std::string::npos);
}

/// Without the key the refusal names it.
TEST(Overlap, IsRefusedUnlessAskedFor) {
  itr::Setup<2> setup = blocks<2>({{{0, 0}, {1, 1}, 3}, {{0, 0.99}, {1, 2}, 4}});
  setup.contact.resolve_overlap = false;
  linear::Registry registry;
  try {
    Simulation<2> simulation(setup, registry);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(error.parts().expected.find("initial_overlap"), std::string::npos) << error.parts().expected;
  }
}

/// Points in a square from -1 to 1 and outside of it.
TEST(Solids, SignedDistances) {
  const itr::Setup<2> setup = blocks<2>({{{-1, -1}, {1, 1}, 2}, {{0.9, -0.3}, {2, 0.4}, 1}});
  Mesh<2> mesh = setup.mesh;
  mesh.compact();
  const Eigen::Map<const VectorX> x(mesh.rest()[0].data(), 2 * mesh.num_nodes());
  const Solids<2> solids(find_solids(setup, mesh, {}), x);
  const auto found = solids.penetrations();
  ASSERT_EQ(found.size(), 2u);
  for (const auto& penetration : found) {
    EXPECT_NEAR(penetration.depth, 0.1, 1e-12);
    EXPECT_FALSE(penetration.is_whole);
  }
  solids.for_each_near(0.05, [&](const FacetPoint<2>& point, const Nearest<2>& nearest) {
    const Vec<2> p = point.at(x);
    EXPECT_NEAR((p - nearest.foot.at(x)).norm(), std::abs(nearest.gap), 1e-12);
    EXPECT_NEAR(nearest.normal.norm(), 1, 1e-12);
    EXPECT_LT(nearest.gap, 0.05);
  });
}

}  // namespace
}  // namespace itr
