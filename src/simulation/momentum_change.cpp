// SPDX-License-Identifier: MIT
#include "simulation/momentum_change.hpp"

#include <map>
#include <set>

#include "energy/inertia.hpp"
#include "simulation/moment.hpp"

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

}  // namespace

template <int Dim>
std::vector<MomentumChange> momentum_changes(const StepSetup<Dim>& setup, const State<Dim>& before, const State<Dim>& after,
                                             const TouchedCells& touched) {
  if (setup.time.quasistatic || setup.time.is_static) return {};
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

template std::vector<MomentumChange> momentum_changes(const StepSetup<2>&, const State<2>&, const State<2>&,
                                                      const TouchedCells&);
template std::vector<MomentumChange> momentum_changes(const StepSetup<3>&, const State<3>&, const State<3>&,
                                                      const TouchedCells&);

}  // namespace itr
