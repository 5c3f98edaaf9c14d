// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "geometry/bvh.hpp"
#include "geometry/closed_surface.hpp"
#include "geometry/distance.hpp"
#include "geometry/intersection.hpp"
#include "geometry/measures.hpp"
#include "geometry/predicates.hpp"
#include "random_points.hpp"

namespace itr {
namespace {

template <typename T>
class Geometry : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Geometry, Dimensions);

/// The boundary of the squares or cubes of unit size that `is_solid` takes, on a lattice whose corners are whole numbers.
template <int Dim>
struct LatticeSolid {
  static constexpr int kSize = 6;  ///< cells lie in [0, kSize)^Dim
  std::vector<Vec<Dim>> x;
  std::vector<std::array<int, Dim>> facets;
  std::function<bool(const Vec<Dim>&)> is_solid;  ///< by the cell's lower corner

  explicit LatticeSolid(std::function<bool(const Vec<Dim>&)> solid) : is_solid(std::move(solid)) {
    const int points = kSize + 1;
    for (int i = 0; i < std::pow(points, Dim); ++i) {
      x.emplace_back();
      for (int c = 0, rest = i; c < Dim; ++c, rest /= points) x.back()[c] = rest % points;
    }
    for (const Vec<Dim>& corner : x)
      for (int axis = 0; axis < Dim; ++axis)
        for (const int side : {0, 1}) {
          Vec<Dim> neighbour = corner;
          neighbour[axis] += side ? 1 : -1;
          if (!solid_at(corner) || solid_at(neighbour)) continue;
          Vec<Dim> base = corner;
          base[axis] += side;
          add_side(base, axis, side == 1);
        }
  }
  bool solid_at(const Vec<Dim>& corner) const {
    return (corner.array() >= 0).all() && (corner.array() < kSize).all() && is_solid(corner);
  }
  int id(const Vec<Dim>& p) const {
    int sum = 0;
    for (int c = Dim - 1; c >= 0; --c) sum = sum * (kSize + 1) + static_cast<int>(p[c]);
    return sum;
  }
  void add_side(const Vec<Dim>& base, int axis, bool upper) {
    Vec<Dim> u = Vec<Dim>::Unit((axis + 1) % Dim);
    if constexpr (Dim == 2) {
      const bool forward = (axis == 0) == upper;  // counter-clockwise
      facets.push_back(forward ? std::array{id(base), id(base + u)} : std::array{id(base + u), id(base)});
    } else {
      Vec<3> v = Vec<3>::Unit((axis + 2) % 3);
      if (!upper) std::swap(u, v);
      facets.push_back({id(base), id(base + u), id(base + u + v)});
      facets.push_back({id(base), id(base + u + v), id(base + v)});
    }
  }
  /// On a lattice of quarters, where rays meet vertices, edges and facets.
  void expect_right_windings() const {
    const ClosedSurface<Dim> closed(x, facets);
    const int steps = 4 * kSize + 9;
    int inside = 0;
    for (int i = 0; i < std::pow(steps, Dim); ++i) {
      Vec<Dim> p;
      for (int c = 0, rest = i; c < Dim; ++c, rest /= steps) p[c] = 0.25 * (rest % steps) - 1;
      int solid = 0, around = 0;  // of the cells around p
      for (int k = 0; k < (1 << Dim); ++k) {
        Vec<Dim> nudged = p;
        for (int c = 0; c < Dim; ++c) nudged[c] += (k >> c) % 2 ? 0.1 : -0.1;
        solid += solid_at(nudged.array().floor().matrix());
        ++around;
      }
      const bool on_surface = solid != 0 && solid != around;
      ASSERT_EQ(closed.touches(p), on_surface) << p.transpose();
      if (on_surface) continue;
      ASSERT_EQ(closed.winding(p), solid ? 1 : 0) << p.transpose();
      inside += solid != 0;
    }
    EXPECT_GT(inside, 50);
  }
};

TYPED_TEST(Geometry, ClosedSurfacesHoldWhatIsInsideOfThem) {
  constexpr int Dim = TypeParam::value;
  // Odd, with a cavity and in the cavity another solid: none is inside of a solid.
  const auto ring = [](const Vec<Dim>& corner, double low, double high) {
    return (corner.array() >= low).all() && (corner.array() <= high).all();
  };
  const LatticeSolid<Dim> solid(
      [&](const Vec<Dim>& c) { return (!ring(c, 2, 4) && c != Vec<Dim>::Zero()) || ring(c, 3, 3); });
  solid.expect_right_windings();
  EXPECT_TRUE(ClosedSurface<Dim>(solid.x, solid.facets).nested().empty());
  // A solid in a solid is; an open surface has no inside.
  LatticeSolid<Dim> nested([&](const Vec<Dim>& c) { return ring(c, 0, 5); });
  const std::size_t outer = nested.facets.size();
  const LatticeSolid<Dim> small([&](const Vec<Dim>& c) { return ring(c, 2, 3); });
  nested.facets.insert(nested.facets.end(), small.facets.begin(), small.facets.end());
  const std::vector<int> found = ClosedSurface<Dim>(nested.x, nested.facets).nested();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0], small.facets[0][0]);
  nested.facets.erase(nested.facets.begin() + static_cast<std::ptrdiff_t>(outer) - 1);
  const ClosedSurface<Dim> open(nested.x, nested.facets);
  EXPECT_TRUE(open.nested().empty());
  EXPECT_EQ(open.winding(Vec<Dim>::Constant(1.5)), 0);
  EXPECT_EQ(open.winding(Vec<Dim>::Constant(2.5)), 1);
}

template <int Dim>
std::vector<PairKind> pair_kinds() {
  if (Dim == 2) return {PairKind::vertex_vertex, PairKind::edge_vertex};
  return {PairKind::vertex_vertex, PairKind::edge_vertex, PairKind::face_vertex, PairKind::edge_edge};
}

TYPED_TEST(Geometry, PairDistanceDerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i)
    for (const PairKind kind : pair_kinds<Dim>()) {
      const auto x = random_pair<Dim>(random);
      const int dofs = Dim * pair_size(kind);
      const auto gradient = [&](const std::array<Vec<Dim>, 4>& y) {
        const PairDistance<Dim> pair = pair_distance<Dim>(kind, y.data());
        VectorX result(dofs);
        for (int k = 0; k < dofs; ++k) result[k] = 2 * pair.coefficients[k / Dim] * pair.separation[k % Dim];
        return result;
      };
      const MatrixX hessian = pair_distance_hessian<Dim>(kind, x.data()).topLeftCorner(dofs, dofs);
      const double h = 1e-6;
      for (int k = 0; k < dofs; ++k) {
        auto plus = x, minus = x;
        plus[k / Dim][k % Dim] += h;
        minus[k / Dim][k % Dim] -= h;
        const double up = pair_distance<Dim>(kind, plus.data()).squared,
                     down = pair_distance<Dim>(kind, minus.data()).squared;
        EXPECT_NEAR(gradient(x)[k], (up - down) / (2 * h), 1e-6 * (1 + gradient(x).norm()));
        EXPECT_LE((hessian.col(k) - (gradient(plus) - gradient(minus)) / (2 * h)).norm(), 1e-5 * (1 + hessian.norm()));
      }
    }
}

TYPED_TEST(Geometry, PairDistanceRangeHoldsTheHessian) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(2);
  for (int i = 0; i < 100; ++i)
    for (const PairKind kind : pair_kinds<Dim>()) {
      const auto x = random_pair<Dim>(random);
      const PairDistance<Dim> pair = pair_distance<Dim>(kind, x.data());
      const auto basis = pair_distance_range<Dim>(kind, pair);
      const MatrixX hessian = pair_distance_hessian<Dim>(kind, x.data());
      const MatrixX onto = basis * basis.transpose();
      EXPECT_LE((onto * hessian * onto - hessian).norm(), 1e-12 * (1 + hessian.norm()));
      const MatrixX gram = basis.transpose() * basis;
      EXPECT_LE((gram - MatrixX(gram.diagonal().asDiagonal())).norm(), 1e-12);
      for (const double length : gram.diagonal()) EXPECT_LE(std::min(std::abs(length), std::abs(length - 1)), 1e-12);
    }
}

TEST(Geometry3, EdgeCrossDerivativesMatchDifferences) {
  std::mt19937 random(6);
  for (int i = 0; i < 50; ++i) {
    const auto x = random_pair<3>(random);
    const CrossSquared cross = edge_cross_squared_with_gradient(x.data());
    EXPECT_NEAR(cross.value, edge_cross_squared(x.data()), 1e-13);
    const Mat<12> hessian = edge_cross_squared_hessian(x.data());
    const double h = 1e-6;
    for (int k = 0; k < 12; ++k) {
      auto plus = x, minus = x;
      plus[k / 3][k % 3] += h;
      minus[k / 3][k % 3] -= h;
      EXPECT_NEAR(cross.gradient[k], (edge_cross_squared(plus.data()) - edge_cross_squared(minus.data())) / (2 * h), 1e-6);
      const Vec<12> difference = (edge_cross_squared_with_gradient(plus.data()).gradient -
                                  edge_cross_squared_with_gradient(minus.data()).gradient) /
                                 (2 * h);
      EXPECT_LE((hessian.col(k) - difference).norm(), 1e-6);
    }
  }
}

/// Least squared distance over a grid of points of both primitives, refined around its best.
double sampled_distance_squared(PairKind kind, const std::array<Vec<3>, 4>& x) {
  const auto at = [&](double s, double t) -> double {
    if (kind == PairKind::edge_edge) return (x[0] + s * (x[1] - x[0]) - x[2] - t * (x[3] - x[2])).squaredNorm();
    if (s + t > 1) return HUGE_VAL;
    return (x[1] + s * (x[2] - x[1]) + t * (x[3] - x[1]) - x[0]).squaredNorm();
  };
  double best = HUGE_VAL, s0 = 0.5, t0 = 0.5, width = 0.5;
  for (int level = 0; level < 12; ++level, width *= 0.3) {
    const double s = s0, t = t0;
    for (int i = -10; i <= 10; ++i)
      for (int j = -10; j <= 10; ++j) {
        const double u = std::clamp(s + width * i / 10, 0.0, 1.0), v = std::clamp(t + width * j / 10, 0.0, 1.0);
        if (at(u, v) < best) best = at(u, v), s0 = u, t0 = v;
      }
  }
  return best;
}

/// Which of two features with other second derivatives a pair has on their border, round-off does not say.
TEST(Geometry3, RoundOffDoesNotChooseBetweenFeatures) {
  const double gap = 1e-3, round_off = 1e-15;
  const auto kind_at = [&](PairKind kind, const Vec<3>& p, const Vec<3>& q) {
    const std::array<Vec<3>, 4> triangle{p, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, edges{p, q, {0, 0, 0}, {1, 0, 0}};
    return closest_features<3>(kind, kind == PairKind::edge_edge ? edges.data() : triangle.data()).kind;
  };
  for (const double side : {-round_off, 0.0, round_off}) {
    EXPECT_EQ(kind_at(PairKind::face_vertex, {0.3, side, gap}, {}), PairKind::face_vertex) << side;
    EXPECT_EQ(kind_at(PairKind::edge_vertex, {side, 0, gap}, {}), PairKind::edge_vertex) << side;
    EXPECT_EQ(kind_at(PairKind::edge_edge, {side, -1, gap}, {side, 1, gap}), PairKind::edge_edge) << side;
  }
  for (const double out : {1e-6 * gap, gap}) {
    EXPECT_EQ(kind_at(PairKind::face_vertex, {0.3, -out, gap}, {}), PairKind::edge_vertex) << out;
    EXPECT_EQ(kind_at(PairKind::edge_vertex, {-out, 0, gap}, {}), PairKind::vertex_vertex) << out;
    EXPECT_EQ(kind_at(PairKind::edge_edge, {-out, -1, gap}, {-out, 1, gap}), PairKind::edge_vertex) << out;
  }
}

TEST(Geometry3, PairDistanceIsTheLeastOverAllPoints) {
  std::mt19937 random(7);
  for (int i = 0; i < 500; ++i)
    for (const PairKind kind : {PairKind::face_vertex, PairKind::edge_edge}) {
      auto x = random_pair<3>(random);
      if (i % 5 == 0) x[3] = x[2] + (x[1] - x[0]) + 1e-9 * random_point<3>(random);  // nearly parallel edges, slivers
      if (i % 7 == 0) x[3] = x[2];                                                   // degenerate
      const double squared = pair_distance_squared<3>(kind, x.data());
      EXPECT_LE(box_distance_squared<3>(kind, x.data()), squared * (1 + 1e-12));
      EXPECT_NEAR(std::sqrt(squared), std::sqrt(sampled_distance_squared(kind, x)), 2e-4) << i;
      const ClosestFeatures closest = closest_features<3>(kind, x.data());
      std::array<Vec<3>, 4> features;
      for (int k = 0; k < pair_size(closest.kind); ++k) features[k] = x[closest.local[k]];
      EXPECT_NEAR(pair_distance<3>(closest.kind, features.data()).squared, squared, 1e-12) << i;
    }
}

struct NamedPair {
  const char* name;
  PairKind kind;
  std::array<Vec<3>, 4> x;
  double distance;
};

TEST(Geometry3, DegeneratePairs) {
  using V = Vec<3>;
  const double tiny = 1e-12;
  const NamedPair pairs[] = {
      {"parallel edges side by side", PairKind::edge_edge, {V(0, 0, 0), V(1, 0, 0), V(0.2, 1, 0), V(0.8, 1, 0)}, 1},
      {"antiparallel edges", PairKind::edge_edge, {V(0, 0, 0), V(1, 0, 0), V(0.8, 1, 0), V(0.2, 1, 0)}, 1},
      {"parallel edges one after the other", PairKind::edge_edge, {V(0, 0, 0), V(1, 0, 0), V(4, 4, 0), V(5, 4, 0)}, 5},
      {"nearly parallel edges", PairKind::edge_edge, {V(0, 0, 0), V(1, 0, 0), V(0.2, 1, 0), V(0.8, 1, tiny)}, 1},
      {"collinear edges apart", PairKind::edge_edge, {V(0, 0, 0), V(1, 0, 0), V(3, 0, 0), V(4, 0, 0)}, 2},
      {"collinear edges that overlap", PairKind::edge_edge, {V(0, 0, 0), V(2, 0, 0), V(1, 0, 0), V(4, 0, 0)}, 0},
      {"coincident edges", PairKind::edge_edge, {V(0, 0, 0), V(1, 2, 3), V(0, 0, 0), V(1, 2, 3)}, 0},
      {"crossing edges that touch", PairKind::edge_edge, {V(-1, 0, 0), V(1, 0, 0), V(0, -1, 0), V(0, 1, 0)}, 0},
      {"an edge of no length", PairKind::edge_edge, {V(0.5, 2, 0), V(0.5, 2, 0), V(0, 0, 0), V(1, 0, 0)}, 2},
      {"two edges of no length", PairKind::edge_edge, {V(0, 0, 0), V(0, 0, 0), V(0, 3, 4), V(0, 3, 4)}, 5},
      {"vertex over a triangle", PairKind::face_vertex, {V(0.2, 0.2, 3), V(0, 0, 0), V(1, 0, 0), V(0, 1, 0)}, 3},
      {"vertex in the triangle", PairKind::face_vertex, {V(0.2, 0.2, 0), V(0, 0, 0), V(1, 0, 0), V(0, 1, 0)}, 0},
      {"vertex on a corner", PairKind::face_vertex, {V(1, 0, 0), V(0, 0, 0), V(1, 0, 0), V(0, 1, 0)}, 0},
      {"vertex beside, in the plane", PairKind::face_vertex, {V(0.5, -2, 0), V(0, 0, 0), V(1, 0, 0), V(0, 1, 0)}, 2},
      {"collinear triangle", PairKind::face_vertex, {V(0.5, 2, 0), V(0, 0, 0), V(1, 0, 0), V(3, 0, 0)}, 2},
      {"triangle of one point", PairKind::face_vertex, {V(3, 4, 0), V(0, 0, 0), V(0, 0, 0), V(0, 0, 0)}, 5},
      {"sliver triangle", PairKind::face_vertex, {V(0.5, 0, 2), V(0, 0, 0), V(1, 0, 0), V(0.5, tiny, 0)}, 2},
  };
  for (const auto& pair : pairs)
    EXPECT_NEAR(std::sqrt(pair_distance_squared<3>(pair.kind, pair.x.data())), pair.distance, 1e-7) << pair.name;
}

TYPED_TEST(Geometry, SegmentDistanceIsTheLeastOverItsPoints) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(2);
  for (int i = 0; i < 200; ++i) {
    const Vec<Dim> p = random_point<Dim>(random), a = random_point<Dim>(random), b = random_point<Dim>(random);
    double least = HUGE_VAL;
    for (int k = 0; k <= 1000; ++k) least = std::min(least, (p - (a + k / 1000.0 * (b - a))).squaredNorm());
    EXPECT_NEAR(point_edge_distance_squared<Dim>(p, a, b), least, 1e-5);
  }
}

TYPED_TEST(Geometry, TreeFindsWhatBruteForceFinds) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(3);
  std::vector<Box<Dim>> boxes(300);
  for (int pass = 0; pass < 2; ++pass) {
    for (auto& box : boxes) {
      box = {};
      const Vec<Dim> center = random_point<Dim>(random);
      box.include(center);
      box.include(Vec<Dim>(center + random_point<Dim>(random, 0.1)));
    }
    static Bvh<Dim> tree;
    if (pass == 0)
      tree.build(boxes);
    else
      tree.refit(boxes);
    for (const auto& query : boxes) {
      std::vector<int> hits, expected;
      tree.query(query, hits);
      std::sort(hits.begin(), hits.end());
      for (int i = 0; i < 300; ++i)
        if (boxes[i].overlaps(query)) expected.push_back(i);
      EXPECT_EQ(hits, expected);
    }
  }
}

TYPED_TEST(Geometry, OverlapIntegralsAreExact) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(5);
  const auto random_simplex = [&] {
    std::array<Vec<Dim>, Dim + 1> p;
    do {
      for (auto& q : p) q = random_point<Dim>(random);
      if (simplex_volume<Dim>(p) < 0) std::swap(p[0], p[1]);
    } while (simplex_volume<Dim>(p) < 0.05);
    return p;
  };
  for (int i = 0; i < 100; ++i) {
    const auto a = random_simplex(), b = random_simplex();
    OverlapIntegrals<Dim> ab, ba, aa;
    const bool overlaps = integrate_overlap(Simplex<Dim>(a), Simplex<Dim>(b), ab);
    EXPECT_EQ(overlaps, integrate_overlap(Simplex<Dim>(b), Simplex<Dim>(a), ba));
    EXPECT_EQ(overlaps, ab.volume() > 0);
    EXPECT_TRUE(integrate_overlap(Simplex<Dim>(a), Simplex<Dim>(a), aa));
    EXPECT_LE((ab.ab - ba.ab.transpose()).norm(), 1e-13);
    EXPECT_LE((ab.aa - ba.bb).norm() + (ab.bb - ba.aa).norm(), 1e-13);
    EXPECT_NEAR(ab.aa.sum(), ab.volume(), 1e-13);
    EXPECT_NEAR(ab.bb.sum(), ab.volume(), 1e-13);
    const Mat<Dim + 1> mass =
        simplex_volume<Dim>(a) / ((Dim + 1) * (Dim + 2)) * (Mat<Dim + 1>::Ones() + Mat<Dim + 1>::Identity());
    EXPECT_LE((aa.ab - mass).norm() + (aa.aa - mass).norm() + (aa.bb - mass).norm(), 1e-13);
    // b cut by a and by what is left of its bounding simplex: compare with sampling.
    const Mat<Dim> in_a = edge_matrix<Dim>(a).inverse(), in_b = edge_matrix<Dim>(b).inverse();
    int hits = 0;
    constexpr int kSamples = 2000;
    for (int k = 0; k < kSamples; ++k) {
      const Vec<Dim> X = random_point<Dim>(random);
      const Vec<Dim> wa = in_a * (X - a[0]), wb = in_b * (X - b[0]);
      hits += wa.minCoeff() >= 0 && wa.sum() <= 1 && wb.minCoeff() >= 0 && wb.sum() <= 1;
    }
    EXPECT_NEAR(ab.volume(), std::pow(2.0, Dim) * hits / kSamples, 0.35);
  }
}

TYPED_TEST(Geometry, SimplicesThatOnlyTouchDoNotOverlap) {
  constexpr int Dim = TypeParam::value;
  std::array<Vec<Dim>, Dim + 1> a, b;
  std::mt19937 random(6);
  for (int i = 0; i < 100; ++i) {
    do {
      for (auto& p : a) p = random_point<Dim>(random);
      if (simplex_volume<Dim>(a) < 0) std::swap(a[0], a[1]);
    } while (simplex_volume<Dim>(a) < 0.05);
    b = a;  // the same face, the other corner mirrored
    Vec<Dim> middle = Vec<Dim>::Zero();
    for (int k = 0; k < Dim; ++k) middle += a[k] / Dim;
    b[Dim] = 2 * middle - a[Dim];
    std::swap(b[0], b[1]);
    OverlapIntegrals<Dim> none;
    EXPECT_FALSE(integrate_overlap(Simplex<Dim>(a), Simplex<Dim>(b), none));
    EXPECT_EQ(none.volume(), 0);
  }
}

TEST(Measures, QualityIsOneForRegularSimplicesOnly) {
  const double height = std::sqrt(3.0) / 2;
  EXPECT_NEAR(simplex_quality<2>({Vec<2>(0, 0), Vec<2>(1, 0), Vec<2>(0.5, height)}), 1, 1e-15);
  EXPECT_NEAR(simplex_quality<2>({Vec<2>(0, 0), Vec<2>(0.5, height), Vec<2>(1, 0)}), -1, 1e-15);
  EXPECT_EQ(simplex_quality<2>({Vec<2>(0, 0), Vec<2>(1, 1), Vec<2>(3, 3)}), 0);
  EXPECT_NEAR(simplex_quality<2>({Vec<2>(0, 0), Vec<2>(7, 0), Vec<2>(0, 7)}), height, 1e-15);  // of any size
  EXPECT_NEAR(simplex_quality<3>({Vec<3>(1, 1, 1), Vec<3>(1, -1, -1), Vec<3>(-1, -1, 1), Vec<3>(-1, 1, -1)}), 1, 1e-15);
}

TEST(Predicates, AreExact) {
  const double tiny = std::ldexp(1.0, -53);
  EXPECT_EQ(orientation(Vec<2>(0, 0), Vec<2>(1, 1), Vec<2>(0.5, 0.5 + tiny)), 1);
  EXPECT_EQ(orientation(Vec<2>(0, 0), Vec<2>(1, 1), Vec<2>(0.5, 0.5)), 0);
  EXPECT_EQ(orientation(Vec<3>(0, 0, 0), Vec<3>(1, 0, 0), Vec<3>(0, 1, 0), Vec<3>(0, 0, 1)), 1);
  EXPECT_TRUE(segments_intersect({0, 0}, {1, 1}, {0.5, 0.5}, {2, 0}));  // touches
  EXPECT_TRUE(segments_intersect({0, 0}, {2, 0}, {1, 0}, {3, 0}));      // overlaps
  EXPECT_FALSE(segments_intersect({0, 0}, {1, 1}, {0.5, 0.5 + tiny}, {0, 2}));
  EXPECT_TRUE(segment_intersects_triangle({0.2, 0.2, -1}, {0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
  EXPECT_FALSE(segment_intersects_triangle({0.2, 0.2, 0.1}, {0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
}

/// Damaged frames have degenerate triangles and edges.
TEST(Predicates, TakeTrianglesForSegmentsAndSegmentsForPoints) {
  const Vec<3> a(0, 0, 0), b(2, 0, 0), middle(1, 0, 0), above(1, 0, 1), below(1, 0, -1), beside(3, 0, 1), out(3, 0, -1);
  for (const auto& corners : {std::array{a, b, middle}, std::array{a, b, b}, std::array{b, a, a}}) {
    const auto& [p, q, r] = corners;
    EXPECT_TRUE(segment_intersects_triangle(above, below, p, q, r));
    EXPECT_FALSE(segment_intersects_triangle(beside, out, p, q, r));
    EXPECT_TRUE(segment_intersects_triangle(middle, middle, p, q, r));
    EXPECT_FALSE(segment_intersects_triangle(above, above, p, q, r));
  }
  EXPECT_TRUE(segment_intersects_triangle(above, below, middle, middle, middle));
  EXPECT_FALSE(segment_intersects_triangle(beside, out, middle, middle, middle));
  EXPECT_TRUE(segment_intersects_triangle(middle, middle, a, b, {1, 2, 0}));
  EXPECT_FALSE(segment_intersects_triangle(above, above, a, b, {1, 2, 0}));
}

}  // namespace
}  // namespace itr
