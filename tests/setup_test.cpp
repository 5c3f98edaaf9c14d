// SPDX-License-Identifier: MIT
// Setups that a program fills in by hand: wrong ones are refused with the place, defaults are chosen and said, and a solve
// can be cancelled.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "apps/itr/advice.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "simulation/step_problem.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

/// A square above a line.
Setup<2> good_setup() {
  Setup<2> setup;
  const Grid grid = make_regular_grid(3, 0.2, [](int, int) { return true; });
  setup.mesh = Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
  setup.time = {.dt = 0.01, .steps = 10};
  setup.obstacles.rest = {{-1, -0.01}, {1, -0.01}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact.enabled = true;
  return setup;
}

struct Mistake {
  const char* name;
  std::function<void(Setup<2>&)> make;
  std::string place, found, expected;
};

const std::vector<Mistake> kMistakes = {
    {"no mesh", [](auto& s) { s.mesh = Mesh<2>(); }, "mesh", "no cells", "at least one"},
    {"no material", [](auto& s) { s.materials.clear(); }, "/materials", "no material with the id 1", "every body"},
    {"nu of 0.7", [](auto& s) { s.materials[1].poisson_ratio = 0.7; }, "/materials (id 1)/nu", "0.7", "(-1, 0.5)"},
    {"no density", [](auto& s) { s.materials[1].density = 0; }, "/materials (id 1)/rho", "0", "> 0"},
    {"nan for E", [](auto& s) { s.materials[1].youngs_modulus = std::nan(""); }, "/materials (id 1)/E", "nan", "> 0"},
    {"dt of 0", [](auto& s) { s.time.dt = 0; }, "/time/dt", "0", "> 0"},
    {"no steps", [](auto& s) { s.time.steps = 0; }, "/time/time_steps", "0", ">= 1"},
    {"BDF7", [](auto& s) { s.time.bdf_order = 7; }, "/time/integrator/steps", "7", "1 to 6"},
    {"d-hat of -1", [](auto& s) { s.contact.dhat = -1; }, "/contact/dhat", "-1", ">= 0"},
    {"negative friction", [](auto& s) { s.contact.friction_coefficient = -1; }, "/contact/friction_coefficient", "-1",
     ">= 0"},
    {"motion out of range", [](auto& s) { s.obstacles.motion[1] = 3; }, "obstacles.motion[1]", "3", "kNone"},
    {"no motions", [](auto& s) { s.obstacles.motion.clear(); }, "obstacles.motion", "0 entries", "2, one a vertex"},
    {"edge out of range",
     [](auto& s) {
       s.obstacles.edges[0] = {0, 2};
     },
     "obstacles.edges[0]", "vertex 2", "0 to 2 - 1"},
    {"infinite obstacle", [](auto& s) { s.obstacles.rest[0][1] = std::numeric_limits<double>::infinity(); },
     "obstacles.rest[0]", "not finite", "numbers"},
    {"no function",
     [](auto& s) {
       s.dirichlet.push_back({1, {true, true}, {}});
     },
     "dirichlet[0]", "no function", "time"},
    {"no iterations", [](auto& s) { s.newton.max_iterations = 0; }, "/solver/nonlinear/max_iterations", "0", ">= 1"},
    {"split tolerance of 0", [](auto& s) { s.remesh.enabled = true, s.remesh.split.acceptance_tolerance = 0; },
     "/space/remesh/split/acceptance_tolerance", "0", "> 0"},
    {"nan for the swaps' tolerance",
     [](auto& s) { s.remesh.enabled = true, s.remesh.swap.acceptance_tolerance = std::nan(""); },
     "/space/remesh/swap/acceptance_tolerance", "nan", "a number"},
    {"negative split tolerance", [](auto& s) { s.remesh.enabled = true, s.remesh.split.acceptance_tolerance = -1; },
     "/space/remesh/split/acceptance_tolerance", "-1", "> 0"},
    {"damping", [](auto& s) { s.damping.push_back({.coefficient = -1}); }, "damping[0].coefficient", "-1", ">= 0"},
};

std::ostream& operator<<(std::ostream& out, const Mistake& mistake) { return out << mistake.name; }

class Mistakes : public ::testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, AreRefusedWithPlaceFoundAndExpected) {
  const Mistake& mistake = GetParam();
  itr::Setup<2> setup = good_setup();
  ASSERT_NO_THROW(setup.validate());
  mistake.make(setup);
  linear::Registry registry;
  try {
    const Simulation<2> simulation(setup, registry);
    FAIL() << "was simulated";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, mistake.place);
    EXPECT_NE(error.parts().found.find(mistake.found), std::string::npos) << error.what();
    EXPECT_NE(error.parts().expected.find(mistake.expected), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(All, Mistakes, ::testing::ValuesIn(kMistakes), [](const auto& info) {
  std::string name = info.param.name;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
});

TEST(SetupDefaults, StiffnessIsFromTheModulusWithRemeshingAndWithout) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.contact.convergent = true;
  EXPECT_FALSE(Simulation<2>(setup, registry).setup().contact.adaptive_stiffness);
  EXPECT_DOUBLE_EQ(Simulation<2>(setup, registry).setup().contact.barrier_stiffness, 1e3);
  setup.contact.adaptive_stiffness = true;
  EXPECT_TRUE(Simulation<2>(setup, registry).setup().contact.adaptive_stiffness);
  setup.contact.adaptive_stiffness = false;

  setup.remesh.enabled = true;
  std::vector<std::string> said;
  const Logger logger([&](LogLevel, std::string_view text) { said.emplace_back(text); });
  const Simulation<2> simulation(setup, registry, logger);
  const auto& chosen = simulation.setup();
  EXPECT_FALSE(chosen.contact.adaptive_stiffness);
  EXPECT_DOUBLE_EQ(chosen.contact.barrier_stiffness, 1e3);
  // 1 % of E V, times 1e-5: the most that what follows the stored energy may be.
  EXPECT_TRUE(chosen.follows_stored_energy.split && chosen.follows_stored_energy.collapse);
  EXPECT_DOUBLE_EQ(*chosen.remesh.split.acceptance_tolerance, 1e-7 * 1e4 * 0.04);
  EXPECT_DOUBLE_EQ(*chosen.remesh.collapse.acceptance_tolerance, -0.01 * *chosen.remesh.split.acceptance_tolerance);
  ASSERT_EQ(said.size(), 2u);
  EXPECT_NE(said[0].find("barrier stiffness 1e+03"), std::string::npos) << said[0];
  EXPECT_NE(said[1].find("of the energy that is stored so far, at most 4e-05 J"), std::string::npos) << said[1];

  setup.contact.convergent = false;  // the same pressure at the same gap
  const double area = 0.8 / 12;      // of a vertex on the boundary
  EXPECT_NEAR(Simulation<2>(setup, registry).setup().contact.barrier_stiffness, 1e3 * area / (2 * 1e-9), 1e-3);
}

TEST(SetupDefaults, ToleranceIsOfTheEnergyThatTheSceneHas) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.remesh.enabled = true;
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -0.01); }});
  const double kinetic = 0.5 * 1000 * 0.04 * 1e-4;
  EXPECT_NEAR(*Simulation<2>(setup, registry).setup().remesh.split.acceptance_tolerance, 1e-4 * kinetic, 1e-15);
  setup.remesh.split.acceptance_tolerance = 0.5;
  EXPECT_EQ(*Simulation<2>(setup, registry).setup().remesh.split.acceptance_tolerance, 0.5);
}

/// One rule for what is left open, whoever chose the split tolerance; what is given stays, whatever it is.
TEST(SetupDefaults, TolerancesLeftOpenFollowTheSplits) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.remesh.enabled = true;
  for (const std::optional<double> split : {std::optional<double>(), std::optional(0.5), std::optional(1e-9)}) {
    setup.remesh.split.acceptance_tolerance = split;
    const RemeshOptions chosen = Simulation<2>(setup, registry).setup().remesh;
    const double delta = chosen.split.acceptance_tolerance.value();
    EXPECT_EQ(delta, split.value_or(delta));
    EXPECT_DOUBLE_EQ(chosen.collapse.acceptance_tolerance.value(), -0.01 * delta);
    EXPECT_DOUBLE_EQ(chosen.swap.acceptance_tolerance.value(), -1e-6 * delta);
    EXPECT_DOUBLE_EQ(chosen.smooth.acceptance_tolerance.value(), -1e-6 * delta);
    EXPECT_DOUBLE_EQ(chosen.split.min_edge_length.value(), 1e-6 * std::sqrt(0.08));
  }
  setup.remesh.split.acceptance_tolerance = std::nullopt;
  setup.remesh.collapse.acceptance_tolerance = setup.remesh.swap.acceptance_tolerance = -1e-8;
  setup.remesh.smooth.acceptance_tolerance = 0;
  setup.remesh.split.min_edge_length = 0;
  const RemeshOptions chosen = Simulation<2>(setup, registry).setup().remesh;
  EXPECT_EQ(*chosen.collapse.acceptance_tolerance, -1e-8);
  EXPECT_EQ(*chosen.swap.acceptance_tolerance, -1e-8);
  EXPECT_EQ(*chosen.smooth.acceptance_tolerance, 0);
  EXPECT_EQ(*chosen.split.min_edge_length, 0);
}

/// Chosen values are checked as given ones are: here a tolerance that underflows.
TEST(SetupDefaults, AreValidated) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.remesh.enabled = true;
  setup.remesh.relative_tolerance = 1e-323;
  setup.materials.at(1).youngs_modulus = 1e-10;
  try {
    const Simulation<2> simulation(setup, registry);
    FAIL() << "began with a tolerance of 0 J";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "/space/remesh/split/acceptance_tolerance");
  }
}

/// With chosen defaults alone, a drop with remeshing goes to its end and splits.
TEST(SetupDefaults, RunADropWithRemeshing) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.remesh.enabled = true;
  setup.contact.convergent = true;
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -1); }});
  setup.time.steps = 20;
  Simulation<2> simulation(setup, registry);
  int splits = 0;
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    splits += result.report.splits.accepted;
  }
  EXPECT_GT(splits, 0);
  EXPECT_LT(simulation.state().mesh.num_vertices(), 2000);
}

TEST(Cancelling, DropsTheStepAndChangesNothing) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.remesh.enabled = true;
  setup.contact.convergent = true;
  setup.time.step_cuts = 3;  // a cancelled step is not cut
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -2); }});
  Simulation<2> whole(setup, registry);
  std::atomic<bool> cancel = false;
  setup.newton.cancel = &cancel;
  Simulation<2> disturbed(setup, registry);
  for (int step = 0; step < 5; ++step) {
    cancel = true;
    const StepResult result = disturbed.advance();
    ASSERT_FALSE(result.ok);
    EXPECT_NE(result.reason.find("cancelled"), std::string::npos) << result.reason;
    EXPECT_EQ(result.report.cut_steps, 0);
    EXPECT_EQ(disturbed.state().step, step);
    cancel = false;
    ASSERT_TRUE(disturbed.advance().ok);
    ASSERT_TRUE(whole.advance().ok);
    ASSERT_EQ(disturbed.state().history.x[0], whole.state().history.x[0]);
  }
}

TEST(Advice, SaysWhatWillHappenAndWhatLooksWrong) {
  linear::Registry registry;
  itr::Setup<2> setup = good_setup();
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, 9.81); };
  const auto words = cli::foretell(setup);
  const auto has = [](const std::vector<std::string>& list, const std::string& text) {
    return std::any_of(list.begin(), list.end(), [&](const auto& line) { return line.find(text) != line.npos; });
  };
  EXPECT_TRUE(has(words, "bodies accelerate by (0, +9.81) m/s^2"));
  EXPECT_TRUE(has(words, "plane stress"));
  EXPECT_TRUE(has(words, "total mass 40 kg, weight 392.4 N"));
  // c = sqrt((lambda + 2 mu) / rho), of plane stress
  const double c = std::sqrt((1e4 * 0.4 / (1 - 0.16) + 1e4 / 1.4) / 1000);
  EXPECT_TRUE(has(words, "waves run at up to " + std::to_string(c).substr(0, 4)));
  EXPECT_TRUE(has(cli::find_suspicious(Simulation<2>(setup, registry)), "rhs pushes in the negative direction"));
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
  EXPECT_TRUE(cli::find_suspicious(Simulation<2>(setup, registry)).empty());
  const ContactOptions contact = setup.contact;
  setup.contact.enabled = setup.contact.convergent = true;
  for (const auto& [stiffness, is_odd] : {std::pair(1e3, false), std::pair(1e6, true), std::pair(1e1, true)}) {
    setup.contact.barrier_stiffness = stiffness;  // `auto` takes E / 10
    EXPECT_EQ(has(cli::find_suspicious(Simulation<2>(setup, registry)), "barrier stiffness"), is_odd) << stiffness;
  }
  setup.contact = contact;
  setup.materials[1].density = 1.1;
  EXPECT_TRUE(has(cli::find_suspicious(Simulation<2>(setup, registry)), "are densities in kg/m^3?"));
  setup.time.quasistatic = true;
  EXPECT_TRUE(has(cli::find_suspicious(Simulation<2>(setup, registry)), "only contact can keep them in place"));
}

/// Sentences of find_suspicious that have these words.
int count_words(const itr::Setup<2>& setup, const std::string& words) {
  linear::Registry registry;
  int count = 0;
  for (const std::string& line : cli::find_suspicious(Simulation<2>(setup, registry)))
    count += line.find(words) != line.npos;
  return count;
}

DirichletCondition<2> held(int tag, std::array<bool, 2> components, SpaceTimeFunction<2> displacement) {
  return {tag, components, std::move(displacement)};
}
SpaceTimeFunction<2> constant(double x, double y) {
  return [=](const Vec<2>&, double) { return Vec<2>(x, y); };
}

TEST(Advice, NamesHeldCornersThatContradictEachOther) {
  itr::Setup<2> setup = good_setup();
  tag_sides(setup.mesh, 0.2);
  setup.time.quasistatic = true;
  const std::string words = "contradict each other";
  setup.dirichlet = {held(1, {true, true}, constant(0, 0)), held(3, {true, true}, constant(0.1, 0))};
  EXPECT_EQ(count_words(setup, words), 0) << "opposite sides";
  setup.dirichlet = {held(1, {true, true}, constant(0, 0)), held(2, {true, true}, constant(0, 0)),
                     held(4, {true, false}, constant(0, 7))};
  EXPECT_EQ(count_words(setup, words), 0) << "the same, or of another component";
  setup.dirichlet.push_back(held(3, {true, true}, constant(0.01, 0)));
  EXPECT_EQ(count_words(setup,
                        "ids 2 and 3 contradict each other at 1 vertices that both hold, by up to 0.01 m at (0.2, 0): "
                        "that of 3 counts"),
            1);
  EXPECT_EQ(count_words(setup, "ids 3 and 4 contradict each other at 1 vertices"), 1);
  EXPECT_EQ(count_words(setup, words), 2);
  const HeldDofs<2> taken = held_dofs(setup, setup.mesh, 0.01);
  for (VertexId v = 0; v < setup.mesh.num_vertices(); ++v)
    if (setup.mesh.rest(v) == Vec<2>(0.2, 0)) {
      EXPECT_EQ(taken.target[2 * v], 0.2 + 0.01);
    }
  // One that moves away from the other later only.
  setup.dirichlet = {held(1, {true, true}, constant(0, 0)),
                     held(2, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(t > 0.055 ? t : 0, 0); })};
  EXPECT_EQ(count_words(setup, words), 1);
}

TEST(Advice, NamesTimesThatStepsAreLongerThan) {
  itr::Setup<2> setup = good_setup();
  tag_sides(setup.mesh, 0.2);
  const std::string to_and_fro = "goes to and fro", crosses = "in which bodies cross", swings = "come to rest";
  const auto wave = [](double period) -> SpaceTimeFunction<2> {
    return [=](const Vec<2>&, double t) { return Vec<2>(1e-3 * std::sin(2 * std::numbers::pi * t / period), 0); };
  };
  for (const double period : {1.0, 0.1, 0.04}) {
    setup.dirichlet = {held(1, {true, true}, wave(period))};
    EXPECT_EQ(count_words(setup, to_and_fro), 0) << period;
  }
  for (const double period : {0.02, 0.01, 0.005, 0.0037}) {
    setup.dirichlet = {held(1, {true, true}, wave(period))};
    EXPECT_EQ(count_words(setup, to_and_fro), 1) << period;
  }
  setup.dirichlet = {held(1, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(t > 0.033 ? 1e-3 : 0, 0); })};
  EXPECT_EQ(count_words(setup, to_and_fro), 0) << "a jump is there at the end of a step";
  setup.dirichlet.clear();
  setup.obstacles.motions = {wave(0.01)};
  setup.obstacles.motion = {0, 0};
  EXPECT_EQ(count_words(setup, to_and_fro), 1);
  setup.obstacles.motions = {wave(1)};
  setup.neumann = {{3, [](const Vec<2>&, double t) { return Vec<2>(std::abs(t - 0.0251) < 1e-3 ? 1 : 0, 0); }}};
  EXPECT_EQ(count_words(setup, to_and_fro), 1) << "a pulse that no end of a step sees";
  setup.neumann.clear();

  setup.body_acceleration = constant(0, -9.81);
  EXPECT_EQ(count_words(setup, crosses), 0);
  setup.time.dt = 10;
  EXPECT_EQ(count_words(setup, crosses), 1);
  setup.body_acceleration = nullptr;
  EXPECT_EQ(count_words(setup, crosses), 0);

  setup.obstacles.motion = {kNone, kNone};
  setup.dirichlet = {held(1, {true, true}, constant(0, 0))};
  setup.initial_displacement = {{1, [](const Vec<2>& X, double) { return Vec<2>(0, 0.01 * X[0]); }}};
  EXPECT_EQ(count_words(setup, swings), 1);
  setup.time.dt = 0.01;
  EXPECT_EQ(count_words(setup, swings), 0);
}

}  // namespace
}  // namespace itr
