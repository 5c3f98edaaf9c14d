// SPDX-License-Identifier: MIT
// Friction by pair with two coefficients, along a direction and across it.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>
#include <random>

#include "advance.hpp"
#include "block.hpp"
#include "contact_scenes.hpp"
#include "derivatives.hpp"
#include "energy/contact/friction.hpp"
#include "scene_folder.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

using Frame = FrictionAcross::Frame;
constexpr double kSpeed = 0.05;  ///< eps_v [m/s]
constexpr double kRate = 20;     ///< [1/s]

/// The upper sheet is side a of a pair, the lower one side b.
void add_pair(ContactScene3& scene, double along, double across, double ratio, Frame frame = Frame::space) {
  FrictionPair pair{.a = {.bodies = {1}}, .b = {.bodies = {2}}, .statics = along, .kinetic = ratio * along};
  pair.across = {.statics = across, .kinetic = ratio * across, .direction = Vec<3>(2, 1, 0.3).normalized(), .frame = frame};
  scene.options.friction_pairs = {pair};
  scene.options.friction_velocity = kSpeed;
  const std::size_t n = scene.surface.area.size();
  scene.surface.friction_sides.clear();
  for (std::size_t v = 0; v < n; ++v) scene.surface.friction_sides.push_back(v < n / 2 ? 2 : 1);
  scene.surface.rest = scene.x;
}

FrictionEnergy<3> friction_of(const ContactScene3& scene, const VectorX& reference) {
  const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
  Workspace workspace;
  return FrictionEnergy<3>(contact, scene.x, workspace, scene.options, {kRate, reference}, 0.01);
}
VectorX scattered(const VectorX& x, double speed, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, speed / kRate);
  return x + VectorX::NullaryExpr(x.size(), [&] { return normal(random); });
}

void expect_psd_beside(double most, const Energy& energy, const VectorX& x) {
  const MatrixX hessian = hessian_of(energy, x, PsdProjection::clamp);
  EXPECT_GE(Eigen::SelfAdjointEigenSolver<MatrixX>(hessian).eigenvalues()[0], -1e-12 * most);
}

TEST(FrictionDirections, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 2; ++seed)
    for (const double across : {0.15, 0.0})
      for (const double ratio : {1.0, 0.4, 0.0}) {
        ContactScene3 scene(seed, seed % 2, 0.4, 0.03);
        add_pair(scene, 0.6, across, ratio);
        const double most =
            hessian_of(friction_of(scene, scattered(scene.x, 1e-3 * kSpeed, seed)), scene.x, PsdProjection::none).norm();
        for (const double speed : {0.1 * kSpeed, 0.5 * kSpeed, 2.5 * kSpeed}) {
          FrictionEnergy<3> friction = friction_of(scene, scattered(scene.x, speed, seed));
          ASSERT_FALSE(friction.empty());
          if (hessian_of(friction, scene.x, PsdProjection::none).norm() > 1e-6 * most)  // else nothing resists any more
            expect_derivatives(friction, scene.x, 1e-8, 1e-4);
          expect_psd_beside(most, friction, scene.x);
          friction.begin_solve(scene.x, true);
          expect_psd_beside(most, friction, scene.x);
          friction.follow(scattered(scene.x, speed, seed + 9), 0.5);
          expect_psd_beside(most, friction, scene.x);
          EXPECT_TRUE(hessian_of(friction, scene.x, PsdProjection::clamp).allFinite());
        }
      }
}

TEST(FrictionDirections, AreNoneWhereBothCoefficientsAreTheSame) {
  ContactScene3 scene(1, false, 0.4, 0.03), plain = scene;
  add_pair(scene, 0.4, 0.4, 0.5);
  add_pair(plain, 0.4, 0.4, 0.5);
  plain.options.friction_pairs[0].across.reset();
  const VectorX reference = scattered(scene.x, kSpeed, 3);
  EXPECT_EQ(gradient_of(friction_of(scene, reference), scene.x), gradient_of(friction_of(plain, reference), scene.x));
}

/// A small triangle over a large one, so that all normals are upright.
ContactScene3 flat_scene() {
  ContactScene3 scene(0, false, 0, 0);
  const std::vector<Vec<3>> rest = {{-9, -9, 0}, {9, -9, 0}, {0, 9, 0}, {0, 0, 0.12}, {0.4, 0, 0.12}, {0.1, 0.3, 0.12}};
  scene.surface = make_collision_surface<3>({}, {{0, 1, 2}, {3, 4, 5}}, {}, rest, std::vector<char>(6, 1));
  scene.x.resize(18);
  for (int v = 0; v < 6; ++v) scene.x.segment<3>(3 * v) = rest[v];
  return scene;
}

/// Force of friction on the upper one of two flat sheets that slides at `velocity`, by the normal force.
Vec<3> force_on_upper(const ContactScene3& scene, const Vec<3>& velocity) {
  VectorX reference = scene.x;
  const Eigen::Index half = reference.size() / 2;
  for (Eigen::Index i = half; i < reference.size(); i += 3) reference.segment<3>(i) -= velocity / kRate;
  const auto force = [&](const ContactScene3& of) {
    const VectorX gradient = gradient_of(friction_of(of, reference), of.x);
    Vec<3> sum = Vec<3>::Zero();
    for (Eigen::Index i = half; i < gradient.size(); i += 3) sum -= gradient.segment<3>(i);
    return sum;
  };
  ContactScene3 plain = scene;
  plain.options.friction_pairs.clear();
  plain.options.friction_coefficient = 1;
  return force(scene) / force(plain).norm();
}

TEST(FrictionDirections, ForcesAreNormalToEllipsesOfSlip) {
  ContactScene3 scene = flat_scene();
  add_pair(scene, 0.6, 0.15, 0.5);
  const Vec<3> along = Vec<3>(2, 1, 0).normalized(), across = Vec<3>(-1, 2, 0).normalized();
  for (const double angle : {0.0, 0.7, 1.3, std::numbers::pi / 2, 2.5, 4.0}) {
    const Vec<2> v = 100 * kSpeed * Vec<2>(std::cos(angle), std::sin(angle));
    const Vec<2> A(0.6, 0.15);
    const Vec<2> expected = -0.5 * A.cwiseProduct(A).cwiseProduct(v) / A.cwiseProduct(v).norm();
    const Vec<3> force = force_on_upper(scene, v[0] * along + v[1] * across);
    EXPECT_LE((force - expected[0] * along - expected[1] * across).norm(), 1e-9) << angle;
  }
  EXPECT_NEAR(force_on_upper(scene, kSpeed * across).dot(across), -0.15, 1e-9) << "at its most from eps_v on";
  EXPECT_LT(force_on_upper(scene, kSpeed / 4 * along).dot(along), -0.6 + 1e-9) << "or before that";
}

TEST(FrictionDirections, AllSlipIsAcrossADirectionThatIsNormal) {
  ContactScene3 scene = flat_scene();
  add_pair(scene, 0.6, 0.15, 1);
  scene.options.friction_pairs[0].across->direction = Vec<3>::UnitZ();
  for (const Vec<3>& v : {Vec<3>(7, 0, 0), Vec<3>(0, 7, 0), Vec<3>(-3, 6, 0)})
    EXPECT_LE((force_on_upper(scene, v) + 0.15 * v.normalized()).norm(), 1e-9);
}

TEST(FrictionDirections, TurnWithTheSurfaceThatTheyAreOf) {
  const Mat<3> Q = Eigen::AngleAxisd(1.1, Vec<3>(0.2, 0.1, 1).normalized()).toRotationMatrix();
  const auto turned = [&](VectorX x) {
    for (Eigen::Index i = 0; i < x.size(); i += 3) x.segment<3>(i) = (Q * x.segment<3>(i)).eval();
    return x;
  };
  for (const Frame frame : {Frame::a, Frame::b, Frame::space}) {
    ContactScene3 scene(2, false, 0.4, 0.01);
    add_pair(scene, 0.6, 0.15, 1, frame);
    const VectorX reference = scattered(scene.x, kSpeed, 5);
    const VectorX expected = turned(gradient_of(friction_of(scene, reference), scene.x));
    scene.x = turned(scene.x);
    const VectorX gradient = gradient_of(friction_of(scene, turned(reference)), scene.x);
    if (frame == Frame::space)
      EXPECT_GT((gradient - expected).norm(), 0.1 * expected.norm());
    else
      EXPECT_LE((gradient - expected).norm(), 1e-9 * expected.norm());

    ContactScene3 swapped = scene;
    FrictionPair& pair = swapped.options.friction_pairs[0];
    std::swap(pair.a, pair.b);
    if (frame != Frame::space) pair.across->frame = frame == Frame::a ? Frame::b : Frame::a;
    for (auto& sides : swapped.surface.friction_sides) sides = 3 - sides;
    EXPECT_EQ(gradient_of(friction_of(swapped, turned(reference)), scene.x), gradient);
  }
}

constexpr double kAlong = 0.2, kAcross = 0.4, kKinetic = 0.75;  ///< of the static ones
constexpr double kPullAngle = std::numbers::pi / 4, kPullRate = 0.5, kFlat = 0.05;
double pull_at(double t) { return kPullRate * std::max(0.0, t - kFlat); }

/// A block on a table, pulled at an angle to the direction of its coefficients by a force that grows.
Setup<3> pulled_block() {
  Setup<3> setup = block<3>();
  setup.materials[1].youngs_modulus = 1e8;
  add_table(setup);
  setup.body_acceleration = [](const Vec<3>&, double t) {
    return Vec<3>(kGravity * Vec<3>(pull_at(t) * std::cos(kPullAngle), -1, pull_at(t) * std::sin(kPullAngle)));
  };
  setup.contact.barrier_stiffness = 1e7;
  setup.contact.friction_iterations = -1;
  setup.contact.friction_velocity = 1e-3;
  FrictionPair pair{
      .a = {.bodies = {1}}, .b = {.obstacle_vertices = {0, 1, 2, 3}}, .statics = kAlong, .kinetic = kKinetic * kAlong};
  pair.across = {.statics = kAcross, .kinetic = kKinetic * kAcross, .direction = Vec<3>::UnitX()};
  setup.contact.friction_pairs = {pair};
  setup.lagging_tolerance = 1e-4;
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  setup.time = {.dt = 0.0025, .steps = 320};
  return setup;
}

/// Velocity in the plane of a point mass whose friction has the convex potential mu N |A v|, from when it lets go on.
Vec<2> predicted(double from, double to) {
  constexpr int kSteps = 20000;
  const double h = (to - from) / kSteps;
  const Vec<2> A(kKinetic * kAlong, kKinetic * kAcross), along(std::cos(kPullAngle), std::sin(kPullAngle));
  Vec<2> v = 1e-9 * along.cwiseQuotient(A.cwiseProduct(A));
  for (int i = 0; i < kSteps; ++i)
    v += h * kGravity * (pull_at(from + i * h) * along - A.cwiseProduct(A).cwiseProduct(v) / A.cwiseProduct(v).norm());
  return v;
}

TEST(FrictionDirections, ABlockSticksWithinTheEllipseThenSlidesAsTheConvexPotentialSays) {
  const itr::Setup<3> setup = pulled_block();
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  const double most = 1 / std::hypot(std::cos(kPullAngle) / kAlong, std::sin(kPullAngle) / kAcross);
  double began = 0;
  const auto velocity = [&] {
    const VectorX& v = simulation.state().history.v[0];
    const Vec<3> mean = sum<3>(v) / setup.mesh.num_vertices();  // the table rests
    return Vec<2>(mean[0], mean[2]);
  };
  while (!simulation.finished()) {
    const VectorX x = simulation.state().history.x[0];
    advance(simulation);
    const State<3>& state = simulation.state();
    const VectorX friction = asked(simulation).forces.friction;
    EXPECT_LE(friction.dot((state.history.x[0] - x).head(friction.size())), 1e-15) << state.step;
    const bool has_settled = state.t > kFlat + 0.1;  // on the table
    if (began == 0 && has_settled && velocity().norm() > 10 * setup.contact.friction_velocity) {
      began = state.t;
      const Vec<2> v = velocity(),
                   steep(std::cos(kPullAngle) / (kAlong * kAlong), std::sin(kPullAngle) / (kAcross * kAcross));
      EXPECT_NEAR(v[1] / v[0], steep[1] / steep[0], 0.15) << "begins where the ellipse is normal to the pull";
    }
  }
  EXPECT_GE(pull_at(began), most);
  // The force that is free, the part that friction falls by, needs about ten steps for that speed.
  EXPECT_LE(pull_at(began), most + 12 * kPullRate * setup.time.dt);
  const Vec<2> expected = predicted(kFlat + most / kPullRate, simulation.state().t);
  EXPECT_LE((velocity() - expected).norm(), 0.02 * expected.norm())
      << velocity().transpose() << ", " << expected.transpose();
}

TEST(FrictionDirections, AreCheckedWhereAProgramGivesThem) {
  const auto place_of = [](double kinetic_along, const FrictionAcross& across) {
    itr::Setup<3> setup = pulled_block();
    setup.contact.friction_pairs[0].kinetic = kinetic_along;
    setup.contact.friction_pairs[0].across = across;
    try {
      setup.validate();
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string("none");
  };
  const Vec<3> x = Vec<3>::UnitX();
  EXPECT_EQ(place_of(kAlong / 2, {.statics = kAcross, .kinetic = kAcross / 2, .direction = x}), "none");
  EXPECT_EQ(place_of(kAlong / 2, {.statics = kAlong, .kinetic = kAlong, .direction = x}),
            "/contact/friction_pairs/0/kinetic");
  EXPECT_EQ(place_of(kAlong / 2, {.statics = 0, .kinetic = 0.1, .direction = x}), "/contact/friction_pairs/0/kinetic");
  EXPECT_EQ(place_of(kAlong / 2, {.statics = kAcross, .kinetic = kAcross / 2}), "/contact/friction_pairs/0/direction");
}

}  // namespace

namespace scene {
namespace {

class FrictionDirectionScenes : public SceneTest {
 protected:
  static json with_pair(const json& changes, const char* mesh = "tet.msh") {
    json pair = {{"a", 1}, {"b", "steel"}, {"direction", {0, 3, 4}}};
    pair.merge_patch(changes);
    return square(
        {{"geometry", json::array({{{"mesh", mesh}, {"volume_selection", 1}},
                                   {{"type", "ground"}, {"height", -1}, {"name", "steel"}, {"is_obstacle", true}}})},
         {"contact", {{"enabled", true}, {"friction_pairs", json::array({pair})}}}});
  }
  FrictionPair read3(const json& changes) {
    return std::get<itr::Setup<3>>(read_scene(with_pair(changes)).setup).contact.friction_pairs.at(0);
  }
};

TEST_F(FrictionDirectionScenes, HaveTwoCoefficientsADirectionAndAFrame) {
  const FrictionPair pair = read3({{"static", {0.5, 0.25}}, {"kinetic", {0.3, 0.15}}, {"frame", "steel"}});
  EXPECT_EQ(pair.statics, 0.5);
  EXPECT_EQ(pair.kinetic, 0.3);
  ASSERT_TRUE(pair.across);
  EXPECT_EQ(pair.across->statics, 0.25);
  EXPECT_EQ(pair.across->kinetic, 0.15);
  EXPECT_LE((pair.across->direction - Vec<3>(0, 0.6, 0.8)).norm(), 1e-15);
  EXPECT_EQ(pair.across->frame, FrictionAcross::Frame::b);
  EXPECT_EQ(read3({{"coefficient", {0.2, 0}}}).across->frame, FrictionAcross::Frame::space);
  EXPECT_EQ(read3({{"coefficient", {0, 0.2}}, {"frame", 1}}).across->frame, FrictionAcross::Frame::a);
  EXPECT_FALSE(read3({{"coefficient", {0.2, 0.2}}, {"direction", nullptr}}).across);
}

TEST_F(FrictionDirectionScenes, RefuseWhatHasNoMeaning) {
  const auto wrong = [&](const json& changes) {
    return failure(with_pair(changes)).place.substr(sizeof("/contact/friction_pairs/0") - 1);
  };
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"direction", nullptr}}), "");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"direction", {1, 0}}}), "/direction");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"direction", {0, 0, 0}}}), "/direction");
  EXPECT_EQ(wrong({{"static", 0.5}}), "/direction") << "one coefficient has no direction";
  EXPECT_EQ(wrong({{"static", 0.5}, {"direction", nullptr}, {"frame", 1}}), "/frame");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"frame", "rubber"}}), "/frame");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"b", 1}, {"frame", 1}}), "/frame");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2, 0.1}}}), "/static");
  EXPECT_EQ(wrong({{"static", {0.5, -0.2}}}), "/static/1");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"kinetic", {0.4, 0.3}}}), "/kinetic");
  EXPECT_EQ(wrong({{"static", {0.5, 0.2}}, {"kinetic", 0.2}}), "/kinetic");
  EXPECT_EQ(failure(with_pair({{"static", {0.5, 0.2}}, {"kinetic", {0.25, 0.2}}})).expected,
            "kinetic by static as the same ratio in both directions, such as [0.25, 0.1]");
}

TEST_F(FrictionDirectionScenes, AreRefusedInThePlane) {
  const auto parts = failure(with_pair({{"static", {0.5, 0.2}}}, "square.obj"));
  EXPECT_EQ(parts.place, "/contact/friction_pairs/0/static");
  EXPECT_EQ(parts.expected, "one coefficient: in the plane, surfaces slide along one line only");
}

}  // namespace
}  // namespace scene
}  // namespace itr
