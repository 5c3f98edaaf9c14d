// SPDX-License-Identifier: MIT
// A million random operations on tetrahedral meshes, with the whole mesh checked after each block.
#include <gtest/gtest.h>

#include "random_tets.hpp"

namespace itr {
namespace {

TEST(Edits3D, KeepAllInvariantsThroughAMillionOperations) {
  constexpr int kOperations = 1000000, kMeshes = 20, kBlock = 5000;
  long done = 0, tried = 0;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = random_tets(3 + static_cast<int>(seed) % 3, random, seed % 2);
    Strata<3> strata(mesh);
    const Invariants before(mesh, strata);
    const double worst = worst_cell(mesh);
    const int size = 3 * mesh.num_cells();
    for (int i = 1; i <= kOperations / kMeshes;) {
      // The less, the more cells there are, of what makes more of them.
      const bool may_split = random() % size > static_cast<unsigned>(mesh.num_cells());
      const auto operation = static_cast<Operation>(may_split ? random() % 5 : 1 + random() % 4);
      ++tried;
      const auto proposal = propose_at_random(mesh, strata, operation, random);
      if (!proposal) continue;
      apply(mesh, strata, *proposal.edit);
      ++done;
      if (i++ % kBlock) continue;
      ASSERT_EQ(mesh.find_defect(), "") << seed << ", after " << i;
      ASSERT_EQ(strata.find_defect(mesh), "") << seed << ", after " << i;
      strata.compact(mesh.compact());
      ASSERT_EQ(mesh.find_defect(), "") << seed << ", after " << i;
      ASSERT_EQ(Invariants(mesh, strata).difference(before, 1e-11), "") << seed << ", after " << i;
      ASSERT_GE(worst_cell(mesh), std::min(worst, kSplitRule.floor));
      ASSERT_LT(mesh.num_cells(), 2 * size);
    }
  }
  EXPECT_EQ(done, kOperations);
  RecordProperty("tried", static_cast<int>(tried));
}

}  // namespace
}  // namespace itr
