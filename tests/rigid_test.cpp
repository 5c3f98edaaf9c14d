// SPDX-License-Identifier: MIT
// Rigid bodies: their coordinates and loads, scenes with closed forms, and what is refused.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <sstream>

#include "advance.hpp"
#include "derivatives.hpp"
#include "energy/rigid_body.hpp"
#include "energy/rigid_load.hpp"
#include "itr/simulation.hpp"
#include "scene_folder.hpp"
#include "simulation/invariants.hpp"
#include "simulation/rigid_coordinates.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

using nlohmann::json;
constexpr double kPi = std::numbers::pi, kGravity = 9.81;

template <int Dim>
VectorX random_field(Eigen::Index size, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return VectorX::NullaryExpr(size, [&] { return normal(random); });
}

/// A square and a triangle apart from it, which is rigid.
struct SquareAndTriangle {
  std::shared_ptr<RigidBody> rigid = std::make_shared<RigidBody>();
  Mesh<2> mesh{{{0, 0}, {1, 0}, {1, 1}, {0, 1}, {3, 0}, {4, 0.2}, {3, 2}, {3.4, 0.5}},
               {{0, 1, 2}, {0, 2, 3}, {4, 5, 7}, {5, 6, 7}, {6, 4, 7}},
               {1, 1, 2, 2, 2}};
  std::map<int, Material> materials{{1, {}}, {2, {}}};
  SquareAndTriangle() {
    rigid->about = {3.5, 1, 0};
    materials[2].own = rigid;
  }
  RigidCoordinates<2> coordinates() const { return {materials, whole_mesh(mesh, {})}; }
  VectorX rest() const {
    VectorX x(16);
    for (int v = 0; v < 8; ++v) vertex_of<2>(x, v) = mesh.rest(v);
    return x;
  }
};

TEST(RigidCoordinates, PositionsAreLinearInThem) {
  const SquareAndTriangle scene;
  const RigidCoordinates<2> rigid = scene.coordinates();
  const VectorX x = scene.rest(), z = rigid.coordinates_of(x);
  EXPECT_LE((rigid.map()->positions(z) - x).norm(), 1e-14);
  EXPECT_LE((rigid.frame(0, x).col(0) - Vec<2>(3.5, 1)).norm(), 1e-14);
  Mat<2> A;
  A << 1.2, -0.7, 0.4, 0.9;
  VectorX moved = x;
  for (int v = 4; v < 8; ++v) vertex_of<2>(moved, v) = A * scene.mesh.rest(v) + Vec<2>(0.3, -2);
  EXPECT_LE((rigid.map()->positions(rigid.coordinates_of(moved)) - moved).norm(), 1e-13);
  EXPECT_LE(rigid.distortion(0, moved), 1e-14);
  moved[15] += 0.1;
  EXPECT_GT(rigid.distortion(0, moved), 1e-2);
}

TEST(RigidCoordinates, ReactionsAndTheRestHaveTheResultants) {
  const SquareAndTriangle scene;
  scene.rigid->held_position = {true, false, false};
  const RigidCoordinates<2> rigid = scene.coordinates();
  const VectorX g = random_field<2>(16, 3), free = rigid.without_reactions(g), held = rigid.reactions(g);
  const auto resultant = [&](const VectorX& field) {
    Vec<3> sum = Vec<3>::Zero();
    for (int v = 4; v < 8; ++v) {
      const Vec<2> f = field.segment<2>(2 * v), arm = scene.mesh.rest(v) - Vec<2>(3.5, 1);
      sum += Vec<3>(f[0], f[1], arm[0] * f[1] - arm[1] * f[0]);
    }
    return sum;
  };
  EXPECT_LE((resultant(free) + resultant(held) - resultant(g)).norm(), 1e-13);
  EXPECT_NEAR(resultant(free)[0], 0, 1e-13);
  EXPECT_LE(resultant(held).tail<2>().norm(), 1e-13);
  EXPECT_EQ(free.head<8>(), g.head<8>());
}

TEST(RigidCoordinates, StepsBendToArcs) {
  const SquareAndTriangle scene;
  const RigidCoordinates<2> rigid = scene.coordinates();
  const VectorX at = rigid.coordinates_of(scene.rest());
  VectorX motion = VectorX::Zero(16);
  for (int v = 4; v < 8; ++v) {
    const Vec<2> arm = scene.mesh.rest(v) - Vec<2>(3.5, 1);
    vertex_of<2>(motion, v) = 0.7 * Vec<2>(-arm[1], arm[0]) + Vec<2>(0.1, 0.2);
  }
  VectorX step = rigid.of_motion(motion);
  EXPECT_NEAR(rigid.bend(at, step), std::atan(0.7), 1e-12);
  const VectorX x = rigid.map()->positions(VectorX(at + step));
  for (int v = 5; v < 8; ++v)
    EXPECT_NEAR((x.segment<2>(2 * v) - x.segment<2>(8)).norm(), (scene.mesh.rest(v) - scene.mesh.rest(4)).norm(), 1e-12);
  EXPECT_LE((rigid.frame(0, x).col(0) - Vec<2>(3.6, 1.2)).norm(), 1e-12);
}

TEST(RigidLoad, DerivativesMatchDifferencesAndTheWorkIsThatOfTheTurn) {
  const SquareAndTriangle scene;
  const RigidCoordinates<2> rigid = scene.coordinates();
  const VectorX rest = scene.rest();
  const RigidLoad<2> load(rigid.anchors(0), rigid.coefficients(0), {3, -2}, {0, 0, 5}, rest, 0.5);
  for (unsigned seed = 0; seed < 5; ++seed) expect_derivatives(load, rest + 0.1 * random_field<2>(16, seed), 1e-6, 1e-6);
  VectorX turned = rest;
  for (int v = 4; v < 8; ++v)
    vertex_of<2>(turned, v) =
        Vec<2>(3.5, 1) + Eigen::Rotation2Dd(2) * (scene.mesh.rest(v) - Vec<2>(3.5, 1)) + Vec<2>(0.1, 0.2);
  Workspace workspace;
  EXPECT_NEAR(load.value(turned, workspace), -0.5 * (3 * 0.1 - 2 * 0.2 + 5 * 2), 1e-12);
}

TEST(RigidLoad, CouplesInSpaceDoTheWorkOfTheMoment) {
  const Eigen::Matrix<double, 3, 4> frame = (Eigen::Matrix<double, 3, 4>() << 1, 2, 0, 0, 5, 0, 2, 0, 0, 0, 0, 2).finished();
  VectorX x(12);
  for (int k = 0; k < 4; ++k) x.segment<3>(3 * k) = frame.col(k);
  const Vec<3> moment(1, -2, 3), spin(0.3, 0.1, -0.7);
  const RigidLoad<3> load({0, 1, 2, 3}, Mat<4>::Identity(), {1, 1, 1}, moment, x, 1);
  const VectorX forces = -gradient_of(load, x);
  double power = 0;
  for (int k = 1; k < 4; ++k) power += forces.segment<3>(3 * k).dot(spin.cross(Vec<3>(frame.col(k))));
  EXPECT_NEAR(power, moment.dot(spin), 1e-13);
  EXPECT_EQ(forces.head<3>(), Vec<3>(1, 1, 1));
}

}  // namespace
}  // namespace itr

namespace itr::scene {
namespace {

using itr::kGravity;
using itr::kPi;

class RigidScene : public SceneTest {
 protected:
  using Points = std::vector<Vec<2>>;
  using Triangles = std::vector<std::array<int, 3>>;
  void write_mesh(const std::string& name, const Points& points, const Triangles& triangles) {
    std::ostringstream text;
    text.precision(17);
    for (const Vec<2>& p : points) text << "v " << p[0] << ' ' << p[1] << " 0\n";
    for (const auto& t : triangles) text << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
    write(name, text.str());
  }
  void write_disc(const std::string& name, int corners, double radius, const Vec<2>& centre) {
    Points points = {centre};
    Triangles triangles;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2 * kPi * i / corners;
      points.push_back(centre + radius * Vec<2>(std::cos(angle), std::sin(angle)));
      triangles.push_back({0, 1 + i, 1 + (i + 1) % corners});
    }
    write_mesh(name, points, triangles);
  }
  void write_box(const std::string& name, int nx, int ny, const Vec<2>& low, const Vec<2>& size) {
    Points points;
    Triangles triangles;
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) points.push_back(low + Vec<2>(size[0] * i / nx, size[1] * j / ny));
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        const int a = j * (nx + 1) + i, b = a + 1, c = a + nx + 1, d = c + 1;
        if ((i + j) % 2)
          triangles.insert(triangles.end(), {{a, b, d}, {a, d, c}});
        else
          triangles.insert(triangles.end(), {{a, b, c}, {b, d, c}});
      }
    write_mesh(name, points, triangles);
  }
  template <int Dim>
  itr::Setup<Dim> setup_of(const json& scene) {
    return std::get<itr::Setup<Dim>>(read_scene(scene).setup);
  }
  linear::Registry registry_;
};

/// The body's point, turn and their speeds.
struct Motion2 {
  Vec<2> point, speed;
  double turn, spin;
};
Motion2 motion_of(const Simulation<2>& simulation) {
  const State<2>& state = simulation.state();
  const RigidCoordinates<2> rigid(simulation.setup().materials, whole_mesh(state.mesh, simulation.setup().obstacles.rest));
  const auto now = rigid.frame(0, state.history.x[0]), rate = rigid.frame(0, state.history.v[0]);
  const Vec<2> a = now.col(1), v = rate.col(1);
  return {now.col(0), rate.col(0), std::atan2(a[1], a[0]), (a[0] * v[1] - a[1] * v[0]) / a.squaredNorm()};
}

template <int Dim>
void expect_free_of_violations(const Simulation<Dim>& simulation) {
  const State<Dim>& state = simulation.state();
  EXPECT_EQ(find_violation(simulation.setup(), state.mesh, state.history.x[0]), "") << "step " << simulation.steps();
}

TEST_F(RigidScene, DiscRollsDownASlopeWithoutSlip) {
  write_disc("disc.obj", 120, 0.1, {0, 0.1001});
  const double slope = 0.2;
  const json scene = {{"geometry", {{{"mesh", "disc.obj"}, {"rigid", {{"density", 1000}}}}, {{"type", "ground"}}}},
                      {"time", {{"dt", 0.005}, {"tend", 0.5}}},
                      {"boundary_conditions", {{"rhs", {-kGravity * std::sin(slope), kGravity * std::cos(slope)}}}},
                      {"contact", {{"enabled", true}, {"friction_coefficient", 0.5}}}};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  Motion2 before = motion_of(simulation);
  while (!simulation.finished()) {
    advance(simulation);
    expect_free_of_violations(simulation);
    if (simulation.steps() == 50) before = motion_of(simulation);
  }
  const Motion2 after = motion_of(simulation);
  const double a = 2. / 3 * kGravity * std::sin(slope);
  EXPECT_NEAR((after.speed[0] - before.speed[0]) / 0.25, a, 0.01 * a);
  EXPECT_NEAR(after.spin, -after.speed[0] / 0.1, 0.01 * after.speed[0] / 0.1);
}

TEST_F(RigidScene, FreeBodyKeepsMomentumAndSpin) {
  write_box("bar.obj", 8, 1, {-0.5, -0.05}, {1, 0.1});
  json scene = {{"geometry", {{{"mesh", "bar.obj"}, {"name", "bar"}, {"rigid", {{"density", 1000}}}}}},
                {"time", {{"dt", 0.002}, {"tend", 0.2}}},
                {"initial_conditions", {{"velocity", {{{"id", "bar"}, {"value", {"1-5*y", "5*x"}}}}}}}};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  int iterations = 0;
  while (!simulation.finished()) iterations += advance(simulation).report.newton_iterations;
  const Motion2 after = motion_of(simulation);
  EXPECT_LE((after.speed - Vec<2>(1, 0)).norm(), 1e-9);
  EXPECT_LE((after.point - Vec<2>(0.2, 0)).norm(), 1e-9);
  EXPECT_NEAR(after.spin, 5, 0.005);
  EXPECT_NEAR(after.turn, 1, 0.001);
  EXPECT_LE(iterations, 6 * simulation.steps());
}

TEST_F(RigidScene, HingeTurnsByTheMomentOverTheInertia) {
  write_box("bar.obj", 8, 1, {-0.5, -0.05}, {1, 0.1});
  const json rigid = {{"mass", 12}, {"held", {"x", "y"}}, {"about", {-0.5, 0}}, {"moment", 2}};
  const json scene = {{"geometry", {{{"mesh", "bar.obj"}, {"name", "bar"}, {"rigid", rigid}}}},
                      {"time", {{"dt", 0.01}, {"tend", 2}}},
                      {"output", {{"forces", {{{"name", "bar"}, {"bodies", {"bar"}}, {"about", {-0.5, 0}}}}}}}};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  while (!simulation.finished()) advance(simulation);
  const double inertia = 12 * ((1 + 0.01) / 12 + 0.25), alpha = 2 / inertia;
  const Motion2 after = motion_of(simulation);
  EXPECT_NEAR(after.spin, 2 * alpha, 0.01 * 2 * alpha);
  EXPECT_NEAR(after.turn, 2 * alpha, 0.01 * 2 * alpha);
  EXPECT_LE((after.point - Vec<2>(-0.5, 0)).norm(), 1e-12);
  // The reaction of the hinge makes the centre of mass go round it.
  Vec<2> reaction = Vec<2>::Zero();
  const VectorX& all = simulation.forces().reaction;
  for (Eigen::Index i = 0; i < all.size(); i += 2) reaction += all.segment<2>(i);
  const Vec<2> along(std::cos(after.turn), std::sin(after.turn)), across(-along[1], along[0]);
  const Vec<2> expected = 12 * 0.5 * (alpha * across - after.spin * after.spin * along);
  EXPECT_LE((reaction - expected).norm(), 0.02 * expected.norm());
}

/// A block on rollers, and a plate above it.
json press(const json& rigid, double gap) {
  const json rollers = {{{"id", 2}, {"value", {0, 0}}, {"dimension", {false, true}}}};
  const json plate = {
      {"mesh", "plate.obj"}, {"name", "plate"}, {"rigid", rigid}, {"transformation", {{"translation", {0, 0.1 + gap}}}}};
  return {{"geometry",
           {{{"mesh", "block.obj"},
             {"volume_selection", 1},
             {"surface_selection", {{{"id", 2}, {"axis", "-y"}, {"position", 1e-6}}}}},
            plate}},
          {"materials", {{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e5}, {"nu", 0}, {"rho", 1}}}},
          {"time", {{"quasistatic", true}, {"dt", 1}, {"tend", 1}}},
          {"boundary_conditions", {{"dirichlet_boundary", rollers}}},
          {"contact", {{"enabled", true}}},
          {"output", {{"forces", {{{"name", "plate"}, {"bodies", {"plate"}}}, {{"name", "floor"}, {"surfaces", {2}}}}}}}};
}

/// Sum of a kind of force on the nodes above or below this height at rest.
Vec<2> force_above(const Simulation<2>& simulation, const VectorX& forces, double height) {
  Vec<2> sum = Vec<2>::Zero();
  for (int v = 0; v < simulation.mesh().num_vertices(); ++v)
    if (simulation.mesh().rest(v)[1] > height) sum += forces.segment<2>(2 * v);
  return sum;
}

TEST_F(RigidScene, PlateLiesOnRubberByItsWeight) {
  write_box("block.obj", 6, 6, {0, 0}, {0.1, 0.1});
  write_box("plate.obj", 2, 1, {-0.02, 0}, {0.14, 0.02});
  json scene = press({{"mass", 50}}, 0.0005);
  scene["boundary_conditions"]["rhs"] = {0, kGravity};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  while (!simulation.finished()) advance(simulation);
  expect_free_of_violations(simulation);
  const double weight = 50 * kGravity;
  EXPECT_NEAR(force_above(simulation, simulation.forces().contact, 0.1003)[1], weight, 1e-3 * weight);
  // Uniform compression of a Neo-Hookean block with nu = 0: E (s - 1/s) / 2 by width.
  const double pressure = (weight + 0.5 * 0.01 * kGravity) / 0.1, by_E = pressure / 1e5;
  const double stretch = -by_E + std::sqrt(by_E * by_E + 1);
  double top = 0;
  for (int v = 0; v < 49; ++v) top = std::max(top, simulation.positions()[2 * v + 1]);
  EXPECT_NEAR(0.1 - top, 0.1 * (1 - stretch), 0.01 * 0.1 * (1 - stretch));
}

TEST_F(RigidScene, ToolWithoutMassApproachesAndPressesByItsForce) {
  write_box("block.obj", 6, 6, {0, 0}, {0.1, 0.1});
  write_box("plate.obj", 2, 1, {-0.02, 0}, {0.14, 0.02});
  for (const json& held : {json::array({"x", "rz"}), json::array({"x"}), json::array()}) {
    json scene = press({{"force", {0, -50}}, {"held", held}}, 0.03);
    scene["boundary_conditions"]["dirichlet_boundary"][0].erase("dimension");  // the block does not glide away
    if (held.empty()) scene["contact"]["friction_coefficient"] = 0.3;          // nor does the tool
    Simulation<2> simulation(setup_of<2>(scene), registry_);
    while (!simulation.finished()) advance(simulation);
    expect_free_of_violations(simulation);
    EXPECT_NEAR(force_above(simulation, simulation.forces().contact, 0.12)[1], 50, 0.05) << held;
    EXPECT_NEAR(motion_of(simulation).turn, 0, 1e-4) << held;
  }
}

TEST_F(RigidScene, SliderPreloadsByItsForce) {
  write_box("block.obj", 6, 6, {0, 0}, {0.1, 0.1});
  write_box("plate.obj", 2, 1, {-0.02, 0}, {0.14, 0.02});
  json scene = press({{"mass", 2}, {"force", {30, "-1000*t"}}, {"moment", 5}, {"held", {"x", "rz"}}}, 0.001);
  scene["time"] = {{"quasistatic", true}, {"dt", 0.25}, {"tend", 1}};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  for (int step = 1; step <= 4; ++step) {
    advance(simulation);
    EXPECT_NEAR(force_above(simulation, simulation.forces().contact, 0.1005)[1], 250 * step, 0.25);
    EXPECT_NEAR(force_above(simulation, simulation.forces().reaction, 0.1005)[0], -30, 1e-6);
    const Motion2 now = motion_of(simulation);
    EXPECT_NEAR(now.point[0], 0.05, 1e-12);
    EXPECT_NEAR(now.turn, 0, 1e-12);
  }
}

TEST_F(RigidScene, PlateBondedToRubberHandsItsForceOn) {
  write_box("block.obj", 6, 6, {0, 0}, {0.1, 0.1});
  write_box("plate.obj", 5, 1, {-0.02, 0}, {0.14, 0.02});
  for (const bool has_contact : {true, false}) {
    json scene = press({{"force", {20, 50}}, {"held", {"rz"}}}, 0);
    scene["geometry"][0]["surface_selection"].push_back({{"id", 3}, {"axis", "y"}, {"position", 0.0999}});
    scene["geometry"][1]["surface_selection"] = {{{"id", 5}, {"axis", "-y"}, {"relative", false}, {"position", 0.10001}}};
    scene["ties"] = {{{"a", {3}}, {"b", {5}}}};
    scene["boundary_conditions"]["dirichlet_boundary"][0].erase("dimension");
    scene["contact"]["enabled"] = has_contact;
    Simulation<2> simulation(setup_of<2>(scene), registry_);
    advance(simulation);
    Vec<2> floor = Vec<2>::Zero(), plate = floor;
    for (int v = 0; v < simulation.mesh().num_vertices(); ++v)
      (v < 49 ? floor : plate) += simulation.forces().reaction.segment<2>(2 * v);
    EXPECT_LE((floor + Vec<2>(20, 50)).norm(), 1e-6);
    EXPECT_LE(plate.norm(), 1e-6);
    EXPECT_NEAR(motion_of(simulation).turn, 0, 1e-12);
    const VectorX u = simulation.positions();
    const Vec<2> corner = u.segment<2>(2 * 42) - Vec<2>(0, 0.1), middle = motion_of(simulation).point - Vec<2>(0.05, 0.11);
    EXPECT_LE((corner - middle).norm(), 1e-6 * middle.norm()) << "the top of the block goes with the plate";
  }
}

TEST_F(RigidScene, ToolThatNothingStopsEndsWithTheReason) {
  write_box("block.obj", 2, 2, {0, 0}, {0.1, 0.1});
  write_box("plate.obj", 2, 1, {-0.02, 0}, {0.14, 0.02});
  Simulation<2> simulation(setup_of<2>(press({{"force", {0, 50}}}, 0.03)), registry_);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("nothing comes in its way"), std::string::npos) << result.reason;
}

TEST_F(RigidScene, SpinningPaddleAtLargeStepsPassesThroughNothing) {
  write_box("paddle.obj", 10, 1, {-0.5, -0.02}, {1, 0.04});
  write_box("flap.obj", 1, 10, {0.35, 0.1}, {0.04, 0.6});
  const json paddle = {{"density", 2000}, {"held", {"x", "y"}}};
  const json scene = {{"geometry",
                       {{{"mesh", "paddle.obj"}, {"name", "paddle"}, {"rigid", paddle}},
                        {{"mesh", "flap.obj"},
                         {"volume_selection", 1},
                         {"surface_selection", {{{"id", 4}, {"axis", "y"}, {"position", 0.699}}}}}}},
                      {"materials", {{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e6}, {"nu", 0.3}, {"rho", 1000}}}},
                      {"time", {{"dt", 0.02}, {"tend", 0.4}}},
                      {"boundary_conditions", {{"dirichlet_boundary", {{{"id", 4}, {"value", {0, 0}}}}}}},
                      {"initial_conditions", {{"velocity", {{{"id", "paddle"}, {"value", {"-20*y", "20*x"}}}}}}},
                      {"contact", {{"enabled", true}}}};
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  double largest = 0;
  while (!simulation.finished()) {
    advance(simulation);
    expect_free_of_violations(simulation);
    const Motion2 now = motion_of(simulation);
    EXPECT_LE(now.point.norm(), 1e-12);
    largest = std::max(largest, std::abs(now.turn));
  }
  EXPECT_GT(largest, 0.5) << "the paddle has not come to the flap";
}

TEST_F(RigidScene, RemeshingLeavesTheToolAlone) {
  write_box("block.obj", 4, 4, {0, 0}, {0.1, 0.1});
  write_disc("tool.obj", 24, 0.03, {0.05, 0.131});
  json scene = press({{"force", {0, -400}}, {"held", {"x", "rz"}}}, 0);
  scene["geometry"][1] = {
      {"mesh", "tool.obj"}, {"name", "plate"}, {"rigid", {{"force", {0, "-400*t"}}, {"held", {"x", "rz"}}}}};
  scene["time"] = {{"quasistatic", true}, {"dt", 0.5}, {"tend", 1}};
  scene["space"] = {{"remesh", {{"enabled", true}}}};
  scene["boundary_conditions"]["dirichlet_boundary"][0].erase("dimension");
  Simulation<2> simulation(setup_of<2>(scene), registry_);
  int splits = 0;
  while (!simulation.finished()) {
    splits += advance(simulation).report.splits.accepted;
    expect_free_of_violations(simulation);
  }
  int cells = 0;
  for (const CellId c : simulation.mesh().live_cells())
    cells += rigid_body_of(simulation.setup().materials.at(simulation.mesh().body(c))) != nullptr;
  EXPECT_EQ(cells, 24);
  EXPECT_GT(splits, 10);
}

TEST_F(RigidScene, UnitsDoNotMatter) {
  write_box("bar.obj", 8, 1, {-0.5, -0.05}, {1, 0.1});
  write_box("bar_mm.obj", 8, 1, {-500, -50}, {1000, 100});
  const json bar = {{"mesh", "bar.obj"}, {"rigid", {{"mass", 12}, {"force", {3, "2*t"}}, {"moment", 2}}}};
  const json metres = {{"geometry", json::array({bar})}, {"time", {{"dt", 0.05}, {"tend", 0.5}}}};
  json millimetres = metres;
  millimetres["units"] = {{"length", "mm"}, {"mass", "t"}, {"time", "s"}};
  millimetres["geometry"][0]["mesh"] = "bar_mm.obj";
  // By thickness of 1 mm: 12 kg/m, 3 N/m and 2 N.
  millimetres["geometry"][0]["rigid"] = {{"mass", 12e-6}, {"force", {3e-3, "2e-3*t"}}, {"moment", 2}};
  Simulation<2> one(setup_of<2>(metres), registry_), other(setup_of<2>(millimetres), registry_);
  while (!one.finished()) advance(one), advance(other);
  EXPECT_LE((one.positions() - other.positions()).norm(), 1e-9);
  EXPECT_NEAR(motion_of(one).speed[0], 3. / 12 * 0.5, 1e-3 * 3. / 12 * 0.5);
}

TEST_F(RigidScene, BallOfASurfaceRollsInSpace) {
  // An octahedron whose faces are split three times, on a sphere; its inertia is its own.
  std::vector<Vec<3>> points = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  std::vector<std::array<int, 3>> faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                           {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int i = 0; i < 3; ++i) {
    std::map<std::pair<int, int>, int> middles;
    std::vector<std::array<int, 3>> finer;
    const auto middle = [&](int a, int b) {
      const auto [found, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<int>(points.size()));
      if (is_new) points.push_back((points[a] + points[b]).normalized());
      return found->second;
    };
    for (const auto& [a, b, c] : faces) {
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    faces = finer;
  }
  std::ostringstream text;
  text.precision(17);
  for (const Vec<3>& p : points) text << "v " << 0.1 * p[0] << ' ' << 0.1 * p[1] + 0.1001 << ' ' << 0.1 * p[2] << '\n';
  for (const auto& f : faces) text << "f " << f[0] + 1 << ' ' << f[1] + 1 << ' ' << f[2] + 1 << '\n';
  write("ball.obj", text.str());
  const double slope = 0.2;
  const json scene = {{"geometry", {{{"mesh", "ball.obj"}, {"rigid", {{"density", 1000}}}}, {{"type", "ground"}}}},
                      {"time", {{"dt", 0.01}, {"tend", 0.4}}},
                      {"boundary_conditions", {{"rhs", {-kGravity * std::sin(slope), kGravity * std::cos(slope), 0}}}},
                      {"contact", {{"enabled", true}, {"friction_coefficient", 0.6}}}};
  Simulation<3> simulation(setup_of<3>(scene), registry_);
  const VectorX start = simulation.positions();
  while (!simulation.finished()) {
    advance(simulation);
    expect_free_of_violations(simulation);
  }
  const State<3>& state = simulation.state();
  const RigidCoordinates<3> rigid(simulation.setup().materials, whole_mesh(state.mesh, simulation.setup().obstacles.rest));
  const auto rate = rigid.frame(0, state.history.v[0]);
  const double a = 5. / 7 * kGravity * std::sin(slope);
  EXPECT_NEAR(rate(0, 0), a * 0.4, 0.05 * a * 0.4);
}

TEST_F(RigidScene, WhatHasNoMeaningIsRefused) {
  write_box("bar.obj", 2, 1, {-0.5, -0.05}, {1, 0.1});
  const json bar = {{"mesh", "bar.obj"}, {"rigid", {{"mass", 1}}}};
  const json scene = {{"geometry", json::array({bar})}, {"time", {{"dt", 0.1}, {"tend", 1}}}};
  const auto place = [&](const char* pointer, const json& value) {
    json changed = scene;
    changed[json::json_pointer(pointer)] = value;
    return failure(changed).place;
  };
  EXPECT_EQ(place("/geometry/0/rigid", json::object()), "/geometry/0/rigid/mass");
  EXPECT_EQ(place("/geometry/0/rigid/density", 1), "/geometry/0/rigid/density");
  EXPECT_EQ(place("/geometry/0/rigid/held", json::array({"rx"})), "/geometry/0/rigid/held/0");
  EXPECT_EQ(place("/geometry/0/rigid/held", json::array({"up"})), "/geometry/0/rigid/held/0");
  EXPECT_EQ(place("/geometry/0/rigid/force", {1, 2, 3}), "/geometry/0/rigid/force");
  EXPECT_EQ(place("/geometry/0/rigid/moment", {1, 2, 3}), "/geometry/0/rigid/moment");
  EXPECT_EQ(place("/geometry/0/rigid/about", json::array({1})), "/geometry/0/rigid/about");
  EXPECT_EQ(place("/geometry/0/rigid/about", json::array({1e9, 0})), "/geometry/0/rigid/about") << "round-off hides turns";
  EXPECT_EQ(place("/geometry/0/rigid/weight", 1), "/geometry/0/rigid/weight");
  EXPECT_EQ(place("/geometry/0/is_obstacle", true), "/geometry/0/rigid");

  const auto run_place = [&](const json& changes) {
    json changed = scene;
    changed["geometry"][0]["name"] = "bar";
    changed["geometry"][0]["surface_selection"] = 1;
    changed.merge_patch(changes);
    try {
      Simulation<2> simulation(setup_of<2>(changed), registry_);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string("accepted");
  };
  EXPECT_EQ(run_place(json::object()), "accepted");
  EXPECT_EQ(run_place({{"boundary_conditions", {{"dirichlet_boundary", {{{"id", 1}, {"value", {0, 0}}}}}}}}),
            "/boundary_conditions/dirichlet_boundary");
  EXPECT_EQ(run_place({{"initial_conditions", {{"velocity", {{{"id", "bar"}, {"value", {"x", 0}}}}}}}}),
            "/initial_conditions/velocity");
  EXPECT_EQ(run_place({{"initial_conditions", {{"solution", {{{"id", "bar"}, {"value", {"x", 0}}}}}}}}),
            "/initial_conditions/solution");
  EXPECT_EQ(run_place({{"output", {{"error_bars", true}}}}), "/output/error_bars");
}

}  // namespace
}  // namespace itr::scene
