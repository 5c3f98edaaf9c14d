// SPDX-License-Identifier: MIT
// Decisions about edits use their memory again: a warm bound or trial asks for none. Counted in malloc itself, which
// operator new and Eigen come down to.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "random_mesh.hpp"
#include "random_tets.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/decide/trial.hpp"
#include "remesh/edits.hpp"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ITR_COUNTS_ALLOCATIONS 1
#else
#define ITR_COUNTS_ALLOCATIONS 0
#endif

namespace {
thread_local long allocations = 0;
}

#if ITR_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* realloc(void* old, std::size_t size) {
  ++allocations;
  return __libc_realloc(old, size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
}
#endif

namespace itr {
namespace {

Mesh<2> make_mesh(std::mt19937& random, Mesh<2>*) { return random_mesh(8, random); }
Mesh<3> make_mesh(std::mt19937& random, Mesh<3>*) { return random_tets(3, random, false); }

/// A body with inertia and weight, partly held and a little out of shape.
template <int Dim>
struct Body {
  std::mt19937 random{3};
  Mesh<Dim> mesh = make_mesh(random, static_cast<Mesh<Dim>*>(nullptr));
  RemeshFields<Dim> fields;
  StepContext<Dim> context;
  Body() {
    for (const int body : {1, 2, 3}) context.materials[body] = {.youngs_modulus = 1000, .poisson_ratio = 0.3, .density = 2};
    context.scaling = 0.01;
    context.newton.step_tolerance = 1e-9;
    context.newton.norm = NewtonNorm::l2;
    context.shortest_edge = 0.1;
    context.loads.acceleration = [](const Vec<Dim>&) { return Vec<Dim>(-5 * Vec<Dim>::Unit(Dim - 1)); };
    context.held_components[1].fill(true);
    std::uniform_real_distribution<double> noise(-0.005, 0.005);
    fields.x.resize(Dim * mesh.node_slots());
    for (int v = 0; v < mesh.node_slots(); ++v)
      for (int c = 0; c < Dim; ++c) fields.x[Dim * v + c] = mesh.rest(v)[c] + noise(random);
    fields.predictor = fields.x;
    for (double& x : fields.predictor) x += noise(random);
  }
};

template <typename T>
class WarmTrial : public ::testing::Test {
 protected:
  static constexpr int kDim = T::value;
  Body<kDim> body_;

  /// Decides about the edits twice, and counts the second time. At least `touching` verdicts are about what touches.
  void expect_no_allocation(const std::vector<Edit<kDim>>& edits, HistoryRule history, int touching = 0) {
    if (!ITR_COUNTS_ALLOCATIONS) GTEST_SKIP() << "malloc cannot be counted here";
    ASSERT_GT(edits.size(), 10u);
    const Gate<kDim> gate(body_.mesh, body_.fields, body_.context);
    const RemeshState<kDim> state{body_.mesh, body_.fields, body_.context, gate.present(), history};
    LocalScratch<kDim> scratch;
    Verdict<kDim> verdict;
    int accepted = 0, bounded = 0, relaxed = 0, in_contact = 0;
    const auto decide_all = [&] {
      double sum = 0;
      for (const auto& edit : edits) {
        sum += predict_gain<kDim>(state, edit) + gain_of_vertex<kDim>(state, edit, scratch);
        // Always enough; never, as the vertex alone tells; never, as a patch tells.
        for (const auto& [required, patch_over_vertex] : {std::pair{-1e9, 2.0}, {1e9, 2.0}, {1e9, 0.0}}) {
          preview<kDim>(state, gate, edit, {.required = required, .patch_over_vertex = patch_over_vertex, .local = {}},
                        scratch, verdict);
          sum += verdict.gain;
          accepted += verdict.accepted();
          bounded += verdict.refusal == Refusal::bound;
          relaxed += verdict.was_relaxed;
          in_contact += verdict.touches_contact;
        }
      }
      return sum;
    };
    const double cold = decide_all();
    const long before = allocations;
    const double warm = decide_all();
    EXPECT_EQ(allocations - before, 0);
    EXPECT_EQ(warm, cold);
    EXPECT_GT(before, 0);
    EXPECT_GT(accepted, 10);
    EXPECT_GT(bounded, 10);
    EXPECT_GT(relaxed, 10);
    EXPECT_GE(in_contact, touching);
  }

  /// Edges near the side that is pressed onto a plane, where one is.
  std::vector<EdgeKey> edges() const {
    auto found = body_.mesh.edges();
    const auto is_near = [&](int v) { return body_.mesh.rest(v)[kDim - 1] < 0.3; };
    if (!body_.context.obstacles.rest.empty())
      std::erase_if(found, [&](const EdgeKey& e) { return !is_near(e[0]) || !is_near(e[1]); });
    return found;
  }
  std::vector<Edit<kDim>> splits() const {
    std::vector<Edit<kDim>> edits;
    for (const EdgeKey& edge : edges()) edits.push_back(make_split(body_.mesh, edge));
    return edits;
  }
  std::vector<Edit<kDim>> collapses() const {
    std::vector<Edit<kDim>> edits;
    for (const EdgeKey& edge : edges())
      if (auto edit = propose_collapse(body_.mesh, Strata<kDim>(body_.mesh), edge).edit) edits.push_back(*edit);
    return edits;
  }

  /// Presses a side of the body onto a plane, with friction.
  void press_onto_plane() {
    constexpr double kDhat = 0.05;
    auto& context = body_.context;
    context.contact = {.enabled = true, .dhat = kDhat, .convergent = true, .barrier_stiffness = 1e4};
    context.contact.friction_coefficient = 0.3;
    context.contact.friction_velocity = 1e-3;
    body_.fields.velocity_reference = body_.fields.predictor;
    auto& obstacles = context.obstacles;
    if constexpr (kDim == 2) {
      obstacles.rest = {{-9, -0.3 * kDhat}, {9, -0.3 * kDhat}};
      obstacles.edges = {{0, 1}};
    } else {
      obstacles.rest = {{-9, -9, -0.3 * kDhat}, {9, -9, -0.3 * kDhat}, {0, 9, -0.3 * kDhat}};
      obstacles.triangles = {{0, 1, 2}};
      obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
    }
    obstacles.x = obstacles.velocity_reference = obstacles.rest;
  }
};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(WarmTrial, Dimensions);

TYPED_TEST(WarmTrial, OfASplitAllocatesNothing) {
  this->expect_no_allocation(this->splits(), HistoryRule::function);
  this->body_.context.contact = {.enabled = true, .dhat = 0.01, .convergent = true};  // nothing is that near
  this->expect_no_allocation(this->splits(), HistoryRule::function);
}

TYPED_TEST(WarmTrial, OfACollapseThatForgetsNothingAllocatesNothing) {
  this->expect_no_allocation(this->collapses(), HistoryRule::interpolated);
}

TYPED_TEST(WarmTrial, InContactAllocatesNothing) {
  this->press_onto_plane();
  for (const bool convergent : {true, false}) {
    this->body_.context.contact.convergent = convergent;
    this->expect_no_allocation(this->splits(), HistoryRule::function, 30);
    this->expect_no_allocation(this->collapses(), HistoryRule::interpolated, 30);
  }
}

}  // namespace
}  // namespace itr
