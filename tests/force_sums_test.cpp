// SPDX-License-Identifier: MIT
// Reported forces of random combinations of all terms add up: the rate of momentum is their sum, and what acts on bodies
// acts on obstacles the other way.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <sstream>

#include "energy/inertia.hpp"
#include "fem/cell_set.hpp"
#include "host_block.hpp"
#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "simulation/resultant.hpp"

namespace itr {
namespace {

/// 1/2 k |x - X|^2 by mass-like weights of the cells' vertices.
template <int Dim>
class Springs final : public Energy {
 public:
  Springs(const CellSet<Dim>& cells, double stiffness) : cells_(cells), stiffness_(stiffness) {}
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = 0;
    for_each_spring([&](int v, double k) { sum += 0.5 * k * direction(v, x).squaredNorm(); });
    return sum;
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    for_each_spring([&](int v, double k) { gradient.segment<Dim>(Dim * v) += k * direction(v, x); });
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const override {
    for_each_spring([&](int v, double k) {
      const Mat<Dim> block = k * Mat<Dim>::Identity();
      sink.add<Dim>(std::array{v}, block.data());
    });
  }

 private:
  Vec<Dim> direction(int v, ConstVectorView x) const { return x.segment<Dim>(Dim * v) - cells_.rest[v]; }
  template <typename F>
  void for_each_spring(const F& f) const {
    for (const auto& element : cells_.elements)
      for (const int v : element.vertices) f(v, stiffness_ * element.volume);
  }

  const CellSet<Dim>& cells_;
  double stiffness_;
};

/// A block, or two of which the upper one touches the lower one. Facet tags 1: left, 2: top, 3: others; 4: of the upper one.
template <int Dim>
Mesh<Dim> stacked_blocks(bool two, std::mt19937& random) {
  constexpr double gap = 4e-4;
  const Mesh<Dim> one = block<Dim>().mesh;
  std::uniform_real_distribution<double> noise(-0.1, 0.1);
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<int> body;
  for (int copy = 0; copy < (two ? 2 : 1); ++copy) {
    const int first = static_cast<int>(rest.size());
    for (int v = 0; v < one.node_slots(); ++v) {
      Vec<Dim> X = one.rest(v);
      const bool is_inside = Dim == 2 && X.minCoeff() > 1e-9 && X.maxCoeff() < kSize - 1e-9;
      for (int c = 0; is_inside && c < Dim; ++c) X[c] += noise(random) * kSize / 3;
      rest.push_back(X + copy * ((kSize + gap) * Vec<Dim>::Unit(1) + 0.03 * Vec<Dim>::Unit(0)));
    }
    for (int c = 0; c < one.cell_slots(); ++c) {
      auto cell = one.cell(c);
      for (int& v : cell) v += first;
      cells.push_back(cell);
      body.push_back(1 + copy);
    }
  }
  Mesh<Dim> mesh(rest, cells, body);
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    Vec<Dim> low = mesh.rest(mesh.facet(f)[0]), high = low;
    for (const int v : mesh.facet(f)) low = low.cwiseMin(mesh.rest(v)), high = high.cwiseMax(mesh.rest(v));
    const bool is_upper = high[1] > kSize + gap / 2;
    mesh.set_facet_tag(f, is_upper ? 4 : high[0] < 1e-9 ? 1 : low[1] > kSize - 1e-9 ? 2 : 3);
  }
  return mesh;
}

/// A setup with a random choice of everything that exerts or changes forces; `words` says which.
template <int Dim>
struct RandomScene {
  std::mt19937 random;
  std::ostringstream words;
  Setup<Dim> setup;
  bool is_curved = false;

  explicit RandomScene(unsigned seed) : random(seed) {
    words << Dim << "D, seed " << seed << ":";
    setup = block<Dim>();
    const bool two = with("two bodies");
    setup.mesh = stacked_blocks<Dim>(two, random);
    setup.materials[2] = {.youngs_modulus = 3e5, .poisson_ratio = 0.2, .density = 700};
    setup.fields.applied_forces = true;
    setup.newton = {};
    if (with("tight Newton")) setup.newton.force_tolerance = 1e-13;
    add_time();
    add_mesh_options();
    add_loads();
    add_contact();
    if (with("elastic damping"))
      setup.damping.push_back({DampingOptions::Term::elastic, 5e-3, 1 + static_cast<int>(random() % 3)});
    if (!setup.time.is_static && with("cut steps", 0.3)) {
      setup.newton.max_iterations = 4 + static_cast<int>(random() % 4);
      setup.time.step_cuts = 8;
    }
    const Vec<Dim> speed = some_vector(0.5);
    if (has_inertia() && with("speed"))
      for (const int body : {1, 2})
        setup.initial_velocity.push_back(
            {body, [=](const Vec<Dim>& X, double) { return Vec<Dim>(speed + 3 * (X[0] - 0.1) * Vec<Dim>::Unit(1)); }});
  }

  bool has_inertia() const { return !setup.time.quasistatic && !setup.time.is_static; }

 private:
  bool with(const char* word, double fraction = 0.5) {
    const bool is = std::uniform_real_distribution<double>(0, 1)(random) < fraction;
    if (is) words << ' ' << word << ',';
    return is;
  }
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  Vec<Dim> some_vector(double size) {
    Vec<Dim> v;
    for (double& c : v) c = number(-size, size);
    return v;
  }

  void add_time() {
    setup.time = {.dt = 0.004, .steps = 6};
    switch (random() % 6) {
      case 0:
        setup.time.integrator = Integrator::bdf;
        setup.time.bdf_order = 2 + static_cast<int>(random() % 2);
        words << " BDF" << setup.time.bdf_order << ',';
        break;
      case 1:
        setup.time.integrator = Integrator::newmark;
        words << " Newmark,";
        break;
      case 2:
        setup.time.integrator = Integrator::newmark;
        setup.time.newmark_beta = 0.3;
        setup.time.newmark_gamma = 0.6;
        words << " damped Newmark,";
        break;
      case 3:
        setup.time.quasistatic = true;
        words << " quasistatic,";
        break;
      default:
        words << " Euler,";
    }
  }

  void add_mesh_options() {
    is_curved = with("quadratic", 0.3);
    if (is_curved) setup.order = {{1, 2}, {2, random() % 2 ? 2 : 1}};
    auto& remesh = setup.remesh;
    remesh.enabled = with("remeshing");
    if (remesh.enabled) {
      remesh.split.acceptance_tolerance = Dim == 2 ? number(1e-5, 1e-4) : 1e-2;
      remesh.split.max_depth = 1;
      remesh.split.min_edge_length = kSize / 8;
      remesh.collapse.acceptance_tolerance = Dim == 2 ? -1e-3 : -1e-2;
      remesh.collapse.rel_max_edge_length = 1.5;
      remesh.swap.enabled = remesh.smooth.enabled = with("swaps and smoothing");
      remesh.curve.enabled = remesh.straighten.enabled = is_curved || with("curving", 0.3);
      is_curved |= remesh.curve.enabled;
    } else if (with("density varies", 0.3)) {
      setup.materials[1].density_at = [](const Vec<3>& X) { return 800 + 2000 * X[0]; };
    }
    if (!is_curved) setup.lump_mass = with("lumped", 0.3);
  }

  void add_loads() {
    const Vec<Dim> a = some_vector(20), f = some_vector(500), push = some_vector(5);
    if (!with("gravity", 0.7)) setup.body_acceleration = nullptr;
    if (with("body force that varies", 0.3))
      setup.body_acceleration = [=](const Vec<Dim>& X, double t) { return Vec<Dim>((1 + 4 * X[0] + t) * a); };
    if (with("tractions")) setup.neumann.push_back({2, [=](const Vec<Dim>& X, double) { return Vec<Dim>(X[0] * 5 * f); }});
    const double p = number(-200, 200);
    if (with("pressure")) setup.pressure.push_back({3, [=](const Vec<Dim>&, double t) { return p * (1 + t); }});
    if (with("pressure all around", 0.2))
      for (const int tag : {1, 2}) setup.pressure.push_back({tag, [=](const Vec<Dim>&, double) { return 0.5 * p; }});
    if (with("held side")) {
      DirichletCondition<Dim> held{1, {}, [=](const Vec<Dim>&, double t) { return Vec<Dim>(t * push * 0.02); }};
      held.components.fill(true);
      if (with("rollers")) held.components[1] = false;
      setup.dirichlet.push_back(held);
    }
    if (with("held point", 0.3)) {
      for (VertexId v = 0; v < setup.mesh.node_slots(); ++v)
        if ((setup.mesh.rest(v) - kSize * Vec<Dim>::Ones()).norm() < 1e-9) setup.mesh.set_vertex_tag(v, 9);
      DirichletCondition<Dim> point{
          9, {true}, [](const Vec<Dim>&, double t) { return Vec<Dim>(0.01 * t * Vec<Dim>::Ones()); }};
      setup.dirichlet.push_back(point);
    }
    if (is_curved) return;
    if (with("point forces")) {
      VectorX forces = VectorX::Zero(Dim * setup.mesh.node_slots());
      for (double& force : forces) force = number(-0.5, 0.5);
      setup.terms.push_back(point_forces<Dim>(setup.mesh, forces));
    }
    if (with("host term"))
      setup.terms.push_back([](const CellSet<Dim>& cells, double, double scale) {
        return std::make_shared<Springs<Dim>>(cells, scale * 2e4);
      });
    if (with("follower forces")) {
      setup.follower.forces = [=](const Mesh<Dim>&, ConstVectorView x, double, VectorView forces) {
        for (Eigen::Index i = 0; i < forces.size(); i += Dim) {
          forces[i] += 3 * x[i + 1];
          forces[i + 1] -= 2 * x[i] + 1;
        }
      };
    }
  }

  void add_contact() {
    if (!with("contact", 0.8)) return;
    add_table(setup);
    setup.contact.convergent = with("convergent");
    setup.contact.barrier_stiffness = 0;  // the default
    if (with("adaptive stiffness", 0.2)) setup.contact.adaptive_stiffness = true;
    if (with("moving table")) {
      const Vec<Dim> speed = 0.05 * some_vector(1) + 0.05 * Vec<Dim>::Unit(1);
      std::fill(setup.obstacles.motion.begin(), setup.obstacles.motion.end(), 0);
      setup.obstacles.motions.push_back([=](const Vec<Dim>&, double t) { return Vec<Dim>(t * speed); });
    }
    if (with("friction")) {
      setup.contact.friction_coefficient = 0.4;
      setup.contact.friction_iterations = 1 + static_cast<int>(random() % 3);
    }
    if (with("contact damping"))
      setup.damping.push_back({DampingOptions::Term::contact, number(1e-3, 5e-3), 1 + static_cast<int>(random() % 3)});
  }
};

/// A sum of vectors and of their sizes.
template <int Dim>
struct Sum {
  Vec<Dim> total = Vec<Dim>::Zero();
  double size = 0;
  void add(const Vec<Dim>& f) {
    total += f;
    size += f.norm();
  }
  void add(const VectorX& field, double factor = 1) {
    for (Eigen::Index i = 0; i < field.size(); i += Dim) add(Vec<Dim>(factor * field.segment<Dim>(i)));
  }
};

template <int Dim>
VectorX mass_times(const Setup<Dim>& setup, const State<Dim>& state, const VectorX& v) {
  const Eigen::Index dofs = Eigen::Index{Dim} * state.mesh.num_nodes();
  const CellSet<Dim> cells = whole_mesh(state.mesh, {});
  VectorX product = VectorX::Zero(dofs);
  InertiaEnergy<Dim>(cells, setup.materials, setup.lump_mass ? MassKind::lumped : MassKind::consistent, VectorX::Zero(dofs))
      .add_mass_product(v.head(dofs), product);
  return product;
}

/// Mass times the acceleration of the integrator from `before` to `after`, each velocity on its own mesh.
template <int Dim>
Sum<Dim> rate_of_momentum(const Setup<Dim>& setup, const State<Dim>& before, const State<Dim>& after,
                          const StepReport& report) {
  TimeOptions time = setup.time;
  History history = before.history;
  if (report.cut_steps > 0 || report.damped_steps > 0) time.integrator = Integrator::implicit_euler;
  if (time.integrator == Integrator::implicit_euler) history.v.resize(1), history.x.resize(1);
  const TimeIntegrator integrator(time);
  const VectorX none = VectorX::Zero(history.x[0].size());
  Sum<Dim> rate;
  rate.add(mass_times(setup, before, integrator.acceleration(none, history)));
  // Acceleration is linear in the velocity at the end: a unit of it shows its factor.
  const VectorX one = VectorX::Ones(none.size());
  const double factor = (integrator.acceleration(one, history) - integrator.acceleration(none, history))[0];
  rate.add(mass_times(setup, after, after.history.v[0]), factor);
  return rate;
}

struct Tally {
  double kept = 0;  ///< most momentum that edits changed, by that of the bodies, where history is no interpolation
  int failed = 0, cut = 0, remeshed = 0, in_contact = 0, with_friction = 0;
};

template <int Dim>
void expect_sums(const Setup<Dim>& setup, const State<Dim>& before, const State<Dim>& after, const StepResult& result,
                 const NodalForces& forces, Tally& tally) {
  constexpr double kTolerance = 1e-10;
  const auto opposite = [&](const VectorX& on_bodies, const VectorX& on_obstacles, const char* kind) {
    Sum<Dim> sum;
    sum.add(on_bodies);
    sum.add(on_obstacles);
    EXPECT_LE(sum.total.norm(), kTolerance * sum.size) << kind;
    return sum.size > 0;
  };
  tally.in_contact += opposite(forces.contact, forces.obstacle_contact, "contact");
  tally.with_friction += opposite(forces.friction, forces.obstacle_friction, "friction");

  Sum<Dim> sum, residual, rate;
  for (const VectorX* kind : {&forces.contact, &forces.friction, &forces.reaction, &forces.applied, &forces.body})
    sum.add(*kind);
  residual.add(forces.residual);
  const bool has_inertia = !setup.time.quasistatic && !setup.time.is_static;
  if (has_inertia) rate = rate_of_momentum(setup, before, after, result.report);
  Vec<Dim> expected = sum.total - residual.total;
  Vec<Dim> by_edits = Vec<Dim>::Zero();
  for (const MomentumChange& change : forces.remeshing) by_edits += Vec<Dim>(change.linear.data());
  expected += by_edits;
  if (rate.size > 0) tally.kept = std::max(tally.kept, by_edits.norm() / rate.size);
  EXPECT_LE((rate.total - expected).norm(), kTolerance * (sum.size + residual.size) + 1e-13 * rate.size)
      << "rate " << rate.total.transpose() << ", forces " << sum.total.transpose() << ", sizes " << sum.size << " and "
      << rate.size << ", residual " << residual.total.transpose();
  EXPECT_LE(residual.size, 1e-6 * (sum.size + rate.size) + 1e-8);
}

template <int Dim>
void run(unsigned seed, Tally& tally) {
  RandomScene<Dim> scene(seed);
  SCOPED_TRACE(scene.words.str());
  linear::Registry registry;
  Simulation<Dim> simulation(scene.setup, registry);
  for (int step = 0; step < (Dim == 2 ? 3 : 2); ++step) {
    const State<Dim> before = simulation.state();
    const StepResult result = simulation.advance();
    if (!result.ok) {
      ++tally.failed;
      return;
    }
    tally.cut += result.report.cut_steps > 0;
    tally.remeshed += !result.renumbering.empty();
    SCOPED_TRACE("step " + std::to_string(step + 1) + (result.report.cut_steps > 0 ? ", cut" : "") +
                 (result.renumbering.empty() ? "" : ", remeshed") + (result.report.damped_steps > 0 ? ", damped" : ""));
    expect_sums(simulation.setup(), before, simulation.state(), result, simulation.forces(), tally);
  }
}

/// Scenes may stop before their end; enough of them must do what the sums are about.
template <int Dim>
void run_all(unsigned count) {
  Tally tally;
  for (unsigned seed = 1; seed <= count && !::testing::Test::HasFailure(); ++seed) run<Dim>(seed, tally);
  EXPECT_LT(tally.failed, static_cast<int>(count) / 2);
  for (const int covered : {tally.cut, tally.remeshed, tally.in_contact, tally.with_friction}) EXPECT_GT(covered, 0);
  EXPECT_LT(tally.kept, 1e-12) << "edits change the momentum by round-off";
}

TEST(ForceSums, AreTheRateOfMomentum2D) { run_all<2>(40); }
TEST(ForceSums, AreTheRateOfMomentum3D) { run_all<3>(20); }

}  // namespace
}  // namespace itr
