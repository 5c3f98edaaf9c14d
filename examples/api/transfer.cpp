// SPDX-License-Identifier: MIT
// Field transfer alone: the L2 projection of a nodal field between two meshes of one domain, exact on the intersections of
// their cells. Integrals are kept to round-off, which interpolation does not do.
#include <cmath>
#include <cstdio>
#include <itr/transfer.hpp>

namespace {

/// The unit square by n x n squares, two triangles each; their diagonals alternate.
struct SquareMesh {
  std::vector<itr::Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<double> density;

  explicit SquareMesh(int n) : density(2 * n * n, 1.0) {
    for (int i = 0; i < (n + 1) * (n + 1); ++i) rest.emplace_back(double(i % (n + 1)) / n, double(i / (n + 1)) / n);
    for (int i = 0; i < n * n; ++i) {
      const int a = i / n * (n + 1) + i % n, b = a + 1, c = a + n + 2, d = a + n + 1;
      if ((i + i / n) % 2)
        cells.insert(cells.end(), {{a, b, c}, {a, c, d}});
      else
        cells.insert(cells.end(), {{a, b, d}, {b, c, d}});
    }
  }
  itr::TransferMesh<2> view() const { return {rest, cells, density}; }
  std::vector<int> all() const {
    std::vector<int> ids(cells.size());
    for (std::size_t c = 0; c < ids.size(); ++c) ids[c] = static_cast<int>(c);
    return ids;
  }
  double integral(const itr::MatrixX& u) const {
    double sum = 0;
    for (const auto& cell : cells)
      for (const int v : cell) sum += u(v, 0) / (3.0 * static_cast<double>(cells.size()));
    return sum;
  }
};

}  // namespace

int main() {
  const SquareMesh from(20), to(13);
  itr::MatrixX u(from.rest.size(), 1), u_bar = itr::MatrixX::Zero(to.rest.size(), 1);
  for (std::size_t v = 0; v < from.rest.size(); ++v)
    u(v, 0) = std::sin(4 * from.rest[v][0]) * std::cos(3 * from.rest[v][1]) + 0.3 * (v % 3);

  itr::TransferReport report;
  const itr::MatrixX projected = itr::project_l2<2>(from.view(), to.view(), {from.all(), to.all()}, u, u_bar, {}, report);
  const double lost = to.integral(projected) - from.integral(u);
  std::printf("integral %.12f, changed by %.1e; L2 distance %.4f; %d iterations\n", from.integral(u), lost,
              std::sqrt(report.l2_error_squared), report.iterations);
  return std::abs(lost) < 1e-13 ? 0 : 1;
}
