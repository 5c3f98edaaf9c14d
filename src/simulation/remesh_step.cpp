// SPDX-License-Identifier: MIT
#include "simulation/remesh_step.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "core/profile.hpp"
#include "core/timer.hpp"
#include "energy/cavity.hpp"
#include "energy/inertia.hpp"
#include "geometry/bvh.hpp"
#include "itr/energy.hpp"
#include "itr/transfer.hpp"
#include "remesh/remesher.hpp"
#include "simulation/history_transfer.hpp"
#include "simulation/moment.hpp"
#include "simulation/shape_step.hpp"
#include "simulation/state.hpp"
#include "time/integrator.hpp"

namespace itr {

namespace {

template <int Dim>
struct Momentum {
  Vec<Dim> linear = Vec<Dim>::Zero();
  Vec<Dim == 2 ? 1 : 3> angular = Vec < Dim == 2 ? 1 : 3 > ::Zero();
};

/// Momentum by body, of some bodies, whose nodes move with v.
template <int Dim>
std::map<int, Momentum<Dim>> momenta_of(const StepSetup<Dim>& setup, const CellSet<Dim>& cells, const std::set<int>& bodies,
                                        const VectorX& x, const VectorX& v) {
  std::map<int, Momentum<Dim>> momenta;
  for (const int body : bodies) momenta[body];
  const InertiaEnergy<Dim> inertia(cells, setup.materials, setup.lump_mass ? MassKind::lumped : MassKind::consistent,
                                   VectorX::Zero(v.size()));
  inertia.for_each_mass([&](int body, const auto& nodes, const auto& mass) {
    const auto found = momenta.find(body);
    if (found == momenta.end()) return;
    const auto product = (at_nodes<Dim>(nodes, v) * mass).eval();
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const Vec<Dim> p = product.col(static_cast<Eigen::Index>(k));
      found->second.linear += p;
      found->second.angular += moment(Vec<Dim>(x.segment<Dim>(Dim * nodes[k])), p);
    }
  });
  return momenta;
}

/// Changes by edits, between two states at the start of a step, of the momentum that bodies would have at its end without
/// forces: for the bodies of `touched`, as an impulse over the step.
template <int Dim>
std::vector<MomentumChange> momentum_changes(const StepSetup<Dim>& setup, const State<Dim>& before, const State<Dim>& after,
                                             const TouchedCells& touched) {
  if (!setup.time.has_inertia()) return {};
  std::set<int> bodies;
  for (const CellId c : touched.old_cells) bodies.insert(before.mesh.body(c));
  for (const CellId c : touched.new_cells) bodies.insert(after.mesh.body(c));
  // The integrator's acceleration from the history is linear in the end velocity, of which none is left here.
  const auto momenta = [&](const State<Dim>& state) {
    const Eigen::Index dofs = Eigen::Index{Dim} * state.mesh.num_nodes();
    const VectorX& x = state.history.x[0];
    const VectorX free = -setup.time.dt * TimeIntegrator(setup.time).acceleration(VectorX::Zero(x.size()), state.history);
    return momenta_of<Dim>(setup, whole_mesh(state.mesh, {}), bodies, x.head(dofs), free.head(dofs));
  };
  const auto were = momenta(before), are = momenta(after);
  std::vector<MomentumChange> changes;
  for (const int body : bodies) {
    const Vec<Dim> linear = are.at(body).linear - were.at(body).linear;
    const Vec<Dim == 2 ? 1 : 3> angular = are.at(body).angular - were.at(body).angular;
    changes.push_back({body, {linear.begin(), linear.end()}, {angular.begin(), angular.end()}});
  }
  return changes;
}

/// Fraction of the mass times the size of the bodies that round-off explains: less is not told.
constexpr double kLossWorthTelling = 1e-12;

/// The bodies' part of a field over bodies and obstacles.
VectorX head_of(const VectorX& field, int dofs) { return field.head(dofs); }

void tell_operations(const RemeshReport& remeshed, double split_tolerance, double scaling, StepReport& report) {
  report.split_tolerance = split_tolerance;
  report.best_refused_split = remeshed.best_refused_gain / scaling;
  report.splits = remeshed.splits;
  report.curves = remeshed.curves;
  report.straightens = remeshed.straightens;
  report.collapses = remeshed.collapses;
  report.swaps = remeshed.swaps;
  report.smooths = remeshed.smooths;
  report.trial_seconds = remeshed.trial_seconds;
  report.bound_by_dhat = remeshed.splits.refused_by(Refusal::dhat);
}

/// Levels of quadrature from those by element with curved edges to those by cell; empty where all are 0.
template <int Dim>
QuadratureLevels levels_by_cell(const State<Dim>& state) {
  if (state.quadrature.empty()) return {};
  QuadratureLevels levels(state.mesh.cell_slots(), 0);
  std::size_t next = 0;
  for (CellId c = 0; c < state.mesh.cell_slots(); ++c)
    if (state.mesh.is_axisymmetric() || state.mesh.is_curved(c)) levels[c] = state.quadrature[next++];
  return levels;
}

/// And back, on the mesh that has been made compact.
template <int Dim>
QuadratureLevels levels_by_element(const QuadratureLevels& by_slot, const std::vector<CellId>& number,
                                   const State<Dim>& state) {
  if (by_slot.empty()) return {};
  std::vector<std::uint8_t> by_cell(state.mesh.cell_slots(), 0);
  for (std::size_t slot = 0; slot < by_slot.size(); ++slot)
    if (number[slot] != kNone) by_cell[number[slot]] = by_slot[slot];
  QuadratureLevels levels;
  for (CellId c = 0; c < state.mesh.cell_slots(); ++c)
    if (state.mesh.is_axisymmetric() || state.mesh.is_curved(c)) levels.push_back(by_cell[c]);
  return levels;
}

/// Gives curves that are still there their chords.
template <int Dim>
ChordLevels carried_chords(const State<Dim>& before, const std::vector<VertexId>& number, const State<Dim>& state) {
  const Mesh<Dim>& mesh = state.mesh;
  ChordLevels levels(before.chords.empty() ? 0 : mesh.num_curved(), 0);
  for (std::size_t i = 0; i < before.chords.size(); ++i) {
    const auto [a, b] = before.mesh.edge_of_node(before.mesh.num_vertices() + static_cast<int>(i));
    if (number[a] == kNone || number[b] == kNone) continue;
    if (const int node = mesh.node_of(number[a], number[b]); node != kNone)
      levels[node - mesh.num_vertices()] = before.chords[i];
  }
  return levels;
}

template <int Dim>
std::vector<Vec<Dim>> as_points(const VectorX& field, int first) {
  std::vector<Vec<Dim>> points;
  for (Eigen::Index i = Dim * first; i < field.size(); i += Dim) points.emplace_back(field.segment<Dim>(i));
  return points;
}

template <int Dim>
StepContext<Dim> make_context(const StepTools<Dim>& tools, const State<Dim>& state, const StepProblem<Dim>& problem,
                              const VectorX& x, const EnergyReport& energy) {
  const StepSetup<Dim>& setup = tools.setup;
  const TimeIntegrator integrator(setup.time);
  StepContext<Dim> context;
  static_cast<PotentialTerms<Dim>&>(context) = potential_terms(setup, state.history, state.t, state.mesh.is_axisymmetric());
  // Patches see a cavity's pressure as it is: what they move hardly changes its volume.
  const CellSet<Dim> cells = context.loads.cavities.empty() ? CellSet<Dim>() : whole_mesh(state.mesh, setup.obstacles.rest);
  for (const CavityLoad& cavity : std::exchange(context.loads.cavities, {}))
    for (const int tag : cavity.surfaces)
      context.loads.pressures.emplace_back(
          tag, [p = CavityEnergy<Dim>(cells, cavity, 1).pressure(x)](const RestPoint<Dim>&) { return p; });
  for (auto& traction : problem.tie_tractions()) context.loads.tractions.push_back(std::move(traction));
  for (auto& traction : problem.coupling_tractions(x)) context.loads.tractions.push_back(std::move(traction));
  if (setup.time.has_inertia())  // past positions and velocities would have gaps on other meshes
    for (const Tie& tie : setup.ties)
      for (const auto* side : {&tie.a, &tie.b})
        context.kept_surfaces.insert(context.kept_surfaces.end(), side->begin(), side->end());
  context.held_components = held_components(setup);
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads))
    for (const int tag : coupling->surfaces) {
      if (coupling->is_rigid) context.held_components[tag].fill(true);
      if (coupling->is_rigid || (setup.time.has_inertia() && (coupling->is_held() || coupling->mass > 0)))
        context.kept_surfaces.push_back(tag);
    }
  if (setup.follower.forces) {
    const int dofs = Dim * state.mesh.num_nodes();
    VectorX forces = VectorX::Zero(dofs);
    setup.follower.forces(state.mesh, x.head(dofs), state.t, forces);
    context.host.push_back(point_forces<Dim>(state.mesh, forces));
  }
  context.contact.barrier_stiffness = problem.stiffness().value;  // that of the moment, where it is adaptive
  context.contact.friction_velocity = problem.friction_velocity();
  context.newton = setup.newton;
  context.shortest_edge = tools.initial_edges.shortest;
  context.longest_edge = tools.initial_edges.longest;
  // Corrections of the convergent form have negative weights, so that its energy may fall below 0.
  if (!setup.contact.convergent || energy.contact == 0)
    context.coupling = context.scaling * (energy.contact + energy.friction);
  const int bodies = state.mesh.num_nodes();
  auto& obstacles = context.obstacles;
  obstacles.rest = setup.obstacles.rest;
  obstacles.edges = setup.obstacles.edges;
  obstacles.triangles = setup.obstacles.triangles;
  obstacles.x = as_points<Dim>(x, bodies);
  obstacles.velocity_reference = as_points<Dim>(integrator.velocity_reference(state.history), bodies);
  for (const auto& past : state.history.x) obstacles.past_x.push_back(as_points<Dim>(past, bodies));
  return context;
}

template <int Dim>
RemeshFields<Dim> make_fields(const StepSetup<Dim>& setup, const PotentialTerms<Dim>& terms, const State<Dim>& state,
                              const VectorX& x) {
  const int dofs = Dim * state.mesh.num_nodes();
  const TimeIntegrator integrator(setup.time);
  RemeshFields<Dim> fields;
  fields.x = head_of(x, dofs);
  fields.levels = levels_by_cell(state);
  if (is_in(TermKind::inertia, terms)) fields.predictor = head_of(integrator.predictor(state.history), dofs);
  if (needs_velocities(terms)) fields.velocity_reference = head_of(integrator.velocity_reference(state.history), dofs);
  for (const auto& past : state.history.x) fields.past_positions.push_back(head_of(past, dofs));
  for (const auto& past : state.history.v) fields.past_rates.push_back(head_of(past, dofs));
  for (const auto& past : state.history.a) fields.past_rates.push_back(head_of(past, dofs));
  return fields;
}

/// The tolerances that follow the energy stored so far.
template <int Dim>
RemeshOptions options_of_step(const StepSetup<Dim>& setup, double stored_energy) {
  constexpr double kLeast = 1e-6;  // of the tolerance for strains of a tenth: those of 1e-4
  RemeshOptions options = setup.remesh;
  const FollowsStoredEnergy& follows = setup.follows_stored_energy;
  if (!follows.split) return options;
  const double split = *options.split.acceptance_tolerance;
  const double fraction = std::clamp(kStoredFraction * options.relative_tolerance * stored_energy / split, kLeast, 1.0);
  options.split.acceptance_tolerance = fraction * split;
  const auto scale = [fraction](std::optional<double>& tolerance, bool follows_too) {
    if (follows_too) tolerance = fraction * *tolerance;
  };
  scale(options.collapse.acceptance_tolerance, follows.collapse);
  scale(options.swap.acceptance_tolerance, follows.swap);
  scale(options.smooth.acceptance_tolerance, follows.smooth);
  return options;
}

/// Mass of the bodies times the diameter of where they are [kg m].
template <int Dim>
double mass_moment(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x) {
  double mass = 0;
  for (int c = 0; c < mesh.cell_slots(); ++c) mass += setup.materials.at(mesh.body(c)).density * mesh.volume(c);
  Box<Dim> box;
  for (int v = 0; v < mesh.num_vertices(); ++v) box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
  return mass * (box.max - box.min).norm();
}

/// Logs what the transfer could not keep.
void tell(const HistoryTransferReport& transfer, double extent, int step, const Units& units, const Logger& logger) {
  if (transfer.not_converged > 0)
    logger.warning(
        fmt::format("step {}: {} of the past positions are valid on the new mesh, but not the nearest to the old "
                    "ones: their safe projection did not converge",
                    step, transfer.not_converged));
  if (transfer.with_barriers > 0)
    logger.debug(fmt::format("step {}: barriers kept {} of the past positions valid", step, transfer.with_barriers));
  if (transfer.lost_positions > kLossWorthTelling * extent)
    logger.warning(fmt::format("step {}: the new mesh loses {} of the integral of rho x", step,
                               units.text(transfer.lost_positions, "kg m", 3)));
}

template <int Dim>
std::vector<CellId> removed_cells(const Mesh<Dim>& before, const Mesh<Dim>& now) {
  std::vector<CellId> removed;
  for (CellId c = 0; c < before.cell_slots(); ++c)
    if (!now.is_cell_alive(c)) removed.push_back(c);
  return removed;
}

/// `operate(mesh, fields, context, options, memory, strata)` on the state's mesh, and carries the state over: interpolants
/// of the history are there when `settle(renumbering)` is called, or are projected where there is none.
template <int Dim, typename Operate>
std::optional<MeshRenumbering> change_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                  const State<Dim>& before, State<Dim>& state, VectorX& x,
                                                  StepReport& report, const Operate& operate,
                                                  const std::function<void(const MeshRenumbering&)>& settle = {}) {
  const StepSetup<Dim>& setup = tools.setup;
  const StepContext<Dim> context = make_context(tools, before, problem, x, report.energy);
  RemeshFields<Dim> fields = make_fields<Dim>(setup, context, before, x);
  const RemeshOptions options =
      options_of_step(setup, std::max(before.stored_energy, report.energy.elastic + report.energy.contact));
  RemeshReport remeshed;
  {
    const ScopedTimer timer(report.seconds.remesh);
    const auto phase = ScopedPhase::coarse("remeshing");
    if (state.mesh.has_nodes() && state.strata.empty()) state.strata = Strata<Dim>(state.mesh);
    remeshed = operate(state.mesh, fields, context, options, state.remesh_memory, state.strata);
  }
  tell_operations(remeshed, *options.split.acceptance_tolerance, problem.scaling(), report);
  if (!remeshed.changed()) return std::nullopt;

  const ScopedTimer timer(report.seconds.projection);
  const auto phase = ScopedPhase::coarse("projection");
  TouchedCells touched{removed_cells(before.mesh, state.mesh), {}};
  MeshRenumbering renumbering = state.mesh.compact();
  state.strata.compact(renumbering);
  state.remesh_memory.renumber(renumbering.vertex);
  for (int c = before.mesh.cell_slots(); c < static_cast<int>(renumbering.cell.size()); ++c)
    if (renumbering.cell[c] != kNone) touched.new_cells.push_back(renumbering.cell[c]);
  state.chords = carried_chords(before, renumbering.vertex, state);
  state.quadrature = levels_by_element(fields.levels, renumbering.cell, state);
  const auto obstacle_dofs = Dim * static_cast<Eigen::Index>(setup.obstacles.rest.size());
  const auto carried = [&](const VectorX& slots, const VectorX& with_obstacles) {
    VectorX field(Dim * state.mesh.num_nodes() + obstacle_dofs);
    for (std::size_t v = 0; v < renumbering.vertex.size(); ++v)
      if (renumbering.vertex[v] != kNone)
        field.segment<Dim>(Dim * renumbering.vertex[v]) = slots.segment<Dim>(Dim * static_cast<int>(v));
    field.tail(obstacle_dofs) = with_obstacles.tail(obstacle_dofs);
    return field;
  };
  x = carried(fields.x, x);
  for (std::size_t i = 0; i < state.history.x.size(); ++i)
    state.history.x[i] = carried(fields.past_positions[i], before.history.x[i]);
  std::size_t next = 0;
  for (auto& v : state.history.v) v = carried(fields.past_rates[next++], VectorX(v));
  for (auto& a : state.history.a) a = carried(fields.past_rates[next++], VectorX(a));
  if (settle) {
    settle(renumbering);
  } else if (remeshed.coarsened()) {  // else interpolation is exact
    const auto transfer = transfer_history(setup, before.mesh, before.history, state.mesh, touched,
                                           tools.cache.system.solver(), state.history);
    report.history_loss = transfer.loss / problem.scaling();
    tell(transfer, mass_moment(setup, state.mesh, x), state.step, setup.units, tools.logger);
  }
  report.remeshing = momentum_changes(setup, before, state, touched);
  return renumbering;
}

}  // namespace

template <int Dim>
std::optional<MeshRenumbering> remesh_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                  const State<Dim>& before, State<Dim>& state, VectorX& x,
                                                  StepReport& report, bool may_curve) {
  return change_and_project(tools, problem, before, state, x, report,
                            [may_curve](auto& mesh, auto& fields, const auto& context, RemeshOptions options, auto&... all) {
                              options.curve.enabled &= may_curve;
                              return remesh<Dim>(mesh, fields, context, options, all...);
                            });
}

template <int Dim>
std::optional<MeshRenumbering> curve_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                 std::span<const EdgeKey> edges, const State<Dim>& before, State<Dim>& state,
                                                 VectorX& x, StepReport& report) {
  return change_and_project(tools, problem, before, state, x, report,
                            [&](auto&&... all) { return curve_edges<Dim>(edges, std::forward<decltype(all)>(all)...); });
}

template <int Dim>
std::optional<MeshRenumbering> shape_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                 const State<Dim>& before, State<Dim>& state, VectorX& x,
                                                 StepReport& report) {
  AddedMaterial<Dim> added;
  const auto operate = [&](auto&&... all) {
    RemeshReport operations = put_on_shapes<Dim>(tools.setup.shapes, all..., added);
    if (added.compressed > 0)
      tools.logger.warning(
          fmt::format("step {}: {} vertices were put onto their shapes where something is in the way: the material there "
                      "begins compressed; leave room for the shapes at rest",
                      state.step, added.compressed));
    if (added.off > 0)
      tools.logger.warning(
          fmt::format("step {}: {} vertices stay off their shapes, by up to {}: cells behind them are too thin", state.step,
                      added.off, tools.setup.units.text(added.farthest, "m", 3)));
    return operations;
  };
  return change_and_project(tools, problem, before, state, x, report, operate, [&](const MeshRenumbering& renumbering) {
    for (VertexId& v : added.moved) v = renumbering.vertex[v];
    if (tools.setup.time.has_inertia()) keep_momenta(tools.setup, before, added, state);
  });
}

template <int Dim>
std::optional<MeshRenumbering> straighten_and_project(const StepTools<Dim>& tools, std::span<const CellId> cells,
                                                      double least_volume, const State<Dim>& before, State<Dim>& state,
                                                      VectorX& x, StepReport& report) {
  const StepProblem<Dim> problem(tools.setup, before.mesh, before.history, before.t, tools.cache, before.stiffness,
                                 before.quadrature, before.chords);
  x = before.history.x[0];
  state = before;
  auto renumbering = change_and_project(tools, problem, before, state, x, report, [&](auto&&... all) {
    return straighten_cells<Dim>(cells, least_volume, std::forward<decltype(all)>(all)...);
  });
  if (renumbering) state.deviation.resize(0);  // of another mesh
  return renumbering;
}

#define ITR_INSTANTIATE(Dim)                                                                                               \
  template std::optional<MeshRenumbering> shape_and_project<Dim>(const StepTools<Dim>&, const StepProblem<Dim>&,           \
                                                                 const State<Dim>&, State<Dim>&, VectorX&, StepReport&);   \
  template std::optional<MeshRenumbering> remesh_and_project<Dim>(                                                         \
      const StepTools<Dim>&, const StepProblem<Dim>&, const State<Dim>&, State<Dim>&, VectorX&, StepReport&, bool);        \
  template std::optional<MeshRenumbering> curve_and_project<Dim>(const StepTools<Dim>&, const StepProblem<Dim>&,           \
                                                                 std::span<const EdgeKey>, const State<Dim>&, State<Dim>&, \
                                                                 VectorX&, StepReport&);                                   \
  template std::optional<MeshRenumbering> straighten_and_project<Dim>(                                                     \
      const StepTools<Dim>&, std::span<const CellId>, double, const State<Dim>&, State<Dim>&, VectorX&, StepReport&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
