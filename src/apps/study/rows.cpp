// SPDX-License-Identifier: MIT
#include "rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "itr/core/error.hpp"

namespace itr::cli::study {

namespace {

constexpr double kSameVolume = 1e-9;

/// Kuhn's six tetrahedra of a cube, one for each way along its edges from corner 0 to corner 7; bits are axes.
constexpr int kTetrahedra[6][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}};

}  // namespace

std::array<int, 3> RowsOfBox::counts(double cells) const {
  const Vec<3> extent = high - low;
  const double edge = std::cbrt(6 * extent.prod() / cells);
  std::array<int, 3> found;
  for (int k = 0; k < 3; ++k) found[k] = std::max(1, static_cast<int>(std::lround(extent[k] / edge)));
  return found;
}

std::optional<RowsOfBox> find_box(const Mesh<3>& mesh) {
  if (mesh.num_cells() == 0) return std::nullopt;
  RowsOfBox box{mesh.rest(mesh.cell(0)[0]), mesh.rest(mesh.cell(0)[0])};
  double volume = 0;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    volume += mesh.volume(c);
    for (const VertexId v : mesh.cell(c)) {
      box.low = box.low.cwiseMin(mesh.rest(v));
      box.high = box.high.cwiseMax(mesh.rest(v));
    }
  }
  const double whole = (box.high - box.low).prod();
  if (std::abs(volume - whole) > kSameVolume * whole) return std::nullopt;
  return box;
}

void write_rows(const RowsOfBox& box, const std::array<int, 3>& n, int id, const std::filesystem::path& file) {
  std::string text = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", (n[0] + 1) * (n[1] + 1) * (n[2] + 1));
  const auto node = [&](int i, int j, int k) { return 1 + i + (n[0] + 1) * (j + (n[1] + 1) * k); };
  for (int k = 0; k <= n[2]; ++k)
    for (int j = 0; j <= n[1]; ++j)
      for (int i = 0; i <= n[0]; ++i) {
        const std::array<int, 3> at = {i, j, k};
        text += fmt::format("{}", node(i, j, k));
        for (int c = 0; c < 3; ++c) {
          const double share = static_cast<double>(at[c]) / n[c];
          text += fmt::format(" {:.17g}", (1 - share) * box.low[c] + share * box.high[c]);
        }
        text += '\n';
      }
  text += fmt::format("$EndNodes\n$Elements\n{}\n", 6 * n[0] * n[1] * n[2]);
  int number = 0;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        for (const auto& tetrahedron : kTetrahedra) {
          text += fmt::format("{} 4 2 {} {}", ++number, id, id);
          for (const int corner : tetrahedron)
            text += fmt::format(" {}", node(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2 & 1)));
          text += '\n';
        }
  text += "$EndElements\n";
  std::ofstream stream(file, std::ios::binary);
  if (!(stream << text).flush()) throw InputError({file.string(), "", "not written", "a folder with space"});
}

}  // namespace itr::cli::study
