// SPDX-License-Identifier: MIT
// Strata of meshes, and the ring of cells around an edge.
#include <gtest/gtest.h>

#include "mesh/edge_ring.hpp"
#include "random_tets.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

std::map<Stratum, int> count_strata(const auto& mesh, const auto& strata) {
  std::map<Stratum, int> count;
  for (int v = 0; v < mesh.node_slots(); ++v) ++count[strata.vertex(v)];
  return count;
}

TEST(Strata, OfACubeOfTwoBodiesAreItsPlanesAndLines) {
  // Turned by an angle that no coordinate survives without round-off.
  const Mat<3> turn = Eigen::AngleAxisd(0.7, Vec<3>(1, 2, 3).normalized()).toRotationMatrix();
  const auto place = [&](int i, int j, int k) { return Vec<3>(turn * Vec<3>(i, j, k) / 3); };
  const Mesh<3> one = make_cubes(3, place, [](int, int, int) { return 1; });
  const Strata<3> strata(one);
  EXPECT_EQ(strata.find_defect(one), "");
  EXPECT_EQ(strata.num_patches(), 6);
  EXPECT_EQ(
      count_strata(one, strata),
      (std::map<Stratum, int>{{Stratum::volume, 8}, {Stratum::surface, 24}, {Stratum::feature, 24}, {Stratum::corner, 8}}));

  const Mesh<3> two = make_cubes(3, place, [](int i, int, int) { return i == 0 ? 1 : 2; });
  const Strata<3> of_two(two);
  EXPECT_EQ(of_two.find_defect(two), "");
  EXPECT_EQ(of_two.num_patches(), 11);  // four sides are cut in two
  // The interface has 4 inner vertices, 8 on its straight rim and 4 corners where the rim turns.
  EXPECT_EQ(
      count_strata(two, of_two),
      (std::map<Stratum, int>{{Stratum::volume, 4}, {Stratum::surface, 20}, {Stratum::feature, 28}, {Stratum::corner, 12}}));
  for (int v = 0; v < two.node_slots(); ++v) {
    const Mat<3> P = of_two.tangent_projector(two, v);
    EXPECT_NEAR((P * P - P).norm(), 0, 1e-14);
    EXPECT_NEAR(P.trace(), std::max(0, 3 - static_cast<int>(of_two.vertex(v))), 1e-14);
  }
}

TEST(Strata, FollowTagsShapesAndBodiesThatOnlyTouch) {
  Mesh<3> tagged = make_cubes(2, unit_grid(2), [](int, int, int) { return 1; });
  for (int f = 0; f < tagged.facet_slots(); ++f) {  // half of the lower side has another tag
    double x = 0;
    for (const int v : tagged.facet(f)) x += tagged.rest(v)[0] / 3;
    if (tagged.facet_tag(f) == 4 && x < 0.5) tagged.set_facet_tag(f, 9);
  }
  const Strata<3> of_tags(tagged);
  EXPECT_EQ(of_tags.num_patches(), 7);
  // The middle of the lower side is now on a feature, that feature's ends are corners.
  EXPECT_EQ(
      count_strata(tagged, of_tags),
      (std::map<Stratum, int>{{Stratum::volume, 1}, {Stratum::surface, 5}, {Stratum::feature, 11}, {Stratum::corner, 10}}));

  const auto round = [](int i, int j, int k) {
    const Vec<3> p(i - 2, j - 2, k - 2);
    return Vec<3>(p.norm() > 0 ? p * p.lpNorm<Eigen::Infinity>() / p.norm() : p);
  };
  const Mesh<3> ball = make_cubes(4, round, [](int, int, int) { return 1; });
  const auto of_ball = count_strata(ball, Strata<3>(ball));
  EXPECT_EQ(of_ball, (std::map<Stratum, int>{{Stratum::volume, 27}, {Stratum::corner, 98}}));

  const Mesh<3> by_edge = make_cubes(2, unit_grid(2), [](int i, int j, int k) { return k == 0 && i == j ? i + 1 : kNone; });
  const Strata<3> of_edge(by_edge);
  EXPECT_EQ(count_strata(by_edge, of_edge)[Stratum::non_manifold], 2);
  const Mesh<3> by_vertex = make_cubes(2, unit_grid(2), [](int i, int j, int k) { return i == j && j == k ? 1 : kNone; });
  EXPECT_EQ(count_strata(by_vertex, Strata<3>(by_vertex))[Stratum::non_manifold], 1);
}

TEST(Strata, InTwoDimensionsAreStretchesAndCorners) {
  Grid grid = make_regular_grid(4, 1, [](int, int) { return true; });
  std::vector<int> body;
  for (const auto& cell : grid.cells)
    body.push_back(grid.rest[cell[0]][0] + grid.rest[cell[1]][0] + grid.rest[cell[2]][0] < 1.5 ? 1 : 2);
  Mesh<2> mesh(grid.rest, grid.cells, body);
  tag_sides(mesh, 1);
  const Strata<2> strata(mesh);
  EXPECT_EQ(strata.find_defect(mesh), "");
  EXPECT_EQ(strata.num_patches(), 7);
  EXPECT_EQ(count_strata(mesh, strata),
            (std::map<Stratum, int>{{Stratum::volume, 6}, {Stratum::surface, 13}, {Stratum::corner, 6}}));
}

TEST(EdgeRing, IsInCyclicOrderAndEachCellPositive) {
  std::mt19937 random(1);
  const Mesh<3> mesh = make_cubes(3, unit_grid(3), [](int, int, int) { return 1; });
  int closed = 0, open = 0;
  for (const EdgeKey& edge : mesh.edges()) {
    const auto ring = ring_of_edge(mesh, edge);
    ASSERT_TRUE(ring);
    ++(ring->closed ? closed : open);
    EXPECT_EQ(ring->closed, mesh.facets_of_edge(edge).empty());
    EXPECT_EQ(ring->vertices.size(), ring->cells.size() + (ring->closed ? 0 : 1));
    for (std::size_t i = 0; i < ring->cells.size(); ++i) {
      const VertexId u = ring->vertices[i], v = ring->vertices[(i + 1) % ring->vertices.size()];
      const Mesh<3>::Cell expected{edge[0], edge[1], u, v};
      EXPECT_EQ(ascending(mesh.cell(ring->cells[i])), ascending(expected));
      EXPECT_GT(simplex_volume<3>({mesh.rest(edge[0]), mesh.rest(edge[1]), mesh.rest(u), mesh.rest(v)}), 0);
    }
  }
  EXPECT_GT(closed, 10);
  EXPECT_GT(open, 10);
  const Mesh<3> by_edge = make_cubes(2, unit_grid(2), [](int i, int j, int k) { return k == 0 && i == j ? 1 : kNone; });
  int none = 0;
  for (const EdgeKey& edge : by_edge.edges()) none += !ring_of_edge(by_edge, edge);
  EXPECT_EQ(none, 1);
}

}  // namespace
}  // namespace itr
