// SPDX-License-Identifier: MIT
#include "geometry/intersection.hpp"

#include <cmath>

namespace itr {

namespace {

constexpr double kRoundOff = 1e-15;  ///< of the volume of a: pieces below it are noise
constexpr double kTouching = 1e-14;  ///< of a height: simplices that overlap by less only touch

/// A point by its barycentric coordinates in both simplices.
template <int Dim>
struct Corner {
  Vec<Dim + 1> in_a, in_b;
};

/// Clips a simplex by one plane of b after another, depth first, and gives what is left, with its fraction of a, to a sink.
template <int Dim, typename Sink>
class Clipper {
 public:
  using Piece = std::array<Corner<Dim>, Dim + 1>;

  explicit Clipper(Sink& sink) : sink_(sink) {}

  /// Adds the rest of `piece` behind the planes from `plane` on, where a barycentric coordinate of b is not negative.
  void clip(const Piece& piece, int plane) {
    if (plane > Dim) return add(piece);
    Cut cut;
    for (const auto& corner : piece) (corner.in_b[plane] >= 0 ? cut.in[cut.num_in++] : cut.out[cut.num_out++]) = &corner;
    if (cut.num_out == 0) return clip(piece, plane + 1);
    // Simplices of the first k + 1 corners inside and a monotone path through the grid of cut edges, for each k and path.
    Piece part;
    for (int k = 0; k < cut.num_in; ++k) {
      part[k] = *cut.in[k];
      add_paths(cut, part, k + 1, k, 0, plane);
    }
  }

 private:
  struct Cut {
    std::array<const Corner<Dim>*, Dim + 1> in, out;
    int num_in = 0, num_out = 0;
  };

  static Corner<Dim> cut_edge(const Corner<Dim>& in, const Corner<Dim>& out, int plane) {
    const double fraction = in.in_b[plane] / (in.in_b[plane] - out.in_b[plane]);
    Corner<Dim> point{in.in_a + fraction * (out.in_a - in.in_a), in.in_b + fraction * (out.in_b - in.in_b)};
    point.in_b[plane] = 0;
    return point;
  }

  void add_paths(const Cut& cut, Piece& part, int filled, int i, int o, int plane) {
    part[filled] = cut_edge(*cut.in[i], *cut.out[o], plane);
    if (filled == Dim) return clip(part, plane + 1);
    if (i + 1 < cut.num_in) add_paths(cut, part, filled + 1, i + 1, o, plane);
    if (o + 1 < cut.num_out) add_paths(cut, part, filled + 1, i, o + 1, plane);
  }

  void add(const Piece& piece) {
    Mat<Dim> edges;
    for (int k = 0; k < Dim; ++k) edges.col(k) = piece[k + 1].in_a.template tail<Dim>() - piece[0].in_a.template tail<Dim>();
    const double fraction = std::abs(edges.determinant());
    if (fraction < kRoundOff) return;
    sink_.add(piece, fraction);
  }

  Sink& sink_;
};

template <int Dim>
using Piece = std::array<Corner<Dim>, Dim + 1>;

/// Sums of products of barycentric coordinates.
template <int Dim>
struct ProductSink {
  OverlapIntegrals<Dim>& sum;

  void add(const Piece<Dim>& piece, double fraction) {
    Vec<Dim + 1> total_a = Vec<Dim + 1>::Zero(), total_b = Vec<Dim + 1>::Zero();
    for (const auto& corner : piece) {
      total_a += corner.in_a;
      total_b += corner.in_b;
      add_products(fraction, corner.in_a, corner.in_b);
    }
    add_products(fraction, total_a, total_b);
  }
  void add_products(double fraction, const Vec<Dim + 1>& a, const Vec<Dim + 1>& b) {
    sum.aa.noalias() += fraction * a * a.transpose();
    sum.ab.noalias() += fraction * a * b.transpose();
    sum.bb.noalias() += fraction * b * b.transpose();
  }
};

template <int Dim>
struct ListSink {
  std::vector<OverlapPiece<Dim>>& pieces;
  double volume;  ///< of a

  void add(const Piece<Dim>& piece, double fraction) {
    OverlapPiece<Dim>& listed = pieces.emplace_back();
    for (int k = 0; k <= Dim; ++k) {
      listed.in_a[k] = piece[k].in_a;
      listed.in_b[k] = piece[k].in_b;
    }
    listed.volume = fraction * volume;
  }
};

/// Whether a plane of `simplex` has all of the other one's corners on its outer side.
template <int Dim>
bool separates(const Simplex<Dim>& simplex, const Simplex<Dim>& other) {
  Vec<Dim + 1> largest = simplex.barycentric(other.corners[0]);
  for (int k = 1; k <= Dim; ++k) largest = largest.cwiseMax(simplex.barycentric(other.corners[k]));
  return largest.minCoeff() < kTouching;
}

template <int Dim>
Piece<Dim> whole(const Simplex<Dim>& a, const Simplex<Dim>& b) {
  Piece<Dim> piece;
  for (int k = 0; k <= Dim; ++k) piece[k] = {Vec<Dim + 1>::Unit(k), b.barycentric(a.corners[k])};
  return piece;
}

}  // namespace

template <int Dim>
bool integrate_overlap(const Simplex<Dim>& a, const Simplex<Dim>& b, OverlapIntegrals<Dim>& integrals) {
  integrals.aa.setZero();
  integrals.ab.setZero();
  integrals.bb.setZero();
  if (separates(a, b) || separates(b, a)) return false;
  ProductSink<Dim> sink{integrals};
  Clipper<Dim, ProductSink<Dim>>(sink).clip(whole(a, b), 0);
  const double scale = a.volume / ((Dim + 1) * (Dim + 2));
  integrals.aa *= scale;
  integrals.ab *= scale;
  integrals.bb *= scale;
  return integrals.volume() > 0;
}

template <int Dim>
void list_overlap(const Simplex<Dim>& a, const Simplex<Dim>& b, std::vector<OverlapPiece<Dim>>& pieces) {
  pieces.clear();
  if (separates(a, b) || separates(b, a)) return;
  ListSink<Dim> sink{pieces, a.volume};
  Clipper<Dim, ListSink<Dim>>(sink).clip(whole(a, b), 0);
}

template void list_overlap<2>(const Simplex<2>&, const Simplex<2>&, std::vector<OverlapPiece<2>>&);
template void list_overlap<3>(const Simplex<3>&, const Simplex<3>&, std::vector<OverlapPiece<3>>&);
template bool integrate_overlap<2>(const Simplex<2>&, const Simplex<2>&, OverlapIntegrals<2>&);
template bool integrate_overlap<3>(const Simplex<3>&, const Simplex<3>&, OverlapIntegrals<3>&);

}  // namespace itr
