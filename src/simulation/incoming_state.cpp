// SPDX-License-Identifier: MIT
#include "incoming_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "energy/softening.hpp"
#include "energy/tie.hpp"
#include "energy/viscous.hpp"
#include "itr/core.hpp"
#include "mesh/validate.hpp"
#include "simulation/chord_bound.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/flat_obstacles.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/invariants.hpp"
#include "simulation/named.hpp"
#include "simulation/rigid_coordinates.hpp"

namespace itr {

namespace {

constexpr int kDigits = 6;  ///< of places
constexpr const char* kRemedy =
    "; \"contact\": {\"initial_overlap\": \"resolve\"} finds the equilibrium of bodies that touch or overlap, such as press "
    "fits";

/// Where no surfaces cross: what is wholly inside of a body.
template <int Dim>
void refuse_enclosed(const Setup<Dim>& setup, const State<Dim>& state) {
  if (setup.proxy) return;
  const auto refuse = [&](const char* what, const Vec<Dim>& p) {
    throw InputError(
        {"", "initial state",
         fmt::format("{} inside of a body, at {} {}", what, point_text<Dim>(p, setup.units, kDigits), setup.units.length()),
         fmt::format("surfaces that do not touch{}", kRemedy)});
  };
  const VectorX& x = state.history.x[0];
  const ClosedSurface<Dim> boundary = body_boundary(state.mesh, x, state.chords);
  if (!has_closed_faces(state.mesh)) {
    for (const int v : boundary.nested()) refuse("a body", x.segment<Dim>(Dim * v));
  } else if (const auto overlap = boundary.find_overlap(contact_surface(setup, state.mesh, state.chords).surface.closed);
             overlap.depth > setup.contact.reach_of_closed()) {
    refuse("a body", overlap.place);
  }
  for (Eigen::Index i = Dim * state.mesh.num_nodes(); i < x.size(); i += Dim)
    if (const Vec<Dim> p = x.segment<Dim>(i); boundary.touches(p) || boundary.winding(p) != 0) refuse("an obstacle", p);
}

/// Value of the first condition that names the body of one of the vertex's cells; the last cell's body wins.
template <int Dim>
VectorX sample(const std::vector<InitialCondition<Dim>>& conditions, const Mesh<Dim>& mesh, int obstacle_vertices,
               double t0) {
  VectorX field = VectorX::Zero(Dim * (mesh.num_nodes() + obstacle_vertices));
  if (conditions.empty()) return field;
  for (int c = 0; c < mesh.cell_slots(); ++c)
    for (const auto& condition : conditions) {
      if (condition.body != mesh.body(c)) continue;
      for_each_node(mesh, mesh.cell(c),
                    [&](int node) { field.segment<Dim>(Dim * node) = condition.value(mesh.rest(node), t0); });
      break;
    }
  return field;
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
  if (setup.time.adaptive.enabled && history.a.size() > static_cast<std::size_t>(integrator.acceleration_depth()))
    refuse_state("saved accelerations", std::to_string(history.a.size()) + " past states",
                 fmt::format("at most {}, as adaptive steps remember", integrator.acceleration_depth()));
  if (!setup.time.adaptive.enabled || (integrator.uses_acceleration() && history.a.empty()))
    require_size("past states of saved accelerations", history.a.size(),
                 integrator.uses_acceleration() ? history.x.size() : 0);
  const auto size =
      static_cast<std::size_t>(Dim) * (static_cast<std::size_t>(state.mesh.num_nodes()) + setup.obstacles.rest.size());
  const auto check = [&](const std::string& name, const VectorX& field) {
    require_size("length of saved " + name, static_cast<std::size_t>(field.size()), size);
    require_finite("saved " + name, field);
  };
  for (const VectorX& x : history.x) check("positions", x);
  for (const VectorX& v : history.v) check("velocities", v);
  for (const VectorX& a : history.a) check("accelerations", a);
  if (state.deviation.size() > 0) check("deviation", state.deviation);
  if (!state.doublings.empty())
    require_size("doublings of flat obstacles", state.doublings.size(), setup.obstacles.flats.size());
  for (const int times : state.doublings)
    if (times < 0 || times > FlatObstacles<Dim>::kMostDoublings)
      refuse_state("doublings of flat obstacles", std::to_string(times),
                   fmt::format("0 to {}", FlatObstacles<Dim>::kMostDoublings));
}

/// Refuses records of cells that are not as many as their material has.
template <int Dim, typename F>
void check_cells(const Setup<Dim>& setup, const State<Dim>& state, const std::shared_ptr<const CellHistory>& saved,
                 const char* name, const F& rows_of) {
  const auto field = std::dynamic_pointer_cast<const CellField<Dim>>(saved);
  for (CellId c = 0; c < state.mesh.cell_slots(); ++c) {
    const Eigen::Index rows = rows_of(setup.materials.at(state.mesh.body(c)));
    const Eigen::Index found = field ? field->by_cell().at(static_cast<std::size_t>(c)).rows() : 0;
    if (found != rows) refuse_state(name, std::to_string(found) + " numbers in a cell", std::to_string(rows));
  }
}

}  // namespace

template <int Dim>
void refuse_intersections(const Setup<Dim>& setup, const State<Dim>& state) {
  if (!setup.contact.enabled) return;
  const ContactSurface<Dim> contact = contact_surface(setup, state.mesh, state.chords);
  const CollisionSurface& surface = contact.surface;
  const VectorX x = contact.positions(state.history.x[0]);
  const int bodies = static_cast<int>(x.size() / Dim - setup.obstacles.rest.size());
  const auto corners = [&](const auto& primitive) {
    std::string text;
    for (const int v : primitive)
      text.append(text.empty() ? "" : "-").append(point_text<Dim>(x.segment<Dim>(Dim * v), setup.units, kDigits));
    return text + (primitive[0] < bodies ? "" : " of an obstacle");
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
  throw InputError({"", "initial state", "surfaces that intersect (in " + setup.units.length() + "): " + found,
                    fmt::format("surfaces that do not touch, but for faces of bodies that coincide at rest{}", kRemedy)});
}

template <int Dim>
void refuse_open_ties(const Setup<Dim>& setup, const State<Dim>& state) {
  constexpr double kOpen = 1e-6;  // of the largest value
  if (setup.ties.empty()) return;
  const CellSet<Dim> cells = whole_mesh(state.mesh, setup.obstacles.rest);
  const std::vector<Mortar<Dim>> mortars = mortars_of(setup, state.mesh, cells);
  const TieEnergy<Dim> tie(cells, mortars, setup.materials, false, 1);
  const VectorX u = state.history.x[0] - rest_positions<Dim>(cells);
  const auto check = [&](const char* place, const VectorX& field) {
    const double size = field.size() > 0 ? field.template lpNorm<Eigen::Infinity>() : 0;
    if (size == 0) return;
    if (const double open = tie.largest_gap(field); open > kOpen * size)
      throw InputError({"", std::string("/initial_conditions/") + place,
                        fmt::format("values that differ by {:.3g} of the largest one across /ties", open / size),
                        "values that are the same on both sides of what is tied"});
  };
  check("solution", u);
  if (setup.time.has_inertia()) check("velocity", state.history.v[0]);
  if (!state.history.a.empty()) check("acceleration", state.history.a[0]);
}

/// Refuses initial positions and velocities of rigid bodies that are not those of rigid motions.
template <int Dim>
void refuse_deformed(const Setup<Dim>& setup, const State<Dim>& state) {
  constexpr double kRigid = 1e-6;  ///< of the body
  if (!has_rigid_bodies(setup.materials)) return;
  const RigidCoordinates<Dim> rigid(setup.materials, whole_mesh(state.mesh, setup.obstacles.rest));
  const auto vectors = [&](int body, const VectorX& field) {
    return Mat<Dim>(rigid.frame(body, field).template rightCols<Dim>() / rigid.size(body));
  };
  for (int b = 0; b < rigid.count(); ++b) {
    const Mat<Dim> F = vectors(b, state.history.x[0]), rate = vectors(b, state.history.v[0]);
    const double speed = rate.norm() + rigid.frame(b, state.history.v[0]).col(0).norm() / rigid.size(b);
    if (!(rigid.distortion(b, state.history.x[0]) <= kRigid && (F.transpose() * F - Mat<Dim>::Identity()).norm() <= kRigid))
      throw InputError({"", "/initial_conditions/solution", "a displacement that deforms a rigid body", "a rigid motion"});
    const Mat<Dim> stretching = F.transpose() * rate + rate.transpose() * F;
    if (!(rigid.distortion(b, state.history.v[0]) <= kRigid * speed && stretching.norm() <= kRigid * speed))
      throw InputError({"", "/initial_conditions/velocity", "a velocity that deforms a rigid body",
                        "that of a rigid motion: v0 + omega x X (2D: [\"-w*y\", \"w*x\"])"});
  }
}

template <int Dim>
Mesh<Dim> initial_mesh(const Setup<Dim>& setup) {
  Mesh<Dim> mesh = setup.mesh;
  mesh.compact();
  mesh.set_curved_edges(edges_of_order_2(mesh, setup.order));
  return mesh;
}

template <int Dim>
State<Dim> initial_state(const Setup<Dim>& setup) {
  State<Dim> state;
  state.mesh = initial_mesh(setup);
  close_coincident_faces(setup, state.mesh);
  wet_sources(setup, state.mesh);
  state.t = setup.time.t0;
  const int obstacles = static_cast<int>(setup.obstacles.rest.size());
  const std::vector<Vec<Dim>>& rest = state.mesh.rest();
  const auto sampled = [&](const auto& conditions) { return sample(conditions, state.mesh, obstacles, setup.time.t0); };
  VectorX x = sampled(setup.initial_displacement);
  for (std::size_t v = 0; v < rest.size(); ++v) vertex_of<Dim>(x, static_cast<int>(v)) += rest[v];
  x.tail(Dim * obstacles) = held_dofs(setup, state.mesh, state.t).target.tail(Dim * obstacles);
  state.history.x = {std::move(x)};
  state.chords = settled_chords(setup, state.mesh, {}, state.history.x);
  open_faces(setup, state.chords, state.history.x[0], state.mesh);
  state.history.v = {sampled(setup.initial_velocity)};
  if (setup.time.integrator == Integrator::newmark) state.history.a = {sampled(setup.initial_acceleration)};
  state.history.viscous =
      begin_viscous<Dim>(state.mesh, materials_at(setup, state.t), state.history.x[0], state.t, setup.time.is_static);
  state.history.softening = begin_softening<Dim>(state.mesh, setup.materials, state.history.x[0], state.t);
  refuse_deformed(setup, state);
  return state;
}

template <int Dim>
void refuse_misfit(const Setup<Dim>& setup, const State<Dim>& state) {
  const Mesh<Dim>& mesh = state.mesh;
  if (!mesh.is_compact()) refuse_state("saved mesh", "dead slots", "a compact mesh");
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (!setup.materials.contains(mesh.body(c)))
      refuse_state("body of a saved cell", std::to_string(mesh.body(c)), "one that has a material");
  check_history(setup, state);
  if (!state.quadrature.empty())
    require_size("saved levels of quadrature", state.quadrature.size(), whole_mesh(mesh, {}).curved().size());
  if (!state.chords.empty())
    require_size("saved levels of chords", state.chords.size(), static_cast<std::size_t>(mesh.num_curved()));
  check_cells(setup, state, state.history.viscous, "saved terms of viscoelasticity", ViscousRecord::size);
  check_cells(setup, state, state.history.softening, "saved softening",
              [](const Material& of) -> Eigen::Index { return of.mullins ? 1 : 0; });
  if (state.step < 0) refuse_state("saved step", std::to_string(state.step), "0 or more");
  for (const auto& [name, value] : {std::pair("time", state.t), std::pair("created energy", state.created_energy),
                                    std::pair("barrier stiffness", state.stiffness.value)})
    if (!std::isfinite(value)) refuse_state(std::string("saved ") + name, fmt::format("{}", value), "a number");
  for (std::size_t age = 0; age < state.history.x.size(); ++age)
    if (const std::string violation = find_violation(setup, mesh, state.history.x[age], state.chords, static_cast<int>(age));
        !violation.empty())
      refuse_state(age == 0 ? "saved positions" : fmt::format("saved positions of {} steps before", age), violation,
                   "positions without inversions and intersections");
}

template <int Dim>
void set_consistent_acceleration(const Setup<Dim>& setup, State<Dim>& state, ProblemCache<Dim>& cache) {
  SparseSystem& system = cache.system;
  StepProblem<Dim> problem(setup, state.mesh, state.history, state.t, cache, state.stiffness, {}, state.chords);
  VectorX force = problem.total_force(state.history.x[0], state.history.v[0]);
  const DofMap& dofs = problem.dofs();
  VectorX& a = state.history.a[0];
  const VectorX zero = VectorX::Zero(a.size());
  EnergySum sum;
  const auto inertia = std::make_shared<InertiaEnergy<Dim>>(problem.cells(), setup.materials,
                                                            setup.lump_mass ? MassKind::lumped : MassKind::consistent, zero);
  sum.add(inertia);
  VectorX held = a;
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) held[i] = 0;
  VectorX of_held = zero;
  inertia->add_mass_product(held, of_held);
  Workspace workspace;
  PrescribedMotion motion;
  VectorX rhs(dofs.num_unknowns), solution(dofs.num_unknowns);
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) rhs[dofs.unknown[i]] = force[i] - of_held[i];
  if (dofs.num_unknowns == 0) return;
  system.assemble(sum, zero, PsdProjection::none, dofs, motion, workspace);
  linear::Outcome outcome = rhs.allFinite() ? system.factorize(0).outcome : linear::Outcome::non_finite;
  if (outcome == linear::Outcome::ok) outcome = system.solve_again(rhs, solution).outcome;
  if (outcome != linear::Outcome::ok)
    throw InputError({"", "/initial_conditions/acceleration",
                      "\"consistent\", but M a = f cannot be solved at the start: " + std::string(to_string(outcome)) +
                          ", " + (rhs.allFinite() ? system.message() : "a force is not finite"),
                      "masses above 0 and a solver that copes with the mass matrix, or a given acceleration"});
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) a[i] = solution[dofs.unknown[i]];
}

#define ITR_INSTANTIATE(Dim)                                                \
  template Mesh<Dim> initial_mesh(const Setup<Dim>&);                       \
  template State<Dim> initial_state(const Setup<Dim>&);                     \
  template void refuse_intersections(const Setup<Dim>&, const State<Dim>&); \
  template void refuse_open_ties(const Setup<Dim>&, const State<Dim>&);     \
  template void refuse_misfit(const Setup<Dim>&, const State<Dim>&);        \
  template void set_consistent_acceleration(const Setup<Dim>&, State<Dim>&, ProblemCache<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
