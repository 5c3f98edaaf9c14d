// SPDX-License-Identifier: MIT
// Bodies with eigenstrains: free, between walls, on each other and in time.
#include <gtest/gtest.h>

#include <cmath>

#include "advance.hpp"
#include "itr/itr.hpp"
#include "rings.hpp"
#include "simulation/cell_stress.hpp"

namespace itr {
namespace {

template <typename T>
class GrowingBody : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(GrowingBody, Dimensions);

/// A unit square or cube of random cells, whose sides have the tags 1 (x = 0), 2 (y = 0), 3 (z = 0).
template <int Dim>
itr::Setup<Dim> unit_body(MaterialLaw law, double e) {
  itr::Setup<Dim> setup;
  if constexpr (Dim == 2) {
    const int n = 4;
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 3>> cells;
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) rest.emplace_back(double(i) / n, double(j) / n);
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int a = j * (n + 1) + i;
        cells.push_back({a, a + 1, a + n + 2});
        cells.push_back({a, a + n + 2, a + n + 1});
      }
    setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  } else {
    std::vector<Vec<3>> rest;
    for (int i = 0; i < 8; ++i) rest.emplace_back(i & 1, i >> 1 & 1, i >> 2);
    setup.mesh = Mesh<3>(rest, {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}},
                         std::vector<int>(6, 1));
  }
  for (const FacetId f : setup.mesh.live_facets())
    for (int c = 0; c < Dim; ++c) {
      bool low = true, high = true;
      for (const VertexId v : setup.mesh.facet(f)) {
        low = low && setup.mesh.rest(v)[c] < 1e-9;
        high = high && setup.mesh.rest(v)[c] > 1 - 1e-9;
      }
      if (low) setup.mesh.set_facet_tag(f, 1 + c);
      if (high) setup.mesh.set_facet_tag(f, 11 + c);
    }
  setup.materials[1] = {.law = law, .youngs_modulus = 2e5, .poisson_ratio = 0.3, .density = 1000};
  setup.materials[1].eigenstrain = [e](const Vec<3>&, double t) { return Mat<3>(e * t * Mat<3>::Identity()); };
  setup.fields.stress = true;
  setup.time = {.is_static = true, .dt = 1, .steps = 1};
  return setup;
}

/// Holds one component on the sides with these tags.
template <int Dim>
void hold(itr::Setup<Dim>& setup, std::initializer_list<int> tags) {
  for (const int tag : tags) {
    DirichletCondition<Dim> condition{tag, {}, [](const auto&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }};
    condition.components[static_cast<std::size_t>((tag - 1) % 10)] = true;
    setup.dirichlet.push_back(condition);
  }
}

template <int Dim>
std::vector<double> stress_of(const Simulation<Dim>& simulation) {
  return cell_stress(simulation).cauchy;
}

/// Nothing holds it, in any time integration.
TYPED_TEST(GrowingBody, FreeBodiesGrowWithoutStress) {
  constexpr int Dim = TypeParam::value;
  constexpr double kStrain = 0.05;
  for (const MaterialLaw law : {MaterialLaw::linear, MaterialLaw::neo_hookean})
    for (const bool quasistatic : {false, true})
      for (const int order : {1, 2}) {
        auto setup = unit_body<Dim>(law, kStrain);
        setup.order[1] = order;
        setup.time.is_static = !quasistatic;
        setup.time.quasistatic = quasistatic;
        linear::Registry registry;
        Simulation<Dim> simulation(setup, registry);
        advance(simulation);
        const auto x = simulation.positions();
        const auto& mesh = simulation.mesh();
        for (VertexId v = 0; v < mesh.num_vertices(); ++v)
          for (VertexId w = 0; w < v; ++w) {
            const double length = (vertex_of<Dim>(x, v) - vertex_of<Dim>(x, w)).norm();
            EXPECT_NEAR(length, (1 + kStrain) * (mesh.rest(v) - mesh.rest(w)).norm(), 1e-7);
          }
        for (const double s : stress_of(simulation)) EXPECT_NEAR(s, 0, 1e-5 * 2e5 * kStrain);
      }
}

/// Between rigid walls on all sides: -E e / (1 - 2 nu), in plane strain too; between two, with free sides: -E e.
TEST(Eigenstrain, WallsPressAsClosedFormsSay) {
  constexpr double kE = 2e5, kNu = 0.3, kStrain = 1e-5;
  const auto run = [&]<int Dim>(itr::Setup<Dim> setup, std::initializer_list<int> tags, double expected) {
    hold<Dim>(setup, tags);
    linear::Registry registry;
    Simulation<Dim> simulation(setup, registry);
    advance(simulation);
    const std::vector<double> stress = stress_of(simulation);
    for (std::size_t i = 0; i < stress.size(); i += Dim * Dim) EXPECT_NEAR(stress[i], expected, 2e-4 * std::abs(expected));
  };
  const double all = -kE * kStrain / (1 - 2 * kNu), one = -kE * kStrain;
  run(unit_body<3>(MaterialLaw::linear, kStrain), {1, 2, 3, 11, 12, 13}, all);
  run(unit_body<3>(MaterialLaw::linear, kStrain), {1, 2, 3, 11}, one);
  auto plane_strain = unit_body<2>(MaterialLaw::linear, kStrain);
  plane_strain.materials[1].plane_strain = true;
  run(plane_strain, {1, 2, 11, 12}, all);
  run(plane_strain, {1, 2, 11}, -kE * kStrain / (1 - kNu));
  run(unit_body<2>(MaterialLaw::linear, kStrain), {1, 2, 11}, one);
  run(unit_body<2>(MaterialLaw::linear, kStrain), {1, 2, 11, 12}, one / (1 - kNu));
  // Large strains: a neo-Hookean block in a rigid box at F_e = I / (1 + e).
  constexpr double kLarge = 0.2;
  const double mu = kE / (2 * (1 + kNu)), lambda = kE * kNu / ((1 + kNu) * (1 - 2 * kNu)), s = 1 / (1 + kLarge);
  run(unit_body<3>(MaterialLaw::neo_hookean, kLarge), {1, 2, 3, 11, 12, 13},
      (mu * (s * s - 1) + 3 * lambda * std::log(s)) / (s * s * s));
}

/// A body of revolution that is held along its axis grows around it, too.
TEST(Eigenstrain, HoopsGrow) {
  constexpr double kStrain = 1e-3;
  auto setup = unit_body<2>(MaterialLaw::linear, kStrain);
  std::vector<Vec<2>> rest = setup.mesh.rest();
  for (Vec<2>& X : rest) X[0] += 1;  // a ring
  std::vector<std::array<int, 3>> cells;
  for (const CellId c : setup.mesh.live_cells()) cells.push_back(setup.mesh.cell(c));
  setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  setup.mesh.set_axisymmetric(true);
  for (const FacetId f : setup.mesh.live_facets())
    if (setup.mesh.rest(setup.mesh.facet(f)[0])[1] < 1e-9 && setup.mesh.rest(setup.mesh.facet(f)[1])[1] < 1e-9)
      setup.mesh.set_facet_tag(f, 2);
  hold<2>(setup, {2});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  for (VertexId v = 0; v < simulation.mesh().num_vertices(); ++v) {
    const Vec<2> expected = (1 + kStrain) * simulation.mesh().rest(v);
    EXPECT_LE((vertex_of<2>(simulation.positions(), v) - expected).norm(), 1e-9);
  }
  for (const double s : stress_of(simulation)) EXPECT_NEAR(s, 0, 1e-4);
}

/// Strains of heat that vary in place and time bend a body; remeshing brings linear elements near the quadratic ones.
TEST(Eigenstrain, FollowsTimeAndPlaceOnMeshesThatChange) {
  const auto run = [](int order, bool remeshed) {
    auto setup = unit_body<2>(MaterialLaw::neo_hookean, 0);
    setup.materials[1].eigenstrain = [](const Vec<3>& X, double t) {
      return Mat<3>(0.1 * t * X[0] * X[0] * Mat<3>::Identity());
    };
    setup.materials[1].eigenstrain_varies = true;
    hold<2>(setup, {1, 2});
    setup.time = {.quasistatic = true, .dt = 0.25, .steps = 4};
    setup.remesh.enabled = remeshed;
    setup.remesh.split.acceptance_tolerance = 1e-3;
    setup.order[1] = order;
    setup.fields.points = {{"corner", {1, 1, 0}}};
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    int splits = 0;
    std::vector<double> u;
    while (!simulation.finished()) {
      splits += advance(simulation).report.splits.accepted;
      simulation.observe([&](const FrameView<2>& frame) { u = frame.asked->points[0].u; });
    }
    EXPECT_EQ(splits > 0, remeshed);
    return u;
  };
  const auto quadratic = run(2, false), linear = run(1, false), remeshed = run(1, true);
  EXPECT_NEAR(quadratic[0], 0.0077, 0.0001);
  EXPECT_NEAR(quadratic[1], 0.0769, 0.0002);
  for (int c = 0; c < 2; ++c) {
    EXPECT_GT(std::abs(linear[c] - quadratic[c]), 0.002);
    EXPECT_LT(std::abs(remeshed[c] - quadratic[c]), 0.7 * std::abs(linear[c] - quadratic[c]));
  }
}

/// Timoshenko 1925: equal layers of total thickness h bend to the curvature 3/2 (difference of strains) / h.
TEST(Eigenstrain, BimetalBendsAsTimoshenkoSays) {
  constexpr double kLength = 1, kHeight = 0.05, kStrain = 1e-3;
  constexpr int kAlong = 40, kAcross = 2;
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  for (int j = 0; j <= kAcross; ++j)
    for (int i = 0; i <= kAlong; ++i) rest.emplace_back(kLength * i / kAlong, kHeight * j / kAcross);
  std::vector<int> bodies;
  for (int j = 0; j < kAcross; ++j)
    for (int i = 0; i < kAlong; ++i) {
      const int a = j * (kAlong + 1) + i;
      cells.push_back({a, a + 1, a + kAlong + 2});
      cells.push_back({a, a + kAlong + 2, a + kAlong + 1});
      bodies.insert(bodies.end(), 2, j + 1);
    }
  itr::Setup<2> setup;
  setup.mesh = Mesh<2>(rest, cells, bodies);
  for (const FacetId f : setup.mesh.live_facets())
    if (setup.mesh.rest(setup.mesh.facet(f)[0])[0] + setup.mesh.rest(setup.mesh.facet(f)[1])[0] < 1e-9)
      setup.mesh.set_facet_tag(f, 1);
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }}};
  for (const int body : {1, 2}) {
    setup.materials[body] = {.law = MaterialLaw::neo_hookean, .youngs_modulus = 1e9, .poisson_ratio = 0.3, .density = 1};
    setup.order[body] = 2;
  }
  setup.materials[1].eigenstrain = [e = kStrain](const Vec<3>&, double) { return Mat<3>(e * Mat<3>::Identity()); };
  setup.time = {.is_static = true, .dt = 1, .steps = 1};
  setup.fields.points = {{"tip", {kLength, kHeight / 2, 0}}, {"middle", {kLength / 2, kHeight / 2, 0}}};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  double tip = 0, middle = 0;
  simulation.observe([&](const FrameView<2>& frame) {
    tip = frame.asked->points[0].u[1];
    middle = frame.asked->points[1].u[1];
  });
  const double curvature = 1.5 * kStrain / kHeight;   // the warmer layer is below: the tip rises
  const double slope = 2 * (tip - middle) / kLength;  // away from the clamp, whose warping shifts both
  EXPECT_NEAR(tip, curvature * kLength * kLength / 2, 0.01 * tip);
  EXPECT_NEAR(slope, curvature * kLength * 0.75, 0.01 * slope);
}

/// A ring that shrinks by e onto another one, as if they overlapped by e b (plane stress); d-hat is chosen.
TEST(Eigenstrain, ShrunkRingPressesAsLameSays) {
  constexpr double kA = 0.005, kB = 0.02, kC = 0.04, kGap = 2e-6, kStrain = 1e-3, kE = 2e11;
  itr::Setup<2> setup = quarter_rings({{kA, kB, 180, 10}, {kB + kGap, kC, 194, 10}});
  for (const int body : {1, 2})
    setup.materials[body] = {.law = MaterialLaw::linear, .youngs_modulus = kE, .poisson_ratio = 0.3, .density = 7800};
  setup.materials[2].eigenstrain = [e = kStrain](const Vec<3>&, double t) { return Mat<3>(-e * t * Mat<3>::Identity()); };
  setup.time = {.is_static = true, .dt = 1, .steps = 1};
  setup.contact = {.enabled = true, .dhat = 0, .convergent = true};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = advance(simulation);
  const double p = press_fit_pressure(kA, kB, kC, kE, 0.3, kStrain * kB - kGap);
  EXPECT_NEAR(mean_radial_stress(simulation, 2, kB), -p, 0.005 * p);
  EXPECT_GT(result.report.min_distance, 0);
}

}  // namespace

}  // namespace itr
