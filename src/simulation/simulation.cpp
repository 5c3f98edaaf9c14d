// SPDX-License-Identifier: MIT
#include "itr/simulation/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <utility>

#include "cell_stress.hpp"
#include "initial_acceleration.hpp"
#include "itr/core/error.hpp"
#include "itr/core/process.hpp"
#include "itr/linear/choice.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/simulation/invariants.hpp"
#include "itr/simulation/resultant.hpp"
#include "itr/simulation/step.hpp"
#include "unsupported.hpp"
#include "watch.hpp"

namespace itr {

namespace {

template <int Dim>
std::string describe(const Vec<Dim>& p) {
  std::string text = "(";
  for (int c = 0; c < Dim; ++c) text += (c ? ", " : "") + std::to_string(p[c]);
  return text + ")";
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

[[noreturn]] void refuse_state(const std::string& place, const std::string& found, const std::string& expected) {
  throw InputError({"", place, found, expected});
}

void require_size(const std::string& place, std::size_t found, std::size_t expected) {
  if (found != expected) refuse_state(place, std::to_string(found), std::to_string(expected));
}

void require_finite(const std::string& place, const VectorX& field) {
  for (Eigen::Index i = 0; i < field.size(); ++i)
    if (!std::isfinite(field[i]))
      refuse_state(place + "[" + std::to_string(i) + "]", fmt::format("{}", field[i]), "a number");
}

/// How many past states there are, and how long they are.
template <int Dim>
void check_history(const Setup<Dim>& setup, const State<Dim>& state) {
  const TimeIntegrator integrator(setup.time);
  const History& history = state.history;
  if (history.x.empty() || history.x.size() > static_cast<std::size_t>(integrator.depth()))
    refuse_state("saved positions", std::to_string(history.x.size()) + " past states",
                 fmt::format("1 to {}, as the integrator remembers", integrator.depth()));
  require_size("past states of saved velocities", history.v.size(), history.x.size());
  require_size("past states of saved accelerations", history.a.size(),
               integrator.uses_acceleration() ? history.x.size() : 0);
  const auto size = static_cast<std::size_t>(Dim) *
                    (static_cast<std::size_t>(num_nodes(state.mesh, state.space)) + setup.obstacles.rest.size());
  const auto check = [&](const std::string& name, const VectorX& field) {
    require_size("length of saved " + name, static_cast<std::size_t>(field.size()), size);
    require_finite("saved " + name, field);
  };
  for (const VectorX& x : history.x) check("positions", x);
  for (const VectorX& v : history.v) check("velocities", v);
  for (const VectorX& a : history.a) check("accelerations", a);
  if (state.deviation.size() > 0) check("deviation", state.deviation);
}

/// Throws InputError for a state that no steps of this setup lead to.
template <int Dim>
void refuse_misfit(const Setup<Dim>& setup, const State<Dim>& state) {
  const Mesh<Dim>& mesh = state.mesh;
  if (mesh.num_vertices() != mesh.vertex_slots() || mesh.num_cells() != mesh.cell_slots())
    refuse_state("saved mesh", "dead slots", "a compact mesh");
  const bool may_differ =
      setup.remesh.enabled && (setup.remesh.curve.enabled || !space_of_orders(mesh, setup.order).is_linear());
  if (may_differ) {
    for (const auto& [a, b] : state.space.curved_edges())
      if (a < 0 || b <= a || b >= mesh.vertex_slots() || !mesh.are_joined(a, b))
        refuse_state("curved edges of a saved state", fmt::format("{}-{}", a, b), "an edge of the mesh");
  } else if (const Space expected = space_of_orders(mesh, setup.order); state.space != expected)
    refuse_state("curved edges of a saved state", fmt::format("{}, others than the setup's", state.space.num_curved()),
                 std::to_string(expected.num_curved()));
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (!setup.materials.contains(mesh.body(c)))
      refuse_state("body of a saved cell", std::to_string(mesh.body(c)), "one that has a material");
  check_history(setup, state);
  if (!state.quadrature.empty())
    require_size("saved levels of quadrature", state.quadrature.size(),
                 whole_mesh(mesh, {}, state.space).curved_elements.size());
  if (state.step < 0) refuse_state("saved step", std::to_string(state.step), "0 or more");
  for (const auto& [name, value] : {std::pair("time", state.t), std::pair("created energy", state.created_energy),
                                    std::pair("barrier stiffness", state.stiffness.value)})
    if (!std::isfinite(value)) refuse_state(std::string("saved ") + name, fmt::format("{}", value), "a number");
  for (std::size_t age = 0; age < state.history.x.size(); ++age)
    if (const std::string violation = find_violation(setup, mesh, state.history.x[age], state.space); !violation.empty())
      refuse_state(age == 0 ? "saved positions" : fmt::format("saved positions of {} steps before", age), violation,
                   "positions without inversions and intersections");
}

/// Where a simulation is when it calls the program.
enum class Phase { between_steps, in_step, after_mesh_change };

}  // namespace

template <int Dim>
struct Simulation<Dim>::Impl {
  Setup<Dim> setup;
  Logger logger;
  std::unique_ptr<linear::Solver> direct;  ///< or iterative
  std::unique_ptr<linear::ReusingSolver> solver;
  std::unique_ptr<ProblemCache<Dim>> cache;
  std::shared_ptr<State<Dim>> state;  ///< snapshots may share it: see change_to
  std::uint64_t mesh_revision = 0;
  const std::shared_ptr<const char> identity = std::make_shared<const char>();  ///< of what save() gave
  mutable std::atomic<Phase> phase = Phase::between_steps;                      ///< terms are asked by several threads
  EdgeLengths initial_edges;
  NodalForces forces;                        ///< of the last step
  mutable std::optional<StepReport> report;  ///< empty: of the state as it stands, not made yet
  double first_dt = 1;                       ///< what the setup's tolerances are for [s]
  NewtonOptions first_newton;
  std::function<void(const MeshChange<Dim>&, const Mesh<Dim>&)> on_mesh_change;
  Watch<Dim> watch;

  StepTools<Dim> tools() const { return {setup, initial_edges, *cache, *solver, logger}; }

  /// While a step is taken, or a listener told of it.
  class Inside {
   public:
    Inside(const Impl& impl, Phase phase) : impl_(impl), before_(impl.phase.exchange(phase)) {}
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;
    ~Inside() { impl_.phase = before_; }

   private:
    const Impl& impl_;
    Phase before_;
  };

  /// `what` the program may not do while a step refers to what it would change.
  void refuse_in_step(const char* what) const {
    if (phase == Phase::in_step) throw InputError({"", what, "a call from inside of a step", "one between steps"});
  }
  /// `what` it may not do from a listener of mesh changes either.
  void refuse_in_callback(const char* what) const {
    refuse_in_step(what);
    if (phase != Phase::between_steps)
      throw InputError({"", what, "a call from inside of a listener of mesh changes", "one between steps"});
  }

  /// The only way in which the state changes. What snapshots share stays; else a reference to state() stays good. Returns
  /// the state before.
  std::shared_ptr<const State<Dim>> change_to(std::shared_ptr<State<Dim>> end) {
    if (state.use_count() > 1) return std::exchange(state, std::move(end));
    std::swap(*state, *end);
    return end;
  }

  /// f() with steps of this length. Where it does nothing the length and what belongs to it are as before.
  template <typename F>
  StepResult with_step(double dt, F&& f) {
    const TimeOptions time_before = setup.time;
    const int step_before = state->step;
    std::shared_ptr<const State<Dim>> longer;  // of the history that another step cuts
    const auto put_back = [&] {
      if (state->step != step_before) return;  // it was done before a listener threw
      if (longer) change_to(std::make_shared<State<Dim>>(*longer));
      if (setup.time.dt == time_before.dt) return;
      setup.time = time_before;
      scale_tolerances();
    };
    try {
      longer = set_step(dt);
      StepResult result = f();
      if (!result.ok) put_back();
      return result;
    } catch (...) {
      put_back();
      throw;
    }
  }

  void tell(const State<Dim>& before, const StepResult& result) {
    if (!on_mesh_change || result.renumbering.empty()) return;
    const Inside inside(*this, Phase::after_mesh_change);
    on_mesh_change(describe_change(before.mesh, state->mesh, result.renumbering), before.mesh);
  }

  /// Of the state as it stands.
  StepReport report_of_state() const {
    const Inside inside(*this, Phase::in_step);  // terms and functions of conditions are asked
    StepReport made;
    made.step = state->step;
    made.t = state->t;
    made.vertices = state->mesh.num_vertices();
    made.elements = state->mesh.num_cells();
    const VectorX& x = state->history.x[0];
    StepProblem<Dim> problem(setup, state->mesh, state->space, state->history, state->t, *cache, state->stiffness,
                             state->quadrature);
    made.unknowns = problem.dofs().num_unknowns;
    made.energy = problem.report(x);
    made.energy_before_remesh = made.energy.total;
    made.min_distance = problem.min_distance(x);
    made.min_volume_ratio = min_volume_ratio(problem.cells(), x);
    made.peak_rss_mb = peak_rss_mb();
    return made;
  }

  /// Steps from now on have this length. Returns the state before where its history was cut.
  std::shared_ptr<const State<Dim>> set_step(double dt) {
    TimeOptions& time = setup.time;
    if (!(dt > 0) || !std::isfinite(dt)) throw InputError({"", "dt", fmt::format("{}", dt), "a number > 0"});
    if (dt == time.dt) return nullptr;
    time.t0 = state->t;
    time.first_step = state->step;
    time.dt = dt;
    scale_tolerances();
    if (time.integrator != Integrator::bdf || state->history.x.size() == 1) return nullptr;
    auto shorter = std::make_shared<State<Dim>>(*state);
    shorter->history.x.resize(1);
    shorter->history.v.resize(1);
    return change_to(std::move(shorter));
  }

  void scale_tolerances() {
    if (setup.newton.norm != NewtonNorm::euclidean || setup.time.is_static) return;
    const double factor = setup.time.dt / first_dt;
    setup.newton.step_tolerance = factor * first_newton.step_tolerance;
    setup.newton.gradient_tolerance = factor * first_newton.gradient_tolerance;
    setup.newton.first_gradient_tolerance = factor * first_newton.first_gradient_tolerance;
  }

  /// Those of a state that no step of this simulation led to.
  void set_forces_at_rest() {
    if (!setup.fields.any_forces()) return;
    const Inside inside(*this, Phase::in_step);
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
  setup.validate();  // what was chosen too
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
  auto state = std::make_shared<State<Dim>>(initial_state(impl_->setup));
  impl_->initial_edges = edge_lengths(state->mesh);
  refuse_intersections(impl_->setup, *state);
  if (impl_->setup.consistent_initial_acceleration && !state->history.a.empty())
    set_consistent_acceleration(impl_->setup, *state, *impl_->cache);
  impl_->state = std::move(state);
  impl_->set_forces_at_rest();
}

template <int Dim>
Simulation<Dim>::~Simulation() = default;
template <int Dim>
Simulation<Dim>::Simulation(Simulation&&) noexcept = default;

template <int Dim>
const StepReport& Simulation<Dim>::report() const {
  if (!impl_->report) {
    impl_->refuse_in_step("report");
    impl_->report = impl_->report_of_state();
  }
  return *impl_->report;
}

template <int Dim>
StepResult Simulation<Dim>::adapt(double dt) {
  impl_->refuse_in_callback("adapt");
  if (impl_->setup.on_iteration) report();  // which it may ask for
  std::shared_ptr<const State<Dim>> before;
  StepResult result = impl_->with_step(dt, [&] {
    const typename Impl::Inside inside(*impl_, Phase::in_step);
    State<Dim> end;
    const auto start = std::make_shared<State<Dim>>();
    StepResult adapted = take_step(impl_->tools(), *impl_->state, end, false, start.get());
    if (!adapted.ok || adapted.renumbering.empty()) return adapted;
    before = impl_->change_to(start);
    ++impl_->mesh_revision;
    impl_->set_forces_at_rest();
    return adapted;
  });
  if (!result.ok) return result;
  impl_->report = impl_->report_of_state();
  impl_->report->add_effort(result.report);
  if (before) impl_->tell(*before, result);
  return result;
}

template <int Dim>
StepResult Simulation<Dim>::advance() {
  impl_->refuse_in_callback("step");
  if (impl_->setup.on_iteration) report();
  StepResult result;
  std::shared_ptr<const State<Dim>> before;
  {
    const typename Impl::Inside inside(*impl_, Phase::in_step);
    auto end = std::make_shared<State<Dim>>();
    result = take_step_in_parts(impl_->tools(), *impl_->state, *end);
    if (!result.ok) return result;
    before = impl_->change_to(std::move(end));
  }
  impl_->forces = result.forces;
  impl_->report = result.report;
  impl_->watch.look(impl_->setup, *impl_->state, result.report, impl_->logger);
  if (!result.renumbering.empty()) ++impl_->mesh_revision;
  impl_->tell(*before, result);
  return result;
}

template <int Dim>
StepResult Simulation<Dim>::advance(double dt) {
  impl_->refuse_in_callback("step");
  return impl_->with_step(dt, [&] { return advance(); });
}

template <int Dim>
Setup<Dim>& Simulation<Dim>::conditions() {
  impl_->refuse_in_step("conditions");
  return impl_->setup;
}

template <int Dim>
void Simulation<Dim>::on_mesh_change(std::function<void(const MeshChange<Dim>&, const Mesh<Dim>&)> listener) {
  impl_->refuse_in_callback("listener of mesh changes");
  impl_->on_mesh_change = std::move(listener);
}

template <int Dim>
std::uint64_t Simulation<Dim>::mesh_revision() const {
  return impl_->mesh_revision;
}

template <int Dim>
Snapshot<Dim> Simulation<Dim>::save() const {
  return {impl_->state, impl_->setup.time, impl_->forces, impl_->report, impl_->identity};
}

template <int Dim>
void Simulation<Dim>::restore(const Snapshot<Dim>& snapshot) {
  impl_->refuse_in_callback("restore");
  if (snapshot.owner != impl_->identity)
    refuse_state("saved state", "one of another simulation", "one that this simulation has saved");
  impl_->state = std::const_pointer_cast<State<Dim>>(snapshot.state);  // change_to leaves it as it is
  ++impl_->mesh_revision;
  impl_->setup.time = snapshot.time;
  impl_->scale_tolerances();
  impl_->forces = snapshot.forces;
  impl_->report = snapshot.report;
}

template <int Dim>
void Simulation<Dim>::restore(State<Dim> state) {
  impl_->refuse_in_callback("restore");
  refuse_misfit(impl_->setup, state);
  if (!state.strata.empty() && !state.strata.find_defect(state.mesh).empty()) state.strata = {};
  impl_->change_to(std::make_shared<State<Dim>>(std::move(state)));
  ++impl_->mesh_revision;
  impl_->report.reset();
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
typename Simulation<Dim>::FrameData Simulation<Dim>::frame_data(const State<Dim>& state, const NodalForces& forces) const {
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
  data.asked.forces = forces;
  add_asked(cells, state, data);
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

namespace {

template <int Dim>
CellStress stress_of(const CellSet<Dim>& cells, const VectorX& x, const Setup<Dim>& setup) {
  CellStress stress;
  for_each_cell_in_order<Dim>(cells, x, setup, [&](const Material& material, std::span<const CellPoint<Dim>> points) {
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

}  // namespace

template <int Dim>
CellStress cell_stress(const Simulation<Dim>& simulation) {
  const State<Dim>& state = simulation.state();
  const VectorX x = state.history.x[0].head(Dim * num_nodes(state.mesh, state.space));
  return stress_of<Dim>(whole_mesh(state.mesh, {}, state.space), x, simulation.setup());
}

template CellStress cell_stress(const Simulation<2>&);
template CellStress cell_stress(const Simulation<3>&);

template <int Dim>
void Simulation<Dim>::add_asked(const CellSet<Dim>& cells, const State<Dim>& state, FrameData& data) const {
  const FieldOptions& options = impl_->setup.fields;
  AskedFields& asked = data.asked;
  const NodalForces all = std::exchange(asked.forces, {});
  if (options.contact_forces) asked.forces.contact = all.contact;
  if (options.friction_forces) asked.forces.friction = all.friction;
  if (options.reaction_forces) asked.forces.reaction = all.reaction;
  if (options.applied_forces) asked.forces.applied = all.applied;
  for (const ForceTarget& target : options.curves)
    asked.curves.push_back(curve_point(force_sums(state, all, target), target.name));
  if (options.von_mises || options.stress) {
    CellStress stress = stress_of<Dim>(cells, data.x, impl_->setup);
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
