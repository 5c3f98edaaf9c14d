// SPDX-License-Identifier: MIT
#include "simulation/momentum_change.hpp"

#include <set>

#include "itr/energy/inertia.hpp"
#include "simulation/moment.hpp"

namespace itr {

namespace {

template <int Dim>
struct Momentum {
  Vec<Dim> linear = Vec<Dim>::Zero();
  Vec<Dim == 2 ? 1 : 3> angular = Vec < Dim == 2 ? 1 : 3 > ::Zero();
};

/// Momentum of a body whose nodes move with v.
template <int Dim>
Momentum<Dim> momentum_of(const StepSetup<Dim>& setup, CellSet<Dim> cells, int body, const VectorX& x, const VectorX& v) {
  std::erase_if(cells.elements, [&](const auto& element) { return element.body != body; });
  std::erase_if(cells.curved_elements, [&](const auto& element) { return element.body != body; });
  VectorX product = VectorX::Zero(v.size());
  InertiaEnergy<Dim>(cells, setup.materials, setup.lump_mass ? MassKind::lumped : MassKind::consistent,
                     VectorX::Zero(v.size()))
      .add_mass_product(v, product);
  Momentum<Dim> momentum;
  for (Eigen::Index i = 0; i < v.size(); i += Dim) {
    const Vec<Dim> p = product.segment<Dim>(i);
    momentum.linear += p;
    momentum.angular += moment(Vec<Dim>(x.segment<Dim>(i)), p);
  }
  return momentum;
}

}  // namespace

template <int Dim>
std::vector<MomentumChange> momentum_changes(const StepSetup<Dim>& setup, const State<Dim>& before, const State<Dim>& after,
                                             const TouchedCells& touched) {
  if (setup.time.quasistatic || setup.time.is_static) return {};
  std::set<int> bodies;
  for (const CellId c : touched.old_cells) bodies.insert(before.mesh.body(c));
  for (const CellId c : touched.new_cells) bodies.insert(after.mesh.body(c));
  struct Side {
    CellSet<Dim> cells;
    VectorX x, v;
  };
  // The integrator's acceleration from the history is linear in the end velocity, of which none is left here.
  const auto side_of = [&](const State<Dim>& state) {
    const Eigen::Index dofs = Eigen::Index{Dim} * num_nodes(state.mesh, state.space);
    const VectorX& x = state.history.x[0];
    const VectorX free = -setup.time.dt * TimeIntegrator(setup.time).acceleration(VectorX::Zero(x.size()), state.history);
    return Side{whole_mesh(state.mesh, {}, state.space), x.head(dofs), free.head(dofs)};
  };
  const Side old_side = side_of(before), new_side = side_of(after);
  std::vector<MomentumChange> changes;
  for (const int body : bodies) {
    const auto was = momentum_of<Dim>(setup, old_side.cells, body, old_side.x, old_side.v);
    const auto is = momentum_of<Dim>(setup, new_side.cells, body, new_side.x, new_side.v);
    const Vec<Dim> linear = is.linear - was.linear;
    const Vec<Dim == 2 ? 1 : 3> angular = is.angular - was.angular;
    changes.push_back({body, {linear.begin(), linear.end()}, {angular.begin(), angular.end()}});
  }
  return changes;
}

template std::vector<MomentumChange> momentum_changes(const StepSetup<2>&, const State<2>&, const State<2>&,
                                                      const TouchedCells&);
template std::vector<MomentumChange> momentum_changes(const StepSetup<3>&, const State<3>&, const State<3>&,
                                                      const TouchedCells&);

}  // namespace itr
