// SPDX-License-Identifier: MIT
// The barrier that keeps det F above zero in curved cells: its derivatives, what it proves, where it is zero, and when a
// cell gets one.
#include "energy/elastic/jacobian_barrier.hpp"

#include <gtest/gtest.h>

#include <random>

#include "derivatives.hpp"
#include "itr/energy/elastic/elastic.hpp"
#include "itr/fem/cell_set.hpp"
#include "itr/geometry/quadratic_validity.hpp"
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
  return whole_mesh(mesh, {}, space_of_orders(mesh, {{1, 2}}));
}

template <int Dim>
VectorX flat(const QuadraticCell<Dim>& x) {
  return Eigen::Map<const VectorX>(x.data(), x.size());
}

/// Random positions at which the barrier acts and is finite.
template <int Dim>
QuadraticCell<Dim> positions_at(std::mt19937& random, const typename CellSet<Dim>::CurvedElement& element, int depth) {
  for (;;) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.12);
    const double value = JacobianBarrier<Dim>(element, x, depth).value();
    if (std::isfinite(value) && value > 1e-3 && value < 2) return x;
  }
}

const std::map<int, Material> kMaterials = {{1, {.youngs_modulus = 100, .poisson_ratio = 0.3, .density = 1}}};

TYPED_TEST(JacobianBarriers, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(3);
  for (int depth = 1; depth <= kMostBarrierDepth; ++depth)
    for (int i = 0; i < 5; ++i) {
      const VectorX x = flat<Dim>(positions_at<Dim>(random, cells.curved_elements[0], depth));
      ElasticEnergy<Dim> elastic(cells, kMaterials, 0.3);
      elastic.set_quadrature_levels({static_cast<std::uint8_t>(kBarrierLevel * depth + i % kBarrierLevel)});
      expect_derivatives(elastic, x, 1e-7, 1e-4);
      expect_psd(elastic, x);
    }
}

TYPED_TEST(JacobianBarriers, AreFiniteOnlyWhereDetFIsProvenPositive) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(5);
  int finite = 0;
  for (int i = 0; i < 3000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.01 * (i % 16));
    for (int depth = 1; depth <= 2; ++depth) {
      const double value = JacobianBarrier<Dim>(cells.curved_elements[0], x, depth).value();
      if (!std::isfinite(value)) continue;
      ++finite;
      EXPECT_TRUE(is_positive_everywhere_exact<Dim>(x));
    }
  }
  EXPECT_GT(finite, 1000);
  EXPECT_LT(finite, 6000);
}

TYPED_TEST(JacobianBarriers, AreZeroWhereDetFVariesLittleAtAnyVolume) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(7);
  for (const double size : {1e-3, 0.2, 1.0, 5.0}) {
    const QuadraticCell<Dim> x = size * (unit_cell<Dim>() + random_motion<Dim>(random, 0.01));
    const JacobianBarrier<Dim> barrier(cells.curved_elements[0], x, 1);
    EXPECT_EQ(barrier.value(), 0);
    EXPECT_EQ(barrier.gradient().norm(), 0);
    EXPECT_EQ(barrier.hessian().norm(), 0);
  }
}

/// A cell gets a barrier where det F is somewhere less than a twentieth of its mean, and another one where the one that it
/// has is infinite.
TYPED_TEST(JacobianBarriers, ComeWhereDetFIsFarBelowItsMean) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = one_cell<Dim>();
  std::mt19937 random(9);
  int with_barrier = 0, without = 0, deeper = 0;
  for (int i = 0; i < 20000; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.15);
    if (!is_positive_everywhere<Dim>(x)) continue;
    const JacobianBarrier<Dim> whole(cells.curved_elements[0], x, 1);
    const double ratio = min_jacobian_bound<Dim>(x, 1e-3) / whole.mean();
    if (ratio < 1e-3) continue;
    ElasticEnergy<Dim> elastic(cells, kMaterials, 1);
    int rounds = 0;
    while (elastic.refine_quadrature(flat<Dim>(x))) ASSERT_LE(++rounds, kMostClosedLevel + 1);
    const QuadratureLevels levels = elastic.quadrature_levels();
    const int depth = levels.empty() ? 0 : barrier_depth(levels[0]);
    if (ratio > 1.2 * JacobianBarrier<Dim>::kActive) {
      EXPECT_EQ(depth, 0);
      ++without;
    }
    if (ratio > 0.9 * JacobianBarrier<Dim>::kActive || depth == 0) continue;
    ++with_barrier;
    Workspace workspace;
    EXPECT_TRUE(std::isfinite(elastic.value(flat<Dim>(x), workspace)));
    if (std::isfinite(whole.value())) continue;
    ++deeper;
    EXPECT_GT(depth, 1);
    elastic.set_quadrature_levels({static_cast<std::uint8_t>(kMostClosedLevel + kBarrierLevel)});
    EXPECT_TRUE(elastic.refine_quadrature(flat<Dim>(x)));
    EXPECT_EQ(barrier_depth(elastic.quadrature_levels()[0]), depth);
  }
  EXPECT_GT(with_barrier, 20);
  EXPECT_GT(deeper, 3);
  EXPECT_GT(without, 100);
}

}  // namespace
}  // namespace itr
