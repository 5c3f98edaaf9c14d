// SPDX-License-Identifier: MIT
// Edits of tetrahedral meshes: what they keep, what they refuse and why.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "random_tets.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

/// All that is conserved, on meshes with slivers, holes, several bodies, curved and flat surfaces, bodies that touch by an
/// edge.
TEST(Edits3D, KeepBodiesTagsPatchesFeaturesAndTopology) {
  std::map<Operation, int> done;
  std::map<Operation, std::map<Refusal, long>> refused;
  int slivers = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(2 + static_cast<int>(seed) % 3, random, seed % 2);
    Strata<3> strata(mesh);
    ASSERT_EQ(strata.find_defect(mesh), "") << seed;
    const Invariants before(mesh, strata);
    slivers += worst_cell(mesh) < 1e-2;
    for (int i = 0; i < 400; ++i) {
      const auto operation = static_cast<Operation>(random() % 5);
      const auto proposal = propose_at_random(mesh, strata, operation, random);
      EXPECT_EQ(proposal.refusal == Refusal::none, proposal.edit.has_value());
      if (!proposal) {
        ++refused[operation][proposal.refusal];
        continue;
      }
      ++done[operation];
      const auto& value = proposal.edit->value;
      if (value) {  // fields that are linear in space stay so
        Vec<3> sum = Vec<3>::Zero();
        for (int k = 0; k < value->num_parents; ++k) sum += value->weights[k] * mesh.rest(value->parents[k]);
        EXPECT_LT((sum - value->rest).norm(), 1e-12);
      }
      apply(mesh, strata, *proposal.edit);
      if (i % 50 == 0) {
        ASSERT_EQ(Invariants(mesh, strata).difference(before, 1e-12), "") << seed << ", edit " << i;
      }
    }
    ASSERT_EQ(mesh.find_defect(), "") << seed;
    ASSERT_EQ(strata.find_defect(mesh), "") << seed;
    strata.compact(mesh.compact());
    ASSERT_EQ(mesh.find_defect(), "") << seed;
    ASSERT_EQ(strata.find_defect(mesh), "") << seed;
    EXPECT_EQ(Invariants(mesh, strata).difference(before, 1e-12), "") << seed;
    const Strata<3> anew(mesh);  // what was carried is what the mesh shows
    EXPECT_EQ(anew.num_patches(), strata.num_patches());
    for (int v = 0; v < mesh.node_slots(); ++v) EXPECT_EQ(anew.vertex(v), strata.vertex(v)) << seed << ", vertex " << v;
  }
  EXPECT_GT(slivers, 5);
  EXPECT_EQ(done.size(), 5u);
  for (const auto& [operation, count] : done) EXPECT_GT(count, 100) << static_cast<int>(operation);
  EXPECT_GT(refused[Operation::collapse][Refusal::held], 0);
  EXPECT_GT(refused[Operation::collapse][Refusal::link], 0);
  EXPECT_GT(refused[Operation::collapse][Refusal::non_manifold], 0);
  EXPECT_GT(refused[Operation::edge_removal][Refusal::held], 0);
  EXPECT_GT(refused[Operation::edge_removal][Refusal::long_ring], 0);
  EXPECT_GT(refused[Operation::facet_removal][Refusal::exists], 0);
  EXPECT_GT(refused[Operation::move][Refusal::outside], 0);
  for (const auto operation : {Operation::collapse, Operation::edge_removal, Operation::facet_removal, Operation::move})
    EXPECT_GT(refused[operation][Refusal::shape], 0) << static_cast<int>(operation);
}

/// The part of the boundary that conditions at vertices hold: facets and edges whose ends all have the same tag.
struct HeldPart {
  double area = 0, length = 0;  ///< length: of edges that are not at a facet that is held
  explicit HeldPart(const Mesh<3>& mesh) {
    const auto joined = [&](VertexId a, VertexId b) {
      return mesh.vertex_tag(a) != kNoTag && mesh.vertex_tag(a) == mesh.vertex_tag(b);
    };
    const auto is_held = [&](FacetId f) {
      const auto& [a, b, c] = mesh.facet(f);
      return joined(a, b) && joined(b, c);
    };
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
      if (!mesh.is_facet_alive(f)) continue;
      const auto& facet = mesh.facet(f);
      const Vec<3> u = mesh.rest(facet[1]) - mesh.rest(facet[0]), v = mesh.rest(facet[2]) - mesh.rest(facet[0]);
      if (is_held(f)) area += u.cross(v).norm() / 2;
      for (int k = 0; k < 3; ++k) {
        const EdgeKey edge{facet[k], facet[(k + 1) % 3]};
        const auto around = mesh.facets_of_edge(edge);
        if (joined(edge[0], edge[1]) && std::ranges::none_of(around, is_held))
          length += (mesh.rest(edge[0]) - mesh.rest(edge[1])).norm() / static_cast<double>(around.size());
      }
    }
  }
};

TEST(Edits3D, KeepVerticesWithTagsAndWhatTheyHold) {
  double areas = 0, lengths = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(2 + static_cast<int>(seed) % 3, random, false);
    const Vec<3> middle = mesh.rest(mesh.facet(0)[0]);
    std::map<VertexId, Vec<3>> held;
    for (VertexId v = 0; v < mesh.node_slots(); ++v) {
      if (!mesh.is_boundary(v) || ((mesh.rest(v) - middle).norm() > 0.5 && random() % 3)) continue;
      mesh.set_vertex_tag(v, 7 + static_cast<int>(random() % 8 == 0));
      held[v] = mesh.rest(v);
    }
    Strata<3> strata(mesh);
    const HeldPart before(mesh);
    areas += before.area;
    lengths += before.length;
    for (int i = 0; i < 1000; ++i) {
      const auto proposal = propose_at_random(mesh, strata, static_cast<Operation>(random() % 5), random);
      if (proposal) apply(mesh, strata, *proposal.edit);
    }
    for (const auto& [v, place] : held) {
      ASSERT_TRUE(mesh.is_vertex_alive(v)) << seed;
      ASSERT_EQ(mesh.rest(v), place) << seed;
    }
    mesh.compact();
    const HeldPart after(mesh);
    EXPECT_NEAR(after.area, before.area, 1e-12) << seed;
    EXPECT_NEAR(after.length, before.length, 1e-12) << seed;
  }
  EXPECT_GT(areas, 5);
  EXPECT_GT(lengths, 10);
}

/// Proposals on triangles follow the same rules.
TEST(Edits3D, HaveTheSameRulesInTwoDimensions) {
  std::map<Edit<2>::Kind, int> done;
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-0.05, 0.05);
    const auto place = [&](int i, int j) {
      const bool inside = i > 0 && i < 4 && i != 2 && j > 0 && j < 4;
      return Vec<2>(0.25 * i + (inside ? noise(random) : 0), 0.25 * j + (inside ? noise(random) : 0));
    };
    const Grid grid = make_grid(4, place, [&](int, int) { return random() % 2; });
    std::vector<int> body;
    for (const auto& cell : grid.cells)
      body.push_back(grid.rest[cell[0]][0] + grid.rest[cell[1]][0] + grid.rest[cell[2]][0] < 1.5 ? 1 : 2);
    Mesh<2> mesh(grid.rest, grid.cells, body);
    tag_sides(mesh, 1);
    Strata<2> strata(mesh);
    const auto totals = [&] {
      std::map<int, double> sum;
      for (int c = 0; c < mesh.cell_slots(); ++c)
        if (mesh.is_cell_alive(c)) sum[mesh.body(c)] += mesh.volume(c);
      for (int f = 0; f < mesh.facet_slots(); ++f)
        if (mesh.is_facet_alive(f))
          sum[10 + mesh.facet_tag(f)] += (mesh.rest(mesh.facet(f)[1]) - mesh.rest(mesh.facet(f)[0])).norm();
      return sum;
    };
    const auto before = totals();
    for (int i = 0; i < 200; ++i) {
      const auto edges = mesh.edges();
      const EdgeKey edge = edges[random() % edges.size()];
      const auto kind = random() % 4;
      Proposal<2> proposal = kind == 0 ? propose_split<2>(mesh, edge)
                             : kind == 1
                                 ? propose_collapse<2>(mesh, strata, edge)
                                 : propose_move<2>(mesh, strata, edge[0], best_shaped_position<2>(mesh, strata, edge[0], 3));
      if (kind == 3) proposal = propose_diagonal_swap(mesh, strata, edge);
      if (!proposal) continue;
      ++done[proposal.edit->kind];
      strata.follow(*proposal.edit, mesh.apply(*proposal.edit));
    }
    ASSERT_EQ(mesh.find_defect(), "");
    ASSERT_EQ(strata.find_defect(mesh), "");
    strata.compact(mesh.compact());
    const Strata<2> anew(mesh);
    EXPECT_EQ(anew.num_patches(), 7);
    for (int v = 0; v < mesh.node_slots(); ++v) EXPECT_EQ(anew.vertex(v), strata.vertex(v));
    for (const auto& [key, sum] : totals()) EXPECT_NEAR(sum, before.at(key), 1e-13);
  }
  EXPECT_EQ(done.size(), 4u);
  for (const auto& [kind, count] : done) EXPECT_GT(count, 20);
}

/// Two tetrahedra on a triangle, and n around an edge, both turned.
Mesh<3> two_on_a_triangle() {
  return {{{0, 0, 0}, {1, 0, 0}, {0.4, 0.9, 0}, {0.4, 0.3, 0.8}, {0.5, 0.3, -0.7}}, {{0, 1, 2, 3}, {0, 2, 1, 4}}, {1, 1}};
}
Mesh<3> ring_of(int n, std::mt19937& random, double noise = 0.1) {
  std::uniform_real_distribution<double> off(-noise, noise);
  std::vector<Vec<3>> rest = {{0, 0, -1}, {0, 0, 1}};
  std::vector<Mesh<3>::Cell> cells;
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * M_PI * i / n, radius = 1 + off(random);
    rest.emplace_back(radius * std::cos(angle), radius * std::sin(angle), off(random));
    cells.push_back({0, 1, 2 + i, 2 + (i + 1) % n});
  }
  return {rest, cells, std::vector<int>(cells.size(), 1)};
}

constexpr QualityRule kAnything{.fraction = 0, .floor = 0};

TEST(Edits3D, SwapsOfTwoToThreeAndBackAreInverse) {
  Mesh<3> mesh = two_on_a_triangle();
  Strata<3> strata(mesh);
  const auto there = propose_facet_removal(mesh, {0, 1, 2}, kAnything);
  ASSERT_TRUE(there);
  EXPECT_EQ(there.edit->edge, (EdgeKey{3, 4}));
  apply(mesh, strata, *there.edit);
  EXPECT_EQ(mesh.num_cells(), 3);
  EXPECT_EQ(mesh.find_defect(), "");
  EXPECT_EQ(propose_facet_removal(mesh, {0, 1, 2}).refusal, Refusal::gone);
  const auto back = propose_edge_removal(mesh, strata, {3, 4}, shape_cost(mesh), kAnything);
  ASSERT_TRUE(back);
  apply(mesh, strata, *back.edit);
  EXPECT_EQ(mesh.find_defect(), "");
  mesh.compact();
  std::set<Mesh<3>::Cell> cells;
  for (int c = 0; c < mesh.num_cells(); ++c) cells.insert(ascending(mesh.cell(c)));
  EXPECT_EQ(cells, (std::set<Mesh<3>::Cell>{{0, 1, 2, 3}, {0, 1, 2, 4}}));
}

/// All triangulations of a polygon, by brute force.
double least_sum(int i, int j, const std::function<double(int, int, int)>& cost) {
  if (j - i < 2) return 0;
  double best = HUGE_VAL;
  for (int k = i + 1; k < j; ++k) best = std::min(best, least_sum(i, k, cost) + least_sum(k, j, cost) + cost(i, k, j));
  return best;
}

TEST(Edits3D, EdgeRemovalHasTheLeastCostOfAllTriangulations) {
  std::mt19937 random(3);
  int forbidden = 0;
  for (int n = 3; n <= kLongestRing; ++n)
    for (int repeat = 0; repeat < 40; ++repeat) {
      Mesh<3> mesh = ring_of(n, random);
      Strata<3> strata(mesh);
      const unsigned salt = random();
      // Any number by the cell's vertices, sometimes infinite, sometimes negative.
      const CellCost cost = [&](const Mesh<3>::Cell& cell, int body, const Edit<3>&) {
        EXPECT_EQ(body, 1);
        unsigned hash = salt;
        for (const int v : ascending(cell)) hash = (hash ^ static_cast<unsigned>(v)) * 2654435761u;
        return hash >> 16 & 15 ? (hash >> 8 & 1023) - 100.0 : HUGE_VAL;
      };
      const Edit<3> none{.kind = Edit<3>::Kind::swap};
      const double expected = least_sum(0, n - 1, [&](int i, int k, int j) {
        return cost({2 + i, 2 + k, 2 + j, 1}, 1, none) + cost({2 + i, 2 + j, 2 + k, 0}, 1, none);
      });
      const auto proposal = propose_edge_removal(mesh, strata, {0, 1}, cost, kAnything);
      EXPECT_EQ(proposal.edit.has_value(), expected < HUGE_VAL);
      if (!proposal) {
        EXPECT_EQ(proposal.refusal, Refusal::cost);
        ++forbidden;
        continue;
      }
      double sum = 0;
      for (const auto& cell : proposal.edit->inserted_cells) sum += cost(cell.vertices, cell.body, *proposal.edit);
      EXPECT_EQ(sum, expected);
      EXPECT_EQ(proposal.edit->inserted_cells.size(), 2u * (n - 2));
      const double volume = mesh.total_volume();
      apply(mesh, strata, *proposal.edit);
      EXPECT_EQ(mesh.find_defect(), "");
      EXPECT_NEAR(mesh.total_volume(), volume, 1e-14);
    }
  EXPECT_GT(forbidden, 5);
}

TEST(Edits3D, EdgesOnPatchesOfTheSurfaceAndOfInterfacesAreRemovedInTheirPlane) {
  for (const bool two_bodies : {false, true}) {
    Mesh<3> mesh = make_cubes(3, unit_grid(3), [&](int i, int, int) { return two_bodies && i > 0 ? 2 : 1; });
    Strata<3> strata(mesh);
    const Invariants before(mesh, strata);
    int surface = 0, interface = 0;
    for (const EdgeKey& edge : mesh.edges()) {
      if (mesh.cells_of_edge(edge).empty() || strata.edge(mesh, edge) != Stratum::surface) continue;
      const bool on_boundary = !mesh.facets_of_edge(edge).empty();
      const auto proposal = propose_edge_removal(mesh, strata, edge, shape_cost(mesh), kAnything);
      if (!proposal) continue;
      ++(on_boundary ? surface : interface);
      EXPECT_EQ(proposal.edit->removed_facets.size(), on_boundary ? 2u : 0u);
      EXPECT_EQ(proposal.edit->inserted_interfaces.size(), on_boundary ? 0u : 2u);
      apply(mesh, strata, *proposal.edit);
      ASSERT_EQ(mesh.find_defect(), "");
      ASSERT_EQ(strata.find_defect(mesh), "");
    }
    EXPECT_EQ(Invariants(mesh, strata).difference(before, 1e-13), "");
    EXPECT_GT(surface, 10);
    EXPECT_EQ(interface > 0, two_bodies);
  }
}

TEST(Edits3D, RefusalsHaveNamesAndReasons) {
  for (int r = 0; r < kRefusals; ++r) EXPECT_NE(name(static_cast<Refusal>(r)), "");
  const Mesh<3> cube = make_cubes(2, unit_grid(2), [](int i, int, int) { return i + 1; });
  const Strata<3> strata(cube);
  const auto at = [&](const Mesh<3>& mesh, double x, double y, double z) {
    for (int v = 0; v < mesh.node_slots(); ++v)
      if (mesh.rest(v) == Vec<3>(x, y, z)) return v;
    return kNone;
  };
  const auto edge = [&](const Mesh<3>& mesh, const Vec<3>& a, const Vec<3>& b) {
    const int u = at(mesh, a[0], a[1], a[2]), v = at(mesh, b[0], b[1], b[2]);
    return EdgeKey{std::min(u, v), std::max(u, v)};
  };
  const VertexId centre = at(cube, 0.5, 0.5, 0.5), corner = at(cube, 0, 0, 0);
  EXPECT_EQ(strata.vertex(centre), Stratum::surface);  // of the interface
  EXPECT_EQ(propose_collapse<3>(cube, strata, edge(cube, {0, 0, 0}, {1, 1, 0})).refusal, Refusal::gone);
  EXPECT_EQ(propose_split<3>(cube, edge(cube, {0, 0, 0}, {1, 1, 0})).refusal, Refusal::gone);
  // A corner along a feature to a feature's vertex: the corner stays, the other goes.
  const auto along = propose_collapse<3>(cube, strata, edge(cube, {0, 0, 0}, {0, 0.5, 0}), kAnything);
  ASSERT_TRUE(along);
  EXPECT_EQ(along.edit->value->vertex, corner);
  // From the interface to the surface through the volume; the centre may not leave its plane.
  EXPECT_EQ(propose_collapse<3>(cube, strata, edge(cube, {0, 0, 0}, {0.5, 0.5, 0.5}), kAnything).refusal, Refusal::held);
  EXPECT_EQ(propose_move<3>(cube, strata, corner, {0.1, 0.1, 0.1}, kAnything).refusal, Refusal::held);
  const auto move = propose_move<3>(cube, strata, centre, {0.7, 0.6, 0.55}, kAnything);
  ASSERT_TRUE(move);
  EXPECT_LT((move.edit->value->rest - Vec<3>(0.5, 0.6, 0.55)).norm(), 1e-15);
  EXPECT_EQ(propose_move<3>(cube, strata, centre, {0.5, 1.2, 0.5}, kAnything).refusal, Refusal::outside);
  EXPECT_EQ(propose_edge_removal(cube, strata, edge(cube, {0, 0, 0}, {0, 0.5, 0}), shape_cost(cube)).refusal, Refusal::held);
  EXPECT_EQ(propose_facet_removal(cube, cube.facet(0)).refusal, Refusal::held);

  const Mesh<3> touching = make_cubes(2, unit_grid(2), [](int i, int j, int k) { return k == 0 && i == j ? 1 : kNone; });
  const Strata<3> of_touching(touching);
  const EdgeKey shared = edge(touching, {0.5, 0.5, 0}, {0.5, 0.5, 0.5});
  EXPECT_EQ(of_touching.edge(touching, shared), Stratum::non_manifold);
  EXPECT_EQ(propose_collapse<3>(touching, of_touching, shared, kAnything).refusal, Refusal::non_manifold);
  EXPECT_EQ(propose_edge_removal(touching, of_touching, shared, shape_cost(touching)).refusal, Refusal::non_manifold);
  EXPECT_EQ(propose_move<3>(touching, of_touching, shared[0], {0, 0, 0}).refusal, Refusal::non_manifold);
  EXPECT_TRUE(propose_split<3>(touching, shared));  // a split is possible, and what it makes is as much held
  Mesh<3> split = touching;
  Strata<3> of_split = of_touching;
  EXPECT_EQ(of_split.vertex(apply(split, of_split, make_split(split, shared))), Stratum::non_manifold);

  std::mt19937 random(5);
  const Mesh<3> wide = ring_of(kLongestRing + 1, random);
  EXPECT_EQ(propose_edge_removal(wide, Strata<3>(wide), {0, 1}, shape_cost(wide), kAnything).refusal, Refusal::long_ring);
}

/// Collapses that the link condition refuses would make a facet with more than two cells, a cell twice, or other holes.
TEST(Edits3D, LinkConditionRefusesOnlyWhatChangesTheTopology) {
  const auto faces_of = [](const std::set<Mesh<3>::Cell>& cells) {
    std::set<std::vector<int>> faces;
    for (const auto& cell : cells)
      for (int mask = 1; mask < 16; ++mask) {
        std::vector<int> face;
        for (int k = 0; k < 4; ++k)
          if (mask >> k & 1) face.push_back(cell[k]);
        faces.insert(face);
      }
    return faces;
  };
  const auto euler = [](const std::set<std::vector<int>>& faces) {
    long sum = 0;
    for (const auto& face : faces) sum += face.size() % 2 ? 1 : -1;
    return sum;
  };
  int refused = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(3, random, false);
    Strata<3> strata(mesh);
    for (int i = 0; i < 300; ++i)
      if (const auto edit = propose_at_random(mesh, strata, static_cast<Operation>(1 + random() % 4), random))
        apply(mesh, strata, *edit.edit);
    strata.compact(mesh.compact());
    std::set<Mesh<3>::Cell> before;
    for (int c = 0; c < mesh.cell_slots(); ++c) before.insert(ascending(mesh.cell(c)));
    for (const EdgeKey& edge : mesh.edges()) {
      if (strata.edge(mesh, edge) != Stratum::volume) continue;
      if (propose_collapse<3>(mesh, strata, edge, kAnything).refusal != Refusal::link) continue;
      ++refused;
      std::set<Mesh<3>::Cell> after;
      std::map<Mesh<3>::Facet, int> cells_at;
      bool is_broken = false;
      for (auto cell : before) {
        std::replace(cell.begin(), cell.end(), edge[1], edge[0]);
        cell = ascending(cell);
        if (std::adjacent_find(cell.begin(), cell.end()) != cell.end()) continue;
        is_broken = is_broken || !after.insert(cell).second;
        for (int k = 0; k < 4; ++k) is_broken = is_broken || ++cells_at[ascending(opposite_facet<3>(cell, k))] > 2;
      }
      EXPECT_TRUE(is_broken || euler(faces_of(after)) != euler(faces_of(before))) << seed;
    }
  }
  EXPECT_GT(refused, 20);
}

/// A sliver flat on a patch: its inner triangle a-b-u has all edges on the surface. Collapsing one of them would lay the
/// facets beyond onto each other, which only the link condition among facets sees.
TEST(Edits3D, LinkConditionOfPatchesSeesSliversOnThem) {
  const Mesh<3> cube = make_cubes(3, unit_grid(3), [](int, int, int) { return 1; });
  const Strata<3> of_cube(cube);
  int slivers = 0;
  for (FacetId f = 0; f < cube.facet_slots(); ++f) {
    const auto [a, b, u] = cube.facet(f);
    if (cube.facet_tag(f) != 5 || of_cube.vertex(a) != Stratum::surface) continue;
    std::vector<Vec<3>> rest;
    std::vector<Mesh<3>::Cell> cells;
    for (int v = 0; v < cube.node_slots(); ++v) rest.push_back(cube.rest(v));
    for (int c = 0; c < cube.cell_slots(); ++c) cells.push_back(cube.cell(c));
    cells.push_back({a, b, u, static_cast<int>(rest.size())});
    rest.push_back((rest[a] + rest[b] + rest[u]) / 3 + Vec<3>(0, 0, 1e-13));
    const Mesh<3> mesh(rest, cells, std::vector<int>(cells.size(), 1));
    const Strata<3> strata(mesh);
    EXPECT_EQ(strata.num_patches(), 6);
    for (const VertexId end : {b, u}) {
      const EdgeKey edge{std::min(a, end), std::max(a, end)};
      EXPECT_EQ(strata.edge(mesh, edge), Stratum::surface);
      EXPECT_EQ(propose_collapse<3>(mesh, strata, edge, kAnything).refusal, Refusal::link);
    }
    ++slivers;
  }
  EXPECT_GT(slivers, 3);
}

TEST(Edits3D, QualityNeverFallsBelowTheFloorOrWhatItWas) {
  const QualityRule rule{.fraction = 0.2, .floor = 0.15};
  for (unsigned seed = 0; seed < 12; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(3, random, seed % 2);
    Strata<3> strata(mesh);
    const double worst = worst_cell(mesh);
    for (int i = 0; i < 600; ++i) {
      const auto operation = static_cast<Operation>(1 + random() % 4);  // all but splits
      if (const auto proposal = propose_at_random(mesh, strata, operation, random, rule))
        apply(mesh, strata, *proposal.edit);
    }
    EXPECT_GE(worst_cell(mesh), std::min(worst, rule.floor));
  }
}

/// Swaps, collapses and moves that only ever improve their cavity's worst cell.
TEST(Edits3D, SliversOfTheInputCanBeImproved) {
  int improved = 0, meshes = 0;
  for (unsigned seed = 1; seed < 12; seed += 2) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(3, random, true);
    Strata<3> strata(mesh);
    const double before = worst_cell(mesh);
    if (before > 0.01) continue;
    ++meshes;
    for (int i = 0; i < 4000; ++i) {
      const auto operation = static_cast<Operation>(1 + random() % 4);
      if (const auto proposal = propose_at_random(mesh, strata, operation, random, {.fraction = 1, .floor = 0.3}))
        apply(mesh, strata, *proposal.edit);
    }
    ASSERT_EQ(mesh.find_defect(), "");
    EXPECT_GE(worst_cell(mesh), before);
    improved += worst_cell(mesh) > 10 * before;
  }
  EXPECT_GT(meshes, 3);
  EXPECT_EQ(improved, meshes);
}

TEST(Edits3D, BestShapedPositionIsTheCentreOfARegularStarAndStaysInItsStratum) {
  std::vector<Vec<3>> rest = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}, {0.3, -0.2, 0.25}};
  std::vector<Mesh<3>::Cell> cells;
  for (const int x : {0, 1})
    for (const int y : {2, 3})
      for (const int z : {4, 5}) cells.push_back((x + y + z) % 2 ? Mesh<3>::Cell{6, y, x, z} : Mesh<3>::Cell{6, x, y, z});
  const Mesh<3> octahedron(rest, cells, std::vector<int>(8, 1));
  EXPECT_LT(best_shaped_position<3>(octahedron, Strata<3>(octahedron), 6, 12).norm(), 1e-12);  // quadratically

  const Mesh<3> cube = make_cubes(2, unit_grid(2), [](int, int, int) { return 1; });
  Mesh<3> moved = cube;
  Strata<3> strata(cube);
  int surface = 0, feature = 0;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> noise(-0.1, 0.1);
  for (int v = 0; v < cube.node_slots(); ++v) {
    const auto move = propose_move<3>(moved, strata, v, moved.rest(v) + Vec<3>(noise(random), noise(random), noise(random)));
    EXPECT_EQ(move.edit.has_value(), strata.vertex(v) != Stratum::corner);
    if (!move) continue;
    apply(moved, strata, *move.edit);
    surface += strata.vertex(v) == Stratum::surface;
    feature += strata.vertex(v) == Stratum::feature;
    const Vec<3> best = best_shaped_position<3>(moved, strata, v, 10);
    const auto measure = [&](const Vec<3>& X) {
      double sum = 0;
      for (const CellId c : moved.cells_of(v)) {
        std::array<Vec<3>, 4> p;
        for (int k = 0; k < 4; ++k) p[k] = moved.cell(c)[k] == v ? X : moved.rest(moved.cell(c)[k]);
        double squares = 0;  // tr(J^T J) of a simplex is its squared edges by those of the regular one, up to a factor
        for (int i = 0; i < 4; ++i)
          for (int j = 0; j < i; ++j) squares += (p[i] - p[j]).squaredNorm();
        sum += squares / std::cbrt(std::pow(simplex_volume<3>(p), 2));
      }
      return sum;
    };
    const Mat<3> P = strata.tangent_projector(moved, v);
    EXPECT_LT(((Mat<3>::Identity() - P) * (best - cube.rest(v))).norm(), 1e-14);
    for (int axis = 0; axis < 3; ++axis)  // no way along the stratum leads lower
      for (const double step : {-1e-4, 1e-4})
        EXPECT_GE(measure(best + step * P * Vec<3>::Unit(axis)), measure(best) * (1 - 1e-13));
  }
  EXPECT_EQ(surface, 6);
  EXPECT_EQ(feature, 12);
}

}  // namespace
}  // namespace itr
