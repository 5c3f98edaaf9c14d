// SPDX-License-Identifier: MIT
// PolyFEM's keys beside those that ITR's own scenes use: what each sets, its closed form, and which values are refused.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "advance.hpp"
#include "block.hpp"
#include "contact_scenes.hpp"
#include "derivatives.hpp"
#include "energy/contact/friction.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/polyfem/adhesion.hpp"
#include "energy/polyfem/adhesive_friction.hpp"
#include "energy/polyfem/lagged_regularization.hpp"
#include "itr/simulation.hpp"
#include "itr/solver.hpp"
#include "law_derivatives.hpp"
#include "scene_folder.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

AdhesionOptions some_adhesion() {
  return {.strength = 0.7, .peak = 0.1, .reach = 0.25, .tangential_coefficient = 0.4, .velocity = 0.05};
}

TEST(Adhesion, PullIsThatOfItsFormAndEndsAtItsReach) {
  ContactScene scene(1, false);
  scene.options.adhesion = some_adhesion();
  const ContactEnergy<2> pull(scene.surface, scene.options, 1, 1, ContactLaw::adhesion);
  const auto force = [&](double d) { return 2 * d * pull.barrier_first(d * d); };  // dE/dd
  EXPECT_NEAR(force(0.1), 0.7, 1e-14);                                             // Y at the peak
  EXPECT_NEAR(force(0.1 + 1e-13), force(0.1 - 1e-13), 1e-11);
  EXPECT_NEAR(pull.barrier(0.01 - 1e-14), pull.barrier(0.01 + 1e-14), 1e-13);
  EXPECT_EQ(force(0.25), 0);
  EXPECT_NEAR(force(0.25 - 1e-9), 0, 1e-7);
  EXPECT_EQ(pull.barrier(0.0626), 0);
  EXPECT_LT(pull.barrier(0.001), pull.barrier(0.03));  // near is lower: it pulls
  for (const double D : {0.002, 0.0099, 0.0101, 0.05}) {
    const double h = 1e-6 * D;
    EXPECT_NEAR(pull.barrier_first(D), (pull.barrier(D + h) - pull.barrier(D - h)) / (2 * h), 1e-7);
    EXPECT_NEAR(pull.barrier_second(D), (pull.barrier_first(D + h) - pull.barrier_first(D - h)) / (2 * h), 1e-5);
  }
}

template <int Dim, typename Scene>
void expect_adhesion_derivatives(Scene scene, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.002);
  scene.options.adhesion = some_adhesion();
  const AdhesionEnergy<Dim> adhesion(scene.surface, scene.options, 0.5);
  expect_derivatives(adhesion, scene.x, 1e-7, 1e-5);
  expect_psd(adhesion, scene.x);
  const VectorX reference = scene.x + VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
  Workspace workspace;
  const FrictionEnergy<Dim> sliding(adhesion.pairs(), scene.x, AdhesionEnergy<Dim>::inner(workspace), scene.options,
                                    {20, reference}, 0.01);
  ASSERT_FALSE(sliding.empty());
  expect_derivatives(sliding, scene.x, 1e-7, 1e-5);
  expect_psd(sliding, scene.x);
}

/// In PolyFEM's way the Hessian is 0 where nothing has moved, and that of friction elsewhere; energy and forces stay.
TEST(Adhesion, HasNoHessianAtRestByStep) {
  ContactScene scene(1, false);
  scene.options.adhesion = some_adhesion();
  const AdhesionEnergy<2> adhesion(scene.surface, scene.options, 0.5);
  Workspace workspace;
  const auto make = [&](const VectorX& at_rest) {
    return FrictionEnergy<2>(adhesion.pairs(), scene.x, AdhesionEnergy<2>::inner(workspace), scene.options, {20, at_rest},
                             0.01);
  };
  const auto hessian = [&](const Energy& energy) { return hessian_of(energy, scene.x, PsdProjection::none); };
  const VectorX elsewhere = scene.x.array() + 1e-3;
  ASSERT_GT(hessian(make(scene.x)).norm(), 0);
  EXPECT_EQ(hessian(AdhesiveFriction<2>(make(scene.x), scene.x)).norm(), 0);
  const AdhesiveFriction<2> moved(make(elsewhere), elsewhere);
  EXPECT_EQ(hessian(moved), hessian(make(elsewhere)));
  EXPECT_EQ(moved.value(scene.x, workspace), make(elsewhere).value(scene.x, workspace));
}

TEST(Adhesion, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 6; ++seed) expect_adhesion_derivatives<2>(ContactScene(seed, false), seed);
  for (unsigned seed = 0; seed < 3; ++seed) expect_adhesion_derivatives<3>(ContactScene3(seed, false, 0.4, 0.03), seed);
}

/// A pair that slides as fast as eps_a is held most, at twice the velocity no longer.
TEST(Adhesion, HoldsAgainstSlidingUpToTwiceItsVelocity) {
  const std::vector<Vec<2>> rest = {{0, 0}, {1, 0}, {0.5, 0.05}};
  const std::vector<int> points = {2};
  const CollisionSurface surface = make_collision_surface<2>({{0, 1}}, {}, points, rest, std::vector<char>(3, 1));
  ContactOptions options{.enabled = true, .dhat = 0.01};
  options.adhesion = some_adhesion();
  VectorX x(6);
  x << 0, 0, 1, 0, 0.5, 0.05;
  const auto hold = [&](double velocity) {
    VectorX reference = x;
    reference[4] -= velocity / 20;
    const AdhesionEnergy<2> adhesion(surface, options, 1);
    Workspace workspace;
    const FrictionEnergy<2> sliding(adhesion.pairs(), x, AdhesionEnergy<2>::inner(workspace), options, {20, reference}, 1);
    return gradient_of(sliding, x)[4];
  };
  const double most = 0.4 * 0.7;
  EXPECT_NEAR(hold(0.05), most, 1e-9);
  EXPECT_NEAR(hold(0.025), most * 0.75, 1e-9);
  EXPECT_EQ(hold(0.1001), 0);
  options.adhesion.is_by_step = true;
  EXPECT_NEAR(hold(0.05), most / (2 * 0.1), 1e-9);
}

/// A square at rest near a line, in PolyFEM's way with the pull by (dt)^2: its momentum after a step is the pull times dt.
TEST(Adhesion, MovesBodiesAndIsPartOfContact) {
  for (const bool is_by_step : {false, true}) {
    itr::Setup<2> setup = free_square(2);
    setup.obstacles.rest = {{-1, -0.01}, {1, -0.01}};
    setup.obstacles.edges = {{0, 1}};
    setup.obstacles.motion = {kNone, kNone};
    setup.contact = {.enabled = true, .dhat = 1e-3};
    setup.contact.adhesion = {.strength = 1e-3, .peak = 0.005, .reach = 0.03, .is_by_step = is_by_step};
    setup.fields.contact_forces = setup.fields.momentum = true;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    const double energy = advance(simulation).report.energy.contact;
    const CollisionSurface surface = collision_surface(setup.mesh, setup.obstacles);
    const ContactEnergy<2> law(surface, setup.contact, 1, 1, ContactLaw::adhesion);
    double pull = 0, expected = 0;
    for (int v = 0; v < 3; ++v) {  // below
      const double d = simulation.state().history.x[0][2 * v + 1] + 0.01;
      pull += 2 * d * law.barrier_first(d * d) / (is_by_step ? 1e-4 : 1);
      expected += law.barrier(d * d) / (is_by_step ? 1e-4 : 1);
    }
    const AskedFields fields = asked(simulation);
    EXPECT_NEAR(sum<2>(fields.forces.contact)[1], -pull, 1e-9 * pull);
    EXPECT_NEAR(fields.momentum[1], -pull * 0.01, 1e-9 * pull);
    EXPECT_NEAR(energy, expected, 1e-9 * std::abs(expected));
  }
}

TEST(LaggedRegularization, DerivativesMatchDifferences) {
  const VectorX x0 = VectorX::LinSpaced(6, 0, 1), x = VectorX::LinSpaced(6, 0.3, -0.4);
  const LaggedRegularizationEnergy<3> energy(x0, 7);
  Workspace workspace;
  EXPECT_NEAR(energy.value(x, workspace), 3.5 * (x - x0).squaredNorm(), 1e-14);
  expect_derivatives(energy, x, 1e-5, 1e-8);
}

template <int Dim>
MatrixX random_stiffness(std::mt19937& random) {
  constexpr int kRows = Dim == 2 ? 3 : 6;
  std::normal_distribution<double> normal;
  const MatrixX A = MatrixX::NullaryExpr(kRows, kRows, [&] { return normal(random); });
  return A * A.transpose() + MatrixX::Identity(kRows, kRows);
}

template <int Dim>
void expect_tensor_laws() {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0, 0.2);
  for (const bool is_small : {true, false}) {
    const Material material = tensor_material(random_stiffness<Dim>(random), is_small);
    const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>(Vec<Dim>::Zero()));
    const Mat<Dim> F = Mat<Dim>::Identity() + Mat<Dim>(Mat<Dim>::NullaryExpr([&] { return normal(random); }));
    expect_law_derivatives<Dim>(F, moduli);
  }
}

TEST(TensorLaw, DerivativesMatchDifferences) {
  expect_tensor_laws<2>();
  expect_tensor_laws<3>();
}

/// A body and its stiffness that are turned together have the same energy; an isotropic stiffness is not changed.
TEST(TensorLaw, TurnsWithItsAxes) {
  std::mt19937 random(5);
  const MatrixX C = random_stiffness<3>(random);
  const Mat<3> R = Eigen::AngleAxisd(0.7, Vec<3>(1, 2, -1).normalized()).toRotationMatrix();
  const Mat<3> F = Mat<3>::Identity() + 0.1 * Mat<3>(Mat<3>::Random());
  const auto density = [](const MatrixX& stiffness, const Mat<3>& F) {
    return elastic_density<3>(F, elastic_moduli<3>(tensor_material(stiffness, false), Vec<3>(Vec<3>::Zero())));
  };
  EXPECT_NEAR(density(turned(C, R), Mat<3>(R * F * R.transpose())), density(C, F), 1e-12);
  MatrixX isotropic = MatrixX::Zero(6, 6);
  isotropic.topLeftCorner(3, 3).setConstant(2);
  isotropic.diagonal() << 8, 8, 8, 3, 3, 3;
  EXPECT_LE((turned(isotropic, R) - isotropic).norm(), 1e-13);
  const Material material = tensor_material(isotropic, true);
  EXPECT_NEAR(material.lame_mu(), 3, 1e-13);
  EXPECT_NEAR(material.lame_lambda(3), 2, 1e-13);
}

/// The divergence of the stress, by differences.
TEST(TensorLaw, HoldingForceIsMinusTheDivergenceOfStress) {
  const Material material{.youngs_modulus = 7, .poisson_ratio = 0.3};
  const auto gradient = [](const Vec<3>& X) {  // of (x y, z x^2, y z) / 10
    Mat<3> G;
    G << X[1], X[0], 0, 2 * X[0] * X[2], 0, X[0] * X[0], 0, X[2], X[1];
    return Mat<3>(G / 10);
  };
  const Vec<3> X(0.4, 0.7, -0.3);
  constexpr double kStep = 1e-5;
  std::array<Mat<3>, 3> second;
  Vec<3> expected = Vec<3>::Zero();
  for (int j = 0; j < 3; ++j) {
    const Vec<3> plus = X + kStep * Vec<3>::Unit(j), minus = X - kStep * Vec<3>::Unit(j);
    const auto stress = [&](const Vec<3>& at) {
      return elastic_stress<3>(Mat<3>(Mat<3>::Identity() + gradient(at)), elastic_moduli<3>(material, at));
    };
    expected -= (stress(plus) - stress(minus)).col(j) / (2 * kStep);
    for (int i = 0; i < 3; ++i) second[i].col(j) = (gradient(plus) - gradient(minus)).row(i).transpose() / (2 * kStep);
  }
  EXPECT_LE((holding_force<3>(material, X, gradient(X), second) - expected).norm(), 1e-8);
}

}  // namespace

namespace scene {
namespace {

class PolyfemKeys : public SceneTest {
 protected:
  static json cube(const json& changes = json::object()) {
    json scene = {{"defaults", "polyfem"},
                  {"geometry", json::array({{{"mesh", "tet.msh"}, {"volume_selection", 1}}})},
                  {"materials", {{"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.3}, {"rho", 1000}}}};
    scene.merge_patch(changes);
    return scene;
  }
  itr::Setup<3> read3(const json& scene) { return std::get<itr::Setup<3>>(read_scene(scene).setup); }
};

json quantity(const json& value, const std::string& unit) { return {{"value", value}, {"unit", unit}}; }

TEST_F(PolyfemKeys, QuantitiesBecomeNumbersOfTheScene) {
  const json material = {{"type", "NeoHookean"}, {"E", quantity(20, "kPa")}, {"nu", 0.3}, {"rho", quantity(1.2, "g/cm^3")}};
  const itr::Setup<2> setup = read2(square({{"materials", material},
                                            {"boundary_conditions", {{"rhs", {0, quantity(981, "cm/s^2")}}}},
                                            {"time", {{"dt", quantity(100, "ms")}}}}));
  EXPECT_DOUBLE_EQ(setup.materials.at(1).youngs_modulus, 20000);
  EXPECT_NEAR(setup.materials.at(1).density, 1200, 1e-10);
  EXPECT_DOUBLE_EQ(setup.time.dt, 0.1);
  EXPECT_NEAR(setup.body_acceleration({0, 0}, 0)[1], -9.81, 1e-14);
  // In a scene of millimetres and tonnes the same quantities are the same.
  const itr::Setup<2> in_mm = read2(square({{"materials", material},
                                            {"units", {{"length", "mm"}, {"mass", "t"}}},
                                            {"boundary_conditions", {{"rhs", {0, quantity("981*(1+x)", "cm/s^2")}}}},
                                            {"time", {{"dt", 0.1}}}}));
  EXPECT_NEAR(in_mm.materials.at(1).youngs_modulus, 20000, 1e-9);
  EXPECT_NEAR(in_mm.body_acceleration({0.002, 0}, 0)[1], -9.81 * 3, 1e-12);  // x is in mm
}

TEST_F(PolyfemKeys, QuantitiesOfOtherUnitsAreRefused) {
  const auto with_E = [&](const json& E) {
    return failure(square({{"materials", {{"type", "NeoHookean"}, {"E", E}, {"nu", 0.3}}}}));
  };
  EXPECT_EQ(with_E(quantity(20, "mm")).place, "/materials/E");
  EXPECT_EQ(with_E(quantity(20, "mm")).expected, "a unit of Pa");
  EXPECT_EQ(with_E(quantity(20, "parsec")).place, "/materials/E");
  EXPECT_EQ(with_E(quantity(20, "N/m^")).place, "/materials/E");
  EXPECT_EQ(with_E(quantity(20, "N/")).place, "/materials/E");
}

TEST_F(PolyfemKeys, SelectionsStandInFiles) {
  write("facets.txt", "3 0 1\n\n4 2 3\n");
  write("cells.txt", "5\n7\n");
  write("points.txt", "6 2\n0 1\n");
  json scene =
      square({{"boundary_conditions",
               {{"dirichlet_boundary", json::array({{{"id", 3}, {"value", {0, 0}}}, {{"id", 6}, {"value", {0, 0}}}})},
                {"neumann_boundary", json::array({{{"id", 5}, {"value", {1, 0}}}})}}}});
  scene["geometry"][0]["surface_selection"] = {{"id", "facets.txt"}, {"id_offset", 1}};
  scene["geometry"][0]["volume_selection"] = "cells.txt";
  scene["geometry"][0]["point_selection"] = "points.txt";
  scene["materials"][0]["id"] = {5, 7};
  scene["boundary_conditions"]["dirichlet_boundary"][0]["id"] = 4;
  const Scene read = read_scene(scene);
  const itr::Setup<2>& setup = std::get<itr::Setup<2>>(read.setup);
  EXPECT_EQ(setup.materials.size(), 2u);
  std::multiset<int> tags;
  for (FacetId f = 0; f < setup.mesh.num_facets(); ++f) tags.insert(setup.mesh.facet_tag(f));
  EXPECT_EQ(tags, (std::multiset<int>{4, 5, kNoTag, kNoTag}));
  EXPECT_EQ(setup.mesh.vertex_tag(2), 6);
  EXPECT_NE(read.identity.find("facets.txt"), std::string::npos);
  const auto refused = [&](const std::string& text) {
    write("facets.txt", text);
    return failure(scene).place;
  };
  const std::string place = "/geometry/0/surface_selection/id";
  EXPECT_EQ(refused("3\n"), place);        // facets have no order
  EXPECT_EQ(refused("3 0 9\n"), place);    // no such vertex
  EXPECT_EQ(refused("3 0 1 2\n"), place);  // too many
  EXPECT_EQ(refused("x 0 1\n"), place);
  EXPECT_EQ(refused("2147483646 0 1\n"), place);  // with id_offset
  EXPECT_EQ(refused("3 0 1\n4 1 3\n"), place);    // of no facet of a cell
  EXPECT_NE(failure(scene).found.find("\"4 1 3\" in line 2"), std::string::npos) << failure(scene).found;
  write("facets.txt", "3 0 1\n3 0 2\n4 2 3\n");  // between two cells: no error, and no tag
  EXPECT_EQ(read2(scene).dirichlet.size(), 2u);
  write("cells.txt", "5\n");
  EXPECT_EQ(failure(scene).place, "/geometry/0/volume_selection");
  scene["geometry"][0]["volume_selection"] = {{"id", "no_such.txt"}, {"id_offset", 1}};
  EXPECT_NE(failure(scene).found.find("there is no file"), std::string::npos) << failure(scene).found;
}

TEST_F(PolyfemKeys, BodiesHaveForcesOfTheirOwn) {
  json scene = square();
  scene["geometry"].push_back(
      {{"mesh", "square.obj"}, {"volume_selection", 2}, {"transformation", {{"translation", {3, 0}}}}});
  scene["materials"][0]["id"] = {1, 2};
  scene["boundary_conditions"]["rhs"] = json::array({{{"id", 1}, {"value", {0, 9}}}, {{"id", 2}, {"value", {"t", 0}}}});
  const itr::Setup<2> setup = read2(scene);
  const auto at = [&](const Vec<2>& X, CellId c, double t) {
    return setup.body_acceleration({X, Vec<2>(0, 0), setup.mesh.part(c)}, t);
  };
  EXPECT_EQ(at({0.5, 0.5}, 0, 1), Vec<2>(0, -9));
  EXPECT_EQ(at({3.5, 0.5}, 2, 2), Vec<2>(-2, 0));
  scene["boundary_conditions"]["rhs"].erase(1);
  EXPECT_EQ(read2(scene).body_acceleration({Vec<2>(3, 0), Vec<2>(0, 0), setup.mesh.part(2)}, 1), Vec<2>(0, 0));
  const auto refused = [&](const json& entry) {
    json wrong = scene;
    wrong["boundary_conditions"]["rhs"].push_back(entry);
    return failure(wrong).place;
  };
  EXPECT_EQ(refused({{"id", 2}, {"value", {0, 9}}, {"interpolation", 3}}), "/boundary_conditions/rhs/1/interpolation");
  EXPECT_EQ(refused(9), "/boundary_conditions/rhs/1");
  // Bodies that share vertices are one part.
  scene["geometry"] = json::array(
      {{{"mesh", "square.obj"}, {"volume_selection", json::array({{{"id", 1}, {"axis", "x"}, {"position", 0.5}}, 2})}}});
  EXPECT_EQ(failure(scene).place, "/boundary_conditions/rhs/0/id");
}

template <int Dim>
VectorX solve(itr::Setup<Dim> setup) {
  linear::Registry registry;
  Simulation<Dim> simulation(std::move(setup), registry);
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
  }
  return simulation.positions();
}

/// A bar of unit section that is held on rollers: u = F L / (E A) by a force on its end, in whatever form.
TEST_F(PolyfemKeys, ForcesOnVerticesAndAlongNormalsStretchABar) {
  json scene =
      square({{"materials", {{"type", "LinearElasticity"}, {"E", 1000}, {"nu", 0}, {"rho", 1}}}, {"time", nullptr}});
  scene["geometry"][0]["surface_selection"] = {{"threshold", 1e-6}};
  scene["geometry"][0]["point_selection"] = json::array({{{"id", 9}, {"axis", "x"}, {"position", 0.999}}});
  json& conditions = scene["boundary_conditions"];
  conditions["dirichlet_boundary"] = json::array({{{"id", 1}, {"value", {0, 0}}, {"dimension", {true, false}}},
                                                  {{"id", 2}, {"value", {0, 0}}, {"dimension", {false, true}}}});
  conditions["nodal_neumann_boundary"] = json::array({{{"id", 9}, {"value", {"5 * (1 + 0 * y)", 0}}}});
  const VectorX by_points = solve(read2(scene));
  EXPECT_NEAR(by_points[2 * 1], 1.01, 1e-9);
  EXPECT_NEAR(by_points[2 * 2], 1.01, 1e-9);
  conditions.erase("nodal_neumann_boundary");
  conditions["normal_aligned_neumann_boundary"] = json::array({{{"id", 3}, {"value", 10}}});
  EXPECT_LE((solve(read2(scene)) - by_points).norm(), 1e-9);
  scene["time"] = {{"dt", 1}, {"tend", 1}, {"quasistatic", true}};
  EXPECT_EQ(failure(scene).place, "/boundary_conditions/normal_aligned_neumann_boundary/0");
  conditions.erase("normal_aligned_neumann_boundary");
  conditions["nodal_neumann_boundary"] = json::array({{{"id", 3}, {"value", {1, 0}}}});
  EXPECT_EQ(failure(scene).place, "/boundary_conditions/nodal_neumann_boundary/0/id");
  EXPECT_EQ(failure(scene).expected, "the id of a point_selection: 9");
  conditions.erase("nodal_neumann_boundary");
  conditions["pressure_cavity"] = {{"id", 9}, {"value", 1}};
  EXPECT_EQ(failure(scene).expected, "the id of one: 1, 2, 3, 4");
}

TEST_F(PolyfemKeys, OrthotropicMaterialsHaveTheModuliOfTheirAxes) {
  const auto stiffness = [&](const json& values, const char* defaults) {
    json scene = cube();
    scene["materials"] = values;
    scene["defaults"] = defaults;
    return [material = read3(scene).materials.at(1)](const Mat<3>& e) {
      return elastic_stress<3>(Mat<3>(Mat<3>::Identity() + e), elastic_moduli<3>(material, Vec<3>(Vec<3>::Zero())));
    };
  };
  json material = {
      {"type", "HookeLinearElasticity"}, {"rho", 1}, {"elasticity_tensor", {20, 10, 5, 0.3, 0.2, 0.25, 3, 4, 6}}};
  const auto own = stiffness(material, "itr"), peer = stiffness(material, "polyfem");
  // The strain of a pull of 1 along x, by the compliance.
  const Mat<3> pull = Vec<3>(1 / 20., -0.3 / 20, -0.2 / 20).asDiagonal();
  EXPECT_LE((own(pull) - Mat<3>(Vec<3>(1, 0, 0).asDiagonal())).norm(), 1e-12);
  Mat<3> shear = Mat<3>::Zero();
  shear(0, 1) = shear(1, 0) = 0.005;
  EXPECT_NEAR(own(shear)(0, 1), 6 * 0.01, 1e-12);
  EXPECT_NEAR(peer(shear)(0, 1), 12 * 0.01, 1e-12);  // PolyFEM takes shear moduli twice
  // With axes that are turned by a quarter turn about z, the stiff direction is y.
  material["fiber_direction"] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}};
  const Mat<3> along_y = Vec<3>(-0.3 / 20, 1 / 20., -0.2 / 20).asDiagonal();
  EXPECT_LE((stiffness(material, "itr")(along_y) - Mat<3>(Vec<3>(0, 1, 0).asDiagonal())).norm(), 1e-12);
  const auto refused = [&](const char* key, const json& value) {
    json wrong = material;
    wrong[key] = value;
    json scene = cube();
    scene["materials"] = wrong;
    return failure(scene).place;
  };
  EXPECT_EQ(refused("elasticity_tensor", {1, 2, 3}), "/materials/elasticity_tensor");
  EXPECT_EQ(refused("elasticity_tensor", {20, 10, 5, 0.3, 0.2, 2.5, 3, 4, 6}), "/materials/elasticity_tensor");
  EXPECT_EQ(refused("fiber_direction", {{1, 1, 0}, {1, 0, 0}, {0, 0, 1}}), "/materials/fiber_direction");
  EXPECT_EQ(refused("E", 3), "/materials/E");
}

TEST_F(PolyfemKeys, ActivationIsAFunctionOfPlaceAndTime) {
  const json active = {{"type", "ActiveFiber"}, {"Tmax", 12}, {"activation", "0.5 + x + t"}, {"fiber_direction", {0, 1, 0}}};
  const json matrix = {{"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.3}};
  json scene = cube();
  scene["materials"] = {{"type", "MaterialSum"}, {"models", {matrix, active}}};
  const Material material = read3(scene).materials.at(1);
  ASSERT_TRUE(material.own_at);
  const auto stress = [&](double t, double x) {
    Material now = material;
    now.own = material.own_at(t);
    return elastic_stress<3>(Mat<3>(Mat<3>::Identity()), elastic_moduli<3>(now, Vec<3>(x, 0, 0)))(1, 1);
  };
  // x = a : C J^(-2/3) - 1 has the gradient 2 (1 - 1/3) along the fibre.
  EXPECT_NEAR(stress(0, 0), -0.5 * 12 / 2 * 4 / 3, 1e-12);
  EXPECT_NEAR(stress(0.2, 0.1), -0.8 * 12 / 2 * 4 / 3, 1e-12);
  EXPECT_THROW(stress(0.6, 0), InputError);
}

TEST_F(PolyfemKeys, AdhesionAndRegularizationAreRead) {
  const json contact = {{"enabled", true},
                        {"adhesion",
                         {{"adhesion_enabled", true},
                          {"dhat_p", 0.02},
                          {"dhat_a", 0.03},
                          {"adhesion_strength", 0.5},
                          {"tangential_adhesion_coefficient", 0.3},
                          {"epsa", 0.01}}}};
  const itr::Setup<2> setup =
      read2(square({{"contact", contact}, {"solver", {{"contact", {{"tangential_adhesion_iterations", 3}}}}}}));
  const AdhesionOptions& adhesion = setup.contact.adhesion;
  EXPECT_EQ(adhesion.peak, 0.02);
  EXPECT_EQ(adhesion.reach, 0.03);
  EXPECT_EQ(adhesion.strength, 0.5);
  EXPECT_EQ(adhesion.tangential_coefficient, 0.3);
  EXPECT_EQ(adhesion.velocity, 0.01);
  EXPECT_EQ(adhesion.iterations, 3);
  json wrong = contact;
  wrong["adhesion"]["dhat_a"] = 0.01;
  EXPECT_EQ(wrong_place({{"contact", wrong}}), "/contact/adhesion/dhat_a");
  wrong["adhesion"]["adhesion_enabled"] = false;
  EXPECT_FALSE(read2(square({{"contact", wrong}})).contact.has_adhesion());
  const json advanced = {
      {"lagged_regularization_weight", 10}, {"lagged_regularization_iterations", 2}, {"check_inversion", "Conservative"}};
  const LaggedRegularization regularization =
      read2(square({{"solver", {{"advanced", advanced}}}, {"time", nullptr}})).lagged_regularization;
  EXPECT_EQ(regularization.weight, 10);
  EXPECT_EQ(regularization.rounds, 2);
  EXPECT_EQ(read_scene(square({{"solver", {{"advanced", advanced}}}})).warnings.size(), 1u);  // with /time it does nothing
}

/// Without friction and other rounds the term stays: a spring of its weight at each vertex.
TEST_F(PolyfemKeys, RegularizationHoldsVerticesWhereNoRoundFollows) {
  json scene = square({{"materials", {{"type", "LinearElasticity"}, {"E", 1e9}, {"nu", 0}, {"rho", 2}}}, {"time", nullptr}});
  scene["boundary_conditions"]["rhs"] = {0, 8};
  scene["solver"]["advanced"]["lagged_regularization_weight"] = 10;
  const VectorX x = solve(read2(scene));
  EXPECT_NEAR(x[1], -2 * 8. / (4 * 10), 1e-6);                          // the weight of the square on four springs
  scene["solver"]["advanced"]["lagged_regularization_iterations"] = 3;  // each about the end of the one before
  EXPECT_NEAR(solve(read2(scene))[1], 3 * x[1], 1e-6);
}

TEST_F(PolyfemKeys, PythonGivesValues) {
  write(
      "values.py",
      "import math\ndef left(x, y, z, t, index):\n    return 0.25 * t + y\ndef short(x, y, z, t):\n    return math.cos(x)\n"
      "def broken(x, y, z, t):\n    return 1 / 0\n");
  const auto python = [](const char* name) { return json{{"file_name", "values.py"}, {"function_name", name}}; };
  json scene = square();
  scene["geometry"][0]["surface_selection"] = {{"threshold", 1e-6}};
  json& condition = scene["boundary_conditions"]["dirichlet_boundary"];
  condition = json::array({{{"id", 1}, {"value", {python("left"), python("short")}}}});
  const Scene read = read_scene(scene);
  const auto& held = std::get<itr::Setup<2>>(read.setup).dirichlet.at(0);
  const Vec<2> value = held.displacement(Vec<2>(0.3, 0.7), 0.1);
  EXPECT_EQ(value[0], 0.25 * 0.1 + 0.7);
  EXPECT_EQ(value[1], std::cos(0.3));
  EXPECT_NE(read.identity.find("file_name"), std::string::npos);
  scene["boundary_conditions"]["rhs"] = {python("left"), 0};
  EXPECT_EQ(read2(scene).body_acceleration({Vec<2>(0.3, 0.7), Vec<2>(0, 0), 0}, 0.1), Vec<2>(-value[0], 0));
  const std::string place = "/boundary_conditions/dirichlet_boundary/0/value/0";
  condition[0]["value"][0] = python("broken");
  EXPECT_NE(failure(scene).found.find("ZeroDivisionError"), std::string::npos);
  EXPECT_EQ(failure(scene).place, place);
  condition[0]["value"][0] = python("no_such");
  EXPECT_EQ(failure(scene).place, place);
  condition[0]["value"][0] = {{"file_name", "no_such.py"}, {"function_name", "left"}};
  EXPECT_EQ(failure(scene).place, place + "/file_name");
}

TEST_F(PolyfemKeys, PresetProblemHoldsItsFieldAndTheForcesOfIt) {
  json scene = cube({{"preset_problem", {{"type", "ElasticExact"}}}, {"materials", {{"type", "LinearElasticity"}}}});
  scene["geometry"][0]["surface_selection"] = 1;
  const itr::Setup<3> setup = read3(scene);
  ASSERT_EQ(setup.dirichlet.size(), 1u);
  const Vec<3> u = setup.dirichlet[0].displacement(Vec<3>(1, 2, 3), 1);
  EXPECT_NEAR(u[0], (2 + 1 + 8 + 18) / 80., 1e-15);
  EXPECT_NEAR(u[1], (3 - 27 + 4 + 3) / 80., 1e-15);
  EXPECT_NEAR(u[2], (6 + 36 - 2) / 80., 1e-15);
  const Material& material = setup.materials.at(1);
  constexpr double h = 1e-3;
  Vec<3> expected = Vec<3>::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const auto at = [&](double a, double b) {
        return setup.dirichlet[0].displacement(Vec<3>(Vec<3>(1, 2, 3) + a * h * Vec<3>::Unit(i) + b * h * Vec<3>::Unit(j)),
                                               1);
      };
      const Vec<3> second = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h * h);
      expected[i] -= (material.lame_lambda(3) + material.lame_mu()) * second[j];
      if (i == j) expected -= material.lame_mu() * second;
    }
  EXPECT_LE((setup.body_acceleration(Vec<3>(1, 2, 3), 1) - expected).norm(), 1e-6 * expected.norm());
  scene["boundary_conditions"]["rhs"] = {0, 1, 0};
  EXPECT_EQ(failure(scene).place, "/preset_problem");
}

}  // namespace
}  // namespace scene
}  // namespace itr
