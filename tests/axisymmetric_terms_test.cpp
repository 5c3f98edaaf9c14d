// SPDX-License-Identifier: MIT
// Terms of bodies of revolution: derivatives, integrals over the full turn, what they conserve.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "block.hpp"
#include "curved_mesh.hpp"
#include "derivatives.hpp"
#include "energy/contact/contact.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/elastic/law_table.hpp"
#include "energy/elastic/patched_volume.hpp"
#include "energy/elastic/turned.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"
#include "energy/pressure.hpp"
#include "random_mesh.hpp"
#include "simulation/contact_surface.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

constexpr double kPi = std::numbers::pi;
const Material kBase = {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3};

/// A cylinder of radius and height 1 or, from an inner radius on, a tube; with edges that are all straight (0), curved at
/// random (1), or all curved (2).
Mesh<2> random_cylinder(std::mt19937& random, double inner, int curves) {
  Mesh<2> square = random_mesh(2, random);
  std::vector<Vec<2>> rest;
  for (const Vec<2>& X : square.rest()) rest.emplace_back(inner + (1 - inner) * X[0], X[1]);
  std::vector<MeshTypes<2>::Cell> cells;
  for (const CellId c : square.live_cells()) cells.push_back(square.cell(c));
  Mesh<2> mesh(rest, cells, std::vector<int>(cells.size(), 1));
  mesh.set_axisymmetric(true);
  std::vector<EdgeKey> edges;
  for (const EdgeKey& edge : mesh.edges())
    if (curves == 2 || (curves == 1 && random() % 2)) edges.push_back(edge);
  return curved(mesh, edges);
}

/// Rest positions where they are not `moved`: nodes of curved edges in their middles.
VectorX rest_positions(const Mesh<2>& mesh) {
  VectorX x(2 * mesh.num_nodes());
  for (int v = 0; v < mesh.num_nodes(); ++v) x.segment<2>(2 * v) = mesh.point_of_node(v);
  return x;
}

/// Stretched and perturbed, but for radii on the axis.
VectorX perturbed(const Mesh<2>& mesh, std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> noise(-amount, amount);
  VectorX x = rest_positions(mesh);
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x[i] = mesh.is_on_axis(static_cast<int>(i / 2)) && i % 2 == 0 ? 0 : (i % 2 ? 1.2 : 0.8) * x[i] + noise(random);
  return x;
}

std::vector<Material> all_laws() {
  std::vector<Material> laws(5, kBase);
  laws[1].law = MaterialLaw::linear;
  laws[2].law = MaterialLaw::saint_venant_kirchhoff;
  laws[3].law = MaterialLaw::fixed_corotated;
  laws[4].law = MaterialLaw::mooney_rivlin;
  laws[4].mooney_rivlin = {.c1 = 15, .c2 = 4, .c3 = 1, .log_k = 100, .volume_d = 50};
  for (const LawRow& row : law_rows()) laws.push_back(material_of(sum_of(row, 3, false), 3));
  return laws;
}

TEST(Axisymmetry, DerivativesOfAllLawsMatchDifferences) {
  std::mt19937 random(3);
  for (const Material& material : all_laws())
    for (const double inner : {0.0, 0.3})
      for (const int curves : {0, 1, 2}) {
        SCOPED_TRACE(name_of(material));
        const Mesh<2> mesh = random_cylinder(random, inner, curves);
        const CellSet<2> cells = whole_mesh(mesh, {});
        const ElasticEnergy<2> elastic(cells, {{1, material}}, 0.3);
        const VectorX x = perturbed(mesh, random, 0.03);
        expect_derivatives(elastic, x, 1e-6, 2e-7);
        expect_psd(elastic, x);
        const VectorX gradient = gradient_of(elastic, x);
        EXPECT_NEAR(sum<2>(gradient)[1], 0, 1e-13 * gradient.lpNorm<1>());
      }
}

/// Nearly incompressible bodies average J over the full turn.
TEST(Axisymmetry, PatchesHaveDerivativesAndKeepHomogeneousStates) {
  std::mt19937 random(11);
  for (Material material : all_laws()) {
    if (!may_average_volume(material, 3)) continue;
    SCOPED_TRACE(name_of(material));
    material.volume = VolumeForm::patches;
    const Vec<3> stretches(0.8, 1.3, 0.8);
    const double W = elastic_density<3>(Mat<3>(stretches.asDiagonal()), elastic_moduli<3>(material, Vec<3>(Vec<3>::Zero())));
    for (const double inner : {0.0, 0.3})
      for (const int curves : {0, 1, 2}) {
        const Mesh<2> mesh = random_cylinder(random, inner, curves);
        CellSet<2> cells = whole_mesh(mesh, {});
        add_patches({{1, material}}, cells);
        double volume = 0;
        for (const double of_patch : cells.patches->volume) volume += of_patch;
        EXPECT_NEAR(volume, kPi * (1 - inner * inner), 1e-12);
        const ElasticEnergy<2> elastic(cells, {{1, material}}, 0.3);
        VectorX x = rest_positions(mesh);
        for (Eigen::Index i = 0; i < x.size(); ++i) x[i] *= stretches[i % 2];
        Workspace workspace;
        EXPECT_NEAR(elastic.value(x, workspace), 0.3 * volume * W, 1e-12 * volume * W);
        x = perturbed(mesh, random, 0.03);
        expect_derivatives(elastic, x, 1e-6, 1e-6);
        expect_psd(elastic, x);
      }
  }
}

TEST(Axisymmetry, DerivativesOfOtherTermsMatchDifferences) {
  std::mt19937 random(5);
  const std::map<int, Material> materials = {{1, kBase}};
  for (const double inner : {0.0, 0.3})
    for (const int curves : {0, 1, 2}) {
      Mesh<2> mesh = random_cylinder(random, inner, curves);
      for (const FacetId f : mesh.live_facets()) mesh.set_facet_tag(f, f % 3);
      const CellSet<2> cells = whole_mesh(mesh, {});
      const VectorX x = perturbed(mesh, random, 0.03);
      const InertiaEnergy<2> inertia(cells, materials, MassKind::consistent, perturbed(mesh, random, 0.1));
      expect_derivatives(inertia, x, 1e-4, 1e-8);
      Loads<2> loads;
      loads.acceleration = [](const Vec<2>& X) { return Vec<2>(X * 2 + Vec<2>::Ones()); };
      loads.tractions.emplace_back(1, [](const Vec<2>& X) { return Vec<2>(X - Vec<2>::Ones()); });
      expect_derivatives(LoadEnergy<2>(cells, materials, loads, 0.3), x, 1e-4, 1e-8);
      loads.pressures.emplace_back(2, [](const Vec<2>& X) { return 1 + X[1]; });
      expect_derivatives(PressureEnergy<2>(cells, loads, perturbed(mesh, random, 0.1), 0.3), x, 1e-5, 1e-8);
    }
}

TEST(Axisymmetry, IntegralsGoOverTheFullTurn) {
  std::mt19937 random(7);
  const double volume = kPi;
  for (const int curves : {0, 1, 2}) {
    Mesh<2> mesh = random_cylinder(random, 0, curves);
    tag_sides(mesh, 1);
    const CellSet<2> cells = whole_mesh(mesh, {});
    VectorX x = rest_positions(mesh), radial = x, ones = VectorX::Zero(x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      x[i] *= i % 2 ? 1.3 : 0.8;
      if (i % 2) radial[i] = 0, ones[i] = 1;
    }
    Workspace workspace;
    const double W =
        elastic_density<3>(Mat<3>(Vec<3>(0.8, 1.3, 0.8).asDiagonal()), elastic_moduli<3>(kBase, Vec<3>(Vec<3>::Zero())));
    const std::map<int, Material> materials = {{1, kBase}};
    EXPECT_NEAR(ElasticEnergy<2>(cells, materials, 1).value(x, workspace), volume * W, 1e-12 * volume * W);
    for (const MassKind kind : {MassKind::consistent, MassKind::lumped}) {
      VectorX product = VectorX::Zero(x.size());
      InertiaEnergy<2>(cells, materials, kind, VectorX::Zero(x.size())).add_mass_product(ones, product);
      EXPECT_NEAR(product.sum(), 3 * volume, 1e-12);
      if (kind == MassKind::lumped) continue;
      product.setZero();
      InertiaEnergy<2>(cells, materials, kind, VectorX::Zero(x.size())).add_mass_product(radial, product);
      EXPECT_NEAR(radial.dot(product), 3 * kPi / 2, 1e-12);  // 3 times the integral of R^2 2 pi R
    }
    Loads<2> loads;
    loads.acceleration = [](const Vec<2>& X) { return Vec<2>(0, X[0]); };
    EXPECT_NEAR(sum<2>(LoadEnergy<2>(cells, materials, loads, 1).forces())[1], 3 * 2 * kPi / 3, 1e-12);
    Loads<2> pull;
    pull.tractions.emplace_back(4, [](const Vec<2>&) { return Vec<2>(0, 2); });
    EXPECT_NEAR(sum<2>(LoadEnergy<2>(cells, materials, pull, 1).forces())[1], 2 * kPi, 1e-12);
    Loads<2> pressure;
    for (int side = 1; side <= 4; ++side) pressure.pressures.emplace_back(side, [](const Vec<2>&) { return 7.0; });
    const PressureEnergy<2> closed(cells, pressure, perturbed(mesh, random, 0.05), 1);
    EXPECT_FALSE(closed.is_lagged(all_free(x.size())));
    EXPECT_NEAR(closed.value(x, workspace), 7 * volume * (0.8 * 0.8 * 1.3 - 1), 1e-12);
    const VectorX forces = gradient_of(closed, perturbed(mesh, random, 0.05));
    EXPECT_NEAR(sum<2>(forces)[1], 0, 1e-13 * forces.lpNorm<1>());
    const CollisionSurface surface = collision_surface(mesh, Obstacles<2>());
    double area = 0;
    for (const double of_vertex : surface.area) area += of_vertex;
    EXPECT_NEAR(area, 4 * kPi, 1e-12);  // without the axis
    for (const auto& edge : surface.edges) EXPECT_GT(mesh.rest(edge[0])[0] + mesh.rest(edge[1])[0], 0);
  }
}

TEST(Axisymmetry, AHoleMayCloseOnTheAxisAndNotPassIt) {
  std::mt19937 random(11);
  Workspace workspace;
  for (const int curves : {0, 1, 2}) {
    const Mesh<2> mesh = random_cylinder(random, 0.3, curves);
    const CellSet<2> cells = whole_mesh(mesh, {});
    VectorX x = rest_positions(mesh), way = VectorX::Zero(x.size());
    for (Eigen::Index i = 0; i < x.size(); i += 2) {  // cells at the hole are stretched to near the axis
      const bool is_at_hole = x[i] == 0.3;
      if (x[i] < 0.65) x[i] = 0.65 - (0.65 - x[i]) * (0.65 - 0.004) / 0.35;
      if (is_at_hole) x[i] = 0.004, way[i] = -0.0041;
    }
    const ElasticEnergy<2> elastic(cells, {{1, kBase}}, 1);
    const VectorX at = x + 1e-4 * VectorX::Random(x.size());
    expect_derivatives(elastic, at, 1e-8, 1e-5);
    expect_psd(elastic, at);
    EXPECT_TRUE(std::isfinite(elastic.value(x, workspace)));
    const double step = elastic.max_step(x, way, workspace);
    EXPECT_NEAR(step, 0.9 * 0.004 / 0.0041, 1e-12);
    EXPECT_TRUE(std::isfinite(elastic.value(x + step * way, workspace)));
    EXPECT_TRUE(std::isinf(elastic.value(x + way, workspace)));
  }
}

/// Near the axis the energy grows as V k/16 ln(1/r), though no point of the quadrature comes there.
TEST(Axisymmetry, ABarrierStandsBeforeTheAxis) {
  Mesh<2> mesh({{0.3, 0}, {1, 0}, {1, 1}}, {{0, 1, 2}}, {1});
  mesh.set_axisymmetric(true);
  const CellSet<2> cells = whole_mesh(mesh, {});
  const ElasticEnergy<2> elastic(cells, {{1, kBase}}, 1);
  Workspace workspace;
  const auto energy_at = [&](double r) {
    VectorX x = rest_positions(mesh);
    x[0] = r;
    return elastic.value(x, workspace);
  };
  const double volume = 2 * kPi * (2.3 / 3) * 0.35, k = 3 * kBase.lame_lambda(3) + 2 * kBase.lame_mu();
  const double expected = volume * k / 16 * std::log(1e4);
  EXPECT_NEAR(energy_at(1e-11) - energy_at(1e-7), expected, 1e-3 * expected);
}

/// The forces of contact between two discs that come near, by area.
TEST(Axisymmetry, ContactPressesByAreasOfTheTurn) {
  const double dhat = 0.1, gap = 0.05;
  Mesh<2> mesh({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 1 + gap}, {1, 1 + gap}, {1, 2}, {0, 2}},
               {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, {1, 1, 2, 2});
  mesh.set_axisymmetric(true);
  const CollisionSurface surface = collision_surface(mesh, Obstacles<2>());
  const ContactOptions options{.enabled = true, .dhat = dhat, .convergent = true};
  const ContactEnergy<2> contact(surface, options, 1, 1);
  const VectorX x = rest_positions(mesh), forces = gradient_of(contact, x);
  EXPECT_NEAR(sum<2>(forces)[1], 0, 1e-14 * forces.lpNorm<1>());
  EXPECT_NEAR(surface.area[4], kPi / 3, 1e-14);
  EXPECT_NEAR(surface.area[5], 2 * kPi / 3 + 2 * kPi * (1 - gap) / 2, 1e-14);
  EXPECT_NEAR(forces[2 * 5 + 1] / forces[2 * 4 + 1],
              (surface.area[2] + surface.area[5]) / (surface.area[3] + surface.area[4]), 1e-9);
}

}  // namespace
}  // namespace itr
