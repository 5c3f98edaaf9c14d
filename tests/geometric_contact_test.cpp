// SPDX-License-Identifier: MIT
// The geometric contact potential: its form at simple places, its derivatives, its scenes and what it does not go with.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "advance.hpp"
#include "derivatives.hpp"
#include "energy/polyfem/geometric_contact.hpp"
#include "fem/cell_set.hpp"
#include "itr/simulation.hpp"
#include "itr/solver.hpp"
#include "scene_folder.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

constexpr GeometricContactOptions kOptions{.dhat = 0.2, .stiffness = 7, .tangent = 0.4, .normal = 0.3};

/// A triangle with a level top, and above it one with a corner down at (x, gap).
Mesh<2> two_triangles(double x, double gap) {
  const std::vector<Vec<2>> rest = {{-1, 0}, {0, -1}, {1, 0}, {x, gap}, {x + 0.5, gap + 0.5}, {x - 0.5, gap + 0.5}};
  return Mesh<2>(rest, {{0, 1, 2}, {3, 4, 5}}, {1, 2});
}

double spline_over(double x) { return (x < 0.5 ? 2.0 / 3 - 4 * x * x * (1 - x) : 4.0 / 3 * std::pow(1 - x, 3)) / x; }

TEST(GeometricContact, OfACornerOverAnEdgeIsTheBarrierTimesTheirLengths) {
  Workspace workspace;
  for (const double gap : {0.03, 0.11, 0.19, 0.21}) {
    const CellSet<2> cells = whole_mesh(two_triangles(0.1, gap), {});
    const GeometricContact contact(cells, kOptions, 2);
    const double expected = gap < 0.2 ? 2 * 7 * 2 * std::sqrt(0.5) * spline_over(gap / 0.2) : 0;
    EXPECT_NEAR(contact.value(rest_positions(cells), workspace), expected, 1e-12);
  }
}

/// At the ends of an edge the term fades, and that of two corners takes over.
TEST(GeometricContact, OfACornerOverACornerIsThatOfBoth) {
  Workspace workspace;
  // The tops of both are corners that point at each other.
  const std::vector<Vec<2>> rest = {{0, 0}, {-0.5, -0.5}, {0.5, -0.5}, {0, 0.1}, {0.5, 0.6}, {-0.5, 0.6}};
  const CellSet<2> cells = whole_mesh(Mesh<2>(rest, {{0, 1, 2}, {3, 4, 5}}, {1, 2}), {});
  const GeometricContact contact(cells, kOptions, 1);
  EXPECT_NEAR(contact.value(rest_positions(cells), workspace), 7 * 0.5 * spline_over(0.5), 1e-12);
}

TEST(GeometricContact, DerivativesMatchDifferencesAndForcesBalance) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int acting = 0;
  for (int i = 0; i < 40; ++i) {
    const double gap = 0.1 + 0.07 * uniform(random);
    const CellSet<2> cells = whole_mesh(two_triangles(1.05 * uniform(random), gap), {});
    const GeometricContact contact(cells, kOptions, 1);
    const VectorX x = rest_positions(cells) + VectorX::NullaryExpr(12, [&] { return 0.02 * uniform(random); });
    const VectorX gradient = gradient_of(contact, x);
    if (gradient.norm() == 0) continue;
    ++acting;
    expect_derivatives(contact, x, 1e-7, 1e-5);
    expect_psd(contact, x);
    Vec<2> sum = Vec<2>::Zero();
    double moment = 0;
    for (int v = 0; v < 6; ++v) {
      sum += gradient.segment<2>(2 * v);
      moment += x[2 * v] * gradient[2 * v + 1] - x[2 * v + 1] * gradient[2 * v];
    }
    EXPECT_LE(sum.norm(), 1e-12 * gradient.norm());
    EXPECT_LE(std::abs(moment), 1e-12 * gradient.norm());
  }
  EXPECT_GT(acting, 20);
}

/// Sides of one body that are near each other through it do not press.
TEST(GeometricContact, DoesNotActThroughABody) {
  const std::vector<Vec<2>> rest = {{0, 0}, {1, 0}, {2, 0}, {2, 0.05}, {1, 0.05}, {0, 0.05}};
  const CellSet<2> cells = whole_mesh(Mesh<2>(rest, {{0, 1, 4}, {0, 4, 5}, {1, 2, 3}, {1, 3, 4}}, {1, 1, 1, 1}), {});
  const GeometricContact contact(cells, kOptions, 1);
  Workspace workspace;
  EXPECT_EQ(contact.value(rest_positions(cells), workspace), 0);
}

}  // namespace

namespace scene {
namespace {

class GeometricContactScene : public SceneTest {
 protected:
  /// A square that falls onto one that is held, and comes to rest there.
  static json stack(const json& changes = json::object()) {
    json scene = square(
        {{"contact", {{"enabled", true}, {"dhat", 0.05}, {"use_gcp_formulation", true}, {"alpha_t", 0.3}, {"alpha_n", 0.1}}},
         {"solver", {{"contact", {{"barrier_stiffness", 50}}}}},
         {"time", {{"dt", 0.01}, {"tend", 0.3}}},
         {"boundary_conditions",
          {{"rhs", {0, 10}}, {"dirichlet_boundary", json::array({{{"id", 7}, {"value", {0, 0}}}})}}}});
    scene["geometry"] = json::array({{{"mesh", "square.obj"},
                                      {"volume_selection", 1},
                                      {"surface_selection", 7},
                                      {"transformation", {{"scale", {3, 1}}, {"translation", {-1, -1.04}}}}},
                                     {{"mesh", "square.obj"}, {"volume_selection", 1}}});
    scene["materials"][0]["E"] = 1e6;
    scene.merge_patch(changes);
    return scene;
  }
};

/// The weight of 10 kN/m on two corners over an edge of 3 m: 50 * 3 / 0.05 * 1.67 N/m at 0.028 m.
TEST_F(GeometricContactScene, PressesBodiesApart) {
  linear::Registry registry;
  Simulation<2> simulation(read2(stack()), registry);
  while (!simulation.finished()) advance(simulation);
  const VectorX& x = simulation.state().history.x[0];
  EXPECT_NEAR(x[2 * 4 + 1] + 0.04, 0.028, 2e-3);
}

TEST_F(GeometricContactScene, IsRefusedWhereItHasNoTerms) {
  const std::string place = "/contact/use_gcp_formulation";
  EXPECT_EQ(failure(stack({{"defaults", "itr"}})).place, place);
  EXPECT_EQ(failure(stack({{"space", {{"remesh", {{"enabled", true}}}}}})).place, place);
  EXPECT_EQ(failure(stack({{"space", {{"discr_order", 2}}}})).place, place);
  EXPECT_EQ(failure(stack({{"contact", {{"friction_coefficient", 0.1}}}})).place, place);
  EXPECT_EQ(failure(stack({{"contact", {{"adhesion", {{"adhesion_enabled", true}}}}}})).place, place);
  EXPECT_EQ(failure(stack({{"contact", {{"use_convergent_formulation", true}}}})).place, place);
  EXPECT_EQ(failure(stack({{"solver", {{"contact", {{"barrier_stiffness", "adaptive"}}}}}})).place, place);
  EXPECT_EQ(failure(stack({{"output", {{"error_bars", true}}}})).place, place);
  const json turned = {{"axisymmetric", true},
                       {"geometry", json::array({stack()["geometry"][1]})},
                       {"boundary_conditions", {{"dirichlet_boundary", json::array()}}}};
  EXPECT_EQ(failure(stack(turned)).place, place);
  EXPECT_EQ(failure(stack({{"contact", {{"use_adaptive_dhat", true}}}})).place, "/contact/use_adaptive_dhat");
  EXPECT_EQ(failure(stack({{"contact", {{"alpha_t", 1.5}}}})).place, "/contact/alpha_t");
  json scene = stack();
  scene["geometry"].push_back({{"mesh", "line.obj"}, {"is_obstacle", true}, {"transformation", {{"translation", {0, -5}}}}});
  EXPECT_EQ(failure(scene).place, place);
  const json tet = {{"geometry", json::array({{{"mesh", "tet.msh"}, {"volume_selection", 1}}})},
                    {"boundary_conditions", {{"rhs", {0, 0, 0}}, {"dirichlet_boundary", json::array()}}}};
  EXPECT_EQ(failure(stack(tet)).place, place);
  EXPECT_EQ(read2(stack({{"contact", {{"use_gcp_formulation", false}}}})).terms.size(), 0u);
}

}  // namespace
}  // namespace scene
}  // namespace itr
