// SPDX-License-Identifier: MIT
// The mesh itself: what it refuses, uniform refinement, edits as values, compaction, and that find_defect finds defects.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>
#include <random>
#include <set>

#include "fem/inverted.hpp"
#include "geometry/measures.hpp"
#include "geometry/predicates.hpp"
#include "itr/core.hpp"
#include "itr/mesh.hpp"
#include "mesh/refine.hpp"
#include "remesh/edits.hpp"

namespace itr {
namespace {

using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;

/// A unit box of n^Dim perturbed cubes, cut into simplices along their main diagonals (Kuhn); body 1 below the middle of the
/// first axis, body 2 above; facet tag = 2 * axis + side.
template <int Dim>
Mesh<Dim> make_box(int n, unsigned seed = 0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> noise(-0.15 / n, 0.15 / n);
  std::vector<Vec<Dim>> rest;
  std::vector<typename Mesh<Dim>::Cell> cells;
  std::vector<int> body;
  const int vertices = static_cast<int>(std::pow(n + 1, Dim)), cubes = static_cast<int>(std::pow(n, Dim));
  const auto digits = [](int index, int base) {
    std::array<int, Dim> d;
    for (int k = 0; k < Dim; ++k, index /= base) d[k] = index % base;
    return d;
  };
  const auto index = [&](const std::array<int, Dim>& d) {
    int i = 0;
    for (int k = Dim - 1; k >= 0; --k) i = i * (n + 1) + d[k];
    return i;
  };
  for (int v = 0; v < vertices; ++v) {
    Vec<Dim> p;
    for (int k = 0; k < Dim; ++k) {
      const int i = digits(v, n + 1)[k];
      p[k] = double(i) / n + (i > 0 && i < n && 2 * i != n ? noise(random) : 0);
    }
    rest.push_back(p);
  }
  for (int cube = 0; cube < cubes; ++cube) {
    const auto corner = digits(cube, n);
    std::array<int, Dim> axes;
    for (int k = 0; k < Dim; ++k) axes[k] = k;
    do {
      typename Mesh<Dim>::Cell cell;
      auto at = corner;
      cell[0] = index(at);
      for (int k = 0; k < Dim; ++k) {
        ++at[axes[k]];
        cell[k + 1] = index(at);
      }
      std::array<Vec<Dim>, Dim + 1> p;
      for (int k = 0; k <= Dim; ++k) p[k] = rest[cell[k]];
      if (simplex_volume<Dim>(p) < 0) std::swap(cell[Dim - 1], cell[Dim]);
      cells.push_back(cell);
      body.push_back(2 * corner[0] < n ? 1 : 2);
    } while (std::next_permutation(axes.begin(), axes.end()));
  }
  Mesh<Dim> mesh(rest, cells, body);
  for (int f = 0; f < mesh.facet_slots(); ++f)
    for (int axis = 0; axis < Dim; ++axis)
      for (int side = 0; side < 2; ++side) {
        bool on = true;
        for (const int v : mesh.facet(f)) on = on && mesh.rest(v)[axis] == side;
        if (on) mesh.set_facet_tag(f, 2 * axis + side);
      }
  return mesh;
}

/// Volume by body, and boundary area and outward area vector by tag.
template <int Dim>
struct Totals {
  std::map<int, double> volume, area;
  std::map<int, Vec<Dim>> normal;
  explicit Totals(const Mesh<Dim>& mesh) {
    for (int c = 0; c < mesh.cell_slots(); ++c)
      if (mesh.is_cell_alive(c)) volume[mesh.body(c)] += mesh.volume(c);
    for (int f = 0; f < mesh.facet_slots(); ++f) {
      if (!mesh.is_facet_alive(f)) continue;
      const auto& facet = mesh.facet(f);
      Vec<Dim> n;
      if constexpr (Dim == 2) {
        const Vec<2> along = mesh.rest(facet[1]) - mesh.rest(facet[0]);
        n = Vec<2>(along[1], -along[0]);
      } else {
        n = 0.5 * Vec<3>(mesh.rest(facet[1]) - mesh.rest(facet[0])).cross(Vec<3>(mesh.rest(facet[2]) - mesh.rest(facet[0])));
      }
      area[mesh.facet_tag(f)] += n.norm();
      normal.try_emplace(mesh.facet_tag(f), Vec<Dim>::Zero()).first->second += n;
    }
  }
  void expect_same_as(const Totals& other) const {
    EXPECT_EQ(volume.size(), other.volume.size());
    EXPECT_EQ(area.size(), other.area.size());
    for (const auto& [body, v] : volume) EXPECT_NEAR(v, other.volume.at(body), 1e-14);
    for (const auto& [tag, a] : area) EXPECT_NEAR(a, other.area.at(tag), 1e-14);
    for (const auto& [tag, n] : normal) EXPECT_LE((n - other.normal.at(tag)).norm(), 1e-14);
  }
};

template <typename T>
class MeshOf : public ::testing::Test {};
TYPED_TEST_SUITE(MeshOf, Dimensions);

template <int Dim>
std::string refusal(std::vector<Vec<Dim>> rest, std::vector<typename Mesh<Dim>::Cell> cells) {
  const std::vector<int> body(cells.size(), 0);
  try {
    const Mesh<Dim> mesh(std::move(rest), std::move(cells), body);
  } catch (const InputError& error) {
    EXPECT_NE(error.parts().expected, "");
    return error.parts().place + ": " + error.parts().found;
  }
  return "";
}

TEST(Mesh, RefusesWhatIsNoMeshAndNamesTheCell) {
  const std::vector<Vec<2>> square = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  EXPECT_EQ(refusal<2>(square, {{0, 1, 2}, {0, 2, 3}}), "");
  EXPECT_EQ(refusal<2>(square, {{0, 1, 2}, {0, 2, 4}}), "cell 1: vertex index 4");
  EXPECT_EQ(refusal<2>(square, {{0, 1, 2}, {0, -1, 3}}), "cell 1: vertex index -1");
  EXPECT_EQ(refusal<2>(square, {{0, 2, 1}}).find("cell 0: rest volume -0.5"), 0u);
  EXPECT_EQ(refusal<2>({{0, 0}, {1, 0}, {2, 0}}, {{0, 1, 2}}).find("cell 0: rest volume 0"), 0u);
  EXPECT_EQ(refusal<2>({{0, 0}, {1, 0}, {0, HUGE_VAL}}, {{0, 1, 2}}).find("cell 0: rest volume"), 0u);
  EXPECT_EQ(refusal<2>({{0, 0}, {1, 0}, {0, std::nan("")}}, {{0, 1, 2}}).find("cell 0: rest volume"), 0u);
  EXPECT_EQ(refusal<2>({{0, 0}, {1, 0}, {0, 1}, {1, -1}, {0.5, 2}}, {{0, 1, 2}, {0, 3, 1}, {0, 1, 4}}),
            "cell 2: a facet with more than two cells");
  EXPECT_EQ(refusal<2>({{0, 0}, {1, 0}, {0, 1}, {1, 1}}, {{0, 1, 2}, {0, 1, 3}}),
            "cell 1: a cell that lies on another one of the same facet, or is there twice");
  const std::vector<Vec<3>> tetrahedron = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_EQ(refusal<3>(tetrahedron, {{0, 1, 2, 3}}), "");
  EXPECT_EQ(refusal<3>(tetrahedron, {{0, 2, 1, 3}}).find("cell 0: rest volume -0.1666"), 0u);
  EXPECT_EQ(refusal<3>(tetrahedron, {{0, 1, 2, 7}}), "cell 0: vertex index 7");
}

TYPED_TEST(MeshOf, BoundaryIsClosedAndPointsOutward) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = make_box<Dim>(2, 1);
  EXPECT_EQ(mesh.find_defect(), "");
  EXPECT_NEAR(mesh.total_volume(), 1, 1e-14);
  const Totals<Dim> totals(mesh);
  for (int axis = 0; axis < Dim; ++axis)
    for (int side = 0; side < 2; ++side)
      EXPECT_LE((totals.normal.at(2 * axis + side) - (2 * side - 1) * Vec<Dim>::Unit(axis)).norm(), 1e-14);
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    auto shuffled = mesh.facet(f);
    std::reverse(shuffled.begin(), shuffled.end());
    EXPECT_EQ(mesh.find_facet(shuffled), f);
    for (const int v : shuffled) EXPECT_TRUE(mesh.is_boundary(v));
  }
}

TYPED_TEST(MeshOf, UniformRefinementKeepsTheDomainItsTagsAndIsConforming) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> coarse = make_box<Dim>(2, 2), fine = refine_uniformly(coarse);
  // Facets with one cell are the boundary: with a hanging vertex there would be more of them, and inside.
  EXPECT_EQ(fine.find_defect(), "");
  EXPECT_EQ(fine.num_cells(), (1 << Dim) * coarse.num_cells());
  EXPECT_EQ(fine.num_facets(), (1 << (Dim - 1)) * coarse.num_facets());
  EXPECT_EQ(fine.num_vertices(), coarse.num_vertices() + static_cast<int>(coarse.edges().size()));
  Totals<Dim>(fine).expect_same_as(Totals<Dim>(coarse));
  for (int v = 0; v < coarse.num_vertices(); ++v) EXPECT_EQ(fine.rest(v), coarse.rest(v));
  for (int c = 0; c < fine.cell_slots(); ++c)  // children of a cell come together, with equal volumes and its body
    EXPECT_NEAR(fine.volume(c), coarse.volume(c >> Dim) / (1 << Dim), 1e-15);
  std::set<std::vector<double>> places;
  for (int v = 0; v < fine.num_vertices(); ++v) places.emplace(fine.rest(v).data(), fine.rest(v).data() + Dim);
  EXPECT_EQ(static_cast<int>(places.size()), fine.num_vertices());
}

/// PolyFEM's rule: the inner octahedron is split along the midpoints of (0,1) and (2,3) of the vertices in ascending order.
TEST(Mesh, RefinementOfATetrahedronDependsOnItsNumbersAndNotOnTheirOrder) {
  const std::vector<Vec<3>> rest = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  // Midpoints by edge: 01: 4, 02: 5, 03: 6, 12: 7, 13: 8, 23: 9.
  const std::set<std::set<int>> expected = {{0, 4, 5, 6}, {1, 4, 7, 8}, {2, 5, 7, 9}, {3, 6, 8, 9},
                                            {4, 9, 5, 6}, {4, 9, 6, 8}, {4, 9, 8, 7}, {4, 9, 7, 5}};
  for (const Mesh<3>::Cell& cell : {Mesh<3>::Cell{0, 1, 2, 3}, {1, 2, 0, 3}, {2, 3, 0, 1}, {3, 0, 2, 1}}) {
    const Mesh<3> fine = refine_uniformly(Mesh<3>(rest, {cell}, {1}));
    EXPECT_EQ(fine.find_defect(), "");
    std::set<std::set<int>> children;
    for (int c = 0; c < fine.cell_slots(); ++c) children.emplace(fine.cell(c).begin(), fine.cell(c).end());
    EXPECT_EQ(children, expected);
    EXPECT_EQ(fine.rest(5), Vec<3>(0, 0.5, 0));
    EXPECT_EQ(fine.rest(8), Vec<3>(0.5, 0, 0.5));
  }
}

TYPED_TEST(MeshOf, SplitsKeepTheDomainAndItsTags) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(4);
  Mesh<Dim> mesh = make_box<Dim>(2, 3);
  const Totals<Dim> before(mesh);
  for (int i = 0; i < 60; ++i) {
    const auto edges = mesh.edges();
    const EdgeKey edge = edges[random() % edges.size()];
    const auto edit = make_split(mesh, edge);
    EXPECT_EQ(edit.inserted_cells.size(), 2 * edit.removed_cells.size());
    const VertexId expected = mesh.node_slots();
    EXPECT_EQ(mesh.apply(edit), expected);
    EXPECT_EQ(mesh.rest(expected), Vec<Dim>(0.5 * (mesh.rest(edge[0]) + mesh.rest(edge[1]))));
    ASSERT_EQ(mesh.find_defect(), "") << i;
    EXPECT_TRUE(mesh.cells_of_edge(edge).empty());
  }
  Totals<Dim>(mesh).expect_same_as(before);
}

/// Everything that a mesh shows of itself, for a comparison bit by bit.
template <int Dim>
struct Image {
  std::vector<std::vector<double>> rest, inverse_edges;
  std::vector<std::vector<int>> cells, facets, around, facets_around;
  std::vector<int> body, tags, counts;
  std::vector<double> volumes;
  explicit Image(const Mesh<Dim>& mesh) : counts{mesh.num_vertices(), mesh.num_cells(), mesh.num_facets()} {
    for (int v = 0; v < mesh.node_slots(); ++v) {
      rest.emplace_back(mesh.rest(v).data(), mesh.rest(v).data() + Dim);
      around.emplace_back(mesh.cells_of(v).begin(), mesh.cells_of(v).end());
      facets_around.emplace_back(mesh.facets_of(v).begin(), mesh.facets_of(v).end());
      counts.push_back(mesh.is_vertex_alive(v));
    }
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      cells.emplace_back(mesh.cell(c).begin(), mesh.cell(c).end());
      body.push_back(mesh.body(c));
      volumes.push_back(mesh.volume(c));
      const auto& inverse = mesh.inverse_rest_edges(c);
      inverse_edges.emplace_back(inverse.data(), inverse.data() + inverse.size());
    }
    for (int f = 0; f < mesh.facet_slots(); ++f) {
      facets.emplace_back(mesh.facet(f).begin(), mesh.facet(f).end());
      tags.push_back(mesh.facet_tag(f));
    }
  }
  bool operator==(const Image&) const = default;
};

TEST(Edits, AreMadeWithoutTouchingTheMeshAndCommitWhatTheyPreview) {
  std::mt19937 random(5);
  const Mesh<2> start = make_box<2>(4, 5);
  const Image<2> image(start);
  std::map<Edit<2>::Kind, int> made;
  const auto check = [&](const std::optional<Edit<2>>& edit) {
    if (!edit) return;
    ++made[edit->kind];
    Mesh<2> mesh = start;
    const VertexId created = mesh.apply(*edit);
    EXPECT_EQ(created != kNone, edit->value && edit->value->vertex == kNewVertex);
    EXPECT_EQ(mesh.num_cells(), start.num_cells() - static_cast<int>(edit->removed_cells.size()) +
                                    static_cast<int>(edit->inserted_cells.size()));
    EXPECT_EQ(mesh.cell_slots(), start.cell_slots() + static_cast<int>(edit->inserted_cells.size()));
    for (const CellId c : edit->removed_cells) EXPECT_FALSE(mesh.is_cell_alive(c));
    for (const FacetId f : edit->removed_facets) EXPECT_FALSE(mesh.is_facet_alive(f));
    for (std::size_t i = 0; i < edit->inserted_cells.size(); ++i) {
      auto expected = edit->inserted_cells[i].vertices;
      for (int& v : expected)
        if (v == kNewVertex) v = created;
      const CellId c = start.cell_slots() + static_cast<int>(i);
      EXPECT_EQ(mesh.cell(c), expected);
      EXPECT_EQ(mesh.body(c), edit->inserted_cells[i].body);
    }
    EXPECT_TRUE(edit->removed_vertex == kNone || !mesh.is_vertex_alive(edit->removed_vertex));
    EXPECT_EQ(mesh.find_defect(), "");
    // Vertices that the edit does not name stay where they were, bit for bit.
    for (int c = 0; c < start.cell_slots(); ++c)
      if (std::find(edit->removed_cells.begin(), edit->removed_cells.end(), c) == edit->removed_cells.end()) {
        EXPECT_EQ(mesh.cell(c), start.cell(c));
        EXPECT_EQ(mesh.volume(c), start.volume(c));
      }
  };
  const Strata<2> strata(start);
  for (const EdgeKey& edge : start.edges()) {
    check(make_split(start, edge));
    check(propose_collapse(start, strata, edge).edit);
    check(propose_diagonal_swap(start, strata, edge).edit);
  }
  for (int v = 0; v < start.num_vertices(); ++v)
    check(propose_move(start, strata, v, best_shaped_position(start, strata, v, 5)).edit);
  EXPECT_TRUE(image == Image<2>(start));
  EXPECT_EQ(made.size(), 4u);
  for (const auto& [kind, count] : made) EXPECT_GE(count, 4);
}

TEST(Mesh, CompactionRenumbersAndKeepsOrder) {
  std::mt19937 random(6);
  Mesh<2> mesh = make_box<2>(4, 6);
  for (int i = 0; i < 80; ++i) {
    const auto edges = mesh.edges();
    const EdgeKey edge = edges[random() % edges.size()];
    const auto edit =
        i % 3 == 0 ? std::optional(make_split(mesh, edge)) : propose_collapse(mesh, Strata<2>(mesh), edge).edit;
    if (edit) mesh.apply(*edit);
  }
  ASSERT_GT(mesh.node_slots(), mesh.num_vertices());
  const Mesh<2> before = mesh;
  const auto map = mesh.compact();
  EXPECT_EQ(mesh.find_defect(), "");
  EXPECT_EQ(mesh.node_slots(), before.num_vertices());
  EXPECT_EQ(mesh.cell_slots(), before.num_cells());
  EXPECT_EQ(mesh.facet_slots(), before.num_facets());
  int next = 0;
  for (int v = 0; v < before.node_slots(); ++v) {
    EXPECT_EQ(map.vertex[v], before.is_vertex_alive(v) ? next++ : kNone);
    EXPECT_TRUE(map.vertex[v] == kNone || mesh.rest(map.vertex[v]) == before.rest(v));
  }
  next = 0;
  for (int c = 0; c < before.cell_slots(); ++c) {
    EXPECT_EQ(map.cell[c], before.is_cell_alive(c) ? next++ : kNone);
    if (map.cell[c] == kNone) continue;
    for (int k = 0; k < 3; ++k) EXPECT_EQ(mesh.cell(map.cell[c])[k], map.vertex[before.cell(c)[k]]);
    EXPECT_EQ(mesh.body(map.cell[c]), before.body(c));
    EXPECT_EQ(mesh.volume(map.cell[c]), before.volume(c));
  }
  for (int f = 0; f < before.facet_slots(); ++f) {
    if (!before.is_facet_alive(f)) continue;
    const auto [a, b] = before.facet(f);
    const FacetId to = mesh.find_facet({map.vertex[a], map.vertex[b]});
    ASSERT_NE(to, kNone);
    EXPECT_EQ(mesh.facet_tag(to), before.facet_tag(f));
  }
  const Image<2> compact(mesh);
  mesh.compact();
  EXPECT_TRUE(compact == Image<2>(mesh));
}

/// Edits that break what a mesh promises: each must be found.
TYPED_TEST(MeshOf, DefectsAreFound) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> good = make_box<Dim>(2, 7);
  const auto kind = Edit<Dim>::Kind::smooth;
  const auto broken_by = [&](const Edit<Dim>& edit) {
    Mesh<Dim> mesh = good;
    mesh.apply(edit);
    return mesh.find_defect();
  };
  EXPECT_EQ(good.find_defect(), "");
  Edit<Dim> hole{.kind = kind};
  hole.removed_cells = {0};
  EXPECT_NE(broken_by(hole).find("boundary facet"), std::string::npos) << broken_by(hole);

  Edit<Dim> lost_facet{.kind = kind};
  lost_facet.removed_facets = {3};
  EXPECT_NE(broken_by(lost_facet).find("is missing"), std::string::npos) << broken_by(lost_facet);

  Edit<Dim> inner_facet{.kind = kind};
  for (const auto& edge : good.edges())  // any facet of a cell that is not on the boundary
    if (!good.is_boundary(edge[0])) {
      const auto& cell = good.cell(good.cells_of_edge(edge)[0]);
      auto vertices = typename Mesh<Dim>::Facet{};
      std::copy(cell.begin(), cell.begin() + Dim, vertices.begin());
      vertices[0] = edge[0];
      inner_facet.inserted_facets.push_back({vertices, 0});
      break;
    }
  ASSERT_EQ(inner_facet.inserted_facets.size(), 1u);
  EXPECT_EQ(broken_by(inner_facet), "a facet that is not on the boundary");

  Edit<Dim> turned{.kind = kind};
  auto inward = good.facet(0);
  std::swap(inward[0], inward[1]);
  turned.removed_facets = {0};
  turned.inserted_facets = {{inward, good.facet_tag(0)}};
  EXPECT_NE(broken_by(turned).find("inward"), std::string::npos) << broken_by(turned);

  Edit<Dim> twice{.kind = kind};
  twice.inserted_cells = {{good.cell(0), 1}, {good.cell(0), 1}};
  EXPECT_NE(broken_by(twice).find("more than two cells"), std::string::npos) << broken_by(twice);

  Edit<Dim> moved_only{.kind = kind};  // the cells around keep the volumes of the old position
  moved_only.value = typename Edit<Dim>::Value{0, good.rest(0) + 0.1 * Vec<Dim>::Ones()};
  EXPECT_NE(broken_by(moved_only).find("volume"), std::string::npos) << broken_by(moved_only);
}

TEST(Mesh, RefusesEditsThatInvertOrOrphan) {
  const Mesh<2> good = make_box<2>(2, 8);
  Edit<2> inverted{.kind = Edit<2>::Kind::smooth};
  auto cell = good.cell(0);
  std::swap(cell[0], cell[1]);
  inverted.removed_cells = {0};
  inverted.inserted_cells = {{cell, 1}};
  EXPECT_THROW(Mesh<2>(good).apply(inverted), InternalError);
  Edit<2> orphaned{.kind = Edit<2>::Kind::collapse};
  orphaned.removed_vertex = 0;
  EXPECT_THROW(Mesh<2>(good).apply(orphaned), InternalError);
}

TYPED_TEST(MeshOf, InvertedCellsAreFound) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = make_box<Dim>(2, 9);
  VectorX x(Dim * mesh.node_slots());
  for (int v = 0; v < mesh.node_slots(); ++v) x.segment<Dim>(Dim * v) = mesh.rest(v);
  EXPECT_EQ(find_inverted<Dim>(mesh, x), kNone);
  const CellId c = mesh.num_cells() / 2;
  const auto& cell = mesh.cell(c);
  x.segment<Dim>(Dim * cell[0]) = x.segment<Dim>(Dim * cell[1]);  // flat
  EXPECT_NE(find_inverted<Dim>(mesh, x), kNone);
}

}  // namespace
}  // namespace itr
