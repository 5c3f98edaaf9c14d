// SPDX-License-Identifier: MIT
// Forces, terms of the energy and materials of a program that embeds the library.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "derivatives.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/follower.hpp"
#include "energy/load.hpp"
#include "fem/cell_set.hpp"
#include "host_block.hpp"
#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "law_derivatives.hpp"

namespace itr {
namespace {

template <int Dim>
VectorX some_forces(const Mesh<Dim>& mesh) {
  VectorX forces(Dim * mesh.node_slots());
  for (int i = 0; i < forces.size(); ++i) forces[i] = std::sin(1.0 + 3 * i);
  return forces;
}

TEST(HostForces, StayWhereTheyActHoweverTheMeshChanges) {
  auto simulation = simulate(pressed_block());
  const Mesh<2> mesh = simulation.state().mesh;
  const VectorX forces = some_forces(mesh);
  const auto term = point_forces<2>(mesh, forces);
  const auto totals = [&](const Mesh<2>& other) {
    const CellSet<2> cells = whole_mesh(other, {});
    VectorX gradient = VectorX::Zero(2 * other.node_slots());
    Workspace workspace;
    term(cells, 0, 1)->add_gradient(gradient, gradient, workspace);
    Vec<3> total = Vec<3>::Zero();
    for (int v = 0; v < other.node_slots(); ++v) {
      const Vec<2> f = -gradient.segment<2>(2 * v), X = other.rest(v);
      total += Vec<3>(f[0], f[1], X[0] * f[1] - X[1] * f[0]);
    }
    return total;
  };
  const Vec<3> before = totals(mesh);
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_NE(simulation.state().mesh.num_vertices(), mesh.num_vertices());
  EXPECT_LT((totals(simulation.state().mesh) - before).norm(), 1e-12);
  EXPECT_THROW(point_forces<2>(mesh, VectorX::Zero(3)), InputError);
}

TEST(HostForces, AreTheRateOfMomentum) {
  auto setup = block<3>();
  setup.body_acceleration = nullptr;
  const VectorX forces = some_forces(setup.mesh);
  setup.terms.push_back(point_forces<3>(setup.mesh, forces));
  auto simulation = simulate(setup);
  for (int i = 1; i <= 3; ++i) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok);
    const auto momentum = asked(simulation).momentum;
    const Vec<3> expected = i * setup.time.dt * sum<3>(forces);
    EXPECT_LT((Vec<3>(momentum.data()) - expected).norm(), 1e-10 * expected.norm());
    EXPECT_NE(result.report.energy.host, 0);
  }
}

/// Springs of stiffness k to the origin at each vertex.
class Springs final : public Energy {
 public:
  Springs(double k, double scale, int vertices) : k_(k * scale), vertices_(vertices) {}
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override { return 0.5 * k_ * x.head(2 * vertices_).squaredNorm(); }
  void add_gradient(ConstVectorView x, VectorView g, Workspace&) const override {
    g.head(2 * vertices_) += k_ * x.head(2 * vertices_);
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<2> block = k_ * Mat<2>::Identity();
    for (int v = 0; v < vertices_; ++v) sink.add<2>(std::array{v}, block.data());
  }

 private:
  double k_;
  int vertices_;
};

TEST(HostForces, OfPositionsBalanceAsTheirPotentialDoes) {
  static constexpr double k = 300;  // [N/m]
  VectorX expected;
  std::vector<int> iterations;
  for (int step = 0; step < 3; ++step) {
    auto setup = block<2>();
    if (step == 0)
      setup.terms.push_back([](const CellSet<2>& cells, double, double scale) {
        return std::make_shared<Springs>(k, scale, cells.num_vertices);
      });
    else
      setup.follower.forces = [](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f -= k * x; };
    if (step == 2)
      setup.follower.stiffness = [](const Mesh<2>& mesh, ConstVectorView, double, const StiffnessReceiver& add) {
        const Mat<2> block = k * Mat<2>::Identity();
        for (int v = 0; v < mesh.node_slots(); ++v) add(std::array{v}, block.data());
      };
    auto simulation = simulate(setup);
    int count = 0;
    for (int i = 0; i < 3; ++i) {
      const StepResult result = simulation.advance();
      ASSERT_TRUE(result.ok);
      count += result.report.newton_iterations;
    }
    iterations.push_back(count);
    if (step == 0) expected = simulation.state().history.x[0];
    EXPECT_LT((simulation.state().history.x[0] - expected).norm(), 1e-9) << "way " << step;
  }
  EXPECT_LT(iterations[2], iterations[1]);  // the Hessian saves rounds
}

/// A block between springs of so many N/m a vertex, whose forces are lagged: from about 8000 on rounds lead away.
Setup<2> between_springs(double k, bool with_stiffness = false) {
  auto setup = block<2>();
  setup.follower.forces = [k](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f -= k * x; };
  if (with_stiffness)
    setup.follower.stiffness = [k](const Mesh<2>& mesh, ConstVectorView, double, const StiffnessReceiver& add) {
      const Mat<2> block = k * Mat<2>::Identity();
      for (int v = 0; v < mesh.node_slots(); ++v) add(std::array{v}, block.data());
    };
  return setup;
}

StepResult step_of(const Setup<2>& setup, std::string* warnings = nullptr) {
  static linear::Registry registry;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             if (warnings && level == LogLevel::warning) *warnings += message;
                           }));
  return simulation.advance();
}

TEST(HostForces, ThatDoNotSettleFailTheStep) {
  const StepResult result = step_of(between_springs(11000));
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("loads do not settle: pressure or follower forces are"), std::string::npos) << result.reason;
  EXPECT_NE(result.reason.find("/solver/advanced/lagged_load_tolerance"), std::string::npos) << result.reason;
  EXPECT_EQ(result.reason.find("friction"), std::string::npos) << result.reason;  // there is none
  EXPECT_FALSE(step_of(between_springs(20000)).ok);                               // they move away
  EXPECT_TRUE(step_of(between_springs(11000, true)).ok);
}

TEST(HostForces, ThatHardlySettleAreWarnedOf) {
  std::string warnings;
  EXPECT_TRUE(step_of(between_springs(300), &warnings).ok);
  EXPECT_EQ(warnings, "");
  EXPECT_TRUE(step_of(between_springs(9000), &warnings).ok);
  EXPECT_NE(warnings.find("of themselves off those of the positions reached, not coming nearer after"), std::string::npos)
      << warnings;
  auto setup = between_springs(11000);
  setup.lagged_load_tolerance = 1;
  warnings.clear();
  EXPECT_TRUE(step_of(setup, &warnings).ok);
  EXPECT_NE(warnings.find("off those of the positions reached"), std::string::npos) << warnings;
}

TEST(HostForces, ThatDoNotSettleToTheToleranceCutTheStep) {
  auto setup = between_springs(9000);
  setup.lagging_tolerance = 1e-3;
  setup.time.step_cuts = 3;
  std::string warnings;
  const StepResult result = step_of(setup, &warnings);
  EXPECT_TRUE(result.ok) << result.reason;
  EXPECT_GE(result.report.cut_steps, 2);
  EXPECT_NE(warnings.find("expected at most 0.001 (/solver/lagging_tolerance)"), std::string::npos) << warnings;
}

TEST(HostForces, ThatDoNotSettleToTheToleranceAreWarnedOfWhereNoStepIsCut) {
  auto setup = between_springs(9000);
  setup.lagging_tolerance = 1e-6;
  std::string warnings;
  EXPECT_TRUE(step_of(setup, &warnings).ok);
  EXPECT_NE(warnings.find("expected at most 1e-06 (/solver/lagging_tolerance)"), std::string::npos) << warnings;
}

/// Where there may be friction, the first rounds are loose; where rounds lead away, the first one is the best.
TEST(HostForces, ThatDoNotSettleLeaveASolutionThatIsNotLoose) {
  auto setup = between_springs(9000);
  setup.materials[1].youngs_modulus = 3e4;
  setup.body_acceleration = [](const Vec<2>& X, double) { return Vec<2>(0, -100 - 1000 * X[0]); };
  setup.contact = {.enabled = true, .dhat = 1e-3, .friction_coefficient = 0.3};
  setup.newton = {};
  setup.lagging_tolerance = 1e-6;
  setup.lagged_load_tolerance = 1;
  std::string warnings;
  const StepResult result = step_of(setup, &warnings);
  EXPECT_TRUE(result.ok) << result.reason;
  EXPECT_NE(warnings.find("not coming nearer"), std::string::npos) << warnings;
  EXPECT_LT(result.forces.residual.norm(), 1e-3);  // of 10 kN
}

TEST(HostForces, InACycleAreNoSolution) {
  // On the whole block, of its mass by the square of the time step: it goes there and back from round to round.
  auto setup = block<2>();
  setup.newton.step_tolerance = 1e-6;
  setup.follower.forces = [h = setup.time.dt](const Mesh<2>& mesh, ConstVectorView x, double, VectorView f) {
    Vec<2> moment = Vec<2>::Zero();  // mass times barycentre
    const auto for_each_fraction = [&](const auto& visit) {
      for (CellId c = 0; c < mesh.cell_slots(); ++c)
        for (const VertexId v : mesh.cell(c)) visit(v, kDensity * mesh.volume(c) / 3);
    };
    for_each_fraction([&](VertexId v, double mass) { moment += mass * (x.segment<2>(2 * v) - mesh.rest(v)); });
    const Vec<2> mean = moment / (kDensity * kSize * kSize);
    for_each_fraction([&](VertexId v, double mass) { f.segment<2>(2 * v) -= mass / (h * h) * mean; });
  };
  const StepResult result = step_of(setup);
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("in a cycle"), std::string::npos) << result.reason;
}

TEST(HostForces, ThatVanishWhereTheyLeadAreNoSolution) {
  // On where the block has hardly fallen, off below: what was lagged is all wrong, though nothing acts at its end.
  auto setup = block<2>();
  setup.follower.forces = [](const Mesh<2>& mesh, ConstVectorView x, double, VectorView f) {
    double fall = 0;
    for (VertexId v = 0; v < mesh.node_slots(); ++v) fall += mesh.rest(v)[1] - x[2 * v + 1];
    if (fall / mesh.node_slots() > 2e-3) return;
    for (VertexId v = 0; v < mesh.node_slots(); ++v) f[2 * v + 1] -= 100;
  };
  const StepResult result = step_of(setup);
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("pressure or follower forces are 1 of themselves off"), std::string::npos) << result.reason;
}

TEST(HostForces, LinearisedHaveTheirDerivatives) {
  const Mesh<2> mesh = make_block<2>();
  FollowerForces<2> follower;
  follower.forces = [](const Mesh<2>&, ConstVectorView x, double, VectorView f) { f += x.array().sin().matrix(); };
  follower.stiffness = [](const Mesh<2>&, ConstVectorView, double, const StiffnessReceiver& add) {
    MatrixX block = MatrixX::Random(6, 6);
    add(std::array{2, 0, 5}, block.data());
  };
  VectorX x = VectorX::Random(2 * mesh.node_slots() + 4);  // two more vertices, of obstacles
  const auto energy = lag_follower<2>(follower, mesh, x, 0, 0.1);
  const VectorX y = x + VectorX::Random(x.size());
  expect_derivatives(*energy, y, 1e-6, 1e-7);
  expect_psd(*energy, y);
}

TEST(OwnTerms, ActInTrialsToo) {
  // Gravity as a term of the program's: the same meshes as by the library's own. Predictions know nothing of such terms, nor
  // of damping: with that, be it none, both ask edges in the same order.
  auto setup = pressed_block();
  setup.damping.push_back({.coefficient = 0});
  auto library = simulate(setup);
  setup.terms.push_back(
      [materials = setup.materials, g = setup.body_acceleration](const CellSet<2>& cells, double t, double scale) {
        return std::make_shared<LoadEnergy<2>>(cells, materials,
                                               Loads<2>{[g, t](const Vec<2>& X) { return g(X, t); }, {}, {}}, scale);
      });
  setup.body_acceleration = nullptr;
  auto own = simulate(setup);
  for (int i = 0; i < 5; ++i) {
    const StepResult a = library.advance(), b = own.advance();
    ASSERT_TRUE(a.ok && b.ok);
    EXPECT_EQ(a.report.splits.accepted, b.report.splits.accepted);
    EXPECT_EQ(a.report.collapses.tried, b.report.collapses.tried);
    ASSERT_EQ(a.report.vertices, b.report.vertices);
    EXPECT_NEAR(a.report.energy.total, b.report.energy.total, 1e-9 * std::abs(a.report.energy.total));
  }
  EXPECT_GT(own.state().mesh.num_vertices(), 16);
}

/// W = mu/2 (|F|^2 - d - 2 ln J) + lambda/2 (ln J)^2, as a program would bring it.
class OwnNeoHookean final : public OwnLaw {
 public:
  OwnNeoHookean(double mu, double lambda) : mu_(mu), lambda_(lambda) {}
  double density(const Eigen::Ref<const MatrixX>& F) const override {
    const double log_j = std::log(F.determinant());
    return mu_ / 2 * (F.squaredNorm() - double(F.rows()) - 2 * log_j) + lambda_ / 2 * log_j * log_j;
  }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override {
    const MatrixX T = F.inverse().transpose();
    P = mu_ * (F - T) + lambda_ * std::log(F.determinant()) * T;
  }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    const Eigen::Index d = F.rows();
    const MatrixX T = F.inverse().transpose();
    const double c = mu_ - lambda_ * std::log(F.determinant());
    for (Eigen::Index j = 0; j < d; ++j)
      for (Eigen::Index i = 0; i < d; ++i)
        for (Eigen::Index l = 0; l < d; ++l)
          for (Eigen::Index k = 0; k < d; ++k)
            H(d * j + i, d * l + k) = (i == k && j == l ? mu_ : 0) + c * T(k, j) * T(i, l) + lambda_ * T(i, j) * T(k, l);
  }

 private:
  double mu_, lambda_;
};

template <int Dim>
void expect_own_law_is_neo_hookean() {
  Material material{.youngs_modulus = 2e5, .poisson_ratio = 0.35};
  const ElasticModuli built_in = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
  material.law = MaterialLaw::own;
  material.own = std::make_shared<OwnNeoHookean>(built_in.lame.mu, built_in.lame.lambda);
  const ElasticModuli own = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
  const Mat<Dim> F = Mat<Dim>::Identity() + 0.2 * Mat<Dim>::Random();
  EXPECT_NEAR(elastic_density<Dim>(F, own), elastic_density<Dim>(F, built_in), 1e-8);
  EXPECT_LT((elastic_stress<Dim>(F, own) - elastic_stress<Dim>(F, built_in)).norm(), 1e-8);
  const auto hessian = [&](const ElasticModuli& moduli) { return matrix_of<Dim>(elastic_eigensystem<Dim>(F, moduli)); };
  EXPECT_LT((hessian(own) - hessian(built_in)).norm(), 1e-8 * hessian(own).norm());
}

TEST(OwnMaterial, IsTheSameAsTheLibrarysWithTheSameDensity) {
  expect_own_law_is_neo_hookean<2>();
  expect_own_law_is_neo_hookean<3>();
  for (const bool remeshes : {false, true}) {  // which decides by the last bits here and there
    auto setup = pressed_block();
    setup.remesh.enabled = remeshes;
    auto library = simulate(setup);
    Material& material = setup.materials[1];
    material.law = MaterialLaw::own;
    material.own = std::make_shared<OwnNeoHookean>(material.lame_mu(), material.lame_lambda(2));
    auto own = simulate(setup);
    for (int i = 0; i < 4; ++i) {
      const StepResult a = library.advance(), b = own.advance();
      ASSERT_TRUE(a.ok && b.ok);
      EXPECT_EQ(b.report.vertices > 16, remeshes);
      EXPECT_NEAR(a.report.energy.total, b.report.energy.total, (remeshes ? 1e-3 : 1e-8) * std::abs(a.report.energy.total));
    }
  }
}

}  // namespace
}  // namespace itr
