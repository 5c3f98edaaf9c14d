// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "geometry/bvh.hpp"
#include "geometry/ccd.hpp"
#include "geometry/closed_surface.hpp"
#include "geometry/intersection.hpp"
#include "geometry/measures.hpp"
#include "geometry/predicates.hpp"
#include "itr/geometry/distance.hpp"

namespace itr {
namespace {

template <typename T>
class Geometry : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Geometry, Dimensions);

template <int Dim>
Vec<Dim> random_point(std::mt19937& random, double scale = 1) {
  std::uniform_real_distribution<double> coordinate(-scale, scale);
  return Vec<Dim>::NullaryExpr([&] { return coordinate(random); });
}

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

template <int Dim>
std::array<Vec<Dim>, 4> random_pair(std::mt19937& random) {
  return {random_point<Dim>(random), random_point<Dim>(random), random_point<Dim>(random), random_point<Dim>(random)};
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

/// Share of the distance at the start that is kept until a collision, and by points that pass by.
double least_share(double time) { return time < 1 ? CcdOptions{}.min_separation_ratio : CcdOptions{}.passing_ratio; }

TYPED_TEST(Geometry, CollisionTimesAreNeverLateAndNeverZero) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(4);
  int collisions = 0;
  for (int i = 0; i < 500; ++i) {
    Vec<Dim> p[2], a[2], b[2];
    for (int t = 0; t < 2; ++t) {
      p[t] = random_point<Dim>(random);
      a[t] = random_point<Dim>(random);
      b[t] = random_point<Dim>(random);
    }
    if (i % 4 == 0) {  // they meet at half of the way, which in space random ones hardly do
      const Vec<Dim> on_edge = (0.7 * (a[0] + a[1]) + 0.3 * (b[0] + b[1])) / 2;
      p[1] = 2 * on_edge - p[0];
    }
    const double start = std::sqrt(point_edge_distance_squared<Dim>(p[0], a[0], b[0]));
    const double toi = point_edge_ccd<Dim>(p[0], a[0], b[0], p[1], a[1], b[1]);
    EXPECT_GT(toi, 0);
    if (i % 4 == 0) {
      EXPECT_LT(toi, 0.5) << i;
    }
    collisions += toi < 1;
    for (int k = 0; k <= 200; ++k) {
      const double t = toi * k / 200;
      const Vec<Dim> q = p[0] + t * (p[1] - p[0]), c = a[0] + t * (a[1] - a[0]), d = b[0] + t * (b[1] - b[0]);
      EXPECT_GE(std::sqrt(point_edge_distance_squared<Dim>(q, c, d)), least_share(toi) * start * (1 - 1e-9)) << i;
    }
  }
  EXPECT_GT(collisions, 50);
}

TEST(Ccd, IsNeverLateAndNeverZeroFor3DPairs) {
  std::mt19937 random(8);
  int collisions = 0;
  for (int i = 0; i < 1000; ++i)
    for (const PairKind kind : {PairKind::face_vertex, PairKind::edge_edge}) {
      auto x = random_pair<3>(random), y = random_pair<3>(random);
      if (i % 4 == 0) x[3] = x[2] + (x[1] - x[0]), y[3] = y[2] + (y[1] - y[0]);  // parallel edges at both ends
      if (i % 11 == 0) x[3] = x[2], y[3] = y[2];                                 // degenerate
      const auto now = [&](double t) {
        std::array<Vec<3>, 4> p;
        for (int k = 0; k < 4; ++k) p[k] = x[k] + t * (y[k] - x[k]);
        return std::sqrt(pair_distance_squared<3>(kind, p.data()));
      };
      const double toi = kind == PairKind::face_vertex ? point_triangle_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3])
                                                       : edge_edge_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]);
      EXPECT_GT(toi, 0);
      collisions += toi < 1;
      for (int k = 0; k <= 100; ++k) EXPECT_GE(now(toi * k / 100), least_share(toi) * now(0) * (1 - 1e-9)) << i;
    }
  EXPECT_GT(collisions, 100);
}

/// Pairs that meet at half of the way to the last bit, from starts as near as round-off: all numbers are small dyadic ones.
TEST(Ccd, MissesNothingThatMeetsExactly) {
  std::mt19937 random(6);
  const auto grid_point = [&](double unit) -> Vec<3> {
    std::uniform_int_distribution<int> number(-8, 8);
    return unit * Vec<3>(number(random), number(random), number(random));
  };
  for (int i = 0; i < 4000; ++i) {
    std::array<Vec<3>, 4> x, y;
    for (int k = 0; k < 4; ++k) x[k] = grid_point(0.125), y[k] = grid_point(0.125);
    const Vec<3> near = grid_point(std::ldexp(1, -(i % 40)));
    const auto middle = [&](int k) -> Vec<3> { return (x[k] + y[k]) / 2; };
    x[0] = (x[1] + x[2] + 2 * x[3]) / 4 + near;  // the point and the triangle
    y[0] = (middle(1) + middle(2) + 2 * middle(3)) / 2 - x[0];
    if (pair_distance_squared<3>(PairKind::face_vertex, x.data()) > 0) {
      EXPECT_LE(point_triangle_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]), 0.5) << i;
    }
    x[1] = grid_point(0.125), y[1] = grid_point(0.125);  // the middles of two edges
    x[0] = x[2] + x[3] - x[1] + near;
    y[0] = 2 * (middle(2) + middle(3) - middle(1)) - x[0];
    if (pair_distance_squared<3>(PairKind::edge_edge, x.data()) > 0) {
      EXPECT_LE(edge_edge_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]), 0.5) << i;
    }
  }
}

/// The positions after `times` steps of a pair that goes on towards contact, each along what is free of the motion.
template <class Ccd>
std::array<Vec<3>, 4> after_steps_together(std::array<Vec<3>, 4> x, const std::array<Vec<3>, 4>& motion, int times,
                                           const Ccd& ccd) {
  for (int i = 0; i < times; ++i) {
    std::array<Vec<3>, 4> y;
    for (int k = 0; k < 4; ++k) y[k] = x[k] + motion[k];
    const double share = ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], CcdOptions{});
    for (int k = 0; k < 4; ++k) x[k] += share * motion[k];
  }
  return x;
}

/// Each step may take four fifths of the distance: after twenty of them only round-off would be left to decide on the side.
TEST(Ccd, KeepsTheSideOverHundredsOfStepsTogether) {
  std::mt19937 random(12);
  for (int i = 0; i < 200; ++i) {
    std::array<Vec<3>, 4> face{random_point<3>(random), random_point<3>(random), random_point<3>(random),
                               random_point<3>(random)};
    const Vec<3> motion = (face[1] + face[2] + face[3]) / 3 - face[0];
    const int side = orientation(face[0], face[1], face[2], face[3]);
    const Vec<3> zero = Vec<3>::Zero();
    face = after_steps_together(face, {motion, zero, zero, zero}, 300, point_triangle_ccd);
    EXPECT_EQ(orientation(face[0], face[1], face[2], face[3]), side) << i;

    std::array<Vec<3>, 4> edges{random_point<3>(random), random_point<3>(random), random_point<3>(random),
                                random_point<3>(random)};
    const Vec<3> together = (edges[2] + edges[3] - edges[0] - edges[1]) / 2;
    const int turn = orientation(edges[0], edges[1], edges[2], edges[3]);
    edges = after_steps_together(edges, {together, together, zero, zero}, 300, edge_edge_ccd);
    EXPECT_EQ(orientation(edges[0], edges[1], edges[2], edges[3]), turn) << i;
  }
}

TEST(Ccd, LetsPairsWithinRoundOffMoveApartOnly) {
  const Vec<3> a(1, 0, 0), b(0, 1, 0), c(-1, -1, 0), above(0, 0, 5e-15);
  const auto free = [&](const Vec<3>& to) { return point_triangle_ccd(above, a, b, c, to, a, b, c); };
  EXPECT_EQ(free({0, 0, 1}), 1);
  EXPECT_EQ(free({0.1, 0, 5e-15}), 1);
  EXPECT_EQ(free({0, 0, 4e-15}), 0);
  EXPECT_EQ(free({0, 0, -1}), 0);
}

/// Points that pass by do not collide, however near: only those within round-off may be called a collision.
TEST(Ccd, LetsPassBy) {
  std::mt19937 random(3);
  int near = 0, collisions = 0;
  for (int i = 0; i < 4000; ++i)
    for (const PairKind kind : {PairKind::face_vertex, PairKind::edge_edge}) {
      const auto x = random_pair<3>(random), y = random_pair<3>(random);
      double nearest = std::numeric_limits<double>::infinity(), start = 0;
      constexpr int kSamples = 300;
      for (int k = 0; k <= kSamples; ++k) {
        std::array<Vec<3>, 4> p;
        for (int v = 0; v < 4; ++v) p[v] = x[v] + double(k) / kSamples * (y[v] - x[v]);
        nearest = std::min(nearest, std::sqrt(pair_distance_squared<3>(kind, p.data())));
        if (k == 0) start = nearest;
      }
      double fastest = 0;
      for (int v = 0; v < 4; ++v) fastest = std::max(fastest, (y[v] - x[v]).norm());
      const double toi = kind == PairKind::face_vertex ? point_triangle_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3])
                                                       : edge_edge_ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]);
      collisions += toi < 1;
      if (nearest <= fastest / kSamples) continue;  // between two samples it may have been anywhere
      EXPECT_EQ(toi, 1) << i << ": passes at " << nearest / start;
      near += nearest < 0.2 * start;
    }
  EXPECT_GT(near, 100);
  EXPECT_GT(collisions, 100);
}

TEST(Ccd, StopsAtAFastThinObstacleAndLetsSlidingPass) {
  const Vec<2> a(-1, 0), b(1, 0);
  EXPECT_LT((point_edge_ccd<2>({0, 1}, a, b, {0, -1000}, a, b)), 1.0 / 1001);
  EXPECT_EQ((point_edge_ccd<2>({-0.5, 1e-3}, a, b, {0.5, 1e-3}, a, b)), 1);
  EXPECT_EQ((point_edge_ccd<2>({0, 1e-3}, a, b, {0, 1e-3}, a, b)), 1);
  EXPECT_EQ((point_edge_ccd<2>({0, 1e-3}, a, b, {500, 1e-3}, Vec<2>(499, 0), Vec<2>(501, 0))), 1);  // moving together
}

TEST(Ccd, LetsPairsTurnAndSlideAtATinyGap) {
  constexpr double kGap = 1e-8;
  EXPECT_EQ((point_edge_ccd<2>({0, kGap}, {-1, 0}, {1, 0}, {0, kGap}, {-0.7, -0.5}, {1.3, 0.2})), 1);
  const Vec<3> point(0, 0, kGap);
  const auto triangle_turned = [&](double angle) {  // about an axis through the point, and moved in its own plane
    const Vec<3> along(std::cos(angle), 0, std::sin(angle)), across(0, 1, 0);
    return std::array<Vec<3>, 3>{1.3 * along - across, -0.7 * along - across, 0.3 * along + 2 * across};
  };
  const auto from = triangle_turned(0), to = triangle_turned(0.3);
  const Vec<3> away(0, 0, -1e-3);
  EXPECT_EQ(point_triangle_ccd(point, from[0], from[1], from[2], point, to[0] + away, to[1] + away, to[2] + away), 1);
  EXPECT_LT(point_triangle_ccd(point, from[0], from[1], from[2], point, to[0] - away, to[1] - away, to[2] - away), 1e-2);
  const Vec<3> c(0, -1, kGap), d(0, 1, kGap);
  EXPECT_EQ(edge_edge_ccd({-1, 0, 0}, {1, 0, 0}, c, d, {-0.7, 0, -0.5}, {1.3, 0, 0.2}, c, d), 1);
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
