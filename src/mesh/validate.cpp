// SPDX-License-Identifier: MIT
#include "mesh/validate.hpp"

#include <algorithm>

#include "geometry/bvh.hpp"
#include "geometry/predicates.hpp"

namespace itr {

namespace {

int cell_orientation(const std::array<int, 3>& c, ConstVectorView x) {
  return orientation(Vec<2>(x.segment<2>(2 * c[0])), Vec<2>(x.segment<2>(2 * c[1])), Vec<2>(x.segment<2>(2 * c[2])));
}
int cell_orientation(const std::array<int, 4>& c, ConstVectorView x) {
  return orientation(Vec<3>(x.segment<3>(3 * c[0])), Vec<3>(x.segment<3>(3 * c[1])), Vec<3>(x.segment<3>(3 * c[2])),
                     Vec<3>(x.segment<3>(3 * c[3])));
}

}  // namespace

std::vector<std::array<int, 2>> find_intersections(ConstVectorView x, std::span<const std::array<int, 2>> edges,
                                                   std::span<const char> counts, std::size_t most) {
  std::vector<std::array<int, 2>> pairs;
  std::vector<Box<2>> boxes(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (const int v : edges[e]) boxes[e].include(Vec<2>(x.segment<2>(2 * v)));
  const Bvh<2> tree(boxes);
  std::vector<int> hits;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    hits.clear();
    tree.query(boxes[e], hits);
    std::sort(hits.begin(), hits.end());
    const auto [a, b] = edges[e];
    for (const int f : hits) {
      if (f <= static_cast<int>(e)) continue;
      const auto [c, d] = edges[f];
      if (a == c || a == d || b == c || b == d) continue;
      if (!counts[a] && !counts[b] && !counts[c] && !counts[d]) continue;
      if (segments_intersect(x.segment<2>(2 * a), x.segment<2>(2 * b), x.segment<2>(2 * c), x.segment<2>(2 * d)))
        pairs.push_back({static_cast<int>(e), f});
      if (pairs.size() >= most) return pairs;
    }
  }
  return pairs;
}

std::vector<std::array<int, 2>> find_intersections(ConstVectorView x, std::span<const std::array<int, 2>> edges,
                                                   std::span<const std::array<int, 3>> triangles,
                                                   std::span<const char> counts, std::size_t most) {
  std::vector<std::array<int, 2>> pairs;
  const auto at = [&](int v) { return Vec<3>(x.segment<3>(3 * v)); };
  std::vector<Box<3>> boxes(edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (const int v : edges[e]) boxes[e].include(at(v));
  const Bvh<3> tree(boxes);
  std::vector<int> hits;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto [a, b, c] = triangles[t];
    Box<3> box;
    for (const int v : triangles[t]) box.include(at(v));
    hits.clear();
    tree.query(box, hits);
    std::sort(hits.begin(), hits.end());
    for (const int e : hits) {
      const auto [p, q] = edges[e];
      if (p == a || p == b || p == c || q == a || q == b || q == c) continue;
      if (!counts[a] && !counts[b] && !counts[c] && !counts[p] && !counts[q]) continue;
      if (segment_intersects_triangle(at(p), at(q), at(a), at(b), at(c))) pairs.push_back({e, static_cast<int>(t)});
      if (pairs.size() >= most) return pairs;
    }
  }
  return pairs;
}

template <int Dim>
bool is_positively_oriented(const typename MeshTypes<Dim>::Cell& cell, ConstVectorView x) {
  return cell_orientation(cell, x) > 0;
}

template bool is_positively_oriented<2>(const MeshTypes<2>::Cell&, ConstVectorView);
template bool is_positively_oriented<3>(const MeshTypes<3>::Cell&, ConstVectorView);

}  // namespace itr
