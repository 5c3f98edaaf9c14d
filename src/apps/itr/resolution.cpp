// SPDX-License-Identifier: MIT
#include "resolution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "energy/energy.hpp"
#include "energy/rigid_body.hpp"
#include "fem/cell_set.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/sizes.hpp"

namespace itr::cli {

namespace {

constexpr double kSpacing = std::numeric_limits<double>::epsilon();
constexpr double kDigits = 1e3;  ///< spacings of positions that a motion or strain has to be worth
constexpr double kAbove = 4;     ///< times a motion: its estimate, from the size of a body, not of what bends

/// The largest of what acts on the bodies of a setup.
struct Actions {
  double speed = 0;         ///< at the start [m/s]
  double motion = 0;        ///< prescribed, in a step [m]
  double displacement = 0;  ///< prescribed [m]
  double acceleration = 0;  ///< [m/s^2]
  double tide = 0;          ///< differences of accelerations [m/s^2]
  double traction = 0;      ///< [Pa]
  double force = 0;         ///< on a node [N]
  double eigenstrain = 0;
  bool is_any() const { return std::max({speed, motion, displacement, acceleration, traction, force, eigenstrain}) > 0; }
};

void raise(double& largest, double value) {
  if (std::isfinite(value)) largest = std::max(largest, value);
}

template <int Dim>
void add_nodal_loads(const Setup<Dim>& setup, double t, Actions& actions) {
  if (setup.nodal_loads.empty()) return;
  const CellSet<Dim> cells = whole_mesh(setup.mesh, {});
  VectorX x(Dim * cells.num_vertices), gradient = VectorX::Zero(x.size());
  for (int v = 0; v < cells.num_vertices; ++v) vertex_of<Dim>(x, v) = cells.rest[v];
  Workspace workspace;
  for (const auto& load : setup.nodal_loads)
    if (const auto energy = load(cells, t, 1)) energy->add_gradient(x, gradient, workspace);
  for (int v = 0; v < cells.num_vertices; ++v) raise(actions.force, vertex_of<Dim>(gradient, v).norm());
}

template <int Dim>
void add_eigenstrains(const Setup<Dim>& setup, double t, Actions& actions) {
  const Mesh<Dim>& mesh = setup.mesh;
  for (const CellId c : mesh.live_cells()) {
    const Material& material = setup.materials.at(mesh.body(c));
    if (!material.eigenstrain) continue;
    Vec<3> X = Vec<3>::Zero();
    X.head<Dim>() = mesh.barycenter(c);
    raise(actions.eigenstrain, material.eigenstrain(X, t).norm());
  }
}

/// Adds what is held at t, and its motion since `before`.
template <int Dim>
void add_moves(const Setup<Dim>& setup, double before, double t, Actions& actions) {
  const Mesh<Dim>& mesh = setup.mesh;
  const auto add_held = [&](const RestPoint<Dim>& X, const DirichletCondition<Dim>& condition) {
    const Vec<Dim> there = condition.displacement(X, t);
    raise(actions.displacement, there.norm());
    if (!setup.time.is_static) raise(actions.motion, (there - condition.displacement(X, before)).norm());
  };
  for (const auto& condition : setup.dirichlet) {
    for (VertexId v = 0; v < mesh.node_slots(); ++v)
      if (mesh.vertex_tag(v) == condition.tag) add_held(mesh.point(v), condition);
    for (const FacetId f : mesh.live_facets())
      if (mesh.facet_tag(f) == condition.tag) add_held(mesh.point(mesh.facet(f)[0]), condition);
  }
  for (std::size_t o = 0; o < setup.obstacles.motion.size(); ++o)
    if (const int motion = setup.obstacles.motion[o]; motion != kNone) {
      const auto& moves = setup.obstacles.motions[motion];
      const Vec<Dim>& X = setup.obstacles.rest[o];
      raise(actions.motion, (moves(X, t) - moves(X, before)).norm());
    }
}

/// Adds what moves between times of the run alone, as where held surfaces go and return.
template <int Dim>
void add_moves_between(const Setup<Dim>& setup, Actions& actions) {
  constexpr int kTimes = 64;
  const TimeOptions& time = setup.time;
  const int steps = time.steps - time.first_step, times = std::min(steps, kTimes);
  const auto at = [&](int k) {
    return time.time_after(time.first_step + static_cast<int>(static_cast<long long>(k) * steps / times));
  };
  for (int k = 1; k <= times; ++k) add_moves(setup, at(k - 1), at(k), actions);
}

template <int Dim>
void add_loads(const Setup<Dim>& setup, double t, Actions& actions) {
  const Mesh<Dim>& mesh = setup.mesh;
  add_nodal_loads(setup, t, actions);
  add_eigenstrains(setup, t, actions);
  add_moves(setup, std::max(setup.time.t0, t - setup.time.dt), t, actions);
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    if (setup.body_acceleration) {
      const Vec<Dim> here = setup.body_acceleration(mesh.point(v), t);
      raise(actions.acceleration, here.norm());
      raise(actions.tide, (here - setup.body_acceleration(mesh.point(0), t)).norm());
    }
  for (const FacetId f : mesh.live_facets()) {
    const RestPoint<Dim> X = mesh.point(mesh.facet(f)[0]);
    for (const auto& condition : setup.neumann)
      if (condition.tag == mesh.facet_tag(f)) raise(actions.traction, condition.traction(X, t).norm());
    for (const auto& condition : setup.pressure)
      if (tag_without_fluid(setup.fluids, condition.tag) == mesh.facet_tag(f))
        raise(actions.traction, std::abs(condition.pressure(X, t)));
    for (const Cavity& cavity : setup.cavities)
      if (cavity.pressure && std::ranges::find(cavity.surfaces, mesh.facet_tag(f)) != cavity.surfaces.end())
        raise(actions.traction, std::abs(cavity.pressure(t)));
  }
}

/// Whether nothing holds the bodies, and they have nothing to touch: what is the same all over them does not strain them.
template <int Dim>
bool are_in_flight(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  if (!setup.time.has_inertia() || !setup.dirichlet.empty() || !setup.nodal_loads.empty()) return false;
  if (!setup.contact.enabled) return true;
  std::set<int> parts;
  for (const CellId c : mesh.live_cells()) parts.insert(mesh.part(c));
  return parts.size() <= 1 && setup.obstacles.rest.empty();
}

/// The largest difference of two vertices of a field [as that].
template <int Dim>
double spread_of(const VectorX& field) {
  double spread = 0;
  for (Eigen::Index i = 0; i < field.size(); i += Dim) raise(spread, (field.segment<Dim>(i) - field.segment<Dim>(0)).norm());
  return spread;
}

}  // namespace

template <int Dim>
void find_unresolved(const Simulation<Dim>& simulation, std::vector<std::string>& found) {
  const Setup<Dim>& setup = simulation.setup();
  const TimeOptions& time = setup.time;
  const History& history = simulation.state().history;
  Actions actions, first;
  double spread = 0;  // of speeds
  if (time.has_inertia() && !history.v.empty() && history.v[0].size() > 0) {
    actions.speed = history.v[0].template lpNorm<Eigen::Infinity>();
    spread = spread_of<Dim>(history.v[0].head(Dim * simulation.state().mesh.num_nodes()));
  }
  add_loads(setup, time.time_after(time.first_step + 1), actions);
  first = actions;
  if (time.steps > 1) add_loads(setup, time.time_after(time.steps), actions);
  if (!actions.is_any()) return;
  if (actions.motion == 0 && !time.is_static) add_moves_between(setup, actions);
  const Eigen::Index bodies = history.x[0].size() - Dim * static_cast<Eigen::Index>(setup.obstacles.rest.size());
  const double farthest = history.x[0].head(bodies).template lpNorm<Eigen::Infinity>();
  const double spacing = kSpacing * farthest;
  double motion = actions.motion, strain = 0;
  if (!first.is_any()) first = actions;
  const bool fly = are_in_flight(setup);
  const double straining = fly ? actions.tide : actions.acceleration, impact = fly ? spread : actions.speed;
  for (const auto& [body, size] : body_sizes(setup.mesh)) {
    const Material& material = setup.materials.at(body);
    if (rigid_body_of(material)) continue;
    const double length = size.diagonal;
    const auto traction = [length](const Actions& of) { return of.traction + of.force / std::pow(length, Dim - 1); };
    const double stress = traction(actions) + material.density * straining * length;
    const double of_load = stress / material.youngs_modulus;
    strain = std::max({strain, of_load, actions.displacement / length, actions.eigenstrain,
                       impact / std::sqrt(material.youngs_modulus / material.density)});
    const double at_rest =
        ((traction(first) + material.density * first.acceleration * length) / material.youngs_modulus + first.eigenstrain) *
        length;
    const double in_flight = time.dt * time.dt * (first.acceleration + traction(first) / (material.density * length));
    if (!time.has_inertia())
      motion = std::max(motion, at_rest);
    else
      motion =
          std::max(motion, time.dt * first.speed + (setup.dirichlet.empty() ? in_flight : std::min(in_flight, at_rest)));
  }
  if (time.is_static) motion = std::max(motion, actions.displacement);
  const Units& units = setup.units;
  if (motion > 0 && motion < kAbove * kDigits * spacing)  // none is known of rigid bodies
    found.push_back(fmt::format(
        "bodies move by about {} in the first step, and positions up to {} from the origin are {} apart: results of single "
        "steps are round-off; a larger dt, or a scene near the origin, helps",
        units.text(motion, "m", 2), units.text(farthest, "m", 2), units.text(spacing, "m", 2)));
  else if (strain > 0 && strain < kDigits * kSpacing)  // none is known where only obstacles move
    found.push_back(
        fmt::format("strains are about {:.1g}, and positions resolve {:.1g}: stresses in stored frames are round-off",
                    strain, kSpacing));
}

template void find_unresolved(const Simulation<2>&, std::vector<std::string>&);
template void find_unresolved(const Simulation<3>&, std::vector<std::string>&);

}  // namespace itr::cli
