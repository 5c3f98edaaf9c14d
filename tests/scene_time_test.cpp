// SPDX-License-Identifier: MIT
// Keys of a scene's times and steps: integrators, how many steps there are, and steps that are chosen by their errors.
#include <gtest/gtest.h>

#include <vector>

#include "scene_folder.hpp"

namespace itr::scene {
namespace {

TEST_F(SceneTest, Integrators) {
  const auto time = [&](const json& integrator) { return read2(square({{"time", {{"integrator", integrator}}}})).time; };

  EXPECT_EQ(time("ImplicitNewmark").integrator, Integrator::newmark);
  EXPECT_EQ(time({{"type", "ImplicitNewmark"}, {"beta", 0.3}, {"gamma", 0.6}}).newmark_beta, 0.3);
  EXPECT_EQ(time({{"type", "ImplicitNewmark"}, {"energy_growth_limit", 0.2}}).energy_growth_limit, 0.2);
  EXPECT_EQ(time("BDF3").bdf_order, 3);
  EXPECT_EQ(time({{"type", "BDF"}, {"steps", 5}}).bdf_order, 5);
  EXPECT_EQ(read2(square({{"time", {{"tend", nullptr}, {"time_steps", 7}}}})).time.steps, 7);
  EXPECT_DOUBLE_EQ(read2(square({{"time", {{"dt", nullptr}, {"time_steps", 4}}}})).time.dt, 0.25);
  EXPECT_TRUE(read2(square({{"time", nullptr}})).time.is_static);
}

TEST_F(SceneTest, OptionsOfAnotherIntegratorAreRefused) {
  const auto place = [&](const json& integrator) { return wrong_place({{"time", {{"integrator", integrator}}}}); };

  EXPECT_EQ(place({{"type", "BDF2"}, {"steps", 3}}), "/time/integrator/steps");
  EXPECT_EQ(place({{"type", "ImplicitEuler"}, {"steps", 3}}), "/time/integrator/steps");
  EXPECT_EQ(place({{"type", "ImplicitNewmark"}, {"steps", 3}}), "/time/integrator/steps");
  EXPECT_EQ(place({{"type", "BDF"}, {"steps", 3}, {"beta", 0.25}}), "/time/integrator/beta");
  EXPECT_EQ(place({{"type", "ImplicitEuler"}, {"gamma", 0.5}}), "/time/integrator/gamma");
  EXPECT_EQ(place({{"type", "BDF3"}, {"energy_growth_limit", 1}}), "/time/integrator/energy_growth_limit");
}

TEST_F(SceneTest, RoundOffAddsNoStep) {
  const auto steps = [&](double tend, double dt) {
    return read2(square({{"time", {{"tend", tend}, {"dt", dt}}}})).time.steps;
  };
  EXPECT_EQ(steps(0.07, 0.01), 7);
  EXPECT_EQ(steps(0.28, 0.01), 28);
  EXPECT_EQ(steps(2.1, 0.3), 7);
  EXPECT_EQ(steps(0.56, 0.01), 56);
  EXPECT_EQ(steps(0.071, 0.01), 8);
  EXPECT_EQ(steps(1e-12, 1), 1);
}

/// The known norms of peers' scenes are those of an L D L^T, which takes indefinite directions.
TEST_F(SceneTest, WayThroughIndefiniteHessiansIsThatOfAnLdltThatTheSceneNamesFirst) {
  const auto direction = [&](const json& solvers) {
    return read2(square({{"solver", {{"linear", {{"solver", solvers}}}}}})).newton.indefinite;
  };
  for (const char* name : {"Eigen::SimplicialLDLT", "Eigen::PardisoLDLT", "Eigen::AccelerateLDLT"}) {
    EXPECT_EQ(direction(name), IndefiniteHessian::accept);
    EXPECT_EQ(direction({name, "Eigen::CholmodSupernodalLLT"}), IndefiniteHessian::accept);
    EXPECT_EQ(direction({"Eigen::CholmodSupernodalLLT", name}), IndefiniteHessian::project);
  }
  for (const char* name : {"eigen:ldlt", "mumps", "cholmod", "Eigen::PardisoLLT"})
    EXPECT_EQ(direction({name, "eigen"}), IndefiniteHessian::project) << name;
}

TEST_F(SceneTest, TolerancesCarryTheTimeStep) {
  const json nonlinear = {{"x_delta", 1e-3}, {"grad_norm", 1e-7}, {"f_delta", 1e-3}};
  const itr::Setup<2> dynamic = read2(square({{"solver", {{"nonlinear", nonlinear}}}}));
  const itr::Setup<2> statics = read2(square({{"solver", {{"nonlinear", nonlinear}}}, {"time", nullptr}}));
  const json euclidean = {{"norm_type", "Euclidean"}, {"grad_norm_tol", 1e-6}};

  EXPECT_DOUBLE_EQ(dynamic.newton.step_tolerance, 1e-4);
  EXPECT_DOUBLE_EQ(dynamic.newton.gradient_tolerance, 1e-8);
  EXPECT_EQ(dynamic.newton.first_gradient_tolerance, 0) << "only where a scene asks for it";
  EXPECT_DOUBLE_EQ(statics.newton.step_tolerance, 1e-3);
  EXPECT_EQ(read2(square({{"solver", {{"nonlinear", euclidean}}}})).newton.gradient_tolerance, 1e-6);
  EXPECT_DOUBLE_EQ(dynamic.newton.energy_tolerance, 1e-4);
  EXPECT_EQ(dynamic.newton.norm, NewtonNorm::euclidean);
}

TEST_F(SceneTest, StepsMayBeChosenByTheirErrors) {
  const json condition = {{"id", 1},
                          {"value", json::array({"if(t - 0.25, 1, 0)", 0})},
                          {"interpolation", {{"type", "linear_ramp"}, {"from", 0.5}, {"to", 7}}}};
  const auto scene = [&](const json& time) {
    json all = {{"dt", "auto"}, {"tend", 2}};
    all.update(time);
    const json body = {{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", 1}};
    return square({{"geometry", json::array({body})},
                   {"time", all},
                   {"boundary_conditions", {{"dirichlet_boundary", json::array({condition})}}}});
  };
  const itr::TimeOptions time = read2(scene({{"t0", 1e-3}, {"output_dt", 0.5}, {"tolerance", 0.02}})).time;
  EXPECT_TRUE(time.adaptive.enabled);
  EXPECT_EQ(time.adaptive.tolerance, 0.02);
  EXPECT_EQ(time.adaptive.begin, 1e-3);
  EXPECT_EQ(time.adaptive.end, 2);
  EXPECT_EQ(time.adaptive.kinks, (std::vector<double>{0.25, 0.5}));
  EXPECT_NEAR(time.dt * time.steps, 2 - 1e-3, 1e-12);
  EXPECT_EQ(read_scene(scene({{"output_dt", 0.5}})).output.times.output_dt, 0.5);
  const auto place = [&](const json& changes) { return failure(scene(changes)).place; };
  EXPECT_EQ(place({{"tend", nullptr}, {"time_steps", 10}}), "/time/tend");
  EXPECT_EQ(place({{"time_steps", 10}}), "/time/time_steps");
  EXPECT_EQ(place({{"integrator", "BDF3"}}), "/time/integrator");
  EXPECT_EQ(place({{"tolerance", 0}}), "/time/tolerance");
  EXPECT_EQ(place({{"dt_min", 0.1}, {"dt_max", 0.01}}), "/time/dt_max");
  EXPECT_EQ(wrong_place({{"time", {{"tolerance", 0.1}}}}), "/time/tolerance");
  EXPECT_EQ(wrong_place({{"time", {{"output_dt", 0.1}}}}), "/time/output_dt");
}

}  // namespace
}  // namespace itr::scene
