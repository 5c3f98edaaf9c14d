// SPDX-License-Identifier: MIT
// The barrier that keeps det F above zero in curved cells: its derivatives, what it proves, where it is zero, and when a
// cell gets one.
#include "energy/elastic/jacobian_barrier.hpp"
#include "curved_mesh.hpp"

#include <gtest/gtest.h>

#include <random>

#include "derivatives.hpp"
#include "energy/elastic/elastic.hpp"
#include "fem/cell_set.hpp"
#include "geometry/quadratic_validity.hpp"
#include "random_quadratic.hpp"

namespace itr {
namespace {

template <typename T>
class JacobianBarriers : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(JacobianBarriers, Dimensions);

/// The unit simplex with all edges curved.
template <int Dim>
CellSet<Dim> one_cell() {
  std::vector<Vec<Dim>> rest(Dim + 1, Vec<Dim>::Zero());
  std::array<VertexId, Dim + 1> cell;
  for (int k = 0; k <= Dim; ++k) {
    if (k > 0) rest[k][k - 1] = 1;
    cell[k] = k;
  }
  const Mesh<Dim> mesh(rest, {cell}, {1});
  return whole_mesh(of_orders(mesh, {{1, 2}}), {});
}

template <int Dim>
double mean_jacobian(const QuadraticCell<Dim>& x) {
  double mean = 0;
  for (const auto& point : quadrature<Dim>(Dim)) mean += point.fraction * jacobian_at<Dim>(x, point.weights);
  return mean;
}

template <int Dim>
VectorX flat(const QuadraticCell<Dim>& x) {
  return Eigen::Map<const VectorX>(x.data(), x.size());
}

/// Random positions at which the barrier acts and is finite.
template <int Dim>
QuadraticCell<Dim> distorted(std::mt19937& random, const typename CellSet<Dim>::Element& element) {
  for (;;) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.15);
    const double value = JacobianBarrier<Dim>(element, x).value();
    if (std::isfinite(value) && value > 1e-3) return x;
  }
}

const std::map<int, Material> kMaterials = {{1, {.youngs_modulus = 100, .poisson_ratio = 0.3, .density = 1}}};

TYPED_TEST(JacobianBarriers, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(3);
  for (int i = 0; i < 20; ++i) {
    const QuadraticCell<Dim> positions = distorted<Dim>(random, cells.curved()[0]);
    const double h = 1e-4 * JacobianBarrier<Dim>(cells.curved()[0], positions).least_ratio();
    const ElasticEnergy<Dim> elastic(cells, kMaterials, 0.3);
    expect_derivatives(elastic, flat<Dim>(positions), h, 1e-4);
    expect_psd(elastic, flat<Dim>(positions));
  }
}

TYPED_TEST(JacobianBarriers, ActWhereDetFIsFarBelowItsMeanAndAreFiniteOnlyWhereItIsPositive) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(5);
  int finite = 0, inactive = 0, acting = 0;
  for (int i = 0; i < 20000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.01 * (i % 16));
    const JacobianBarrier<Dim> barrier(cells.curved()[0], x);
    if (!std::isfinite(barrier.value())) continue;
    ++finite;
    ASSERT_TRUE(is_positive_everywhere_exact<Dim>(x));
    const double ratio = min_jacobian_bound<Dim>(x, 1e-3) / mean_jacobian<Dim>(x);
    if (ratio < 0.9 * JacobianBarrier<Dim>::kActive) {
      ++acting;
      EXPECT_GT(barrier.value(), 0);
      EXPECT_TRUE(barrier.is_active());
    } else if (!barrier.is_active()) {
      ++inactive;
      EXPECT_EQ(barrier.value(), 0);
      EXPECT_EQ(barrier.gradient().norm(), 0);
      EXPECT_EQ(barrier.hessian().norm(), 0);
    }
  }
  EXPECT_GT(inactive, finite / 2);
  EXPECT_GT(acting, 50);
  EXPECT_LT(finite, 20000);
}

TYPED_TEST(JacobianBarriers, DoNotFeelTheVolume) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(7);
  for (int i = 0; i < 20; ++i) {
    const QuadraticCell<Dim> x = distorted<Dim>(random, cells.curved()[0]);
    const double value = JacobianBarrier<Dim>(cells.curved()[0], x).value();
    for (const double size : {1e-3, 0.2, 5.0})
      EXPECT_NEAR(JacobianBarrier<Dim>(cells.curved()[0], size * x).value(), value, 1e-9 * value);
  }
}

/// A step that validity alone allows ends where the barrier is infinite, or so steep that no further step is free.
TYPED_TEST(JacobianBarriers, StepsLeaveATenthOfTheLeastCoefficient) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  const ElasticEnergy<Dim> elastic(cells, kMaterials, 1);
  const auto& element = cells.curved()[0];
  std::mt19937 random(9);
  Workspace workspace;
  int shorter = 0;
  for (int i = 0; i < 2000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.1), step = random_motion<Dim>(random, 0.4);
    const double least = std::min(JacobianBarrier<Dim>::kActive, JacobianBarrier<Dim>(element, x).least_ratio());
    if (least == 0) continue;
    const double t = elastic.max_step(flat<Dim>(x), flat<Dim>(step), workspace);
    ASSERT_GT(t, 0);
    EXPECT_GE(JacobianBarrier<Dim>(element, x + t * step).least_ratio(), 0.0999 * least);
    EXPECT_TRUE(std::isfinite(elastic.value(flat<Dim>(x) + t * flat<Dim>(step), workspace)));
    shorter += t < 0.89 * max_positive_step<Dim>(x, step);
  }
  EXPECT_GT(shorter, 2);
}

}  // namespace
}  // namespace itr
