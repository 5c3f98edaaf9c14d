// SPDX-License-Identifier: MIT
// Forces, stresses, kinetic energy and momentum that observers ask for, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "advance.hpp"
#include "energy/pressure.hpp"
#include "host_block.hpp"
#include "itr/core.hpp"
#include "simulation/contact_pressure.hpp"
#include "simulation/resultant.hpp"

namespace itr {
namespace {

template <int Dim>
AskedFields after_one_step(const Setup<Dim>& setup) {
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  advance(simulation);
  return asked(simulation);
}

/// Held sideways only, so that the table alone carries it.
template <int Dim>
void expect_table_carries_weight() {
  Setup<Dim> setup = block<Dim>();
  add_table(setup);
  setup.time.quasistatic = true;
  DirichletCondition<Dim> guide{1, {}, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }};
  guide.components.fill(true);
  guide.components[1] = false;
  setup.dirichlet = {guide};
  const AskedFields fields = after_one_step(setup);
  EXPECT_NEAR(sum<Dim>(fields.forces.contact)[1], weight<Dim>(), 1e-7 * weight<Dim>());
  EXPECT_NEAR(sum<Dim>(fields.forces.reaction)[1], 0, 1e-9);
  EXPECT_NEAR((sum<Dim>(fields.forces.contact) + sum<Dim>(fields.forces.reaction))[0], 0, 1e-6);
  EXPECT_EQ(fields.forces.friction.norm(), 0);
}

TEST(Forces, TableCarriesTheWeightOfABlock2D) { expect_table_carries_weight<2>(); }
TEST(Forces, TableCarriesTheWeightOfABlock3D) { expect_table_carries_weight<3>(); }

template <int Dim>
Setup<Dim> hanging_block() {
  Setup<Dim> setup = block<Dim>();
  DirichletCondition<Dim> hook{2, {}, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }};
  hook.components.fill(true);
  setup.dirichlet = {hook};
  return setup;
}

template <int Dim>
void expect_support_carries_weight() {
  Setup<Dim> setup = hanging_block<Dim>();
  setup.time.quasistatic = true;
  setup.fields.contact_forces = setup.fields.friction_forces = false;
  const AskedFields fields = after_one_step(setup);
  EXPECT_LT((sum<Dim>(fields.forces.reaction) - weight<Dim>() * Vec<Dim>::Unit(1)).norm(), 1e-8 * weight<Dim>());
  EXPECT_EQ(fields.forces.contact.size(), 0);
  for (int v = 0; v < setup.mesh.node_slots(); ++v)
    if (setup.mesh.rest(v)[1] < kSize - 1e-9) {
      EXPECT_EQ((fields.forces.reaction.segment<Dim>(Dim * v).norm()), 0) << v;
    }
}

TEST(Forces, SupportCarriesTheWeightOfAHangingBlock2D) { expect_support_carries_weight<2>(); }
TEST(Forces, SupportCarriesTheWeightOfAHangingBlock3D) { expect_support_carries_weight<3>(); }

/// A block that slides: friction is mu times the normal force, against the motion, and all forces change the momentum.
template <int Dim>
void expect_coulomb() {
  Setup<Dim> setup = sliding_block<Dim>(30);
  setup.contact.friction_tolerance = 1e-9;
  const double mu = setup.contact.friction_coefficient;
  // In space the block widens as it lands, so that vertices slip a little sideways too: at an angle below 0.02.
  constexpr double kDeviation = Dim == 3 ? 0.02 * 0.02 / 2 : 0;
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  Vec<Dim> momentum = Eigen::Map<const Vec<Dim>>(asked(simulation).momentum.data());
  EXPECT_NEAR(momentum[0], 2 * weight<Dim>() / kGravity, 1e-12 * weight<Dim>());
  for (int step = 1; step <= 10; ++step) {
    const StepResult result = advance(simulation);
    const AskedFields fields = asked(simulation);
    const Vec<Dim> normal = sum<Dim>(fields.forces.contact), friction = sum<Dim>(fields.forces.friction);
    EXPECT_LE(-friction[0], mu * normal[1] + 1e-6 * weight<Dim>()) << step;
    EXPECT_GE(-friction[0], (1 - kDeviation) * mu * normal[1] - 1e-6 * weight<Dim>()) << step;
    const Vec<Dim> next = Eigen::Map<const Vec<Dim>>(fields.momentum.data());
    const Vec<Dim> change = (next - momentum) / setup.time.dt;
    EXPECT_LT((change - (normal + friction - weight<Dim>() * Vec<Dim>::Unit(1))).norm(), 1e-5 * weight<Dim>()) << step;
    momentum = next;
  }
}

TEST(Forces, SlidingFrictionIsCoulombs2D) { expect_coulomb<2>(); }
TEST(Forces, SlidingFrictionIsCoulombs3D) { expect_coulomb<3>(); }

/// The forces of one step, as they were in its solve, are what changes the momentum; `loads` are those nobody reports.
template <int Dim>
void expect_forces_change_momentum(const Setup<Dim>& setup, const std::function<Vec<Dim>(const VectorX& x)>& loads) {
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  const Vec<Dim> before = Eigen::Map<const Vec<Dim>>(asked(simulation).momentum.data());
  const StepResult result = advance(simulation);
  const AskedFields fields = asked(simulation);
  const Vec<Dim> change = (Eigen::Map<const Vec<Dim>>(fields.momentum.data()) - before) / setup.time.dt;
  Vec<Dim> forces = loads(simulation.state().history.x[0]) - weight<Dim>() * Vec<Dim>::Unit(1);
  for (const VectorX& field : {fields.forces.contact, fields.forces.friction, fields.forces.reaction})
    forces += sum<Dim>(field);
  EXPECT_LT((change - forces).norm(), 1e-6 * weight<Dim>()) << change.transpose() << " not " << forces.transpose();
}

template <int Dim>
Vec<Dim> no_loads(const VectorX&) {
  return Vec<Dim>::Zero();
}

TEST(Forces, OfOneRoundOfFrictionAreThoseOfTheSolve) {
  expect_forces_change_momentum<2>(sliding_block<2>(1), no_loads<2>);
  expect_forces_change_momentum<3>(sliding_block<3>(1), no_loads<3>);
}

TEST(Forces, OfASupportBalanceDamping) {
  auto setup = hanging_block<2>();
  setup.damping.push_back({.term = DampingOptions::Term::elastic, .coefficient = 0.02});
  expect_forces_change_momentum<2>(setup, no_loads<2>);
}

/// A block that lands on a table while contact is damped: bodies and table exert on each other what changes the momentum.
template <int Dim>
void expect_damped_contact_in_forces() {
  Setup<Dim> setup = block<Dim>();
  add_table(setup);
  setup.damping.push_back({.term = DampingOptions::Term::contact, .coefficient = 0.02, .lagging_rounds = 3});
  setup.initial_velocity.push_back({1, [](const Vec<Dim>&, double) { return Vec<Dim>(-Vec<Dim>::Unit(1)); }});
  auto simulation = simulate(setup);
  double damped = 0;
  for (int step = 0; step < 5; ++step) {
    const Vec<Dim> before(asked(simulation).momentum.data());
    const StepResult result = advance(simulation);
    damped = std::max(damped, result.report.energy.damping);
    const AskedFields fields = asked(simulation);
    const Vec<Dim> change = (Vec<Dim>(fields.momentum.data()) - before) / setup.time.dt;
    const Vec<Dim> contact = sum<Dim>(fields.forces.contact);
    EXPECT_LT((change + weight<Dim>() * Vec<Dim>::Unit(1) - contact).norm(), 1e-7 * weight<Dim>()) << step;
    EXPECT_LT((sum<Dim>(result.forces.obstacle_contact) + contact).norm(), 1e-10 * (1 + contact.norm())) << step;
  }
  EXPECT_GT(damped, 1e-3 * weight<Dim>() * kSize);
}

TEST(Forces, OfContactHaveItsDamping) {
  expect_damped_contact_in_forces<2>();
  expect_damped_contact_in_forces<3>();
}

TEST(Forces, OfASupportBalancePressure) {
  auto setup = hanging_block<2>();
  constexpr double p = 3000;
  setup.pressure.push_back({1, [](const Vec<2>&, double) { return p; }});
  int corner = kNone;
  for (int v = 0; v < setup.mesh.node_slots(); ++v)
    if (setup.mesh.rest(v).norm() < 1e-12) corner = v;
  expect_forces_change_momentum<2>(setup, [corner](const VectorX& x) {  // normals of the left side sum to its ends' distance
    const Vec<2> down = x.segment<2>(2 * corner) - Vec<2>(0, kSize);
    return Vec<2>(-p * down[1], p * down[0]);
  });
}

/// Neo-Hookean, stretched along one axis: sigma = (mu (F F^T - I) + lambda ln J I) / J.
template <int Dim>
void expect_stress_of_stretch(bool plane_strain) {
  constexpr double stretch = 1.2;
  Setup<Dim> setup = block<Dim>();
  setup.materials[1].plane_strain = plane_strain;
  setup.fields.pressure = setup.fields.stretches = true;
  setup.initial_displacement.push_back(
      {1, [](const Vec<Dim>& X, double) { return Vec<Dim>((stretch - 1) * X[0] * Vec<Dim>::Unit(0)); }});
  linear::Registry registry;
  const AskedFields fields = asked(Simulation<Dim>(setup, registry));
  const double mu = setup.materials[1].lame_mu(), lambda = setup.materials[1].lame_lambda(Dim);
  const double along = (mu * (stretch * stretch - 1) + lambda * std::log(stretch)) / stretch;
  const double across = lambda * std::log(stretch) / stretch, out = Dim == 3 || plane_strain ? across : 0;
  const double von_mises =
      std::sqrt(0.5 * (std::pow(along - across, 2) + std::pow(across - out, 2) + std::pow(out - along, 2)));
  ASSERT_EQ(fields.von_mises.size(), static_cast<std::size_t>(setup.mesh.num_cells()));
  ASSERT_EQ(fields.stress.size(), Dim * Dim * fields.von_mises.size());
  for (std::size_t c = 0; c < fields.von_mises.size(); ++c) {
    EXPECT_NEAR(fields.von_mises[c], von_mises, 1e-9 * along);
    EXPECT_NEAR(fields.pressure.at(c), -(along + across + out) / 3, 1e-9 * along);
    EXPECT_NEAR(fields.stretches.at(3 * c), stretch, 1e-12);
    EXPECT_NEAR(fields.stretches.at(3 * c + 1), 1, 1e-12);
    if (Dim == 3 || plane_strain)
      EXPECT_NEAR(fields.stretches.at(3 * c + 2), 1, 1e-12);
    else
      EXPECT_TRUE(std::isnan(fields.stretches.at(3 * c + 2)));  // of a law that does not know the thickness
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < Dim; ++j)
        EXPECT_NEAR(fields.stress[Dim * Dim * c + Dim * i + j], i != j ? 0 : i == 0 ? along : across, 1e-9 * along);
  }
}

TEST(Stress, OfAStretchInPlaneStress) { expect_stress_of_stretch<2>(false); }
TEST(Stress, OfAStretchInPlaneStrain) { expect_stress_of_stretch<2>(true); }
TEST(Stress, OfAStretchInSpace) { expect_stress_of_stretch<3>(false); }

/// A body that is pressed by p at its bottom: all vertices there have it, also at the rim, and others nothing.
template <int Dim>
void expect_uniform_contact_pressure(bool is_curved, bool is_turned) {
  constexpr double p = 700;
  Mesh<Dim> mesh = block<Dim>().mesh;
  if (is_curved) mesh.set_curved_edges(mesh.edges());
  if constexpr (Dim == 2) mesh.set_axisymmetric(is_turned);
  VectorX x(Dim * mesh.num_nodes());
  for (int v = 0; v < mesh.num_nodes(); ++v) {
    x.segment<Dim>(Dim * v) = mesh.point_of_node(v);
    x[Dim * v] *= 1.1;  // the present area counts
  }
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    const auto& facet = mesh.facet(f);
    mesh.set_facet_tag(f, std::ranges::all_of(facet, [&](VertexId v) { return mesh.rest(v)[1] < 1e-9; }) ? 7 : 8);
  }
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  Loads<Dim> loads;
  loads.pressures = {{7, [](const RestPoint<Dim>&) { return p; }}};
  VectorX force = VectorX::Zero(x.size());
  Workspace workspace;
  PressureEnergy<Dim>(cells, loads, x, 1).add_gradient(x, force, workspace);
  const VectorX found = contact_pressure(mesh, x, VectorX(-force));
  for (int v = 0; v < mesh.num_nodes(); ++v) {
    const bool is_inner = v < mesh.num_vertices();
    const bool is_at_bottom = mesh.point_of_node(v)[1] < 1e-9;
    if (is_inner || is_at_bottom) EXPECT_NEAR(found[v], is_at_bottom ? p : 0, 1e-9 * p) << v;
  }
}

TEST(ContactPressure, IsThatOfUniformPressure) {
  expect_uniform_contact_pressure<2>(false, false);
  expect_uniform_contact_pressure<2>(true, false);
  expect_uniform_contact_pressure<3>(false, false);
  expect_uniform_contact_pressure<3>(true, false);
  expect_uniform_contact_pressure<2>(false, true);
}

TEST(Totals, OfARotatingBlock) {
  auto setup = block<2>();
  setup.initial_velocity.push_back({1, [](const Vec<2>& X, double) { return Vec<2>(1 - X[1], X[0]); }});
  linear::Registry registry;
  const AskedFields fields = asked(Simulation<2>(setup, registry));
  const double mass = kDensity * kSize * kSize, inertia = mass * kSize * kSize / 6, half = kSize / 2;
  const Vec<2> v(1 - half, half);  // of the centre of mass
  EXPECT_NEAR(fields.kinetic_energy.at(0), 0.5 * mass * v.squaredNorm() + 0.5 * inertia, 1e-12 * mass);
  EXPECT_NEAR(fields.momentum.at(0), mass * v[0], 1e-12 * mass);
  EXPECT_NEAR(fields.momentum.at(1), mass * v[1], 1e-12 * mass);
}

TEST(Fields, ThatNobodyAsksForAreNotThere) {
  auto setup = block<2>();
  setup.fields = {};
  const AskedFields fields = after_one_step(setup);
  EXPECT_EQ(fields.forces.contact.size() + fields.forces.friction.size() + fields.forces.reaction.size(), 0);
  EXPECT_TRUE(fields.von_mises.empty() && fields.stress.empty() && fields.kinetic_energy.empty() && fields.momentum.empty());
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
    const StepResult result = advance(simulation);
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

TEST(Resultants, RefuseWhatNothingHas) {
  auto setup = block<2>();
  add_table(setup);
  setup.fields.applied_forces = true;
  auto simulation = simulate(setup);
  advance(simulation);
  EXPECT_NO_THROW(resultant<2>(simulation, std::array{1, 3}, Vec<2>::Zero()));
  EXPECT_THROW(resultant<2>(simulation, std::array{1, 77}, Vec<2>::Zero()), InputError);
  EXPECT_THROW(resultant<2>(simulation, {}, Vec<2>::Zero()), InputError);
  const auto refused = [&](const ForceTarget& target) {
    EXPECT_THROW(force_sums(simulation.state(), simulation.forces(), target), InputError);
    auto with_curve = setup;
    with_curve.fields.curves = {target};
    EXPECT_THROW(simulate(with_curve), InputError);
  };
  refused({.name = "none"});
  refused({.name = "surface", .surfaces = {77}});
  refused({.name = "body", .bodies = {1, 2}});
  refused({.name = "obstacle", .obstacle_vertices = {0, 2}});
  refused({.name = "obstacle", .obstacle_vertices = {-1}});
}

TEST(Resultants, HaveTheMomentOfTheForces) {
  auto setup = block<2>();
  setup.fields.applied_forces = true;
  setup.body_acceleration = nullptr;
  setup.dirichlet.push_back({1, {true, true}, [](const Vec<2>&, double) { return Vec<2>::Zero().eval(); }});
  setup.neumann.push_back({2, [](const Vec<2>&, double) { return Vec<2>(0, -10); }});
  setup.time.quasistatic = true;
  auto simulation = simulate(setup);
  advance(simulation);
  const auto held = resultant<2>(simulation, std::array{1}, Vec<2>(0, 0));
  const auto all = resultant<2>(simulation, std::array{1, 2, 3}, Vec<2>(0, 0));
  EXPECT_LT(all.force.norm(), 1e-8);  // in balance, moments too
  EXPECT_LT(all.moment.norm(), 1e-8);
  EXPECT_NEAR(held.force[0], 0, 1e-8);
  EXPECT_GT(held.moment[0], 0.1);  // left end holds what hangs right of it
}

}  // namespace
}  // namespace itr
