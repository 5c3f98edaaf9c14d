// SPDX-License-Identifier: MIT
#include "simulation/step_terms.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "energy/support.hpp"
#include "itr/core.hpp"
#include "mesh/rest_box.hpp"

namespace itr {

namespace {

/// Throws InputError for a value of a program's function that is not finite; those of scenes name their keys themselves.
template <int Dim, typename Value>
Value finite(const Value& value, const char* what, const Vec<Dim>& X, double t) {
  bool is_finite = false;
  if constexpr (std::is_same_v<Value, double>)
    is_finite = std::isfinite(value);
  else
    is_finite = value.allFinite();
  if (is_finite) return value;
  throw InputError(
      {"", what, fmt::format("no finite value at X = ({:g}) m, t = {:g} s", fmt::join(X, ", "), t), "a value there"});
}

}  // namespace

template <int Dim>
Loads<Dim> loads_at(const StepSetup<Dim>& setup, double t) {
  Loads<Dim> loads;
  if (setup.body_acceleration)
    loads.acceleration = [f = setup.body_acceleration, t](const RestPoint<Dim>& X) {
      return finite<Dim, Vec<Dim>>(f(X, t), "body force", X, t);
    };
  for (const auto& condition : setup.neumann)
    loads.tractions.emplace_back(condition.tag, [f = condition.traction, t](const RestPoint<Dim>& X) {
      return finite<Dim, Vec<Dim>>(f(X, t), "traction", X, t);
    });
  for (const auto& condition : setup.pressure)
    loads.pressures.emplace_back(condition.tag, [f = condition.pressure, t](const RestPoint<Dim>& X) {
      return finite<Dim, double>(f(X, t), "pressure", X, t);
    });
  for (const Cavity& cavity : setup.cavities) {
    const std::string place = fmt::format("/boundary_conditions/pressure_cavity/{}/value", loads.cavities.size());
    CavityLoad load{cavity.surfaces, 0, cavity.external_pressure, cavity.exponent, cavity.bulk_modulus};
    load.pressure = finite<Dim, double>(cavity.pressure ? cavity.pressure(t) : 0, place.c_str(), Vec<Dim>::Zero(), t);
    if (cavity.bulk_modulus == 0 && load.pressure + load.external_pressure < 0)
      throw InputError(
          {"", place,
           fmt::format("{} at t = {}, below a vacuum", setup.units.text(load.pressure, "Pa"), setup.units.text(t, "s")),
           "at least minus the external pressure, " + setup.units.text(load.external_pressure, "Pa")});
    loads.cavities.push_back(std::move(load));
  }
  return loads;
}

template <int Dim>
ConditionsByTag<Dim> conditions_by_tag(const StepSetup<Dim>& setup) {
  ConditionsByTag<Dim> first;
  for (const auto& condition : setup.dirichlet) first.try_emplace(condition.tag, &condition);
  return first;
}

template <int Dim>
typename HeldRule<Dim>::Components held_components(const StepSetup<Dim>& setup) {
  typename HeldRule<Dim>::Components components;
  for (const auto& condition : setup.dirichlet) components.try_emplace(condition.tag, condition.components);
  return components;
}

template <int Dim>
HeldDofs<Dim> held_dofs(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, double t) {
  const int bodies = mesh.num_nodes(), total = bodies + static_cast<int>(setup.obstacles.rest.size());
  HeldDofs<Dim> result{std::vector<char>(Dim * total, 0), VectorX::Zero(Dim * total)};
  const ConditionsByTag<Dim> conditions = conditions_by_tag(setup);
  const auto components = held_components(setup);
  const HeldRule<Dim> rule(components);
  const auto hold = [&](int node, const typename HeldRule<Dim>::Tags& tags, const auto& rest) {
    int tag = kNoTag;
    Vec<Dim> target;
    for (int c = 0; c < Dim; ++c) {
      if (tags[c] == kNoTag) continue;
      if (tags[c] != tag) {
        tag = tags[c];
        const RestPoint<Dim> X = rest();
        target = X + finite<Dim, Vec<Dim>>(conditions.at(tag)->displacement(X, t), "prescribed displacement", X, t);
      }
      result.held[Dim * node + c] = 1;
      result.target[Dim * node + c] = target[c];
    }
  };
  for (VertexId node = 0; node < mesh.node_slots(); ++node) {
    hold(node, rule.tags_of_node(mesh, node), [&] { return mesh.point_of_node(node); });
    if (!mesh.is_on_axis(node)) continue;
    result.held[Dim * node] = 1;
    result.target[Dim * node] = 0;
  }
  for (int o = 0; o < total - bodies; ++o) {
    const Vec<Dim>& X = setup.obstacles.rest[o];
    const int motion = setup.obstacles.motion.empty() ? kNone : setup.obstacles.motion[o];
    result.target.template segment<Dim>(Dim * (bodies + o)) =
        motion == kNone
            ? X
            : Vec<Dim>(X + finite<Dim, Vec<Dim>>(setup.obstacles.motions[motion](X, t), "motion of an obstacle", X, t));
    for (int c = 0; c < Dim; ++c) result.held[Dim * (bodies + o) + c] = 1;
  }
  return result;
}

template <int Dim>
std::vector<Mortar<Dim>> mortars_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const CellSet<Dim>& cells) {
  if (setup.ties.empty()) return {};
  const auto components = held_components(setup);
  const HeldRule<Dim> rule(components);
  return make_mortars<Dim>(cells, setup.ties, [&](int node, int c) {
    return rule.tags_of_node(mesh, node)[c] != kNoTag || (c == 0 && mesh.is_on_axis(node));
  });
}

template <int Dim>
double relative_motion(const VectorX& motions) {
  Eigen::AlignedBox<double, Dim> box;
  for (Eigen::Index i = 0; i < motions.size(); i += Dim) box.extend(Vec<Dim>(motions.segment<Dim>(i)));
  return box.isEmpty() ? 0 : box.diagonal().norm();
}

template <int Dim>
double rest_diagonal(const Mesh<Dim>& mesh) {
  return rest_box(mesh).diagonal().norm();
}

template <int Dim>
std::map<int, Material> materials_at(const StepSetup<Dim>& setup, double t) {
  std::map<int, Material> materials = setup.materials;
  for (auto& [body, material] : materials) {
    if (material.own_at) material.own = material.own_at(t);
    material.eigenstrain_time = t;
  }
  return materials;
}

template <int Dim>
std::shared_ptr<const ViscousStep<Dim>> viscous_step(const StepSetup<Dim>& setup, const History& history, double t) {
  const auto start = std::dynamic_pointer_cast<const CellField<Dim>>(history.viscous);
  if (!start) return nullptr;
  const double dt = setup.time.is_static ? std::numeric_limits<double>::infinity() : t - start->time();
  return std::make_shared<ViscousStep<Dim>>(start, materials_at(setup, t), dt);
}

template <int Dim>
std::shared_ptr<const SofteningStep<Dim>> softening_step(const StepSetup<Dim>& setup, const History& history) {
  const auto start = std::dynamic_pointer_cast<const CellField<Dim>>(history.softening);
  return start ? std::make_shared<SofteningStep<Dim>>(start, setup.materials) : nullptr;
}

template <int Dim>
PotentialTerms<Dim> potential_terms(const StepSetup<Dim>& setup, const History& history, double t, bool is_axisymmetric) {
  const TimeIntegrator integrator(setup.time);
  std::map<int, Material> materials = materials_at(setup, t);
  const auto viscous = viscous_step<Dim>(setup, history, t);
  for (auto& [body, material] : materials)
    if (viscous && viscous->acts_on(body)) material.deviator *= viscous->factor(body);
  std::vector<TermFactory<Dim>> host = setup.terms;
  std::ranges::copy_if(setup.nodal_loads, std::back_inserter(host), [](const TermFactory<Dim>& load) {
    return load.template target<CouplingEntry<Dim>>() == nullptr;  // whose terms StepProblem makes
  });
  return {.materials = std::move(materials),
          .viscous = viscous,
          .softening = softening_step<Dim>(setup, history),
          .loads = loads_at(setup, t),
          .has_inertia = setup.time.has_inertia(),
          .axisymmetric = is_axisymmetric,
          .mass = setup.lump_mass ? MassKind::lumped : MassKind::consistent,
          .quadrature_degree = setup.quadrature_degree,
          .scaling = integrator.scaling(history),
          .contact = setup.contact,
          .damping = setup.time.is_static ? std::vector<DampingOptions>() : setup.damping,
          .velocity_rate = integrator.velocity_rate(history),
          .slips_from_touch = !setup.time.has_inertia() && setup.lagging_tolerance > 0,
          .host = std::move(host),
          .t = t,
          .follower = {}};
}

#define ITR_INSTANTIATE(Dim)                                                                                         \
  template Loads<Dim> loads_at<Dim>(const StepSetup<Dim>&, double);                                                  \
  template std::map<int, Material> materials_at<Dim>(const StepSetup<Dim>&, double);                                 \
  template PotentialTerms<Dim> potential_terms<Dim>(const StepSetup<Dim>&, const History&, double, bool);            \
  template std::shared_ptr<const ViscousStep<Dim>> viscous_step<Dim>(const StepSetup<Dim>&, const History&, double); \
  template std::shared_ptr<const SofteningStep<Dim>> softening_step<Dim>(const StepSetup<Dim>&, const History&);     \
  template ConditionsByTag<Dim> conditions_by_tag<Dim>(const StepSetup<Dim>&);                                       \
  template HeldRule<Dim>::Components held_components<Dim>(const StepSetup<Dim>&);                                    \
  template HeldDofs<Dim> held_dofs<Dim>(const StepSetup<Dim>&, const Mesh<Dim>&, double);                            \
  template std::vector<Mortar<Dim>> mortars_of<Dim>(const StepSetup<Dim>&, const Mesh<Dim>&, const CellSet<Dim>&);   \
  template double relative_motion<Dim>(const VectorX&);                                                              \
  template double rest_diagonal<Dim>(const Mesh<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
