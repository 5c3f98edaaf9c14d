// SPDX-License-Identifier: MIT
// The broad phase of contact: the pairs that it keeps are those of a whole search.
#include <gtest/gtest.h>

#include <random>

#include "itr/energy/contact/contact.hpp"
#include "itr/energy/contact/surface.hpp"

namespace itr {
namespace {

/// Two sheets, one a hand above the other, with so many pairs that trees find them. The lower one is an obstacle if asked.
struct Sheets {
  static constexpr int kSide = 14;
  CollisionSurface surface;
  VectorX x{2 * kSide * kSide * 3};
  ContactOptions options;
  explicit Sheets(bool is_obstacle) {
    options.enabled = options.convergent = true;
    options.activation_distance = 0.3;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> noise(-0.1, 0.1);
    std::vector<Vec<3>> rest;
    std::vector<std::array<int, 3>> triangles;
    std::vector<char> counts(x.size() / 3, 1);
    for (int sheet = 0; sheet < 2; ++sheet)
      for (int i = 0; i < kSide; ++i)
        for (int j = 0; j < kSide; ++j) {
          const int v = static_cast<int>(rest.size());
          rest.emplace_back(i, j, sheet);
          if (sheet == 0 && is_obstacle) counts[v] = 0;
          x.segment<3>(3 * v) << i + 0.3 * sheet + noise(random), j + noise(random), 0.35 * sheet + noise(random);
          if (i + 1 == kSide || j + 1 == kSide) continue;
          triangles.push_back({v, v + kSide, v + 1});
          triangles.push_back({v + 1, v + kSide, v + kSide + 1});
        }
    surface = make_collision_surface<3>({}, triangles, {}, rest, counts);
  }
};

/// Terms of one surface share a workspace: pairs that were found for a near reach are not those of a farther one.
TEST(Candidates, AreOfTheReachThatTheyWereFoundFor) {
  const Sheets scene(false);
  const auto value_at = [&](double dhat, Workspace& workspace) {
    ContactOptions options = scene.options;
    options.activation_distance = dhat;
    return ContactEnergy<3>(scene.surface, options, 3, 0.5).value(scene.x, workspace);
  };
  Workspace fresh, shared;
  const double expected = value_at(0.4, fresh);
  ASSERT_LT(value_at(0.02, shared), expected);
  EXPECT_EQ(value_at(0.4, shared), expected);
}

TEST(Candidates, OfVerticesThatLeaveTheirBoxesAreThoseOfAWholeSearch) {
  for (const bool is_obstacle : {false, true}) {
    const Sheets scene(is_obstacle);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace kept;
    VectorX x = scene.x;
    ASSERT_GT(contact.active(x, kept).size(), 20u);
    for (const int v : {17, 250, 251, 130, 17, 300}) {  // each goes three cells further, through the other sheet
      VectorX way = VectorX::Zero(x.size());
      way.segment<3>(3 * v) << 3, -2, v < 196 ? 0.5 : -0.5;
      Workspace fresh;
      EXPECT_NEAR(contact.max_step(x, way, kept), contact.max_step(x, way, fresh), 1e-12) << "vertex " << v;
      x += way;
      Workspace another;
      const auto& expected = contact.active(x, another);
      const auto& found = contact.active(x, kept);
      ASSERT_EQ(found.size(), expected.size()) << "vertex " << v;
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].vertices, expected[i].vertices) << "vertex " << v;
        EXPECT_EQ(found[i].weight, expected[i].weight) << "vertex " << v;
      }
    }
  }
}

}  // namespace
}  // namespace itr
