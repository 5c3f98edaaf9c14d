// SPDX-License-Identifier: MIT
// The table of the terms of the incremental potential, what is summed, and what becomes of terms that nobody knows.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "energy/follower.hpp"
#include "energy/incremental_potential.hpp"
#include "random_mesh.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/decide/prospect.hpp"
#include "remesh/edits.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

/// Minus the work of a force by rest area, uniform in each cell.
class Push final : public Energy {
 public:
  Push(const CellSet<2>& cells, const Vec<2>& force, double scale) : cells_(cells), force_(scale * force) {}
  std::string_view name() const override { return "push"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = 0;
    for (const auto& element : cells_.elements)
      for (const int v : element.vertices) sum -= element.volume / 3 * force_.dot(x.segment<2>(2 * v) - cells_.rest[v]);
    return sum;
  }
  void add_gradient(ConstVectorView, VectorView gradient, Workspace&) const override {
    for (const auto& element : cells_.elements)
      for (const int v : element.vertices) gradient.segment<2>(2 * v) -= element.volume / 3 * force_;
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}

 private:
  const CellSet<2>& cells_;
  Vec<2> force_;
};

TermFactory<2> push(const Vec<2>& force) {
  return [force](const CellSet<2>& cells, double, double scale) { return std::make_shared<Push>(cells, force, scale); };
}

/// A scene in which every kind of term acts.
TrialScene scene_of_all_terms() {
  TrialScene scene(1, 6, {.friction = true, .pressure = true, .damping = true});
  scene.context.contact.dhat = 0.1;  // to the obstacle and beyond
  scene.context.contact.average_gaps = true;
  scene.context.contact.adhesion = {.strength = 1, .peak = 0.05, .reach = 0.1, .tangential_coefficient = 0.3};
  scene.context.host.push_back(push({1, 0}));
  scene.context.loads.cavities = {{{3}, 0.5, 1, 1.4, 0}};
  auto viscous = scene.context.materials;
  for (auto& [body, material] : viscous) material.prony = {{0.5, 0.1}};
  Mesh<2> start = scene.mesh;
  start.compact();
  VectorX x = 1.1 * scene.fields.x;
  const auto state = begin_viscous<2>(start, viscous, x, 0);
  scene.context.viscous = std::make_shared<ViscousStep<2>>(
      std::dynamic_pointer_cast<const CellField<2>>(
          ViscousStep<2>(std::dynamic_pointer_cast<const CellField<2>>(state), viscous, 0.1).end(start, x, 0.1).state),
      viscous, 0.1);
  auto softening = scene.context.materials;
  for (auto& [body, material] : softening) {
    material.law = MaterialLaw::mooney_rivlin;
    material.mooney_rivlin = {.c1 = 100, .c2 = 10};
    material.mullins = MullinsSoftening{2, 1, 0.1};
  }
  for (Eigen::Index k = 0; k + 1 < x.size(); k += 2) x[k] += 0.5 * x[k + 1];  // growth alone stores no energy of shape
  scene.context.softening = std::make_shared<SofteningStep<2>>(
      std::dynamic_pointer_cast<const CellField<2>>(begin_softening<2>(start, softening, x, 0)), softening);
  scene.context.follower = [](const VectorX& x) {
    return std::vector<std::shared_ptr<const Energy>>{std::make_shared<LinearizedForces<2>>(VectorX(), x, 1)};
  };
  const auto dofs = scene.fields.x.size() + 2 * static_cast<Eigen::Index>(scene.context.obstacles.rest.size());
  scene.context.tie = std::make_shared<LinearizedForces<2>>(VectorX(), VectorX::Zero(dofs), 1);
  return scene;
}

/// The kinds of term that the whole mesh' potential sums at the scene's positions; with each its energy.
std::multimap<TermKind, double> summed_terms(const TrialScene& scene) {
  const StepContext<2>& context = scene.context;
  const auto& obstacles = context.obstacles;
  const int bodies = scene.mesh.node_slots();
  const auto with_obstacles = [&](const VectorX& field, const std::vector<Vec<2>>& values) {
    VectorX all(field.size() + 2 * static_cast<Eigen::Index>(values.size()));
    all.head(field.size()) = field;
    for (std::size_t o = 0; o < values.size(); ++o) vertex_of<2>(all, bodies + static_cast<int>(o)) = values[o];
    return all;
  };
  const CellSet<2> cells = whole_mesh<2>(scene.mesh, obstacles.rest);
  std::vector<std::array<int, 2>> edges;
  std::vector<char> counts(cells.num_vertices, 0);
  for (const auto& facet : cells.facets) {
    edges.push_back(facet.vertices);
    for (const int v : facet.vertices) counts[v] = 1;
  }
  for (const auto& [a, b] : obstacles.edges) edges.push_back({bodies + a, bodies + b});
  CollisionSurface surface = make_collision_surface<2>(edges, {}, {}, cells.rest, counts);
  if (context.contact.average_gaps) {
    const std::size_t n = cells.rest.size();
    surface.retraction = std::make_shared<Retraction>(Retraction{.depth = std::vector<double>(n, 0),
                                                                 .width = std::vector<double>(n, 0),
                                                                 .is_corner = std::vector<char>(n, 1),
                                                                 .rest = cells.rest,
                                                                 .outward = cells.rest,
                                                                 .stiffness = std::vector<double>(n, 1)});
  }
  const VectorX x = with_obstacles(scene.fields.x, obstacles.x);
  const VectorX predictor = with_obstacles(scene.fields.predictor, obstacles.x);
  const VectorX reference = with_obstacles(scene.fields.velocity_reference, obstacles.velocity_reference);
  IncrementalPotential<2> potential(context, cells, {.predictor = predictor, .velocity_reference = reference});
  if (context.contact.enabled) potential.add_contact(surface, context.contact.barrier_stiffness);
  Workspace workspace;
  const auto lagged = potential.lag(x, workspace);
  std::multimap<TermKind, double> found;
  double total = 0;
  potential.for_each(lagged, [&](TermKind kind, const auto& term) {
    total += term->value(x, workspace);
    found.emplace(kind, term->value(x, workspace));
  });
  EXPECT_EQ(potential.sum(lagged).value(x, workspace), total);
  return found;
}

TEST(Terms, OfTheTableAreThoseThatAreSummed) {
  const TrialScene all = scene_of_all_terms();
  const std::vector<std::pair<TermKind, std::function<void(StepContext<2>&)>>> without = {
      {TermKind::inertia, [](auto& c) { c.has_inertia = false; }},
      {TermKind::viscous, [](auto& c) { c.viscous = nullptr; }},
      {TermKind::softening, [](auto& c) { c.softening = nullptr; }},
      {TermKind::loads, [](auto& c) { c.loads.acceleration = nullptr, c.loads.tractions.clear(); }},
      {TermKind::host, [](auto& c) { c.host.clear(); }},
      {TermKind::follower, [](auto& c) { c.follower = nullptr; }},
      {TermKind::contact, [](auto& c) { c.contact.enabled = false; }},
      {TermKind::averaged_contact, [](auto& c) { c.contact.average_gaps = false; }},
      {TermKind::friction, [](auto& c) { c.contact.friction_coefficient = 0; }},
      {TermKind::friction, [](auto& c) { c.contact.friction_iterations = 0; }},
      {TermKind::adhesion, [](auto& c) { c.contact.adhesion.strength = 0; }},
      {TermKind::adhesive_friction, [](auto& c) { c.contact.adhesion.tangential_coefficient = 0; }},
      {TermKind::adhesive_friction, [](auto& c) { c.contact.adhesion.iterations = 0; }},
      {TermKind::pressure, [](auto& c) { c.loads.pressures.clear(); }},
      {TermKind::cavity, [](auto& c) { c.loads.cavities.clear(); }},
      {TermKind::tie, [](auto& c) { c.tie = nullptr; }},
      {TermKind::damping, [](auto& c) { c.damping.clear(); }},
      {TermKind::contact_damping, [](auto& c) { c.damping.clear(); }},
      {TermKind::contact_damping, [](auto& c) { c.contact.enabled = false; }}};
  const auto compare = [](const TrialScene& scene) {
    const auto summed = summed_terms(scene);
    std::size_t count = 0;
    for (const auto& term : kTerms<2>) {
      EXPECT_EQ(term.is_in(scene.context), summed.count(term.kind) > 0) << "kind " << static_cast<int>(term.kind);
      count += summed.count(term.kind) > 0;
    }
    return count;
  };
  EXPECT_EQ(compare(all), kNumTermKinds);
  for (const auto& [kind, leave_out] : without) {
    TrialScene scene = all;
    leave_out(scene.context);
    EXPECT_FALSE(is_in(kind, scene.context));
    compare(scene);
  }
}

TEST(Terms, ThatNobodyKnowsAreTakenForTheWorst) {
  constexpr TermTraits<2> kUnknown{.kind = TermKind::host, .is_in = nullptr, .energy = EnergyEntry::host};
  EXPECT_EQ(kUnknown.in_predictions, InPredictions::unknown);
  EXPECT_EQ(kUnknown.is_bounded, nullptr);
  EXPECT_TRUE(kUnknown.needs_facets({}));
  EXPECT_EQ(traits<2>(TermKind::host).in_predictions, kUnknown.in_predictions);
  EXPECT_EQ(traits<2>(TermKind::host).is_bounded, kUnknown.is_bounded);
}

/// A body at rest, of which all that is known has nothing to gain.
TrialScene scene_at_rest() {
  TrialScene scene(2, 4);
  scene.context.contact.enabled = false;
  scene.context.loads = {};
  scene.context.coupling = 0;
  scene.context.obstacles = {};
  scene.context.obstacles.past_x.resize(1);
  for (int v = 0; v < scene.mesh.node_slots(); ++v) vertex_of<2>(scene.fields.x, v) = scene.mesh.rest(v);
  scene.fields.predictor = scene.fields.velocity_reference = scene.fields.past_positions[0] = scene.fields.x;
  return scene;
}

TEST(Terms, ThatNobodyKnowsLeaveEditsToTrials) {
  RemeshOptions options = remesh_options();
  options.collapse.enabled = false;
  options.split.acceptance_tolerance = 1e-9;
  const auto splits = [&](TrialScene scene) {
    RemeshMemory memory;
    Strata<2> strata;
    return remesh<2>(scene.mesh, scene.fields, scene.context, options, memory, strata).splits;
  };
  TrialScene scene = scene_at_rest();
  EXPECT_EQ(splits(scene).tried, 0);
  scene.context.host.push_back(push({1, 0}));
  EXPECT_GT(splits(scene).accepted, 0);
}

TEST(Terms, ThatPredictionsDoNotKnowArePredictedToGainAnything) {
  const std::vector<std::function<void(StepContext<2>&)>> unknown = {
      [](auto& c) {
        c.host.push_back(push({1, 0}));
      },
      [](auto& c) { c.follower = [](const VectorX&) { return std::vector<std::shared_ptr<const Energy>>(); }; },
      [](auto& c) { c.loads.pressures.emplace_back(1, [](const Vec<2>&) { return 1.0; }); },
      [](auto& c) { c.damping.push_back({}); }};
  const auto look = [](const TrialScene& scene) {
    const LocalView view(scene);
    const EdgeKey edge = scene.mesh.edges().front();
    const double split = predict_split<2>(view.state, edge);
    EXPECT_EQ(std::isinf(split), std::isinf(predict_gain<2>(view.state, make_split(scene.mesh, edge))));
    EXPECT_EQ(std::isinf(split), std::isinf(available_energy(scene.mesh, scene.fields, scene.context)));
    return split;
  };
  EXPECT_TRUE(std::isfinite(look(scene_at_rest())));
  for (const auto& add : unknown) {
    TrialScene scene = scene_at_rest();
    add(scene.context);
    EXPECT_EQ(look(scene), std::numeric_limits<double>::infinity());
  }
}

}  // namespace
}  // namespace itr
