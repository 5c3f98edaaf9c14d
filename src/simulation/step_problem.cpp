// SPDX-License-Identifier: MIT
#include "simulation/step_problem.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include "diagnosis.hpp"
#include "energy/contact/averaged_contact.hpp"
#include "energy/elastic/patched_volume.hpp"
#include "energy/follower.hpp"
#include "energy/mapped.hpp"
#include "energy/rigid_load.hpp"
#include "fem/unknowns.hpp"
#include "geometry/quadratic_validity.hpp"
#include "itr/core.hpp"
#include "newton/curvature.hpp"
#include "newton/rank_one_system.hpp"

namespace itr {

template <int Dim>
MeshScope<Dim>::MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords)
    : mesh_revision(mesh.revision()),
      chords(chords),
      cells(whole_mesh(mesh, setup.obstacles.rest)),
      diagonal(rest_diagonal(mesh)),
      mortars(mortars_of(setup, mesh, cells)),
      coupled(coupled_surfaces<Dim>(setup, cells)) {
  add_patches(setup.materials, cells);
  if (setup.contact.enabled) surface = contact_surface(setup, mesh, chords);
  if (has_rigid_bodies(setup.materials)) rigid = std::make_unique<const RigidCoordinates<Dim>>(setup.materials, cells);
}

template <int Dim>
bool MeshScope<Dim>::is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& asked_chords) const {
  return mesh_revision == mesh.revision() && chords == asked_chords &&
         std::ranges::equal(setup.obstacles.rest, std::span(cells.rest).subspan(mesh.num_nodes()));
}

template <int Dim>
std::shared_ptr<MeshScope<Dim>> ProblemCache<Dim>::scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                                            const ChordLevels& chords) {
  if (!scope || !scope->is_of(setup, mesh, chords)) scope = std::make_shared<MeshScope<Dim>>(setup, mesh, chords);
  return scope;
}

template struct MeshScope<2>;
template struct MeshScope<3>;
template struct ProblemCache<2>;
template struct ProblemCache<3>;

namespace {

constexpr double kEnergyResolution = 1e-14;     ///< of moduli times volume
constexpr double kVolumeRatioTolerance = 1e-3;  ///< relative, of the bound that is reported

double& entry_of(EnergyReport& report, EnergyEntry entry) {
  const std::array<double*, kNumEnergyEntries> by_entry{&report.inertia,  &report.elastic, &report.body, &report.contact,
                                                        &report.friction, &report.damping, &report.host};
  return *by_entry[static_cast<std::size_t>(entry)];
}

bool is_diagonal(const Mat<3>& K) { return Mat<3>(K.diagonal().asDiagonal()) == K; }

/// Adds to held components those that springs along the axes and coupled points keep from moving. A point that may turn
/// counts as its nearest node.
template <int Dim>
std::vector<char> with_supports(const StepSetup<Dim>& setup, const CellSet<Dim>& cells,
                                const std::vector<CoupledSurface<Dim>>& coupled, std::vector<char> held) {
  const auto hold = [&](int node, const auto& is_held) {
    for (int c = 0; c < Dim; ++c)
      if (is_held(c)) held[Dim * node + c] = 1;
  };
  for (const auto& spring : springs_of<Dim>(setup.nodal_loads))
    for (const auto& facet : cells.facets)
      if (is_diagonal(spring->stiffness) && std::ranges::find(spring->surfaces, facet.tag) != spring->surfaces.end())
        for (const int v : facet.vertices) hold(v, [&](int c) { return spring->stiffness(c, c) > 0; });
  for (const auto& [coupling, mean, modulus, density] : coupled) {
    const bool has_spring = is_diagonal(coupling->stiffness);
    const auto is_held = [&](int c) { return coupling->held_position[c] || (has_spring && coupling->stiffness(c, c) > 0); };
    const auto& turns = coupling->held_rotation;
    if (turns[2] && (Dim == 2 || (turns[0] && turns[1]))) {
      for (const int v : mean.nodes) hold(v, is_held);
    } else {
      Eigen::Index nearest = 0;
      (mean.rest.colwise() - coupling->point.template head<Dim>()).colwise().squaredNorm().minCoeff(&nearest);
      hold(mean.nodes[nearest], is_held);
    }
  }
  return held;
}

}  // namespace

template <int Dim>
StepProblem<Dim>::StepProblem(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const History& history, double t,
                              ProblemCache<Dim>& cache, const BarrierStiffness& stiffness, const QuadratureLevels& levels,
                              const ChordLevels& chords)
    : setup_(setup),
      terms_(potential_terms(setup, history, t, mesh.is_axisymmetric())),
      scope_(cache.scope_of(setup, mesh, chords)),
      cells_(scope_->cells),
      surface_(scope_->surface),
      workspace_(scope_->workspace),
      held_(held_dofs(setup, mesh, t)),
      dofs_(DofMap::from_held(held_.held)),
      rigid_(scope_->rigid.get()),
      solve_dofs_(rigid_ ? DofMap::from_held(rigid_->held(held_.held)) : dofs_),
      potential_(terms_, cells_,
                 {.predictor = terms_.has_inertia ? TimeIntegrator(setup.time).predictor(history) : VectorX(),
                  .velocity_reference = TimeIntegrator(setup.time).velocity_reference(history)}),
      base_(history.x[0]),
      stiffness_(stiffness),
      cache_(cache) {
  if (terms_.has_inertia)
    potential_.inertia()->set_predicted_increment(TimeIntegrator(setup.time).predicted_increment(history));
  coupled_ = std::make_unique<const CoupledPoints<Dim>>(setup, terms_, scope_->coupled, history);
  constraints_ = coupled_->constraints();
  if (std::vector<int> loaded = loaded_rigid_bodies(); setup.follower.forces || !loaded.empty() || !coupled_->empty())
    terms_.follower = [this, &mesh, t, loaded](const VectorX& x) {
      std::vector<std::shared_ptr<const Energy>> terms;
      if (setup_.follower.forces) terms.push_back(lag_follower(setup_.follower, mesh, x, t, terms_.scaling));
      for (const int body : loaded) terms.push_back(rigid_load(body, x, t));
      std::ranges::copy(coupled_->terms(x), std::back_inserter(terms));
      return terms;
    };
  if (setup.contact.enabled) {
    if (!setup.contact.adaptive_stiffness) {
      const bool is_raised = std::isfinite(stiffness.largest);
      stiffness_.value = std::max(setup.contact.barrier_stiffness, is_raised ? stiffness.value : 0);
    }
    potential_.add_contact(surface_.surface, stiffness_.value, surface_.map);
    if (setup.contact.adaptive_stiffness)
      adaptive_ = std::make_unique<AdaptiveStiffness<Dim>>(surface_.surface, setup.contact, average_mass(), terms_.scaling,
                                                           surface_.map.get());
  }
  if (!history.v.empty()) last_motion_ = relative_motion<Dim>(history.v[0]) * setup.time.dt;
  if (!history.v.empty() && setup.contact.has_static_friction()) start_velocity_ = history.v[0];
  potential_.elastic()->set_quadrature_levels(levels);
  add_ties(history, t);
  if (!terms_.has_inertia && setup.newton.indefinite == IndefiniteHessian::project)
    if (auto loose = find_loose_parts<Dim>(cells_, base_, with_supports(setup, cells_, scope_->coupled, held_.held),
                                           setup.materials, tie_ ? tie_->bonds() : std::vector<std::vector<int>>());
        !loose.empty())
      least_motion_ = std::make_shared<LeastMotion<Dim>>(cells_, std::move(loose), terms_.scaling);
  reset_system();
}

/// By the trapezoidal rule a gap at the start of a step that ends without one would leave a velocity that changes its sign
/// in each step: half of the gap and of the way that its velocity goes in half a step are left, of which nothing is left
/// after two steps.
template <int Dim>
void StepProblem<Dim>::add_ties(const History& history, double t) {
  if (scope_->mortars.empty()) return;
  tie_ = std::make_shared<TieEnergy<Dim>>(cells_, scope_->mortars, setup_.materials, terms_.has_inertia, terms_.scaling);
  terms_.tie = tie_;
  if (terms_.has_inertia && TimeIntegrator(setup_.time).is_trapezoidal(history))
    tie_->add_targets(0.5, VectorX(base_ - rest_positions<Dim>(cells_) + setup_.time.dt / 2 * history.v[0]));
  tie_->set_jumps(setup_.ties, t);
  tie_->begin_at(base_);
  constraints_.push_back(tie_.get());
}

template <int Dim>
void StepProblem<Dim>::reset_system() {
  cache_.system.reset(solve_dofs_, Dim, element_stencils(cells_));
  turn_ = ++cache_.served;
}

/// The cache's, for this problem: another one may have had it since.
template <int Dim>
SparseSystem& StepProblem<Dim>::system() {
  if (turn_ != cache_.served) reset_system();
  return cache_.system;
}

template <int Dim>
NewtonSystem& StepProblem<Dim>::newton_system() {
  SparseSystem& sparse = system();
  if (terms_.loads.cavities.empty()) return sparse;
  if (!rank_ones_) rank_ones_ = std::make_unique<RankOneSystem>(sparse);
  return *rank_ones_;
}

template <int Dim>
std::vector<int> StepProblem<Dim>::loaded_rigid_bodies() const {
  std::vector<int> loaded;
  for (int b = 0; rigid_ && b < rigid_->count(); ++b)
    if (rigid_->body(b).force || rigid_->body(b).moment) loaded.push_back(b);
  return loaded;
}

template <int Dim>
std::shared_ptr<const Energy> StepProblem<Dim>::rigid_load(int body, const VectorX& x, double t) const {
  const RigidBody& loaded = rigid_->body(body);
  const auto at_t = [t](const auto& load) { return load ? load(t) : Vec<3>(Vec<3>::Zero()); };
  return std::make_shared<RigidLoad<Dim>>(rigid_->anchors(body), rigid_->coefficients(body),
                                          Vec<Dim>(at_t(loaded.force).template head<Dim>()), at_t(loaded.moment), x,
                                          terms_.scaling);
}

/// Sum of all entries of the mass matrix by its number of rows, obstacles' included; 1 where there is none [kg].
template <int Dim>
double StepProblem<Dim>::average_mass() const {
  const Eigen::Index rows = held_.target.size();
  return potential_.inertia() ? momentum(VectorX::Ones(rows)).sum() / static_cast<double>(rows) : 1;
}

/// Balances the barrier against the other terms at x, dissipation aside. At obstacles the reference implementation's
/// gradient is their prescribed displacement (docs/theory.md, "Barrier stiffness"): it is part of its schedule.
template <int Dim>
void StepProblem<Dim>::initialize_stiffness(const VectorX& x) {
  VectorX gradient = VectorX::Zero(x.size());
  EnergySum others;
  potential_.add_to(others, lagged_, [](const Traits& term) { return !term.is_between_bodies && !term.needs_velocities; });
  others.add_gradient(x, gradient, workspace_);
  if (rigid_) gradient = rigid_->without_reactions(std::move(gradient));
  const Eigen::Index bodies = x.size() - Dim * static_cast<Eigen::Index>(setup_.obstacles.rest.size());
  for (Eigen::Index o = 0; bodies + Dim * o < x.size(); ++o)
    gradient.template segment<Dim>(bodies + Dim * o) =
        -terms_.scaling * (held_.target.template segment<Dim>(bodies + Dim * o) - setup_.obstacles.rest[o]);
  adaptive_->initialize(surface_.positions(x), gradient, stiffness_, workspace_);
  potential_.contact()->set_stiffness(stiffness_.value);
}

/// Where the scene leaves it open, friction is smoothed below a part of the relative motion in the step [m]: bodies that
/// stick then creep by as much of the whole path, in any number of steps and in any unit of time.
template <int Dim>
void StepProblem<Dim>::smooth_friction_by(double motion) {
  constexpr double kFraction = 1e-3;
  constexpr double kLeast = 1e-6;  // of the bodies' diagonal: less is no motion
  if (setup_.contact.friction_velocity == 0)
    terms_.contact.friction_velocity = kFraction * std::max(motion, kLeast * scope_->diagonal) * terms_.velocity_rate;
}

template <int Dim>
std::string StepProblem<Dim>::describe_effort(const NewtonSummary& summary) {
  const int num_obstacles = static_cast<int>(setup_.obstacles.rest.size());
  return itr::describe_effort<Dim>(
      {cells_, potential_, surface_, num_obstacles, terms_.scaling, setup_.units, terms_.materials}, summary, rounds_,
      workspace_);
}

/// x minus the positions at the start of the step; of the last solution without the round-off of x.
template <int Dim>
VectorX StepProblem<Dim>::increment_of(const VectorX& x) const {
  return solution_.x.size() == x.size() && solution_.x == x ? solution_.increment : VectorX(x - base_);
}

template <int Dim>
VectorX StepProblem<Dim>::find_instability(const VectorX& x) {
  smooth_friction_by(relative_motion<Dim>(increment_of(x)));
  lagged_ = potential_.lag(x, workspace_);
  EnergySum sum = potential_.sum(lagged_);
  if (least_motion_) sum.add(least_motion_);
  PrescribedMotion none;
  std::shared_ptr<const Energy> energy = std::make_shared<EnergyOfIncrement>(sum, x);
  if (rigid_) energy = std::make_shared<MappedEnergy<Dim>>(energy, rigid_->map());
  const VectorX at = VectorX::Zero(x.size());
  const auto assemble = [&](PsdProjection psd) {
    newton_system().assemble(*energy, at, psd, solve_dofs_, none, workspace_);
  };
  const int unknowns = solve_dofs_.num_unknowns;
  VectorX by_unknown;
  double curvature = 0;
  if (unknowns == 0) return {};
  if (newton_system().sees_all_directions()) {
    assemble(PsdProjection::none);
    const bool is_indefinite = newton_system().factorize(0).definiteness == linear::Definiteness::indefinite;
    if (is_indefinite) curvature = find_negative_curvature(newton_system(), unknowns, by_unknown);
  } else {
    curvature = find_negative_curvature_by_products(newton_system(), assemble, unknowns, by_unknown).value_or(0);
  }
  if (!(curvature < 0)) return {};
  const VectorX direction = at_dofs(solve_dofs_, by_unknown);
  return rigid_ ? rigid_->map()->motion(direction) : direction;
}

template <int Dim>
EnergyReport StepProblem<Dim>::report(const VectorX& x) {
  EnergyReport report;
  Lagged shown = lagged_;
  potential_.lag_friction(x, workspace_, shown);
  potential_.for_each(shown, [&](TermKind kind, const auto& term) {
    entry_of(report, traits<Dim>(kind).energy) += term->value(x, workspace_) / terms_.scaling;
  });
  if (terms_.viscous) report.elastic += terms_.viscous->stored_excess(cells_, x);
  if (terms_.softening) report.elastic -= terms_.softening->lost(cells_, x);
  for (std::size_t i = 0; i < kNumEnergyEntries; ++i) report.total += entry_of(report, static_cast<EnergyEntry>(i));
  return report;
}

template <int Dim>
NodalForces StepProblem<Dim>::forces(const VectorX& x) {
  const Eigen::Index bodies = x.size() - Dim * static_cast<Eigen::Index>(setup_.obstacles.rest.size());
  const VectorX increment = increment_of(x);
  NodalForces forces;
  const FieldOptions& asked = setup_.fields;
  const bool all = !asked.curves.empty();
  Lagged lagged = lagged_;
  // A lagged part that acts on held components alone is still that of the start of the step.
  if (lagged.pressure && !lagged.pressure->is_lagged(dofs_))
    lagged.pressure = std::make_shared<PressureEnergy<Dim>>(cells_, terms_.loads, x, terms_.scaling);
  const auto get = [&](const EnergySum& sum, VectorX& of_bodies, VectorX* of_obstacles) {
    VectorX gradient = VectorX::Zero(x.size());
    EnergyOfIncrement(sum, base_).add_gradient(increment, gradient, workspace_);
    of_bodies = -gradient.head(bodies) / terms_.scaling;
    if (of_obstacles) *of_obstacles = -gradient.tail(x.size() - bodies) / terms_.scaling;
  };
  const auto add = [&](ForceEntry entry, EnergySum& sum) {
    potential_.add_to(sum, lagged, [&](const Traits& term) { return term.force == entry; });
  };
  EnergySum contact, friction, applied;
  add(ForceEntry::contact, contact);
  add(ForceEntry::friction, friction);
  if (asked.contact_forces || asked.contact_pressure || all) get(contact, forces.contact, &forces.obstacle_contact);
  if (asked.friction_forces || all) get(friction, forces.friction, &forces.obstacle_friction);
  if (asked.applied_forces || all) {
    const Loads<Dim> tractions{{}, terms_.loads.tractions, {}};
    applied.add(std::make_shared<LoadEnergy<Dim>>(cells_, setup_.materials, tractions, terms_.scaling));
    add(ForceEntry::applied, applied);
    get(applied, forces.applied, nullptr);
    EnergySum body;
    body.add(std::make_shared<LoadEnergy<Dim>>(cells_, setup_.materials, Loads<Dim>{terms_.loads.acceleration, {}, {}},
                                               terms_.scaling));
    get(body, forces.body, nullptr);
    EnergySum of_wholes;  // no loads of a surface
    for (const auto& term : lagged.follower)
      if (std::dynamic_pointer_cast<const RigidLoad<Dim>>(term)) of_wholes.add(term);
    VectorX on_wholes;
    get(of_wholes, on_wholes, nullptr);
    forces.applied -= on_wholes;
    forces.body += on_wholes;
  }
  if (!asked.reaction_forces && !all) return forces;
  get(potential_.sum(lagged), forces.residual, nullptr);
  forces.reaction = VectorX::Zero(bodies);
  for (Eigen::Index i = 0; i < bodies; ++i)
    if (dofs_.unknown[i] == kNone) forces.reaction[i] = -std::exchange(forces.residual[i], 0.0);
  if (rigid_) {
    forces.reaction -= rigid_->reactions(forces.residual);
    forces.residual = rigid_->without_reactions(std::move(forces.residual));
  }
  return forces;
}

template <int Dim>
NodalForces StepProblem<Dim>::forces_at_start(const VectorX& x) {
  Lagged at_x = potential_.lag(x, workspace_);
  lagged_ = {};
  lagged_.pressure = std::move(at_x.pressure);
  lagged_.follower = std::move(at_x.follower);
  NodalForces result = forces(x);
  result.reaction.setZero();
  result.residual.setZero();
  return result;
}

template <int Dim>
VectorX StepProblem<Dim>::total_force(const VectorX& x, const VectorX& v) {
  potential_.set_velocity_reference(x - v / terms_.velocity_rate);
  if (adaptive_) initialize_stiffness(x);
  lagged_ = potential_.lag(x, workspace_);
  EnergySum sum;
  potential_.add_to(sum, lagged_, [](const Traits& term) { return term.kind != TermKind::inertia; });
  VectorX gradient = VectorX::Zero(x.size());
  sum.add_gradient(x, gradient, workspace_);
  return -gradient / terms_.scaling;
}

template <int Dim>
void StepProblem<Dim>::lag_as(const StepProblem& other, const VectorX& x) {
  terms_.contact.friction_velocity = other.terms_.contact.friction_velocity;
  lagged_ = potential_.lag(x, workspace_);
}

template <int Dim>
typename StepProblem<Dim>::Gradients StepProblem<Dim>::gradients(const VectorX& x) {
  const auto of = [&](ForceEntry entry) {
    EnergySum sum;
    potential_.add_to(sum, lagged_, [=](const Traits& term) { return term.force == entry; });
    VectorX gradient = VectorX::Zero(x.size());
    sum.add_gradient(x, gradient, workspace_);
    return gradient;
  };
  Gradients found{of(ForceEntry::none), of(ForceEntry::contact), of(ForceEntry::friction), of(ForceEntry::applied)};
  found.all += found.contact + found.friction + found.applied;
  return found;
}

/// Pressures stay as they are where gaps, or averaged overlaps, shrink: in the plain form they go with the third power of
/// d-hat.
template <int Dim>
typename StepProblem<Dim>::TermAt StepProblem<Dim>::contact_at(const VectorX& x, double factor) {
  ContactOptions options = terms_.contact;
  options.dhat *= factor;
  const double stiffness = stiffness_.value / (options.convergent ? 1 : factor * factor * factor);
  TermAt at{0, VectorX::Zero(x.size())};
  Workspace workspace;  // searches of the problem's own are of its d-hat
  const auto add = [&](std::shared_ptr<const Energy> term) {
    if (surface_.map) term = std::make_shared<MappedEnergy<Dim>>(term, surface_.map);
    at.value += term->value(x, workspace);
    term->add_gradient(x, at.gradient, workspace);
  };
  const CollisionSurface& surface = surface_.surface;
  add(std::make_shared<ContactEnergy<Dim>>(surface, options, stiffness, terms_.scaling));
  if (surface.retraction) {
    CollisionSurface narrower = surface;
    auto retraction = std::make_shared<Retraction>(*surface.retraction);
    for (double& width : retraction->width) width *= factor;
    narrower.retraction = retraction;
    add(std::make_shared<AveragedContact>(narrower, terms_.scaling));
  }
  return at;
}

template <int Dim>
typename StepProblem<Dim>::TermAt StepProblem<Dim>::friction_at(const VectorX& x, double factor) {
  TermAt at{0, VectorX::Zero(x.size())};
  const double velocity = terms_.contact.friction_velocity;
  terms_.contact.friction_velocity *= factor;
  Lagged lagged;
  potential_.lag_friction(x, workspace_, lagged);
  terms_.contact.friction_velocity = velocity;
  if (!lagged.friction) return at;
  at.value = lagged.friction->value(x, workspace_);
  lagged.friction->add_gradient(x, at.gradient, workspace_);
  return at;
}

template <int Dim>
std::vector<TractionOfTie<Dim>> StepProblem<Dim>::tie_tractions() const {
  return tie_ ? tie_->tractions() : std::vector<TractionOfTie<Dim>>();
}

template <int Dim>
SparseSystem& StepProblem<Dim>::assemble(const VectorX& x, PsdProjection psd) {
  PrescribedMotion none;
  system().assemble(sum(), x, psd, dofs_, none, workspace_);
  return system();
}

template <int Dim>
double StepProblem<Dim>::created_energy(const History& history, const VectorX& x) {
  const VectorX &x0 = history.x[0], &v0 = history.v[0];
  const bool trapezoidal = TimeIntegrator(setup_.time).is_trapezoidal(history);
  double rise = 0;
  VectorX gradient = VectorX::Zero(x.size());  // twice the mean over the step
  EnergySum stored;
  potential_.add_to(stored, lagged_, [](const Traits& term) { return term.is_stored; });
  for (const auto& term : stored.terms()) {
    rise += term->value(x, workspace_) - term->value(x0, workspace_);
    term->add_gradient(x, gradient, workspace_);
    term->add_gradient(trapezoidal ? x0 : x, gradient, workspace_);
  }
  const double created = (rise - 0.5 * gradient.dot(x - x0)) / terms_.scaling;
  if (trapezoidal) return created;
  const VectorX change = TimeIntegrator(setup_.time).velocity(x, history) - v0;
  return created - 0.5 * change.dot(momentum(change));
}

template <int Dim>
VectorX StepProblem<Dim>::momentum(const VectorX& v) const {
  VectorX result = VectorX::Zero(v.size());
  if (potential_.inertia()) potential_.inertia()->add_mass_product(v, result);
  coupled_->add_mass_product(base_, v, result);
  return result;
}

template <int Dim>
double StepProblem<Dim>::mechanical_energy(const VectorX& x, const VectorX& v) {
  double energy = 0;
  potential_.for_each(lagged_, [&](TermKind kind, const auto& term) {
    if (traits<Dim>(kind).is_stored && kind != TermKind::host) energy += term->value(x, workspace_) / terms_.scaling;
  });
  return energy + 0.5 * v.dot(momentum(v));
}

/// Densities are differences of terms as large as the moduli.
template <int Dim>
double StepProblem<Dim>::energy_resolution() const {
  double stiffness = 0;
  for (const auto& element : cells_.elements)
    if (!rigid_body_of(setup_.materials.at(element.body)))
      stiffness += element.volume * cells_.turn(rest_barycenter<Dim>(cells_, element)) *
                   setup_.materials.at(element.body).youngs_modulus;
  return kEnergyResolution * stiffness;
}

template <int Dim>
double StepProblem<Dim>::min_distance(const VectorX& x) {
  return potential_.contact() ? potential_.contact()->min_distance(surface_.positions(x), workspace_)
                              : std::numeric_limits<double>::infinity();
}

template <int Dim>
double min_volume_ratio(const CellSet<Dim>& cells, ConstVectorView x) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& element : cells.elements)
    least = std::min(least, element.curved ? min_jacobian_bound<Dim>(at_all_nodes<Dim>(element, x), kVolumeRatioTolerance) *
                                                 element.inverse_edges.determinant()
                                           : deformation_gradient<Dim>(element, x).determinant());
  return least;
}

#define ITR_INSTANTIATE(Dim)       \
  template class StepProblem<Dim>; \
  template double min_volume_ratio<Dim>(const CellSet<Dim>&, ConstVectorView);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
