// SPDX-License-Identifier: MIT
// What a program that embeds the library does between and within steps.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "block.hpp"
#include "derivatives.hpp"
#include "itr/core/error.hpp"
#include "itr/energy/elastic/laws.hpp"
#include "itr/energy/follower.hpp"
#include "itr/energy/load.hpp"
#include "itr/energy/point_forces.hpp"
#include "itr/fem/cell_set.hpp"
#include "itr/fem/locator.hpp"
#include "itr/simulation/resultant.hpp"

namespace itr {
namespace {

template <int Dim>
Simulation<Dim> simulate(Setup<Dim> setup) {
  static linear::Registry registry;
  return Simulation<Dim>(std::move(setup), registry);
}

/// A block that is pressed down on its top by a wall, and refined where that helps.
Setup<2> pressed_block() {
  auto setup = block<2>();
  setup.time = {.dt = 0.01, .steps = 1000};
  setup.dirichlet.push_back({2, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(0.3 * t, -0.6 * t); }});
  add_table(setup);
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 1e-4;
  setup.remesh.collapse.acceptance_tolerance = -1e-6;
  setup.remesh.swap.enabled = true;
  setup.remesh.smooth.enabled = true;
  return setup;
}

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
  for (int v = 0; v < simulation.state().mesh.vertex_slots(); ++v)
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

/// What they take on meshes of 10^4 vertices: `itr_bench --benchmark_filter=Snapshot`.
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
    // The same minimum, from another start.
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

/// What a listener keeps stays as it is, and takes the simulation back to before the step.
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
    VectorX values(mesh.vertex_slots());
    for (int v = 0; v < values.size(); ++v) values[v] = 1 + 2 * mesh.rest(v)[0] - 3 * mesh.rest(v)[1];
    return values;
  };
  own = exact(simulation.state().mesh);
  int changes = 0;
  simulation.on_mesh_change([&](const MeshChange<2>& change, const Mesh<2>& before) {
    ++changes;
    EXPECT_EQ(before.vertex_slots(), own.size());
    EXPECT_LT((project_fields(before, simulation.state().mesh, change, own) - exact(simulation.state().mesh)).norm(), 1e-12);
    own = change.interpolation * own;
  });
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(simulation.advance().ok);
  EXPECT_GT(changes, 0);
  ASSERT_EQ(own.size(), simulation.state().mesh.vertex_slots());
  EXPECT_LT((own - exact(simulation.state().mesh)).norm(), 1e-12);
}

template <int Dim>
VectorX some_forces(const Mesh<Dim>& mesh) {
  VectorX forces(Dim * mesh.vertex_slots());
  for (int i = 0; i < forces.size(); ++i) forces[i] = std::sin(1.0 + 3 * i);
  return forces;
}

TEST(HostForces, StayWhereTheyActHoweverTheMeshChanges) {
  auto simulation = simulate(pressed_block());
  const Mesh<2> mesh = simulation.state().mesh;
  const VectorX forces = some_forces(mesh);
  const auto term = point_forces<2>(mesh, forces);
  const auto totals = [&](const Mesh<2>& other) {
    const CellSet<2> cells = whole_mesh(other, {});
    VectorX gradient = VectorX::Zero(2 * other.vertex_slots());
    Workspace workspace;
    term(cells, 0, 1)->add_gradient(gradient, gradient, workspace);
    Vec<3> total = Vec<3>::Zero();
    for (int v = 0; v < other.vertex_slots(); ++v) {
      const Vec<2> f = -gradient.segment<2>(2 * v), X = other.rest(v);
      total += Vec<3>(f[0], f[1], X[0] * f[1] - X[1] * f[0]);
    }
    return total;
  };
  const Vec<3> before = totals(mesh);
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_NE(simulation.state().mesh.num_vertices(), mesh.num_vertices());
  EXPECT_LT((totals(simulation.state().mesh) - before).norm(), 1e-12);
  EXPECT_THROW(point_forces<2>(mesh, VectorX::Zero(3)), InputError);
}

TEST(HostForces, AreTheRateOfMomentum) {
  auto setup = block<3>();
  setup.body_acceleration = nullptr;
  const VectorX forces = some_forces(setup.mesh);
  setup.terms.push_back(point_forces<3>(setup.mesh, forces));
  auto simulation = simulate(setup);
  for (int i = 1; i <= 3; ++i) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok);
    const auto momentum = asked(simulation).momentum;
    const Vec<3> expected = i * setup.time.dt * sum<3>(forces);
    EXPECT_LT((Vec<3>(momentum.data()) - expected).norm(), 1e-10 * expected.norm());
    EXPECT_NE(result.report.energy.host, 0);
  }
}

/// Springs of stiffness k to the origin at each vertex.
class Springs final : public Energy {
 public:
  Springs(double k, double scale, int vertices) : k_(k * scale), vertices_(vertices) {}
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override { return 0.5 * k_ * x.head(2 * vertices_).squaredNorm(); }
  void add_gradient(ConstVectorView x, VectorView g, Workspace&) const override {
    g.head(2 * vertices_) += k_ * x.head(2 * vertices_);
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<2> block = k_ * Mat<2>::Identity();
    for (int v = 0; v < vertices_; ++v) sink.add<2>(std::array{v}, block.data());
  }

 private:
  double k_;
  int vertices_;
};

TEST(HostForces, OfPositionsBalanceAsTheirPotentialDoes) {
  static constexpr double k = 300;  // [N/m]
  VectorX expected;
  std::vector<int> iterations;
  for (int way = 0; way < 3; ++way) {
    auto setup = block<2>();
    if (way == 0)
      setup.terms.push_back([](const CellSet<2>& cells, double, double scale) {
        return std::make_shared<Springs>(k, scale, cells.num_vertices);
      });
    else
      setup.follower.forces = [](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f -= k * x; };
    if (way == 2)
      setup.follower.stiffness = [](const Mesh<2>& mesh, ConstVectorView, double, const StiffnessReceiver& add) {
        const Mat<2> block = k * Mat<2>::Identity();
        for (int v = 0; v < mesh.vertex_slots(); ++v) add(std::array{v}, block.data());
      };
    auto simulation = simulate(setup);
    int count = 0;
    for (int i = 0; i < 3; ++i) {
      const StepResult result = simulation.advance();
      ASSERT_TRUE(result.ok);
      count += result.report.newton_iterations;
    }
    iterations.push_back(count);
    if (way == 0) expected = simulation.state().history.x[0];
    EXPECT_LT((simulation.state().history.x[0] - expected).norm(), 1e-9) << "way " << way;
  }
  EXPECT_LT(iterations[2], iterations[1]);  // the Hessian saves rounds
}

/// A block between springs of so many N/m a vertex, whose forces are lagged: from about 8000 on rounds lead away.
Setup<2> between_springs(double k, bool with_stiffness = false) {
  auto setup = block<2>();
  setup.follower.forces = [k](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f -= k * x; };
  if (with_stiffness)
    setup.follower.stiffness = [k](const Mesh<2>& mesh, ConstVectorView, double, const StiffnessReceiver& add) {
      const Mat<2> block = k * Mat<2>::Identity();
      for (int v = 0; v < mesh.vertex_slots(); ++v) add(std::array{v}, block.data());
    };
  return setup;
}

StepResult step_of(const Setup<2>& setup, std::string* warnings = nullptr) {
  static linear::Registry registry;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             if (warnings && level == LogLevel::warning) *warnings += message;
                           }));
  return simulation.advance();
}

TEST(HostForces, ThatDoNotSettleFailTheStep) {
  const StepResult result = step_of(between_springs(11000));
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("loads do not settle: pressure or follower forces are"), std::string::npos) << result.reason;
  EXPECT_NE(result.reason.find("/solver/advanced/lagged_load_tolerance"), std::string::npos) << result.reason;
  EXPECT_EQ(result.reason.find("friction"), std::string::npos) << result.reason;  // there is none
  EXPECT_FALSE(step_of(between_springs(20000)).ok);                               // they move away
  EXPECT_TRUE(step_of(between_springs(11000, true)).ok);
}

TEST(HostForces, ThatHardlySettleAreWarnedOf) {
  std::string warnings;
  EXPECT_TRUE(step_of(between_springs(300), &warnings).ok);
  EXPECT_EQ(warnings, "");
  EXPECT_TRUE(step_of(between_springs(9000), &warnings).ok);
  EXPECT_NE(warnings.find("of themselves off those of the positions reached, not coming nearer after"), std::string::npos)
      << warnings;
  auto setup = between_springs(11000);
  setup.lagged_load_tolerance = 1;
  warnings.clear();
  EXPECT_TRUE(step_of(setup, &warnings).ok);
  EXPECT_NE(warnings.find("off those of the positions reached"), std::string::npos) << warnings;
}

TEST(HostForces, InACycleAreNoSolution) {
  // On the whole block, of its mass by the square of the time step: it goes there and back from round to round.
  auto setup = block<2>();
  setup.newton.step_tolerance = 1e-6;
  setup.follower.forces = [h = setup.time.dt](const Mesh<2>& mesh, ConstVectorView x, double, VectorView f) {
    Vec<2> moment = Vec<2>::Zero();  // mass times barycentre
    const auto for_each_share = [&](const auto& visit) {
      for (CellId c = 0; c < mesh.cell_slots(); ++c)
        for (const VertexId v : mesh.cell(c)) visit(v, kDensity * mesh.volume(c) / 3);
    };
    for_each_share([&](VertexId v, double mass) { moment += mass * (x.segment<2>(2 * v) - mesh.rest(v)); });
    const Vec<2> mean = moment / (kDensity * kSize * kSize);
    for_each_share([&](VertexId v, double mass) { f.segment<2>(2 * v) -= mass / (h * h) * mean; });
  };
  const StepResult result = step_of(setup);
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("in a cycle"), std::string::npos) << result.reason;
}

TEST(HostForces, LinearisedHaveTheirDerivatives) {
  const Mesh<2> mesh = make_block<2>();
  FollowerForces<2> follower;
  follower.forces = [](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f += x.array().sin().matrix(); };
  follower.stiffness = [](const Mesh<2>&, ConstVectorView, double, const StiffnessReceiver& add) {
    MatrixX block = MatrixX::Random(6, 6);
    add(std::array{2, 0, 5}, block.data());
  };
  VectorX x = VectorX::Random(2 * mesh.vertex_slots() + 4);  // two more vertices, of obstacles
  const auto energy = lag_follower<2>(follower, mesh, x, 0, 0.1);
  const VectorX y = x + VectorX::Random(x.size());
  expect_derivatives(*energy, y, 1e-6, 1e-7);
  expect_psd(*energy, y);
}

TEST(OwnTerms, ActInTrialsToo) {
  // Gravity as a term of the program's: the same meshes as by the library's own. Predictions know nothing of such terms, nor
  // of damping: with that, be it none, both ask edges in the same order.
  auto setup = pressed_block();
  setup.damping.push_back({.coefficient = 0});
  auto library = simulate(setup);
  setup.terms.push_back(
      [materials = setup.materials, g = setup.body_acceleration](const CellSet<2>& cells, double t, double scale) {
        return std::make_shared<LoadEnergy<2>>(cells, materials,
                                               Loads<2>{[g, t](const Vec<2>& X) { return g(X, t); }, {}, {}}, scale);
      });
  setup.body_acceleration = nullptr;
  auto own = simulate(setup);
  for (int i = 0; i < 5; ++i) {
    const StepResult a = library.advance(), b = own.advance();
    ASSERT_TRUE(a.ok && b.ok);
    EXPECT_EQ(a.report.splits.accepted, b.report.splits.accepted);
    EXPECT_EQ(a.report.collapses.tried, b.report.collapses.tried);
    ASSERT_EQ(a.report.vertices, b.report.vertices);
    EXPECT_NEAR(a.report.energy.total, b.report.energy.total, 1e-9 * std::abs(a.report.energy.total));
  }
  EXPECT_GT(own.state().mesh.num_vertices(), 16);
}

/// W = mu/2 (|F|^2 - d - 2 ln J) + lambda/2 (ln J)^2, as a program would bring it.
class OwnNeoHookean final : public OwnLaw {
 public:
  OwnNeoHookean(double mu, double lambda) : mu_(mu), lambda_(lambda) {}
  double density(const Eigen::Ref<const MatrixX>& F) const override {
    const double log_j = std::log(F.determinant());
    return mu_ / 2 * (F.squaredNorm() - double(F.rows()) - 2 * log_j) + lambda_ / 2 * log_j * log_j;
  }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override {
    const MatrixX T = F.inverse().transpose();
    P = mu_ * (F - T) + lambda_ * std::log(F.determinant()) * T;
  }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    const Eigen::Index d = F.rows();
    const MatrixX T = F.inverse().transpose();
    const double c = mu_ - lambda_ * std::log(F.determinant());
    for (Eigen::Index j = 0; j < d; ++j)
      for (Eigen::Index i = 0; i < d; ++i)
        for (Eigen::Index l = 0; l < d; ++l)
          for (Eigen::Index k = 0; k < d; ++k)
            H(d * j + i, d * l + k) = (i == k && j == l ? mu_ : 0) + c * T(k, j) * T(i, l) + lambda_ * T(i, j) * T(k, l);
  }

 private:
  double mu_, lambda_;
};

template <int Dim>
void expect_own_law_is_neo_hookean() {
  Material material{.youngs_modulus = 2e5, .poisson_ratio = 0.35};
  const ElasticModuli built_in = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
  material.law = MaterialLaw::own;
  material.own = std::make_shared<OwnNeoHookean>(built_in.lame.mu, built_in.lame.lambda);
  const ElasticModuli own = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
  const Mat<Dim> F = Mat<Dim>::Identity() + 0.2 * Mat<Dim>::Random();
  EXPECT_NEAR(elastic_density<Dim>(F, own), elastic_density<Dim>(F, built_in), 1e-8);
  EXPECT_LT((elastic_stress<Dim>(F, own) - elastic_stress<Dim>(F, built_in)).norm(), 1e-8);
  const auto hessian = [&](const ElasticModuli& moduli) {
    const auto system = elastic_eigensystem<Dim>(F, moduli);
    MatrixX H = MatrixX::Zero(Dim * Dim, Dim * Dim);
    for (int k = 0; k < Dim * Dim; ++k) {
      const Eigen::Map<const VectorX> mode(system.modes[k].data(), Dim * Dim);
      H += system.values[k] * mode * mode.transpose();
    }
    return H;
  };
  EXPECT_LT((hessian(own) - hessian(built_in)).norm(), 1e-8 * hessian(own).norm());
}

TEST(OwnMaterial, IsTheSameAsTheLibrarysWithTheSameDensity) {
  expect_own_law_is_neo_hookean<2>();
  expect_own_law_is_neo_hookean<3>();
  for (const bool remeshes : {false, true}) {  // which decides by the last bits here and there
    auto setup = pressed_block();
    setup.remesh.enabled = remeshes;
    auto library = simulate(setup);
    Material& material = setup.materials[1];
    material.law = MaterialLaw::own;
    material.own = std::make_shared<OwnNeoHookean>(material.lame_mu(), material.lame_lambda(2));
    auto own = simulate(setup);
    for (int i = 0; i < 4; ++i) {
      const StepResult a = library.advance(), b = own.advance();
      ASSERT_TRUE(a.ok && b.ok);
      EXPECT_EQ(b.report.vertices > 16, remeshes);
      EXPECT_NEAR(a.report.energy.total, b.report.energy.total, (remeshes ? 1e-3 : 1e-8) * std::abs(a.report.energy.total));
    }
  }
}

template <int Dim>
void expect_resultants() {
  Setup<Dim> setup = sliding_block<Dim>(1);
  setup.fields.applied_forces = true;
  setup.newton.step_tolerance = 0;  // forces are as exact as the gradient is small
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-14;
  setup.neumann.push_back({2, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Constant(40)); }});
  setup.pressure.push_back({3, [](const Vec<Dim>&, double) { return 30.0; }});
  setup.dirichlet.push_back({1, {true}, [](const Vec<Dim>&, double t) { return Vec<Dim>(2 * t * Vec<Dim>::Unit(0)); }});
  auto simulation = simulate(setup);
  Vec<Dim> before = Vec<Dim>::Zero();
  for (int i = 0; i < 4; ++i) {
    if (i > 0) before = Vec<Dim>(asked(simulation).momentum.data());
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    if (i == 0) continue;
    const Resultant<Dim> all = resultant<Dim>(simulation, std::array{1, 2, 3}, Vec<Dim>::Zero());
    const Vec<Dim> gain = Vec<Dim>(asked(simulation).momentum.data()) - before;
    const Vec<Dim> force = all.force - weight<Dim>() * Vec<Dim>::Unit(1);
    EXPECT_LT((setup.time.dt * force - gain).norm(), 1e-10 * weight<Dim>() * setup.time.dt) << "step " << i;
    EXPECT_GT(all.force.norm(), 1);
  }
  auto unasked = simulate(block<Dim>());
  EXPECT_THROW(resultant<Dim>(unasked, std::array{1}, Vec<Dim>::Zero()), InputError);
}

TEST(Resultants, AreTheRateOfMomentum) {
  expect_resultants<2>();
  expect_resultants<3>();
}

TEST(Resultants, HaveTheMomentOfTheForces) {
  auto setup = block<2>();
  setup.fields.applied_forces = true;
  setup.body_acceleration = nullptr;
  setup.dirichlet.push_back({1, {true, true}, [](const Vec<2>&, double) { return Vec<2>::Zero().eval(); }});
  setup.neumann.push_back({2, [](const Vec<2>&, double) { return Vec<2>(0, -10); }});
  setup.time.quasistatic = true;
  auto simulation = simulate(setup);
  ASSERT_TRUE(simulation.advance().ok);
  const auto held = resultant<2>(simulation, std::array{1}, Vec<2>(0, 0));
  const auto all = resultant<2>(simulation, std::array{1, 2, 3}, Vec<2>(0, 0));
  EXPECT_LT(all.force.norm(), 1e-8);  // in balance, moments too
  EXPECT_LT(all.moment.norm(), 1e-8);
  EXPECT_NEAR(held.force[0], 0, 1e-8);
  EXPECT_GT(held.moment[0], 0.1);  // left end holds what hangs right of it
}

TEST(Locator, FindsPointsAndVertices) {
  const Mesh<3> mesh = make_block<3>();
  const Locator<3> locator(mesh);
  for (int v = 0; v < mesh.vertex_slots(); ++v) {
    const auto place = locator.find(mesh.rest(v));
    for (int k = 0; k <= 3; ++k) EXPECT_EQ(place.weights[k], place.vertices[k] == v ? 1 : 0);
  }
  const Vec<3> X(0.07, 0.11, 0.03);
  const auto place = locator.find(X);
  Vec<3> there = Vec<3>::Zero();
  for (int k = 0; k <= 3; ++k) there += place.weights[k] * mesh.rest(place.vertices[k]);
  EXPECT_LT((there - X).norm(), 1e-15);
  EXPECT_EQ(locator.find(X, 7).cell, kNone);  // no such body
  VectorX values(8);
  for (int v = 0; v < 8; ++v) values[v] = mesh.rest(v)[1];
  EXPECT_NEAR(nodal_function<3>(std::make_shared<Locator<3>>(mesh), values)(X)[0], 0.11, 1e-15);
}

}  // namespace
}  // namespace itr
