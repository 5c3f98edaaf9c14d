// SPDX-License-Identifier: MIT
// Keys of a scene: what they set, and which values are refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "energy/elastic/law_table.hpp"
#include "scene_folder.hpp"
#include "simulation/step_problem.hpp"

namespace itr::scene {
namespace {

TEST_F(SceneTest, LeastScene) {
  const Scene scene = read_scene(square());
  const itr::Setup<2>& setup = std::get<itr::Setup<2>>(scene.setup);

  EXPECT_EQ(setup.mesh.num_vertices(), 4);
  EXPECT_DOUBLE_EQ(setup.mesh.total_volume(), 1);  // the second triangle is turned round
  EXPECT_EQ(setup.materials.at(1).density, 1000);
  EXPECT_EQ(setup.time.steps, 10);
  EXPECT_FALSE(setup.body_acceleration);
  EXPECT_FALSE(setup.contact.enabled);
  EXPECT_TRUE(scene.warnings.empty());
}

TEST_F(SceneTest, CommonPatchAndNull) {
  write("sub/base.json", square({{"contact", {{"dhat", 0.5}, {"epsv", 0.1}}}, {"time", {{"t0", 0}}}}).dump());
  const json scene = {{"common", "sub/base.json"},
                      {"time", {{"dt", 0.2}}},
                      {"contact", {{"epsv", nullptr}, {"enabled", true}}},
                      {"patch", json::array({{{"op", "add"}, {"path", "/geometry/0/n_refs"}, {"value", 1}},
                                             {{"op", "replace"}, {"path", "/materials/0/E"}, {"value", 7}}})}};

  const itr::Setup<2> setup = read2(scene);  // the mesh lies beside the outer file

  EXPECT_EQ(setup.time.steps, 5);
  EXPECT_EQ(setup.contact.dhat, 0.5);
  EXPECT_EQ(setup.contact.friction_velocity, 1e-3);
  EXPECT_EQ(setup.mesh.num_vertices(), 9);
  EXPECT_EQ(setup.materials.at(1).youngs_modulus, 7);
}

TEST_F(SceneTest, WrongMergesSayWhere) {
  write("base.json", square().dump());
  write("loop.json", R"({"common": "scene.json"})");
  const json bad_patch = json::array({{{"op", "replace"}, {"path", "/geometry/9/mesh"}, {"value", 1}}});

  EXPECT_EQ(failure({{"common", "base.json"}, {"patch", bad_patch}}).place, "/patch/0");
  EXPECT_EQ(failure({{"common", "missing.json"}}).place, "/common");
  EXPECT_EQ(failure({{"common", "loop.json"}}).place, "/common");
  EXPECT_EQ(wrong_place({{"patch", json::array()}}), "/patch");
}

TEST_F(SceneTest, WrongJsonNamesTheLine) {
  write("broken.json", "{\n  \"time\": {\n    \"dt\": 0.1,,\n  }\n}\n");
  try {
    read(folder_ / "broken.json");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "line 3");
  }
  EXPECT_THROW(read(folder_ / "no-such.json"), InputError);
  EXPECT_THROW(read(folder_), InputError);
}

TEST_F(SceneTest, OverridesActBeforeValidation) {
  const itr::Setup<2> setup = read2(square(), {{"/space/remesh/split/max_depth", "5"},
                                               {"/time/dt", "0.5"},
                                               {"/geometry/0/n_refs", "1"},
                                               {"/boundary_conditions/rhs", "[0, 9.81]"}});

  EXPECT_EQ(setup.remesh.split.max_depth, 5);
  EXPECT_EQ(setup.time.steps, 2);
  EXPECT_EQ(setup.mesh.num_cells(), 8);
  EXPECT_EQ(setup.body_acceleration({0, 0}, 0), Vec<2>(0, -9.81));
  EXPECT_EQ(failure(square(), {{"/time/dt", "fast"}}).place, "--set /time/dt=fast");
  EXPECT_EQ(failure(square(), {{"time/dt", "1"}}).place, "--set time/dt=1");
  EXPECT_EQ(failure(square(), {{"/geometry/7/mesh", "1"}}).place, "--set /geometry/7/mesh=1");
  EXPECT_EQ(failure(square(), {{"/time/dtt", "1"}}).place, "/time/dtt");
}

TEST_F(SceneTest, UnknownKeysSuggestTheNearest) {
  const InputError::Parts parts = failure(square({{"contact", {{"friction_coeficient", 0.1}}}}));

  EXPECT_EQ(parts.place, "/contact/friction_coeficient");
  EXPECT_NE(parts.expected.find("\"friction_coefficient\" perhaps"), std::string::npos) << parts.expected;
  EXPECT_NE(failure(square({{"dhat", 1}})).expected.find("/contact/dhat"), std::string::npos);
}

TEST_F(SceneTest, OutputAndSpeedOfOthersDoNotStopAScene) {
  const Scene scene = read_scene(square(json::parse(R"({
    "output": {"json": "sim.json", "directory": "out", "paraview": {"skip_frame": 4, "volume": true}},
    "tests": {"err_l2": 1}, "solver": {"max_threads": 2, "contact": {"CCD": {"broad_phase": "HG"}},
    "nonlinear": {"line_search": {"method": "Backtracking"}}, "linear": {"solver": ["Eigen::PardisoLLT", "mumps"]}}})")));

  EXPECT_EQ(scene.directory, "out");
  EXPECT_EQ(scene.output.skip_frames, 4);
  EXPECT_EQ(scene.max_threads, 2);
  EXPECT_EQ(std::get<itr::Setup<2>>(scene.setup).linear.solvers, (std::vector<std::string>{"Eigen::PardisoLLT", "mumps"}));
}

TEST_F(SceneTest, LambdaAndMuArePlaneStressAsEAndNuAre) {
  const auto material = [&](json moduli) {
    moduli["type"] = "NeoHookean";
    return read2(square({{"materials", moduli}})).materials.at(1);
  };
  for (const double nu : {-0.8, 0.0, 0.3, 0.49}) {
    const double lambda = nu * 200 / (1 - nu * nu), mu = 200 / (2 * (1 + nu));
    const Material lame = material({{"lambda", lambda}, {"mu", mu}});
    EXPECT_FALSE(lame.plane_strain);
    EXPECT_NEAR(lame.youngs_modulus, 200, 1e-11);
    EXPECT_NEAR(lame.poisson_ratio, nu, 1e-14);
    const Material varying = material({{"lambda", std::to_string(lambda) + " + 0*x"}, {"mu", mu}});
    EXPECT_FALSE(varying.plane_strain);
    EXPECT_NEAR(varying.lame_lambda(2), lambda, 1e-4);
  }
  const Material asked = material({{"lambda", 3}, {"mu", 2}, {"plane_strain", true}});
  EXPECT_TRUE(asked.plane_strain);
  EXPECT_DOUBLE_EQ(asked.lame_lambda(2), 3);

  const itr::scene::Scene beyond = read_scene(square({{"materials", {{"type", "NeoHookean"}, {"lambda", 8}, {"mu", 2}}}}));
  const Material& taken = std::get<itr::Setup<2>>(beyond.setup).materials.at(1);
  EXPECT_TRUE(taken.plane_strain);
  EXPECT_DOUBLE_EQ(taken.lame_lambda(2), 8);
  EXPECT_TRUE(std::any_of(beyond.warnings.begin(), beyond.warnings.end(),
                          [](const std::string& text) { return text.starts_with("/materials/lambda: "); }));
}

TEST_F(SceneTest, MaterialsOfAllLaws) {
  const auto material = [&](const char* text) { return read2(square({{"materials", json::parse(text)}})).materials.at(1); };
  const auto linear = material(R"({"type": "HookeLinearElasticity", "E": 3, "nu": 0.25})");
  EXPECT_EQ(linear.law, MaterialLaw::linear);
  EXPECT_DOUBLE_EQ(linear.lame_lambda(2), 0.25 * 3 / (1 - 0.0625));
  EXPECT_EQ(linear.density, 1);
  EXPECT_DOUBLE_EQ(material(R"({"type": "SaintVenant", "E": 3, "nu": 0.25, "plane_strain": true})").lame_lambda(2), 1.2);
  const auto lame = material(R"({"type": "FixedCorotational", "lambda": "2*x + 1", "mu": 3})");
  EXPECT_EQ(lame.law, MaterialLaw::fixed_corotated);
  const Vec<3> X(0.25, 0, 0);
  const double E = lame.youngs_modulus_at(X), nu = lame.poisson_ratio_at(X);
  EXPECT_NEAR(lame.lame_lambda(E, nu, 2), 1.5, 1e-14);
  EXPECT_NEAR(Material::lame_mu(E, nu), 3, 1e-14);
  const auto graded = material(R"({"type": "NeoHookean", "E": "2 + 3*compare(0.5, x) + 0", "nu": 0.3, "rho": "1 + y"})");
  EXPECT_EQ(graded.youngs_modulus, 5);
  EXPECT_EQ(graded.youngs_modulus_at({0.1, 0, 0}), 2);
  EXPECT_EQ(graded.density_at({0.1, 0.5, 0}), 1.5);
  const auto mooney = material(R"({"type": "MooneyRivlin3Param", "c1": 4, "c2": 2, "c3": 1, "d1": 50})");
  EXPECT_EQ(mooney.mooney_rivlin.volume_d, 50);
  EXPECT_DOUBLE_EQ(mooney.youngs_modulus, 9 * 100 * 6 / (300 + 6.));
}

TEST_F(SceneTest, LawsOfTheTableAreReadByTheirRows) {
  const auto material = [&](const char* text, const char* defaults = "itr") {
    return read2(square({{"materials", json::parse(text)}, {"defaults", defaults}})).materials.at(1);
  };
  const auto ogden = material(R"({"type": "Ogden", "mus": [0.63, 0.0012, -0.01], "alphas": [1.3, 5, -2], "K": 1000})");
  EXPECT_EQ(ogden.law, MaterialLaw::own);
  EXPECT_EQ(itr::sum_of(ogden)->name(), "Ogden");
  EXPECT_TRUE(ogden.plane_strain);
  EXPECT_NEAR(ogden.lame_mu(), (0.63 * 1.3 + 0.0012 * 5 + 0.01 * 2) / 2, 1e-14);
  EXPECT_NEAR(ogden.lame_lambda(2) + 2 * ogden.lame_mu() / 3, 1000, 1e-8);
  EXPECT_FALSE(material(R"({"type": "Yeoh", "C": [1], "K": 9, "plane_stress": true})").plane_strain);
  const auto in_plane = material(R"({"type": "Yeoh", "C": 1, "K": 9})", "polyfem");
  EXPECT_EQ(itr::sum_of(in_plane)->dimension, 2);
  EXPECT_NEAR(in_plane.lame_lambda(2), 7, 1e-14);  // K is lambda + mu there
  const auto sum = material(R"({"type": "MaterialSum", "rho": 7, "models": [
    {"type": "HGOFiber", "k1": 3, "k2": 2, "fiber_direction": ["x", 2]}, {"type": "NeoHookean", "E": 3, "nu": 0.25}]})");
  EXPECT_EQ(itr::sum_of(sum)->name(), "NeoHookean + HGOFiber");
  EXPECT_EQ(sum.density, 7);
  EXPECT_TRUE(sum.has_varying_moduli());
  EXPECT_LT((itr::sum_of(sum)->terms[1].direction({1.5, 0, 0}) - Vec<3>(0.6, 0.8, 0)).norm(), 1e-15);
  EXPECT_NEAR(sum.youngs_modulus, 3, 1e-14);
  const auto scaled = material(R"({"type": "ArrudaBoyce", "mu": 2, "lambda_m": 3, "K": 50})");
  EXPECT_NEAR(scaled.lame_mu(), 2 * (1 + 3 / 45. + 99 / (175. * 81) + 513 / (875. * 729) + 42039 / (67375. * 6561)), 1e-12);
}

TEST_F(SceneTest, WrongCoefficientsOfLawsAreNamed) {
  const auto place = [&](const char* text) { return wrong_place({{"materials", json::parse(text)}}); };
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [1]})"), "/materials/K");
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [1], "K": -1})"), "/materials/K");
  EXPECT_EQ(place(R"({"type": "ArrudaBoyce", "mu": 1, "lambda_m": 1, "K": 1})"), "/materials/lambda_m");
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [], "K": 1})"), "/materials/C");
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [-1], "K": 1})"), "/materials");  // no shear modulus
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [1], "K": 1, "mus": [1]})"), "/materials/mus");
  EXPECT_EQ(place(R"({"type": "Yeoh", "C": [1], "K": 1, "plane_strain": true})"), "/materials/plane_strain");
  EXPECT_EQ(place(R"({"type": "Ogden", "mus": [1, 2], "alphas": [1], "K": 1})"), "/materials/alphas");
  EXPECT_EQ(place(R"({"type": "Ogden", "mus": [1], "alphas": [0], "K": 1})"), "/materials/alphas/0");
  EXPECT_EQ(place(R"({"type": "Hyperfoam", "mus": [1], "alphas": [2], "nus": [0.5]})"), "/materials/nus/0");
  EXPECT_EQ(place(R"({"type": "Hencky", "E": 1, "nu": 0.5})"), "/materials/nu");
  EXPECT_EQ(place(R"({"type": "VolumePenalty", "k": 1})"), "/materials");
  EXPECT_EQ(place(R"({"type": "MaterialSum"})"), "/materials/models");
  EXPECT_EQ(place(R"({"type": "MaterialSum", "models": [{"type": "SaintVenant", "E": 1, "nu": 0}]})"),
            "/materials/models/0/type");
  const auto fibre = [&](const std::string& keys) {
    return place((R"({"type": "MaterialSum", "models": [{"type": "Hencky", "E": 1, "nu": 0}, {"type": "HGOFiber", "k1": 1)" +
                  keys + "}]}")
                     .c_str());
  };
  EXPECT_EQ(fibre(R"(, "fiber_direction": [1, 0])"), "/materials/models/1/k2");
  EXPECT_EQ(fibre(R"(, "k2": 1)"), "/materials/models/1/fiber_direction");
  EXPECT_EQ(fibre(R"(, "k2": 1, "fiber_direction": [0, 0])"), "/materials/models/1/fiber_direction");
  EXPECT_EQ(fibre(R"(, "k2": 1, "fiber_direction": ["x - x", 0])"), "/materials/models/1/fiber_direction");
  EXPECT_EQ(fibre(R"(, "k2": 1, "kappa": 1.5, "fiber_direction": [1, 0])"), "/materials/models/1/kappa");
  EXPECT_EQ(place(R"({"type": "MaterialSum", "models": [{"type": "VolumePenalty", "k": 9}, {"type": "AMIPS"}]})"),
            "/materials/models/1/use_rest_pose");
}

TEST_F(SceneTest, NumbersThatNoDoubleHoldAreNamedByTheirPointer) {
  const auto failure_of = [&](const std::string& text) {
    write("scene.json", text);
    try {
      read(folder_ / "scene.json");
    } catch (const InputError& error) {
      return error.parts();
    }
    return InputError::Parts{};
  };
  const InputError::Parts in_list =
      failure_of(R"({"a": {"b": [1, {"c": 2}, []]}, "time": {"x~y/z": [0, {"d": [[], 3]}, [4, 1e999]]}})");
  EXPECT_EQ(in_list.place, "/time/x~0y~1z/2/1");
  EXPECT_EQ(in_list.found, "1e999");
  EXPECT_EQ(failure_of(R"({"solver": {}, "time": {"dt": -1e400, "tend": 1}})").place, "/time/dt");
}

TEST_F(SceneTest, FilesOfTheWorkingFolderAreTakenWithAWord) {
  const fs::path before = fs::current_path();
  fs::create_directories(folder_ / "elsewhere");
  write("elsewhere/only_here.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
  write("elsewhere/shared.json", "{}");
  const json scene = square(
      {{"geometry",
        json::array({{{"mesh", "only_here.obj"}, {"volume_selection", 1}},
                     {{"mesh", "square.obj"}, {"volume_selection", 1}, {"transformation", {{"translation", {3, 0}}}}}})},
       {"common", "shared.json"}});
  write("scene.json", scene.dump());
  write("elsewhere/scene.json",
        square({{"geometry", json::array({{{"mesh", "only_here.obj"}, {"volume_selection", 1}}})}}).dump());
  fs::current_path(folder_ / "elsewhere");
  const auto told_of = [](const fs::path& file) {
    std::set<std::string> places;
    for (const std::string& text : read(file).warnings)
      if (text.find("working folder") != text.npos) places.insert(text.substr(0, text.find(':')));
    return places;
  };
  EXPECT_EQ(told_of(folder_ / "scene.json"), (std::set<std::string>{"/common", "/geometry/0/mesh"}));
  EXPECT_EQ(told_of("scene.json"), std::set<std::string>());
  EXPECT_EQ(told_of(folder_ / "elsewhere/scene.json"), std::set<std::string>());
  fs::current_path(before);
}

TEST_F(SceneTest, WrongValuesAreRefusedWithTheirPointer) {
  const auto material = [](const char* key, const json& value) {
    json one = {{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}};
    one[key] = value;
    return json{{"materials", json::array({one})}};
  };
  EXPECT_EQ(wrong_place(material("E", 0)), "/materials/0/E");
  EXPECT_EQ(wrong_place(material("E", "1e4 * (x - 0.5)")), "/materials/0/E");
  EXPECT_EQ(wrong_place(material("E", "1e4 * t")), "/materials/0/E");
  EXPECT_EQ(wrong_place(material("rho", "1 / (x - x)")), "/materials/0/rho");
  EXPECT_EQ(wrong_place(material("c1", 1)), "/materials/0/c1");
  EXPECT_EQ(wrong_place({{"materials", {{"type", "MooneyRivlin"}, {"c1", 1}, {"c2", 1}}}}), "/materials/k");
  EXPECT_EQ(wrong_place({{"materials", {{"type", "MooneyRivlin"}, {"c1", 1}, {"c2", 1}, {"k", -1}}}}), "/materials/k");
  EXPECT_EQ(wrong_place({{"materials", {{"type", "SaintVenant"}, {"E", 1}, {"nu", 0.6}}}}), "/materials/nu");
  EXPECT_EQ(wrong_place(material("nu", 0.5)), "/materials/0/nu");
  EXPECT_EQ(wrong_place(material("nu", -1)), "/materials/0/nu");
  EXPECT_EQ(wrong_place(material("rho", -3)), "/materials/0/rho");
  EXPECT_EQ(wrong_place(material("type", "Gent")), "/materials/0/type");
  EXPECT_EQ(wrong_place(material("id", 2)), "/materials");
  EXPECT_EQ(wrong_place({{"materials", nullptr}}), "/materials");
  EXPECT_EQ(wrong_place({{"geometry", nullptr}}), "/geometry");
  EXPECT_EQ(wrong_place({{"geometry", {{"mesh", "missing.obj"}}}}), "/geometry/mesh");
  EXPECT_EQ(wrong_place({{"geometry", {{"mesh", "flat.obj"}}}}), "/geometry/mesh");
  EXPECT_EQ(wrong_place({{"contact", {{"dhat", 0}}}}), "/contact/dhat");
  EXPECT_EQ(wrong_place({{"contact", {{"dhat", "x"}}}}), "/contact/dhat");
  EXPECT_EQ(wrong_place({{"contact", {{"enabled", 1}}}}), "/contact/enabled");
  EXPECT_EQ(wrong_place({{"time", {{"dt", -0.1}}}}), "/time/dt");
  EXPECT_EQ(wrong_place({{"time", {{"dt", nullptr}}}}), "/time");
  EXPECT_EQ(wrong_place({{"time", {{"time_steps", 3}}}}), "/time");
  EXPECT_EQ(wrong_place({{"time", {{"tend", 0}}}}), "/time/tend");
  EXPECT_EQ(wrong_place({{"time", {{"integrator", "Euler"}}}}), "/time/integrator");
  EXPECT_EQ(wrong_place({{"space", {{"discr_order", 3}}}}), "/space/discr_order");
  EXPECT_EQ(wrong_place({{"solver", {{"nonlinear", {{"norm_type", "L1"}}}}}}), "/solver/nonlinear/norm_type");
  EXPECT_EQ(wrong_place({{"time", {{"step_cuts", -1}}}}), "/time/step_cuts");
  EXPECT_EQ(wrong_place({{"input", {{"data", {{"state", "a.hdf5"}}}}}}), "/input/data/state");
}

TEST_F(SceneTest, WaysToProjectTheHessian) {
  const auto newton = [&](const json& options) {
    return read2(square({{"solver", {{"nonlinear", {{"Newton", options}}}}}})).newton;
  };
  EXPECT_FALSE(newton({{"use_psd_projection", false}}).project_to_psd);
  EXPECT_EQ(newton({{"force_psd_projection", true}}).projected_iterations, 0);
  EXPECT_GT(newton({{"force_psd_projection", false}}).projected_iterations, 0);
  EXPECT_THROW(newton({{"force_psd_projection", true}, {"use_psd_projection", false}}), itr::InputError);
  EXPECT_EQ(read2(square({{"solver", {{"nonlinear", {{"iterations_per_strategy", 1}}}}}})).newton.projected_iterations, 2);
  EXPECT_EQ(newton(json::object()).indefinite, IndefiniteHessian::project);
}

TEST_F(SceneTest, TolerancesOfMainCarryTheScalesOfTheScene) {
  const auto newton = [&](const json& nonlinear, const json& advanced = json::object()) {
    return read2(square({{"solver", {{"nonlinear", nonlinear}, {"advanced", advanced}}}})).newton;
  };
  const double L = std::sqrt(2.0);  // of the unit square

  const NewtonOptions l2 = newton({{"x_delta_tol", 1e-4}, {"grad_norm_tol", 1e-8}, {"newton_decrement_tol", 1e-9}});
  EXPECT_EQ(l2.norm, NewtonNorm::l2);
  EXPECT_DOUBLE_EQ(l2.gradient_tolerance, 1e-8 * 1e4 * L);
  EXPECT_EQ(l2.first_gradient_tolerance, 0) << "only where a scene asks for it";
  EXPECT_DOUBLE_EQ(l2.step_tolerance, 1e-4 * L * L);
  EXPECT_EQ(l2.relative_gradient_tolerance, 0);
  EXPECT_DOUBLE_EQ(l2.decrement_tolerance, 1e-9);
  const NewtonOptions linf = newton({{"norm_type", "Linf"}, {"x_delta_tol", 1e-4}, {"rel_x_delta_tol", 1e-3}},
                                    {{"characteristic_length", 3}, {"characteristic_force_density", 10}});
  EXPECT_EQ(linf.norm, NewtonNorm::linf);
  EXPECT_EQ(linf.gradient_tolerance, 0);
  EXPECT_DOUBLE_EQ(newton({{"norm_type", "Linf"}, {"first_grad_norm_tol", 1e-9}}, {{"characteristic_force_density", 10}})
                       .first_gradient_tolerance,
                   1e-9 * 10);
  EXPECT_DOUBLE_EQ(linf.step_tolerance, 1e-4 * 3);
  EXPECT_DOUBLE_EQ(linf.relative_step_tolerance, 1e-3);
  EXPECT_EQ(newton(json::object()).norm, NewtonNorm::l2);  // no key of either vocabulary
}

TEST_F(SceneTest, ForcesAreComparedWithThoseThatActUnlessAScenesSaysOtherwise) {
  EXPECT_EQ(read2(square()).newton.force_tolerance, 1e-9);
  EXPECT_EQ(read2(square({{"solver", {{"nonlinear", {{"force_tol", 1e-6}}}}}})).newton.force_tolerance, 1e-6);
}

/// At times and places that were not looked at when the scene was read.
TEST_F(SceneTest, ValuesThatAreNoneNameKeyPlaceAndTimeWhereTheyAreAsked) {
  const auto parts_of = [](const auto& ask) {
    try {
      ask();
    } catch (const InputError& error) {
      return error.parts();
    }
    ADD_FAILURE() << "no error";
    return InputError::Parts();
  };
  const json sides = {{"rhs", {"1/(t-0.123)", 0}},
                      {"dirichlet_boundary", {{{"id", 1}, {"value", {"0.1*sqrt((t-0.3)*(t-0.4)+0.002)", 0}}}}}};
  const itr::Setup<2> setup = read2(square(
      {{"boundary_conditions", sides},
       {"geometry", {{{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", {{"threshold", 1e-3}}}}}}}));
  const auto side = parts_of([&] { setup.dirichlet[0].displacement({0, 0.5}, 0.35); });
  EXPECT_EQ(side.place, "/boundary_conditions/dirichlet_boundary/0/value");
  EXPECT_NE(side.found.find("0.5"), std::string::npos) << side.found;
  EXPECT_NE(side.found.find("t = 0.35"), std::string::npos) << side.found;
  EXPECT_EQ(parts_of([&] { setup.body_acceleration({0, 0}, 0.123); }).place, "/boundary_conditions/rhs");

  json soft = square();
  soft["materials"][0]["E"] = "1e6*(x-0.2)";
  const itr::Setup<2> varying = read2(soft);
  const auto modulus = parts_of([&] { varying.materials.at(1).youngs_modulus_at({0.1, 0.5, 0}); });
  EXPECT_EQ(modulus.place, "/materials/0/E");
  EXPECT_NE(modulus.found.find("-100000"), std::string::npos) << modulus.found;
}

TEST_F(SceneTest, TolerancesOfTwoVocabulariesAreRefused) {
  const auto place = [&](const json& nonlinear) { return wrong_place({{"solver", {{"nonlinear", nonlinear}}}}); };

  EXPECT_EQ(place({{"x_delta", 1}, {"x_delta_tol", 1}}), "/solver/nonlinear/x_delta");
  EXPECT_EQ(place({{"x_delta", 1}, {"advanced", {{"f_delta_tol", 1}}}}), "/solver/nonlinear/x_delta");
  EXPECT_EQ(place({{"grad_norm_tol", 1}, {"advanced", {{"f_delta", 1}}}}), "/solver/nonlinear/advanced/f_delta");
  EXPECT_EQ(place({{"advanced", {{"f_delta", 1}, {"f_delta_tol", 1}}}}), "/solver/nonlinear/advanced/f_delta");
}

TEST_F(SceneTest, ActivationDistanceShrinksUnlessGiven) {
  const json small = {
      {"geometry", {{"mesh", "square.obj"}, {"volume_selection", 1}, {"transformation", {{"scale", 1e-4}}}}}};
  json given = small;
  given["contact"] = {{"enabled", true}, {"dhat", 1e-3}};
  json absent = small;
  absent["contact"] = {{"enabled", true}};

  EXPECT_NEAR(read2(square(absent)).contact.dhat, 0.8e-4, 1e-12);
  EXPECT_EQ(read2(square(given)).contact.dhat, 1e-3);
  EXPECT_EQ(read_scene(square(given)).warnings.size(), 1u);
  EXPECT_TRUE(read2(square(given)).contact.adaptive_stiffness);
  given["solver"] = {{"contact", {{"barrier_stiffness", "auto"}}}};
  EXPECT_FALSE(read2(square(given)).contact.adaptive_stiffness);
  EXPECT_EQ(read2(square(given)).contact.barrier_stiffness, 0);
  given["contact"]["dhat"] = "auto";
  EXPECT_EQ(read2(square(given)).contact.dhat, 0);
}

/// In kilometres a body of 0.1 mm has an extent of 1e-7.
TEST_F(SceneTest, ConditionsAndMotions) {
  const Scene scene = read_scene(square(json::parse(R"json({"geometry": [
      {"mesh": "square.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-3}},
      {"mesh": "line.obj", "is_obstacle": true, "surface_selection": 3, "transformation": {"translation": [0, -1]}},
      {"mesh": "square.obj", "is_obstacle": true, "surface_selection": 8, "transformation": {"translation": [0, -3]}},
      {"mesh": "line.obj", "is_obstacle": true, "transformation": {"translation": [0, -5]}}],
    "boundary_conditions": {"rhs": [0, "9.81 * 2"],
      "dirichlet_boundary": [{"id": 2, "value": [0, "x*t"], "dimension": [false, true]},
                             {"id": 4, "value": [1, 1], "dimension": [false, false]},
                             {"id": 3, "value": [1, 0], "interpolation": {"type": "linear"}},
                             {"id": 2, "value": [9, 9]}],
      "neumann_boundary": [{"id": 4, "value": [0, "1e3*t"]}, {"id": 1, "value": [0, 0]}],
      "obstacle_displacements": [{"id": 8, "value": ["sin(t)", 0]}]},
    "initial_conditions": {"velocity": [{"id": 1, "value": ["-pi*y", 0]}], "acceleration": "consistent"}})json")));
  const itr::Setup<2>& setup = std::get<itr::Setup<2>>(scene.setup);

  EXPECT_EQ(setup.body_acceleration({1, 1}, 3), Vec<2>(0, -19.62));
  ASSERT_EQ(setup.dirichlet.size(), 2u);
  EXPECT_EQ(setup.dirichlet[0].components, (std::array<bool, 2>{false, true}));
  EXPECT_EQ(setup.dirichlet[0].displacement({2, 0}, 3), Vec<2>(0, 6));
  EXPECT_EQ(setup.dirichlet[1].displacement({2, 0}, 3), Vec<2>(3, 0));
  ASSERT_EQ(setup.neumann.size(), 1u);
  EXPECT_EQ(setup.neumann[0].traction({0, 0}, 2), Vec<2>(0, 2000));
  EXPECT_EQ(setup.obstacles.edges.size(), 6u);
  EXPECT_EQ(setup.obstacles.motion, (std::vector<int>{1, 1, 0, 0, 0, 0, kNone, kNone}));
  EXPECT_EQ(setup.obstacles.motions[1]({0, 0}, 2), Vec<2>(2, 0));  // by the dirichlet entry with its id
  EXPECT_TRUE(setup.consistent_initial_acceleration);
  ASSERT_EQ(setup.initial_velocity.size(), 1u);
  EXPECT_DOUBLE_EQ(setup.initial_velocity[0].value({0, 1}, 0)[0], -std::numbers::pi);
  ASSERT_EQ(scene.warnings.size(), 3u) << scene.warnings[0];  // of contact and of the acceleration, too
  EXPECT_NE(scene.warnings[0].find("/boundary_conditions/dirichlet_boundary/3"), std::string::npos);
}

/// A key or an entry that cannot do what it says leads to an error or a warning.
TEST_F(SceneTest, NothingIsAcceptedSilently) {
  const json base = square(json::parse(R"json({"geometry": [
      {"mesh": "square.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-3},
       "point_selection": [{"id": 9, "box": [[0.5, 0.5], [2, 2]]}]},
      {"mesh": "line.obj", "is_obstacle": true, "surface_selection": 8, "transformation": {"translation": [0, -1]}}],
    "contact": {"enabled": true, "dhat": 1e-3}})json"));
  const auto with = [&](const char* changes) {
    json scene = base;
    scene.merge_patch(json::parse(changes));
    return scene;
  };
  const auto refused = [&](const char* changes) { return failure(with(changes)).place; };
  const auto warned = [&](const char* changes) {
    std::string text;
    for (const std::string& warning : read_scene(with(changes)).warnings) text += warning + "\n";
    return text;
  };
  EXPECT_EQ(warned("{}"), "");

  const char* condition = R"({"boundary_conditions": {"%s": [{"id": %d, "value": %s}]}})";
  const auto conditions = [&](const char* kind, int id, const char* value) {
    std::array<char, 200> text;
    std::snprintf(text.data(), text.size(), condition, kind, id, value);
    return refused(text.data());
  };
  EXPECT_EQ(conditions("dirichlet_boundary", 5, "[0, 0]"), "/boundary_conditions/dirichlet_boundary/0/id");
  EXPECT_EQ(conditions("neumann_boundary", 5, "[0, 1]"), "/boundary_conditions/neumann_boundary/0/id");
  EXPECT_EQ(conditions("obstacle_displacements", 5, "[0, 1]"), "/boundary_conditions/obstacle_displacements/0/id");
  EXPECT_EQ(conditions("neumann_boundary", 8, "[0, 1]"), "/boundary_conditions/neumann_boundary/0/id");  // an obstacle
  EXPECT_EQ(conditions("pressure_boundary", 9, "1"), "/boundary_conditions/pressure_boundary/0/id");     // points
  EXPECT_EQ(refused(R"({"initial_conditions": {"velocity": [{"id": 4, "value": [1, 0]}]}})"),
            "/initial_conditions/velocity/0/id");
  EXPECT_NE(failure(with(R"({"boundary_conditions": {"neumann_boundary": [{"id": 5, "value": [0, 1]}]}})"))
                .expected.find("1, 2, 3, 4"),
            std::string::npos);

  EXPECT_EQ(refused(R"({"geometry": [{"mesh": "square.obj", "volume_selection": 1}, {"type": "ground", "unit": "mm"}]})"),
            "/geometry/1/unit");

  json twins = base;
  twins["geometry"].push_back(twins["geometry"][1]);
  EXPECT_TRUE(read_scene(twins).warnings.empty());  // an id of several obstacles moves them together
  const json solid = {{"geometry", {{"mesh", "tet.msh"}, {"volume_selection", 1}}},
                      {"materials", {{"type", "NeoHookean"}, {"E", 1}, {"nu", 0.3}, {"plane_strain", true}}}};
  EXPECT_EQ(wrong_place(solid), "/materials/plane_strain");
}

TEST_F(SceneTest, PressureAndDamping) {
  const auto setup = read2(square(json::parse(R"json({
    "geometry": [{"mesh": "square.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-3}}],
    "boundary_conditions": {"pressure_boundary": [{"id": 3, "value": "100*x", "interpolation": {"type": "linear"}},
                                                  {"id": 1, "value": 0}]},
    "solver": {"rayleigh_damping": [{"form": "elasticity", "stiffness": 0.01, "lagging_iterations": 3},
                                    {"form": "contact", "stiffness_ratio": 0.5}]}})json")));
  ASSERT_EQ(setup.pressure.size(), 1u);
  EXPECT_EQ(setup.pressure[0].tag, 3);
  EXPECT_EQ(setup.pressure[0].pressure({0.5, 0}, 2), 100);
  ASSERT_EQ(setup.damping.size(), 2u);
  EXPECT_EQ(setup.damping[0].coefficient, 0.01);
  EXPECT_EQ(setup.damping[0].lagging_rounds, 3);
  EXPECT_EQ(setup.damping[1].term, DampingOptions::Term::contact);
  EXPECT_NEAR(setup.damping[1].coefficient, 0.75 * 0.5 * 1e-3, 1e-18);
  const auto damping = [](const json& entry) { return json{{"solver", {{"rayleigh_damping", json::array({entry})}}}}; };
  EXPECT_EQ(wrong_place(damping({{"form", "elasticity"}})), "/solver/rayleigh_damping/0");
  EXPECT_EQ(wrong_place(damping({{"stiffness", 1}})), "/solver/rayleigh_damping/0/form");
  EXPECT_EQ(wrong_place(damping({{"form", "inertia"}, {"stiffness", 1}})), "/solver/rayleigh_damping/0/form");
}

TEST_F(SceneTest, ValuesThatAreNotDefinedAreRefused) {
  const auto dirichlet = [&](const json& value) {
    return failure(square({{"geometry", {{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", 2}}},
                           {"boundary_conditions", {{"dirichlet_boundary", {{"id", 2}, {"value", value}}}}}}));
  };
  EXPECT_EQ(dirichlet({"sqrt(x - 0.5)", 0}).place, "/boundary_conditions/dirichlet_boundary/value");
  EXPECT_EQ(dirichlet({"sqrt(-1)", 0}).place, "/boundary_conditions/dirichlet_boundary/value/0");
  EXPECT_EQ(dirichlet({0, "velocity * t"}).place, "/boundary_conditions/dirichlet_boundary/value/1");
  EXPECT_EQ(dirichlet({0, {1}}).place, "/boundary_conditions/dirichlet_boundary/value/1");
  EXPECT_EQ(dirichlet(3).place, "/boundary_conditions/dirichlet_boundary/value");
}

TEST_F(SceneTest, RemeshOptions) {
  const RemeshOptions options = read2(square({{"space", {{"remesh", json::parse(R"({
      "enabled": true, "type": "sizing_field", "screening": "energy-percentile",
      "split": {"acceptance_tolerance": 0.4}, "collapse": {"rel_max_edge_length": 3}, "swap": {"enabled": true},
      "sizing_field": {"rel_min_edge_length": 0.02}})")}}}}))
                                    .remesh;

  EXPECT_TRUE(options.enabled && options.sizing_field.enabled && options.swap.enabled);
  EXPECT_EQ(options.screening, Screening::energy_percentile);
  EXPECT_EQ(options.split.acceptance_tolerance, 0.4);
  EXPECT_EQ(options.collapse.rel_max_edge_length, 3);
  EXPECT_EQ(options.sizing_field.rel_min_edge_length, 0.02);
}

}  // namespace
}  // namespace itr::scene
