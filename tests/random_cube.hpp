// SPDX-License-Identifier: MIT
// Cubes of tetrahedra, and coarsening them without asking what it costs.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "geometry/measures.hpp"
#include "itr/mesh.hpp"

namespace itr {

/// Regular tetrahedra of n^3 cubes in the unit cube, interior vertices moved by `noise` of a cube.
inline Mesh<3> make_cube(int n, std::mt19937& random, double noise) {
  std::uniform_real_distribution<double> shift(-noise / n, noise / n);
  std::vector<Vec<3>> rest;
  for (int k = 0; k <= n; ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) {
        rest.push_back(Vec<3>(i, j, k) / n);
        if (i % n && j % n && k % n)
          for (double& x : rest.back()) x += shift(random);
      }
  constexpr int kCells[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  std::vector<std::array<int, 4>> cells;
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        for (const auto& corners : kCells) {
          std::array<int, 4> cell;
          for (int c = 0; c < 4; ++c) {
            const int x = i + (corners[c] & 1), y = j + (corners[c] >> 1 & 1), z = k + (corners[c] >> 2 & 1);
            cell[c] = (z * (n + 1) + y) * (n + 1) + x;
          }
          cells.push_back(cell);
        }
  const std::vector<int> body(cells.size(), 1);
  return Mesh<3>(rest, cells, body);
}

/// Collapses an interior vertex onto a neighbour; empty where that would spoil a cell.
inline std::optional<Edit<3>> collapse(const Mesh<3>& mesh, VertexId gone, VertexId kept) {
  Edit<3> edit{.kind = Edit<3>::Kind::collapse, .edge = {std::min(gone, kept), std::max(gone, kept)}};
  double before = 0, after = 0;
  for (const CellId c : mesh.cells_of(gone)) {
    auto cell = mesh.cell(c);
    edit.removed_cells.push_back(c);
    before += mesh.volume(c);
    if (std::find(cell.begin(), cell.end(), kept) != cell.end()) continue;
    std::replace(cell.begin(), cell.end(), gone, kept);
    const std::array<Vec<3>, 4> p{mesh.rest(cell[0]), mesh.rest(cell[1]), mesh.rest(cell[2]), mesh.rest(cell[3])};
    if (simplex_quality<3>(p) < 0.05) return std::nullopt;
    after += simplex_volume<3>(p);
    edit.inserted_cells.push_back({cell, mesh.body(c)});
  }
  if (std::abs(after - before) > 1e-12 * before) return std::nullopt;
  edit.removed_vertex = gone;
  return edit;
}

}  // namespace itr
