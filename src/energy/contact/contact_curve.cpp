// SPDX-License-Identifier: MIT
#include "energy/contact/contact_curve.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "core/connected_parts.hpp"

namespace itr {

namespace {

/// Builds the pieces at one vertex after the other.
class PieceBuilder {
 public:
  PieceBuilder(const CollisionSurface& surface, const Retraction& retraction)
      : retraction_(retraction),
        part_(connected_parts<2>(surface.area.size(), std::span<const std::array<int, 2>>(surface.edges))),
        neighbours_(surface.area.size(), {kNone, kNone}) {
    for (const auto& [a, b] : surface.edges) {
      neighbours_[a][neighbours_[a][0] != kNone] = b;
      neighbours_[b][neighbours_[b][0] != kNone] = a;
    }
  }

  void add(int v, std::vector<CurvePiece>& pieces) const {
    const auto [u, w] = neighbours_[v];
    if (is_smooth(v)) {
      Mat<3> hats;
      hats << 0.5, -1, 0.5, 0.5, 1, -1, 0, 0, 0.5;  // of u, v and w, from the middle of u v to that of v w
      pieces.push_back(piece(v, {u, v, w}, hats, (length(u, v) + length(v, w)) / 2));
      return;
    }
    for (const int other : neighbours_[v]) {
      if (other == kNone) continue;
      Mat<3> hats;
      hats << 0.5, -0.5, 0, 0.5, 0.5, 0, 0, 0, 0;  // from the middle of the edge to v
      pieces.push_back(piece(v, {other, v, v}, hats, length(other, v) / 2));
    }
  }

 private:
  bool is_smooth(int v) const { return !retraction_.is_corner[v] && neighbours_[v][1] != kNone; }
  double length(int a, int b) const { return (retraction_.rest[a] - retraction_.rest[b]).norm(); }

  CurvePiece piece(int v, const std::array<int, 3>& owners, const Mat<3>& hats, double length) const {
    CurvePiece piece;
    piece.part = part_[v];
    piece.vertex = v;
    piece.owners = owners;
    piece.hats = hats;
    piece.length = length;
    const auto add = [&](int vertex, const Vec<3>& coefficients) {
      const auto end = piece.vertices.begin() + piece.size;
      const auto at = std::find(piece.vertices.begin(), end, vertex);
      if (at == end) piece.vertices[piece.size++] = vertex;
      piece.coefficients.row(at - piece.vertices.begin()) += coefficients.transpose();
    };
    for (int k = 0; k < 3; ++k) {
      const Vec<3> hat = hats.row(k).transpose();
      if (hat.isZero(0)) continue;
      if (!is_smooth(owners[k])) {
        add(owners[k], hat);
        continue;
      }
      add(owners[k], 1.25 * hat);  // the control point that makes the curve pass near the vertex
      for (const int neighbour : neighbours_[owners[k]]) add(neighbour, -0.125 * hat);
    }
    const Vec<2> tangent = rest_position(piece, piece.slope(0.5));
    piece.side = Vec<2>(tangent[1], -tangent[0]).dot(retraction_.outward[v]) < 0 ? -1 : 1;
    return piece;
  }
  Vec<2> rest_position(const CurvePiece& piece, const CurvePiece::Weights& weights) const {
    Vec<2> p = Vec<2>::Zero();
    for (int i = 0; i < piece.size; ++i) p += weights[i] * retraction_.rest[piece.vertices[i]];
    return p;
  }

  const Retraction& retraction_;
  std::vector<int> part_;
  std::vector<std::array<int, 2>> neighbours_;
};

}  // namespace

std::vector<CurvePiece> curve_pieces(const CollisionSurface& surface, const Retraction& retraction) {
  const PieceBuilder builder(surface, retraction);
  std::vector<CurvePiece> pieces;
  for (int v = 0; v < static_cast<int>(surface.area.size()); ++v) builder.add(v, pieces);
  return pieces;
}

double PlacedPiece::nearest(const Vec<2>& q) const {
  constexpr int kSamples = 4;
  double t = 0, least = (q - c[0]).squaredNorm();
  for (int k = 1; k <= kSamples; ++k)
    if (const double squared = (q - at(double(k) / kSamples)).squaredNorm(); squared < least) {
      least = squared;
      t = double(k) / kSamples;
    }
  const auto slope = [&](double s) { return (at(s) - q).dot(tangent(s)); };  // of half the squared distance
  const double low = std::max(0.0, t - 1.0 / kSamples), high = std::min(1.0, t + 1.0 / kSamples);
  if (slope(low) >= 0) return low;
  if (slope(high) <= 0) return high;
  return bracketed_root(low, high, t,
                        [&](double s) { return std::pair(slope(s), tangent(s).squaredNorm() + 2 * (at(s) - q).dot(c[2])); });
}

}  // namespace itr
