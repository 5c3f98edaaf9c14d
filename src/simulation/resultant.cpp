// SPDX-License-Identifier: MIT
#include "simulation/resultant.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "fem/cell_set.hpp"
#include "itr/core.hpp"
#include "mesh/facet_tags.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/force_target.hpp"
#include "simulation/moment.hpp"

namespace itr {

namespace {

template <int Dim>
void add_force(const Vec<Dim>& f, const Vec<Dim>& arm, Resultant<Dim>& sum) {
  sum.force += f;
  sum.moment += moment(arm, f);
}

/// Which nodes, those on curved edges included, the target has.
template <int Dim>
std::vector<char> nodes_of(const State<Dim>& state, std::span<const int> surfaces, std::span<const int> bodies) {
  const Mesh<Dim>& mesh = state.mesh;
  std::vector<char> is_on(mesh.num_nodes(), 0);
  const auto has = [](std::span<const int> list, int id) { return std::find(list.begin(), list.end(), id) != list.end(); };
  const auto take = [&](const auto& simplex) { for_each_node(mesh, simplex, [&](int node) { is_on[node] = 1; }); };
  if (!surfaces.empty())
    for (const FacetId f : mesh.live_facets())
      if (has(surfaces, mesh.facet_tag(f))) take(mesh.facet(f));
  if (!bodies.empty())
    for (const CellId c : mesh.live_cells())
      if (has(bodies, mesh.body(c))) take(mesh.cell(c));
  return is_on;
}

void refuse_unknown_ids(std::span<const int> ids, const std::set<int>& known, const std::string& place, const char* what) {
  for (const int id : ids)
    if (!known.contains(id))
      throw InputError(
          {"", place, fmt::format("{}, which nothing has", id),
           known.empty() ? fmt::format("{}: there is none", what) : fmt::format("{}: {}", what, fmt::join(known, ", "))});
}

}  // namespace

template <int Dim>
void refuse_unknown(const ForceTarget& target, const Mesh<Dim>& mesh, const std::set<int>& surfaces,
                    std::size_t obstacle_vertices, const std::string& place) {
  if (target.surfaces.empty() && target.bodies.empty() && target.obstacle_vertices.empty())
    throw InputError({"", place, "no surfaces, bodies or obstacles", "at least one of them"});
  std::set<int> bodies;
  for (const CellId c : mesh.live_cells()) bodies.insert(mesh.body(c));
  refuse_unknown_ids(target.surfaces, surfaces, place, "the id of a surface");
  refuse_unknown_ids(target.bodies, bodies, place, "the id of a body");
  for (const int v : target.obstacle_vertices)
    if (v < 0 || static_cast<std::size_t>(v) >= obstacle_vertices)
      throw InputError(
          {"", place, std::to_string(v), fmt::format("a vertex of the obstacles, 0 to {} - 1", obstacle_vertices)});
}

template <int Dim>
ForceSums<Dim> force_sums(const State<Dim>& state, const NodalForces& forces, const ForceTarget& target) {
  const auto nodes = static_cast<std::size_t>(state.history.x[0].size()) / Dim;
  refuse_unknown(target, state.mesh, facet_tags(state.mesh), nodes - static_cast<std::size_t>(state.mesh.num_nodes()),
                 "forces of '" + target.name + "'");
  return sum_forces(state, forces, target);
}

template <int Dim>
ForceSums<Dim> sum_forces(const State<Dim>& state, const NodalForces& forces, const ForceTarget& target) {
  const std::array<const VectorX*, 4> kinds{&forces.contact, &forces.friction, &forces.reaction, &forces.applied};
  const int bodies = state.mesh.num_nodes();
  for (const auto kind : kForcesOnBodies)
    if ((forces.*kind).size() != Eigen::Index{Dim} * bodies)
      throw InputError({"", "fields", "not all kinds of forces",
                        "contact_forces, friction_forces, reaction_forces and applied_forces for a resultant"});
  const VectorX& x = state.history.x[0];
  const Vec<Dim> about(target.about.data());
  const std::vector<char> is_on = nodes_of(state, target.surfaces, target.bodies);
  ForceSums<Dim> sums;
  for (int v = 0; v < bodies; ++v) {
    if (!is_on[v]) continue;
    const Vec<Dim> arm = x.template segment<Dim>(Dim * v) - about;
    const auto of = [&](const VectorX& kind) { return Vec<Dim>(kind.template segment<Dim>(Dim * v)); };
    add_force<Dim>(of(forces.contact), arm, sums.contact);
    add_force<Dim>(of(forces.friction), arm, sums.friction);
    add_force<Dim>(of(forces.reaction), arm, sums.reaction);
    Vec<Dim> all = Vec<Dim>::Zero();
    for (const VectorX* kind : kinds) all += of(*kind);
    add_force<Dim>(all, arm, sums.all);
    add_force<Dim>(of(forces.body), arm, sums.body);
    add_force<Dim>(of(forces.residual), arm, sums.residual);
  }
  for (const MomentumChange& change : forces.remeshing) {
    if (std::find(target.bodies.begin(), target.bodies.end(), change.body) == target.bodies.end()) continue;
    const Vec<Dim> f(change.linear.data());
    sums.remeshing.force += f;
    sums.remeshing.moment += Vec < Dim == 2 ? 1 : 3 > (change.angular.data()) - moment(about, f);
  }
  for (const int o : target.obstacle_vertices) {
    const Vec<Dim> arm = x.template segment<Dim>(Dim * (bodies + o)) - about;
    const Vec<Dim> contact = forces.obstacle_contact.template segment<Dim>(Dim * o);
    const Vec<Dim> friction = forces.obstacle_friction.template segment<Dim>(Dim * o);
    add_force<Dim>(contact, arm, sums.contact);
    add_force<Dim>(friction, arm, sums.friction);
    add_force<Dim>(contact + friction, arm, sums.all);
  }
  return sums;
}

template <int Dim>
Resultant<Dim> resultant(const Simulation<Dim>& simulation, std::span<const int> tags, const Vec<Dim>& about) {
  ForceTarget target{.name = "resultant"};
  target.surfaces.assign(tags.begin(), tags.end());
  std::copy(about.begin(), about.end(), target.about.begin());
  refuse_unknown(target, simulation.mesh(), known_tags(simulation.setup(), simulation.mesh()), 0, "forces of 'resultant'");
  return sum_forces(simulation.state(), simulation.forces(), target).all;
}

#define ITR_INSTANTIATE(Dim)                                                                                 \
  template void refuse_unknown<Dim>(const ForceTarget&, const Mesh<Dim>&, const std::set<int>&, std::size_t, \
                                    const std::string&);                                                     \
  template Resultant<Dim> resultant<Dim>(const Simulation<Dim>&, std::span<const int>, const Vec<Dim>&);     \
  template ForceSums<Dim> sum_forces<Dim>(const State<Dim>&, const NodalForces&, const ForceTarget&);        \
  template ForceSums<Dim> force_sums<Dim>(const State<Dim>&, const NodalForces&, const ForceTarget&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
