// SPDX-License-Identifier: MIT
#include "itr/simulation/resultant.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "itr/core/error.hpp"
#include "itr/fem/quadratic.hpp"

namespace itr {

namespace {
Vec<1> moment(const Vec<2>& arm, const Vec<2>& f) { return Vec<1>(arm[0] * f[1] - arm[1] * f[0]); }
Vec<3> moment(const Vec<3>& arm, const Vec<3>& f) { return arm.cross(f); }
}  // namespace

template <int Dim>
Resultant<Dim> resultant(const Simulation<Dim>& simulation, std::span<const int> tags, const Vec<Dim>& about) {
  const Mesh<Dim>& mesh = simulation.state().mesh;
  const Space& space = simulation.state().space;
  const int nodes = num_nodes(mesh, space);
  const NodalForces& forces = simulation.forces();
  const std::array<const VectorX*, 4> kinds{&forces.contact, &forces.friction, &forces.reaction, &forces.applied};
  for (const VectorX* kind : kinds)
    if (kind->size() != Eigen::Index{Dim} * nodes)
      throw InputError({"", "fields", "not all kinds of forces",
                        "contact_forces, friction_forces, reaction_forces and applied_forces for a resultant"});
  std::vector<char> is_on(nodes, 0);
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    if (std::find(tags.begin(), tags.end(), mesh.facet_tag(f)) == tags.end()) continue;
    const auto& facet = mesh.facet(f);
    for (const int v : facet) is_on[v] = 1;
    for_each_edge<Dim - 1>([&](int, int i, int j) {
      if (const int curved = space.find(facet[i], facet[j]); curved != kNone) is_on[mesh.vertex_slots() + curved] = 1;
    });
  }
  Resultant<Dim> sum;
  for (int v = 0; v < nodes; ++v) {
    if (!is_on[v]) continue;
    Vec<Dim> f = Vec<Dim>::Zero();
    for (const VectorX* kind : kinds) f += kind->template segment<Dim>(Dim * v);
    sum.force += f;
    sum.moment += moment(Vec<Dim>(simulation.state().history.x[0].template segment<Dim>(Dim * v) - about), f);
  }
  return sum;
}

template Resultant<2> resultant<2>(const Simulation<2>&, std::span<const int>, const Vec<2>&);
template Resultant<3> resultant<3>(const Simulation<3>&, std::span<const int>, const Vec<3>&);

}  // namespace itr
