// SPDX-License-Identifier: MIT
// Chords of curved edges and faces: their points lie on the curves, neighbours meet, and in contact no curve leaves its
// chords by more than a quarter of dhat and half of the gap.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "fem/refined_chords.hpp"
#include "random_tets.hpp"
#include "simulation/chord_bound.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/invariants.hpp"
#include "simulation/state.hpp"
#include "simulation/watch.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

/// A body round about the origin, of radius 1, one cell with body 1 for each of a grid's.
template <int Dim>
Mesh<Dim> make_ball(int n) {
  const auto on_ball = [n](auto... at) {
    const Vec<Dim> p = Vec<Dim>(2.0 * at / n - 1 ...);
    return p.isZero() ? p : Vec<Dim>(p * p.template lpNorm<Eigen::Infinity>() / p.norm());
  };
  if constexpr (Dim == 2) {
    const Grid grid = make_grid(n, on_ball, [](int i, int j) { return (i + j) % 2; });
    return Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  } else {
    return make_cubes(n, on_ball, [](int, int, int) { return 1; });
  }
}

/// A quadratic ball between two plates, of which the upper one comes down by `speed` [m/s] for half of the time and goes
/// back.
template <int Dim>
Setup<Dim> pressed_ball(double speed, int steps) {
  Setup<Dim> setup;
  setup.mesh = make_ball<Dim>(Dim == 2 ? 6 : 3);
  setup.order[1] = 2;
  setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 100};
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 2, .dt = 0.01, .steps = steps};
  setup.contact = {.enabled = true,
                   .dhat = Dim == 2 ? 2e-3 : 1e-2,
                   .convergent = true,
                   .barrier_stiffness = 1e4,
                   .friction_coefficient = 0.1};
  auto& obstacles = setup.obstacles;
  for (const double height : {-1.01, 1.01}) {
    const int first = static_cast<int>(obstacles.rest.size());
    if constexpr (Dim == 2) {
      obstacles.rest.insert(obstacles.rest.end(), {{-4, height}, {4, height}});
      obstacles.edges.push_back({first, first + 1});
    } else {
      obstacles.rest.insert(obstacles.rest.end(), {{-4, -4, height}, {4, -4, height}, {0, 6, height}});
      obstacles.triangles.push_back({first, first + 1, first + 2});
      obstacles.edges.insert(obstacles.edges.end(), {{first, first + 1}, {first + 1, first + 2}, {first, first + 2}});
    }
  }
  obstacles.motion.assign(obstacles.rest.size(), kNone);
  std::fill(obstacles.motion.begin() + Dim, obstacles.motion.end(), 0);
  const double turn = steps * setup.time.dt / 2;
  obstacles.motions = {[speed, turn](const Vec<Dim>&, double t) {
    return Vec<Dim>(Vec<Dim>::Unit(Dim - 1) * -speed * (t < turn ? t : 2 * turn - t));
  }};
  return setup;
}

/// How far curves of the boundary go beyond the plates of pressed_ball [m].
template <int Dim>
double depth_in_plates(const State<Dim>& state) {
  constexpr int kSamples = 16;
  const VectorX& x = state.history.x[0];
  const int nodes = state.mesh.num_nodes();
  const double low = vertex_of<Dim>(x, nodes)[Dim - 1], high = vertex_of<Dim>(x, nodes + Dim)[Dim - 1];
  double deepest = 0;
  for (FacetId f = 0; f < state.mesh.facet_slots(); ++f) {
    const auto& facet = state.mesh.facet(f);
    const auto look = [&](const std::array<double, Dim>& at) {
      double height = 0;
      for (int i = 0; i < Dim; ++i) {
        height += at[i] * (2 * at[i] - 1) * vertex_of<Dim>(x, facet[i])[Dim - 1];
        for (int j = 0; j < i; ++j)
          height += 4 * at[i] * at[j] * vertex_of<Dim>(x, state.mesh.node_of(facet[i], facet[j]))[Dim - 1];
      }
      deepest = std::max({deepest, height - high, low - height});
    };
    for (int i = 0; i <= kSamples; ++i) {
      const double a = static_cast<double>(i) / kSamples;
      if constexpr (Dim == 2)
        look({a, 1 - a});
      else
        for (int j = 0; i + j <= kSamples; ++j)
          look({a, static_cast<double>(j) / kSamples, 1 - a - static_cast<double>(j) / kSamples});
    }
  }
  return deepest;
}

int most_halvings(const ChordLevels& levels) { return levels.empty() ? 0 : *std::max_element(levels.begin(), levels.end()); }

template <typename T>
class Chords : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Chords, Dimensions);

/// Random levels, edges of which some are straight: each edge between simplices has two of them, turned as one surface, and
/// points are where the quadratic functions of the facets are.
TYPED_TEST(Chords, MeetAtPointsOfTheCurves) {
  constexpr int Dim = TypeParam::value;
  Mesh<Dim> mesh = make_ball<Dim>(2);
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    std::vector<EdgeKey> curved;
    for (const EdgeKey& edge : mesh.edges())
      if (random() % 4 > 0) curved.push_back(edge);
    mesh.set_curved_edges(curved);
    ChordLevels levels(curved.size());
    for (auto& level : levels) level = static_cast<std::uint8_t>(random() % 4);
    const RefinedChords<Dim> chords = refine_chords(mesh, levels);
    std::map<std::array<int, Dim - 1>, int> balance, sides;
    for (const auto& facet : chords.facets)
      for (int k = 0; k < Dim; ++k) {
        std::array<int, Dim - 1> side;
        for (int i = 1; i < Dim; ++i) side[i - 1] = facet[(k + i) % Dim];
        int sign = Dim == 2 && k == 1 ? -1 : 1;
        if (Dim == 3 && side.front() > side.back()) std::swap(side.front(), side.back()), sign = -sign;
        balance[side] += sign;
        ++sides[side];
      }
    for (const auto& [side, sum] : balance) EXPECT_EQ(sum, 0);
    for (const auto& [side, count] : sides) EXPECT_EQ(count, 2);
    VectorX x(Dim * mesh.num_nodes());
    for (double& value : x) value = static_cast<double>(random() % 1000);
    const int nodes = mesh.num_nodes();
    for (std::size_t i = 0; i < chords.facets.size(); ++i)
      for (int corner = 0; corner < Dim; ++corner) {
        const auto& facet = mesh.facet(chords.parents[i]);
        const auto& at = chords.coordinates[i][corner];
        Vec<Dim> of_facet = Vec<Dim>::Zero(), of_chord = Vec<Dim>::Zero();
        for (int a = 0; a < Dim; ++a) {
          of_facet += at[a] * vertex_of<Dim>(x, facet[a]);
          for (int b = 0; b < a; ++b)
            if (const int node = mesh.node_of(facet[a], facet[b]); node != kNone)
              of_facet += 4 * at[a] * at[b] *
                          (vertex_of<Dim>(x, node) - (vertex_of<Dim>(x, facet[a]) + vertex_of<Dim>(x, facet[b])) / 2);
        }
        const int id = chords.facets[i][corner];
        if (id < nodes)
          of_chord = vertex_of<Dim>(x, id);
        else
          for (const auto& [node, weight] : chords.points[id - nodes]) of_chord += weight * vertex_of<Dim>(x, node);
        EXPECT_LT((of_facet - of_chord).norm(), 1e-9);
      }
  }
}

TYPED_TEST(Chords, WithoutHalvingsAreThoseThroughTheNodes) {
  constexpr int Dim = TypeParam::value;
  Mesh<Dim> mesh = make_ball<Dim>(2);
  mesh.set_curved_edges(mesh.edges());
  std::vector<typename Mesh<Dim>::Facet> through_nodes;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) add_chord_facets(mesh, f, through_nodes);
  EXPECT_EQ(refine_chords(mesh, {}).facets, through_nodes);
  EXPECT_TRUE(refine_chords(mesh, {}).points.empty());
}

/// Presses, and lets go. A state goes on in another simulation with the same bits.
TYPED_TEST(Chords, KeepCurvesOutOfWhatTheyTouch) {
  constexpr int Dim = TypeParam::value;
  const itr::Setup<Dim> setup = pressed_ball<Dim>(Dim == 2 ? 3 : 2, Dim == 2 ? 20 : 12);
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry), other(setup, registry);
  int before = 0, raised = 0, joined = 0;
  double nearest = 1;
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const State<Dim>& state = simulation.state();
    const ChordLevels levels = state.chords;
    nearest = std::min(nearest, result.report.min_distance);
    raised += most_halvings(levels) > before;
    joined += most_halvings(levels) < before;
    before = most_halvings(levels);
    EXPECT_LE(find_chord_demand(setup, state.mesh, levels, state.history.x[0]).excess, 1) << state.step;
    EXPECT_EQ(depth_in_plates(state), 0) << state.step;
    for (const VectorX& x : state.history.x) EXPECT_EQ(find_violation(setup, state.mesh, x, levels), "");
    if (2 * state.step == setup.time.steps) other.restore(State<Dim>(state));
  }
  EXPECT_LT(nearest, setup.contact.dhat);
  EXPECT_GT(raised, 0);
  EXPECT_GT(joined, 0);
  while (!other.finished()) ASSERT_TRUE(other.advance().ok);
  EXPECT_EQ(other.state().history.x[0], simulation.state().history.x[0]);
  EXPECT_EQ(other.state().chords, simulation.state().chords);
}

/// A barrier so soft that gaps are smaller than curves leave the shortest chords by becomes stiffer.
TEST(ChordBound, HoldsBehindASoftBarrier) {
  constexpr int Dim = 2;
  itr::Setup<Dim> setup = pressed_ball<Dim>(3, 20);
  setup.contact.barrier_stiffness = 10;
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry), other(setup, registry);
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const State<Dim>& state = simulation.state();
    EXPECT_LE(find_chord_demand(setup, state.mesh, state.chords, state.history.x[0]).excess, 1) << state.step;
    EXPECT_EQ(depth_in_plates(state), 0) << state.step;
    if (2 * state.step == setup.time.steps) other.restore(State<Dim>(state));
  }
  EXPECT_GT(simulation.state().stiffness.value, setup.contact.barrier_stiffness);
  while (!other.finished()) ASSERT_TRUE(other.advance().ok);
  EXPECT_EQ(other.state().history.x[0], simulation.state().history.x[0]);
}

/// Presses a ball by a barrier that gives way until gaps are narrower than the shortest chords allow: no step is taken.
TEST(ChordBound, StopsStepsThatCurvesMayNotTake) {
  itr::Setup<2> setup = pressed_ball<2>(3, 20);
  setup.contact.barrier_stiffness *= 2e-6;  // 4096 times as much is too little still
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  StepResult result = simulation.advance();
  while (result.ok && !simulation.finished()) {
    EXPECT_EQ(depth_in_plates(simulation.state()), 0);
    result = simulation.advance();
  }
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("curved edges reach into what they touch"), std::string::npos) << result.reason;
  EXPECT_EQ(depth_in_plates(simulation.state()), 0);
}

/// Lets one edge of a ball at rest come down beside a plate.
TEST(ChordBound, CountsWhatIsNearACurve) {
  itr::Setup<2> setup = pressed_ball<2>(1, 4);
  Mesh<2> mesh = setup.mesh;
  mesh.set_curved_edges(mesh.edges());
  VectorX x(2 * (mesh.num_nodes() + 4));
  const std::vector<Vec<2>> rest = mesh.rest();
  for (std::size_t i = 0; i < rest.size(); ++i) vertex_of<2>(x, static_cast<int>(i)) = rest[i];
  for (int i = 0; i < 4; ++i) vertex_of<2>(x, mesh.num_nodes() + i) = setup.obstacles.rest[i];
  EXPECT_EQ(find_chord_demand(setup, mesh, {}, x).excess, 0);  // straight
  int lowest = 0;
  for (int f = 0; f < mesh.facet_slots(); ++f)
    if (mesh.rest(mesh.facet(f)[0])[1] + mesh.rest(mesh.facet(f)[1])[1] <
        mesh.rest(mesh.facet(lowest)[0])[1] + mesh.rest(mesh.facet(lowest)[1])[1])
      lowest = f;
  const auto [a, b] = mesh.facet(lowest);
  const int edge = mesh.node_of(a, b) - mesh.num_vertices();
  vertex_of<2>(x, mesh.node_of(a, b))[1] -= 0.02;  // its chords are left by 0.005
  for (int i = 0; i < 2; ++i) vertex_of<2>(x, mesh.num_nodes() + i)[1] = -1.006;
  ChordDemand demand = find_chord_demand(setup, mesh, {}, x);
  EXPECT_GT(demand.excess, 1);

  int told = 0;
  const Logger logger([&](LogLevel level, std::string_view message) {
    told += level == LogLevel::warning && message.find("can have no shorter chords") != message.npos;
  });
  State<2> state;
  state.mesh = mesh;
  state.history.x = {x};
  Watch<2> watch;
  for (int step = 0; step < 2; ++step) watch.look(setup, state, {}, {}, logger);
  EXPECT_EQ(told, 2) << "at each step, so that a run that goes on counts as one that was never stopped";

  EXPECT_GT(demand.levels[edge], 0);
  for (int round = 0; round < 4 && demand.excess > 1; ++round) demand = find_chord_demand(setup, mesh, demand.levels, x);
  EXPECT_LE(demand.excess, 1);
  EXPECT_EQ(std::count(demand.levels.begin(), demand.levels.end(), 0), mesh.num_curved() - 1);

  // The chord from a to the node and the curve are 0.005 apart in its middle.
  const Vec<2> middle = (vertex_of<2>(x, a) + vertex_of<2>(x, mesh.node_of(a, b))) / 2;
  vertex_of<2>(x, mesh.num_nodes()) = middle - Vec<2>(0, 1);
  for (const double tip : {0.006, 0.0025}) {
    vertex_of<2>(x, mesh.num_nodes() + 1) = middle - Vec<2>(0, tip);
    EXPECT_EQ(are_curves_apart(setup, mesh, {}, x), tip > 0.005);
  }
}

}  // namespace
}  // namespace itr
