// SPDX-License-Identifier: MIT
// Proofs about curves by Bernstein bounds, against dense samples of the curves.
#include "geometry/quadratic_patch.hpp"

#include <gtest/gtest.h>

#include <random>

namespace itr {
namespace {

template <int Dim>
class Draw {
 public:
  Vec<Dim> point(double size) {
    Vec<Dim> p;
    for (int c = 0; c < Dim; ++c) p[c] = size * number_(random_);
    return p;
  }
  /// A patch about the origin, whose edges leave their chords.
  QuadraticPatch<Dim> patch() {
    std::array<Vec<Dim>, Dim> corners;
    for (auto& corner : corners) corner = point(1);
    return quadratic_patch<Dim>(corners,
                                [&](int i, int j) -> Vec<Dim> { return (corners[i] + corners[j]) / 2 + point(0.4); });
  }

 private:
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> number_{-1, 1};
};

template <int Dim>
Vec<Dim> value(const QuadraticPatch<Dim>& patch, const Vec<Dim>& barycentric) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < Dim; ++j) sum += barycentric[i] * barycentric[j] * patch.at[i][j];
  return sum;
}

template <int Dim>
QuadraticPatch<Dim> moved(QuadraticPatch<Dim> patch, const Vec<Dim>& by) {
  for (auto& row : patch.at)
    for (Vec<Dim>& p : row) p += by;
  return patch;
}

template <int Dim>
std::vector<Vec<Dim>> samples(const QuadraticPatch<Dim>& patch, int n) {
  std::vector<Vec<Dim>> result;
  for (int i = 0; i <= n; ++i) {
    if constexpr (Dim == 2)
      result.push_back(value<2>(patch, Vec<2>(i, n - i) / n));
    else
      for (int j = 0; i + j <= n; ++j) result.push_back(value<3>(patch, Vec<3>(i, j, n - i - j) / n));
  }
  return result;
}

template <int Dim>
void expect_proofs_to_agree_with_samples(int n) {
  Draw<Dim> draw;
  int apart = 0, touching = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const QuadraticPatch<Dim> a = draw.patch(), b = moved<Dim>(draw.patch(), draw.point(0.7));
    double distance = 1e9;
    const auto of_b = samples<Dim>(b, n);
    for (const auto& p : samples<Dim>(a, n))
      for (const auto& q : of_b) distance = std::min(distance, (p - q).norm());
    const bool is_proven = are_apart<Dim>(a, b);
    EXPECT_EQ(is_proven, are_apart<Dim>(b, a)) << trial;
    if (is_proven) EXPECT_GT(distance, 0) << trial;
    if (distance > 8.0 / n) EXPECT_TRUE(is_proven) << trial << ", " << distance;
    ++(is_proven ? apart : touching);
    // Let the two share one point.
    Vec<Dim> where = Vec<Dim>::Constant(0.6 / (Dim - 1));
    where[0] = 0.4;
    EXPECT_FALSE(are_apart<Dim>(a, moved<Dim>(b, value<Dim>(a, where) - value<Dim>(b, where)))) << trial;
  }
  EXPECT_GT(apart, 50);
  EXPECT_GT(touching, 20);
}

TEST(QuadraticPatch, PlaneCurvesAreApartWhereSamplesAre) { expect_proofs_to_agree_with_samples<2>(200); }
TEST(QuadraticPatch, CurvedTrianglesAreApartWhereSamplesAre) { expect_proofs_to_agree_with_samples<3>(16); }

TEST(QuadraticPatch, TellsGapsFarUnderTheCurvesHeight) {
  const QuadraticPatch<2> arc = quadratic_patch<2>({Vec<2>(0, 0), Vec<2>(1, 0)}, [](int, int) { return Vec<2>(0.5, 0.1); });
  for (const double gap : {1e-3, 1e-9, 1e-12}) {
    const auto line = [&](double y) {
      return quadratic_patch<2>({Vec<2>(0, y), Vec<2>(1, y)}, [&](int, int) { return Vec<2>(0.5, y); });
    };
    EXPECT_TRUE(are_apart<2>(arc, line(0.1 + gap))) << gap;
    EXPECT_FALSE(are_apart<2>(arc, line(0.1 - gap))) << gap;
  }
}

TEST(QuadraticPatch, PointsBetweenCurveAndChordAreBeyondTheChord) {
  const QuadraticPatch<2> arc = quadratic_patch<2>({Vec<2>(0, 0), Vec<2>(1, 0)}, [](int, int) { return Vec<2>(0.5, 0.1); });
  for (const double x : {0.1, 0.3, 0.5, 0.77}) {
    const double height = 0.4 * x * (1 - x);
    for (const double fraction : {0.01, 0.5, 0.999999}) EXPECT_TRUE(is_beyond_chord(arc, Vec<2>(x, fraction * height))) << x;
    for (const double fraction : {-0.01, 1.000001, 2.0})
      EXPECT_FALSE(is_beyond_chord(arc, Vec<2>(x, fraction * height))) << x;
  }
}

}  // namespace
}  // namespace itr
