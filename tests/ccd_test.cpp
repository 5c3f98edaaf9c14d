// SPDX-License-Identifier: MIT
// Conservative collision times: never late, never zero, and none for pairs that pass by.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "geometry/ccd.hpp"
#include "geometry/distance.hpp"
#include "geometry/predicates.hpp"
#include "random_points.hpp"

namespace itr {
namespace {

template <typename T>
class EdgeCcd : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(EdgeCcd, Dimensions);

/// Fraction of the distance at the start that is kept until a collision, and by points that pass by.
double least_fraction(double time) { return time < 1 ? CcdOptions{}.min_separation_ratio : CcdOptions{}.passing_ratio; }

TYPED_TEST(EdgeCcd, CollisionTimesAreNeverLateAndNeverZero) {
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
      EXPECT_GE(std::sqrt(point_edge_distance_squared<Dim>(q, c, d)), least_fraction(toi) * start * (1 - 1e-9)) << i;
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
      for (int k = 0; k <= 100; ++k) EXPECT_GE(now(toi * k / 100), least_fraction(toi) * now(0) * (1 - 1e-9)) << i;
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
    const double fraction = ccd(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], CcdOptions{});
    for (int k = 0; k < 4; ++k) x[k] += fraction * motion[k];
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

}  // namespace
}  // namespace itr
