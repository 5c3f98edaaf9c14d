// SPDX-License-Identifier: MIT
// Numbers of shapes from patches of meshes on them: random kinds, sizes, places and resolutions.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

#include "geometry/fit_shape.hpp"

namespace itr {
namespace {

constexpr double kPi = std::numbers::pi;

struct Patch {
  Shape shape;
  std::vector<SurfaceTriangle> triangles;
};

/// A part of a shape of size about 1 that turns by at least half a radian each way, with 3 to 8 cells each way, somewhere.
class RandomPatch {
 public:
  explicit RandomPatch(unsigned seed) : random_(seed) {}

  Patch make(Shape::Kind kind) {
    const double size = std::pow(10, between(-3, 2));
    const Vec<3> origin = size * Vec<3>(between(-5, 5), between(-5, 5), between(-5, 5));
    const Eigen::Quaterniond turn = Eigen::Quaterniond(between(-1, 1), between(-1, 1), between(-1, 1), 1).normalized();
    Shape shape{.kind = kind, .center = origin, .axis = turn * Vec<3>::UnitZ(), .radius = size * between(0.3, 1)};
    shape.tube_radius = shape.radius * between(0.2, 0.7);
    shape.angle = between(0.2, 1.2);
    const double from_u = between(0, 2 * kPi), range_u = between(0.6, 2 * kPi), from_v = between(0, 1),
                 range_v = between(0.6, 1.5);
    const int nu = std::uniform_int_distribution(3, 8)(random_) + static_cast<int>(range_u),
              nv = std::uniform_int_distribution(3, 8)(random_);
    const auto at = [&](int i, int j) {
      const double u = from_u + range_u * i / nu, v = from_v + range_v * j / nv;
      return Vec<3>(origin + turn * place(shape, size, u, v));
    };
    Patch patch{shape, {}};
    for (int i = 0; i < nu; ++i)
      for (int j = 0; j < nv; ++j) {
        patch.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        patch.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    return patch;
  }

 private:
  double between(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }
  static Vec<3> place(const Shape& shape, double size, double u, double v) {
    const Vec<3> out(std::cos(u), std::sin(u), 0), up(0, 0, 1);
    using enum Shape::Kind;
    switch (shape.kind) {
      case plane:
        return size * Vec<3>(u / 3, v, 0);
      case sphere:
        return shape.radius * (std::cos(v - 1) * out + std::sin(v - 1) * up);
      case cylinder:
        return shape.radius * out + size * v * up;
      case cone:
        return size * (0.2 + v) * (std::sin(shape.angle) * out + std::cos(shape.angle) * up);
      default:
        return shape.radius * out + shape.tube_radius * (std::cos(3 * v) * out + std::sin(3 * v) * up);
    }
  }
  std::mt19937 random_;
};

void expect_same(const Shape& found, const Shape& right, double size) {
  const double near = 1e-7 * size;
  EXPECT_EQ(found.kind, right.kind);
  using enum Shape::Kind;
  const bool has_axis = right.kind != sphere, has_radius = right.kind != plane && right.kind != cone;
  EXPECT_LE(has_axis ? found.axis.cross(right.axis).norm() : 0, 1e-7);
  EXPECT_NEAR(has_radius ? found.radius : right.radius, right.radius, near);
  EXPECT_NEAR(right.kind == torus ? found.tube_radius : right.tube_radius, right.tube_radius, near);
  EXPECT_NEAR(right.kind == cone ? found.angle : right.angle, right.angle, 1e-7);
  const Vec<3> off = found.center - right.center;
  if (right.kind == plane) {
    EXPECT_NEAR(off.dot(right.axis), 0, near);
  } else if (right.kind == cylinder) {
    EXPECT_LE(off.cross(right.axis).norm(), near);
  } else {
    EXPECT_LE(off.norm(), near);
  }
}

struct Kinds : ::testing::TestWithParam<Shape::Kind> {};

TEST_P(Kinds, NumbersOfRandomPatchesAreFound) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    const Patch patch = RandomPatch(seed).make(GetParam());
    const double size = std::max(patch.shape.radius, patch.shape.tube_radius);
    const std::optional<ShapeFit> fit = fit_shape(GetParam(), patch.triangles);
    ASSERT_TRUE(fit);
    EXPECT_LE(fit->farthest, 1e-10 * size);
    expect_same(fit->shape, patch.shape, size);
  }
}

TEST_P(Kinds, KindsOfRandomPatchesAreRecognized) {
  for (unsigned seed = 1000; seed < 1050; ++seed) {
    SCOPED_TRACE(seed);
    const Patch patch = RandomPatch(seed).make(GetParam());
    const double size = std::max(patch.shape.radius, patch.shape.tube_radius);
    const std::optional<ShapeFit> fit = recognize_shape(patch.triangles, 1e-6 * size);
    ASSERT_TRUE(fit);
    expect_same(fit->shape, patch.shape, size);
  }
}

INSTANTIATE_TEST_SUITE_P(FitShape, Kinds,
                         ::testing::Values(Shape::Kind::plane, Shape::Kind::sphere, Shape::Kind::cylinder, Shape::Kind::cone,
                                           Shape::Kind::torus));

/// Two rings of six corners lie on a sphere, too.
TEST(FitShape, CoarseCylindersAreNoSpheres) {
  std::vector<SurfaceTriangle> triangles;
  const auto at = [](int i, double z) { return Vec<3>(std::cos(i * kPi / 3), std::sin(i * kPi / 3), z); };
  for (int i = 0; i < 6; ++i) {
    triangles.push_back({at(i, 0), at(i + 1, 0), at(i + 1, 1)});
    triangles.push_back({at(i, 0), at(i + 1, 1), at(i, 1)});
  }
  const std::optional<ShapeFit> fit = recognize_shape(triangles, 1e-6);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->shape.kind, Shape::Kind::cylinder);
  EXPECT_NEAR(fit->shape.radius, 1, 1e-9);
}

TEST(FitShape, FewCornersTellNoCylinder) {
  const Vec<3> a(0, 0, 0), b(1, 0, 0), up(0, 0, 1);
  const std::vector<SurfaceTriangle> triangles{{a, b, b + up}, {a, b + up, a + up}};
  EXPECT_FALSE(fit_shape(Shape::Kind::cylinder, triangles));
  EXPECT_TRUE(fit_shape(Shape::Kind::plane, triangles));
}

TEST(FitShape, CornersOfABoxLieOnNoCylinder) {
  std::vector<SurfaceTriangle> triangles;
  const Vec<3> a(0, 0, 0), b(1, 0, 0), c(1, 2, 0), d(0.5, 1, 0), up(0, 0, 1);
  for (const auto& [from, to] : {std::pair{a, b}, {b, c}, {c, d}, {d, a}}) {
    triangles.push_back({from, to, to + up});
    triangles.push_back({from, to + up, from + up});
  }
  EXPECT_FALSE(recognize_shape(triangles, 1e-5));
}

}  // namespace
}  // namespace itr
