// SPDX-License-Identifier: MIT
// Viscoelasticity by Prony series: derivatives, relaxation, cycles, energy, rotations, statics, and the state on other
// meshes.
#include "energy/viscous.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "advance.hpp"
#include "derivatives.hpp"
#include "driven.hpp"
#include "energy/elastic/law_sum.hpp"
#include "itr/solver.hpp"
#include "mesh/refine.hpp"
#include "random_cube.hpp"
#include "random_mesh.hpp"
#include "scene_folder.hpp"
#include "simulation/cell_stress.hpp"
#include "simulation_scenes.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

constexpr double kPi = std::numbers::pi;
const std::vector<PronyTerm> kSeries = {{0.3, 0.2}, {0.4, 1.5}};

double relaxation(double t) {
  double share = 1;
  for (const PronyTerm& term : kSeries) share -= term.g * -std::expm1(-t / term.tau);
  return share;
}

/// All laws that can be viscoelastic.
template <int Dim>
std::vector<Material> viscous_laws() {
  std::vector<Material> laws;
  for (const MaterialLaw law :
       {MaterialLaw::neo_hookean, MaterialLaw::linear, MaterialLaw::saint_venant_kirchhoff, MaterialLaw::fixed_corotated})
    laws.push_back({.law = law, .youngs_modulus = 100, .poisson_ratio = 0.3, .density = 1, .plane_strain = Dim == 2});
  if (Dim == 3)
    laws.push_back({.law = MaterialLaw::mooney_rivlin,
                    .youngs_modulus = 100,
                    .poisson_ratio = 0.4,
                    .mooney_rivlin = {.c1 = 12, .c2 = 5, .c3 = 1, .volume_d = 80}});
  for (const LawSum& sum : sums_of_all_laws<Dim>()) laws.push_back(material_of(sum, Dim));
  std::erase_if(laws, [](const Material& law) { return !why_not_viscous(law, Dim).empty(); });
  for (Material& law : laws) law.prony = kSeries;
  return laws;
}

/// Stress of the law with other moduli of shape.
template <int Dim>
Mat<Dim> stress_of(Material material, double deviator, const Mat<Dim>& F) {
  material.deviator = deviator;
  return elastic_stress<Dim>(F, elastic_moduli<Dim>(material, Vec<Dim>::Zero())) * F.transpose() / F.determinant();
}

TEST(Viscous, DeviatorScalesModuliOfShapeAlone) {
  Material material{.youngs_modulus = 100, .poisson_ratio = 0.3};
  const double mu = material.lame_mu(), bulk = material.lame_lambda(3) + 2 * mu / 3;
  material.deviator = 0.4;
  const LameParameters lame = elastic_moduli<3>(material, Vec<3>::Zero()).lame;
  EXPECT_NEAR(lame.mu, 0.4 * mu, 1e-12);
  EXPECT_NEAR(lame.lambda + 2 * lame.mu / 3, bulk, 1e-12);
  Mat<3> E;
  E << 2, 1, -1, 1, 3, 0.5, -1, 0.5, -4;
  for (Material& law : viscous_laws<3>()) {
    const ElasticModuli whole = elastic_moduli<3>(law, Vec<3>::Zero());
    constexpr double kSmall = 1e-7;
    const auto response = [&](double deviator) {
      return Mat<3>(stress_of<3>(law, deviator, Mat<3>::Identity() + kSmall * E));
    };
    const Mat<3> at_1 = response(1), at_04 = response(0.4);
    EXPECT_NEAR(at_1.trace(), at_04.trace(), 1e-5 * at_1.norm()) << name_of(law);
    const auto deviator = [](const Mat<3>& s) { return Mat<3>(s - s.trace() / 3 * Mat<3>::Identity()); };
    EXPECT_LE((0.4 * deviator(at_1) - deviator(at_04)).norm(), 1e-5 * at_1.norm()) << name_of(law);
    // Only the part of shape is scaled, at any strain.
    const Mat<3> F = sheared<3>();
    const double part = elastic_density<3>(F, shape_part(whole));
    law.deviator = 0.4;
    EXPECT_NEAR(elastic_density<3>(F, whole) - elastic_density<3>(F, elastic_moduli<3>(law, Vec<3>::Zero())), 0.6 * part,
                1e-11 * std::abs(part))
        << name_of(law);
  }
}

TEST(Viscous, PastHasDerivatives) {
  Mat<3> H;
  H << 2, 1, -1, 1, 3, 0.5, -1, 0.5, -4;
  const Mat<3> F = sheared<3>();
  constexpr double kStep = 1e-6;
  for (const ShapeMeasure measure : {ShapeMeasure::isochoric, ShapeMeasure::whole, ShapeMeasure::small}) {
    const Mat<3> P = past_stress(measure, F - Mat<3>::Identity(), H);
    const Mat<9> hessian = past_hessian(measure, F, H);
    for (int k = 0; k < 9; ++k) {
      Mat<3> plus = F - Mat<3>::Identity(), minus = plus;
      plus(k) += kStep;
      minus(k) -= kStep;
      EXPECT_NEAR((past_density(measure, plus, H) - past_density(measure, minus, H)) / (2 * kStep), P(k), 1e-8);
      const Mat<3> column = (past_stress(measure, plus, H) - past_stress(measure, minus, H)) / (2 * kStep);
      EXPECT_LE((hessian.col(k) - Eigen::Map<const Vec<9>>(column.data())).norm(), 1e-7);
    }
  }
}

/// The state of a body that has relaxed from a random motion.
template <int Dim>
std::shared_ptr<const CellField<Dim>> relaxed_field(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                    const VectorX& x) {
  const auto start = std::dynamic_pointer_cast<const CellField<Dim>>(begin_viscous<Dim>(mesh, materials, x, 0));
  const auto end = ViscousStep<Dim>(start, materials, 0.3).end(mesh, x, 0.3);
  EXPECT_GT(end.dissipation, 0);
  return std::dynamic_pointer_cast<const CellField<Dim>>(end.state);
}

template <int Dim>
void expect_energy_with_derivatives(Mesh<Dim> mesh, Material material) {
  std::mt19937 random(5);
  const std::map<int, Material> materials = {{1, material}, {2, material}};
  const VectorX before = moved(mesh, 0.02, random), x = moved(mesh, 0.02, random);
  const auto step = std::make_shared<ViscousStep<Dim>>(relaxed_field(mesh, materials, before), materials, 0.1);
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const ViscousEnergy<Dim> energy("viscous", cells, *step, 0.7, kElasticDegree);
  expect_derivatives(energy, x, 1e-6, 1e-6);
  expect_psd(energy, x);
}

TEST(Viscous, EnergyOfBodiesThatGrowHasDerivatives) {
  const auto growing = [](Material material) {
    material.eigenstrain_varies = true;
    material.eigenstrain = [](const Vec<3>& X, double) {
      Mat<3> strain = 0.1 * Mat<3>::Identity();
      strain(0, 1) = strain(1, 0) = 0.1 * X[0];
      return strain;
    };
    return material;
  };
  for (const int law : {0, 1, 4}) {
    Mesh<2> square = make_square(2, 1);
    expect_energy_with_derivatives(square, growing(viscous_laws<2>()[law]));
    square.set_curved_edges(square.edges());
    square.set_axisymmetric(true);
    expect_energy_with_derivatives(square, growing(viscous_laws<3>()[law]));
    expect_energy_with_derivatives(body<3>(1), growing(viscous_laws<3>()[law]));
  }
}

TEST(Viscous, EnergyHasDerivativesOnAllCells) {
  for (const int law : {0, 1, 4}) {
    Mesh<2> square = make_square(2, 1);
    expect_energy_with_derivatives(square, viscous_laws<2>()[law]);
    square.set_curved_edges(square.edges());
    expect_energy_with_derivatives(square, viscous_laws<2>()[law]);
    square.set_axisymmetric(true);
    expect_energy_with_derivatives(square, viscous_laws<3>()[law]);
    Mesh<3> cube = body<3>(1);
    expect_energy_with_derivatives(cube, viscous_laws<3>()[law]);
    cube.set_curved_edges(cube.edges());
    expect_energy_with_derivatives(cube, viscous_laws<3>()[law]);
  }
}

/// After a strain at t = 0 stresses of shape follow the series exactly, whatever the length of steps.
template <int Dim>
void expect_relaxation(const Material& material, int order) {
  const Mat<Dim> F = sheared<Dim>();
  linear::Registry registry;
  Simulation<Dim> simulation(driven<Dim>(
                                 material, [F](double) { return F; }, 0.35, 4, order),
                             registry);
  const double size = stress_of<Dim>(material, 1, F).norm();
  EXPECT_LE((stress_in(simulation) - stress_of<Dim>(material, 1, F)).norm(), 1e-9 * size) << name_of(material);
  for (int k = 1; k <= 4; ++k) {
    const StepReport report = advance(simulation).report;
    EXPECT_GT(report.viscous_dissipation, 0);
    EXPECT_LE((stress_in(simulation) - stress_of<Dim>(material, relaxation(0.35 * k), F)).norm(), 1e-8 * size)
        << name_of(material) << ", order " << order << ", step " << k;
  }
}

TEST(Viscous, StepOfStrainRelaxesAsTheSeries) {
  for (const Material& material : viscous_laws<2>()) expect_relaxation<2>(material, 1);
  for (const Material& material : viscous_laws<3>()) expect_relaxation<3>(material, 1);
  expect_relaxation<2>(viscous_laws<2>()[4], 2);
  expect_relaxation<3>(viscous_laws<3>()[5], 2);
}

/// A stretch that keeps the volume, of axes that turn.
template <int Dim>
Mat<Dim> stretched(double t) {
  Mat<Dim> stretch = Mat<Dim>::Identity(), turn = Mat<Dim>::Identity();
  stretch(0, 0) = std::exp(0.3 * std::sin(t));
  stretch(1, 1) = 1 / stretch(0, 0);
  turn.template topLeftCorner<2, 2>() = Eigen::Rotation2Dd(0.4 * t).toRotationMatrix();
  return turn * stretch * turn.transpose();
}

/// The law sees the strain beyond the eigenstrain, past and present: a body that is held while it grows is as one that does
/// not grow and moves the other way.
template <int Dim>
void expect_growth_to_be_as_motion(Material material) {
  const bool is_small = material.law == MaterialLaw::linear;
  linear::Registry registry;
  Simulation<Dim> moving(driven<Dim>(material, stretched<Dim>, 0.35, 5), registry);
  material.eigenstrain = [is_small](const Vec<3>&, double t) {
    Mat<3> F = Mat<3>::Identity();
    F.topLeftCorner<Dim, Dim>() = stretched<Dim>(t);
    const Mat<3> strain = is_small ? Mat<3>(Mat<3>::Identity() - F) : Mat<3>(F.inverse() - Mat<3>::Identity());
    return Mat<3>((strain + strain.transpose()) / 2);
  };
  Simulation<Dim> held(driven<Dim>(
                           material, [](double) { return Mat<Dim>(Mat<Dim>::Identity()); }, 0.35, 5),
                       registry);
  const double modulus = material.lame_mu();
  for (int k = 1; k <= 5; ++k) {
    const StepReport one = advance(moving).report, other = advance(held).report;
    const Mat<Dim> F = stretched<Dim>(0.35 * k);
    const Mat<Dim> expected =
        is_small ? Mat<Dim>(stress_in(moving) * F.determinant() * F.inverse().transpose()) : stress_in(moving);  // P
    EXPECT_LE((stress_in(held) - expected).norm(), 1e-7 * modulus) << name_of(material) << ", step " << k;
    EXPECT_NEAR(other.energy.elastic, one.energy.elastic, 1e-8 * modulus) << name_of(material) << ", step " << k;
    EXPECT_NEAR(other.viscous_dissipation, one.viscous_dissipation, 1e-8 * modulus) << name_of(material) << ", step " << k;
    EXPECT_GT(other.viscous_dissipation, 1e-6 * modulus);
  }
}

TEST(Viscous, BodiesThatGrowAreAsBodiesThatMove) {
  for (const Material& material : viscous_laws<2>()) expect_growth_to_be_as_motion<2>(material);
  for (const Material& material : viscous_laws<3>()) expect_growth_to_be_as_motion<3>(material);
}

/// Expects that a body which grows freely has no stress and no past, whether it grows at once or by and by.
template <int Dim>
void expect_free_growth(Material material, bool at_once) {
  material.eigenstrain = [at_once](const Vec<3>&, double t) {
    Mat<3> strain = Mat<3>::Zero();
    strain.diagonal() << 0.2, -0.05, Dim == 3 ? 0.1 : 0;
    strain(0, 1) = strain(1, 0) = 0.03;
    return Mat<3>((at_once ? 1 : std::sin(t)) * strain);
  };
  Setup<Dim> setup = driven<Dim>(material, {}, 0.35, 4);
  setup.dirichlet.clear();
  setup.initial_displacement.clear();
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  for (int k = 1; k <= 4; ++k) {
    const StepReport report = advance(simulation).report;
    EXPECT_LE(stress_in(simulation).norm(), 1e-7 * material.lame_mu()) << name_of(material) << ", step " << k;
    EXPECT_NEAR(report.viscous_dissipation, 0, 1e-10 * material.lame_mu()) << name_of(material) << ", step " << k;
  }
}

TEST(Viscous, FreeGrowthHasNoStressAndNoPast) {
  for (const bool at_once : {true, false}) {
    for (const Material& material : viscous_laws<2>()) expect_free_growth<2>(material, at_once);
    for (const Material& material : viscous_laws<3>()) expect_free_growth<3>(material, at_once);
  }
}

/// All that a step of strain stores in the terms is dissipated in the end.
TEST(Viscous, RelaxationDissipatesWhatItStored) {
  for (const Material& material : viscous_laws<3>()) {
    const Mat<3> F = sheared<3>();
    linear::Registry registry;
    Simulation<3> simulation(driven<3>(
                                 material, [F](double) { return F; }, 2, 20),
                             registry);
    double energy = simulation.report().energy.elastic, dissipated = 0;
    const double at_once = energy, part = elastic_density<3>(F, shape_part(elastic_moduli<3>(material, Vec<3>::Zero())));
    for (int k = 0; k < 20; ++k) {
      const StepReport report = advance(simulation).report;
      dissipated += report.viscous_dissipation;
      EXPECT_NEAR(report.energy.elastic + report.viscous_dissipation, energy, 1e-9 * at_once) << name_of(material);
      energy = report.energy.elastic;
    }
    EXPECT_NEAR(dissipated, 0.7 * part, 1e-8 * part) << name_of(material);
  }
}

/// Storage and loss modulus, and the energy that a cycle dissipates.
TEST(Viscous, CyclesHaveTheModuliOfTheSeries) {
  constexpr int kSteps = 64;
  constexpr double kShear = 1e-4;
  Material material = viscous_laws<2>()[0];
  const double mu = material.lame_mu();
  for (const double omega : {0.3, 2.0, 12.0}) {
    const double period = 2 * kPi / omega, dt = period / kSteps;
    const int cycles = 2 + static_cast<int>(std::ceil(12 * 1.5 / period));  // until the start is forgotten
    const Motion<2> F = [&](double t) {
      Mat<2> shear = Mat<2>::Identity();
      shear(0, 1) = kShear * std::sin(omega * t);
      return shear;
    };
    linear::Registry registry;
    auto setup = driven<2>(material, F, dt, cycles * kSteps);
    Simulation<2> simulation(setup, registry);
    double storage = 0, loss = 0, dissipated = 0, G1 = 1, G2 = 0;
    for (int k = 1; k <= cycles * kSteps; ++k) {
      const StepReport report = advance(simulation).report;
      EXPECT_GE(report.viscous_dissipation, 0);
      if (k <= (cycles - 1) * kSteps) continue;
      const double stress = stress_in(simulation)(0, 1);
      storage += 2.0 / kSteps * stress * std::sin(omega * k * dt) / kShear;
      loss += 2.0 / kSteps * stress * std::cos(omega * k * dt) / kShear;
      dissipated += report.viscous_dissipation;
    }
    for (const PronyTerm& term : kSeries) {
      const double y = omega * term.tau;
      G1 -= term.g / (1 + y * y);
      G2 += term.g * y / (1 + y * y);
    }
    EXPECT_NEAR(storage, mu * G1, 0.01 * mu * G1) << omega;
    EXPECT_NEAR(loss, mu * G2, 0.01 * mu * G2) << omega;
    EXPECT_NEAR(dissipated, kPi * mu * G2 * kShear * kShear, 0.01 * kPi * mu * G2 * kShear * kShear) << omega;
  }
}

/// Ramps are of second order, and their work is stored or dissipated.
TEST(Viscous, LargeRampsConvergeAndBalance) {
  const Material material = viscous_laws<2>()[4];
  const Motion<2> F = [](double t) {
    Mat<2> strain = Mat<2>::Identity();
    strain(0, 1) = 0.8 * std::sin(2 * t);
    strain(0, 0) = 1 + 0.2 * t;
    return strain;
  };
  std::vector<Mat<2>> stresses;
  double imbalance = 0;
  for (const int steps : {10, 20, 40, 160}) {
    linear::Registry registry;
    Simulation<2> simulation(driven<2>(material, F, 2.0 / steps, steps), registry);
    double work = 0, dissipated = 0;
    const auto nominal = [&](double t) {
      return Mat<2>(F(t).determinant() * stress_in(simulation) * F(t).inverse().transpose());
    };
    Mat<2> before = nominal(0);
    for (int k = 1; k <= steps; ++k) {
      const double t = 2.0 * k / steps;
      dissipated += advance(simulation).report.viscous_dissipation;
      const Mat<2> now = nominal(t);
      work += (before + now).cwiseProduct(F(t) - F(t - 2.0 / steps)).sum() / 2;
      before = now;
    }
    stresses.push_back(stress_in(simulation));
    imbalance = std::abs(work - dissipated - simulation.report().energy.elastic) / work;
  }
  EXPECT_LT(imbalance, 1e-3);
  const double coarse = (stresses[0] - stresses[3]).norm(), middle = (stresses[1] - stresses[3]).norm(),
               fine = (stresses[2] - stresses[3]).norm();
  EXPECT_GT(coarse / middle, 3.5);
  EXPECT_GT(middle / fine, 3.5);
}

/// Turning a body by 90 degrees while it relaxes changes nothing.
TEST(Viscous, RotationsLeaveStateStressAndEnergyAlone) {
  for (const int law : {0, 4}) {
    const Material material = viscous_laws<2>()[law];
    const Mat<2> strain = sheared<2>();
    const auto turn = [](double t) { return Eigen::Rotation2Dd(kPi / 2 * std::min(t, 1.0)).toRotationMatrix(); };
    linear::Registry registry;
    Simulation<2> still(driven<2>(
                            material, [&](double) { return strain; }, 0.1, 12),
                        registry);
    Simulation<2> turned(driven<2>(
                             material, [&](double t) { return Mat<2>(turn(t) * strain); }, 0.1, 12),
                         registry);
    for (int k = 1; k <= 12; ++k) {
      const StepReport a = advance(still).report, b = advance(turned).report;
      EXPECT_NEAR(a.energy.elastic, b.energy.elastic, 1e-9 * a.energy.elastic);
      EXPECT_NEAR(a.viscous_dissipation, b.viscous_dissipation, 1e-9 * a.energy.elastic);
    }
    const Mat<2> R = turn(1), s = stress_in(still);
    EXPECT_LE((R * s * R.transpose() - stress_in(turned)).norm(), 1e-8 * s.norm());
    const auto records = [](const Simulation<2>& simulation) {
      return dynamic_cast<const CellField<2>&>(*simulation.state().history.viscous).by_cell()[0];
    };
    EXPECT_LE((records(still) - records(turned)).norm(), 1e-8 * records(still).norm());
  }
}

/// Statics, and steps that are much longer than all times, have the long-term moduli.
TEST(Viscous, StaticsHaveTheLongTermModuli) {
  Material material = viscous_laws<3>()[0];
  const Mat<3> F = sheared<3>();
  const auto end_of = [&](bool is_static) {
    auto setup = driven<3>(
        material, [F](double) { return F; }, 1e6, 1);
    setup.time.is_static = is_static;
    if (is_static) setup.time.quasistatic = false;
    linear::Registry registry;
    Simulation<3> simulation(setup, registry);
    EXPECT_EQ(advance(simulation).report.viscous_dissipation > 0, !is_static);
    return stress_in(simulation);
  };
  const Mat<3> expected = stress_of<3>(material, 0.3, F);
  EXPECT_LE((end_of(true) - expected).norm(), 1e-9 * expected.norm());
  EXPECT_LE((end_of(false) - expected).norm(), 1e-4 * expected.norm());
  material.deviator = 1 / 0.3;  // as "long_term" has it
  const Mat<3> given = stress_of<3>(material, 1, F);
  EXPECT_LE((end_of(true) - given).norm(), 1e-9 * given.norm());
}

/// A restored simulation repeats its steps.
TEST(Viscous, RestoredStatesRepeatTheirSteps) {
  auto setup = impact();
  setup.materials[1].plane_strain = true;
  setup.materials[1].prony = {{0.5, 0.02}};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  for (int k = 0; k < 3; ++k) advance(simulation);
  const auto saved = simulation.save();
  double first = 0, again = 0;
  for (int k = 0; k < 3; ++k) first += advance(simulation).report.viscous_dissipation;
  const VectorX x = simulation.state().history.x[0];
  simulation.restore(saved);
  for (int k = 0; k < 3; ++k) again += advance(simulation).report.viscous_dissipation;
  EXPECT_EQ(first, again);
  EXPECT_EQ(x, simulation.state().history.x[0]);
}

template <int Dim>
double integral(const Mesh<Dim>& mesh, const CellField<Dim>& field, int record) {
  double sum = 0;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    sum += mesh.volume(c) * field.by_cell()[static_cast<std::size_t>(c)].row(record).mean();
  return sum;
}

/// Children of cells have their state exactly, also where it is linear; other cells its means, with a loss.
TEST(Viscous, StateIsRestrictedToFinerCells) {
  std::mt19937 random(7);
  Mesh<2> mesh = make_square(3, 1);
  mesh.set_curved_edges(mesh.edges());
  const std::map<int, Material> materials = {{1, viscous_laws<2>()[0]}};
  const auto field = relaxed_field(mesh, materials, moved(mesh, 0.03, random));
  const Mesh<2> finer = refine_uniformly(make_square(3, 1));
  const CellSet<2> cells = whole_mesh(finer, {});
  double sum = 0;
  for (const auto& element : cells.elements) {
    VectorX variance;
    const auto records = field->on(cells, element, &variance);
    EXPECT_EQ(variance.size(), 0);
    sum += element.volume * records.row(10).mean();
  }
  EXPECT_NEAR(sum, integral(mesh, *field, 10), 1e-12 * std::abs(sum));
  const Mesh<2> other = make_square(2, 1);
  const CellSet<2> others = whole_mesh(other, {});
  VectorX lost;
  for (const auto& element : others.elements) field->on(others, element, &lost);
  ASSERT_GT(lost.size(), 0);
  EXPECT_GT(lost.segment(8, 6).sum(), 0);
}

/// Edits of a mesh keep what bodies store, but for what they report as lost.
TEST(Viscous, RemeshedBodiesGoOn) {
  Material material = impact().materials.at(1);
  material.plane_strain = true;
  material.prony = {{0.5, 0.05}};
  expect_memory_where_meshes_change(material, &StepReport::viscous_dissipation, &History::viscous);
}

class ViscousScene : public scene::SceneTest {
 protected:
  static scene::json with(const scene::json& prony, bool is_plane_strain = true) {
    return square({{"materials", scene::json::array({{{"id", 1},
                                                      {"type", "NeoHookean"},
                                                      {"E", 1e4},
                                                      {"nu", 0.4},
                                                      {"rho", 1000},
                                                      {"plane_strain", is_plane_strain},
                                                      {"prony", prony}}})}});
  }
};

TEST_F(ViscousScene, ReadsTheSeries) {
  const auto setup = read2(with({{"g", {0.2, 0.3}}, {"tau", {1, 10}}, {"long_term", true}}));
  const Material& material = setup.materials.at(1);
  ASSERT_EQ(material.prony.size(), 2u);
  EXPECT_EQ(material.prony[1].g, 0.3);
  EXPECT_EQ(material.prony[1].tau, 10);
  EXPECT_NEAR(material.deviator, 2, 1e-15);
}

TEST_F(ViscousScene, RefusesWhatIsNoSeries) {
  EXPECT_EQ(failure(with({{"g", {0.2}}, {"tau", {1, 2}}})).place, "/materials/0/prony/tau");
  EXPECT_EQ(failure(with({{"g", {0.7, 0.3}}, {"tau", {1, 2}}})).place, "/materials/0/prony/g");
  EXPECT_EQ(failure(with({{"g", {0.2}}, {"tau", {0}}})).place, "/materials/0/prony/tau/0");
  EXPECT_EQ(failure(with({{"g", {0.2}}})).place, "/materials/0/prony/tau");
  EXPECT_EQ(failure(with({{"g", {0.2}}, {"tau", {1}}}, false)).place, "/materials/0/prony");
}

}  // namespace
}  // namespace itr
