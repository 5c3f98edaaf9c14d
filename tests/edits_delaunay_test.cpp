// SPDX-License-Identifier: MIT
// Edits on Delaunay meshes of random points: all the slivers that such meshes have. CGAL's triangulations are GPL: only for
// tests.
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <gtest/gtest.h>

#include "random_tets.hpp"

namespace itr {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Delaunay = CGAL::Delaunay_triangulation_3<Kernel>;

/// Cells of the Delaunay triangulation for which `body` of their centroid is not kNone.
template <typename Body>
Mesh<3> delaunay_mesh(const std::vector<Vec<3>>& points, Body&& body) {
  Delaunay triangulation;
  for (const Vec<3>& p : points) triangulation.insert({p[0], p[1], p[2]});
  std::map<Delaunay::Vertex_handle, int> ids;
  std::vector<Vec<3>> rest;
  std::vector<Mesh<3>::Cell> cells;
  std::vector<int> bodies;
  for (const auto& c : triangulation.finite_cell_handles()) {
    Vec<3> centroid = Vec<3>::Zero();
    for (int k = 0; k < 4; ++k) {
      const auto& p = c->vertex(k)->point();
      centroid += Vec<3>(p.x(), p.y(), p.z()) / 4;
    }
    if (body(centroid) == kNone) continue;
    Mesh<3>::Cell cell;
    for (int k = 0; k < 4; ++k) {
      const auto [entry, is_new] = ids.try_emplace(c->vertex(k), static_cast<int>(rest.size()));
      const auto& p = c->vertex(k)->point();
      if (is_new) rest.emplace_back(p.x(), p.y(), p.z());
      cell[k] = entry->second;
    }
    cells.push_back(cell);
    bodies.push_back(body(centroid));
  }
  return {rest, cells, bodies};
}

/// A box with points on its corners, edges and sides, and inside; convex, with a notch, of two bodies.
TEST(EditsOfDelaunayMeshes, KeepAllInvariantsAndRemoveSlivers) {
  int slivers = 0, fewer = 0, meshes = 0;
  for (unsigned seed = 0; seed < 9; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<Vec<3>> points;
    for (int i = 0; i < 400; ++i) {
      Vec<3> p(unit(random), unit(random), unit(random));
      const int fixed = i < 8 ? 3 : i < 40 ? 2 : i < 150 ? 1 : 0;  // coordinates on the box's surface
      for (int k = 0; k < fixed; ++k) p[(i / 3 + k) % 3] = fixed == 3 ? i >> k & 1 : std::round(p[(i / 3 + k) % 3]);
      points.push_back(p);
    }
    Mesh<3> mesh = delaunay_mesh(points, [&](const Vec<3>& X) {
      return seed % 3 == 1 && X.minCoeff() > 0.6 ? kNone : seed % 3 == 2 && X[0] + X[1] < 0.9 ? 1 : 2;
    });
    ASSERT_EQ(mesh.find_defect(), "");
    Strata<3> strata(mesh);
    ASSERT_EQ(strata.find_defect(mesh), "");
    const Invariants before(mesh, strata);
    const auto count_slivers = [&] {
      int count = 0;
      for (int c = 0; c < mesh.cell_slots(); ++c) count += mesh.is_cell_alive(c) && mesh.quality(c) < 0.05;
      return count;
    };
    const int at_start = count_slivers();
    for (int i = 0; i < 20000; ++i) {
      const auto operation = static_cast<Operation>(1 + random() % 4);
      if (const auto proposal = propose_at_random(mesh, strata, operation, random, {.fraction = 1, .floor = 0.3}))
        apply(mesh, strata, *proposal.edit);
    }
    EXPECT_EQ(mesh.find_defect(), "");
    EXPECT_EQ(strata.find_defect(mesh), "");
    EXPECT_EQ(Invariants(mesh, strata).difference(before, 1e-12), "") << seed;
    slivers += at_start;
    fewer += at_start - count_slivers();
    ++meshes;
  }
  EXPECT_GT(slivers, 10 * meshes);
  EXPECT_GT(fewer, slivers / 2);
}

}  // namespace
}  // namespace itr
