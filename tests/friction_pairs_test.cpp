// SPDX-License-Identifier: MIT
// Friction by pair, with static and kinetic coefficients.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "advance.hpp"
#include "block.hpp"
#include "contact_scenes.hpp"
#include "derivatives.hpp"
#include "energy/contact/friction.hpp"
#include "scene_folder.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

constexpr double kSpeed = 0.05;  ///< eps_v [m/s]

/// The second half of a scene's vertices is side a of a pair, the first is side b.
template <typename Scene>
void add_pair(Scene& scene, double statics, double kinetic) {
  scene.options.friction_pairs = {{.a = {.bodies = {1}}, .b = {.bodies = {2}}, .statics = statics, .kinetic = kinetic}};
  scene.options.friction_velocity = kSpeed;
  const std::size_t n = scene.surface.area.size();
  for (std::size_t v = 0; v < n; ++v) scene.surface.friction_sides.push_back(v < n / 2 ? 2 : 1);
}

/// Friction lagged where the scene is, where vertices have slipped at about `speed`.
template <int Dim, typename Scene>
FrictionEnergy<Dim> friction_of(const Scene& scene, double speed, unsigned seed) {
  constexpr double kRate = 20;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, speed / kRate);
  const VectorX reference = scene.x + VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
  const ContactEnergy<Dim> contact(scene.surface, scene.options, 3, 0.5);
  Workspace workspace;
  return FrictionEnergy<Dim>(contact, scene.x, workspace, scene.options, {kRate, reference}, 0.01);
}

/// No eigenvalue is negative beside those of what sticks: of what slides there may be hardly any.
void expect_psd_beside(double of_sticking, const Energy& energy, const VectorX& x) {
  const MatrixX hessian = hessian_of(energy, x, PsdProjection::clamp);
  EXPECT_GE(Eigen::SelfAdjointEigenSolver<MatrixX>(hessian).eigenvalues()[0], -1e-12 * of_sticking);
}

template <int Dim, typename Scene>
void expect_pair_derivatives(Scene scene, unsigned seed) {
  add_pair(scene, 0.6, 0.2);
  const double most = hessian_of(friction_of<Dim>(scene, 1e-3 * kSpeed, seed), scene.x, PsdProjection::none).norm();
  for (const double speed : {0.4 * kSpeed, 1.5 * kSpeed, 2.5 * kSpeed, 8 * kSpeed}) {
    if (Dim == 2 && speed > 3 * kSpeed) continue;  // no curvature is left
    FrictionEnergy<Dim> friction = friction_of<Dim>(scene, speed, seed);
    ASSERT_FALSE(friction.empty());
    expect_derivatives(friction, scene.x, 1e-7, 1e-5);
    expect_psd_beside(most, friction, scene.x);
    const VectorX gradient = gradient_of(friction, scene.x);
    friction.begin_solve(scene.x, false);
    EXPECT_EQ(gradient_of(friction, scene.x), gradient);
    expect_psd_beside(most, friction, scene.x);
    friction.begin_solve(scene.x, true);
    expect_psd_beside(most, friction, scene.x);
    const VectorX near = scene.x.array() + 0.3 * speed / 20 * VectorX::LinSpaced(scene.x.size(), -1, 1).array().sin();
    friction.follow(near, 0.5);
    expect_psd_beside(most, friction, near);
  }
}

TEST(FrictionPairs, DerivativesMatchDifferencesWhereStaticFallsToKinetic) {
  for (unsigned seed = 0; seed < 6; ++seed) expect_pair_derivatives<2>(ContactScene(seed, false), seed);
  for (unsigned seed = 0; seed < 2; ++seed) expect_pair_derivatives<3>(ContactScene3(seed, seed % 2, 0.4, 0.03), seed);
}

TEST(FrictionPairs, StaticAndKineticBoundTheForce) {
  ContactScene scene(3, false), plain = scene;
  add_pair(scene, 0.6, 0.2);
  plain.options.friction_velocity = kSpeed;
  plain.options.friction_coefficient = 0.6;
  for (const auto& [speed, ratio] : {std::pair{1e-3 * kSpeed, 1.0}, {1e3 * kSpeed, 1. / 3}}) {
    const auto size = [&](const ContactScene& of) { return gradient_of(friction_of<2>(of, speed, 5), of.x).norm(); };
    EXPECT_NEAR(size(scene), ratio * size(plain), 1e-9 * size(plain));
  }
}

TEST(FrictionPairs, FallByACubicFunctionBetweenOneAndThreeTimesTheirSpeed) {
  const SlipLaw law{kSpeed, 0.25, false};
  for (const auto& [y, f1] :
       {std::pair{0.5, 0.75}, {1.0, 1.0}, {1.5, 1 - 0.75 * 0.15625}, {2.0, 0.625}, {3.0, 0.25}, {9.0, 0.25}}) {
    const double v = y * kSpeed, h = 1e-6 * kSpeed;
    EXPECT_NEAR(law.by_speed(v) * v, f1, 1e-14) << y;
    EXPECT_NEAR((law.potential(v + h) - law.potential(v - h)) / (2 * h), f1, 1e-6) << y;
  }
}

TEST(FrictionPairs, OrderDoesNotMatterAndOthersHaveTheDefault) {
  ContactScene scene(2, false);
  add_pair(scene, 0.5, 0.3);
  const VectorX one = gradient_of(friction_of<2>(scene, kSpeed, 7), scene.x);
  ContactScene turned = scene;
  for (auto& sides : turned.surface.friction_sides) sides = 3 - sides;
  EXPECT_EQ(gradient_of(friction_of<2>(turned, kSpeed, 7), scene.x), one);

  ContactScene other = scene;
  for (auto& sides : other.surface.friction_sides) sides &= 1;  // nothing is of side b
  EXPECT_TRUE(friction_of<2>(other, kSpeed, 7).empty());
  other.options.friction_coefficient = 0.5;
  ContactScene plain(2, false);
  plain.options.friction_velocity = kSpeed;
  plain.options.friction_coefficient = 0.5;
  EXPECT_EQ(gradient_of(friction_of<2>(other, kSpeed, 7), scene.x), gradient_of(friction_of<2>(plain, kSpeed, 7), scene.x));

  scene.options.friction_pairs.insert(scene.options.friction_pairs.begin(), FrictionPair{{}, {}, 0.1, 0.1});
  for (auto& sides : scene.surface.friction_sides) sides = sides << 2 | sides;  // of both pairs: the first counts
  scene.options.friction_pairs[1].kinetic = 0.5;
  ContactScene first = plain;
  first.options.friction_coefficient = 0.1;
  EXPECT_LE((gradient_of(friction_of<2>(scene, kSpeed, 7), scene.x) - gradient_of(friction_of<2>(first, kSpeed, 7), scene.x))
                .norm(),
            1e-14 * one.norm());
}

constexpr double kMuS[] = {0.5, 0.3}, kMuK[] = {0.3, 0.2};
constexpr double kFlatUntil = 0.1, kSteepest = 0.55;

/// The tangent of the slope.
double slope_at(double t) { return std::clamp(t - kFlatUntil, 0.0, kSteepest); }

/// Two blocks side by side on a slope of two materials, which becomes steeper by 1 a second.
Setup<2> two_blocks() {
  Setup<2> setup = block<2>();
  const Grid grid = make_regular_grid(2, kSize, [](int, int) { return true; });
  std::vector<Vec<2>> rest = grid.rest;
  std::vector<std::array<int, 3>> cells = grid.cells;
  const int n = static_cast<int>(rest.size());
  for (const Vec<2>& X : grid.rest) rest.push_back(X + Vec<2>(2, 0));
  for (auto cell : grid.cells) cells.push_back({cell[0] + n, cell[1] + n, cell[2] + n});
  std::vector<int> body(cells.size(), 1);
  std::fill(body.begin() + static_cast<std::ptrdiff_t>(grid.cells.size()), body.end(), 2);
  setup.mesh = Mesh<2>(rest, cells, body);
  setup.materials[1].youngs_modulus = 1e8;  // else corners begin to slide much earlier than the block
  setup.materials[2] = setup.materials[1];
  add_table(setup);
  const double y = setup.obstacles.rest[0][1];
  setup.obstacles.rest = {{-1, y}, {1, y}, {1.1, y}, {4, y}};
  setup.obstacles.edges = {{0, 1}, {2, 3}};
  setup.obstacles.motion.assign(4, kNone);
  setup.body_acceleration = [](const Vec<2>&, double t) {
    const double slope = slope_at(t);
    return Vec<2>(kGravity / std::sqrt(1 + slope * slope) * Vec<2>(slope, -1));
  };
  setup.contact.barrier_stiffness = 1e7;
  setup.contact.friction_iterations = -1;
  setup.contact.friction_velocity = 1e-3;
  setup.contact.friction_pairs = {
      {.a = {.bodies = {1}}, .b = {.obstacle_vertices = {0, 1}}, .statics = kMuS[0], .kinetic = kMuK[0]},
      {.a = {.obstacle_vertices = {2, 3}}, .b = {.bodies = {2}}, .statics = kMuS[1], .kinetic = kMuK[1]}};
  setup.lagging_tolerance = 1e-4;
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  setup.time = {.dt = 0.005, .steps = 160};
  return setup;
}

/// Mean speeds along the slope of both blocks.
std::array<double, 2> speeds(const State<2>& state) {
  std::array<double, 2> sum{};
  const int half = state.mesh.num_nodes() / 2;
  for (int v = 0; v < 2 * half; ++v) sum[v / half] += state.history.v[0][2 * v] / half;
  return sum;
}

TEST(FrictionPairs, BlocksStickToTheirOwnStaticAngleAndSlideByTheirKineticFriction) {
  const itr::Setup<2> setup = two_blocks();
  linear::Registry registry;
  std::vector<int> told;  // the steps whose warnings say that something begins to slide
  int step = 1;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel, std::string_view text) {
                             if (text.find("to slide, where friction falls from static to kinetic") != text.npos)
                               told.push_back(step);
                           }));
  std::array<double, 2> began{}, before{};
  constexpr int kMeasured = 20;
  for (; step <= setup.time.steps; ++step) {
    const VectorX x = simulation.state().history.x[0];
    advance(simulation);
    const State<2>& state = simulation.state();
    const auto now = speeds(state);
    for (int i = 0; i < 2; ++i)
      if (began[i] == 0 && now[i] > 3 * setup.contact.friction_velocity) began[i] = slope_at(state.t);
    const VectorX friction = asked(simulation).forces.friction;
    EXPECT_LE(friction.dot((state.history.x[0] - x).head(friction.size())), 1e-15) << step;  // takes energy only
    if (step == setup.time.steps - kMeasured) before = now;
  }
  const auto now = speeds(simulation.state());
  const double cosine = 1 / std::sqrt(1 + kSteepest * kSteepest);
  for (int i = 0; i < 2; ++i) {
    EXPECT_GE(began[i], kMuS[i] - 1e-3) << i;
    EXPECT_LE(began[i], kMuS[i] + 2 * setup.time.dt) << i;
    const double expected = kGravity * cosine * (kSteepest - kMuK[i]);
    EXPECT_NEAR((now[i] - before[i]) / (kMeasured * setup.time.dt), expected, 0.01 * expected) << i;
    const auto is_told = [&](int at) { return std::abs(slope_at(at * setup.time.dt) - began[i]) < 2 * setup.time.dt; };
    EXPECT_TRUE(std::ranges::any_of(told, is_told)) << i << ": " << ::testing::PrintToString(told);
  }
}

/// A pair of a body and an obstacle acts as one coefficient for all does, also on edits.
TEST(FrictionPairs, ArePartOfRemeshing) {
  itr::Setup<2> all = impact();
  enable_remeshing(all);
  all.time.steps = 4;
  linear::Registry registry;
  const auto run = [&](const itr::Setup<2>& setup) {
    Simulation<2> simulation(setup, registry);
    int edits = 0;
    while (!simulation.finished()) edits += advance(simulation).report.splits.accepted;
    EXPECT_GT(edits, 0);
    return simulation.state().history.x[0];
  };
  itr::Setup<2> pairs = all;
  pairs.contact.friction_coefficient = 0;
  pairs.contact.friction_pairs = {
      {.a = {.surfaces = {1, 2, 3, 4}}, .b = {.obstacle_vertices = {0, 1}}, .statics = 0.2, .kinetic = 0.2}};
  const VectorX expected = run(all);
  EXPECT_EQ(run(pairs), expected);
  itr::Setup<2> none = pairs;
  none.contact.friction_pairs[0].a = {.bodies = {7}};
  const VectorX without = run(none);
  EXPECT_TRUE(without.size() != expected.size() || without != expected);
}

}  // namespace

namespace scene {
namespace {

class FrictionPairScenes : public SceneTest {
 protected:
  static json with_pairs(const json& pairs) {
    return square(
        {{"geometry", json::array({{{"mesh", "square.obj"},
                                    {"volume_selection", "rubber"},
                                    {"surface_selection", json::array({{{"id", 4}, {"axis", 2}, {"position", 0.9}}})}},
                                   {{"mesh", "line.obj"},
                                    {"is_obstacle", true},
                                    {"name", "steel"},
                                    {"surface_selection", 9},
                                    {"transformation", {{"translation", {0, -0.1}}}}}})},
         {"materials", json::array({{{"id", "rubber"}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1}}})},
         {"contact", {{"enabled", true}, {"friction_pairs", pairs}}}});
  }
};

TEST_F(FrictionPairScenes, NameBodiesSurfacesAndObstacles) {
  const auto pairs = read2(with_pairs(json::array({{{"a", "rubber"}, {"b", 9}, {"static", 0.5}, {"kinetic", 0.25}},
                                                   {{"a", 4}, {"b", "steel"}, {"coefficient", 0.1}}})))
                         .contact.friction_pairs;
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_EQ(pairs[0].a.bodies.size(), 1U);
  EXPECT_EQ(pairs[0].b.obstacle_vertices, (std::vector{0, 1}));
  EXPECT_EQ(pairs[0].statics, 0.5);
  EXPECT_EQ(pairs[0].kinetic, 0.25);
  EXPECT_EQ(pairs[1].a.surfaces, std::vector{4});
  EXPECT_EQ(pairs[1].b.obstacle_vertices, (std::vector{0, 1}));
  EXPECT_EQ(pairs[1].kinetic, 0.1);
  EXPECT_EQ(read2(with_pairs({{"a", 9}, {"b", 4}, {"static", 0.5}})).contact.friction_pairs[0].kinetic, 0.5);
}

TEST_F(FrictionPairScenes, RefuseWhatNothingHasWithTheNearestName) {
  const auto parts = failure(with_pairs({{"a", "ruber"}, {"b", "steel"}, {"coefficient", 0.1}}));
  EXPECT_EQ(parts.place, "/contact/friction_pairs/a");
  EXPECT_EQ(parts.found, "\"ruber\", which nothing has");
  EXPECT_NE(parts.expected.find("\"rubber\" perhaps"), std::string::npos) << parts.expected;
  EXPECT_NE(parts.expected.find("\"steel\""), std::string::npos) << parts.expected;
  EXPECT_NE(parts.expected.find("a surface or an obstacle: 4, 9, \"steel\""), std::string::npos) << parts.expected;
  const auto wrong = [&](json pair) {
    return failure(with_pairs(json::array({pair}))).place.substr(sizeof("/contact/friction_pairs/0") - 1);
  };
  EXPECT_EQ(wrong({{"a", "rubber"}, {"b", 17}, {"coefficient", 0.1}}), "/b");
  EXPECT_EQ(wrong({{"a", 9}, {"b", "steel"}, {"coefficient", 0.1}}), "/b") << "obstacles alone never slide";
  EXPECT_EQ(wrong({{"a", "rubber"}, {"coefficient", 0.1}}), "/b");
  EXPECT_EQ(wrong({{"a", "rubber"}, {"b", 9}}), "");
  EXPECT_EQ(wrong({{"a", "rubber"}, {"b", 9}, {"coefficient", 0.1}, {"static", 0.1}}), "");
  EXPECT_EQ(wrong({{"a", "rubber"}, {"b", 9}, {"static", 0.1}, {"kinetic", 0.2}}), "/kinetic");
  EXPECT_EQ(wrong({{"a", "rubber"}, {"b", 9}, {"coefficient", 0.1}, {"kinetic", 0.1}}), "/kinetic");
}

}  // namespace
}  // namespace scene
}  // namespace itr
