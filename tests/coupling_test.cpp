// SPDX-License-Identifier: MIT
// Energies of springs and coupled points: their derivatives, rotations and means.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "derivatives.hpp"
#include "energy/coupling.hpp"
#include "energy/facet_shapes.hpp"
#include "energy/spring.hpp"
#include "fem/cell_set.hpp"
#include "random_cube.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

template <int Dim>
Mesh<Dim> block_with_sides() {
  if constexpr (Dim == 2) {
    const Grid grid = make_regular_grid(3, 1, [](int i, int j) { return (i + j) % 2 == 0; });
    Mesh<2> mesh(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
    tag_sides(mesh, 1);
    return mesh;
  } else {
    std::mt19937 random(1);
    Mesh<3> mesh = make_cube(2, random, 0.2);
    for (const FacetId f : mesh.live_facets()) {
      Vec<3> middle = Vec<3>::Zero();
      for (const VertexId v : mesh.facet(f)) middle += mesh.rest(v) / 3;
      mesh.set_facet_tag(f, middle[0] > 1 - 1e-9 ? 3 : middle[1] > 1 - 1e-9 ? 4 : 1);
    }
    return mesh;
  }
}

template <int Dim>
VectorX moved(const CellSet<Dim>& cells, unsigned seed, double turn) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.05);
  Mat<3> R = Eigen::AngleAxisd(turn, Dim == 2 ? Vec<3>(0, 0, 1) : Vec<3>(0.6, 0, 0.8)).toRotationMatrix();
  const Mat<Dim> F = R.topLeftCorner<Dim, Dim>();
  VectorX x = itr::rest_positions<Dim>(cells);
  for (Eigen::Index i = 0; i < x.size(); i += Dim) {
    const Vec<Dim> X = x.segment<Dim>(i);
    x.segment<Dim>(i) = F * X;
    for (int c = 0; c < Dim; ++c) x[i + c] += 0.3 + noise(random);
  }
  return x;
}

template <int Dim>
void expect_rotation() {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (const int rank : {Dim - 1, Dim}) {
    Mat<3> G = Mat<3>::Zero(), H = Mat<3>::Zero(), K = Mat<3>::Zero(), C = Mat<3>::Zero();
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < Dim; ++j) H(i, j) = normal(random), K(i, j) = normal(random), C(i, j) = normal(random);
    for (int i = 0; i < rank; ++i) G += (1 + 0.3 * i) * Vec<3>(H.col(i)) * Vec<3>(Vec<3>::Unit(i)).transpose();
    const NearestRotation<Dim> at(G);
    EXPECT_NEAR(at.R().determinant(), 1, 1e-14);
    EXPECT_LE(axial(at.R().transpose() * G).norm(), 1e-13);
    const double h = 1e-5;
    const auto R = [&](double a, double b) { return NearestRotation<Dim>(G + a * H + b * K).R(); };
    EXPECT_LE(((R(h, 0) - R(-h, 0)) / (2 * h) - at.first(H)).norm(), 1e-8);
    const double first = (C.cwiseProduct(R(h, 0) - R(-h, 0))).sum() / (2 * h);
    EXPECT_NEAR(at.gradient(C, Vec<3>::Zero()).cwiseProduct(H).sum(), first, 1e-8);
    const Vec<3> a = at.spin(H), b = at.spin(K);
    const Mat<3> second = at.R() * ((skew(a) * skew(b) + skew(b) * skew(a)) / 2 + skew(at.second_spin(H, a, K, b)));
    const NearestRotation<Dim> plus(G + h * K), minus(G - h * K);
    EXPECT_LE(((plus.first(H) - minus.first(H)) / (2 * h) - second).norm(), 1e-6 * (1 + second.norm()));
  }
}

TEST(NearestRotation, HasItsDerivatives) {
  expect_rotation<2>();
  expect_rotation<3>();
}

template <int Dim>
void expect_means(const Mesh<Dim>& mesh) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const SurfaceMean<Dim> mean(cells, std::vector<int>{3});
  EXPECT_NEAR(mean.area, 1, 1e-14);
  EXPECT_NEAR(mean.centroid[0], 1, 1e-14);
  const CoupledPoint<Dim> point(mean, Vec<3>(1.7, 0.2, 0.4));
  VectorX x = itr::rest_positions<Dim>(cells), v = x;
  const Mat<3> R = Eigen::AngleAxisd(2, Dim == 2 ? Vec<3>(0, 0, 1) : Vec<3>(0, 0.6, 0.8)).toRotationMatrix();
  const auto turned = [&](const Vec<Dim>& X) { return Vec<Dim>(R.topLeftCorner<Dim, Dim>() * X + Vec<Dim>::Ones()); };
  for (Eigen::Index i = 0; i < x.size(); i += Dim) x.segment<Dim>(i) = turned(x.segment<Dim>(i));
  const Vec<Dim> X = Vec<3>(1.7, 0.2, 0.4).head<Dim>();
  EXPECT_LE((point.displacement(x) - (turned(X) - X)).norm(), 1e-13);
  const VectorX at = moved(cells, 4, 0.7), rate = moved(cells, 5, 2);
  const double h = 1e-4;
  const auto place = [&](double t) { return point.displacement(at + t * rate + t * t / 2 * x); };
  EXPECT_LE((point.velocity(at, rate) - (place(h) - place(-h)) / (2 * h)).norm(), 1e-5);
  EXPECT_LE((point.acceleration(at, rate, x) - (place(h) - 2 * place(0) + place(-h)) / (h * h)).norm(), 1e-5);
}

TEST(CoupledPoint, MovesWithTheMeanOfItsSurface) {
  expect_means(block_with_sides<2>());
  expect_means(block_with_sides<3>());
  Mesh<2> curved = block_with_sides<2>();
  curved.set_curved_edges(curved.edges());
  expect_means(curved);
}

/// Increments give the energy and its gradient up to a constant value.
template <typename Term>
void expect_increments(const Term& energy, const VectorX& base, const VectorX& x) {
  Workspace workspace;
  VectorX gradient = VectorX::Zero(x.size());
  energy.add_gradient_at({base, x - base}, gradient, workspace);
  EXPECT_LE((gradient - gradient_of(energy, x)).norm(), 1e-13 * gradient.norm());
  EXPECT_NEAR(energy.value_at({base, x - base}, workspace) - energy.value_at({base, 0 * x}, workspace),
              energy.value(x, workspace) - energy.value(base, workspace), 1e-13);
}

template <int Dim>
void expect_coupling(const Mesh<Dim>& mesh, bool is_rigid, const std::array<bool, 3>& rotation) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const SurfaceMean<Dim> mean(cells, std::vector<int>{3});
  const CoupledPoint<Dim> point(mean, Vec<3>(1.5, 0.2, Dim == 3 ? 0.6 : 0));
  PointTerms<Dim> terms;
  terms.force.setLinSpaced(0.3, -1);
  terms.stiffness.setConstant(0.2);
  terms.stiffness.diagonal().setConstant(1.5);
  terms.origin.setConstant(-0.4);
  if (Dim == 3) terms.couple << 0.2, 0.5, -0.3, 0.4, -0.1, 0.6, 0.7, 0.2, 0.1;
  terms.moment = Dim == 2 ? 0.8 : 0;
  terms.turn = 0.2;
  HeldPoint<Dim> held{.is_rigid = is_rigid, .position = {true, false, Dim == 3}, .rotation = rotation};
  held.displacement.setConstant(0.1);
  held.turned = Eigen::AngleAxisd(0.3, Vec<3>(0, 0, 1)).toRotationMatrix();
  held.stiffness = 3;
  CouplingEnergy<Dim> energy(point, terms, held, 0.7);
  const VectorX rest = itr::rest_positions<Dim>(cells), x = moved(cells, 7, 0.9), other = moved(cells, 8, 0.4);
  energy.update({rest, other - rest});
  expect_derivatives(energy, x, 1e-5, 1e-7);
  expect_psd(energy, x);
  expect_increments(energy, other, x);
  const VectorX v = moved(cells, 9, 0);
  VectorX product = VectorX::Zero(x.size());
  energy.add_product(x, v, product);
  const Vec<Dim> u = point.velocity(x, v);
  EXPECT_NEAR(v.dot(product), 0.7 * u.dot(terms.stiffness * u), 1e-12);
}

TEST(CouplingEnergy, HasItsDerivatives) {
  for (const bool is_rigid : {false, true}) {
    expect_coupling(block_with_sides<2>(), is_rigid, {false, false, true});
    for (int held = 0; held < 8; ++held)
      expect_coupling(block_with_sides<3>(), is_rigid, {(held & 1) != 0, (held & 2) != 0, (held & 4) != 0});
    Mesh<2> curved = block_with_sides<2>();
    curved.set_curved_edges(curved.edges());
    expect_coupling(curved, is_rigid, {false, false, true});
  }
}

/// The energy that holds turns is least where they are, and grows up to half a turn about any held axis.
template <int Dim>
void expect_one_least(const Mesh<Dim>& mesh, const std::array<bool, 3>& rotation) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const SurfaceMean<Dim> mean(cells, std::vector<int>{3});
  const CoupledPoint<Dim> point(mean, Vec<3>::Zero());
  HeldPoint<Dim> held{.rotation = rotation};
  held.turned = Eigen::AngleAxisd(2, Dim == 2 ? Vec<3>(0, 0, 1) : Vec<3>(0.6, 0, 0.8)).toRotationMatrix();
  const CouplingEnergy<Dim> energy(point, {}, held, 1);
  Workspace workspace;
  for (int axis = 0; axis < 3; ++axis) {
    if (!rotation[axis]) continue;
    double before = -1;
    for (const double turn : {0.0, 0.3, 1.2, 1.8, 2.5, 3.1}) {
      const Mat<3> R = held.turned * Eigen::AngleAxisd(turn, Vec<3>(Vec<3>::Unit(axis))).toRotationMatrix();
      VectorX x = itr::rest_positions<Dim>(cells);
      for (Eigen::Index i = 0; i < x.size(); i += Dim)
        x.segment<Dim>(i) = (R.topLeftCorner<Dim, Dim>() * x.segment<Dim>(i)).eval();
      const double value = energy.value(x, workspace);
      if (turn == 0)
        EXPECT_LE(value, 1e-28);
      else
        EXPECT_GT(value, before + 1e-4);
      before = value;
    }
  }
}

/// A point that has come far has the round-off of the way since rest, however short the step is: its value is noisy by that.
template <int Dim>
void expect_round_off(const Mesh<Dim>& mesh) {
  constexpr double kFar = 1e3, kStep = 1e-9;
  constexpr int kSamples = 50;
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const SurfaceMean<Dim> mean(cells, std::vector<int>{3});
  PointTerms<Dim> terms;
  terms.stiffness.setIdentity();
  terms.origin.setConstant(kFar + kStep);
  const CouplingEnergy<Dim> energy(CoupledPoint<Dim>(mean, Vec<3>::Zero()), terms, {}, 1);
  const VectorX base = (itr::rest_positions<Dim>(cells).array() + kFar).matrix(),
                way = VectorX::Constant(base.size(), kStep);
  Workspace workspace;
  const auto value = [&](double part) { return energy.value_at({base, VectorX(part * way)}, workspace); };
  double noise = 0;
  for (int k = 1; k < kSamples; ++k) {
    const double part = 0.5 * k / kSamples, between = 1e-3;
    noise = std::max(noise, std::abs(value(part + between) - 2 * value(part) + value(part - between)));
  }
  const double curvature = Dim * 1e-6 * kStep * kStep;
  EXPECT_GT(noise, 10 * curvature) << "nothing is tested";
  EXPECT_LE(noise, 8 * energy.value_round_off_at({base, VectorX(0.25 * way)}, workspace));
}

TEST(CouplingEnergy, TellsTheRoundOffOfTheWaySinceRest) {
  expect_round_off(block_with_sides<2>());
  expect_round_off(block_with_sides<3>());
}

TEST(CouplingEnergy, HasOneLeastWhereTurnsAreHeld) {
  expect_one_least(block_with_sides<2>(), {false, false, true});
  for (const std::array<bool, 3> held :
       {std::array{true, true, true}, {false, true, true}, {true, false, true}, {true, true, false}})
    expect_one_least(block_with_sides<3>(), held);
}

template <int Dim>
void expect_springs(const Mesh<Dim>& mesh) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  Spring spring{.surfaces = {3, 4}};
  spring.stiffness << 2, 0.5, 0, 0.5, 1, 0, 0, 0, 3;
  const SpringEnergy<Dim> energy(cells, spring, 0.7);
  const VectorX rest = itr::rest_positions<Dim>(cells), x = moved(cells, 3, 0.4), other = moved(cells, 6, 0.1);
  expect_derivatives(energy, x, 1e-4, 1e-8);
  expect_psd(energy, x);
  expect_increments(energy, other, x);
  Workspace workspace;
  VectorX shifted = rest;
  for (Eigen::Index i = 0; i < rest.size(); i += Dim) shifted[i] += 0.3;
  double area = 0;
  for (const auto& facet : cells.facets)
    if (facet.tag == 3 || facet.tag == 4)
      for_each_facet_point<Dim>(cells, facet, [&](const auto&, double part, const auto&) { area += part; });
  EXPECT_NEAR(area, cells.axisymmetric ? 3 * std::numbers::pi : 2, 1e-13);
  EXPECT_NEAR(energy.value(shifted, workspace), 0.7 * 2 * 0.09 / 2 * area, 1e-14);
}

TEST(SpringEnergy, HasItsDerivatives) {
  expect_springs(block_with_sides<2>());
  expect_springs(block_with_sides<3>());
  Mesh<2> other = block_with_sides<2>();
  other.set_curved_edges(other.edges());
  expect_springs(other);
  Mesh<2> turned = block_with_sides<2>();
  turned.set_axisymmetric(true);
  expect_springs(turned);
}

}  // namespace
}  // namespace itr
