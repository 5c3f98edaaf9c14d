// SPDX-License-Identifier: MIT
#include "mesh/edge_ring.hpp"

#include <algorithm>

namespace itr {

namespace {

/// The two other vertices u, v of a cell with the edge a-b, such that (a, b, u, v) has the cell's orientation.
EdgeKey opposite_edge(const Mesh<3>::Cell& cell, const EdgeKey& edge) {
  const auto place = [&](VertexId v) { return static_cast<int>(std::find(cell.begin(), cell.end(), v) - cell.begin()); };
  const int a = place(edge[0]), b = place(edge[1]);
  int c = 0;
  while (c == a || c == b) ++c;
  const int d = 6 - a - b - c;
  // (a, b, c, d) with c < d is an even permutation of (0, 1, 2, 3) where the inversions of a and b add up to an even number.
  const bool even = ((a > b) + (a > c) + (a > d) + (b > c) + (b > d)) % 2 == 0;
  return even ? EdgeKey{cell[c], cell[d]} : EdgeKey{cell[d], cell[c]};
}

}  // namespace

std::optional<EdgeRing> ring_of_edge(const Mesh<3>& mesh, const EdgeKey& edge) {
  EdgeRing ring;
  ring.cells = mesh.cells_of_edge(edge);
  const std::size_t n = ring.cells.size();
  if (n == 0) return std::nullopt;
  std::vector<EdgeKey> links(n);
  for (std::size_t i = 0; i < n; ++i) links[i] = opposite_edge(mesh.cell(ring.cells[i]), edge);
  // A fan begins with the link that no other one leads to; a ring with any.
  for (std::size_t i = 0; i < n; ++i)
    if (std::none_of(links.begin(), links.end(), [&](const EdgeKey& link) { return link[1] == links[i][0]; })) {
      std::swap(links[0], links[i]);
      std::swap(ring.cells[0], ring.cells[i]);
      break;
    }
  for (std::size_t i = 1; i < n; ++i) {
    std::size_t next = i;
    while (next < n && links[next][0] != links[i - 1][1]) ++next;
    if (next == n) return std::nullopt;
    std::swap(links[i], links[next]);
    std::swap(ring.cells[i], ring.cells[next]);
  }
  for (const EdgeKey& link : links) ring.vertices.push_back(link[0]);
  ring.closed = links.back()[1] == links[0][0];
  if (!ring.closed) ring.vertices.push_back(links.back()[1]);
  return ring;
}

}  // namespace itr
