// SPDX-License-Identifier: MIT
// Scenes with springs and coupled points: closed forms, momentum, remeshing, what is refused.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <sstream>

#include "advance.hpp"
#include "energy/coupling.hpp"
#include "energy/spring.hpp"
#include "fem/cell_set.hpp"
#include "itr/simulation.hpp"
#include "random_cube.hpp"
#include "scene_folder.hpp"
#include "simulation/invariants.hpp"
#include "simulation/resultant.hpp"
#include "simulation/state.hpp"

namespace itr::scene {
namespace {

constexpr double kModulus = 1e5;

/// Scenes of a beam along x: its left end has the id 1, its right end 3, its lower side 2, its upper one 4.
class SupportSceneTest : public SceneTest {
 protected:
  static json side(int id, const char* axis, double position) {
    return {{"id", id}, {"axis", axis}, {"position", position}};
  }
  json beam(double length, double height, int along, int across, const json& changes) {
    std::ostringstream mesh;
    mesh.precision(17);
    for (int j = 0; j <= across; ++j)
      for (int i = 0; i <= along; ++i) mesh << "v " << length * i / along << ' ' << height * j / across << " 0\n";
    for (int j = 0; j < across; ++j)
      for (int i = 0; i < along; ++i) {
        const int a = j * (along + 1) + i + 1, b = a + along + 1;
        mesh << "f " << a << ' ' << a + 1 << ' ' << b + 1 << "\nf " << a << ' ' << b + 1 << ' ' << b << '\n';
      }
    write("beam.obj", mesh.str());
    constexpr double kInside = 1e-6;
    json scene = {{"geometry",
                   {{{"mesh", "beam.obj"},
                     {"volume_selection", 1},
                     {"surface_selection",
                      {side(1, "-x", kInside), side(3, "x", length - kInside), side(2, "-y", kInside),
                       side(4, "y", height - kInside)}}}}},
                  {"materials", {{{"id", 1}, {"type", "SaintVenant"}, {"E", kModulus}, {"nu", 0.0}, {"rho", 1000}}}},
                  {"space", {{"discr_order", 2}}}};
    scene.merge_patch(changes);
    return scene;
  }
  static json clamp() { return {{"dirichlet_boundary", {{{"id", 1}, {"value", {0, 0}}}}}}; }
  Simulation<2> simulation_of(const json& scene) { return Simulation<2>(read2(scene), registry_); }
  static ForceSums<2> sums(const Simulation<2>& simulation, const std::string& name) {
    for (const ForceTarget& target : simulation.setup().fields.curves)
      if (target.name == name) return force_sums(simulation.state(), simulation.forces(), target);
    throw std::runtime_error("no curve " + name);
  }
  static CoupledPoint<2>::Means means(const Simulation<2>& simulation) {
    const CellSet<2> cells = whole_mesh(simulation.mesh(), {});
    const SurfaceMean<2> mean(cells, couplings_of<2>(simulation.setup().nodal_loads)[0]->surfaces);
    return CoupledPoint<2>(mean, Vec<3>::Zero()).means_of(mean.displacements(simulation.state().history.x[0]));
  }
  struct Motion {
    Vec<2> u;
    double turn;
  };
  /// Finds that of the first coupling.
  static Motion motion_of(const Simulation<2>& simulation) {
    const CellSet<2> cells = whole_mesh(simulation.mesh(), {});
    const auto coupling = couplings_of<2>(simulation.setup().nodal_loads)[0];
    const SurfaceMean<2> mean(cells, coupling->surfaces);
    const CoupledPoint<2> point(mean, coupling->point);
    const VectorX& x = simulation.state().history.x[0];
    const Mat<3> R = point.rotation(point.means_of(mean.displacements(x))).R();
    return {point.displacement(x), std::atan2(R(1, 0), R(0, 0))};
  }

  linear::Registry registry_;
};

/// A force on an arm beyond the end of a cantilever, and a couple: beam theory with shear (Timoshenko).
TEST_F(SupportSceneTest, ForceAndMomentOnAnArmBendABeam) {
  constexpr double kLength = 10, kArm = 2, kForce = 0.5, kMoment = 1.5, kI = 1.0 / 12;
  for (const char* kind : {"distributing", "rigid"}) {
    Simulation<2> simulation = simulation_of(
        beam(kLength, 1, 40, 4,
             {{"boundary_conditions", clamp()},
              {"output", {{"forces", {{{"name", "wall"}, {"surfaces", 1}, {"about", {kLength + kArm, 0.5}}}}}}},
              {"couplings",
               {{{"id", 3},
                 {"kind", kind},
                 {"point", {kLength + kArm, 0.5}},
                 {"force", {0, -kForce}},
                 {"moment", -kMoment},
                 {"name", "tip"}}}}}));
    advance(simulation);
    const double bent = kMoment + kForce * kArm, stiffness = kModulus * kI;
    const double turn = -(kForce * kLength * kLength / 2 + bent * kLength) / stiffness;
    const double sag = -(kForce * std::pow(kLength, 3) / 3 + bent * kLength * kLength / 2) / stiffness -
                       1.2 * kForce * kLength * 2 / kModulus;
    const Motion tip = motion_of(simulation);
    EXPECT_NEAR(tip.turn, turn, 3e-3 * std::abs(turn)) << kind;
    EXPECT_NEAR(tip.u[1], sag + kArm * turn, 3e-3 * std::abs(sag + kArm * turn)) << kind;
    const auto wall = sums(simulation, "wall"), point = sums(simulation, "tip");
    EXPECT_NEAR(wall.reaction.force[1], kForce, 1e-9 * kForce);
    EXPECT_NEAR(wall.reaction.force[0], 0, 1e-9 * kForce);
    // About the point at rest; it has moved by u under the force.
    EXPECT_NEAR(wall.reaction.moment[0], kMoment + kForce * tip.u[0], 1e-8 * kMoment);
    EXPECT_NEAR(point.all.force[1], -kForce, 1e-10 * kForce);
  }
}

/// A guided end: held against turns, moved across, k = 12 EI / L^3 with shear.
TEST_F(SupportSceneTest, MovedPointBendsABeam) {
  constexpr double kLength = 10, kI = 1.0 / 12, kMotion = 0.1;
  for (const char* kind : {"distributing", "rigid"}) {
    Simulation<2> simulation = simulation_of(beam(
        kLength, 1, 40, 4,
        {{"boundary_conditions", clamp()},
         {"output", {{"forces", {{{"name", "wall"}, {"surfaces", 1}}, {{"name", "beam"}, {"bodies", 1}}}}}},
         {"couplings", {{{"id", 3}, {"kind", kind}, {"held", {"y", "rz"}}, {"motion", {0, kMotion}}, {"name", "end"}}}}}));
    advance(simulation);
    const Motion end = motion_of(simulation);
    EXPECT_NEAR(end.u[1], kMotion, 1e-8 * kMotion);
    EXPECT_NEAR(end.turn, 0, 1e-9);
    const double soft = std::pow(kLength, 3) / (12 * kModulus * kI) + 1.2 * kLength * 2 / kModulus;
    const auto wall = sums(simulation, "wall"), held = sums(simulation, "end");
    EXPECT_NEAR(held.all.force[1], kMotion / soft, 3e-3 * kMotion / soft) << kind;
    const auto beam = sums(simulation, "beam");
    EXPECT_LE((held.all.force + wall.reaction.force - beam.all.force).norm(), 1e-10 * held.all.force.norm());
    EXPECT_LE((beam.all.force - beam.residual.force).norm(), 1e-10 * held.all.force.norm());
  }
}

/// A point that turns by half a turn takes its surface along, as an end of a free bar, without strain.
TEST_F(SupportSceneTest, HeldPointTurnsABody) {
  Simulation<2> simulation = simulation_of(
      beam(2, 1, 4, 2,
           {{"time", {{"quasistatic", true}, {"dt", 0.1}, {"time_steps", 5}}},
            {"couplings",
             {{{"id", 3}, {"point", {3, 0}}, {"held", {"x", "y", "rz"}}, {"motion", {"t", 0}}, {"turn", "200*t"}}}}}));
  for (int step = 0; step < 5; ++step) advance(simulation);
  const Motion motion = motion_of(simulation);
  EXPECT_NEAR(motion.turn, 100 * std::numbers::pi / 180, 1e-8);
  EXPECT_LE((motion.u - Vec<2>(0.5, 0)).norm(), 1e-8);
  const VectorX& x = simulation.state().history.x[0];
  EXPECT_NEAR((x.segment<2>(0) - x.segment<2>(2 * 4)).norm(), 2, 1e-6);
  // By more than a quarter of a turn at once, too.
  Simulation<2> at_once =
      simulation_of(beam(2, 1, 4, 2, {{"couplings", {{{"id", 3}, {"held", {"x", "y", "rz"}}, {"turn", 120}}}}}));
  advance(at_once);
  EXPECT_NEAR(motion_of(at_once).turn, 120 * std::numbers::pi / 180, 1e-8);
}

/// A stiff block on springs along y only, with a mass on it: sinks by m g / k, swings by the period of both masses.
TEST_F(SupportSceneTest, MassOnSpringsSinksAndSwings) {
  constexpr double kStiffness = 3e4, kMass = 500, kGravity = 9.81;
  const json changes = {{"materials", {{{"id", 1}, {"type", "SaintVenant"}, {"E", 1e9}, {"nu", 0.0}, {"rho", 1000}}}},
                        {"space", {{"discr_order", 1}}},
                        {"boundary_conditions", {{"rhs", {0, kGravity}}}},
                        {"springs", {{{"id", 2}, {"stiffness", {kStiffness, kStiffness}}}}},
                        {"couplings", {{{"id", 4}, {"mass", kMass}, {"held", {"x", "rz"}}}}}};
  const double sink = (1000 + kMass) * kGravity / kStiffness;
  Simulation<2> at_rest = simulation_of(beam(1, 1, 2, 2, changes));
  advance(at_rest);
  EXPECT_NEAR(motion_of(at_rest).u[1], -sink, 1e-4 * sink);
  const auto springs = sums(at_rest, "spring 2"), point = sums(at_rest, "coupling 4");
  EXPECT_NEAR(springs.all.force[1], 1500 * kGravity, 1e-9 * 1500 * kGravity);
  EXPECT_NEAR(point.all.force[1], -kMass * kGravity, 1e-10 * kMass * kGravity);
  json moving = changes;
  const double period = 2 * std::numbers::pi * std::sqrt((1000 + kMass) / kStiffness);
  moving["time"] = {{"dt", period / 100}, {"time_steps", 50}, {"integrator", "ImplicitNewmark"}};
  Simulation<2> swings = simulation_of(beam(1, 1, 2, 2, moving));
  for (int step = 0; step < 50; ++step) advance(swings);
  EXPECT_NEAR(motion_of(swings).u[1], -2 * sink, 2e-3 * sink);
  // The first step begins without acceleration, which costs half of it.
  EXPECT_NEAR(swings.state().history.v[0][1], 0, 0.04 * sink * 2 * std::numbers::pi / period);
}

/// A long beam on an elastic foundation under a load in its middle (Winkler; Hetenyi 1946).
TEST_F(SupportSceneTest, BeamOnAFoundation) {
  constexpr double kLength = 60, kFoundation = 10, kForce = 0.05, kI = 1.0 / 12;
  Simulation<2> simulation = simulation_of(beam(kLength, 1, 120, 2,
                                                {{"boundary_conditions", clamp()},
                                                 {"springs", {{{"id", 2}, {"stiffness_by_area", {0, kFoundation}}}}},
                                                 {"couplings", {{{"id", 3}, {"force", {0, -kForce}}}}}}));
  advance(simulation);
  const double lambda = std::pow(kFoundation / (4 * kModulus * kI), 0.25);
  const Motion end = motion_of(simulation);
  // The end of a half-infinite beam: w = 2 P lambda / k, turn 2 P lambda^2 / k.
  EXPECT_NEAR(end.u[1], -2 * kForce * lambda / kFoundation, 0.01 * 2 * kForce * lambda / kFoundation);
  EXPECT_NEAR(end.turn, -2 * kForce * lambda * lambda / kFoundation, 0.01 * 2 * kForce * lambda * lambda / kFoundation);
  const CellSet<2> cells = whole_mesh(simulation.mesh(), {});
  const SpringEnergy<2> springs(cells, *springs_of<2>(simulation.setup().nodal_loads)[0], 1);
  VectorX gradient = VectorX::Zero(simulation.state().history.x[0].size());
  Workspace workspace;
  springs.add_gradient(simulation.state().history.x[0], gradient, workspace);
  EXPECT_NEAR(-gradient.reshaped(2, gradient.size() / 2).row(1).sum(), kForce, 2e-3 * kForce);
}

/// A free body that turns with a mass: momentum stays, on an arm to the order of the step.
TEST_F(SupportSceneTest, MassIsAPartOfMomentum) {
  constexpr double kMass = 700, kSpin = 2;
  for (const double arm : {0.0, 1.0})
    for (const char* integrator : {"ImplicitEuler", "ImplicitNewmark"}) {
      const double y = arm > 0 ? 0 : 0.5;
      const auto about = [](const char* axis, double of_mass) {  // their centre, which flies straight on
        return "-4*(" + std::string(axis) + "-" + std::to_string((500 + kMass * of_mass) / (1000 + kMass)) + ")";
      };
      Simulation<2> simulation =
          simulation_of(beam(1, 1, 2, 2,
                             {{"materials", {{{"id", 1}, {"type", "SaintVenant"}, {"E", 1e8}, {"nu", 0.0}, {"rho", 1000}}}},
                              {"space", {{"discr_order", 1}}},
                              {"initial_conditions",
                               {{"velocity", {{{"id", 1}, {"value", {"-2*y", "2*x"}}}}},
                                {"acceleration", {{{"id", 1}, {"value", {about("x", 1 + arm), about("y", y)}}}}}}},
                              {"output", {{"paraview", {{"options", {{"momentum", true}, {"kinetic_energy", true}}}}}}},
                              {"time", {{"dt", 0.005}, {"time_steps", 20}, {"integrator", integrator}}},
                              {"couplings", {{{"id", 3}, {"point", {1 + arm, y}}, {"mass", kMass}}}}}));
      const auto fields = [&] {
        AskedFields found;
        simulation.observe([&](const FrameView<2>& frame) { found = *frame.asked; });
        return found;
      };
      const AskedFields start = fields();
      EXPECT_NEAR(start.momentum[0], -kSpin * (500 + y * kMass), 1e-9 * 1000);
      EXPECT_NEAR(start.momentum[1], kSpin * (500 + (1 + arm) * kMass), 1e-9 * 1000);
      const double squared = std::pow(1 + arm, 2) + y * y;
      EXPECT_NEAR(start.kinetic_energy[0], kSpin * kSpin / 2 * (1000 * 2.0 / 3 + squared * kMass), 1e-6);
      for (int step = 0; step < 20; ++step) advance(simulation);
      const AskedFields end = fields();
      const Vec<2> change(end.momentum[0] - start.momentum[0], end.momentum[1] - start.momentum[1]);
      const bool is_euler = std::string(integrator) == "ImplicitEuler";
      EXPECT_LE(change.norm(), (arm == 0 ? 1e-8 : is_euler ? 2e-2 : 5e-4) * start.momentum[1]) << integrator << arm;
      EXPECT_NEAR(end.kinetic_energy[0] / start.kinetic_energy[0], 1, is_euler ? 0.1 : 0.01) << integrator << arm;
    }
}

TEST_F(SupportSceneTest, RigidSurfaceKeepsItsShape) {
  const json changes = {{"materials", {{{"id", 1}, {"type", "NeoHookean"}, {"E", kModulus}, {"nu", 0.4}, {"rho", 1000}}}},
                        {"boundary_conditions", clamp()},
                        {"couplings", {{{"id", 3}, {"kind", "rigid"}, {"force", {2e4, 5e3}}}}}};
  const auto stretch = [](const Simulation<2>& simulation) {
    const Mesh<2>& mesh = simulation.mesh();
    double most = 0;
    const VectorX& x = simulation.state().history.x[0];
    for (int v = 0; v < mesh.num_vertices(); ++v)
      for (int w = 0; w < v; ++w)
        if (mesh.rest(v)[0] > 2 - 1e-9 && mesh.rest(w)[0] > 2 - 1e-9)
          most = std::max(
              most, std::abs((x.segment<2>(2 * v) - x.segment<2>(2 * w)).norm() - (mesh.rest(v) - mesh.rest(w)).norm()));
    return most;
  };
  Simulation<2> rigid = simulation_of(beam(2, 1, 8, 4, changes));
  advance(rigid);
  EXPECT_LE(stretch(rigid), 1e-7);
  EXPECT_GT(std::abs(motion_of(rigid).turn), 0.1);
  json soft = changes;
  soft["couplings"][0].erase("kind");
  Simulation<2> distributing = simulation_of(beam(2, 1, 8, 4, soft));
  advance(distributing);
  EXPECT_GT(stretch(distributing), 1e-2);
}

/// Remeshing refines beside a point; the forces at it stay what they are.
TEST_F(SupportSceneTest, PointsAndSpringsStayWhereBodiesAreRemeshed) {
  for (const bool is_dynamic : {false, true}) {
    json changes = {{"space", {{"discr_order", 1}, {"remesh", {{"enabled", true}, {"relative_tolerance", 1e-5}}}}},
                    {"boundary_conditions", clamp()},
                    {"springs", {{{"id", 2}, {"stiffness", 1e3}}}},
                    {"couplings", {{{"id", 3}, {"point", {3, 0.5}}, {"force", {0, "-2000*t"}}, {"name", "tip"}}}},
                    {"output", {{"forces", {{{"name", "body"}, {"bodies", 1}}}}}}};
    changes["time"] = {{"quasistatic", !is_dynamic}, {"dt", 0.25}, {"time_steps", 3}};
    if (is_dynamic) changes["couplings"][0]["mass"] = 100;
    Simulation<2> simulation = simulation_of(beam(2, 1, 4, 2, changes));
    for (int step = 1; step <= 3; ++step) {
      advance(simulation);
      const auto body = sums(simulation, "body"), tip = sums(simulation, "tip");
      if (is_dynamic) continue;
      EXPECT_NEAR(tip.all.force[1], -500 * step, 1e-9 * 500 + std::abs(sums(simulation, "spring 2").all.force[1]));
      EXPECT_LE((body.all.force + body.body.force - body.residual.force).norm(), 1e-8 * 500 * step);
    }
    EXPECT_GT(simulation.mesh().num_vertices(), 15);
  }
}

TEST_F(SupportSceneTest, SavedStatesGoOnWithTheSameBits) {
  const json scene = beam(2, 1, 4, 2,
                          {{"time", {{"dt", 0.02}, {"time_steps", 4}, {"integrator", "ImplicitNewmark"}}},
                           {"springs", {{{"id", 1}, {"stiffness", 1e5}}}},
                           {"couplings",
                            {{{"id", 3},
                              {"point", {3, 0.5}},
                              {"mass", 100},
                              {"held", "rz"},
                              {"turn", "100*t*t"},
                              {"stiffness", {{2e3, 1e3}, {1e3, 2e3}}}}}}});
  Simulation<2> one = simulation_of(scene), other = simulation_of(scene);
  for (int step = 0; step < 2; ++step) advance(one);
  const Snapshot<2> middle = one.save();
  for (int step = 0; step < 2; ++step) advance(one);
  other.restore(*middle.state);
  for (int step = 0; step < 2; ++step) advance(other);
  EXPECT_EQ(one.state().history.x[0], other.state().history.x[0]);
}

/// A die that a force on a point presses onto the ground.
TEST_F(SupportSceneTest, PointPressesABodyOntoAnObstacle) {
  json scene = beam(1, 1, 3, 3,
                    {{"space", {{"discr_order", 1}}},
                     {"contact", {{"enabled", true}, {"friction_coefficient", 0.5}}},
                     {"couplings", {{{"id", 4}, {"point", {0.5, 1.5}}, {"force", {0, -2e3}}, {"held", {"x", "rz"}}}}}});
  scene["geometry"].push_back({{"type", "ground"}, {"height", -0.01}, {"is_obstacle", true}, {"name", "floor"}});
  scene["output"] = {{"forces", {{{"name", "ground"}, {"obstacles", "floor"}}}}};
  Simulation<2> simulation = simulation_of(scene);
  advance(simulation);
  const auto& state = simulation.state();
  EXPECT_EQ(find_violation(simulation.setup(), state.mesh, state.history.x[0]), "");
  EXPECT_NEAR(sums(simulation, "ground").contact.force[1], -2e3, 1e-6 * 2e3);
  EXPECT_NEAR(motion_of(simulation).u[0], 0, 1e-9);
}

/// A couple in space on a cube that a wall holds, and a force on an arm: reactions balance them about the moved point.
TEST(Coupling, MomentInSpaceMeetsItsReaction) {
  for (const bool is_rigid : {false, true}) {
    itr::Setup<3> setup;
    std::mt19937 random(1);
    setup.mesh = make_cube(2, random, 0);
    for (const FacetId f : setup.mesh.live_facets()) {
      double least = 1, most = 0;
      for (const VertexId v : setup.mesh.facet(f)) {
        least = std::min(least, setup.mesh.rest(v)[0]);
        most = std::max(most, setup.mesh.rest(v)[0]);
      }
      setup.mesh.set_facet_tag(f, most < 1e-9 ? 1 : least > 1 - 1e-9 ? 3 : 2);
    }
    setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3};
    setup.dirichlet.push_back({1, {true, true, true}, [](const Vec<3>&, double) { return Vec<3>(0, 0, 0); }});
    const Vec<3> moment(800, -500, 900), force(300, 500, -400);
    Coupling coupling{.name = "tool", .surfaces = {3}, .is_rigid = is_rigid, .point = {1.6, 0.2, 0.5}};
    coupling.force = [=](double) { return force; };
    coupling.moment = [=](double) { return moment; };
    setup.nodal_loads.push_back(CouplingEntry<3>{std::make_shared<const Coupling>(coupling)});
    setup.time = {.is_static = true};
    setup.lagging_tolerance = 1e-7;
    setup.fields.curves = {{.name = "wall", .surfaces = {1}}};
    linear::Registry registry;
    Simulation<3> simulation(setup, registry);
    advance(simulation);
    const auto& state = simulation.state();
    const auto wall = force_sums(state, simulation.forces(), {.name = "wall", .surfaces = {1}});
    const SurfaceMean<3> mean(whole_mesh(state.mesh, {}), coupling.surfaces);
    const Vec<3> point = coupling.point + CoupledPoint<3>(mean, coupling.point).displacement(state.history.x[0]);
    EXPECT_GT((point - coupling.point).norm(), 0.05);
    EXPECT_LE((wall.reaction.force + force).norm(), 1e-8 * force.norm());
    EXPECT_LE((wall.reaction.moment + moment + point.cross(force)).norm(), 1e-5 * moment.norm());
  }
}

TEST_F(SupportSceneTest, RefusesByKey) {
  const auto place = [&](const json& changes) { return failure(beam(2, 1, 4, 2, changes)).place; };
  const auto coupling = [&](json entry) {
    entry["id"] = entry.value("id", 3);
    return place({{"couplings", {entry}}});
  };
  EXPECT_EQ(place({{"springs", {{{"id", 2}}}}}), "/springs/0/stiffness");
  EXPECT_EQ(place({{"springs", {{{"id", 2}, {"stiffness", 1}, {"stiffness_by_area", 1}}}}}), "/springs/0/stiffness");
  EXPECT_EQ(place({{"springs", {{{"id", 2}, {"stiffness", {1, -1}}}}}}), "/springs/0/stiffness");
  EXPECT_EQ(place({{"springs", {{{"id", 2}, {"stiffness", {{1, 2}, {3, 1}}}}}}}), "/springs/0/stiffness");
  EXPECT_EQ(place({{"springs", {{{"id", 2}, {"stiffness", 0}}}}}), "/springs/0/stiffness");
  EXPECT_EQ(place({{"springs", {{{"id", 9}, {"stiffness", 1}}}}}), "/springs/0/id");
  EXPECT_EQ(coupling({{"id", 9}, {"mass", 1}}), "/couplings/0/id");
  EXPECT_EQ(coupling({{"held", "z"}}), "/couplings/0/held");
  EXPECT_EQ(coupling({{"motion", {1, 0}}, {"held", "rz"}}), "/couplings/0/motion");
  EXPECT_EQ(coupling({{"turn", 5}, {"held", "x"}}), "/couplings/0/turn");
  EXPECT_EQ(coupling({{"force", {1, 2, 3}}}), "/couplings/0/force");
  EXPECT_EQ(coupling({{"moment", {1, 2, 3}}}), "/couplings/0/moment");
  EXPECT_EQ(coupling({{"point", {1}}, {"mass", 1}}), "/couplings/0/point");
  EXPECT_EQ(place({{"couplings", {{{"id", 3}, {"mass", 1}}, {{"id", 3}, {"name", "coupling 3"}}}}}), "/couplings");
  const auto refusal = [&](const json& changes) {
    try {
      simulation_of(beam(2, 1, 4, 2, changes));
    } catch (const InputError& error) {
      return error.parts().place + ": " + error.parts().found;
    }
    return std::string();
  };
  EXPECT_EQ(refusal({{"couplings", {{{"id", 3}}}}}), "/couplings/0: a point on which nothing acts");
  EXPECT_EQ(refusal({{"boundary_conditions", clamp()}, {"couplings", {{{"id", 1}, {"mass", 1}}}}}),
            "/couplings/0/id: a surface that a Dirichlet condition holds");
  EXPECT_EQ(refusal({{"couplings", {{{"id", 3}, {"mass", 1}}, {{"id", 3}, {"mass", 1}, {"name", "b"}}}}}),
            "/couplings/1/id: a surface that another coupling has");
  EXPECT_EQ(refusal({{"boundary_conditions", clamp()}, {"couplings", {{{"id", 2}, {"kind", "rigid"}}}}}),
            "/couplings/0/id: a rigid surface of which a condition holds vertex 0");
  EXPECT_EQ(refusal({{"axisymmetric", true}, {"couplings", {{{"id", 3}, {"mass", 1}}}}}).substr(0, 12), "/couplings: ");
}

}  // namespace
}  // namespace itr::scene
