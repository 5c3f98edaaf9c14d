// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "itr/geometry/bvh.hpp"
#include "itr/geometry/ccd.hpp"
#include "itr/geometry/distance.hpp"
#include "itr/geometry/intersection.hpp"
#include "itr/geometry/measures.hpp"
#include "itr/geometry/predicates.hpp"

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

TYPED_TEST(Geometry, LineDistanceDerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(1);
  for (int i = 0; i < 50; ++i) {
    Vec<3 * Dim> x;
    x << random_point<Dim>(random), random_point<Dim>(random), random_point<Dim>(random);
    const auto value = [](const Vec<3 * Dim>& y) {
      return point_line_distance_squared<Dim>(y.template head<Dim>(), y.template segment<Dim>(Dim), y.template tail<Dim>());
    };
    const auto gradient = [](const Vec<3 * Dim>& y) {
      return point_line_distance_squared_gradient<Dim>(y.template head<Dim>(), y.template segment<Dim>(Dim),
                                                       y.template tail<Dim>());
    };
    const Mat<3 * Dim> hessian = point_line_distance_squared_hessian<Dim>(
        x.template head<Dim>(), x.template segment<Dim>(Dim), x.template tail<Dim>());
    const double h = 1e-6;
    for (int k = 0; k < 3 * Dim; ++k) {
      const Vec<3 *Dim> plus = x + h * Vec<3 * Dim>::Unit(k), minus = x - h * Vec<3 * Dim>::Unit(k);
      EXPECT_NEAR(gradient(x)[k], (value(plus) - value(minus)) / (2 * h), 1e-6 * (1 + gradient(x).norm()));
      EXPECT_LE((hessian.col(k) - (gradient(plus) - gradient(minus)) / (2 * h)).norm(), 1e-5 * (1 + hessian.norm()));
    }
  }
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
    const double start = std::sqrt(point_edge_distance_squared<Dim>(p[0], a[0], b[0]));
    const double toi = point_edge_ccd<Dim>(p[0], a[0], b[0], p[1], a[1], b[1]);
    EXPECT_GT(toi, 0);
    collisions += toi < 1;
    for (int k = 0; k <= 200; ++k) {
      const double t = toi * k / 200;
      const Vec<Dim> q = p[0] + t * (p[1] - p[0]), c = a[0] + t * (a[1] - a[0]), d = b[0] + t * (b[1] - b[0]);
      EXPECT_GE(std::sqrt(point_edge_distance_squared<Dim>(q, c, d)), 0.2 * start * (1 - 1e-9)) << i;
    }
  }
  EXPECT_GT(collisions, 50);
}

TEST(Ccd, StopsAtAFastThinObstacleAndLetsSlidingPass) {
  const Vec<2> a(-1, 0), b(1, 0);
  EXPECT_LT((point_edge_ccd<2>({0, 1}, a, b, {0, -1000}, a, b)), 1.0 / 1001);
  EXPECT_EQ((point_edge_ccd<2>({-0.5, 1e-3}, a, b, {0.5, 1e-3}, a, b)), 1);
  EXPECT_EQ((point_edge_ccd<2>({0, 1e-3}, a, b, {0, 1e-3}, a, b)), 1);
  EXPECT_EQ((point_edge_ccd<2>({0, 1e-3}, a, b, {500, 1e-3}, Vec<2>(499, 0), Vec<2>(501, 0))), 1);  // moving together
}

TYPED_TEST(Geometry, PiecesOfAnIntersectionFillIt) {
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
  const auto volume = [](const std::vector<std::array<Vec<Dim>, Dim + 1>>& pieces) {
    double sum = 0;
    for (const auto& piece : pieces) sum += simplex_volume<Dim>(piece);
    return sum;
  };
  for (int i = 0; i < 100; ++i) {
    const auto a = random_simplex(), b = random_simplex();
    std::vector<std::array<Vec<Dim>, Dim + 1>> ab, ba, aa;
    intersect_simplices<Dim>(a, b, ab);
    intersect_simplices<Dim>(b, a, ba);
    intersect_simplices<Dim>(a, a, aa);
    EXPECT_NEAR(volume(ab), volume(ba), 1e-13);
    EXPECT_NEAR(volume(aa), simplex_volume<Dim>(a), 1e-13);
    // b cut by a and by what is left of its bounding simplex: compare with sampling.
    const Mat<Dim> in_a = edge_matrix<Dim>(a).inverse(), in_b = edge_matrix<Dim>(b).inverse();
    int hits = 0;
    constexpr int kSamples = 2000;
    for (int k = 0; k < kSamples; ++k) {
      const Vec<Dim> X = random_point<Dim>(random);
      const Vec<Dim> wa = in_a * (X - a[0]), wb = in_b * (X - b[0]);
      hits += wa.minCoeff() >= 0 && wa.sum() <= 1 && wb.minCoeff() >= 0 && wb.sum() <= 1;
    }
    EXPECT_NEAR(volume(ab), std::pow(2.0, Dim) * hits / kSamples, 0.35);
  }
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

}  // namespace
}  // namespace itr
