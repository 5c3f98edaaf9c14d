// SPDX-License-Identifier: MIT
// A million quadratic cells and a million steps in each dimension, many of them near degenerate: what floating point says of
// validity against exact arithmetic.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "core/parallel.hpp"
#include "random_quadratic.hpp"

namespace itr {
namespace {

struct Counts {
  long cells = 0, proven = 0, false_alarms = 0, wrong = 0;  ///< wrong: proven in floating point, not so in exact arithmetic
  long steps = 0, cut = 0, early = 0;                       ///< early: a tenth farther is valid too
  long invalid = 0;                                         ///< states on the way of a step that are not valid
  void operator+=(const Counts& other) {
    cells += other.cells, proven += other.proven, false_alarms += other.false_alarms, wrong += other.wrong;
    steps += other.steps, cut += other.cut, early += other.early, invalid += other.invalid;
  }
};

template <int Dim>
void compare(const QuadraticCell<Dim>& x, Counts& counts) {
  const bool is_proven = is_positive_everywhere<Dim>(x), is_valid = is_positive_everywhere_exact<Dim>(x);
  ++counts.cells;
  counts.proven += is_proven;
  counts.wrong += is_proven && !is_valid;
  counts.false_alarms += is_valid && !is_proven;
}

/// Random cells, their steps, and the cells at which a step ends: as near to degenerate as 1e-12 of the step.
template <int Dim>
Counts run_block(unsigned seed, int steps) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> exponent(-12, -1), place(0, 1);
  Counts counts;
  for (int i = 0; i < steps; ++i) {
    const QuadraticCell<Dim> x = unit_cell<Dim>() + random_motion<Dim>(random, 0.01 * (1 + i % 12));
    if (counts.cells < steps / 2) compare<Dim>(x, counts);
    if (!is_positive_everywhere<Dim>(x)) continue;
    const QuadraticCell<Dim> dx = random_motion<Dim>(random, 0.1 * (1 + i % 10));
    const double t = max_positive_step<Dim>(x, dx);
    ++counts.steps;
    counts.invalid += !is_positive_everywhere_exact<Dim>(x + t * place(random) * dx);
    counts.invalid += !is_positive_everywhere_exact<Dim>(x + t * dx);
    if (t == 1) continue;
    ++counts.cut;
    counts.early += is_positive_everywhere_exact<Dim>(x + std::min(1.0, 1.1 * t) * dx);
    compare<Dim>(x + t * (1 + (i % 2 ? 1 : -1) * std::pow(10, exponent(random))) * dx, counts);
  }
  return counts;
}

template <int Dim>
void run() {
  constexpr long kMany = 1000000;
  constexpr int kBlock = 4000, kBlocks = 64;
  Counts sum;
  for (unsigned first = 0; sum.cells < kMany || sum.steps < kMany; first += kBlocks) {
    std::vector<Counts> blocks(kBlocks);
    parallel_blocks(kBlocks, 1, [&](std::size_t b, std::size_t) {
      blocks[b] = run_block<Dim>(first + static_cast<unsigned>(b), kBlock);
    });
    for (const Counts& counts : blocks) sum += counts;
  }
  std::cout << Dim << "D: " << sum.cells << " cells, " << sum.proven << " proven valid, " << sum.false_alarms
            << " false alarms; " << sum.steps << " steps, " << sum.cut << " cut, " << sum.early
            << " of these by a tenth early\n";
  EXPECT_EQ(sum.wrong, 0);
  EXPECT_EQ(sum.invalid, 0);
  EXPECT_LT(sum.false_alarms, sum.cells / 100);
  EXPECT_LT(sum.early, sum.cut / 20);
}

TEST(QuadraticValidity, OfAMillionTrianglesIsNeverClaimedFalsely) { run<2>(); }
TEST(QuadraticValidity, OfAMillionTetrahedraIsNeverClaimedFalsely) { run<3>(); }

}  // namespace
}  // namespace itr
