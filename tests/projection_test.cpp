// SPDX-License-Identifier: MIT
// L2 transfer: what it keeps exactly.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <random>

#include "geometry/measures.hpp"
#include "projection/transfer_patch.hpp"
#include "random_cube.hpp"
#include "random_mesh.hpp"

namespace itr {
namespace {

struct Arrays {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<double> density;
  TransferMesh<2> view() const { return {rest, cells, density}; }
};

/// n x n quadrilaterals with random diagonals; density 1 left of the middle, 7 right of it. Interior vertices that are not
/// on the middle line move by `noise`.
Arrays make(int n, std::mt19937& random, double noise) {
  std::uniform_real_distribution<double> shift(-noise / n, noise / n);
  const auto place = [&](int i, int j) {
    const bool free = i > 0 && i < n && j > 0 && j < n && 2 * i != n;
    return Vec<2>(double(i) / n + (free ? shift(random) : 0), double(j) / n + (free ? shift(random) : 0));
  };
  Grid grid = make_grid(n, place, [&](int, int) { return random() % 2; });
  Arrays mesh{std::move(grid.rest), std::move(grid.cells), {}};
  for (const auto& cell : mesh.cells) {
    const double middle = (mesh.rest[cell[0]][0] + mesh.rest[cell[1]][0] + mesh.rest[cell[2]][0]) / 3;
    mesh.density.push_back(middle < 0.5 ? 1 : 7);
  }
  return mesh;
}

TouchedCells all_cells(const Arrays& from, const Arrays& to) {
  TouchedCells touched;
  touched.old_cells.resize(from.cells.size());
  touched.new_cells.resize(to.cells.size());
  std::iota(touched.old_cells.begin(), touched.old_cells.end(), 0);
  std::iota(touched.new_cells.begin(), touched.new_cells.end(), 0);
  return touched;
}

/// Integral of rho u.
Eigen::RowVectorXd momentum(const Arrays& mesh, const MatrixX& u) {
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(u.cols());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const auto& cell = mesh.cells[c];
    const double mass = mesh.density[c] * simplex_volume<2>({mesh.rest[cell[0]], mesh.rest[cell[1]], mesh.rest[cell[2]]});
    for (const int v : cell) sum += mass / 3 * u.row(v);
  }
  return sum;
}

TEST(Transfer, KeepsMomentumBetweenMeshesOfOneDomain) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937 random(seed);
    const Arrays from = make(8, random, 0.2), to = make(6, random, 0.2);
    const MatrixX u = MatrixX::Random(from.rest.size(), 3);
    TransferReport report;
    const MatrixX projected =
        project_l2<2>(from.view(), to.view(), all_cells(from, to), u, MatrixX::Zero(to.rest.size(), 3), {}, report);
    EXPECT_LE((momentum(to, projected) - momentum(from, u)).norm(), 1e-13 * momentum(from, u.cwiseAbs()).norm());
    EXPECT_GT(report.l2_error_squared, 0);
    EXPECT_LT(report.relative_residual, 1e-14);
  }
}

TEST(Transfer, IsExactForLinearFieldsAndForNestedMeshes) {
  std::mt19937 random(1);
  const Arrays from = make(4, random, 0.2);
  const Arrays to = make(6, random, 0.2);
  const auto linear = [](const Arrays& mesh) {
    MatrixX u(mesh.rest.size(), 1);
    for (std::size_t v = 0; v < mesh.rest.size(); ++v) u(v, 0) = 3 + 2 * mesh.rest[v][0] - 5 * mesh.rest[v][1];
    return u;
  };
  TransferReport report;
  const MatrixX projected =
      project_l2<2>(from.view(), to.view(), all_cells(from, to), linear(from), MatrixX::Zero(to.rest.size(), 1), {}, report);
  EXPECT_LE((projected - linear(to)).norm(), 1e-12);
  EXPECT_NEAR(report.l2_error_squared, 0, 1e-12);

  // Nested: every cell of `from` split at its first edge's midpoint cannot be built without adjacency; split one boundary
  // cell.
  Arrays nested = from;
  const auto cell = from.cells[0];  // its edge 0-1 lies on the lower boundary
  const int m = static_cast<int>(nested.rest.size());
  nested.rest.push_back(0.5 * (from.rest[cell[0]] + from.rest[cell[1]]));
  nested.cells[0] = {cell[0], m, cell[2]};
  nested.cells.push_back({m, cell[1], cell[2]});
  nested.density.push_back(from.density[0]);
  const MatrixX u = MatrixX::Random(from.rest.size(), 2);
  MatrixX interpolant(nested.rest.size(), 2);
  interpolant << u, 0.5 * (u.row(cell[0]) + u.row(cell[1]));
  const MatrixX exact = project_l2<2>(from.view(), nested.view(), {{0}, {0, static_cast<int>(nested.cells.size()) - 1}}, u,
                                      interpolant, {}, report);
  EXPECT_LE((exact - interpolant).norm(), 1e-14);
}

TEST(Transfer, NoTouchedCellsMeansNoChangeBitForBit) {
  std::mt19937 random(2);
  const Arrays mesh = make(4, random, 0.2);
  const MatrixX u = MatrixX::Random(mesh.rest.size(), 2);
  TransferReport report;
  EXPECT_TRUE((project_l2<2>(mesh.view(), mesh.view(), {}, u, u, {}, report).array() == u.array()).all());
}

TEST(Transfer, LocalFormEqualsTheGlobalOne) {
  std::mt19937 random(3);
  const Arrays from = make(6, random, 0.2);
  Arrays to = from;
  // Swap the diagonal of one quadrilateral away from the boundary.
  const int q = 2 * (2 * 6 + 2);
  const auto first = from.cells[q], second = from.cells[q + 1];
  std::vector<int> corners(first.begin(), first.end());
  for (const int v : second)
    if (std::find(corners.begin(), corners.end(), v) == corners.end()) corners.push_back(v);
  const int n = 7, a = *std::min_element(corners.begin(), corners.end()), b = a + 1, d = a + n, c = d + 1;
  const bool was_ac =
      std::find(first.begin(), first.end(), c) != first.end() && std::find(first.begin(), first.end(), a) != first.end();
  to.cells[q] = was_ac ? std::array{a, b, d} : std::array{a, b, c};
  to.cells[q + 1] = was_ac ? std::array{b, c, d} : std::array{a, c, d};
  const MatrixX u = MatrixX::Random(from.rest.size(), 2);
  TransferReport report;
  const MatrixX local = project_l2<2>(from.view(), to.view(), {{q, q + 1}, {q, q + 1}}, u, u, {}, report);
  const MatrixX global = project_l2<2>(from.view(), to.view(), all_cells(from, to), u, u, {}, report);
  EXPECT_LE((local - global).norm(), 1e-13 * u.norm());
  EXPECT_GT((local - u).norm(), 1e-6);
}

/// Projects columns of nodal values through an edit of a compact mesh, on its patch only.
struct Coarsening {
  Mesh<3> mesh;
  std::map<int, Material> materials{{1, {.density = 7}}};
  TransferReport report{};
  Eigen::Index patch_vertices = 0;

  bool apply(const Edit<3>& edit, MatrixX& u) {
    const Mesh<3> before = mesh;
    const int first = mesh.cell_slots();
    mesh.apply(edit);
    TouchedCells touched{edit.removed_cells, {}};
    const auto map = mesh.compact();
    for (int c = first; c < static_cast<int>(map.cell.size()); ++c) touched.new_cells.push_back(map.cell[c]);
    MatrixX carried(mesh.node_slots(), u.cols());
    for (Eigen::Index v = 0; v < u.rows(); ++v)
      if (map.vertex[v] != kNone) carried.row(map.vertex[v]) = u.row(v);
    const TransferPatch<3> patch = make_transfer_patch(before, mesh, touched, materials, 2);
    MatrixX u_old(patch.old_cells.vertices.size(), u.cols()), u_bar(patch.new_cells.vertices.size(), u.cols());
    for (Eigen::Index i = 0; i < u_old.rows(); ++i) u_old.row(i) = u.row(patch.old_cells.vertices[i]);
    for (Eigen::Index i = 0; i < u_bar.rows(); ++i) u_bar.row(i) = carried.row(patch.new_cells.vertices[i]);
    std::vector<char> fixed;
    for (const char at_rim : patch.at_rim) fixed.insert(fixed.end(), u.cols(), at_rim);
    const MatrixX projected =
        project_l2<3>(patch.old_cells.view(), patch.new_cells.view(), patch.touched, u_old, u_bar, fixed, report);
    for (Eigen::Index i = 0; i < u_bar.rows(); ++i) carried.row(patch.new_cells.vertices[i]) = projected.row(i);
    patch_vertices = u_bar.rows();
    u = std::move(carried);
    return true;
  }
  /// Integrals of rho u and rho X u.
  MatrixX moments(const MatrixX& u) const {
    MatrixX sum = MatrixX::Zero(4, u.cols());
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      Eigen::Matrix<double, 4, 4> p;
      for (int k = 0; k < 4; ++k) p.row(k) << 1, mesh.rest(mesh.cell(c)[k]).transpose();
      MatrixX values(4, u.cols());
      for (int k = 0; k < 4; ++k) values.row(k) = u.row(mesh.cell(c)[k]);
      const Mat<4> mass = 7 * mesh.volume(c) / 20 * (Mat<4>::Ones() + Mat<4>::Identity());
      sum += p.transpose() * mass * values;
    }
    return sum;
  }
};

TEST(Transfer, KeepsMomentumAndLinearFieldsThroughAThousandCoarseningsIn3D) {
  std::mt19937 random(4);
  Coarsening state{make_cube(14, random, 0.15)};
  MatrixX u(state.mesh.num_vertices(), 4);  // random, random, smooth, linear
  const auto linear = [](const Vec<3>& X) { return 1 + 2 * X[0] - 3 * X[1] + 5 * X[2]; };
  for (int v = 0; v < state.mesh.num_vertices(); ++v) {
    const Vec<3>& X = state.mesh.rest(v);
    u.row(v) << std::uniform_real_distribution<double>(-1, 1)(random), std::uniform_real_distribution<double>(-1, 1)(random),
        std::sin(5 * X[0]) * std::cos(4 * X[1] + X[2]), linear(X);
  }
  const MatrixX before = state.moments(u);
  const double scale = state.moments(u.cwiseAbs()).cwiseAbs().maxCoeff();
  int done = 0;
  for (int i = 0; done < 1000 && i < 100000; ++i) {
    const VertexId gone = static_cast<int>(random() % state.mesh.num_vertices());
    if (state.mesh.is_boundary(gone)) continue;
    const auto around = state.mesh.cells_of(gone);
    const VertexId kept = state.mesh.cell(around[random() % around.size()])[random() % 4];
    if (kept == gone) continue;
    const auto edit = collapse(state.mesh, gone, kept);
    if (!edit) continue;
    state.apply(*edit, u);
    ++done;
  }
  ASSERT_EQ(done, 1000);
  ASSERT_EQ(state.mesh.find_defect(), "");
  EXPECT_LE((state.moments(u) - before).cwiseAbs().maxCoeff(), 1e-12 * scale);
  for (int v = 0; v < state.mesh.num_vertices(); ++v) ASSERT_NEAR(u(v, 3), linear(state.mesh.rest(v)), 1e-11);
}

/// The visited vertices, and with them the cost, follow the edit and not the mesh.
TEST(Transfer, PatchDoesNotGrowWithTheMesh) {
  std::vector<Eigen::Index> vertices;
  for (const int n : {10, 14, 20}) {
    std::mt19937 random(5);
    Coarsening state{make_cube(n, random, 0)};
    const int middle = (n / 2 * (n + 1) + n / 2) * (n + 1) + n / 2;
    const auto edit = collapse(state.mesh, middle, middle + 1);
    ASSERT_TRUE(edit);
    MatrixX u = MatrixX::Random(state.mesh.num_vertices(), 1);
    state.apply(*edit, u);
    vertices.push_back(state.patch_vertices);
  }
  EXPECT_EQ(vertices[0], vertices[1]);
  EXPECT_EQ(vertices[0], vertices[2]);
}

/// Fixed entries keep u_bar, and what they would have taken is shared by the others: integrals stay.
TEST(Transfer, KeepsIntegralsWhereEntriesAreFixed) {
  std::mt19937 random(6);
  const Arrays from = make(8, random, 0.2), to = make(6, random, 0.2);
  const MatrixX u = MatrixX::Random(from.rest.size(), 2);
  const MatrixX u_bar = MatrixX::Random(to.rest.size(), 2);
  std::vector<char> fixed(2 * to.rest.size(), 0);
  for (std::size_t v = 0; v < to.rest.size(); ++v) fixed[2 * v] = to.rest[v][1] < 0.3;  // the first column only
  TransferReport report;
  const MatrixX projected = project_l2<2>(from.view(), to.view(), all_cells(from, to), u, u_bar, fixed, report);
  for (std::size_t v = 0; v < to.rest.size(); ++v)
    if (fixed[2 * v]) {
      EXPECT_EQ(projected(v, 0), u_bar(v, 0));
    }
  const double scale = momentum(from, u.cwiseAbs()).norm();
  EXPECT_LE((momentum(to, projected) - momentum(from, u)).norm(), 1e-13 * scale);
  EXPECT_LE(report.lost.norm(), 1e-13 * scale);
  const MatrixX free = project_l2<2>(from.view(), to.view(), all_cells(from, to), u, u_bar, {}, report);
  EXPECT_LE((free - projected).col(1).norm(), 1e-12);
  EXPECT_GT((free - projected).col(0).norm(), 1e-3);

  fixed.assign(fixed.size(), 1);
  project_l2<2>(from.view(), to.view(), all_cells(from, to), u, u_bar, fixed, report);
  EXPECT_LE((report.lost.transpose() - momentum(from, u) + momentum(to, u_bar)).norm(), 1e-13 * scale);
}

/// On a patch the correction is that of the whole mesh but for what is small: a factor of three and more a ring.
TEST(Transfer, PatchComesNearTheWholeMeshRingByRing) {
  std::mt19937 random(8);
  const Mesh<2> before = random_mesh(30, random);
  const int middle = 15 * 31 + 12;
  std::optional<Edit<2>> edit;
  for (const VertexId to : {middle + 1, middle + 31, middle - 1, middle - 31})
    if (!edit) edit = propose_collapse(before, Strata<2>(before), {std::min(middle, to), std::max(middle, to)}).edit;
  ASSERT_TRUE(edit);
  Mesh<2> mesh = before;
  RemeshFields<2> fields;
  fields.x = VectorX::Random(2 * before.node_slots());
  const VectorX old_values = fields.x;
  fields.follow(*edit, mesh.apply(*edit));
  TouchedCells touched{edit->removed_cells, {}};
  for (int c = before.cell_slots(); c < mesh.cell_slots(); ++c) touched.new_cells.push_back(c);
  const auto change = [&](int rings) {
    const auto patch = make_transfer_patch(before, mesh, touched, {{1, {.density = 1}}, {2, {.density = 5}}}, rings);
    std::vector<char> fixed;
    for (const char at_rim : patch.at_rim) fixed.insert(fixed.end(), 2, at_rim);
    TransferReport report;
    const MatrixX u_bar = patch.new_cells.gather(fields.x);
    const MatrixX projected = project_l2<2>(patch.old_cells.view(), patch.new_cells.view(), patch.touched,
                                            patch.old_cells.gather(old_values), u_bar, fixed, report);
    VectorX all = VectorX::Zero(fields.x.size());
    for (std::size_t i = 0; i < patch.new_cells.vertices.size(); ++i)
      all.segment<2>(2 * patch.new_cells.vertices[i]) = (projected - u_bar).row(i).transpose();
    return all;
  };
  const VectorX exact = change(40);
  double last = exact.norm();
  for (int rings = 0; rings < 8; ++rings) {
    const double error = (change(rings) - exact).norm();
    EXPECT_LT(error, 0.7 * last) << rings;
    if (rings == 4) {
      EXPECT_LT(error, 1e-2 * exact.norm());
    }
    last = error;
  }
}

}  // namespace
}  // namespace itr
