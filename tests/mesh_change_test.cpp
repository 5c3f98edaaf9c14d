// SPDX-License-Identifier: MIT
// Changes of the mesh as a program is told of them, over 10^4 edits of random meshes in batches.
#include <gtest/gtest.h>

#include <set>

#include "geometry/distance.hpp"
#include "itr/transfer.hpp"
#include "random_mesh.hpp"
#include "random_tets.hpp"

namespace itr {
namespace {

constexpr int kEdits = 5000;  ///< a dimension
constexpr int kBatch = 25;    ///< edits of one change

double to_facet(const Vec<2>& p, const Mesh<2>& mesh, FacetId f) {
  return std::sqrt(point_edge_distance_squared<2>(p, mesh.rest(mesh.facet(f)[0]), mesh.rest(mesh.facet(f)[1])));
}
double to_facet(const Vec<3>& p, const Mesh<3>& mesh, FacetId f) {
  const auto& [a, b, c] = mesh.facet(f);
  return std::sqrt(point_triangle_distance_squared(p, mesh.rest(a), mesh.rest(b), mesh.rest(c)));
}

/// Values of 1, and of each coordinate, at the vertices.
template <int Dim>
MatrixX linear_fields(const Mesh<Dim>& mesh) {
  MatrixX fields(mesh.node_slots(), Dim + 1);
  for (int v = 0; v < mesh.node_slots(); ++v) fields.row(v) << 1, mesh.rest(v).transpose();
  return fields;
}

template <int Dim>
VectorX integrals(const Mesh<Dim>& mesh, const MatrixX& fields) {
  VectorX sum = VectorX::Zero(fields.cols());
  for (int c = 0; c < mesh.cell_slots(); ++c)
    for (const int v : mesh.cell(c)) sum += mesh.volume(c) / (Dim + 1) * fields.row(v).transpose();
  return sum;
}

template <int Dim>
void check(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshChange<Dim>& change) {
  ASSERT_EQ(change.vertex.size(), std::size_t(before.node_slots()));
  // Ids: kept cells and facets have the same vertices, bodies and tags; no new id is told twice.
  const auto follow = [&](auto ids) {
    for (int& v : ids) v = change.vertex[v];
    return ids;
  };
  std::set<int> seen;
  for (int c = 0; c < before.cell_slots(); ++c)
    if (const int now = change.cell[c]; now != kNone) {
      ASSERT_TRUE(seen.insert(now).second);
      ASSERT_EQ(mesh.cell(now), follow(before.cell(c)));
      ASSERT_EQ(mesh.body(now), before.body(c));
    }
  EXPECT_EQ(seen.size() + change.touched.new_cells.size(), std::size_t(mesh.num_cells()));
  for (int f = 0; f < before.facet_slots(); ++f)
    if (const int now = change.facet[f]; now != kNone) {
      ASSERT_EQ(mesh.facet(now), follow(before.facet(f)));
      ASSERT_EQ(mesh.facet_tag(now), before.facet_tag(f));
    }
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    const FacetId parent = change.facet_parent[f];
    ASSERT_NE(parent, kNone);
    ASSERT_EQ(mesh.facet_tag(f), before.facet_tag(parent));
    Vec<Dim> middle = Vec<Dim>::Zero();
    for (const int v : mesh.facet(f)) middle += mesh.rest(v) / Dim;
    ASSERT_LT(to_facet(middle, before, parent), 1e-12);
  }
  // Interpolation: convex, exact for linear functions, one by one for what stayed.
  for (int v = 0; v < mesh.node_slots(); ++v)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(change.interpolation, v); it; ++it)
      ASSERT_GT(it.value(), 0);
  EXPECT_LT((change.interpolation * linear_fields(before) - linear_fields(mesh)).cwiseAbs().maxCoeff(), 1e-12);
  for (int v = 0; v < before.node_slots(); ++v)
    if (const int now = change.vertex[v]; now != kNone && mesh.rest(now) == before.rest(v)) {
      ASSERT_EQ(change.interpolation.coeff(now, v), 1);
    }
  // Projection: keeps integrals of any field.
  const MatrixX field = MatrixX::Random(before.node_slots(), 2);
  const MatrixX projected = project_fields(before, mesh, change, field);
  EXPECT_LT((integrals(mesh, projected) - integrals(before, field)).norm(), 1e-11);
}

TEST(MeshChange, IsToldRightly2D) {
  int edits = 0;
  for (unsigned seed = 0; edits < kEdits; ++seed) {
    std::mt19937 random(seed);
    Mesh<2> mesh = random_mesh(6, random);
    for (int batch = 0; batch < 12; ++batch) {
      const Mesh<2> before = mesh;
      for (int i = 0; i < kBatch;)
        if (const auto edit = random_edit(mesh, random)) mesh.apply(*edit), ++i, ++edits;
      check(before, mesh, describe_change(before, mesh, mesh.compact()));
      if (testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << ", batch " << batch;
    }
  }
}

TEST(MeshChange, IsToldRightly3D) {
  int edits = 0;
  for (unsigned seed = 0; edits < kEdits; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(4, random, false);
    for (int batch = 0; batch < 12; ++batch) {
      const Mesh<3> before = mesh;
      Strata<3> strata(mesh);
      for (int i = 0; i < kBatch;)
        if (const auto proposal = propose_at_random(mesh, strata, static_cast<Operation>(random() % 5), random))
          apply(mesh, strata, *proposal.edit), ++i, ++edits;
      check(before, mesh, describe_change(before, mesh, mesh.compact()));
      if (testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << ", batch " << batch;
    }
  }
}

TEST(MeshChange, OfTwoChangesIsThatOfBoth) {
  std::mt19937 random(5);
  Mesh<2> mesh = random_mesh(5, random);
  const Mesh<2> before = mesh;
  MeshRenumbering both;
  for (int part = 0; part < 2; ++part) {
    for (int i = 0; i < kBatch;)
      if (const auto edit = random_edit(mesh, random)) mesh.apply(*edit), ++i;
    const MeshRenumbering one = mesh.compact();
    both = part == 0 ? one : compose(both, one);
  }
  check(before, mesh, describe_change(before, mesh, both));
}

}  // namespace
}  // namespace itr
