// SPDX-License-Identifier: MIT
// Fluids that come between surfaces in contact: where they stop, that they open and leave what they wet, leaks, sums of
// forces, mirrored scenes, resumed runs, what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "advance.hpp"
#include "core/parallel.hpp"
#include "itr/core.hpp"
#include "scene_folder.hpp"
#include "simulation/contact_pressure.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/resultant.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

constexpr double kModulus = 1e6, kHeight = 0.5, kDhat = 1e-4;
constexpr int kLeft = 1, kTop = 2, kRight = 3, kBottom = 4, kSide = 5, kWet = 14;

/// 1 wide, 0.5 high (and deep), of boxes along x; a mesh of an even number is its mirror image.
template <int Dim>
Mesh<Dim> brick(int boxes);

template <int Dim>
void tag_brick(Mesh<Dim>& mesh) {
  for (const FacetId f : mesh.live_facets()) {
    Vec<Dim> low = mesh.rest(mesh.facet(f)[0]), high = low;
    for (const VertexId v : mesh.facet(f)) {
      low = low.cwiseMin(mesh.rest(v));
      high = high.cwiseMax(mesh.rest(v));
    }
    const bool is_bottom = high[1]<1e-9, is_top = low[1]> kHeight - 1e-9, is_left = high[0] < 1e-9;
    mesh.set_facet_tag(f, is_bottom ? kBottom : is_top ? kTop : is_left ? kLeft : low[0] > 1 - 1e-9 ? kRight : kSide);
  }
}

template <>
Mesh<2> brick<2>(int boxes) {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  for (int j = 0; j <= boxes / 2; ++j)
    for (int i = 0; i <= boxes; ++i) rest.emplace_back(1.0 * i / boxes, 1.0 * j / boxes);
  for (int j = 0; j < boxes / 2; ++j)
    for (int i = 0; i < boxes; ++i) {
      const int a = j * (boxes + 1) + i, b = a + 1, c = a + boxes + 2, d = a + boxes + 1;
      const bool rises = i < boxes / 2;
      cells.push_back(rises ? std::array{a, b, c} : std::array{a, b, d});
      cells.push_back(rises ? std::array{a, c, d} : std::array{b, c, d});
    }
  Mesh<2> mesh(rest, cells, std::vector<int>(cells.size(), 1));
  tag_brick(mesh);
  return mesh;
}

template <>
Mesh<3> brick<3>(int boxes) {
  const std::array<int, 3> n{boxes, boxes / 2, boxes / 2};
  std::vector<Vec<3>> rest;
  std::vector<std::array<int, 4>> cells;
  for (int k = 0; k <= n[2]; ++k)
    for (int j = 0; j <= n[1]; ++j)
      for (int i = 0; i <= n[0]; ++i) rest.emplace_back(Vec<3>(i, j, k) / boxes);
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) {
        const auto corner = [&](int bits) {
          return i + (bits & 1) + (n[0] + 1) * (j + (bits >> 1 & 1) + (n[1] + 1) * (k + (bits >> 2 & 1)));
        };
        for (const auto& [a, b] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
          cells.push_back({corner(0), corner(a), corner(b), corner(7)});
      }
  Mesh<3> mesh(rest, cells, std::vector<int>(cells.size(), 1));
  tag_brick(mesh);
  return mesh;
}

/// How far the top has come down.
template <int Dim>
using Squeeze = std::function<double(const Vec<Dim>& X, double t)>;

/// A brick without lateral strain whose top is moved down onto a table, with a fluid of the pressure beside it at the left
/// that wets its bottom, and leaks to the right.
template <int Dim>
Setup<Dim> seal(int boxes, double pressure, const Squeeze<Dim>& squeeze) {
  Setup<Dim> setup;
  setup.mesh = brick<Dim>(boxes);
  setup.materials[1] = {.youngs_modulus = kModulus, .poisson_ratio = 0, .density = 1000};
  DirichletCondition<Dim> top{
      kTop, {}, [=](const Vec<Dim>& X, double t) { return Vec<Dim>(-squeeze(X, t) * Vec<Dim>::Unit(1)); }};
  top.components.fill(true);
  setup.dirichlet = {top};
  constexpr double y = -kDhat / 2;
  if constexpr (Dim == 2) {
    setup.obstacles.rest = {{-1, y}, {2, y}};
    setup.obstacles.edges = {{0, 1}};
  } else {
    setup.obstacles.rest = {{-1, y, -2}, {4, y, -2}, {-1, y, 4}};
    setup.obstacles.triangles = {{0, 2, 1}};
  }
  setup.obstacles.motion.assign(setup.obstacles.rest.size(), kNone);
  setup.contact = {.enabled = true, .dhat = kDhat, .convergent = true, .barrier_stiffness = 1e7};
  setup.pressure = {{kWet, [=](const RestPoint<Dim>&, double) { return pressure; }}};
  setup.fluids = {{.place = "the fluid", .wet = {{kBottom, kWet}}, .from = {kLeft}, .leaks_to = {kRight}}};
  setup.time = {.dt = 1, .steps = 4};
  setup.time.quasistatic = true;
  setup.fields = {.contact_forces = true, .friction_forces = true, .reaction_forces = true, .applied_forces = true};
  setup.fields.momentum = true;
  return setup;
}

template <int Dim>
Simulation<Dim> simulate(Setup<Dim> setup, std::vector<std::string>* said = nullptr) {
  static linear::Registry registry;
  Logger logger;
  if (said)
    logger = Logger([said](LogLevel level, std::string_view text) {
      if (level >= LogLevel::warning) said->emplace_back(text);
    });
  return Simulation<Dim>(std::move(setup), registry, logger);
}

/// The height of the wet bottom over the table, from the top that has come down.
double lifted(double squeeze, double pressure) {
  const double stress = pressure / (kModulus / 2);  // (1/F - F) E / 2 without lateral strain
  const double F = (-stress + std::sqrt(stress * stress + 4)) / 2;
  return kHeight * (1 - F) - squeeze;
}

template <int Dim>
double sum_y(const VectorX& force) {
  double sum = 0;
  for (Eigen::Index i = 1; i < force.size(); i += Dim) sum += force[i];
  return sum;
}

template <int Dim>
double wet_from(const Mesh<Dim>& mesh) {
  double first = 2;
  for (const FacetId f : mesh.live_facets())
    if (mesh.facet_tag(f) == kWet)
      for (const VertexId v : mesh.facet(f)) first = std::min(first, mesh.rest(v)[0]);
  return first;
}

template <int Dim>
void expect_pressed_seal_is_tight(int boxes) {
  constexpr double kPressure = 5e4, kSqueeze = 0.03;  // the seal presses by 6e4
  std::vector<std::string> said;
  auto simulation = simulate(seal<Dim>(boxes, kPressure, [](const Vec<Dim>&, double) { return kSqueeze; }), &said);
  const auto result = advance(simulation);
  EXPECT_EQ(result.report.wetted, 0);
  EXPECT_EQ(result.report.leaks, 0);
  EXPECT_EQ(sum_y<Dim>(result.forces.applied), 0);
  EXPECT_TRUE(said.empty()) << said[0];
}
TEST(Fluid, APressedSealIsTight2D) { expect_pressed_seal_is_tight<2>(8); }
TEST(Fluid, APressedSealIsTight3D) { expect_pressed_seal_is_tight<3>(4); }

/// The whole bottom lifts, since the fluid alone carries the brick.
template <int Dim>
void expect_loose_seal_leaks(int boxes) {
  constexpr double kPressure = 5e4, kSqueeze = 0.02;
  std::vector<std::string> said;
  auto simulation = simulate(seal<Dim>(boxes, kPressure, [](const Vec<Dim>&, double) { return kSqueeze; }), &said);
  const auto result = advance(simulation);
  EXPECT_EQ(result.report.wetted, 1);
  EXPECT_EQ(result.report.leaks, 1);
  const double area = Dim == 2 ? 1 : kHeight;
  EXPECT_NEAR(sum_y<Dim>(result.forces.applied), kPressure * area, 1e-6 * kPressure);
  EXPECT_NEAR(sum_y<Dim>(result.forces.reaction), -kPressure * area, 1e-6 * kPressure);
  EXPECT_NEAR(sum_y<Dim>(result.forces.contact), 0, 1e-9 * kPressure);
  const Mesh<Dim>& mesh = simulation.mesh();
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.rest(v)[1] == 0) {
      EXPECT_NEAR(simulation.positions()[Dim * v + 1], lifted(kSqueeze, kPressure), 1e-7);
    }
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].find("the fluid leaks from t = 1 s on"), std::string::npos) << said[0];
  EXPECT_EQ(advance(simulation).report.leaks, 1);
  EXPECT_EQ(said.size(), 1u);
}
TEST(Fluid, ALooseSealLeaksAndLifts2D) { expect_loose_seal_leaks<2>(8); }
TEST(Fluid, ALooseSealLeaksAndLifts3D) { expect_loose_seal_leaks<3>(4); }

/// Contact and fluid share the load where the critical pressure lets the fluid between surfaces that are pressed.
TEST(Fluid, PassesContactUpToTheCriticalPressure) {
  constexpr double kPressure = 2e4, kSqueeze = 0.02;
  for (const double critical : {3e4, 6e4}) {
    auto setup = seal<2>(8, kPressure, [](const Vec<2>&, double) { return kSqueeze; });
    setup.fluids[0].critical_pressure = critical;
    auto simulation = simulate(setup);
    const auto result = advance(simulation);
    const double carried = -sum_y<2>(result.forces.reaction);
    EXPECT_NEAR(carried, 4.1e4, 0.2e4);
    EXPECT_EQ(result.report.wetted, critical > carried);
    EXPECT_NEAR(sum_y<2>(result.forces.contact), critical > carried ? carried - kPressure : carried, 1e-3 * carried);
  }
}

/// One that is pressed again is left by the fluid, and ends as one that was never loose.
TEST(Fluid, LeavesWhatContactShuts) {
  constexpr double kPressure = 5e4;
  const auto squeeze = [](const Vec<2>&, double t) { return t < 1.5 ? 0.02 : 0.04; };
  auto again = simulate(seal<2>(8, kPressure, squeeze));
  EXPECT_EQ(advance(again).report.wetted, 1);
  const auto shut = advance(again);
  EXPECT_EQ(shut.report.wetted, 0);
  EXPECT_EQ(shut.report.leaks, 0);
  auto at_once = simulate(seal<2>(8, kPressure, [](const Vec<2>&, double) { return 0.04; }));
  const auto once = advance(at_once);
  EXPECT_NEAR(sum_y<2>(shut.forces.contact), sum_y<2>(once.forces.contact), 1e-6 * kPressure);
}

/// Looser to the right: the fluid from there stops in the middle, where contact presses more than it.
Squeeze<2> tilt(double sign) {
  return [sign](const Vec<2>& X, double) { return 0.03 - sign * 0.06 * (X[0] - 0.5); };
}
Setup<2> tilted(double sign) {
  auto setup = seal<2>(32, 3e4, tilt(sign));
  setup.fluids[0].from = {kLeft, kRight};
  setup.fluids[0].leaks_to.clear();
  return setup;
}

TEST(Fluid, StopsWhereContactPressesMore) {
  auto simulation = simulate(tilted(1));
  const auto result = advance(simulation);
  EXPECT_GT(result.report.wetted, 0.1);
  EXPECT_LT(result.report.wetted, 0.6);
  const Mesh<2>& mesh = simulation.mesh();
  const auto is_dry = [&](FacetId f) { return mesh.facet_tag(f) == kBottom; };
  const auto contact = contact_pressure_on_facets<2>(mesh, simulation.positions(), result.forces.contact, is_dry);
  for (const FacetId f : mesh.live_facets()) {
    if (is_dry(f)) {
      EXPECT_GT(contact[f], 3e4) << mesh.rest(mesh.facet(f)[0])[0];
    }
    if (mesh.facet_tag(f) == kWet) {
      EXPECT_LT(contact[f], 0.05 * 3e4) << mesh.rest(mesh.facet(f)[0])[0];
    }
  }
}

TEST(Fluid, IsMirroredInAMirroredScene) {
  auto one = simulate(tilted(1)), other = simulate(tilted(-1));
  advance(one);
  advance(other);
  const auto wet_places = [](const Mesh<2>& mesh, double sign) {
    std::vector<double> places;
    for (const FacetId f : mesh.live_facets())
      if (mesh.facet_tag(f) == kWet)
        places.push_back(
            std::round(32 * (0.5 + sign * (mesh.middle(edge_key(mesh.facet(f)[0], mesh.facet(f)[1]))[0] - 0.5))));
    std::sort(places.begin(), places.end());
    return places;
  };
  EXPECT_FALSE(wet_places(one.mesh(), 1).empty());
  EXPECT_EQ(wet_places(one.mesh(), 1).size(), wet_places(other.mesh(), -1).size());
  EXPECT_NEAR(
      wet_from(one.mesh()),
      1 -
          [&] {
            double last = 0;
            for (const FacetId f : other.mesh().live_facets())
              if (other.mesh().facet_tag(f) == kWet)
                for (const VertexId v : other.mesh().facet(f)) last = std::max(last, other.mesh().rest(v)[0]);
            return last;
          }(),
      1e-12);
}

/// A fluid without a source is where contact presses by less, whether or not it could come there.
TEST(Fluid, WithoutASourceIsEverywhere) {
  auto setup =
      seal<2>(16, 8e4, [](const Vec<2>& X, double) { return 0.05 - 0.16 * std::max(0.0, 0.25 - std::abs(X[0] - 0.5)); });
  setup.fluids[0].leaks_to.clear();
  auto from_left = simulate(setup);
  EXPECT_EQ(advance(from_left).report.wetted, 0);
  setup.fluids[0].from.clear();
  auto everywhere = simulate(setup);
  const double wetted = advance(everywhere).report.wetted;
  EXPECT_GT(wetted, 0);
  EXPECT_LT(wetted, 1);
}

template <typename Set>
void expect_forces_are_rate_of_momentum(Set&& change, int steps) {
  auto setup = seal<2>(8, 5e4, [](const Vec<2>&, double t) { return 0.02 + 0.005 * t; });
  setup.time = {.dt = 0.01, .steps = steps};
  change(setup);
  auto simulation = simulate(setup);
  const auto momentum = [&] {
    AskedFields fields;
    simulation.observe([&](const FrameView<2>& frame) { fields = *frame.asked; });
    return Vec<2>(fields.momentum.data());
  };
  Vec<2> before = momentum();
  for (int k = 0; k < steps; ++k) {
    const auto result = advance(simulation);
    Vec<2> all = Vec<2>::Zero();
    for (const VectorX* force : {&result.forces.contact, &result.forces.reaction, &result.forces.applied})
      for (Eigen::Index i = 0; i < force->size(); ++i) all[i % 2] += (*force)[i];
    for (Eigen::Index i = 0; i < result.forces.residual.size(); ++i) all[i % 2] -= result.forces.residual[i];
    for (const MomentumChange& edits : simulation.forces().remeshing) all += Vec<2>(edits.linear.data());
    const Vec<2> now = momentum();
    EXPECT_LT(((now - before) / 0.01 - all).norm(), 1e-6 * 5e4) << k;
    before = now;
  }
  EXPECT_GT(simulation.report().wetted, 0);
}
TEST(Fluid, ForcesAreTheRateOfMomentum) {
  expect_forces_are_rate_of_momentum([](auto&) {}, 4);
}

TEST(Fluid, IsCarriedByEdits) {
  int splits = 0;
  const auto remeshed = [&](itr::Setup<2>& setup) {
    setup.remesh.enabled = true;
    setup.remesh.split.acceptance_tolerance = 1e-3;
    setup.remesh.collapse.acceptance_tolerance = -1e-6;
  };
  expect_forces_are_rate_of_momentum(remeshed, 3);
  auto setup = tilted(1);
  remeshed(setup);
  auto simulation = simulate(setup);
  for (int k = 0; k < 2; ++k) {
    const auto result = advance(simulation);
    splits += result.report.splits.accepted;
    EXPECT_GT(result.report.wetted, 0.1);
    EXPECT_LT(result.report.wetted, 0.6);
  }
  EXPECT_GT(splits, 0);
}

TEST(Fluid, GoesOnWithTheSameBitsFromASavedState) {
  auto setup = tilted(1);
  setup.dirichlet[0].displacement = [](const Vec<2>& X, double t) {
    return Vec<2>(0, -(0.03 + 0.002 * t) + 0.06 * (X[0] - 0.5));
  };
  auto straight = simulate(setup), resumed = simulate(setup);
  advance(straight);
  resumed.restore(State<2>(straight.state()));
  for (int k = 0; k < 2; ++k) {
    advance(straight);
    advance(resumed);
    EXPECT_EQ(VectorX(straight.positions()), VectorX(resumed.positions()));
    for (const FacetId f : straight.mesh().live_facets())
      EXPECT_EQ(straight.mesh().facet_tag(f), resumed.mesh().facet_tag(f));
  }
}

TEST(Fluid, HasTheSameBitsForAnyNumberOfThreads) {
  std::vector<VectorX> ends;
  for (const int threads : {1, 2}) {
    const ThreadLimit limit(threads);
    auto simulation = simulate(tilted(1));
    advance(simulation);
    ends.emplace_back(simulation.positions());
  }
  EXPECT_EQ(ends[0], ends[1]);
}

/// A disc on a table, wetted from its rim.
TEST(Fluid, LiftsADiscFromItsRim) {
  constexpr double kPressure = 5e4, kSqueeze = 0.02;
  auto setup = seal<2>(8, kPressure, [](const Vec<2>&, double) { return kSqueeze; });
  setup.mesh.set_axisymmetric(true);
  setup.fluids[0].from = {kRight};
  setup.fluids[0].leaks_to.clear();
  auto simulation = simulate(setup);
  const auto result = advance(simulation);
  EXPECT_EQ(result.report.wetted, 1);
  const double force = kPressure * std::numbers::pi;
  EXPECT_NEAR(sum_y<2>(result.forces.applied), force, 1e-6 * force);
  EXPECT_NEAR(sum_y<2>(result.forces.reaction), -force, 1e-6 * force);
}

TEST(Fluid, ResultantsKnowSurfacesThatAreAllWet) {
  auto simulation = simulate(seal<2>(8, 5e4, [](const Vec<2>&, double) { return 0.02; }));
  advance(simulation);
  const std::array tags{kBottom, kWet};
  EXPECT_NEAR(resultant<2>(simulation, tags, Vec<2>::Zero()).force[1], 5e4, 1);
}

TEST(Fluid, LeaksToWhereAnotherFluidIs) {
  constexpr int kWetRight = 15;
  itr::Setup<2> setup = seal<2>(4, 1, [](const Vec<2>&, double) { return 0.0; });
  setup.fluids.push_back({.place = "the other fluid", .wet = {{kRight, kWetRight}}});
  const Mesh<2> dry = setup.mesh;
  for (const FacetId f : setup.mesh.live_facets()) {
    if (setup.mesh.facet_tag(f) == kBottom) setup.mesh.set_facet_tag(f, kWet);
    if (setup.mesh.facet_tag(f) == kRight) setup.mesh.set_facet_tag(f, kWetRight);
  }
  StepReport report;
  const std::vector<std::string> warnings = report_fluids(setup, dry, setup.mesh, 0, report);
  EXPECT_EQ(report.leaks, 1);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find(setup.fluids[0].place), std::string::npos);
}

TEST(Fluid, RefusesWhatCannotCome) {
  const auto place_of = [](const std::function<void(itr::Setup<2>&)>& change) {
    auto setup = seal<2>(4, 1e4, [](const Vec<2>&, double) { return 0.0; });
    change(setup);
    try {
      simulate(setup);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string("none");
  };
  EXPECT_EQ(place_of([](auto&) {}), "none");
  EXPECT_EQ(place_of([](auto& setup) { setup.contact = {}; }), "the fluid/penetrates");
  EXPECT_EQ(place_of([](auto& setup) { setup.fluids[0].from = {kTop}; }), "the fluid/from");
  EXPECT_EQ(place_of([](auto& setup) { setup.fluids[0].leaks_to = {kTop}; }), "the fluid/leaks_to");
}

}  // namespace

namespace scene {
namespace {

class FluidScene : public SceneTest {
 protected:
  FluidScene() { write("floor.obj", "v -3 -0.01 0\nv 3 -0.01 0\nl 1 2\n"); }
  /// The unit square with sides 1 (left), 2 (bottom), 3 (right), 4 (top), over a floor; a fluid at its bottom.
  static json scene(const json& fluid) {
    json geometry = {{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", json::array()}};
    const std::array<std::array<double, 4>, 4> boxes{
        {{-1, -1, 0.01, 2}, {-1, -1, 2, 0.01}, {0.99, -1, 2, 2}, {-1, 0.99, 2, 2}}};
    for (int k = 0; k < 4; ++k)
      geometry["surface_selection"].push_back(
          {{"id", k + 1}, {"box", {{boxes[k][0], boxes[k][1]}, {boxes[k][2], boxes[k][3]}}}});
    json entry = {{"id", 2}, {"value", 1000}};
    entry.merge_patch(fluid);
    return square({{"geometry", {geometry, {{"mesh", "floor.obj"}, {"is_obstacle", true}}}},
                   {"contact", {{"enabled", true}, {"dhat", 0.001}}},
                   {"boundary_conditions",
                    {{"dirichlet_boundary", {{{"id", 2}, {"value", {0, 0}}, {"dimension", {true, false}}}}},
                     {"pressure_boundary", {entry}}}}});
  }
};

TEST_F(FluidScene, GivesWetFacetsAllConditionsOfTheirSurface) {
  const auto setup = read2(scene({{"penetrates", true}, {"from", 1}, {"leaks_to", {3}}, {"critical_pressure", 500}}));
  ASSERT_EQ(setup.fluids.size(), 1u);
  const Fluid& fluid = setup.fluids[0];
  EXPECT_EQ(fluid.place, "/boundary_conditions/pressure_boundary/0");
  ASSERT_EQ(fluid.wet.size(), 1u);
  EXPECT_EQ(fluid.wet.begin()->first, 2);
  const int wet = fluid.wet.begin()->second;
  EXPECT_GT(wet, 4);
  EXPECT_EQ(fluid.from, (std::vector{1}));
  EXPECT_EQ(fluid.leaks_to, (std::vector{3}));
  EXPECT_EQ(fluid.critical_pressure, 500);
  ASSERT_EQ(setup.pressure.size(), 1u);
  EXPECT_EQ(setup.pressure[0].tag, wet);
  EXPECT_EQ(setup.names.surfaces.at("wet 2"), std::vector{wet});
  ASSERT_EQ(setup.dirichlet.size(), 2u);
  EXPECT_EQ(setup.dirichlet[0].tag, 2);
  EXPECT_EQ(setup.dirichlet[1].tag, wet);
  EXPECT_TRUE(read2(scene(json::object())).fluids.empty());
}

TEST_F(FluidScene, RefusesWhatMakesNoSense) {
  EXPECT_EQ(failure(scene({{"from", 1}})).place, "/boundary_conditions/pressure_boundary/0/from");
  EXPECT_EQ(failure(scene({{"penetrates", true}, {"from", 9}})).place, "/boundary_conditions/pressure_boundary/0/from");
  EXPECT_EQ(failure(scene({{"penetrates", true}, {"leaks_to", "out"}})).place,
            "/boundary_conditions/pressure_boundary/0/leaks_to");
  json two = scene({{"penetrates", true}});
  two["boundary_conditions"]["pressure_boundary"].push_back({{"id", "all"}, {"value", 1}, {"penetrates", true}});
  two["geometry"][0]["surface_selection"].push_back({{"id", "low"}, {"box", {{-1, -1}, {2, 0.01}}}});
  two["boundary_conditions"]["pressure_boundary"][1]["id"] = "low";
  EXPECT_EQ(failure(two).place, "/boundary_conditions/pressure_boundary/1/id");
}

}  // namespace
}  // namespace scene
}  // namespace itr
