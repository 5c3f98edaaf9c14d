// SPDX-License-Identifier: MIT
#include "itr/simulation/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "cell_stress.hpp"
#include "initial_acceleration.hpp"
#include "itr/core/error.hpp"
#include "itr/core/process.hpp"
#include "itr/linear/choice.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/simulation/resultant.hpp"
#include "itr/simulation/step.hpp"
#include "watch.hpp"

namespace itr {

namespace {

template <int Dim>
std::string describe(const Vec<Dim>& p) {
  std::string text = "(";
  for (int c = 0; c < Dim; ++c) text += (c ? ", " : "") + std::to_string(p[c]);
  return text + ")";
}

template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup) {
  const auto refuse = [](const char* place, const std::string& found) {
    throw InputError({"", place, found, "something that this version supports"});
  };
  if (setup.remesh.enabled && setup.proxy)
    refuse("/contact/collision_mesh", "a collision mesh where the bodies' mesh changes");
  if (const bool is_quadratic =
          std::any_of(setup.order.begin(), setup.order.end(), [](const auto& e) { return e.second == 2; });
      is_quadratic) {
    if (setup.remesh.enabled) refuse("/space/remesh/enabled", "remeshing of quadratic elements");
    if (setup.proxy) refuse("/contact/collision_mesh", "a collision mesh of quadratic elements");
    if (!setup.pressure.empty()) refuse("/boundary_conditions/pressure_boundary", "pressure on quadratic elements");
    if (!setup.terms.empty() || setup.follower.forces) refuse("terms", "terms of a program's own on quadratic elements");
  }
  for (const auto& [body, material] : setup.materials)
    if (setup.remesh.enabled && material.density_at)
      refuse("/materials", "a density that varies in space (id " + std::to_string(body) + ") where the mesh changes");
}

/// Where no surfaces cross: what is wholly inside of a body.
template <int Dim>
void refuse_enclosed(const Setup<Dim>& setup, const State<Dim>& state) {
  if (setup.proxy) return;
  const auto refuse = [](const char* what, const Vec<Dim>& p) {
    throw InputError({"", "initial state", what + (" inside of a body, at " + describe(p)), "surfaces that do not touch"});
  };
  const VectorX& x = state.history.x[0];
  const ClosedSurface<Dim> boundary = body_boundary(state.mesh, x, state.space);
  for (const int v : boundary.nested()) refuse("a body", x.segment<Dim>(Dim * v));
  for (Eigen::Index i = Dim * num_nodes(state.mesh, state.space); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0) refuse("an obstacle", p);
}

template <int Dim>
void refuse_intersections(const Setup<Dim>& setup, const State<Dim>& state) {
  if (!setup.contact.enabled) return;
  const ContactSurface<Dim> contact = contact_surface(setup, state.mesh, state.space);
  const CollisionSurface& surface = contact.surface;
  const VectorX x = contact.positions(state.history.x[0]);
  const auto corners = [&](const auto& primitive) {
    std::string text;
    for (const int v : primitive) text.append(text.empty() ? "" : "-").append(describe<Dim>(x.segment<Dim>(Dim * v)));
    return text;
  };
  constexpr std::size_t kMostNamed = 5;
  const auto pairs = find_intersections<Dim>(surface, x, kMostNamed + 1);
  if (pairs.empty()) return refuse_enclosed(setup, state);
  std::string found;
  for (std::size_t i = 0; i < std::min(pairs.size(), kMostNamed); ++i) {
    const auto [first, second] = pairs[i];
    found += (i ? "; " : "") + ("edge " + corners(surface.edges[first])) + " and " +
             (Dim == 2 ? "edge " + corners(surface.edges[second]) : "triangle " + corners(surface.triangles[second]));
  }
  if (pairs.size() > kMostNamed) found += "; and more";
  throw InputError({"", "initial state", "surfaces that intersect: " + found, "surfaces that do not touch"});
}

/// Value of the first condition that names the body of one of the vertex's cells; the last cell's body wins.
template <int Dim>
VectorX sample(const std::vector<InitialCondition<Dim>>& conditions, const Mesh<Dim>& mesh, const Space& space,
               int obstacle_vertices) {
  VectorX field = VectorX::Zero(Dim * (num_nodes(mesh, space) + obstacle_vertices));
  if (conditions.empty()) return field;
  const std::vector<Vec<Dim>> rest = node_rest_positions(mesh, space);
  for (int c = 0; c < mesh.cell_slots(); ++c)
    for (const auto& condition : conditions) {
      if (condition.body != mesh.body(c)) continue;
      const auto& cell = mesh.cell(c);
      const auto set = [&](int node) { field.segment<Dim>(Dim * node) = condition.value(rest[node], 0); };
      for (const int v : cell) set(v);
      for_each_edge<Dim>([&](int, int i, int j) {
        if (const int edge = space.find(cell[i], cell[j]); edge != kNone) set(mesh.vertex_slots() + edge);
      });
      break;
    }
  return field;
}

template <int Dim>
State<Dim> initial_state(const Setup<Dim>& setup) {
  State<Dim> state;
  state.mesh = setup.mesh;
  state.mesh.compact();
  state.space = space_of_orders(state.mesh, setup.order);
  state.t = setup.time.t0;
  const int obstacles = static_cast<int>(setup.obstacles.rest.size());
  const std::vector<Vec<Dim>> rest = node_rest_positions(state.mesh, state.space);
  const auto sampled = [&](const auto& conditions) { return sample(conditions, state.mesh, state.space, obstacles); };
  VectorX x = sampled(setup.initial_displacement);
  for (std::size_t v = 0; v < rest.size(); ++v) vertex_of<Dim>(x, static_cast<int>(v)) += rest[v];
  x.tail(Dim * obstacles) = held_dofs(setup, state.mesh, state.t).target.tail(Dim * obstacles);
  state.history.x = {std::move(x)};
  state.history.v = {sampled(setup.initial_velocity)};
  if (setup.time.integrator == Integrator::newmark) state.history.a = {sampled(setup.initial_acceleration)};
  return state;
}

}  // namespace

template <int Dim>
struct Simulation<Dim>::Impl {
  Setup<Dim> setup;
  Logger logger;
  std::unique_ptr<linear::Solver> direct;  ///< or iterative
  std::unique_ptr<linear::ReusingSolver> solver;
  std::unique_ptr<ProblemCache<Dim>> cache;
  std::shared_ptr<State<Dim>> state = std::make_shared<State<Dim>>();  ///< snapshots may share it
  EdgeLengths initial_edges;
  NodalForces forces;   ///< of the last step
  double first_dt = 1;  ///< what the setup's tolerances are for [s]
  NewtonOptions first_newton;
  std::function<void(const MeshChange<Dim>&, const Mesh<Dim>&)> on_mesh_change;
  Watch<Dim> watch;

  StepTools<Dim> tools() const { return {setup, initial_edges, *cache, *solver, logger}; }

  /// Steps from now on have this length.
  void set_step(double dt) {
    TimeOptions& time = setup.time;
    if (!(dt > 0) || !std::isfinite(dt)) throw InputError({"", "dt", fmt::format("{}", dt), "a number > 0"});
    if (dt == time.dt) return;
    time.t0 = state->t;
    time.first_step = state->step;
    time.dt = dt;
    scale_tolerances();
    if (time.integrator != Integrator::bdf || state->history.x.size() == 1) return;
    own_state();
    state->history.x.resize(1);
    state->history.v.resize(1);
  }

  void scale_tolerances() {
    if (setup.newton.norm != NewtonNorm::euclidean || setup.time.is_static) return;
    const double factor = setup.time.dt / first_dt;
    setup.newton.step_tolerance = factor * first_newton.step_tolerance;
    setup.newton.gradient_tolerance = factor * first_newton.gradient_tolerance;
    setup.newton.first_gradient_tolerance = factor * first_newton.first_gradient_tolerance;
  }

  /// Before the state changes: snapshots keep theirs.
  void own_state() {
    if (state.use_count() > 1) state = std::make_shared<State<Dim>>(*state);
  }

  /// Those of a state that no step of this simulation led to.
  void set_forces_at_rest() {
    if (!setup.fields.any_forces()) return;
    StepProblem<Dim> problem(setup, state->mesh, state->space, state->history, state->t, *cache, state->stiffness,
                             state->quadrature);
    forces = problem.forces(state->history.x[0]);
    forces.reaction.setZero();
  }
};

template <int Dim>
// It is moved: NOLINTNEXTLINE(performance-unnecessary-value-param)
Simulation<Dim>::Simulation(Setup<Dim> setup, linear::Registry& registry, Logger logger) : impl_(std::make_unique<Impl>()) {
  refuse_unsupported(setup);
  setup.validate();
  for (const std::string& chosen : setup.choose_defaults()) logger.info(chosen);
  impl_->setup = std::move(setup);
  impl_->logger = std::move(logger);
  const LinearOptions& linear = impl_->setup.linear;
  impl_->direct =
      linear::choose_solver(linear, impl_->setup.newton.indefinite == IndefiniteHessian::accept, registry, impl_->logger);
  impl_->solver =
      std::make_unique<linear::ReusingSolver>(*impl_->direct, linear.reuse_factors && linear.dump_folder.empty());
  impl_->cache = std::make_unique<ProblemCache<Dim>>(*impl_->solver);
  impl_->first_dt = impl_->setup.time.dt;
  impl_->first_newton = impl_->setup.newton;
  *impl_->state = initial_state(impl_->setup);
  impl_->initial_edges = edge_lengths(impl_->state->mesh);
  refuse_intersections(impl_->setup, *impl_->state);
  if (impl_->setup.consistent_initial_acceleration && !impl_->state->history.a.empty())
    set_consistent_acceleration(impl_->setup, *impl_->state, *impl_->cache);
  impl_->set_forces_at_rest();
}

template <int Dim>
Simulation<Dim>::~Simulation() = default;
template <int Dim>
Simulation<Dim>::Simulation(Simulation&&) noexcept = default;

template <int Dim>
StepReport Simulation<Dim>::initial_report() const {
  StepReport report;
  const State<Dim>& state = *impl_->state;
  report.step = state.step;
  report.t = state.t;
  report.vertices = state.mesh.num_vertices();
  report.elements = state.mesh.num_cells();
  StepProblem<Dim> problem(impl_->setup, state.mesh, state.space, state.history, state.t, *impl_->cache, state.stiffness,
                           state.quadrature);
  report.unknowns = problem.dofs().num_unknowns;
  report.energy = problem.report(state.history.x[0]);
  report.energy_before_remesh = report.energy.total;
  report.min_distance = problem.min_distance(state.history.x[0]);
  report.min_volume_ratio = min_volume_ratio(problem.cells(), state.history.x[0]);
  report.peak_rss_mb = peak_rss_mb();
  return report;
}

template <int Dim>
StepResult Simulation<Dim>::adapt(double dt) {
  impl_->set_step(dt);
  State<Dim> end = *impl_->state;
  const auto start = std::make_shared<State<Dim>>();
  StepResult result = take_step(impl_->tools(), end, false, start.get());
  if (!result.ok || result.renumbering.empty()) return result;
  const std::shared_ptr<const State<Dim>> before = std::exchange(impl_->state, start);
  impl_->set_forces_at_rest();
  if (impl_->on_mesh_change)
    impl_->on_mesh_change(describe_change(before->mesh, start->mesh, result.renumbering), before->mesh);
  return result;
}

template <int Dim>
StepResult Simulation<Dim>::advance() {
  const std::shared_ptr<const State<Dim>> before =
      impl_->on_mesh_change && impl_->setup.remesh.enabled ? impl_->state : nullptr;
  impl_->own_state();
  StepResult result = take_step_in_parts(impl_->tools(), *impl_->state);
  if (!result.ok) return result;
  impl_->forces = result.forces;
  impl_->watch.look(impl_->setup, *impl_->state, result.report, impl_->logger);
  if (before && !result.renumbering.empty())
    impl_->on_mesh_change(describe_change(before->mesh, impl_->state->mesh, result.renumbering), before->mesh);
  return result;
}

template <int Dim>
StepResult Simulation<Dim>::advance(double dt) {
  impl_->set_step(dt);
  return advance();
}

template <int Dim>
Setup<Dim>& Simulation<Dim>::conditions() {
  return impl_->setup;
}

template <int Dim>
void Simulation<Dim>::on_mesh_change(std::function<void(const MeshChange<Dim>&, const Mesh<Dim>&)> listener) {
  impl_->on_mesh_change = std::move(listener);
}

template <int Dim>
Snapshot<Dim> Simulation<Dim>::save() const {
  return {impl_->state, impl_->setup.time, impl_->forces};
}

template <int Dim>
void Simulation<Dim>::restore(const Snapshot<Dim>& snapshot) {
  impl_->state = std::const_pointer_cast<State<Dim>>(snapshot.state);  // own_state() before it changes
  impl_->setup.time = snapshot.time;
  impl_->scale_tolerances();
  impl_->forces = snapshot.forces;
}

template <int Dim>
void Simulation<Dim>::restore(State<Dim> state) {
  const auto refuse = [](const std::string& place, auto found, auto expected) {
    throw InputError({"", place, std::to_string(found), std::to_string(expected)});
  };
  if (Space expected = space_of_orders(state.mesh, impl_->setup.order); state.space != expected)
    refuse("curved edges of a saved state", state.space.num_curved(), expected.num_curved());
  const auto size =
      static_cast<Eigen::Index>(Dim * (num_nodes(state.mesh, state.space) + impl_->setup.obstacles.rest.size()));
  const History& history = state.history;
  for (const auto* fields : {&history.x, &history.v, &history.a})
    for (const VectorX& field : *fields)
      if (field.size() != size) refuse("length of a saved field", field.size(), size);
  const std::size_t curved = whole_mesh(state.mesh, {}, state.space).curved_elements.size();
  if (!state.quadrature.empty() && state.quadrature.size() != curved)
    refuse("saved levels of quadrature", state.quadrature.size(), curved);
  if (history.x.empty() || history.v.empty()) refuse("saved states", history.x.size(), 1);
  if (history.a.empty() != impl_->state->history.a.empty())
    refuse("saved accelerations", history.a.size(), impl_->state->history.a.size());
  for (CellId c = 0; c < state.mesh.cell_slots(); ++c)
    if (!impl_->setup.materials.contains(state.mesh.body(c))) refuse("body of a saved cell", state.mesh.body(c), 0);
  if (!state.strata.empty() && !state.strata.find_defect(state.mesh).empty()) state.strata = {};
  impl_->state = std::make_shared<State<Dim>>(std::move(state));
  impl_->set_forces_at_rest();
}

template <int Dim>
bool Simulation<Dim>::finished() const {
  return impl_->state->step >= impl_->setup.time.steps;
}

template <int Dim>
const State<Dim>& Simulation<Dim>::state() const {
  return *impl_->state;
}

template <int Dim>
const Setup<Dim>& Simulation<Dim>::setup() const {
  return impl_->setup;
}

template <int Dim>
const NodalForces& Simulation<Dim>::forces() const {
  return impl_->forces;
}

template <int Dim>
std::string Simulation<Dim>::solver_name() const {
  return std::string(impl_->solver->name());
}

template <int Dim>
std::string Simulation<Dim>::solver_name_in_use() const {
  return std::string(impl_->solver->name_in_use());
}

namespace {

/// Where output samples a cell: its mean has the weights `share`.
template <int Dim>
struct CellPoint {
  Mat<Dim> F;
  Vec<Dim> X;
  double share;
};

/// f(material, points) for each cell in the mesh's order: one point where F is constant, those of the elastic energy's
/// quadrature in cells with curved edges.
template <int Dim, typename Function>
void for_each_cell_in_order(const CellSet<Dim>& cells, const VectorX& x, const Setup<Dim>& setup, const Function& f) {
  const auto& rule = quadrature<Dim>(setup.quadrature_degree);
  std::vector<CellPoint<Dim>> points;
  auto straight = cells.elements.begin();
  auto curved = cells.curved_elements.begin();
  const std::size_t count = cells.elements.size() + cells.curved_elements.size();
  for (std::size_t c = 0; c < count; ++c) {
    points.clear();
    if (curved == cells.curved_elements.end() || static_cast<std::size_t>(curved->cell) != c) {
      points.push_back({deformation_gradient<Dim>(*straight, x), rest_barycenter(cells, *straight), 1});
      f(setup.materials.at(straight->body), std::span<const CellPoint<Dim>>(points));
      ++straight;
      continue;
    }
    for (const auto& point : rule)
      points.push_back({at_nodes<Dim>(curved->nodes, x) * shape_gradients<Dim>(*curved, point.weights).transpose(),
                        rest_position<Dim>(cells, *curved, point.weights), point.share});
    f(setup.materials.at(curved->body), std::span<const CellPoint<Dim>>(points));
    ++curved;
  }
}

}  // namespace

template <int Dim>
typename Simulation<Dim>::FrameData Simulation<Dim>::frame_data() const {
  const State<Dim>& state = *impl_->state;
  const int bodies = num_nodes(state.mesh, state.space);
  FrameData data;
  data.x = state.history.x[0].head(Dim * bodies);
  data.v = state.history.v[0].head(Dim * bodies);
  const CellSet<Dim> cells = whole_mesh(state.mesh, {}, state.space);
  for_each_cell_in_order<Dim>(cells, data.x, impl_->setup,
                              [&](const Material& material, std::span<const CellPoint<Dim>> points) {
                                double mean = 0;
                                for (const auto& [F, X, share] : points)
                                  mean += share * elastic_density<Dim>(F, elastic_moduli<Dim>(material, X));
                                data.elastic_density.push_back(mean);
                              });
  add_asked(cells, data);
  const VectorX& all = state.history.x[0];
  for (Eigen::Index i = Dim * bodies; i < all.size(); i += Dim) data.obstacle_x.emplace_back(all.segment<Dim>(i));
  if (impl_->setup.proxy) {
    const VectorX y = proxy_map(impl_->setup, state.mesh, state.space)->positions(all);
    for (std::size_t v = 0; v < impl_->setup.proxy->rest.size(); ++v)
      data.proxy_x.emplace_back(vertex_of<Dim>(y, static_cast<int>(v)));
  }
  return data;
}

namespace {

template <int Dim>
ForceCurvePoint curve_point(const ForceSums<Dim>& sums, const std::string& name) {
  ForceCurvePoint point{name, {}};
  const std::array<const Resultant<Dim>*, 4> kinds{&sums.contact, &sums.friction, &sums.reaction, &sums.all};
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    point.kinds[k].assign(kinds[k]->force.begin(), kinds[k]->force.end());
    point.kinds[k].insert(point.kinds[k].end(), kinds[k]->moment.begin(), kinds[k]->moment.end());
  }
  return point;
}

/// Of the stress in space: zero out of the plane in plane stress, what F_zz = 1 gives in plane strain.
template <int Dim>
double von_mises(const Mat<Dim>& cauchy, double out_of_plane) {
  Mat<3> s = Mat<3>::Zero();
  s.template topLeftCorner<Dim, Dim>() = cauchy;
  if (Dim == 2) s(2, 2) = out_of_plane;
  const Mat<3> deviator = s - s.trace() / 3 * Mat<3>::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

template <int Dim>
double out_of_plane_stress(const Material& material, const Mat<Dim>& F, const Vec<Dim>& X) {
  if (Dim == 3 || !material.plane_strain) return 0;
  Mat<3> in_space = Mat<3>::Identity();
  in_space.template topLeftCorner<Dim, Dim>() = F;
  Vec<3> place = Vec<3>::Zero();
  place.template head<Dim>() = X;
  return elastic_stress<3>(in_space, elastic_moduli<3>(material, place))(2, 2) / F.determinant();
}

}  // namespace

template <int Dim>
CellStress cell_stress(const Simulation<Dim>& simulation) {
  const State<Dim>& state = simulation.state();
  const CellSet<Dim> cells = whole_mesh(state.mesh, {}, state.space);
  const VectorX x = state.history.x[0].head(Dim * num_nodes(state.mesh, state.space));
  CellStress stress;
  for_each_cell_in_order<Dim>(
      cells, x, simulation.setup(), [&](const Material& material, std::span<const CellPoint<Dim>> points) {
        Mat<Dim> cauchy = Mat<Dim>::Zero();
        double equivalent = 0;
        for (const auto& [F, X, share] : points) {
          const Mat<Dim> here = elastic_stress<Dim>(F, elastic_moduli<Dim>(material, X)) * F.transpose() / F.determinant();
          cauchy += share * here;
          equivalent += share * von_mises<Dim>(here, out_of_plane_stress<Dim>(material, F, X));
        }
        stress.von_mises.push_back(equivalent);
        for (int i = 0; i < Dim; ++i)
          for (int j = 0; j < Dim; ++j) stress.cauchy.push_back(cauchy(i, j));
      });
  return stress;
}

template CellStress cell_stress(const Simulation<2>&);
template CellStress cell_stress(const Simulation<3>&);

template <int Dim>
void Simulation<Dim>::add_asked(const CellSet<Dim>& cells, FrameData& data) const {
  const FieldOptions& options = impl_->setup.fields;
  AskedFields& asked = data.asked;
  if (options.contact_forces) asked.forces.contact = impl_->forces.contact;
  if (options.friction_forces) asked.forces.friction = impl_->forces.friction;
  if (options.reaction_forces) asked.forces.reaction = impl_->forces.reaction;
  if (options.applied_forces) asked.forces.applied = impl_->forces.applied;
  for (const ForceTarget& target : options.curves)
    asked.curves.push_back(curve_point(force_sums(*this, target), target.name));
  if (options.von_mises || options.stress) {
    CellStress stress = cell_stress(*this);
    if (options.von_mises) asked.von_mises = std::move(stress.von_mises);
    if (options.stress) asked.stress = std::move(stress.cauchy);
  }
  if (!options.kinetic_energy && !options.momentum) return;
  VectorX product = VectorX::Zero(data.v.size());
  InertiaEnergy<Dim>(cells, impl_->setup.materials, impl_->setup.lump_mass ? MassKind::lumped : MassKind::consistent,
                     VectorX::Zero(data.v.size()))
      .add_mass_product(data.v, product);
  if (options.kinetic_energy) asked.kinetic_energy = {0.5 * data.v.dot(product)};
  if (!options.momentum) return;
  asked.momentum.assign(Dim, 0);
  for (Eigen::Index i = 0; i < product.size(); ++i) asked.momentum[i % Dim] += product[i];
}

template class Simulation<2>;
template class Simulation<3>;

}  // namespace itr
