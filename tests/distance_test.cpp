// SPDX-License-Identifier: MIT
// Distances between stored frames on different meshes, against integrals by hand.
#include "output/distance.hpp"
#include "curved_mesh.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "itr/core.hpp"
#include "mesh/refine.hpp"
#include "output/frame_file.hpp"
#include "output/surface_distance.hpp"
#include "temporary_path.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;

template <int Dim>
using Motion = std::function<Vec<Dim>(const Vec<Dim>&)>;

Mesh<2> square(bool other_diagonal, int body = 1) {
  if (other_diagonal) return Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 3}, {1, 2, 3}}, {body, body});
  return Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {body, body});
}

class DistanceTest : public testing::Test {
 protected:
  void SetUp() override {
    folder = temporary_path();
    fs::create_directories(folder / "frames");
  }
  void TearDown() override { fs::remove_all(folder); }

  template <int Dim>
  fs::path store(int step, const Mesh<Dim>& mesh, const Motion<Dim>& u) {
    const std::vector<Vec<Dim>>& nodes = mesh.rest();
    const int count = static_cast<int>(nodes.size());
    VectorX x(Dim * count), v = VectorX::Zero(Dim * count);
    for (int i = 0; i < count; ++i) vertex_of<Dim>(x, i) = nodes[i] + u(nodes[i]);
    const std::vector<double> density(mesh.num_cells(), 0);
    const std::vector<Vec<Dim>> obstacles;
    const std::vector<std::array<int, 2>> edges;
    const std::vector<std::array<int, 3>> triangles;
    AskedFields asked;
    asked.kinetic_energy = {2.5};
    asked.momentum.assign(Dim, 0.5 * step);
    const fs::path path = folder / fmt::format("frames/{:06}.h5", step);
    write_frame<Dim>(path, {mesh, x, v, density, obstacles, edges, triangles, &asked}, step, 0.1 * step);
    return path;
  }

  fs::path folder;
};

TEST_F(DistanceTest, OfLinearFieldsIsThatOfTheFunctionsWhateverTheMeshes) {
  // |u - w|^2 = (0.1 X + 0.2)^2 integrated over the unit square; gradients differ by 0.1 in one entry.
  const fs::path a = store<2>(1, square(false), [](const Vec<2>& X) { return Vec<2>(7.2 + 0.3 * X[0], X[1]); });
  const fs::path b = store<2>(2, square(true), [](const Vec<2>& X) { return Vec<2>(7 + 0.2 * X[0], X[1]); });
  const FrameDistance distance = frame_distance(a, b);
  EXPECT_NEAR(distance.l2, std::sqrt((0.027 - 0.008) / 0.3), 1e-13);
  EXPECT_NEAR(distance.h1_semi, 0.1, 1e-14);
  EXPECT_NEAR(distance.reference_l2, std::sqrt((7.2 * 7.2 * 7.2 - 343) / 0.6 + 1.0 / 3), 1e-12);
  EXPECT_NEAR(distance.reference_h1_semi, std::sqrt(1.04), 1e-13);
  EXPECT_NEAR(distance.uncovered, 0, 1e-14);
  EXPECT_LT(frame_distance(a, a).l2, 1e-15);
}

TEST_F(DistanceTest, SeesWhatTheFlippedDiagonalChanges) {
  // The two meshes carry min(X, Y) and max(0, X + Y - 1): their difference is a pyramid over the square, 1/2 high.
  const Motion<2> bump = [](const Vec<2>& X) { return Vec<2>(X[0] * X[1], 0); };
  const FrameDistance distance = frame_distance(store<2>(1, square(false), bump), store<2>(2, square(true), bump));
  EXPECT_NEAR(distance.l2 * distance.l2, 1.0 / 24, 1e-14);
  EXPECT_NEAR(distance.h1_semi * distance.h1_semi, 1.0, 1e-13);
}

TEST_F(DistanceTest, In3DARefinedMeshOfTheSameFieldIsAtNoDistance) {
  const Mesh<3> coarse({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  const Motion<3> shear = [](const Vec<3>& X) { return Vec<3>(0.2 * X[1], 0.1 * X[2], 1.0); };
  const Motion<3> shear_on = [](const Vec<3>& X) { return Vec<3>(0.2 * X[1], 0.1 * X[2], 1.0 + 0.5 * X[0]); };
  const fs::path a = store<3>(1, coarse, shear);
  FrameDistance distance = frame_distance(store<3>(2, refine_uniformly(coarse), shear), a);
  EXPECT_LT(distance.l2, 1e-8);
  EXPECT_LT(distance.h1_semi, 1e-14);
  EXPECT_LT(distance.surface, 1e-5);
  EXPECT_NEAR(distance.uncovered, 0, 1e-13);
  distance = frame_distance(store<3>(3, refine_uniformly(coarse), shear_on), a);
  EXPECT_NEAR(distance.l2, std::sqrt(0.25 / 60), 1e-13);  // the integral of X^2 over the corner simplex is 1/60
  EXPECT_NEAR(distance.h1_semi, 0.5 / std::sqrt(6.0), 1e-13);
}

TEST_F(DistanceTest, OfQuadraticFieldsIsThatOfTheFunctionsWhateverTheMeshes) {
  // On either diagonal both are held exactly: |u - w|^2 = (X Y / 2 - 0.1 Y^2)^2, whose gradient is (Y/2, X/2 - Y/5).
  const Mesh<2> mesh = square(false), other = refine_uniformly(square(true));
  const Motion<2> u = [](const Vec<2>& X) { return Vec<2>(3 + X[0] * X[1], X[0]); };
  const Motion<2> w = [](const Vec<2>& X) { return Vec<2>(3 + 0.5 * X[0] * X[1] + 0.1 * X[1] * X[1], X[0]); };
  const fs::path a = store<2>(1, of_orders(mesh, {{1, 2}}), u);
  const fs::path b = store<2>(2, of_orders(other, {{1, 2}}), w);
  FrameDistance distance = frame_distance(a, b);
  EXPECT_NEAR(distance.l2 * distance.l2, 0.25 / 9 - 0.1 / 8 + 0.01 / 5, 1e-14);
  EXPECT_NEAR(distance.h1_semi * distance.h1_semi, 0.25 / 3 + 0.25 / 3 - 0.2 / 4 + 0.04 / 3, 1e-14);
  EXPECT_NEAR(distance.reference_h1_semi * distance.reference_h1_semi, 0.25 / 3 + 0.25 / 3 + 0.2 / 4 + 0.04 / 3 + 1, 1e-13);
  EXPECT_NEAR(distance.uncovered, 0, 1e-14);
  EXPECT_LT(frame_distance(store<2>(3, of_orders(other, {{1, 2}}), u), a).l2, 1e-14);
}

TEST_F(DistanceTest, OfAQuadraticFieldFromALinearOne) {
  // From its interpolant on the diagonal's two triangles: X^2 - X between the sides.
  const Mesh<2> mesh = square(false);
  const Motion<2> parabola = [](const Vec<2>& X) { return Vec<2>(0, X[0] * X[0]); };
  const fs::path curved = store<2>(1, of_orders(mesh, {{1, 2}}), parabola), straight = store<2>(2, mesh, parabola);
  for (const auto& [a, b] : {std::pair(curved, straight), std::pair(straight, curved)}) {
    const FrameDistance distance = frame_distance(a, b);
    EXPECT_NEAR(distance.l2 * distance.l2, 1.0 / 30, 1e-14);
    EXPECT_NEAR(distance.h1_semi * distance.h1_semi, 1.0 / 3, 1e-14);
    EXPECT_NEAR(distance.surface, 0.25 / std::sqrt(2.0), 3e-4);  // of a parabola from its chord, at the middle
  }
}

TEST_F(DistanceTest, In3DQuadraticFieldsAreIntegratedExactly) {
  const Mesh<3> mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  const Mesh<3> finer = refine_uniformly(mesh);
  const Motion<3> square = [](const Vec<3>& X) { return Vec<3>(0, 0, X[0] * X[0]); };
  const Motion<3> more = [](const Vec<3>& X) { return Vec<3>(0, 0, X[0] * X[0] + X[1] * X[2]); };
  const fs::path a = store<3>(1, of_orders(mesh, {{1, 2}}), square);
  FrameDistance distance = frame_distance(store<3>(2, of_orders(finer, {{1, 2}}), square), a);
  EXPECT_LT(distance.l2, 1e-14);
  EXPECT_LT(distance.h1_semi, 1e-13);
  EXPECT_LT(distance.surface, 1e-3);
  EXPECT_NEAR(distance.reference_l2 * distance.reference_l2, 24.0 / 5040, 1e-15);  // the integral of X^4
  distance = frame_distance(store<3>(3, of_orders(finer, {{1, 2}}), more), a);
  EXPECT_NEAR(distance.l2 * distance.l2, 4.0 / 5040, 1e-15);          // of Y^2 Z^2
  EXPECT_NEAR(distance.h1_semi * distance.h1_semi, 2.0 / 60, 1e-14);  // of Y^2 + Z^2
}

TEST_F(DistanceTest, BodiesAreComparedWithTheirOwn) {
  const Motion<2> rest = [](const Vec<2>&) { return Vec<2>(0, 0); };
  const FrameDistance distance = frame_distance(store<2>(1, square(false, 1), rest), store<2>(2, square(false, 2), rest));
  EXPECT_EQ(distance.uncovered, 1);
}

TEST_F(DistanceTest, BodiesThatOnlyTogetherHaveTheSameShapeAreComparedTogether) {
  const Motion<2> rest = [](const Vec<2>&) { return Vec<2>(0, 0); }, shift = [](const Vec<2>&) { return Vec<2>(0.1, 0); };
  const std::vector<Vec<2>> corners{{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0.5, 0}};
  const std::vector<Mesh<2>::Cell> cells{{0, 4, 3}, {4, 2, 3}, {4, 1, 2}};
  const fs::path a = store<2>(1, Mesh<2>(corners, cells, {1, 1, 2}), rest);
  const FrameDistance distance = frame_distance(a, store<2>(2, Mesh<2>(corners, cells, {1, 2, 2}), shift));
  EXPECT_NEAR(distance.uncovered, 0, 1e-14);
  EXPECT_NEAR(distance.l2, 0.1, 1e-14);
}

TEST_F(DistanceTest, FramesOfOtherDimensionsAreRefused) {
  const fs::path a = store<2>(1, square(false), [](const Vec<2>&) { return Vec<2>(0, 0); });
  const Mesh<3> tetrahedron({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  const fs::path b = store<3>(2, tetrahedron, [](const Vec<3>&) { return Vec<3>(0, 0, 0); });
  EXPECT_THROW(frame_distance(a, b), InputError);
}

TEST_F(DistanceTest, ListsFramesWithTheirTotals) {
  for (const int step : {0, 20, 3}) store<2>(step, square(false), [](const Vec<2>&) { return Vec<2>(0, 0); });
  const auto entries = list_frames(folder);
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[1].totals.step, 3);
  EXPECT_DOUBLE_EQ(entries[2].totals.t, 2.0);
  EXPECT_EQ(entries[2].totals.kinetic_energy, 2.5);
  EXPECT_EQ(entries[2].totals.momentum, (std::vector<double>{10, 10}));
}

TEST(SurfaceDistance, IsFoundBetweenTheCorners) {
  // All corners of a lie on b; the middle of a's edge is 1 away from b's roof, and the roof's top 1 from the edge.
  const std::vector<std::array<Vec<2>, 2>> edge = {{Vec<2>(-1, 0), Vec<2>(1, 0)}},
                                           roof = {{Vec<2>(-1, 0), Vec<2>(0, 2)}, {Vec<2>(0, 2), Vec<2>(1, 0)}};
  EXPECT_NEAR(surface_distance<2>(edge, roof), 2, 2e-3);
  const std::vector<std::array<Vec<2>, 2>> posts = {{Vec<2>(-1, 0), Vec<2>(-1, 0.1)}, {Vec<2>(1, 0), Vec<2>(1, 0.1)}};
  EXPECT_NEAR(surface_distance<2>(edge, posts), 1, 1e-3);  // at the edge's middle, far from every corner
}

TEST(SurfaceDistance, In3DIsFoundInsideOfATriangle) {
  const std::vector<std::array<Vec<3>, 3>> large = {{Vec<3>(-1, -1, 0), Vec<3>(3, -1, 0), Vec<3>(-1, 3, 0)}};
  std::vector<std::array<Vec<3>, 3>> corners;  // tiny triangles around its corners
  for (const auto& p : large[0]) corners.push_back({p, p + Vec<3>(1e-6, 0, 0), p + Vec<3>(0, 1e-6, 0)});
  // The point of a right triangle that is farthest from its corners is the middle of its hypotenuse.
  EXPECT_NEAR(surface_distance<3>(large, corners), 2 * std::sqrt(2.0), 3e-3);
  EXPECT_EQ(surface_distance<3>(large, {}), 0);
}

}  // namespace
}  // namespace itr::output
