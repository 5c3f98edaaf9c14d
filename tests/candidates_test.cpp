// SPDX-License-Identifier: MIT
// The broad phase of contact: the pairs that it keeps are those of a whole search.
#include <gtest/gtest.h>

#include <random>

#include "core/parallel.hpp"
#include "energy/contact/candidates.hpp"
#include "energy/contact/contact.hpp"
#include "energy/contact/surface.hpp"
#include "itr/solver.hpp"
#include "newton/newton.hpp"

namespace itr {
namespace {

/// Two sheets, one a hand above the other, with so many pairs that trees find them. The lower one is an obstacle if asked.
struct Sheets {
  CollisionSurface surface;
  VectorX x;
  ContactOptions options;
  explicit Sheets(bool is_obstacle, int side = 14) : x(2 * side * side * 3) {
    options.enabled = options.convergent = true;
    options.dhat = 0.3;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> noise(-0.1, 0.1);
    std::vector<Vec<3>> rest;
    std::vector<std::array<int, 3>> triangles;
    std::vector<char> counts(x.size() / 3, 1);
    for (int sheet = 0; sheet < 2; ++sheet)
      for (int i = 0; i < side; ++i)
        for (int j = 0; j < side; ++j) {
          const int v = static_cast<int>(rest.size());
          rest.emplace_back(i, j, sheet);
          if (sheet == 0 && is_obstacle) counts[v] = 0;
          x.segment<3>(3 * v) << i + 0.3 * sheet + noise(random), j + noise(random), 0.35 * sheet + noise(random);
          if (i + 1 == side || j + 1 == side) continue;
          triangles.push_back({v, v + side, v + 1});
          triangles.push_back({v + 1, v + side, v + side + 1});
        }
    surface = make_collision_surface<3>({}, triangles, {}, rest, counts);
  }
};

/// Terms of one surface share a workspace: pairs that were found for a near reach are not those of a farther one.
TEST(Candidates, AreOfTheReachThatTheyWereFoundFor) {
  const Sheets scene(false);
  const auto value_at = [&](double dhat, Workspace& workspace) {
    ContactOptions options = scene.options;
    options.dhat = dhat;
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
      VectorX motion = VectorX::Zero(x.size());
      motion.segment<3>(3 * v) << 3, -2, v < 196 ? 0.5 : -0.5;
      Workspace fresh;
      EXPECT_NEAR(contact.max_step(x, motion, kept), contact.max_step(x, motion, fresh), 1e-12) << "vertex " << v;
      x += motion;
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

constexpr int kLargeSide = 32;  ///< of sheets with 18 million pairs of edges

/// The most pairs of a kind that a workspace holds.
std::size_t pairs_in(Workspace& workspace) {
  const auto& candidates = workspace.get<ContactCandidates<3>>();
  return std::max(candidates.vertex_triangles().size(), candidates.edge_edges().size());
}

/// Motions in which each primitive's swept box meets most others, from near ones to ones of 1e6 times the bodies' size.
class FarMotions : public testing::TestWithParam<double> {
 protected:
  VectorX far_motion(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, GetParam());
    return VectorX::NullaryExpr(scene_.x.size(), [&] { return normal(random); });
  }
  const Sheets scene_{false, kLargeSide};
  const ContactEnergy<3> contact_{scene_.surface, scene_.options, 3, 0.5};
  const std::size_t most_ = ContactCandidates<3>::most_pairs(scene_.surface);
};

TEST_P(FarMotions, HoldFewPairsAndAreFreeAsFarAsTold) {
  const VectorX dx = far_motion(0);
  Workspace workspace;
  const double step = contact_.max_step(scene_.x, dx, workspace);
  EXPECT_LE(pairs_in(workspace), most_);
  ASSERT_GT(step, 0);
  ASSERT_LT(step, 1);
  const VectorX near = std::min(1.0, 4 * step) * dx;  // with few enough pairs at a time
  Workspace fresh;
  EXPECT_NEAR(contact_.max_step(scene_.x, near, fresh) * std::min(1.0, 4 * step), step, 0.05 * step);
  for (int i = 1; i <= 20; ++i)
    EXPECT_FALSE(has_intersection<3>(scene_.surface, scene_.x + i / 20.0 * step * dx)) << "at " << 5 * i << " %";

  BlockingPairs none, first{.takes_first = true};
  EXPECT_FALSE(contact_.find_blocking(scene_.x, dx, std::min(1.0, 4 * step), none, workspace)) << "too many";
  EXPECT_TRUE(none.pairs.empty());
  EXPECT_TRUE(contact_.find_blocking(scene_.x, dx, std::min(1.0, 4 * step), first, workspace));
  EXPECT_LE(pairs_in(workspace), most_);
  EXPECT_FALSE(first.pairs.empty());
  EXPECT_LE(first.pairs.size(), BlockingPairs::kMost);

  VectorX steps(dx.size());
  EXPECT_TRUE(contact_.get_vertex_steps(scene_.x, dx, steps, workspace));
  EXPECT_LE(pairs_in(workspace), most_);
  for (int i = 1; i <= 20; ++i)
    EXPECT_FALSE(has_intersection<3>(scene_.surface, scene_.x + i / 20.0 * steps)) << "at " << 5 * i << " %";
  EXPECT_LE(contact_.step_limit(scene_.x, dx, workspace).step, step * (1 + 1e-12));
}

TEST_P(FarMotions, HaveTheSameBitsForOneAndThreeThreads) {
  const VectorX dx = far_motion(5);
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    Workspace workspace;
    contact_.predict_motion(scene_.x, dx, workspace);
    EXPECT_LE(pairs_in(workspace), most_);
    VectorX result(dx.size() + 1), steps(dx.size());
    result[dx.size()] = contact_.max_step(scene_.x, dx, workspace);
    contact_.get_vertex_steps(scene_.x, dx, steps, workspace);
    result.head(dx.size()) = steps;
    return result;
  };
  EXPECT_TRUE((run(1).array() == run(3).array()).all());
}

INSTANTIATE_TEST_SUITE_P(Lengths, FarMotions, testing::Values(10.0, 1e7));

/// A flight has to remain one step of Newton's method, though its pairs are too many at a time.
TEST(Candidates, OfAFreeFlightAreWalkedThrough) {
  const Sheets scene(false, kLargeSide);
  const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
  const VectorX dx = VectorX::Constant(scene.x.size(), 20);
  Workspace workspace;
  EXPECT_EQ(contact.max_step(scene.x, dx, workspace), 1);
  EXPECT_LE(pairs_in(workspace), ContactCandidates<3>::most_pairs(scene.surface));
  const double far = contact.max_step(scene.x, 1e6 * dx, workspace);
  EXPECT_GT(far, 0);
  EXPECT_LT(far, 1) << "walks have an end";
  const StepLimit limit = contact.step_limit(scene.x, 1e6 * dx, workspace);
  EXPECT_EQ(limit.step, 1) << "no pair limits it";
  EXPECT_TRUE(limit.vertices.empty());
}

/// Where bodies at rest have many pairs, a limit on those of motions must not cut steps to the reach.
TEST(Candidates, OfMotionsMayBeMoreWhereThoseAtRestAreMany) {
  const Sheets scene(false, kLargeSide);
  const VectorX dx = VectorX::Constant(scene.x.size(), 100);
  const double reach = 5;
  ContactCandidates<3> candidates;
  ScratchVector part;
  candidates.update(scene.surface, scene.x, reach);
  ASSERT_GT(candidates.edge_edges().size(), ContactCandidates<3>::most_pairs(scene.surface));
  EXPECT_GT(candidates.update(scene.surface, scene.x, dx, reach, part) * 100, reach);
}

/// Springs that pull each vertex to a place of its own.
struct Springs final : Energy {
  explicit Springs(VectorX places) : places(std::move(places)) {}
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override { return 0.5 * (x - places).squaredNorm(); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override { gradient += x - places; }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<3> identity = Mat<3>::Identity();
    for (int v = 0; v < x.size() / 3; ++v) sink.add<3>(std::array{v}, identity.data());
  }
  VectorX places;
};

TEST(Candidates, OfFarStepsLeadToTheSameMinimum) {
  const Sheets scene(false, kLargeSide);
  VectorX places = scene.x.array() + 50;
  for (int v = 0; v < scene.x.size() / 6; ++v) places[3 * v + 2] -= 2;  // the sheets part
  EnergySum energy;
  energy.add(std::make_shared<Springs>(places));
  energy.add(std::make_shared<ContactEnergy<3>>(scene.surface, scene.options, 3, 0.5));
  VectorX x = scene.x;
  const DofMap dofs = DofMap::from_held(std::vector<char>(x.size(), 0));
  linear::Registry registry;
  const auto solver = registry.create("eigen:llt");
  SparseSystem system(*solver);
  system.reset(dofs, 3, {});
  NewtonOptions options;
  options.gradient_tolerance = 1e-8;
  Workspace workspace;
  const NewtonSummary summary = minimize(energy, x, dofs, VectorX(), system, options, workspace);
  EXPECT_TRUE(summary.converged()) << summary.message;
  EXPECT_LT((x - places).norm(), 1e-6);
  EXPECT_LE(pairs_in(workspace), ContactCandidates<3>::most_pairs(scene.surface));
  EXPECT_FALSE(has_intersection<3>(scene.surface, x));
}

}  // namespace
}  // namespace itr
