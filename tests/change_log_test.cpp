// SPDX-License-Identifier: MIT
// The record of what commits change, against the meshes before and after.
#include "remesh/schedule/change_log.hpp"

#include <gtest/gtest.h>

#include "random_mesh.hpp"

namespace itr {
namespace {

std::vector<CellId> cells_at(const Mesh<2>& mesh, VertexId v) {
  if (v >= mesh.node_slots() || !mesh.is_vertex_alive(v)) return {};
  std::vector<CellId> cells(mesh.cells_of(v).begin(), mesh.cells_of(v).end());
  std::sort(cells.begin(), cells.end());
  return cells;
}

TEST(ChangeLog, KnowsEveryVertexAndPartOfTheSurfaceThatACommitChanged) {
  int around_only = 0, untouched = 0, on_surface = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    TrialScene scene(seed);
    Mesh<2>& mesh = scene.mesh;
    VectorX& x = scene.fields.x;
    ChangeLog<2> log(mesh, x, true);
    std::vector<int> called;
    log.add_follower([&](const Change<2>& change) {
      called.push_back(1);
      scene.fields.follow(change.edit, change.created);
      for (const auto& [v, at] : change.positions) x.segment<2>(2 * v) = at;
    });
    log.add_follower([&](const Change<2>& change) {
      called.push_back(2);
      for (const CellId c : change.cells) EXPECT_TRUE(mesh.is_cell_alive(c));
      for (const auto& [v, at] : change.positions) EXPECT_EQ(x.segment<2>(2 * v), at);  // the follower before has set them
    });
    for (int i = 0; i < 30; ++i) {
      const auto edit = random_edit(mesh, scene.random);
      if (!edit) continue;
      const Mesh<2> before = mesh;
      const VectorX x_before = x;
      std::vector<ChangeLog<2>::Position> positions;
      if (edit->value) positions.push_back({edit->value->vertex, RemeshFields<2>::interpolate(x, *edit->value) * 1.001});
      const unsigned since = log.now();
      called.clear();
      const Change<2> change = log.commit(*edit, positions);
      EXPECT_EQ(log.now(), since + 1);
      EXPECT_EQ(called, (std::vector<int>{1, 2}));
      EXPECT_EQ(change.created != kNone, edit->kind == Edit<2>::Kind::split);
      std::vector<char> is_changed(mesh.node_slots(), 0);
      for (int v = 0; v < mesh.node_slots(); ++v) {
        const bool is_new = v >= before.node_slots();
        is_changed[v] =
            is_new || cells_at(before, v) != cells_at(mesh, v) || x.segment<2>(2 * v) != x_before.segment<2>(2 * v);
        ASSERT_TRUE(!is_changed[v] || log.was_written(v, since)) << "seed " << seed << ", edit " << i << ", vertex " << v;
      }
      for (int v = 0; v < mesh.node_slots(); ++v) {
        bool has_changed = is_changed[v];
        for (const CellId c : cells_at(mesh, v))
          for (const VertexId w : mesh.cell(c)) has_changed = has_changed || is_changed[w];
        const Candidate vertex(OperationKind::smooth, v);
        if (has_changed) {
          ASSERT_TRUE(log.has_changed_around(vertex, since)) << "seed " << seed << ", edit " << i << ", vertex " << v;
          EXPECT_TRUE(log.had_changed_around(vertex, log.now()));
        }
        EXPECT_FALSE(log.has_changed_around(vertex, log.now()));
        around_only += !is_changed[v] && has_changed;
        untouched += !log.has_changed_around(vertex, since);
      }
      ASSERT_EQ(log.surfaces(since).size(), 1u);
      const Box<2>& box = log.surfaces(since)[0];
      for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
        const bool was = f < before.facet_slots() && before.is_facet_alive(f), is = mesh.is_facet_alive(f);
        if (!was && !is) continue;
        const auto& facet = was ? before.facet(f) : mesh.facet(f);
        if (was == is && !is_changed[facet[0]] && !is_changed[facet[1]]) continue;
        for (const VertexId v : facet) {
          if (was == is && (!was || x.segment<2>(2 * v) == x_before.segment<2>(2 * v))) continue;
          EXPECT_TRUE(!was || box.contains(Vec<2>(x_before.segment<2>(2 * v))));
          EXPECT_TRUE(!is || box.contains(Vec<2>(x.segment<2>(2 * v))));
          ++on_surface;
        }
      }
    }
  }
  EXPECT_GT(around_only, 1000);
  EXPECT_GT(untouched, 1000);
  EXPECT_GT(on_surface, 100);
}

TEST(ChangeLog, TellsGainsByTheFirstCommitThere) {
  TrialScene scene(1);
  ChangeLog<2> log(scene.mesh, scene.fields.x, false);
  log.add_follower([&](const Change<2>& change) { scene.fields.follow(change.edit, change.created); });
  const EdgeKey edge = scene.mesh.edges()[0];
  log.commit(make_split(scene.mesh, edge), {});
  const Candidate end(OperationKind::smooth, edge[0]);
  EXPECT_TRUE(log.had_changed_around(end, 1));
  EXPECT_FALSE(log.had_changed_around(end, 0));
  const EdgeKey half{edge[0], scene.mesh.node_slots() - 1};
  log.commit(make_split(scene.mesh, half), {});
  EXPECT_TRUE(log.had_changed_around(end, 1)) << "a later commit does not hide the first";
  EXPECT_TRUE(log.has_changed_around(end, 1));
}

}  // namespace
}  // namespace itr
