// SPDX-License-Identifier: MIT
#include "itr/geometry/intersection.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "itr/geometry/measures.hpp"

namespace itr {

namespace {

constexpr double kRoundOff = 1e-15;  ///< of the inputs' volume: pieces below it are noise

/// The part of a convex polygon on the left of the line a -> b (Sutherland & Hodgman 1974). Returns the number of corners.
int clip(const Vec<2>* polygon, int count, const Vec<2>& a, const Vec<2>& b, Vec<2>* clipped) {
  const auto side = [&](const Vec<2>& p) { return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]); };
  int kept = 0;
  double previous = side(polygon[count - 1]);
  for (int i = 0; i < count; ++i) {
    const Vec<2>& from = polygon[(i + count - 1) % count];
    const double here = side(polygon[i]);
    if ((previous < 0) != (here < 0)) clipped[kept++] = from + previous / (previous - here) * (polygon[i] - from);
    if (here >= 0) clipped[kept++] = polygon[i];
    previous = here;
  }
  return kept;
}

void intersect(const std::array<Vec<2>, 3>& a, const std::array<Vec<2>, 3>& b, std::vector<std::array<Vec<2>, 3>>& pieces) {
  const double least = kRoundOff * std::min(simplex_volume<2>(a), simplex_volume<2>(b));
  Vec<2> buffers[2][8];
  int count = 3, current = 0;
  std::copy(a.begin(), a.end(), buffers[0]);
  for (int k = 0; k < 3 && count > 0; ++k, current = 1 - current)
    count = clip(buffers[current], count, b[k], b[(k + 1) % 3], buffers[1 - current]);
  for (int i = 1; i + 1 < count; ++i) {
    const std::array<Vec<2>, 3> piece{buffers[current][0], buffers[current][i], buffers[current][i + 1]};
    if (simplex_volume<2>(piece) > least) pieces.push_back(piece);
  }
}

using Tet = std::array<Vec<3>, 4>;

/// The part of a tetrahedron where a linear function, given at its corners, is not negative: at most three tetrahedra.
void keep_positive(const Tet& tet, const std::array<double, 4>& f, std::vector<Tet>& kept) {
  std::array<int, 4> in{}, out{};
  int inside = 0, outside = 0;
  for (int i = 0; i < 4; ++i) (f[i] >= 0 ? in[inside++] : out[outside++]) = i;
  const auto cut = [&](int i, int o) { return Vec<3>(tet[i] + f[i] / (f[i] - f[o]) * (tet[o] - tet[i])); };
  const auto prism = [&](const std::array<Vec<3>, 3>& p, const std::array<Vec<3>, 3>& q) {
    kept.push_back({p[0], p[1], p[2], q[2]});
    kept.push_back({p[0], p[1], q[1], q[2]});
    kept.push_back({p[0], q[0], q[1], q[2]});
  };
  switch (inside) {
    case 4:
      kept.push_back(tet);
      break;
    case 3:
      prism({tet[in[0]], tet[in[1]], tet[in[2]]}, {cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0])});
      break;
    case 2:
      prism({tet[in[0]], cut(in[0], out[0]), cut(in[0], out[1])}, {tet[in[1]], cut(in[1], out[0]), cut(in[1], out[1])});
      break;
    case 1:
      kept.push_back({tet[in[0]], cut(in[0], out[0]), cut(in[0], out[1]), cut(in[0], out[2])});
      break;
    default:
      break;
  }
}

void intersect(const Tet& a, const Tet& b, std::vector<Tet>& pieces) {
  static constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  const double least = kRoundOff * std::min(simplex_volume<3>(a), simplex_volume<3>(b));
  std::vector<Tet> current{a}, next;
  for (const auto& face : kFaces) {
    const Vec<3> normal = (b[face[2]] - b[face[0]]).cross(b[face[1]] - b[face[0]]);  // inward
    next.clear();
    for (const Tet& tet : current) {
      std::array<double, 4> f;
      for (int i = 0; i < 4; ++i) f[i] = normal.dot(tet[i] - b[face[0]]);
      keep_positive(tet, f, next);
    }
    current.swap(next);
  }
  for (Tet& tet : current) {
    if (simplex_volume<3>(tet) < 0) std::swap(tet[2], tet[3]);
    if (simplex_volume<3>(tet) > least) pieces.push_back(tet);
  }
}

}  // namespace

template <int Dim>
void intersect_simplices(const std::array<Vec<Dim>, Dim + 1>& a, const std::array<Vec<Dim>, Dim + 1>& b,
                         std::vector<std::array<Vec<Dim>, Dim + 1>>& pieces) {
  intersect(a, b, pieces);
}

template void intersect_simplices<2>(const std::array<Vec<2>, 3>&, const std::array<Vec<2>, 3>&,
                                     std::vector<std::array<Vec<2>, 3>>&);
template void intersect_simplices<3>(const std::array<Vec<3>, 4>&, const std::array<Vec<3>, 4>&,
                                     std::vector<std::array<Vec<3>, 4>>&);

}  // namespace itr
