// SPDX-License-Identifier: MIT
// Mullins' softening: its response, derivatives, a cycle in closed form, the balance of energy, and the state in files and
// on other meshes.
#include "energy/softening.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "advance.hpp"
#include "derivatives.hpp"
#include "driven.hpp"
#include "itr/solver.hpp"
#include "mesh/refine.hpp"
#include "output/checkpoint.hpp"
#include "output/frame_file.hpp"
#include "scene_folder.hpp"
#include "simulation_scenes.hpp"
#include "sums_of_laws.hpp"
#include "temporary_path.hpp"

namespace itr {
namespace {

constexpr MullinsSoftening kMullins{1.6, 4, 0.2};

/// All laws that can soften.
template <int Dim>
std::vector<Material> softening_laws() {
  std::vector<Material> laws;
  if (Dim == 3)
    laws.push_back({.law = MaterialLaw::mooney_rivlin,
                    .youngs_modulus = 100,
                    .poisson_ratio = 0.4,
                    .mooney_rivlin = {.c1 = 12, .c2 = 5, .c3 = 1, .volume_d = 80}});
  for (const LawSum& sum : sums_of_all_laws<Dim>()) laws.push_back(material_of(sum, Dim));
  std::erase_if(laws, [](const Material& law) { return !why_not_softening(law, Dim).empty(); });
  for (Material& law : laws) law.mullins = kMullins;
  return laws;
}

TEST(Softening, ResponseIsTheIntegralOfOgdenAndRoxburgh) {
  for (const MullinsSoftening& mullins : {kMullins, MullinsSoftening{2, 5, 0}, MullinsSoftening{1.1, 0, 0.3}}) {
    const double largest = 20;
    const auto eta = [&](double W) {
      return 1 - std::erf((largest - W) / (mullins.m + mullins.beta * largest)) / mullins.r;
    };
    for (const double W : {0.0, 3.0, 12.0, 19.9, 20.0, 25.0}) {
      const SofteningResponse at = softening(mullins, W, largest);
      constexpr int kIntervals = 2000;
      const double width = std::max(largest - W, 0.0) / kIntervals;
      double integral = 0;
      for (int k = 0; k < kIntervals; ++k) integral += width * (1 - eta(W + (k + 0.5) * width));
      EXPECT_NEAR(at.value, integral, 1e-6 * largest);
      EXPECT_NEAR(1 + at.first, W < largest ? eta(W) : 1, 1e-15);
      if (W == largest) continue;  // where the second derivative jumps
      constexpr double kStep = 1e-4;
      const double up = softening(mullins, W + kStep, largest).first, down = softening(mullins, W - kStep, largest).first;
      EXPECT_NEAR(at.second, (up - down) / (2 * kStep), 1e-7);
    }
    EXPECT_EQ(lost_density(mullins, largest).value, softening(mullins, 0, largest).value);
    constexpr double kStep = 1e-4;
    EXPECT_NEAR(lost_density(mullins, largest).slope,
                (lost_density(mullins, largest + kStep).value - lost_density(mullins, largest - kStep).value) / (2 * kStep),
                1e-8);
    EXPECT_EQ(lost_density(mullins, 0).value, 0);
    EXPECT_NEAR(lost_density(mullins, 0).slope, lost_density(mullins, 1e-9).value / 1e-9, 1e-6);
  }
}

/// The state of a body that was once at other positions.
template <int Dim>
std::shared_ptr<const CellField<Dim>> field_after(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                  const VectorX& x) {
  return std::dynamic_pointer_cast<const CellField<Dim>>(begin_softening<Dim>(mesh, materials, x, 0));
}

template <int Dim>
void expect_energy_with_derivatives(const Mesh<Dim>& mesh, const Material& material) {
  std::mt19937 random(5);
  const std::map<int, Material> materials = {{1, material}, {2, material}};
  const VectorX before = moved(mesh, 0.06, random), x = moved(mesh, 0.03, random);
  const auto step = std::make_shared<SofteningStep<Dim>>(field_after(mesh, materials, before), materials);
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const SofteningEnergy<Dim> energy("softening", cells, *step, 0.7, kStateDegree);
  Workspace workspace;
  EXPECT_GT(energy.value(x, workspace), 0);
  expect_derivatives(energy, x, 1e-6, 1e-5);
  expect_psd(energy, x);
}

TEST(Softening, EnergyHasDerivativesOnAllCells) {
  for (const int law : {0, 1, 3}) {
    Mesh<2> square = make_square(2, 1);
    expect_energy_with_derivatives(square, softening_laws<2>()[law]);
    square.set_curved_edges(square.edges());
    expect_energy_with_derivatives(square, softening_laws<2>()[law]);
    square.set_axisymmetric(true);
    expect_energy_with_derivatives(square, softening_laws<3>()[law]);
    Mesh<3> cube = body<3>(1);
    expect_energy_with_derivatives(cube, softening_laws<3>()[law]);
    cube.set_curved_edges(cube.edges());
    expect_energy_with_derivatives(cube, softening_laws<3>()[law]);
  }
}

/// Stress of a law of which the part of shape counts eta times.
template <int Dim>
Mat<Dim> softened_stress(const Material& material, double eta, const Mat<Dim>& F) {
  const ElasticModuli whole = elastic_moduli<3>(material, Vec<3>::Zero());
  Mat<3> G = Mat<3>::Zero();
  G.topLeftCorner<Dim, Dim>() = F - Mat<Dim>::Identity();
  const DisplacementGradient<3> at{G};
  const Mat<3> P = elastic_stress<3>(at, whole) - (1 - eta) * elastic_stress<3>(at, shape_part(whole));
  return P.topLeftCorner<Dim, Dim>() * F.transpose() / F.determinant();
}

template <int Dim>
double shape_density(const Material& material, const Mat<Dim>& F) {
  Mat<3> G = Mat<3>::Zero();
  G.topLeftCorner<Dim, Dim>() = F - Mat<Dim>::Identity();
  return elastic_density<3>(DisplacementGradient<3>{G}, shape_part(elastic_moduli<3>(material, Vec<3>::Zero())));
}

/// Stretch along x by a share of `most`, while the volume stays (2D: with the width).
template <int Dim>
Mat<Dim> stretched(double most, double share) {
  Mat<Dim> F = Mat<Dim>::Identity();
  const double stretch = 1 + (most - 1) * share;
  F(0, 0) = stretch;
  for (int k = 1; k < Dim; ++k) F(k, k) = std::pow(stretch, -1.0 / (Dim - 1));
  return F;
}

/// Loads, unloads, loads again, and farther. Virgin stress where no stretch was larger, eta times that of shape elsewhere;
/// the work that is not stored is lost once, by the closed form.
template <int Dim>
void expect_cycle(const Material& material, int order) {
  const std::vector<double> shares = {0.25, 0.6, 1, 0.8, 0.3, 0, 0.5, 1, 1.3, 0.1};
  const auto share = [&](double t) { return t < 0.5 ? 0 : shares.at(static_cast<std::size_t>(std::lround(t)) - 1); };
  linear::Registry registry;
  Simulation<Dim> simulation(
      driven<Dim>(
          material, [&](double t) { return stretched<Dim>(1.7, share(t)); }, 1, static_cast<int>(shares.size()), order),
      registry);
  double largest = 0, lost = 0;
  for (std::size_t k = 0; k < shares.size(); ++k) {
    const StepReport report = advance(simulation).report;
    const Mat<Dim> F = stretched<Dim>(1.7, shares[k]);
    const double W = shape_density<Dim>(material, F);
    const bool is_virgin = W > largest * (1 - 1e-12);
    const MullinsSoftening& m = *material.mullins;
    const double eta = is_virgin ? 1 : 1 - std::erf((largest - W) / (m.m + m.beta * largest)) / m.r;
    if (is_virgin) largest = std::max(largest, W);
    const Mat<Dim> expected = softened_stress<Dim>(material, eta, F);
    EXPECT_LE((stress_in(simulation) - expected).norm(), 1e-8 * (expected.norm() + material.youngs_modulus * 1e-3))
        << name_of(material) << ", step " << k;
    const double lost_now = lost_density(m, largest).value;  // the body has a volume of 1
    EXPECT_NEAR(report.softening, lost_now - lost, 1e-9 * largest) << name_of(material) << ", step " << k;
    lost = lost_now;
    const double whole =
        elastic_density<Dim>(F, elastic_moduli<Dim>(material, Vec<Dim>::Zero())) -
        elastic_density<Dim>(Mat<Dim>(Mat<Dim>::Identity()), elastic_moduli<Dim>(material, Vec<Dim>::Zero()));
    EXPECT_NEAR(report.energy.elastic, whole + softening(m, W, largest).value - lost, 1e-9 * largest)
        << name_of(material) << ", step " << k;
  }
}

TEST(Softening, CyclesFollowTheClosedForm) {
  for (const Material& material : softening_laws<2>()) expect_cycle<2>(material, 1);
  for (const Material& material : softening_laws<3>()) expect_cycle<3>(material, 1);
  expect_cycle<2>(softening_laws<2>()[1], 2);
  expect_cycle<3>(softening_laws<3>()[1], 2);
}

/// The work on a body that is sheared to and fro is stored or lost.
TEST(Softening, WorkIsStoredOrLost) {
  const Motion<2> F = [](double t) {
    Mat<2> shear = Mat<2>::Identity();
    shear(0, 1) = 0.8 * (1 + 0.3 * t) * std::sin(2 * t);
    return shear;
  };
  std::vector<double> imbalance;
  for (const int steps : {60, 240}) {
    const double dt = 3.0 / steps;
    linear::Registry registry;
    Simulation<2> simulation(driven<2>(softening_laws<2>()[0], F, dt, steps), registry);
    const auto nominal = [&](double t) {
      return Mat<2>(F(t).determinant() * stress_in(simulation) * F(t).inverse().transpose());
    };
    Mat<2> before = nominal(0);
    double work = 0, lost = 0;
    for (int k = 1; k <= steps; ++k) {
      lost += advance(simulation).report.softening;
      const Mat<2> now = nominal(k * dt);
      work += (before + now).cwiseProduct(F(k * dt) - F((k - 1) * dt)).sum() / 2;
      before = now;
    }
    EXPECT_GT(lost, 0.05 * work);
    imbalance.push_back(std::abs(work - lost - simulation.report().energy.elastic) / lost);
  }
  EXPECT_LT(imbalance[1], 1e-3);
  EXPECT_LT(imbalance[1], imbalance[0] / 4);
}

/// Stiff enough for impact().
Material rubber() {
  LawSum sum;
  for (const LawRow& row : law_rows())
    if (std::string(row.type) == "Yeoh") sum.terms.push_back({&row, {{1.8e3, 100}, {1.7e4}}});
  Material material = material_of(sum, 2);
  material.density = 1000;
  material.mullins = {1.6, 50, 0.2};
  return material;
}

/// A simulation that goes on from a file does the same steps to the last bit.
TEST(Softening, FilesKeepTheState) {
  auto setup = impact();
  setup.materials[1] = rubber();
  setup.time.steps = 12;
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  for (int k = 0; k < 6; ++k) advance(simulation);
  const std::filesystem::path path = temporary_path(".h5");
  simulation.observe([&](const FrameView<2>& frame) {
    output::write_frame(path, frame, 6, simulation.state().t, {}, [&](hdf5::File& file) {
      output::write_checkpoint(file, simulation.state(), {"{}", "eigen", "{}", 0});
    });
  });
  Simulation<2> resumed(setup, registry);
  resumed.restore(*output::read_checkpoint<2>({path, "{}", "eigen", 2}).state);
  double first = 0, again = 0;
  for (int k = 0; k < 3; ++k) first += resumed.advance().report.softening;
  const VectorX x = resumed.state().history.x[0];
  Simulation<2> other(setup, registry);
  other.restore(*output::read_checkpoint<2>({path, "{}", "eigen", 2}).state);
  for (int k = 0; k < 3; ++k) again += other.advance().report.softening;
  EXPECT_EQ(first, again);
  EXPECT_EQ(x, other.state().history.x[0]);
  std::filesystem::remove(path);
}

/// Children of cells have the largest densities of their parents exactly; other cells means, and tell what they displaced.
TEST(Softening, StateIsRestrictedToFinerCells) {
  std::mt19937 random(7);
  const Mesh<2> mesh = make_square(3, 1), finer = refine_uniformly(make_square(3, 1)), other = make_square(2, 1);
  const std::map<int, Material> materials = {{1, softening_laws<2>()[0]}};
  const auto field = field_after(mesh, materials, moved(mesh, 0.05, random));
  const SofteningStep<2> step(field, materials);
  const auto at_rest = [](const Mesh<2>& of) {
    VectorX x(2 * of.num_nodes());
    for (int v = 0; v < of.num_nodes(); ++v) x.segment<2>(2 * v) = of.point_of_node(v);
    return x;
  };
  const double lost = step.lost(whole_mesh(mesh, {}), at_rest(mesh));
  EXPECT_GT(lost, 0);
  const HistoryEnd same = step.end(finer, at_rest(finer), 0), means = step.end(other, at_rest(other), 0);
  EXPECT_NEAR(step.lost(whole_mesh(finer, {}), at_rest(finer)), lost, 1e-12 * lost);
  EXPECT_EQ(same.loss, 0);
  EXPECT_LE(std::abs(same.dissipation), 1e-14 * lost);
  EXPECT_GT(means.loss, 0);
  EXPECT_LE(std::abs(step.lost(whole_mesh(other, {}), at_rest(other)) - lost), means.loss);
}

/// Bodies whose mesh changes go on to soften.
TEST(Softening, RemeshedBodiesGoOn) {
  expect_memory_where_meshes_change(rubber(), &StepReport::softening, &History::softening);
}

class SofteningScene : public scene::SceneTest {
 protected:
  static scene::json with(const scene::json& mullins,
                          const scene::json& law = {{"type", "Yeoh"}, {"C", {10.0}}, {"K", 1e3}}) {
    scene::json material = {{"id", 1}, {"rho", 1000}, {"mullins", mullins}};
    material.merge_patch(law);
    return square({{"defaults", "itr"}, {"materials", scene::json::array({material})}});
  }
};

TEST_F(SofteningScene, ReadsTheNumbers) {
  const MullinsSoftening mullins = *read2(with({{"r", 1.5}, {"m", 2}, {"beta", 0.1}})).materials.at(1).mullins;
  EXPECT_EQ(mullins.r, 1.5);
  EXPECT_EQ(mullins.m, 2);
  EXPECT_EQ(mullins.beta, 0.1);
}

TEST_F(SofteningScene, RefusesWhatDoesNotSoften) {
  EXPECT_EQ(failure(with({{"r", 1}, {"m", 2}, {"beta", 0.1}})).place, "/materials/0/mullins/r");
  EXPECT_EQ(failure(with({{"r", 2}, {"beta", 0.1}})).place, "/materials/0/mullins/m");
  EXPECT_EQ(failure(with({{"r", 2}, {"m", -1}, {"beta", 0.1}})).place, "/materials/0/mullins/m");
  EXPECT_EQ(failure(with({{"r", 2}, {"m", 0}, {"beta", 0}})).place, "/materials/0/mullins/m");
  EXPECT_EQ(failure(with({{"r", 2}, {"m", 1}})).place, "/materials/0/mullins/beta");
  const scene::json valid = {{"r", 2}, {"m", 1}, {"beta", 0.1}};
  for (const scene::json& law :
       {scene::json{{"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}},
        scene::json{{"type", "Hyperfoam"}, {"mus", {10.0}}, {"alphas", {2.0}}, {"nus", {0.3}}},
        scene::json{{"type", "Yeoh"}, {"C", {10.0}}, {"K", 1e3}, {"plane_stress", true}},
        scene::json{{"type", "Yeoh"}, {"C", {10.0}}, {"K", 1e3}, {"eigenstrain", 0.01}},
        scene::json{{"type", "Yeoh"}, {"C", {10.0}}, {"K", 1e3}, {"prony", {{"g", {0.2}}, {"tau", {1.0}}}}}})
    EXPECT_EQ(failure(with(valid, law)).place, "/materials/0/mullins") << law;
}

}  // namespace
}  // namespace itr
