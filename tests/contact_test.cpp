// SPDX-License-Identifier: MIT
// Contact, friction and the barrier's stiffness: derivatives, sums by their definitions, steps that are free of contact.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact_scenes.hpp"
#include "core/parallel.hpp"
#include "derivatives.hpp"
#include "energy/contact/friction.hpp"
#include "energy/contact/stiffness.hpp"
#include "energy/contact/surface.hpp"
#include "energy/damping.hpp"
#include "energy/mapped.hpp"

namespace itr {
namespace {

class Contact : public ::testing::TestWithParam<bool> {};

TEST_P(Contact, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const ContactScene scene(seed, GetParam());
    const ContactEnergy<2> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    ASSERT_FALSE(contact.active(scene.x, workspace).empty());
    expect_derivatives(contact, scene.x, 1e-7, 1e-5);
    expect_psd(contact, scene.x);
  }
}

/// Exact predicates on the way that CCD leaves of a random motion; returns its share.
template <int Dim, typename Scene>
double expect_free_step(const Scene& scene, double deviation, unsigned seed) {
  const ContactEnergy<Dim> contact(scene.surface, scene.options, 3, 0.5);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, deviation);
  const VectorX dx = VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
  Workspace workspace;
  const double step = contact.max_step(scene.x, dx, workspace);
  for (int i = 0; i <= 100; ++i) {
    const VectorX x = scene.x + step * i / 100.0 * dx;
    EXPECT_FALSE(has_intersection<Dim>(scene.surface, x)) << "seed " << seed << " at " << i << " %";
    Workspace fresh;
    EXPECT_GT(contact.min_distance(x, fresh), 0) << "seed " << seed;
  }
  return step;
}

TEST_P(Contact, StepIsFreeOfContact) {
  int stopped = 0;
  for (unsigned seed = 0; seed < 20; ++seed) stopped += expect_free_step<2>(ContactScene(seed, GetParam()), 0.3, seed) < 1;
  EXPECT_GT(stopped, 10);
}

INSTANTIATE_TEST_SUITE_P(BothForms, Contact, ::testing::Bool(),
                         [](const auto& info) { return info.param ? "convergent" : "plain"; });

/// A vertex over the middle of a straight line of edges feels it once, wherever the line's vertices are.
TEST(Contact, ConvergentFormCountsOverlappingEdgesOnce) {
  const auto energy_over = [](double corner) {
    const std::vector<Vec<2>> rest = {{0, 0.05}, {-1, 0}, {corner, 0}, {1, 0}};
    CollisionSurface surface = make_collision_surface<2>({{1, 2}, {2, 3}}, {}, std::vector<int>{0}, rest, {1, 0, 0, 0});
    surface.area = {1, 0, 0, 0};  // only the vertex itself carries weight
    ContactOptions options{.enabled = true, .dhat = 0.1, .convergent = true};
    VectorX x(8);
    for (int v = 0; v < 4; ++v) x.segment<2>(2 * v) = rest[v];
    Workspace workspace;
    return ContactEnergy<2>(surface, options, 1, 1).value(x, workspace);
  };
  EXPECT_NEAR(energy_over(0.0), energy_over(0.5), 1e-12 * energy_over(0.5));
}

TEST_P(Contact, DerivativesMatchDifferencesIn3D) {
  int mollified = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const ContactScene3 scene(seed, GetParam(), seed % 2 ? 0.4 : 0, seed % 2 ? 0.03 : 0.003);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    ASSERT_FALSE(contact.active(scene.x, workspace).empty());
    for (const auto& s : contact.active(scene.x, workspace)) mollified += s.is_mollified();
    expect_derivatives(contact, scene.x, 1e-8, 2e-5);
    expect_psd(contact, scene.x);
  }
  EXPECT_GT(mollified, 20);
}

TEST_P(Contact, StepIsFreeOfContactIn3D) {
  for (unsigned seed = 0; seed < 6; ++seed)
    EXPECT_LT(expect_free_step<3>(ContactScene3(seed, GetParam(), 0.2 * seed, 0.02), 0.2, seed), 1);
}

/// Exact predicates on vertex steps; returns how many vertices go further than by the step of all.
template <int Dim, typename Scene>
int expect_free_vertex_steps(const Scene& scene, unsigned seed) {
  const ContactEnergy<Dim> contact(scene.surface, scene.options, 3, 0.5);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.3);
  const VectorX dx = VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
  Workspace workspace;
  const double step = contact.max_step(scene.x, dx, workspace);
  VectorX steps(dx.size());
  EXPECT_TRUE(contact.get_vertex_steps(scene.x, dx, steps, workspace));
  for (int i = 1; i <= 20; ++i) {
    const VectorX x = scene.x + i / 20.0 * steps;
    EXPECT_FALSE(has_intersection<Dim>(scene.surface, x)) << "seed " << seed << " at " << 5 * i << " %";
    Workspace fresh;
    EXPECT_GT(contact.min_distance(x, fresh), 0) << "seed " << seed;
  }
  int further = 0;
  for (const int v : scene.surface.vertices) {
    const double motion = dx.segment<Dim>(Dim * v).norm(), fraction = steps.segment<Dim>(Dim * v).norm() / motion;
    EXPECT_LE((steps.segment<Dim>(Dim * v) - fraction * dx.segment<Dim>(Dim * v)).norm(), 1e-14 * motion);
    EXPECT_LE(fraction, 1 + 1e-14);
    further += fraction > step;
  }
  return further;
}

/// Turns a motion by the bounds of what stops it, each met in turn by the shortest change; returns the shares of it that
/// were free before and are after.
std::array<double, 2> project_by_bounds(const Energy& contact, const VectorX& x, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.1);
  VectorX dx = VectorX::NullaryExpr(x.size(), [&] { return normal(random); });
  Workspace workspace;
  const double before = contact.max_step(x, dx, workspace);
  BlockingPairs blocking;
  for (int round = 0; round < 200; ++round) {
    EXPECT_TRUE(contact.find_blocking(x, dx, 1, blocking, workspace));
    EXPECT_EQ(blocking.bounds.size(), blocking.pairs.size());
    for (const auto& [dofs, coefficients, missing] : blocking.bounds) {
      const auto size = static_cast<Eigen::Index>(dofs.size());
      const VectorX row = Eigen::Map<const VectorX>(coefficients.data(), size);
      dx(Eigen::Map<const Eigen::VectorXi>(dofs.data(), size)) += 0.5 * std::max(0.0, missing) / row.squaredNorm() * row;
    }
  }
  return {before, contact.max_step(x, dx, workspace)};
}

TEST_P(Contact, BoundsOnBlockingPairsFreeTheWay) {
  int blocked = 0, freed = 0;
  const auto count = [&](const std::array<double, 2>& fractions) {
    blocked += fractions[0] < 1;
    freed += fractions[0] < 1 && fractions[1] == 1;
  };
  for (unsigned seed = 0; seed < 20; ++seed) {
    const ContactScene flat(seed, GetParam());
    const ContactScene3 scene(seed, GetParam(), 0.05 * seed, 0.02);
    count(project_by_bounds(ContactEnergy<2>(flat.surface, flat.options, 3, 0.5), flat.x, seed));
    count(project_by_bounds(ContactEnergy<3>(scene.surface, scene.options, 3, 0.5), scene.x, seed));
  }
  EXPECT_GT(blocked, 15);
  EXPECT_GT(freed, 0.8 * blocked);
}

/// A term of energy 0 that lets a step go so far.
struct Limit final : Energy {
  explicit Limit(double step) : step(step) {}
  std::string_view name() const override { return "limit"; }
  double value(ConstVectorView, Workspace&) const override { return 0; }
  void add_gradient(ConstVectorView, VectorView, Workspace&) const override {}
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double max_step(ConstVectorView, ConstVectorView, Workspace&) const override { return step; }
  double step;
};

TEST_P(Contact, SumTellsSingleWaysWhereContactAloneCutsAStep) {
  const ContactScene scene(0, GetParam());
  const auto contact = std::make_shared<ContactEnergy<2>>(scene.surface, scene.options, 3, 0.5);
  const VectorX dx = VectorX::Constant(scene.x.size(), 0.1);
  Workspace workspace;
  VectorX steps(dx.size()), told(dx.size());
  EXPECT_TRUE(contact->get_vertex_steps(scene.x, dx, steps, workspace));
  for (const double step : {1.0, 0.5})
    for (const bool is_first : {false, true}) {
      EnergySum sum;
      if (is_first) sum.add(std::make_shared<Limit>(step));
      sum.add(contact);
      if (!is_first) sum.add(std::make_shared<Limit>(step));
      EXPECT_EQ(sum.get_vertex_steps(scene.x, dx, told, workspace), step == 1);
      if (step == 1) {
        EXPECT_EQ(told, steps);
      }
    }
  EnergySum twice;
  twice.add(contact);
  twice.add(contact);
  EXPECT_FALSE(twice.get_vertex_steps(scene.x, dx, told, workspace));
}

TEST_P(Contact, SingleWaysAreFreeOfContactAndLonger) {
  int further = 0, further_in_3d = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    further += expect_free_vertex_steps<2>(ContactScene(seed, GetParam()), seed);
    further_in_3d += expect_free_vertex_steps<3>(ContactScene3(seed, GetParam(), 0.05 * seed, 0.02), seed);
  }
  EXPECT_GT(further, 100);
  EXPECT_GT(further_in_3d, 100);
}

/// The sum by its definition: every pair of primitives, nothing merged, no tree.
double plain_energy(const ContactScene3& scene, const ContactEnergy<3>& contact) {
  double sum = 0;
  const auto& surface = scene.surface;
  const auto at = [&](int v) { return Vec<3>(scene.x.segment<3>(3 * v)); };
  for (const int v : surface.vertices)
    for (const auto& [a, b, c] : surface.triangles)
      if (v != a && v != b && v != c) sum += contact.barrier(point_triangle_distance_squared(at(v), at(a), at(b), at(c)));
  for (std::size_t e = 0; e < surface.edges.size(); ++e)
    for (std::size_t f = e + 1; f < surface.edges.size(); ++f) {
      const auto [a, b] = surface.edges[e];
      const auto [c, d] = surface.edges[f];
      if (a == c || a == d || b == c || b == d) continue;
      const Vec<3> x[] = {at(a), at(b), at(c), at(d)};
      const double s = edge_cross_squared(x);
      const double eps = 1e-3 * surface.edge_length_squared[e] * surface.edge_length_squared[f];
      const double m = s < eps ? (2 - s / eps) * s / eps : 1;
      sum += m * contact.barrier(edge_edge_distance_squared(x[0], x[1], x[2], x[3]));
    }
  return sum;
}

TEST(Contact3, EnergyIsTheSumOverAllPairs) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const ContactScene3 scene(seed, false, seed % 2 ? 0.3 : 0, seed % 2 ? 0.03 : 0.002);
    const ContactEnergy<3> contact(scene.surface, scene.options, 1, 1);
    Workspace workspace;
    const double expected = plain_energy(scene, contact);
    EXPECT_GT(expected, 0);
    EXPECT_NEAR(contact.value(scene.x, workspace), expected, 1e-12 * expected);
  }
}

/// A vertex over a plane of triangles feels it once, wherever the plane's vertices and edges are.
TEST(Contact3, ConvergentFormCountsOverlappingTrianglesOnce) {
  const auto energy_over = [](double a, double b) {
    const std::vector<Vec<3>> rest = {{0, 0, 0.05}, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {a, b, 0}};
    CollisionSurface surface = make_collision_surface<3>({}, {{1, 2, 5}, {2, 3, 5}, {3, 4, 5}, {4, 1, 5}},
                                                         std::vector<int>{0}, rest, {1, 0, 0, 0, 0, 0});
    surface.area = {1, 0, 0, 0, 0, 0};  // only the vertex itself carries weight
    ContactOptions options{.enabled = true, .dhat = 0.1, .convergent = true};
    VectorX x(18);
    for (int v = 0; v < 6; ++v) x.segment<3>(3 * v) = rest[v];
    Workspace workspace;
    return ContactEnergy<3>(surface, options, 1, 1).value(x, workspace);
  };
  const double inside = energy_over(0.5, 0.1);
  EXPECT_GT(inside, 0);
  EXPECT_NEAR(energy_over(0, 0), inside, 1e-12 * inside) << "over a vertex";
  EXPECT_NEAR(energy_over(0.5, 0.5), inside, 1e-12 * inside) << "over an edge";
  EXPECT_NEAR(energy_over(0.02, 0.01), inside, 1e-12 * inside) << "over a triangle, next to a vertex";
}

TEST(Contact3, ObstaclePointsAndEdgesAreFelt) {
  // A body's triangle over a codimensional edge and a codimensional point.
  const std::vector<Vec<3>> rest = {{0, 0, 0.05}, {1, 0, 0.05}, {0, 1, 0.05}, {0.2, -1, 0}, {0.2, 2, 0}, {0.5, 0.25, 0}};
  VectorX x(18);
  for (int v = 0; v < 6; ++v) x.segment<3>(3 * v) = rest[v];
  const ContactOptions options{.enabled = true, .dhat = 0.1};
  Workspace workspace;
  const CollisionSurface surface =
      make_collision_surface<3>({{3, 4}}, {{0, 1, 2}}, std::vector<int>{3, 4, 5}, rest, {1, 1, 1, 0, 0, 0});
  const ContactEnergy<3> contact(surface, options, 1, 1);
  int by_point = 0, by_edge = 0;
  for (const auto& s : contact.active(x, workspace)) {
    by_point += s.kind == PairKind::face_vertex && s.vertices[0] == 5;
    by_edge += s.kind == PairKind::edge_edge && s.vertices[2] == 3 && s.vertices[3] == 4;
  }
  EXPECT_EQ(by_point, 1);
  EXPECT_GE(by_edge, 1);
}

/// A scene whose vertices y = A x follow from others: each mostly from its own, some also from up to three others.
template <int Dim, typename Scene>
struct MappedScene {
  Scene scene;
  std::shared_ptr<const VertexMap<Dim>> map;
  VectorX x;  ///< where y is the scene's

  MappedScene(Scene s, unsigned seed) : scene(std::move(s)) {
    const int n = static_cast<int>(scene.x.size()) / Dim;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> weight(-0.1, 0.2);
    MatrixX A = MatrixX::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i % 4; ++k) A(i, random() % n) += weight(random);
      A(i, i) += 1 - A.row(i).sum();
    }
    typename VertexMap<Dim>::Weights weights = A.sparseView();
    map = std::make_shared<VertexMap<Dim>>(weights, VectorX::Zero(Dim * n));
    const Eigen::Map<const Eigen::Matrix<double, Dim, Eigen::Dynamic>> y(scene.x.data(), Dim, n);
    const MatrixX solution = A.partialPivLu().solve(MatrixX(y.transpose())).transpose();
    x = Eigen::Map<const VectorX>(solution.data(), Dim * n);
  }
};

/// Derivatives; no net force, and no net moment of contact: weights that sum to one keep rigid motions rigid.
template <int Dim, typename Scene>
void expect_mapped_terms(Scene scene, unsigned seed) {
  scene.options.friction_coefficient = 0.4;
  scene.options.friction_velocity = 0.05;
  const MappedScene<Dim, Scene> mapped(scene, seed);
  const auto of_dofs = [&](auto term) { return MappedEnergy<Dim>(std::move(term), mapped.map); };
  const auto& options = scene.options;
  const auto contact = std::make_shared<ContactEnergy<Dim>>(scene.surface, options, 3, 0.5);
  Workspace workspace;
  const VectorX y = mapped.map->positions(mapped.x);
  EXPECT_LE((y - scene.x).norm(), 1e-12);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 0.001);
  const VectorX reference = y + VectorX::NullaryExpr(y.size(), [&] { return normal(random); });
  const VelocityRule velocity{20, reference};
  const auto friction = std::make_shared<FrictionEnergy<Dim>>(*contact, y, workspace, options, velocity, 0.01);
  ASSERT_FALSE(friction->empty());
  expect_derivatives(of_dofs(contact), mapped.x, 1e-8, 2e-5);
  expect_psd(of_dofs(contact), mapped.x);
  expect_derivatives(of_dofs(friction), mapped.x, 1e-7, 1e-5);
  expect_psd(of_dofs(friction), mapped.x);
  expect_derivatives(of_dofs(std::make_shared<DampingEnergy<Dim>>(*contact, y, 0.1, velocity, workspace)), mapped.x, 1e-6,
                     1e-6);

  bool is_contact = true;
  for (const VectorX& force : {gradient_of(of_dofs(contact), mapped.x), gradient_of(of_dofs(friction), mapped.x)}) {
    Vec<Dim> sum = Vec<Dim>::Zero();
    Mat<Dim> moments = Mat<Dim>::Zero();  // its skew part is the moment
    for (int v = 0; v < force.size() / Dim; ++v) {
      sum += force.segment<Dim>(Dim * v);
      moments += force.segment<Dim>(Dim * v) * mapped.x.template segment<Dim>(Dim * v).transpose();
    }
    EXPECT_LE(sum.norm(), 1e-12 * force.norm());
    if (is_contact) {
      EXPECT_LE((moments - moments.transpose()).norm(), 1e-10 * moments.norm());
    }
    is_contact = false;  // lagged friction acts at lagged points: it keeps the moment up to slip alone
  }
}

TEST(MappedTerms, DerivativesMatchDifferencesAndMomentumIsKept) {
  for (unsigned seed = 0; seed < 6; ++seed) expect_mapped_terms<2>(ContactScene(seed, seed % 2), seed);
  for (unsigned seed = 0; seed < 3; ++seed) expect_mapped_terms<3>(ContactScene3(seed, seed % 2, 0.4, 0.03), seed);
}

TEST(MappedTerms, BoundsOnBlockingPairsFreeTheWay) {
  int blocked = 0, freed = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const MappedScene<2, ContactScene> mapped(ContactScene(seed, true), seed);
    const auto contact = std::make_shared<ContactEnergy<2>>(mapped.scene.surface, mapped.scene.options, 3, 0.5);
    const auto [before, after] = project_by_bounds(MappedEnergy<2>(contact, mapped.map), mapped.x, seed);
    blocked += before < 1;
    freed += before < 1 && after == 1;
  }
  EXPECT_GT(blocked, 10);
  EXPECT_GT(freed, 0.8 * blocked);
}

TEST(MappedTerms, StepIsFreeOfContactOfWhatIsMapped) {
  int stopped = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    const MappedScene<2, ContactScene> mapped(ContactScene(seed, true), seed);
    const auto& scene = mapped.scene;
    const MappedEnergy<2> contact(std::make_shared<ContactEnergy<2>>(scene.surface, scene.options, 3, 0.5), mapped.map);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 0.3);
    const VectorX dx = VectorX::NullaryExpr(mapped.x.size(), [&] { return normal(random); });
    Workspace workspace;
    const double step = contact.max_step(mapped.x, dx, workspace);
    stopped += step < 1;
    for (int i = 0; i <= 100; ++i)
      EXPECT_FALSE(has_intersection<2>(scene.surface, mapped.map->positions(mapped.x + step * i / 100.0 * dx)));
  }
  EXPECT_GT(stopped, 5);
}

TEST(AdaptiveStiffness, BalancesTheBarrierAsTheDofsFeelIt) {
  const MappedScene<3, ContactScene3> mapped(ContactScene3(3, false, 0.3, 0.02), 1);
  const auto& scene = mapped.scene;
  const auto contact = std::make_shared<ContactEnergy<3>>(scene.surface, scene.options, 1, 1);
  const VectorX y = mapped.map->positions(mapped.x), barrier = gradient_of(MappedEnergy<3>(contact, mapped.map), mapped.x);
  const AdaptiveStiffness<3> adaptive(scene.surface, scene.options, 2, 1, mapped.map.get());
  Workspace workspace;
  BarrierStiffness stiffness;
  adaptive.initialize(y, barrier, stiffness, workspace);  // pulls the same way: the least
  const double least = stiffness.value;
  adaptive.initialize(y, -7 * least * barrier, stiffness, workspace);
  EXPECT_NEAR(stiffness.value, 7 * least, 1e-10 * least);
}

/// Search trees are kept: they must not show.
TEST(Contact3, HasTheBitsOfAFreshWorkspaceInAnUsedOne) {
  std::srand(1);
  for (unsigned seed = 0; seed < 10; ++seed) {
    const ContactScene3 scene(seed, true, 0.1, 0.02, 8);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    const VectorX elsewhere = VectorX::Random(scene.x.size()), dx = 0.3 * VectorX::Random(scene.x.size());
    const auto run = [&](Workspace& workspace) {
      contact.predict_motion(scene.x, dx, workspace);
      VectorX result(scene.x.size() + 3);
      VectorX gradient = VectorX::Zero(scene.x.size());
      contact.add_gradient(scene.x, gradient, workspace);
      result << gradient, contact.value(scene.x, workspace), contact.max_step(scene.x, dx, workspace),
          contact.min_distance(scene.x, workspace);
      return result;
    };
    Workspace fresh, used;
    contact.predict_motion(elsewhere, dx, used);
    EXPECT_TRUE((run(fresh).array() == run(used).array()).all()) << "seed " << seed;
  }
}

TEST(Contact3, HasTheSameBitsForOneAndTwoThreads) {
  const ContactScene3 scene(3, true, 0.3, 0.02, 8);
  const VectorX dx = 0.3 * VectorX::Random(scene.x.size());
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    VectorX result(scene.x.size() + 2);
    result << gradient_of(contact, scene.x), contact.value(scene.x, workspace), contact.max_step(scene.x, dx, workspace);
    return result;
  };
  EXPECT_TRUE((run(1).array() == run(2).array()).all());
}

TEST(AdaptiveStiffness, BalancesTheBarrierAndStaysInItsBounds) {
  const ContactScene3 scene(3, false, 0.3, 0.02);
  Workspace workspace;
  const ContactEnergy<3> contact(scene.surface, scene.options, 1, 1);
  const VectorX barrier = gradient_of(contact, scene.x);
  const double mass = 2, scale = 0.25, Dhat = 0.04;
  const AdaptiveStiffness<3> adaptive(scene.surface, scene.options, mass, scale);
  Vec<3> low = scene.x.head<3>(), high = low;
  for (Eigen::Index i = 0; i < scene.x.size(); i += 3) {
    low = low.cwiseMin(scene.x.segment<3>(i));
    high = high.cwiseMax(scene.x.segment<3>(i));
  }
  const double d0 = std::pow(1e-8 * (high - low).norm(), 2), r = Dhat / d0;
  const double least = 1e11 * mass / (4 * d0 * ((r + 2) * r - 2 * std::log(d0 / Dhat) - 3));
  BarrierStiffness stiffness;
  adaptive.initialize(scene.x, -7 * least * barrier, stiffness, workspace);
  EXPECT_NEAR(stiffness.value * scale, 7 * least, 1e-10 * least);
  EXPECT_NEAR(stiffness.largest * scale, 100 * least, 1e-10 * least);
  adaptive.initialize(scene.x, barrier, stiffness, workspace);  // pulls the same way as the barrier
  EXPECT_NEAR(stiffness.value * scale, least, 1e-10 * least);
  adaptive.initialize(scene.x, -1e9 * least * barrier, stiffness, workspace);
  EXPECT_NEAR(stiffness.value * scale, 100 * least, 1e-8 * least);

  // In the convergent form the force at x is that of the plain one: the energies are made equal there.
  auto options = scene.options;
  options.convergent = true;
  const ContactEnergy<3> convergent(scene.surface, options, 1, 1);
  BarrierStiffness other;
  AdaptiveStiffness<3>(scene.surface, options, mass, scale).initialize(scene.x, -7 * least * barrier, other, workspace);
  EXPECT_NEAR(other.value * convergent.value(scene.x, workspace) * scale, 7 * least * contact.value(scene.x, workspace),
              1e-10 * least * contact.value(scene.x, workspace));
}

TEST(AdaptiveStiffness, DoublesWhileTinyGapsClose) {
  const std::vector<Vec<2>> rest = {{0, 1}, {-1, 0}, {1, 0}};
  const CollisionSurface surface = make_collision_surface<2>({{1, 2}}, {}, std::vector<int>{0}, rest, {1, 0, 0});
  const ContactOptions options{.enabled = true, .dhat = 0.1};
  const AdaptiveStiffness<2> adaptive(surface, options, 1, 1);
  Workspace workspace;
  BarrierStiffness stiffness{.value = 1, .largest = 3};
  const auto update = [&](double gap) {
    VectorX x(6);
    x << 0, gap, -1, 0, 1, 0;
    return adaptive.update(x, stiffness, workspace);
  };
  EXPECT_FALSE(update(1e-3));
  EXPECT_FALSE(update(1.5e-9));  // small now, but was large before
  EXPECT_TRUE(update(1e-9));
  EXPECT_EQ(stiffness.value, 2);
  EXPECT_FALSE(update(1.2e-9));  // opening
  EXPECT_TRUE(update(1e-9));
  EXPECT_EQ(stiffness.value, 3);  // the largest
  EXPECT_FALSE(update(0.5e-9));
}

}  // namespace
}  // namespace itr
