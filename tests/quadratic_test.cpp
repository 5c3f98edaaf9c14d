// SPDX-License-Identifier: MIT
// Quadratic elements: validity everywhere in a cell and along its motion, the space, every term of the potential on curved
// edges, and whole runs.
#include <gtest/gtest.h>

#include <numeric>
#include <random>
#include <set>

#include "core/parallel.hpp"
#include "curved_mesh.hpp"
#include "derivatives.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"
#include "energy/pressure.hpp"
#include "fem/chords.hpp"
#include "fem/quadrature.hpp"
#include "geometry/quadratic_validity.hpp"
#include "itr/core.hpp"
#include "random_quadratic.hpp"
#include "remesh/edits.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/invariants.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

template <typename T>
class Quadratic : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Quadratic, Dimensions);

TYPED_TEST(Quadratic, ValidityIsNeverClaimedFalsely) {
  constexpr int Dim = TypeParam::value;
  constexpr int kCells = Dim == 2 ? 100000 : 30000, kSamples = 40;
  std::mt19937 random(3);
  int proven = 0, doubtful = 0;
  for (int i = 0; i < kCells; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.02 * (i % 16));
    const double sampled = least_sampled<Dim>(x, random, kSamples);
    if (is_positive_everywhere<Dim>(x)) {
      ++proven;
      ASSERT_GT(sampled, 0) << i;
      ASSERT_GE(sampled, min_jacobian_bound<Dim>(x, 0.01)) << i;
      ASSERT_TRUE(is_positive_everywhere_exact<Dim>(x)) << i;
    } else if (sampled > 0 && is_positive_everywhere_exact<Dim>(x)) {
      ++doubtful;
    }
  }
  EXPECT_GT(proven, kCells / 5);
  EXPECT_LT(proven, kCells);
  EXPECT_LE(doubtful, kCells / 1000);  // valid, but not proven in floating point
}

TYPED_TEST(Quadratic, QuickBoundsTellWhatFullOnesDo) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(4);
  int less = 0, varying_little = 0;
  for (int i = 0; i < 3000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.02 * (i % 16));
    const double bound = min_jacobian_bound<Dim>(x, 0.1);
    for (const double fraction : {0.2, 0.9, 1.1, 3.0, -1.0}) {
      const double enough = fraction * std::abs(bound);
      EXPECT_EQ(min_jacobian_bound<Dim>(x, 0.1, enough) < enough, bound < enough) << i << ", " << fraction;
      less += bound < enough;
    }
    constexpr double kMost = 0.2;
    if (!varies_little<Dim>(x, kMost)) continue;
    EXPECT_GT(bound, 0.9 * std::pow((1 - kMost) / (1 + kMost), Dim) * least_sampled<Dim>(x, random, 10)) << i;
    ++varying_little;
  }
  EXPECT_GT(less, 1000);
  EXPECT_GT(varying_little, 50);
}

TYPED_TEST(Quadratic, ValidityDoesNotDependOnScaleAndPlace) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.02 * (i % 16));
    const bool is_valid = is_positive_everywhere<Dim>(x);
    for (const double scale : {0x1p-30, 0x1p30}) EXPECT_EQ(is_positive_everywhere<Dim>(scale * x), is_valid) << i;
  }
}

/// Cells that touch validity's border: the middle node of an edge at a quarter of it, where det vanishes at a corner.
TYPED_TEST(Quadratic, ValidityOfDegenerateCellsIsRefused) {
  constexpr int Dim = TypeParam::value;
  for (int k = 0; k < Dim; ++k) {
    QuadraticCell<Dim> x = unit_cell<Dim>();
    x.col(Dim + 1 + k) = 0.25 * x.col(k + 1);
    EXPECT_FALSE(is_positive_everywhere<Dim>(x));
    EXPECT_FALSE(is_positive_everywhere_exact<Dim>(x));
    x.col(Dim + 1 + k) = (0.25 + 1e-9) * x.col(k + 1);
    EXPECT_TRUE(is_positive_everywhere_exact<Dim>(x));
  }
}

TYPED_TEST(Quadratic, StepsNeverPassAnInversion) {
  constexpr int Dim = TypeParam::value;
  constexpr int kSteps = Dim == 2 ? 20000 : 4000, kTimes = 20, kSamples = 20;
  std::mt19937 random(7);
  int cut = 0, far = 0;
  for (int i = 0; i < kSteps; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.08);
    if (!is_positive_everywhere<Dim>(x)) continue;
    const QuadraticCell<Dim> dx = random_motion<Dim>(random, 0.1 * (1 + i % 10));
    const double t = max_positive_step<Dim>(x, dx);
    ASSERT_GT(t, 0);
    for (int k = 0; k <= kTimes; ++k)
      ASSERT_GT(least_sampled<Dim>(x + (t * k / kTimes) * dx, random, kSamples), 0) << i << ' ' << k;
    if (t == 1) continue;
    ++cut;
    far += is_positive_everywhere_exact<Dim>(x + std::min(1.0, 1.1 * t) * dx);  // stopped early
  }
  EXPECT_GT(cut, kSteps / 10);
  EXPECT_LE(far, cut / 20);
}

template <int Dim>
Mesh<Dim> two_cells() {
  if constexpr (Dim == 2)
    return {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {1, 2}};
  else
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}, {{0, 1, 2, 3}, {1, 4, 2, 3}}, {1, 2}};
}

/// The mesh with some of its edges curved.
template <int Dim>
Mesh<Dim> randomly_curved(const Mesh<Dim>& mesh, std::mt19937& random) {
  std::vector<EdgeKey> edges;
  for (const EdgeKey& edge : mesh.edges())
    if (random() % 3) edges.push_back(edge);
  return curved(mesh, edges);
}

template <int Dim>
VectorX perturbed(const CellSet<Dim>& cells, std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> noise(-amount, amount);
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v)
    for (int c = 0; c < Dim; ++c) x[Dim * v + c] = (c == 0 ? 0.8 : 1.1) * cells.rest[v][c] + noise(random);
  return x;
}

const std::map<int, Material> kMaterials = {
    {1, {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3}},
    {2, {.youngs_modulus = 50, .poisson_ratio = 0.2, .density = 1, .density_at = [](const Vec<3>& X) { return 1 + X[0]; }}}};

TYPED_TEST(Quadratic, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = two_cells<Dim>();
  std::mt19937 random(11);
  for (int i = 0; i < 12; ++i) {
    const CellSet<Dim> cells = whole_mesh(i == 0 ? of_orders(mesh, {{1, 2}, {2, 2}}) : randomly_curved(mesh, random), {});
    std::map<int, Material> materials = kMaterials;
    materials.at(1).law = static_cast<MaterialLaw>(i % 4);
    materials.at(2).youngs_modulus_at = [](const Vec<3>& X) { return 50 + 20 * X[1]; };
    const VectorX x = perturbed(cells, random, 0.02);
    ElasticEnergy<Dim> elastic(cells, materials, 0.3);
    expect_derivatives(elastic, x, 1e-6, 1e-6);
    expect_psd(elastic, x);
    elastic.set_quadrature_levels(QuadratureLevels(cells.curved().size(), 2));
    expect_derivatives(elastic, x, 1e-6, 1e-6);
    for (const MassKind kind : {MassKind::consistent, MassKind::lumped})
      expect_derivatives(InertiaEnergy<Dim>(cells, materials, kind, perturbed(cells, random, 0.2)), x, 1e-4, 1e-7);
    Loads<Dim> loads;
    loads.acceleration = [](const Vec<Dim>& X) { return Vec<Dim>(X * 2 + Vec<Dim>::Ones()); };
    loads.tractions.emplace_back(kNoTag, [](const Vec<Dim>& X) { return Vec<Dim>(X - Vec<Dim>::Ones()); });
    expect_derivatives(LoadEnergy<Dim>(cells, materials, loads, 0.3), x, 1e-4, 1e-8);
  }
}

/// Volume that the cells enclose, by the determinant of the deformation gradient.
template <int Dim>
double deformed_volume(const CellSet<Dim>& cells, const VectorX& x) {
  double sum = 0;
  for (const auto& element : cells.straight()) sum += element.volume * deformation_gradient<Dim>(element, x).determinant();
  for (const auto& element : cells.curved())
    for (const auto& point : quadrature<Dim>(Dim)) {
      const Mat<Dim> F = at_nodes<Dim>(element.nodes(), x) * shape_gradients<Dim>(element, point.weights).transpose();
      sum += element.volume * point.fraction * F.determinant();
    }
  return sum;
}

TYPED_TEST(Quadratic, PressureOnAClosedSurfaceIsThatOfTheEnclosedVolume) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = two_cells<Dim>();
  std::mt19937 random(17);
  Workspace workspace;
  for (int i = 0; i < 8; ++i) {
    CellSet<Dim> cells = whole_mesh(i == 0 ? of_orders(mesh, {{1, 2}, {2, 2}}) : randomly_curved(mesh, random), {});
    VectorX rest(Dim * cells.num_vertices);
    for (int v = 0; v < cells.num_vertices; ++v) vertex_of<Dim>(rest, v) = cells.rest[v];
    const VectorX lagged = perturbed(cells, random, 0.1), x = perturbed(cells, random, 0.1);
    Loads<Dim> loads;
    loads.pressures.emplace_back(kNoTag, [](const Vec<Dim>&) { return 2.5; });
    const PressureEnergy<Dim> closed(cells, loads, lagged, 0.3);
    std::vector<int> unknown(x.size());
    std::iota(unknown.begin(), unknown.end(), 0);
    EXPECT_FALSE(closed.is_lagged({unknown, static_cast<int>(x.size())}));
    EXPECT_NEAR(closed.value(x, workspace), 0.3 * 2.5 * (deformed_volume(cells, x) - deformed_volume(cells, rest)), 1e-12);
    expect_derivatives(closed, x, 1e-5, 1e-8);
    expect_psd(closed, x);
    cells.facets.back().tag = 6;
    expect_derivatives(PressureEnergy<Dim>(cells, loads, lagged, 0.3), x, 1e-5, 1e-8);
  }
}

/// A facet alone, lagged where it is: the forces are the integrals of pressure, shape function and area normal.
TYPED_TEST(Quadratic, PressureOnOneFacetPushesAlongItsNormals) {
  constexpr int Dim = TypeParam::value;
  constexpr int kFine = 400;  // midpoints a direction
  const Mesh<Dim> mesh = two_cells<Dim>();
  std::mt19937 random(19);
  CellSet<Dim> cells = whole_mesh(of_orders(mesh, {{1, 2}, {2, 2}}), {});
  const auto loaded = cells.facets.front();
  const auto nodes = loaded.nodes();
  cells.facets = {loaded};
  Loads<Dim> loads;
  loads.pressures.emplace_back(kNoTag, [](const Vec<Dim>&) { return 2.5; });
  const VectorX x = perturbed(cells, random, 0.1);
  const VectorX gradient = gradient_of(PressureEnergy<Dim>(cells, loads, x, 1), x);
  const auto p = at_nodes<Dim>(nodes, x);
  VectorX expected = VectorX::Zero(x.size());
  Eigen::Matrix<double, Dim - 1, Dim> linear;
  linear << Eigen::Matrix<double, Dim - 1, 1>::Constant(-1), Mat<Dim - 1>::Identity();
  for (int i = 0; i < kFine; ++i)
    for (int j = 0; j < (Dim == 2 ? 1 : kFine - i); ++j)
      for (const bool is_upper : {false, true}) {  // the two triangles of a square
        if (Dim == 2 ? is_upper : is_upper && j == kFine - i - 1) continue;
        const double third = is_upper ? 2.0 / 3 : 1.0 / 3, u = (i + (Dim == 2 ? 0.5 : third)) / kFine,
                     v = (j + third) / kFine;
        std::array<double, Dim> l;
        if constexpr (Dim == 2)
          l = {1 - u, u};
        else
          l = {1 - u - v, u, v};
        const Eigen::Matrix<double, Dim, Dim - 1> t =
            p * quadratic_gradients<Dim - 1, Dim - 1>(loaded.curved, l, linear).transpose();
        Vec<Dim> normal;
        if constexpr (Dim == 2)
          normal = Vec<2>(t(1, 0), -t(0, 0)) / kFine;
        else
          normal = t.col(0).cross(t.col(1)) / (2 * kFine * kFine);
        const auto shapes = quadratic_shapes<Dim - 1>(loaded.curved, l);
        for (int n = 0; n < kQuadraticNodes<Dim - 1>; ++n) vertex_of<Dim>(expected, nodes[n]) += 2.5 * shapes[n] * normal;
      }
  EXPECT_LE((gradient - expected).norm(), 1e-4 * expected.norm());
}

/// Every space holds the linear functions: there all energies are those of straight cells.
TYPED_TEST(Quadratic, LinearFunctionsHaveTheEnergiesOfStraightCells) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = two_cells<Dim>();
  std::mt19937 random(13);
  Workspace workspace;
  std::map<int, Material> materials = kMaterials;
  materials.at(2).density_at = nullptr;
  for (int i = 0; i < 8; ++i) {
    const Mesh<Dim> with_curves = i == 0 ? of_orders(mesh, {{1, 2}, {2, 2}}) : randomly_curved(mesh, random);
    const CellSet<Dim> straight = whole_mesh(mesh, {}), curved = whole_mesh(with_curves, {});
    const VectorX x = perturbed(straight, random, 0.05);
    VectorX y(Dim * curved.num_vertices);
    y.head(x.size()) = x;
    for (const auto& [a, b] : with_curves.curved_edges())
      vertex_of<Dim>(y, with_curves.node_of(a, b)) = (vertex_of<Dim>(x, a) + vertex_of<Dim>(x, b)) / 2;
    const double W = ElasticEnergy<Dim>(straight, materials, 1).value(x, workspace);
    ElasticEnergy<Dim> elastic(curved, materials, 1);
    EXPECT_NEAR(elastic.value(y, workspace), W, 1e-12 * W);
    for (std::uint8_t level = 1; level <= kMostClosedLevel; ++level) {
      elastic.set_quadrature_levels(QuadratureLevels(curved.curved().size(), level));
      EXPECT_NEAR(elastic.value(y, workspace), W, 1e-12 * W);
    }
    const InertiaEnergy<Dim> of_straight(straight, materials, MassKind::consistent, VectorX::Zero(x.size()));
    const double T = of_straight.value(x, workspace);
    const InertiaEnergy<Dim> of_curved(curved, materials, MassKind::consistent, VectorX::Zero(y.size()));
    EXPECT_NEAR(of_curved.value(y, workspace), T, 1e-12 * T);
    const InertiaEnergy<Dim> lumped(curved, materials, MassKind::lumped, VectorX::Zero(y.size()));
    VectorX momentum = VectorX::Zero(y.size()), straight_momentum = VectorX::Zero(x.size());
    lumped.add_mass_product(VectorX::Ones(y.size()), momentum);
    of_straight.add_mass_product(VectorX::Ones(x.size()), straight_momentum);
    EXPECT_NEAR(momentum.sum(), straight_momentum.sum(), 1e-12 * momentum.sum());
    EXPECT_GE(momentum.minCoeff(), 0);
  }
}

/// Neighbours cut a shared facet in the same way whatever its vertices' order is, and the parts cover it.
TEST(CurvedMesh, ChordFacetsCoverTheFacet) {
  const std::vector<Vec<3>> rest = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<EdgeKey> edges = {{0, 1}, {0, 2}, {1, 2}};
  for (int mask = 0; mask < 8; ++mask) {
    std::vector<EdgeKey> curved;
    for (int k = 0; k < 3; ++k)
      if (mask >> k & 1) curved.push_back(edges[k]);
    const auto node_of = [&](int a, int b) {
      const auto at = std::find(curved.begin(), curved.end(), edge_key(a, b));
      return at == curved.end() ? kNone : 3 + static_cast<int>(at - curved.begin());
    };
    std::vector<Vec<3>> nodes = rest;
    for (const auto& [a, b] : curved) nodes.push_back((rest[a] + rest[b]) / 2);
    std::set<std::array<int, 3>> first;
    for (const std::array<int, 3> facet :
         {std::array{0, 1, 2}, std::array{1, 2, 0}, std::array{2, 0, 1}, std::array{0, 2, 1}}) {
      std::vector<std::array<int, 3>> chords;
      for_each_chord<3>(facet, node_of, [&](const auto& ids) { chords.push_back(ids); });
      EXPECT_EQ(chords.size(), 1 + curved.size());
      double area = 0;
      std::set<std::array<int, 3>> sorted;
      for (const auto& [a, b, c] : chords) {
        area += (nodes[b] - nodes[a]).cross(nodes[c] - nodes[a])[2] / 2;
        sorted.insert(ascending(std::array{a, b, c}));
      }
      EXPECT_NEAR(area, facet[1] == 2 && facet[0] == 0 ? -0.5 : 0.5, 1e-15);
      if (first.empty()) first = sorted;
      EXPECT_EQ(sorted, first) << mask;
    }
  }
}

TEST(CurvedMesh, AnEdgeHasTheLeastOrderOfItsCells) {
  const Mesh<2> mesh = two_cells<2>();
  EXPECT_EQ(of_orders(mesh, {{1, 2}}).curved_edges(), (std::vector<EdgeKey>{{0, 1}, {1, 2}}));
  EXPECT_EQ(of_orders(mesh, {{1, 2}, {2, 2}}).num_curved(), 5);
  EXPECT_FALSE(of_orders(mesh, {{1, 1}}).has_nodes());
}

TEST(CurvedMesh, HasEdgesOfItsOwnOnlyAscendingAndOnce) {
  const std::vector<std::vector<EdgeKey>> wrong = {{{1, 3}},  {{0, 4}},         {{1, 0}},
                                                   {{-1, 2}}, {{0, 2}, {0, 1}}, {{0, 1}, {0, 1}}};
  Mesh<2> mesh = curved(two_cells<2>(), {{0, 1}});
  const std::uint64_t revision = mesh.revision();
  for (const auto& edges : wrong) {
    EXPECT_THROW(mesh.set_curved_edges(edges), InputError) << edges[0][0] << " " << edges[0][1];
    EXPECT_EQ(mesh.curved_edges(), (std::vector<EdgeKey>{{0, 1}}));
    EXPECT_EQ(mesh.revision(), revision);
  }
}

/// A revision stays with copies, and no two contents share one.
TEST(CurvedMesh, ChangesGiveNewRevisions) {
  Mesh<2> mesh = two_cells<2>();
  const Mesh<2> copy = mesh;
  EXPECT_EQ(copy.revision(), mesh.revision());
  std::set<std::uint64_t> revisions = {mesh.revision(), two_cells<2>().revision()};
  const auto expect_new = [&](const char* change) { EXPECT_TRUE(revisions.insert(mesh.revision()).second) << change; };
  mesh.set_facet_tag(0, 3);
  expect_new("tag of a facet");
  mesh.set_vertex_tag(1, 2);
  expect_new("tag of a vertex");
  mesh.set_curved_edges({{0, 1}});
  expect_new("curved edge");
  mesh.apply(make_split(mesh, {0, 2}));
  expect_new("split");
  EXPECT_FALSE(mesh.is_compact());
  mesh.compact();
  expect_new("compacted");
  EXPECT_TRUE(mesh.is_compact());
  EXPECT_EQ(mesh.edge_of_node(mesh.num_vertices()), (EdgeKey{0, 1}));
  EXPECT_EQ(revisions.size(), 7u);
}

/// A square of n x n x 2 triangles with its lower left corner at `origin`.
void add_square(double size, Vec<2> origin, int n, int body, std::vector<Vec<2>>& rest,
                std::vector<std::array<int, 3>>& cells, std::vector<int>& bodies) {
  const int first = static_cast<int>(rest.size());
  const auto id = [&](int i, int j) { return first + j * (n + 1) + i; };
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) rest.push_back(origin + size / n * Vec<2>(i, j));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      cells.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      cells.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
      bodies.insert(bodies.end(), {body, body});
    }
}

/// Two soft squares, one quadratic, that are thrown at each other with friction.
Setup<2> collision() {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> bodies;
  add_square(1, {0, 0}, 3, 1, rest, cells, bodies);
  add_square(1, {1.05, 0.3}, 3, 2, rest, cells, bodies);
  Setup<2> setup;
  setup.mesh = Mesh<2>(rest, cells, bodies);
  setup.order = {{1, 2}};
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e4, .poisson_ratio = 0.3, .density = 1000};
  setup.time.dt = 0.01;
  setup.time.steps = 20;
  setup.contact.enabled = true;
  setup.contact.dhat = 0.005;
  setup.contact.convergent = true;  // gaps are wide enough for chords
  setup.contact.barrier_stiffness = 1e3;
  setup.contact.adaptive_stiffness = false;
  setup.contact.friction_coefficient = 0.3;
  setup.initial_velocity = {{1, [](const Vec<2>&, double) { return Vec<2>(2, 0); }},
                            {2, [](const Vec<2>&, double) { return Vec<2>(-2, 0); }}};
  return setup;
}

TEST(QuadraticRun, BodiesThatCollideStayValidAndKeepMomentum) {
  linear::Registry registry;
  Simulation<2> simulation(collision(), registry);
  double nearest = 1;
  for (int step = 0; step < 20; ++step) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    nearest = std::min(nearest, result.report.min_distance);
    const State<2>& state = simulation.state();
    EXPECT_EQ(find_violation(simulation.setup(), state.mesh, state.history.x[0]), "");
  }
  EXPECT_LT(nearest, 0.005);  // they did touch
  const State<2>& state = simulation.state();
  const CellSet<2> cells = whole_mesh(state.mesh, {});
  VectorX momentum = VectorX::Zero(state.history.v[0].size());
  InertiaEnergy<2>(cells, simulation.setup().materials, MassKind::consistent, VectorX::Zero(momentum.size()))
      .add_mass_product(state.history.v[0], momentum);
  Vec<2> total = Vec<2>::Zero();
  for (Eigen::Index i = 0; i < momentum.size(); i += 2) total += momentum.segment<2>(i);
  EXPECT_LT(total.norm(), 1e-2);  // of 2000 kg m/s each way, at Newton's tolerance
}

TEST(QuadraticRun, HasTheSameBitsOnAnyNumberOfThreads) {
  VectorX first;
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    linear::Registry registry;
    Simulation<2> simulation(collision(), registry);
    for (int step = 0; step < 8; ++step) ASSERT_TRUE(simulation.advance().ok);
    if (first.size() == 0) first = simulation.state().history.x[0];
    EXPECT_EQ(simulation.state().history.x[0], first);
  }
}

TEST(QuadraticRun, RefusesWhatItCannotDo) {
  linear::Registry registry;
  ::itr::Setup<2> setup = collision();
  setup.remesh.enabled = setup.lump_mass = true;
  EXPECT_THROW(Simulation<2>(setup, registry), ::itr::InputError);
}

}  // namespace
}  // namespace itr
