// SPDX-License-Identifier: MIT
// Ties of opposite sides of periodic cells.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "advance.hpp"
#include "simulation/resultant.hpp"
#include "tied_bricks.hpp"

namespace itr {
namespace {

constexpr int kRight = 12, kBack = 13, kPoint = 14;

/// A periodic cell of two layers of 1 by 1 (by 1), of which one vertex is held: under a macroscopic displacement gradient.
template <int Dim>
Setup<Dim> periodic_cell(const Mat<Dim>& gradient, int below, int above) {
  Setup<Dim> setup = tied<Dim>(two_cubes<Dim>(below, above));
  Mesh<Dim>& mesh = setup.mesh;
  for (const FacetId f : mesh.live_facets()) {
    const auto is_at = [&](int c) {
      return std::ranges::all_of(mesh.facet(f), [&](VertexId v) { return mesh.rest(v)[c] > 1 - 1e-9; });
    };
    if (is_at(0)) mesh.set_facet_tag(f, kRight);
    if (Dim == 3 && is_at(1)) mesh.set_facet_tag(f, kBack);
  }
  mesh.set_vertex_tag(0, kPoint);
  std::array<bool, Dim> all;
  all.fill(true);
  setup.dirichlet.push_back({kPoint, all, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }});
  const auto tie = [&](int a, int b, const Vec<Dim>& period) {
    Vec<3> jump = Vec<3>::Zero();
    jump.head<Dim>() = gradient * period;
    setup.ties.push_back({{a}, {b}, [jump](double) { return jump; }});
  };
  tie(kRight, kLeft, -Vec<Dim>::Unit(0));
  if (Dim == 3) tie(kFront, kBack, Vec<Dim>::Unit(1));
  tie(kBelow, kAbove, 2 * Vec<Dim>::Unit(Dim - 1));
  return setup;
}

template <int Dim>
void expect_uniform_cell(int below, int above, int order) {
  Mat<Dim> gradient = 0.1 * Mat<Dim>::Identity();
  gradient(0, Dim - 1) = 0.2;
  gradient(Dim - 1, 0) = -0.05;
  Setup<Dim> setup = periodic_cell<Dim>(gradient, below, above);
  setup.order = {{1, order}, {2, order}};
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(spread_of_strain(simulation), 1e-8);
  const CellSet<Dim> cells = whole_mesh(simulation.mesh(), {});
  const Mat<Dim> F = deformation_gradient<Dim>(cells.elements[0], simulation.state().history.x[0]);
  EXPECT_LE((F - Mat<Dim>::Identity() - gradient).norm(), 1e-8);
}

TEST(PeriodicTie, CellsOfOneMaterialHaveTheMacroscopicGradient) {
  expect_uniform_cell<2>(3, 3, 1);
  expect_uniform_cell<2>(3, 4, 1);
  expect_uniform_cell<2>(4, 3, 2);
  expect_uniform_cell<3>(2, 3, 1);
}

TEST(PeriodicTie, CellsFailWhereConditionsHoldAnotherJump) {
  Mat<2> gradient = Mat<2>::Zero();
  gradient(0, 0) = 0.1;
  Plane setup = periodic_cell<2>(gradient, 2, 2);
  for (const int tag : {kRight, kLeft})
    setup.dirichlet.push_back({tag, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("stay apart by 0.1 m"), std::string::npos) << result.reason;
}

/// The traction on the right or the upper side of a laminate.
Vec<2> traction_of_laminate(const Mat<2>& gradient, bool is_right) {
  Plane setup = periodic_cell<2>(gradient, 3, 4);
  setup.materials[2].youngs_modulus = 4e5;
  for (auto& [body, material] : setup.materials) material.law = MaterialLaw::linear, material.poisson_ratio = 0;
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(simulation.state().history.x[0].head(2).norm(), 1e-12);
  const auto sums =
      force_sums(simulation.state(), simulation.forces(), {.name = "", .surfaces = {is_right ? kRight : kAbove}});
  return sums.contact.force.head<2>() / (is_right ? 2 : 1);
}

TEST(PeriodicTie, LaminatesHaveTheirEffectiveModuli) {
  constexpr double kStrain = 1e-3, kFirst = 1e5, kSecond = 4e5;
  const double mean = (kFirst + kSecond) / 2, harmonic = 2 / (1 / kFirst + 1 / kSecond);
  Mat<2> along = Mat<2>::Zero(), across = along, shear = along;
  along(0, 0) = across(1, 1) = shear(0, 1) = kStrain;
  EXPECT_NEAR(traction_of_laminate(along, true)[0], mean * kStrain, 1e-6 * mean * kStrain);
  EXPECT_NEAR(traction_of_laminate(across, false)[1], harmonic * kStrain, 1e-6 * mean * kStrain);
  EXPECT_NEAR(traction_of_laminate(shear, false)[0], harmonic / 2 * kStrain, 1e-6 * mean * kStrain);
}

/// Pulled along its last axis and free otherwise, a cell of one material is in uniaxial stress, whatever its meshes.
template <int Dim>
void expect_uniaxial_cell(int below, int above, int order) {
  Mat<Dim> gradient = Mat<Dim>::Zero();
  gradient(Dim - 1, Dim - 1) = 0.1;
  Setup<Dim> setup = periodic_cell<Dim>(gradient, below, above);
  setup.order = {{1, order}, {2, order}};
  for (auto& [body, material] : setup.materials) material.law = MaterialLaw::linear, material.poisson_ratio = 0.3;
  constexpr double kFree = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t tie = 1; tie < setup.ties.size(); ++tie) {  // behind that of the layers
    Vec<3> jump = setup.ties[tie].jump(0);
    if (tie + 1 < setup.ties.size())
      jump[static_cast<Eigen::Index>(tie) - 1] = kFree;
    else  // the last axis is free to turn upon the others
      jump.head<Dim - 1>().setConstant(kFree);
    setup.ties[tie].jump = [jump](double) { return jump; };
  }
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(spread_of_strain(simulation), 1e-8);
  const CellSet<Dim> cells = whole_mesh(simulation.mesh(), {});
  const Mat<Dim> H = deformation_gradient<Dim>(cells.elements[0], simulation.state().history.x[0]) - Mat<Dim>::Identity();
  const Material& material = setup.materials.at(1);
  const double lambda = material.lame_lambda(Dim), mu = material.lame_mu();
  Mat<Dim> expected = gradient;
  for (int c = 0; c + 1 < Dim; ++c) expected(c, c) = -0.1 * lambda / ((Dim - 1) * lambda + 2 * mu);
  EXPECT_LE((H - expected).norm(), 1e-8);
  const auto force = [&](int tag) {
    const auto sums = force_sums(simulation.state(), simulation.forces(), {.name = "", .surfaces = {tag}});
    return Vec<Dim>(sums.contact.force.template head<Dim>());
  };
  const double pull = force(kAbove)[Dim - 1];
  EXPECT_GT(pull, 0);
  EXPECT_LE(force(kAbove).template head<Dim - 1>().norm(), 1e-6 * pull);
  EXPECT_LE(std::abs(force(kRight)[0]), 1e-6 * pull);
}

TEST(PeriodicTie, FreeComponentsLeaveNoForce) {
  expect_uniaxial_cell<2>(3, 3, 1);
  expect_uniaxial_cell<2>(3, 4, 1);
  expect_uniaxial_cell<2>(4, 3, 2);
  expect_uniaxial_cell<3>(2, 3, 1);
}

TEST(PeriodicTie, SidesHaveOneShape) {
  Plane setup = periodic_cell<2>(Mat<2>::Zero(), 2, 3);
  bool is_cut = false;
  for (const FacetId f : setup.mesh.live_facets())
    if (setup.mesh.facet_tag(f) == kRight && !std::exchange(is_cut, true)) setup.mesh.set_facet_tag(f, kFree);
  EXPECT_EQ(refusal_of(setup).substr(0, 16), "/ties/1/periodic");
  setup = periodic_cell<2>(Mat<2>::Zero(), 2, 3);
  setup.time = {.dt = 0.1, .steps = 1};
  EXPECT_EQ(refusal_of(setup), "/ties: periodic cells with inertia");
}

TEST(PeriodicTie, CellsAreRemeshed) {
  Mat<2> gradient = Mat<2>::Zero();
  gradient(0, 1) = 0.3;
  Plane setup = periodic_cell<2>(gradient, 2, 2);
  setup.materials[2].youngs_modulus = 1e6;
  for (const FacetId f : setup.mesh.live_facets())  // only half of the layers is bonded, so that stresses differ
    if (setup.mesh.facet_tag(f) == kOfA &&
        setup.mesh.rest(setup.mesh.facet(f)[0])[0] + setup.mesh.rest(setup.mesh.facet(f)[1])[0] > 1)
      setup.mesh.set_facet_tag(f, kFree);
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.remesh.enabled = true;
  setup.remesh.relative_tolerance = 1e-4;
  setup.remesh.curve.enabled = false;
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  EXPECT_GT(simulation.mesh().num_vertices(), setup.mesh.num_vertices());
  const auto force = [&](const ForceTarget& target) {
    return Vec<2>(force_sums(simulation.state(), simulation.forces(), target).contact.force.head<2>());
  };
  const double shear = force({.name = "", .surfaces = {kAbove}})[0];
  EXPECT_GT(shear, 0);
  EXPECT_LE(force({.name = "", .bodies = {1, 2}}).norm(), 1e-10 * shear);
  const Mesh<2>& mesh = simulation.mesh();
  const auto displacement = [&](int tag) {  // the mean over the surface
    Vec<2> sum = Vec<2>::Zero();
    for (const FacetId f : mesh.live_facets()) {
      if (mesh.facet_tag(f) != tag) continue;
      const auto& [a, b] = mesh.facet(f);
      for (const VertexId v : {a, b})
        sum += (mesh.rest(a) - mesh.rest(b)).norm() / 2 * (vertex_of<2>(simulation.state().history.x[0], v) - mesh.rest(v));
    }
    return sum;
  };
  EXPECT_LE((displacement(kAbove) - displacement(kBelow) - gradient * Vec<2>(0, 2)).norm(), 1e-8);
}

}  // namespace
}  // namespace itr
