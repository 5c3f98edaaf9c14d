// SPDX-License-Identifier: MIT
// Squares of n x n quadrilaterals, two triangles each.
#pragma once

#include <array>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

struct Grid {
  std::vector<Vec<2>> rest;  ///< row by row, from below
  std::vector<std::array<int, 3>> cells;
};

/// Vertices (i, j) are at `place(i, j)`; the diagonal of quadrilateral (i, j) goes from its lower left corner to the upper
/// right one if `rises(i, j)`. All places are asked for before the diagonals.
template <typename Place, typename Rises>
Grid make_grid(int n, Place&& place, Rises&& rises) {
  Grid grid;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) grid.rest.push_back(place(i, j));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      const bool diagonal = rises(i, j);
      grid.cells.push_back(diagonal ? std::array{a, b, c} : std::array{a, b, d});
      grid.cells.push_back(diagonal ? std::array{a, c, d} : std::array{b, c, d});
    }
  return grid;
}

/// Regular, with its corner at the origin.
template <typename Rises>
Grid make_regular_grid(int n, double size, Rises&& rises) {
  return make_grid(
      n, [&](int i, int j) { return Vec<2>(size * i / n, size * j / n); }, rises);
}

/// Facet tags of a square with its corner at the origin by side, as `threshold` selects them: left 1, bottom 2, right 3,
/// top 4.
inline void tag_sides(Mesh<2>& mesh, double size) {
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    const Vec<2> middle = 0.5 * (mesh.rest(mesh.facet(f)[0]) + mesh.rest(mesh.facet(f)[1]));
    mesh.set_facet_tag(f, middle[0] < 1e-9 ? 1 : middle[1] < 1e-9 ? 2 : middle[0] > size - 1e-9 ? 3 : 4);
  }
}

}  // namespace itr
