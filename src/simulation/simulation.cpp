// SPDX-License-Identifier: MIT
#include "simulation/state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/process.hpp"
#include "incoming_state.hpp"
#include "itr/core.hpp"
#include "linear/choice.hpp"
#include "simulation/flat_obstacles.hpp"
#include "simulation/frame_data.hpp"
#include "simulation/overlap.hpp"
#include "simulation/step.hpp"
#include "simulation/step_problem.hpp"
#include "unsupported.hpp"
#include "watch.hpp"

namespace itr {

namespace {

/// Where a simulation is when it calls the program.
enum class Phase { between_steps, in_step, after_mesh_change };

/// Chooses what the setup leaves open; refuses what it may not ask for.
template <int Dim>
void complete(Setup<Dim>& setup, const Logger& logger) {
  refuse_unsupported(setup);
  setup.validate();
  for (const std::string& chosen : setup.choose_defaults()) logger.info(chosen);
  setup.validate();  // what was chosen too
}

}  // namespace

template <int Dim>
struct Simulation<Dim>::Impl {
  Setup<Dim> setup;
  Logger logger;
  std::unique_ptr<linear::Solver> direct;  ///< or iterative
  std::unique_ptr<linear::ReusingSolver> solver;
  std::unique_ptr<ProblemCache<Dim>> cache;
  std::shared_ptr<State<Dim>> state;                                            ///< snapshots may share it: see change_to
  const std::shared_ptr<const char> identity = std::make_shared<const char>();  ///< of what save() gave
  mutable std::atomic<Phase> phase = Phase::between_steps;                      ///< terms are asked by several threads
  EdgeLengths initial_edges;
  NodalForces forces;                                    ///< of the last step
  ErrorFields errors;                                    ///< of them
  std::unique_ptr<ErrorEstimator<Dim>> error_estimator;  ///< null: nobody asks for error bars
  mutable std::optional<StepReport> report;              ///< empty: of the state as it stands, not made yet
  bool remeshing_is_complete = false;                    ///< its tolerances are chosen
  double first_dt = 1;                                   ///< what the setup's tolerances are for [s]
  NewtonOptions first_newton;
  std::function<void(const MeshChange<Dim>&, const Mesh<Dim>&)> on_mesh_change;
  Watch<Dim> watch;
  std::optional<FlatObstacles<Dim>> flats;
  double interference_energy = 0;  ///< [J]

  StepTools<Dim> tools() const { return {setup, initial_edges, *cache, *solver, logger, error_estimator.get()}; }

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

  /// How steps change the state. What snapshots share stays; else a reference to state() stays good, until a snapshot is
  /// restored. Returns the state before.
  std::shared_ptr<const State<Dim>> change_to(std::shared_ptr<State<Dim>> end) {
    if (state.use_count() > 1) return std::exchange(state, std::move(end));
    std::swap(*state, *end);
    return end;
  }

  /// f() with steps of this length, which is not adapted. Where it does nothing the length and what belongs to it are as
  /// before.
  template <typename F>
  StepResult with_step(double dt, F&& f) {
    const TimeOptions time_before = setup.time;
    setup.time.adaptive.enabled = false;
    const int step_before = state->step;
    std::shared_ptr<const State<Dim>> longer;  // of the history that another step cuts
    const auto put_back = [&] {
      setup.time.adaptive.enabled = time_before.adaptive.enabled;
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
      setup.time.adaptive.enabled = time_before.adaptive.enabled;
      return result;
    } catch (...) {
      put_back();
      throw;
    }
  }

  /// Gives the flat obstacles of the setup the size that they have in the state, also where a step did not lead on.
  class FlatsOfState {
   public:
    explicit FlatsOfState(Impl& impl) : impl_(impl) {}
    FlatsOfState(const FlatsOfState&) = delete;
    FlatsOfState& operator=(const FlatsOfState&) = delete;
    ~FlatsOfState() { impl_.flats->stretch(impl_.state->doublings, impl_.setup.obstacles); }

   private:
    Impl& impl_;
  };

  /// Where nodes are now, where they fly, and where they are held at the end of the step.
  std::vector<VectorX> places_of_step(const State<Dim>& before) const {
    std::vector<VectorX> places = {before.history.x[0]};
    if (setup.time.has_inertia()) places.push_back(TimeIntegrator(setup.time).predictor(before.history));
    const HeldDofs<Dim> held = held_dofs(setup, before.mesh, setup.time.time_after(before.step + 1));
    VectorX target = before.history.x[0];
    for (Eigen::Index i = 0; i < target.size(); ++i)
      if (held.held[i]) target[i] = held.target[i];
    places.push_back(std::move(target));
    return places;
  }

  /// The state before a step in which bodies come to these places: with larger flat obstacles if these must be, else null.
  std::shared_ptr<const State<Dim>> with_room(const State<Dim>& before, const std::vector<VectorX>& places, double times) {
    const std::vector<int> doublings = flats->find_doublings(before, places, times);
    if (doublings.empty()) return nullptr;
    flats->stretch(doublings, setup.obstacles);
    return std::make_shared<const State<Dim>>(flats->doubled(before, doublings, setup.obstacles));
  }

  /// take(before) makes `end` of the state before, which stays on flat obstacles: it is taken again on larger ones if bodies
  /// came near a border that was far from where they were expected.
  template <typename Take>
  StepResult step_with_room(const State<Dim>& end, const Take& take) {
    constexpr double kAhead = 3, kAtEnd = 1.1;
    std::shared_ptr<const State<Dim>> start = state;
    if (!flats->empty())
      if (auto larger = with_room(*start, places_of_step(*start), kAhead)) start = std::move(larger);
    StepResult result = take(*start);
    while (result.ok && !flats->empty()) {
      auto larger = with_room(*start, {end.history.x[0]}, kAtEnd);
      if (!larger) break;
      start = std::move(larger);
      StepReport dropped = std::move(result.report);
      result = take(*start);
      add_dropped(std::move(dropped), result.report);
    }
    return result;
  }

  void tell(const State<Dim>& before, const StepResult& result) {
    if (!on_mesh_change || result.renumbering.empty()) return;
    const Inside inside(*this, Phase::after_mesh_change);
    on_mesh_change(describe_change(before.mesh, state->mesh, result.renumbering), before.mesh);
  }

  /// Reports the state as it stands.
  StepReport report_of_state() const {
    const Inside inside(*this, Phase::in_step);  // terms and functions of conditions are asked
    StepReport made;
    made.step = state->step;
    made.t = state->t;
    made.vertices = state->mesh.num_vertices();
    made.elements = state->mesh.num_cells();
    const VectorX& x = state->history.x[0];
    StepProblem<Dim> problem(setup, state->mesh, state->history, state->t, *cache, state->stiffness, state->quadrature,
                             state->chords);
    made.unknowns = problem.dofs().num_unknowns;
    made.energy = problem.report(x);
    made.energy_before_remesh = made.energy.total;
    made.min_distance = problem.min_distance(x);
    made.min_volume_ratio = min_volume_ratio(problem.cells(), x);
    made.peak_rss_mb = peak_rss_mb();
    return made;
  }

  /// Remeshing may have been switched on since the simulation was made: its tolerances are chosen then. The state may have
  /// got curved edges since, on which remeshing knows no lumped mass.
  void complete_conditions() {
    const RemeshOptions& remesh = setup.remesh;
    if (!remesh.enabled) return;
    if (!remeshing_is_complete || setup.lump_mass) refuse_unsupported(setup);
    if (setup.lump_mass) refuse_unsupported(setup, *state);
    if (remeshing_is_complete && remesh.split.acceptance_tolerance) return;
    complete(setup, logger);
    remeshing_is_complete = true;
  }

  /// Steps from now on have this length. Returns the state before where its history was cut.
  std::shared_ptr<const State<Dim>> set_step(double dt) {
    TimeOptions& time = setup.time;
    if (!is_step_length(dt)) throw InputError({"", "dt", fmt::format("{}", dt), kStepLength});
    // A program's clock rounds: a step that differs by no more than that of times is the same.
    if (std::abs(dt - time.dt) <= 8 * std::numeric_limits<double>::epsilon() * (std::abs(state->t) + dt)) return nullptr;
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

  /// Begins an adaptive step: chooses its length, as far as it is not rejected.
  void choose_step() {
    TimeOptions& time = setup.time;
    const State<Dim>& now = *state;
    const bool has_ratio = time.integrator == Integrator::bdf && now.history.x.size() > 1;
    const StepController::Next next =
        StepController(time).next(now.control, now.t, first_dt, has_ratio ? now.history.dt : 0);
    time.t0 = now.t;
    time.first_step = now.step;
    time.dt = next.dt;
    time.adaptive.step_end = next.end;
    scale_tolerances();
  }

  void scale_tolerances() {
    if (setup.newton.norm != NewtonNorm::euclidean || setup.time.is_static) return;
    const double factor = setup.time.dt / first_dt;
    setup.newton.step_tolerance = factor * first_newton.step_tolerance;
    setup.newton.gradient_tolerance = factor * first_newton.gradient_tolerance;
    setup.newton.first_gradient_tolerance = factor * first_newton.first_gradient_tolerance;
  }

  /// Sets the forces of a state that no step of this simulation led to.
  void set_forces_at_rest() {
    errors = {};
    if (!setup.fields.any_forces()) return;
    const Inside inside(*this, Phase::in_step);
    StepProblem<Dim> problem(setup, state->mesh, state->history, state->t, *cache, state->stiffness, state->quadrature,
                             state->chords);
    forces = problem.forces_at_start(state->history.x[0]);
  }

  /// Adds to forces what edits changed of the momentum in a step.
  void add_remeshing(const StepReport& report, NodalForces& to) const {
    if (setup.fields.any_forces()) add_changes(report.remeshing, 1 / setup.time.dt, to.remeshing);
  }
};

template <int Dim>
// NOLINTNEXTLINE(performance-unnecessary-value-param): the setup is moved
Simulation<Dim>::Simulation(Setup<Dim> setup, linear::Registry& registry, Logger logger) : impl_(std::make_unique<Impl>()) {
  complete(setup, logger);
  impl_->remeshing_is_complete = setup.remesh.enabled;
  impl_->setup = std::move(setup);
  impl_->logger = std::move(logger);
  const LinearOptions& linear = impl_->setup.linear;
  impl_->direct =
      linear::choose_solver(linear, impl_->setup.newton.indefinite == IndefiniteHessian::accept, registry, impl_->logger);
  impl_->solver = std::make_unique<linear::ReusingSolver>(*impl_->direct);
  impl_->cache = std::make_unique<ProblemCache<Dim>>(*impl_->solver);
  if (impl_->setup.fields.error_bars) impl_->error_estimator = std::make_unique<ErrorEstimator<Dim>>(*impl_->solver);
  impl_->first_dt = impl_->setup.time.dt;
  impl_->first_newton = impl_->setup.newton;
  auto state = std::make_shared<State<Dim>>(initial_state(impl_->setup));
  impl_->initial_edges = edge_lengths(state->mesh);
  if (impl_->setup.contact.resolve_overlap) {
    // A solver of its own: steps find theirs as they would without an overlap.
    const auto direct =
        linear::choose_solver(linear, impl_->setup.newton.indefinite == IndefiniteHessian::accept, registry, Logger());
    linear::ReusingSolver solver(*direct);
    ProblemCache<Dim> cache(solver);
    impl_->interference_energy =
        resolve_overlap<Dim>({impl_->setup, impl_->initial_edges, cache, solver, impl_->logger}, *state);
  }
  refuse_intersections(impl_->setup, *state);
  refuse_open_ties(impl_->setup, *state);
  if (impl_->setup.consistent_initial_acceleration && !state->history.a.empty())
    set_consistent_acceleration(impl_->setup, *state, *impl_->cache);
  impl_->state = std::move(state);
  impl_->flats.emplace(impl_->setup.obstacles);
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
  impl_->complete_conditions();
  if (impl_->setup.on_iteration) report();  // which it may ask for
  std::shared_ptr<const State<Dim>> before;
  StepResult result = impl_->with_step(dt, [&] {
    const typename Impl::Inside inside(*impl_, Phase::in_step);
    State<Dim> end;
    const auto start = std::make_shared<State<Dim>>();
    const typename Impl::FlatsOfState flats(*impl_);
    StepResult adapted =
        impl_->step_with_room(end, [&](const State<Dim>& now) { return take_step(impl_->tools(), now, end, start.get()); });
    if (!adapted.ok || adapted.renumbering.empty()) return adapted;
    before = impl_->change_to(start);
    impl_->set_forces_at_rest();
    impl_->add_remeshing(adapted.report, impl_->forces);
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
  impl_->complete_conditions();
  if (impl_->setup.time.adaptive.enabled) impl_->choose_step();
  if (impl_->setup.on_iteration) report();
  StepResult result;
  std::shared_ptr<const State<Dim>> before;
  {
    const typename Impl::Inside inside(*impl_, Phase::in_step);
    auto end = std::make_shared<State<Dim>>();
    const typename Impl::FlatsOfState flats(*impl_);
    result = impl_->step_with_room(*end, [&](const State<Dim>& now) { return take_step(impl_->tools(), now, *end); });
    if (!result.ok) return result;
    before = impl_->change_to(std::move(end));
  }
  if (result.report.dt > 0) impl_->setup.time.dt = result.report.dt;  // the trials before may have been longer
  impl_->add_remeshing(result.report, result.forces);
  impl_->forces = result.forces;
  impl_->errors = result.errors;
  impl_->report = result.report;
  impl_->watch.look(impl_->setup, *impl_->state, result.report, result.forces, impl_->logger);
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
Snapshot<Dim> Simulation<Dim>::save() const {
  return {impl_->state, impl_->setup.time, impl_->forces, impl_->report, impl_->errors, impl_->identity};
}

template <int Dim>
void Simulation<Dim>::restore(const Snapshot<Dim>& snapshot) {
  impl_->refuse_in_callback("restore");
  if (snapshot.owner != impl_->identity)
    throw InputError({"", "saved state", "one of another simulation", "one that this simulation has saved"});
  impl_->state = std::const_pointer_cast<State<Dim>>(snapshot.state);  // change_to leaves it as it is
  impl_->flats->stretch(impl_->state->doublings, impl_->setup.obstacles);
  impl_->setup.time = snapshot.time;
  impl_->scale_tolerances();
  impl_->forces = snapshot.forces;
  impl_->errors = snapshot.errors;
  impl_->report = snapshot.report;
}

template <int Dim>
void Simulation<Dim>::restore(const State<Dim>& state) {
  impl_->refuse_in_callback("restore");
  refuse_misfit(impl_->setup, state);
  if (!impl_->state->mesh.has_nodes() && state.mesh.has_nodes()) refuse_unsupported(impl_->setup, state);
  auto copy = std::make_shared<State<Dim>>(state);
  if (!copy->strata.empty() && !copy->strata.find_defect(copy->mesh).empty()) copy->strata = {};
  impl_->change_to(std::move(copy));
  impl_->flats->stretch(impl_->state->doublings, impl_->setup.obstacles);
  impl_->report.reset();
  impl_->set_forces_at_rest();
}

template <int Dim>
bool Simulation<Dim>::finished() const {
  return impl_->setup.time.is_over(impl_->state->step, impl_->state->t);
}

template <int Dim>
double Simulation<Dim>::time() const {
  return impl_->state->t;
}

template <int Dim>
int Simulation<Dim>::steps() const {
  return impl_->state->step;
}

template <int Dim>
const Mesh<Dim>& Simulation<Dim>::mesh() const {
  return impl_->state->mesh;
}

template <int Dim>
ConstVectorView Simulation<Dim>::positions() const {
  return impl_->state->history.x[0].head(Dim * mesh().num_nodes());
}

template <int Dim>
ConstVectorView Simulation<Dim>::velocities() const {
  return impl_->state->history.v[0].head(Dim * mesh().num_nodes());
}

template <int Dim>
const State<Dim>& Simulation<Dim>::state() const {
  return *impl_->state;
}

template <int Dim>
void Simulation<Dim>::observe(const std::function<void(const FrameView<Dim>&)>& observer) const {
  observe(save(), observer);
}

template <int Dim>
void Simulation<Dim>::observe(const Snapshot<Dim>& snapshot,
                              const std::function<void(const FrameView<Dim>&)>& observer) const {
  const Setup<Dim>& setup = impl_->setup;
  const FrameData<Dim> data = frame_data(setup, *snapshot.state, snapshot.forces, snapshot.errors);
  FrameView<Dim> frame{snapshot.state->mesh,      data.x,          data.v,
                       data.elastic_density,      data.obstacle_x, setup.obstacles.edges,
                       setup.obstacles.triangles, &data.asked};
  frame.names = &setup.names;
  frame.dhat = setup.contact.reach_of_closed();
  if (setup.proxy) frame.proxy = {&data.proxy_x, &setup.proxy->edges, &setup.proxy->triangles};
  observer(frame);
}

template <int Dim>
const Setup<Dim>& Simulation<Dim>::setup() const {
  return impl_->setup;
}

template <int Dim>
double Simulation<Dim>::interference_energy() const {
  return impl_->interference_energy;
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

template class Simulation<2>;
template class Simulation<3>;

}  // namespace itr
