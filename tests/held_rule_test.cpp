// SPDX-License-Identifier: MIT
// Which condition holds a component of a vertex or of the node of an edge.
#include "fem/held_rule.hpp"

#include <gtest/gtest.h>

#include "square_mesh.hpp"

namespace itr {
namespace {

using Tags = HeldRule<2>::Tags;

/// Two triangles on the unit square, whose sides have the tags 1 (left), 2 (lower), 3 (right) and 4 (upper).
Mesh<2> square() {
  Mesh<2> mesh({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {1, 1});
  tag_sides(mesh, 1);
  return mesh;
}

TEST(HeldRule, OfTwoFacetsTheLargerTagCountsInEachComponent) {
  const HeldRule<2>::Components components{{1, {true, true}}, {2, {true, false}}};
  const HeldRule<2> rule(components);
  const Mesh<2> mesh = square();
  EXPECT_EQ(rule.tags_at(mesh, std::array{0}), (Tags{2, 1}));
  EXPECT_EQ(rule.tags_at(mesh, std::array{1}), (Tags{2, kNoTag}));
  EXPECT_EQ(rule.tags_at(mesh, std::array{2}), (Tags{kNoTag, kNoTag}));
  EXPECT_EQ(rule.tags_at(mesh, std::array{3}), (Tags{1, 1}));
}

TEST(HeldRule, TheVertexOwnTagCountsBeforeThoseOfItsFacets) {
  const HeldRule<2>::Components components{{0, {false, true}}, {2, {true, true}}};
  const HeldRule<2> rule(components);
  Mesh<2> mesh = square();
  mesh.set_vertex_tag(0, 0);
  mesh.set_vertex_tag(2, 0);
  EXPECT_EQ(rule.tags_at(mesh, std::array{0}), (Tags{2, 0}));
  EXPECT_EQ(rule.tags_at(mesh, std::array{2}), (Tags{kNoTag, 0}));
}

TEST(HeldRule, AFacetAtTheEdgeHoldsItsNode) {
  const HeldRule<2>::Components components{{1, {true, true}}, {2, {true, false}}};
  const HeldRule<2> rule(components);
  const Mesh<2> mesh = square();
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{0, 1}), (Tags{2, kNoTag}));
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{0, 3}), (Tags{1, 1}));
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{1, 2}), (Tags{kNoTag, kNoTag}));
}

TEST(HeldRule, TheTagOfBothEndsHoldsTheNodeOfAnEdgeOfTheSurface) {
  const HeldRule<2>::Components components{{7, {true, false}}};
  const HeldRule<2> rule(components);
  Mesh<2> mesh = square();
  for (const VertexId v : {0, 1, 2}) mesh.set_vertex_tag(v, 7);
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{0, 1}), (Tags{7, kNoTag}));
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{0, 2}), (Tags{kNoTag, kNoTag})) << "inside the body";
  EXPECT_EQ(rule.tags_at(mesh, EdgeKey{2, 3}), (Tags{kNoTag, kNoTag})) << "one end only";
}

/// The mesh with one facet more, as a view of it tells.
struct WithFacet {
  const Mesh<2>& mesh;
  int vertex_tag(VertexId v) const { return mesh.vertex_tag(v); }
  template <std::size_t N, typename F>
  friend void for_each_facet_tag(const WithFacet& view, const std::array<VertexId, N>& ends, const F& f) {
    if (has_all(EdgeKey{0, 2}, ends)) f(9);
    for_each_facet_tag(view.mesh, ends, f);
  }
};

TEST(HeldRule, AsksAView) {
  const HeldRule<2>::Components components{{1, {false, true}}, {9, {true, false}}};
  const HeldRule<2> rule(components);
  const Mesh<2> mesh = square();
  EXPECT_EQ(rule.tags_at(WithFacet{mesh}, EdgeKey{0, 2}), (Tags{9, kNoTag}));
  EXPECT_EQ(rule.tags_at(WithFacet{mesh}, std::array{0}), (Tags{9, 1}));
}

}  // namespace
}  // namespace itr
