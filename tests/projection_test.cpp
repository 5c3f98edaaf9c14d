// SPDX-License-Identifier: MIT
// L2 transfer: what it keeps exactly.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "itr/geometry/measures.hpp"
#include "itr/projection/transfer.hpp"
#include "square_mesh.hpp"

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
    const std::vector<char> none(to.rest.size(), 0);
    TransferReport report;
    const MatrixX projected =
        project_l2<2>(from.view(), to.view(), all_cells(from, to), u, MatrixX::Zero(to.rest.size(), 3), none, report);
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
  const std::vector<char> none(to.rest.size(), 0);
  TransferReport report;
  const MatrixX projected = project_l2<2>(from.view(), to.view(), all_cells(from, to), linear(from),
                                          MatrixX::Zero(to.rest.size(), 1), none, report);
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
  const std::vector<char> none_nested(nested.rest.size(), 0);
  const MatrixX exact = project_l2<2>(from.view(), nested.view(), {{0}, {0, static_cast<int>(nested.cells.size()) - 1}}, u,
                                      interpolant, none_nested, report);
  EXPECT_LE((exact - interpolant).norm(), 1e-14);
}

TEST(Transfer, NoTouchedCellsMeansNoChangeBitForBit) {
  std::mt19937 random(2);
  const Arrays mesh = make(4, random, 0.2);
  const MatrixX u = MatrixX::Random(mesh.rest.size(), 2);
  const std::vector<char> none(mesh.rest.size(), 0);
  TransferReport report;
  EXPECT_TRUE((project_l2<2>(mesh.view(), mesh.view(), {}, u, u, none, report).array() == u.array()).all());
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
  const std::vector<char> none(to.rest.size(), 0);
  TransferReport report;
  const MatrixX local = project_l2<2>(from.view(), to.view(), {{q, q + 1}, {q, q + 1}}, u, u, none, report);
  const MatrixX global = project_l2<2>(from.view(), to.view(), all_cells(from, to), u, u, none, report);
  EXPECT_LE((local - global).norm(), 1e-13 * u.norm());
  EXPECT_GT((local - u).norm(), 1e-6);
}

}  // namespace
}  // namespace itr
