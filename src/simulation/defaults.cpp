// SPDX-License-Identifier: MIT
// Setup::choose_defaults.
#include <fmt/format.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

#include "barrier_stiffness.hpp"
#include "energy/rigid_body.hpp"
#include "energy/support.hpp"
#include "geometry/shape.hpp"
#include "itr/core.hpp"
#include "itr/setup.hpp"
#include "mesh/facet_measure.hpp"
#include "mesh/rest_box.hpp"
#include "mesh/turn.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/incoming_state.hpp"
#include "simulation/overlap.hpp"
#include "simulation/remesh_step.hpp"
#include "simulation/retraction.hpp"
#include "simulation/step_length.hpp"
#include "simulation/step_problem.hpp"
#include "sizes.hpp"

namespace itr {

namespace {

constexpr double kSoftness = 0.1;          ///< barrier stiffness by modulus: gaps of about dhat / 2 at strains of a tenth
constexpr double kDhatByThickness = 1e-3;  ///< of what surfaces stand off, little beside usual deformations
/// Where prescribed motions press bodies without inertia, gaps add to what these are compressed by. In 3D, chords of
/// curved edges and remeshing, which resolve contact as far as dhat does, would cost too much.
constexpr double kDhatByThicknessIfPressed = 2e-4;
constexpr double kDhatByEdge = 0.1, kDhatByGap = 0.9;
constexpr double kLeastDhat = 0.01;        ///< of that without the gap: what nearly touches presses a little at the start
constexpr double kDhatByOverlap = 0.0005;  ///< of the overlap that is resolved, as long as that leaves kLeastByOverlap
constexpr double kLeastByOverlap = 1e-3;
constexpr double kDhatByMotion = 0.01;    ///< of the way that is prescribed without inertia
constexpr double kDhatByGrowth = 0.0025;  ///< of what eigenstrains change of a thickness: it gives little interference
constexpr int kFirstSteps = 20;           ///< that are looked at: choices do not depend on where the run ends
constexpr double kSlipByMotion = 1e-3;    ///< of the speed that is prescribed: friction is smoothed below that
/// Part of the speed that gravity gives over the bodies' size: bodies that it holds in place creep by less than 1e-4 of
/// their size in the time of a hundred falls over it.
constexpr double kSlipByFall = 5e-7;
constexpr double kLeastSplitEdge = 1e-6;  ///< of the bodies' diagonal at rest
/// Cost that operations may have, in split tolerances. Collapses: with less, meshes stay fine where contact was.
constexpr double kCollapseFraction = 0.01;
/// Swaps and moves for the sake of the shape: hardly more than round-off, as they gain nothing else.
constexpr double kShapeFraction = 1e-6;
constexpr double kUsualStrain2 = 0.01;  ///< square of the strain at which bodies are expected to store energy

/// The largest modulus of bodies that deform [Pa].
template <int Dim>
double stiffest_modulus(const Setup<Dim>& setup) {
  double stiffest = 0;
  for (const auto& [body, material] : setup.materials)
    if (!rigid_body_of(material)) stiffest = std::max(stiffest, material.youngs_modulus);
  return stiffest;
}

/// The largest of a force of time, at times from the first step's to far beyond any end: no choice depends on the end.
template <typename Function>
double largest_norm(const Function& f, const TimeOptions& time) {
  constexpr int kDoublings = 16;
  double largest = 0;
  for (int k = 0; f && k <= kDoublings; ++k)
    if (const double norm = f(time.t0 + std::ldexp(time.dt, k)).norm(); std::isfinite(norm))
      largest = std::max(largest, norm);
  return largest;
}

/// A modulus with which bodies would strain by a hundredth where rigid bodies press or fall on them, those that are there
/// aside [Pa].
template <int Dim>
double usual_modulus(const Setup<Dim>& setup) {
  constexpr double kStrain = 0.01;
  struct Figures {
    Eigen::AlignedBox<double, Dim> own{};
    double mass = 0, speed = 0;
  };
  std::map<const RigidBody*, Figures> bodies;
  for (const CellId c : setup.mesh.live_cells()) {
    const Material& material = setup.materials.at(setup.mesh.body(c));
    const RigidBody* const body = rigid_body_of(material);
    if (!body) continue;
    auto& [own, mass, speed] = bodies[body];
    const Vec<Dim> X = setup.mesh.barycenter(c);
    mass += material.density * setup.mesh.volume(c);
    for (const VertexId v : setup.mesh.cell(c)) own.extend(setup.mesh.rest(v));
    for (const auto& condition : setup.initial_velocity)
      if (condition.body == setup.mesh.body(c)) speed = std::max(speed, condition.value(X, setup.time.t0).norm());
  }
  auto box = rest_box(setup.mesh);
  double pressure = 0;
  for (auto& [body, figures] : bodies) {
    auto& [own, mass, speed] = figures;
    const double size = own.diagonal().norm(), area = std::pow(size, Dim - 1);
    const double gravity =
        setup.body_acceleration ? setup.body_acceleration(Vec<Dim>(own.center()), setup.time.t0).norm() : 0;
    const double load = largest_norm(body->force, setup.time) + largest_norm(body->moment, setup.time) / size;
    pressure = std::max(pressure, (load + mass * gravity) / area);
    if (!setup.time.has_inertia()) continue;
    speed = std::max(speed, prescribed_speed(setup, Vec<Dim>(own.center()), kFirstSteps));
    const double energy = mass * speed * speed + (load + mass * gravity) * box.diagonal().norm();
    pressure = std::max(pressure, energy / (area * size));
  }
  const double usual = std::max(stiffest_modulus(setup), pressure / kStrain);
  constexpr double kAny = 1;  ///< [Pa]: nothing presses, and what parts the bodies presses as little as it has to
  return usual > 0 || bodies.empty() ? usual : kAny;
}

template <int Dim>
void choose_rigid_moduli(Setup<Dim>& setup) {
  constexpr double kRigid = 1e4;  ///< times what else there is: strains of 1e-6, where bodies on it strain by 1e-2
  const double modulus = kRigid * usual_modulus(setup);
  for (auto& [body, material] : setup.materials)
    if (rigid_body_of(material) && modulus > 0) material.youngs_modulus = modulus;
}

/// Mean surface of a vertex on the boundary [m], [m^2].
template <int Dim>
double mean_vertex_area(const Mesh<Dim>& mesh) {
  double area = 0;
  int vertices = 0;
  for (const FacetId f : mesh.live_facets()) {
    Vec<Dim> middle = Vec<Dim>::Zero();
    for (const VertexId v : mesh.facet(f)) middle += mesh.rest(v) / Dim;
    area += facet_measure(mesh, f) * turn_at(mesh, middle);
  }
  for (VertexId v = 0; v < mesh.node_slots(); ++v) vertices += mesh.is_vertex_alive(v) && mesh.is_boundary(v);
  return area / std::max(1, vertices);
}

/// The most that a body grows or shrinks by over its thickness in the first steps, of eigenstrains [m].
template <int Dim>
double prescribed_growth(const Setup<Dim>& setup) {
  const std::map<int, BodySize> sizes = body_sizes(setup.mesh);
  const int steps = setup.time.is_static ? 1 : kFirstSteps;
  double most = 0;
  for (const CellId c : setup.mesh.live_cells()) {
    const int body = setup.mesh.body(c);
    const Material& material = setup.materials.at(body);
    if (!material.eigenstrain) continue;
    Vec<3> X = Vec<3>::Zero();
    X.head<Dim>() = setup.mesh.barycenter(c);
    for (int i = 0; i <= steps; ++i) {
      const Mat<3> strain = material.eigenstrain(X, setup.time.t0 + i * setup.time.dt);
      most = std::max(most, strain.lpNorm<Eigen::Infinity>() * sizes.at(body).thickness);
    }
  }
  return most;
}

/// Kinetic energy at the start, and what gravity gives over the size of the scene [J]; 0 where something else feeds it.
template <int Dim>
double available_energy(const Setup<Dim>& setup) {
  if (!setup.neumann.empty() || !setup.pressure.empty() || !setup.cavities.empty() || !setup.dirichlet.empty() ||
      !setup.obstacles.motions.empty() || setup.contact.resolve_overlap || !couplings_of<Dim>(setup.nodal_loads).empty() ||
      std::ranges::any_of(setup.materials, [](const auto& entry) { return bool(entry.second.eigenstrain); }))
    return 0;
  const Mesh<Dim>& mesh = setup.mesh;
  auto box = rest_box(mesh);
  for (const Vec<Dim>& p : setup.obstacles.rest) box.extend(p);
  double energy = 0;
  for (const CellId c : mesh.live_cells()) {
    const Vec<Dim> X = mesh.barycenter(c);
    const double mass = setup.materials.at(mesh.body(c)).density * mesh.volume(c) * turn_at(mesh, X);
    if (setup.body_acceleration) energy += mass * setup.body_acceleration(X, setup.time.t0).cwiseAbs().dot(box.sizes());
    for (const auto& condition : setup.initial_velocity)
      if (condition.body == mesh.body(c)) {
        energy += mass / 2 * condition.value(X, setup.time.t0).squaredNorm();
        break;
      }
  }
  return energy;
}

}  // namespace

template <int Dim>
double barrier_stiffness_for(const Setup<Dim>& setup, const ContactOptions& contact, double modulus) {
  if (contact.convergent) return kSoftness * modulus;
  // A vertex's surface presses by 2 pairs of weight 1, not by its area over dhat^3.
  return kSoftness * modulus * mean_vertex_area(setup.mesh) / (2 * std::pow(contact.dhat, 3));
}

template double barrier_stiffness_for(const Setup<2>&, const ContactOptions&, double);
template double barrier_stiffness_for(const Setup<3>&, const ContactOptions&, double);

namespace {

template <int Dim>
std::string choose_stiffness(const Setup<Dim>& setup, ContactOptions& contact) {
  const double deformed = stiffest_modulus(setup), stiffest = deformed > 0 ? deformed : usual_modulus(setup);
  contact.barrier_stiffness = barrier_stiffness_for(setup, contact, stiffest);
  const Units& units = setup.units;
  return fmt::format(
      "barrier stiffness {:.3g}: a tenth of the stiffest modulus, {}; "
      "/solver/contact/barrier_stiffness sets another",
      contact.barrier_stiffness / barrier_unit(units, contact), units.text(stiffest, "Pa", 3));
}

/// The longest relative way that conditions, obstacles and eigenstrains prescribe in the first steps, whatever the end of
/// the run [m]; infinity where they move nothing.
template <int Dim>
double prescribed_motion(const Setup<Dim>& setup) {
  double longest = 0;
  try {
    const VectorX first = held_dofs(setup, setup.mesh, setup.time.t0).target;
    const int steps = setup.time.is_static ? 1 : kFirstSteps;
    for (int i = 1; i <= steps; ++i) {
      const double t = setup.time.t0 + setup.time.dt * i;
      longest = std::max(longest, relative_motion<Dim>(held_dofs(setup, setup.mesh, t).target - first));
    }
    longest = std::max(longest, kDhatByGrowth / kDhatByMotion * prescribed_growth(setup));
  } catch (const InputError&) {  // no value at a time that no step asks for
  }
  return longest > 0 ? longest : std::numeric_limits<double>::infinity();
}

/// By what is prescribed and by gravity, the smaller; where neither is there, by waves at strains of a thousandth.
template <int Dim>
std::string choose_friction_velocity(const Setup<Dim>& setup, ContactOptions& contact) {
  constexpr double kStrain = 1e-3;
  const double size = rest_box(setup.mesh).sizes().maxCoeff();
  const Vec<Dim> center = setup.mesh.barycenter(0);
  double prescribed = 0, fall = 0;
  try {
    prescribed = prescribed_speed(setup, center, kFirstSteps);
    if (setup.body_acceleration) fall = std::sqrt(2 * size * setup.body_acceleration(center, setup.time.t0).norm());
  } catch (const InputError&) {  // no value at a time or place that no step asks for
  }
  if (prescribed == 0 && fall == 0)
    for (const auto& [body, material] : setup.materials)
      if (!rigid_body_of(material))
        prescribed = std::max(prescribed, kStrain * std::sqrt(material.youngs_modulus / material.density));
  const bool is_by_fall = fall > 0 && (prescribed == 0 || kSlipByFall * fall < kSlipByMotion * prescribed);
  contact.friction_velocity = is_by_fall ? kSlipByFall * fall : kSlipByMotion * prescribed;
  const Units& units = setup.units;
  return fmt::format("friction is smoothed below {}: {:g} of {}, {}; /contact/epsv sets another",
                     units.text(contact.friction_velocity, "m/s", 3), is_by_fall ? kSlipByFall : kSlipByMotion,
                     is_by_fall ? "the speed of a fall over the bodies' size" : "the fastest motion",
                     units.text(is_by_fall ? fall : prescribed, "m/s", 3));
}

/// A thousandth of the thinnest body, or less where prescribed motions press it, a tenth of the shortest surface edge, a
/// hundredth of what is prescribed without inertia, and less than the gap at the start.
template <int Dim>
std::string choose_dhat(const Setup<Dim>& setup, ContactOptions& contact) {
  double thinnest = std::numeric_limits<double>::infinity(), shortest = thinnest;
  for (const auto& [body, size] : body_sizes(setup.mesh)) thinnest = std::min(thinnest, size.thickness);
  VectorX start = held_dofs(setup, setup.mesh, setup.time.t0).target;
  for (VertexId v = 0; v < setup.mesh.node_slots(); ++v) start.template segment<Dim>(Dim * v) = setup.mesh.rest(v);
  for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f)
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j)
        shortest =
            std::min(shortest, (setup.mesh.rest(setup.mesh.facet(f)[i]) - setup.mesh.rest(setup.mesh.facet(f)[j])).norm());
  const Units& units = setup.units;
  double& dhat = contact.dhat;
  const double motion = setup.time.has_inertia() ? std::numeric_limits<double>::infinity() : prescribed_motion(setup);
  const bool has_curves =
      setup.remesh.curve.enabled || std::ranges::any_of(setup.order, [](const auto& entry) { return entry.second > 1; });
  const bool is_pressed = std::isfinite(motion) && !(Dim == 3 && (has_curves || setup.remesh.enabled));
  const double by_thickness = is_pressed ? kDhatByThicknessIfPressed : kDhatByThickness;
  dhat = std::min({by_thickness * thinnest, kDhatByEdge * shortest, kDhatByMotion * motion});
  double gap = std::numeric_limits<double>::infinity();
  const double overlap = contact.resolve_overlap ? least_overlap(setup, initial_mesh(setup)) : gap;
  dhat = std::min(dhat, std::max(kDhatByOverlap * overlap, kLeastByOverlap * dhat));
  if (!setup.proxy && !contact.resolve_overlap) {
    Workspace workspace;
    Mesh<Dim> mesh = setup.mesh;
    close_coincident_faces(setup, mesh);
    ContactSurface<Dim> surface = contact_surface(setup, mesh);
    surface.surface.closed.dhat = contact.reach_of_closed();
    gap = ContactEnergy<Dim>(surface.surface, contact, 1, 1).min_distance(start, workspace);
    if (gap > 0 && gap < dhat) dhat = std::max(kDhatByGap * gap, kLeastDhat * dhat);
  }
  return fmt::format(
      "d-hat {}: {:g} of the thinnest body ({}), a tenth of the shortest surface edge ({}){}{}{}; /contact/dhat sets "
      "another",
      units.text(dhat, "m"), by_thickness, units.text(thinnest, "m"), units.text(shortest, "m"),
      std::isfinite(motion) ? ", at most a hundredth of what is prescribed, " + units.text(motion, "m") : "",
      std::isfinite(gap) ? ", less than the gap, " + units.text(gap, "m") : "",
      std::isfinite(overlap) ? fmt::format(", {:g} of the overlap, {}", kDhatByOverlap, units.text(overlap, "m")) : "");
}

/// How far surfaces that are tied may overlap where they bend [m].
template <int Dim>
double tie_reach(const Setup<Dim>& setup) {
  constexpr double kByEdge = 0.25;
  const CellSet<Dim> cells = whole_mesh(setup.mesh, {});
  double longest = 0;
  for (const auto& mortar : mortars_of(setup, setup.mesh, cells))
    if (!setup.ties[mortar.tie].jump) longest = std::max(longest, mortar.longest_edge);
  return kByEdge * longest;
}

/// How far faces that coincide at rest may overlap where there is no contact: by what d-hat would be in dynamics [m].
template <int Dim>
double reach_without_contact(const Setup<Dim>& setup) {
  Mesh<Dim> mesh = initial_mesh(setup);
  close_coincident_faces(setup, mesh);
  if (!has_closed_faces(mesh)) return 0;
  Setup<Dim> moving = setup;
  moving.time.is_static = moving.time.quasistatic = false;
  choose_dhat(moving, moving.contact);
  return moving.contact.dhat;
}

/// Chooses the split tolerance [J], and says so.
template <int Dim>
std::string choose_split_tolerance(Setup<Dim>& setup, RemeshOptions& remesh) {
  double energy = 0;
  for (const CellId c : setup.mesh.live_cells())
    if (!rigid_body_of(setup.materials.at(setup.mesh.body(c))))
      energy += kUsualStrain2 * setup.materials.at(setup.mesh.body(c)).youngs_modulus * setup.mesh.volume(c) *
                turn_at(setup.mesh, setup.mesh.barycenter(c));
  const double available = available_energy(setup);
  if (available > 0) energy = std::min(energy, available);
  setup.follows_stored_energy.split = available == 0;
  const double relative = available == 0 ? kStoredFraction * remesh.relative_tolerance : remesh.relative_tolerance;
  const double tolerance = relative * energy;
  remesh.split.acceptance_tolerance = tolerance;
  const Units& units = setup.units;
  const std::string split =
      available == 0 ? fmt::format(
                           "split tolerance: {:g} of the energy that is stored so far, at most {} (strains of a tenth "
                           "everywhere)",
                           relative, units.text(tolerance, "J", 3))
                     : fmt::format("split tolerance {}: {:g} of the scene's energy, about {}", units.text(tolerance, "J", 3),
                                   relative, units.text(energy, "J", 3));
  const std::string collapse = remesh.collapse.acceptance_tolerance
                                   ? units.text(-*remesh.collapse.acceptance_tolerance, "J", 2)
                               : available == 0 ? fmt::format("{:g} of that", kCollapseFraction)
                                                : units.text(kCollapseFraction * tolerance, "J", 2);
  return fmt::format(
      "{}; collapses may cost {}; /space/remesh/relative_tolerance and {{split,collapse}}/acceptance_tolerance set others",
      split, collapse);
}

/// Chooses the tolerances of operations beside splits from that of splits.
void choose_other_tolerances(RemeshOptions& remesh, FollowsStoredEnergy& follows) {
  const double split = *remesh.split.acceptance_tolerance;
  const auto choose = [&](std::optional<double>& tolerance, double fraction, bool& follows_too) {
    follows_too = follows.split && !tolerance;
    tolerance = tolerance.value_or(-fraction * split);
  };
  choose(remesh.collapse.acceptance_tolerance, kCollapseFraction, follows.collapse);
  choose(remesh.swap.acceptance_tolerance, kShapeFraction, follows.swap);
  choose(remesh.smooth.acceptance_tolerance, kShapeFraction, follows.smooth);
}

/// Fits curves through the surfaces of the mesh that is there.
template <int Dim>
void fit_shapes(const Mesh<Dim>& mesh, std::vector<std::shared_ptr<const Shape>>& shapes) {
  for (auto& unfitted : shapes) {
    if (unfitted->kind != Shape::Kind::fitted) continue;
    Shape shape = *unfitted;
    std::vector<std::array<Vec<3>, 2>> segments;
    for (const FacetId f : mesh.live_facets())
      if (std::ranges::find(shape.surfaces, mesh.facet_tag(f)) != shape.surfaces.end()) {
        auto& segment = segments.emplace_back(std::array<Vec<3>, 2>{Vec<3>::Zero(), Vec<3>::Zero()});
        for (int k = 0; k < 2; ++k) segment[k].template head<Dim>() = mesh.rest(mesh.facet(f)[k]);
      }
    shape.fitted = fit_curves(segments, shape.angle);
    unfitted = std::make_shared<const Shape>(std::move(shape));
  }
}

}  // namespace

template <int Dim>
std::vector<std::string> Setup<Dim>::choose_defaults() {
  std::vector<std::string> words;
  ContactOptions& contact = this->contact;
  RemeshOptions& remesh = this->remesh;
  if (!this->ties.empty()) contact.tie_reach = tie_reach(*this);
  if (has_rigid_bodies(this->materials)) choose_rigid_moduli(*this);
  if (contact.adaptive_stiffness && contact.barrier_stiffness == 0) contact.barrier_stiffness = 1;
  if (contact.enabled && contact.dhat == 0) words.push_back(choose_dhat(*this, contact));
  if (!contact.enabled && contact.dhat == 0) contact.tie_reach = std::max(contact.tie_reach, reach_without_contact(*this));
  if (contact.may_average_gaps) contact.average_gaps = averaging_helps(*this);
  if (contact.enabled && contact.average_gaps)
    if (std::string chosen = retract_surfaces(*this); !chosen.empty()) words.push_back(std::move(chosen));
  if (contact.enabled && contact.barrier_stiffness == 0)
    if (std::string chosen = choose_stiffness(*this, contact); !chosen.empty()) words.push_back(std::move(chosen));
  if (contact.enabled && contact.friction_velocity == 0 && this->time.has_inertia()) {
    std::string chosen = choose_friction_velocity(*this, contact);
    if (contact.has_friction()) words.push_back(std::move(chosen));
  }
  if (!remesh.enabled) {
    if (!this->shapes.empty())
      words.emplace_back("surfaces keep their facets: /shapes acts where meshes change, /space/remesh/enabled");
    return words;
  }
  if constexpr (Dim == 2) fit_shapes(mesh, this->shapes);
  if (!remesh.split.min_edge_length) remesh.split.min_edge_length = kLeastSplitEdge * rest_diagonal(mesh);
  if (!remesh.split.acceptance_tolerance) words.push_back(choose_split_tolerance(*this, remesh));
  choose_other_tolerances(remesh, this->follows_stored_energy);
  return words;
}

template std::vector<std::string> Setup<2>::choose_defaults();
template std::vector<std::string> Setup<3>::choose_defaults();

}  // namespace itr
