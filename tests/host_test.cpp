// SPDX-License-Identifier: MIT
// A program that embeds the library, between and within steps.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "fem/locator.hpp"
#include "host_block.hpp"
#include "itr/core.hpp"

namespace itr {
namespace {

template <int Dim>
void expect_same_state(const State<Dim>& a, const State<Dim>& b) {
  EXPECT_EQ(a.t, b.t);
  EXPECT_EQ(a.step, b.step);
  ASSERT_EQ(a.mesh.num_vertices(), b.mesh.num_vertices());
  EXPECT_EQ(a.history.x, b.history.x);
  EXPECT_EQ(a.history.v, b.history.v);
}

TEST(HostLoop, TheLengthOfAStepIsAnArgument) {
  auto asked = simulate(pressed_block()), given = simulate(pressed_block());
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(asked.advance().ok);
    ASSERT_TRUE(given.advance(0.01).ok);
  }
  expect_same_state(asked.state(), given.state());
  ASSERT_TRUE(given.advance(0.004).ok);
  ASSERT_TRUE(given.advance(0.002).ok);
  EXPECT_DOUBLE_EQ(given.state().t, 0.036);
  EXPECT_EQ(given.state().step, 5);
  EXPECT_THROW(given.advance(0), InputError);
  EXPECT_THROW(given.advance(NAN), InputError);
}

TEST(HostLoop, StepsOfAnyLengthFollowAParabola) {
  for (const Integrator integrator : {Integrator::newmark, Integrator::bdf}) {
    auto setup = block<3>();
    setup.time.integrator = integrator;
    setup.initial_acceleration.push_back({1, [](const Vec<3>&, double) { return Vec<3>(-kGravity * Vec<3>::Unit(1)); }});
    auto simulation = simulate(setup);
    double t = 0, last = 0;
    for (const double dt : {0.01, 0.01, 0.03, 0.005, 0.005, 0.02}) {
      ASSERT_TRUE(simulation.advance(dt).ok);
      t += dt;
      const double fall = simulation.state().history.v[0][1];
      EXPECT_NEAR(fall, -kGravity * t, 1e-8) << "t = " << t;  // all of these rules have exact velocities
      EXPECT_LT(fall, last);
      last = fall;
    }
  }
}

TEST(HostLoop, ConditionsChangeBetweenSteps) {
  auto setup = block<2>();
  setup.dirichlet.push_back({1, {true, true}, [](const Vec<2>&, double) { return Vec<2>::Zero().eval(); }});
  auto simulation = simulate(setup);
  ASSERT_TRUE(simulation.advance().ok);
  simulation.conditions().dirichlet[0].displacement = [](const Vec<2>&, double) { return Vec<2>(0.01, 0); };
  simulation.conditions().body_acceleration = nullptr;
  ASSERT_TRUE(simulation.advance().ok);
  for (int v = 0; v < simulation.state().mesh.num_vertices(); ++v)
    if (simulation.state().mesh.rest(v)[0] == 0) {
      EXPECT_NEAR(simulation.state().history.x[0][2 * v], 0.01, 1e-15);
    }
}

TEST(HostLoop, ReplaysWithTheSameBits) {
  auto simulation = simulate(pressed_block());
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(simulation.advance(0.01).ok);
  const Snapshot<2> snapshot = simulation.save();
  const auto go_on = [&] {
    for (const double dt : {0.005, 0.01, 0.01}) EXPECT_TRUE(simulation.advance(dt).ok);
    return simulation.state();
  };
  const State<2> first = go_on();
  EXPECT_NE(first.mesh.num_vertices(), snapshot.state->mesh.num_vertices());
  simulation.restore(snapshot);
  EXPECT_EQ(simulation.state().step, 2);
  expect_same_state(go_on(), first);
  simulation.restore(snapshot);
  expect_same_state(go_on(), first);
}

/// As programs may hold it, while no snapshot does.
TEST(HostLoop, AReferenceToTheStateFollowsIt) {
  auto setup = block<2>();
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 2, .dt = 0.01, .steps = 1000};
  auto simulation = simulate(setup);
  const State<2>& state = simulation.state();
  for (const double dt : {0.01, 0.01, 0.02, 0.02}) {
    ASSERT_TRUE(simulation.advance(dt).ok);
    ASSERT_EQ(&simulation.state(), &state);
  }
  simulation.restore(State<2>(state));
  EXPECT_EQ(&simulation.state(), &state);
  EXPECT_EQ(state.step, 4);
}

/// Their times on meshes of 10^4 vertices: `itr_bench --benchmark_filter=Snapshot`.
TEST(HostLoop, SavingAndRestoringCopyNothing) {
  auto simulation = simulate(pressed_block());
  ASSERT_TRUE(simulation.advance(0.01).ok);
  const State<2>* state = &simulation.state();
  const Snapshot<2> snapshot = simulation.save();
  EXPECT_EQ(snapshot.state.get(), state);
  ASSERT_TRUE(simulation.advance(0.01).ok);
  EXPECT_NE(&simulation.state(), state);
  EXPECT_EQ(snapshot.state->step, 1);
  simulation.restore(snapshot);
  EXPECT_EQ(&simulation.state(), state);
}

TEST(HostLoop, AMeshIsFrozenWhileTheProgramSaysSo) {
  auto simulation = simulate(pressed_block());
  simulation.conditions().remesh.enabled = false;
  for (int i = 0; i < 3; ++i) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok);
    EXPECT_TRUE(result.renumbering.empty());
  }
  EXPECT_EQ(simulation.state().mesh.num_vertices(), 16);
  simulation.conditions().remesh.enabled = true;
  ASSERT_TRUE(simulation.advance().ok);
  EXPECT_GT(simulation.state().mesh.num_vertices(), 16);
}

TEST(HostLoop, AMeshIsFoundBeforeIterationsOverAStep) {
  auto whole = simulate(pressed_block()), apart = simulate(pressed_block());
  int changes = 0;
  apart.on_mesh_change([&](const MeshChange<2>&, const Mesh<2>&) { ++changes; });
  ASSERT_TRUE(whole.advance(0.01).ok);
  ASSERT_TRUE(apart.adapt(0.01).ok);
  EXPECT_EQ(changes, 1);
  EXPECT_EQ(apart.state().step, 0);
  EXPECT_EQ(apart.state().t, 0);
  ASSERT_EQ(apart.state().mesh.num_vertices(), whole.state().mesh.num_vertices());
  apart.conditions().remesh.enabled = false;
  const Snapshot<2> start = apart.save();
  for (int i = 0; i < 2; ++i) {
    apart.restore(start);
    ASSERT_TRUE(apart.advance(0.01).ok);
    // Both reach the same minimum, from different starts.
    EXPECT_LT((apart.state().history.x[0] - whole.state().history.x[0]).lpNorm<Eigen::Infinity>(), 1e-8);
  }
  EXPECT_EQ(changes, 1);
}

TEST(Events, AnIterationCanEndTheStep) {
  auto setup = pressed_block();
  setup.time.step_cuts = 3;
  int calls = 0;
  setup.on_iteration = [&](const NewtonProgress& progress) { return ++calls, progress.iteration < 2; };
  auto simulation = simulate(setup);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_TRUE(result.cancelled);
  EXPECT_EQ(calls, 2);  // the step was not cut
  EXPECT_EQ(simulation.state().step, 0);
  simulation.conditions().on_iteration = nullptr;
  EXPECT_TRUE(simulation.advance().ok);
}

/// A state that a listener keeps stays as it is, and takes the simulation back to before the step.
TEST(Events, AListenerSeesTheStateBeforeTheStep) {
  auto setup = pressed_block();
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 2, .dt = 0.01, .steps = 1000};
  auto simulation = simulate(setup), plain = simulate(setup);
  ASSERT_TRUE(simulation.advance().ok);
  ASSERT_TRUE(plain.advance().ok);
  const State<2> before = simulation.state();
  std::optional<Snapshot<2>> kept;
  simulation.conditions().on_iteration = [&](const NewtonProgress&) {
    kept = simulation.save();
    expect_same_state(simulation.state(), before);
    EXPECT_EQ(simulation.report().step, 1);
    return true;
  };
  ASSERT_TRUE(simulation.advance().ok);
  ASSERT_TRUE(plain.advance().ok);
  expect_same_state(simulation.state(), plain.state());
  ASSERT_TRUE(kept.has_value());
  expect_same_state(*kept->state, before);
  simulation.restore(*kept);
  expect_same_state(simulation.state(), before);
  ASSERT_TRUE(simulation.advance().ok);
  expect_same_state(simulation.state(), plain.state());
}

/// Each is refused with a message, from a listener and from a function of a condition, and the step goes on.
TEST(Events, AListenerMayNotChangeWhatTheStepRefersTo) {
  auto plain = simulate(pressed_block());
  std::optional<Simulation<2>> simulation;
  std::optional<Snapshot<2>> start;
  int refused = 0;
  const auto try_all = [&] {
    const std::function<void()> changes[] = {[&] { simulation->restore(*start); },
                                             [&] { simulation->restore(State<2>(*start->state)); },
                                             [&] { simulation->advance(); },
                                             [&] { simulation->advance(0.01); },
                                             [&] { simulation->adapt(0.01); },
                                             [&] { simulation->conditions().on_iteration = nullptr; },
                                             [&] { simulation->on_mesh_change(nullptr); }};
    for (const auto& change : changes) {
      try {
        change();
        ADD_FAILURE() << "change " << &change - changes << " was not refused";
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("from inside of a step"), std::string::npos) << error.what();
        ++refused;
      }
    }
  };
  auto setup = pressed_block();
  setup.on_iteration = [&](const NewtonProgress&) { return try_all(), true; };
  setup.dirichlet[0].displacement = [&, given = setup.dirichlet[0].displacement](const Vec<2>& X, double t) {
    if (t > 0 && simulation) try_all();
    return given(X, t);
  };
  simulation.emplace(simulate(setup));
  start = simulation->save();
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(simulation->advance().ok);
    ASSERT_TRUE(plain.advance().ok);
  }
  EXPECT_GT(refused, 20);
  expect_same_state(simulation->state(), plain.state());
}

/// The step is done: conditions may follow the mesh, but no step may begin.
TEST(Events, AListenerOfMeshChangesMayChangeConditionsOnly) {
  auto simulation = simulate(pressed_block());
  const Snapshot<2> start = simulation.save();
  int calls = 0;
  simulation.on_mesh_change([&](const MeshChange<2>&, const Mesh<2>& before) {
    ++calls;
    EXPECT_EQ(simulation.report().vertices, simulation.state().mesh.num_vertices());
    EXPECT_NE(before.num_vertices(), simulation.state().mesh.num_vertices());
    simulation.conditions().body_acceleration = nullptr;
    EXPECT_THROW(simulation.advance(), InputError);
    EXPECT_THROW(simulation.adapt(0.01), InputError);
    EXPECT_THROW(simulation.restore(start), InputError);
    EXPECT_THROW(simulation.restore(State<2>(*start.state)), InputError);
    EXPECT_THROW(simulation.on_mesh_change(nullptr), InputError);
  });
  ASSERT_TRUE(simulation.advance().ok);
  EXPECT_EQ(calls, 1);
  simulation.restore(start);
}

TEST(HostLoop, AStepThatFailsKeepsItsLengthToItself) {
  auto setup = block<2>();
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 2, .dt = 0.01, .steps = 1000};
  auto simulation = simulate(setup), plain = simulate(setup);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.advance().ok && plain.advance().ok);
  const State<2> before = simulation.state();
  simulation.conditions().on_iteration = [](const NewtonProgress&) { return false; };
  EXPECT_TRUE(simulation.advance(0.002).cancelled);
  simulation.conditions().on_iteration = [](const NewtonProgress&) -> bool { throw std::runtime_error("mine"); };
  EXPECT_THROW(simulation.advance(0.002), std::runtime_error);
  simulation.conditions().on_iteration = nullptr;
  expect_same_state(simulation.state(), before);
  EXPECT_EQ(simulation.setup().time.dt, 0.01);
  ASSERT_TRUE(simulation.advance().ok && plain.advance().ok);
  expect_same_state(simulation.state(), plain.state());
}

TEST(HostLoop, ASnapshotOfAnotherSimulationIsRefused) {
  auto simulation = simulate(pressed_block()), other = simulate(block<2>());
  EXPECT_THROW(simulation.restore(other.save()), InputError);
  ASSERT_TRUE(simulation.advance().ok);
  Simulation<2> moved = std::move(other);
  moved.restore(moved.save());
}

TEST(HostLoop, TheReportIsOfTheStateThatThereIs) {
  auto simulation = simulate(pressed_block());
  EXPECT_EQ(simulation.report().vertices, 16);
  const Snapshot<2> start = simulation.save();
  const StepResult step = simulation.advance();
  ASSERT_TRUE(step.ok);
  EXPECT_EQ(simulation.report().energy.total, step.report.energy.total);
  EXPECT_EQ(simulation.report().splits.accepted, step.report.splits.accepted);
  simulation.restore(start);
  EXPECT_EQ(simulation.report().step, 0);
  EXPECT_EQ(simulation.report().vertices, 16);
  const StepResult adapted = simulation.adapt(0.01);
  EXPECT_EQ(simulation.report().step, 0);
  EXPECT_EQ(simulation.report().t, 0);
  EXPECT_EQ(simulation.report().vertices, simulation.state().mesh.num_vertices());
  EXPECT_GT(simulation.report().vertices, 16);
  EXPECT_EQ(simulation.report().splits.accepted, adapted.report.splits.accepted);
  simulation.restore(State<2>(*start.state));
  EXPECT_EQ(simulation.report().vertices, 16);
  EXPECT_EQ(simulation.report().splits.accepted, 0);
}

TEST(Events, TheProgramIsToldOfMeshChanges) {
  auto simulation = simulate(pressed_block());
  VectorX own;  // 1 + 2 X - 3 Y at the vertices
  const auto exact = [](const Mesh<2>& mesh) {
    VectorX values(mesh.node_slots());
    for (int v = 0; v < values.size(); ++v) values[v] = 1 + 2 * mesh.rest(v)[0] - 3 * mesh.rest(v)[1];
    return values;
  };
  own = exact(simulation.state().mesh);
  int changes = 0;
  simulation.on_mesh_change([&](const MeshChange<2>& change, const Mesh<2>& before) {
    ++changes;
    EXPECT_EQ(before.node_slots(), own.size());
    EXPECT_LT((project_fields(before, simulation.state().mesh, change, own) - exact(simulation.state().mesh)).norm(), 1e-12);
    own = change.interpolation * own;
  });
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(simulation.advance().ok);
  EXPECT_GT(changes, 0);
  ASSERT_EQ(own.size(), simulation.state().mesh.num_vertices());
  EXPECT_LT((own - exact(simulation.state().mesh)).norm(), 1e-12);
}

TEST(Locator, FindsPointsAndVertices) {
  const Mesh<3> mesh = make_block<3>();
  const Locator<3> locator(mesh);
  for (int v = 0; v < mesh.node_slots(); ++v) {
    const auto place = locator.find(mesh.rest(v));
    for (int k = 0; k <= 3; ++k) EXPECT_EQ(place.weights[k], place.nodes[k] == v ? 1 : 0);
  }
  const Vec<3> X(0.07, 0.11, 0.03);
  const auto place = locator.find(X);
  Vec<3> there = Vec<3>::Zero();
  for (int k = 0; k <= 3; ++k) there += place.weights[k] * mesh.rest(place.nodes[k]);
  EXPECT_LT((there - X).norm(), 1e-15);
  EXPECT_EQ(locator.find(X, 7).cell, kNone);  // no such body
  VectorX values(8);
  for (int v = 0; v < 8; ++v) values[v] = mesh.rest(v)[1];
  EXPECT_NEAR(nodal_function<3>(std::make_shared<Locator<3>>(mesh), values, 1)(X)[0], 0.11, 1e-15);
}

}  // namespace
}  // namespace itr
