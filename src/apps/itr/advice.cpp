// SPDX-License-Identifier: MIT
#include "advice.hpp"
#include "energy/rigid_body.hpp"
#include "energy/support.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "core/connected_parts.hpp"
#include "energy/elastic/law_table.hpp"
#include "itr/core.hpp"
#include "itr/setup.hpp"
#include "long_steps.hpp"
#include "mesh/cell_of_facet.hpp"
#include "mesh/facet_measure.hpp"
#include "mesh_figures.hpp"
#include "resolution.hpp"
#include "simulation/barrier_stiffness.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/incoming_state.hpp"
#include "simulation/named.hpp"
#include "simulation/sizes.hpp"
#include "simulation/step_problem.hpp"
#include "simulation/step_terms.hpp"

namespace itr::cli {

namespace {

constexpr double kResolved = 1e-12;  ///< of the bodies' diagonal

template <int Dim>
using Conditions = std::vector<const DirichletCondition<Dim>*>;

/// Conditions that hold each vertex, the winner last.
template <int Dim>
std::vector<Conditions<Dim>> by_vertex(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const ConditionsByTag<Dim> all = conditions_by_tag<Dim>(setup);
  std::vector<Conditions<Dim>> holding(mesh.node_slots());
  const auto add = [&](VertexId v, const DirichletCondition<Dim>* condition) {
    std::erase(holding[v], condition);
    holding[v].push_back(condition);
  };
  for (const auto& [tag, condition] : all)
    for (const FacetId f : mesh.live_facets())
      if (mesh.facet_tag(f) == tag)
        for (const VertexId v : mesh.facet(f)) add(v, condition);
  for (const auto& [tag, condition] : all)
    for (const VertexId v : mesh.live_vertices())
      if (mesh.vertex_tag(v) == tag) add(v, condition);
  return holding;
}

/// Largest difference of the displacements that two conditions prescribe in a component that both hold, at the ends of the
/// first, the middle and the last step. Less than `resolved` [m] is none.
template <int Dim>
double difference(const DirichletCondition<Dim>& a, const DirichletCondition<Dim>& b, const RestPoint<Dim>& X,
                  const TimeOptions& time, double resolved) {
  constexpr double kRounding = 1e-9;
  double largest = 0;
  for (const int step : {1, (time.steps + 1) / 2, time.steps}) {
    const double t = time.time_after(time.first_step + step);
    const Vec<Dim> of_a = a.displacement(X, t), of_b = b.displacement(X, t);
    for (int c = 0; c < Dim; ++c) {
      if (!a.components[c] || !b.components[c]) continue;
      const double by = std::abs(of_a[c] - of_b[c]);
      if (by > std::max(resolved, kRounding * std::max(std::abs(of_a[c]), std::abs(of_b[c]))))
        largest = std::max(largest, by);
    }
  }
  return largest;
}

struct Contradiction {
  int vertices = 0;
  VertexId worst = kNone;
  double by = 0;  ///< [m]
};

/// Adds a sentence for each two Dirichlet conditions that ask for different displacements of a vertex which both hold: that
/// of the larger id counts, and that of points before that of surfaces (see HeldRule).
template <int Dim>
void find_contradictions(const Setup<Dim>& setup, std::vector<std::string>& found) {
  std::map<std::pair<int, int>, Contradiction> all;  // of the id that loses and of the one that wins
  const std::vector<Conditions<Dim>> holding = by_vertex(setup);
  const double resolved = kResolved * rest_diagonal(setup.mesh);
  for (VertexId v = 0; v < setup.mesh.node_slots(); ++v)
    for (std::size_t i = 0; i < holding[v].size(); ++i)
      for (std::size_t j = i + 1; j < holding[v].size(); ++j) {
        const auto &loser = *holding[v][i], &winner = *holding[v][j];
        double by = 0;
        try {
          by = difference<Dim>(loser, winner, setup.mesh.point(v), setup.time, resolved);
        } catch (const InputError&) {  // the step that asks for it says so
          continue;
        }
        if (!(by > 0)) continue;
        Contradiction& here = all[{loser.tag, winner.tag}];
        ++here.vertices;
        if (by > here.by) here = {here.vertices, v, by};
      }
  for (const auto& [ids, here] : all) {
    const std::string winner = set_text(setup.names.surfaces, ids.second);
    found.push_back(fmt::format(
        "the Dirichlet conditions of the ids {} and {} contradict each other at {} vertices that both hold, by up to {} at "
        "{}: that of {} counts there",
        set_text(setup.names.surfaces, ids.first), winner, here.vertices, setup.units.text(here.by, "m", 3),
        point_text<Dim>(setup.mesh.rest(here.worst), setup.units, 4), winner));
  }
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLargeRatio = 1e3;              ///< of element sizes, from which systems are hard
constexpr double kUsualLength[] = {1e-4, 1e3};   ///< of a scene in metres
constexpr double kLargePart = 5;                 ///< of what touches or falls [m]: above it lengths may be millimetres
constexpr double kUsualDensity[] = {10, 3e4};    ///< of solids [kg/m^3]
constexpr double kAnyDensity[] = {1e-3, 3e4};    ///< of what scenes without inertia write [kg/m^3]
constexpr double kUsualModulus[] = {1e3, 1e13};  ///< [Pa]
constexpr double kDense = 2200;                  ///< [kg/m^3]: of minerals and metals, above plastics and rubbers
constexpr double kSoft = 1e7;                    ///< [Pa], softer than what is dense
constexpr double kStiffnessRange = 20;           ///< of the barrier's, either way; a hundredfold costs 3 to 9 times
constexpr double kRoundFraction = 0.01;          ///< of a body's volume, from which rounds are told of
constexpr double kGravity[] = {9.7, 9.9};        ///< [m/s^2]

bool is_outside(double value, const double (&range)[2]) { return value < range[0] || value > range[1]; }

template <int Dim>
std::string vector_text(const Vec<Dim>& v) {
  std::string text;
  for (int c = 0; c < Dim; ++c) text += (c ? ", " : "") + (v[c] == 0 ? "0" : fmt::format("{:+.4g}", v[c]));
  return "(" + text + ")";
}

/// Least and greatest Young's modulus of the bodies [Pa].
template <int Dim>
std::pair<double, double> range_of_moduli(const Setup<Dim>& setup, const MeshFigures<Dim>& figures) {
  double softest = kInfinity, stiffest = 0;
  for (const auto& [body, of_body] : figures.bodies) {
    if (rigid_body_of(setup.materials.at(body))) continue;
    softest = std::min(softest, setup.materials.at(body).youngs_modulus);
    stiffest = std::max(stiffest, setup.materials.at(body).youngs_modulus);
  }
  return {softest, stiffest};
}

template <int Dim>
void find_odd_units(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  const bool has_named_units = !setup.units.is_si();
  const bool is_large = !has_named_units && figures.size > kLargePart && (setup.contact.enabled || setup.body_acceleration);
  if (is_large || is_outside(figures.size, kUsualLength))
    found.push_back(
        has_named_units
            ? fmt::format("the bodies span {}: is /units/length right?", setup.units.text(figures.size, "m"))
            : fmt::format("the bodies span {:.4g} m: are lengths in metres? (for a mesh in millimetres /geometry/*/unit is "
                          "\"mm\", for a whole scene /units/length)",
                          figures.size));
  const bool has_mass = setup.time.has_inertia() || setup.body_acceleration;
  for (const auto& [body, of_body] : figures.bodies) {
    const Material& material = setup.materials.at(body);
    if (rigid_body_of(material)) continue;
    if (is_outside(material.youngs_modulus, kUsualModulus))
      found.push_back(fmt::format("body {}: E = {} is unusual: are moduli in {}?", set_text(setup.names.bodies, body),
                                  setup.units.text(material.youngs_modulus, "Pa", 3), setup.units.name("Pa")));
    else if (!has_named_units && material.youngs_modulus < kSoft && material.density > kDense &&
             material.density < kUsualDensity[1])
      found.push_back(fmt::format("body {}: E = {:.3g} Pa is unusual at a density of {:.4g} kg/m^3: are moduli in Pa?",
                                  set_text(setup.names.bodies, body), material.youngs_modulus, material.density));
    // Densities of no matter are of other units, as moduli then are, also where no mass counts.
    if (is_outside(material.density, has_mass ? kUsualDensity : kAnyDensity))
      found.push_back(fmt::format("body {}: rho = {:.3g} {} is unusual: are densities in {}?",
                                  set_text(setup.names.bodies, body), setup.units.from_si(material.density, "kg/m^3"),
                                  setup.units.name("kg/m^3"), setup.units.name("kg/m^3")));
  }
}

template <int Dim>
void find_odd_friction(const Setup<Dim>& setup, std::vector<std::string>& found) {
  constexpr double kUsual = 2;
  const double friction = setup.contact.largest_friction();
  if (setup.contact.enabled && friction > kUsual)
    found.push_back(fmt::format("friction coefficient {:.4g} is unusual: 0.3 is 30 %", friction));
}

template <int Dim>
void find_hard_meshes(const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  if (figures.slivers > 0)
    found.push_back(fmt::format("{} slivers (quality below {}), the worst is element {} with {:.2g}", figures.slivers,
                                kSliver, figures.worst_cell, figures.worst_quality));
  if (figures.edges.longest > kLargeRatio * figures.edges.shortest)
    found.push_back(
        fmt::format("edges differ in length by a factor of {:.2g}", figures.edges.longest / figures.edges.shortest));
}

/// Newton takes the fewest iterations where the barrier is about as stiff as the bodies (verification/newton).
template <int Dim>
void find_odd_stiffness(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  const ContactOptions& contact = setup.contact;
  if (!contact.enabled || contact.adaptive_stiffness || !(contact.barrier_stiffness > 0)) return;
  const auto [softest, stiffest] = range_of_moduli(setup, figures);
  const double low = barrier_stiffness_for(setup, contact, softest), high = barrier_stiffness_for(setup, contact, stiffest);
  if (!(high > 0)) return;  // of rigid bodies alone
  if (contact.barrier_stiffness >= low / kStiffnessRange && contact.barrier_stiffness <= kStiffnessRange * high) return;
  const bool is_stiff = contact.barrier_stiffness > high;
  const double unit = barrier_unit(setup.units, contact);
  found.push_back(fmt::format(
      "barrier stiffness {:.3g} is {:.2g} times what suits the {} body, {:.3g}: Newton may take many "
      "times the iterations{}",
      contact.barrier_stiffness / unit, contact.barrier_stiffness / (is_stiff ? high : low),
      is_stiff ? "stiffest" : "softest", (is_stiff ? high : low) / unit, is_stiff ? "" : ", and gaps are narrow"));
}

template <int Dim>
void find_held(const Setup<Dim>& setup, std::vector<std::string>& found) {
  const Mesh<Dim> mesh = initial_mesh(setup);
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0 + setup.time.dt).held;
  if (std::all_of(held.begin(), held.begin() + Dim * mesh.num_nodes(), [](char h) { return h != 0; }))
    found.emplace_back("every vertex is held: there is nothing to solve for");
}

/// Bodies that have a connected part without a held vertex, and how many such parts there are.
template <int Dim>
std::pair<std::set<int>, int> find_loose_parts(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0 + setup.time.dt).held;
  std::vector<EdgeKey> edges = mesh.edges();
  const CellSet<Dim> cells = setup.ties.empty() ? CellSet<Dim>() : whole_mesh(mesh, {});
  for (const auto& mortar : mortars_of(setup, mesh, cells))
    for (const auto& row : mortar.rows)
      for (const int node : row.nodes) edges.push_back({row.nodes.front(), node});
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads)) {
    VertexId first = kNone;  // rigid surfaces are one part
    for (const FacetId f : mesh.live_facets())
      if (coupling->is_rigid && std::ranges::find(coupling->surfaces, mesh.facet_tag(f)) != coupling->surfaces.end()) {
        if (first == kNone) first = mesh.facet(f)[0];
        edges.push_back({first, mesh.facet(f)[0]});
      }
  }
  const std::vector<int> part = connected_parts<2>(mesh.node_slots(), edges);
  std::set<int> fixed, loose, bodies;
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    for (int c = 0; c < Dim; ++c)
      if (mesh.is_vertex_alive(v) && held[Dim * v + c]) fixed.insert(part[v]);
  for (const CellId c : mesh.live_cells())
    if (const RigidBody* const rigid = rigid_body_of(setup.materials.at(mesh.body(c))); rigid && rigid->is_held())
      fixed.insert(part[mesh.cell(c)[0]]);
  std::set<int> supported;  // tags
  for (const auto& spring : springs_of<Dim>(setup.nodal_loads))
    supported.insert(spring->surfaces.begin(), spring->surfaces.end());
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads))
    if (coupling->is_held() || !coupling->stiffness.isZero(0))
      supported.insert(coupling->surfaces.begin(), coupling->surfaces.end());
  for (const FacetId f : mesh.live_facets())
    if (supported.contains(mesh.facet_tag(f))) fixed.insert(part[mesh.facet(f)[0]]);
  for (const CellId c : mesh.live_cells()) {
    if (fixed.contains(part[mesh.cell(c)[0]])) continue;
    loose.insert(part[mesh.cell(c)[0]]);
    bodies.insert(mesh.body(c));
  }
  return {bodies, static_cast<int>(loose.size())};
}

/// A load on vertices that are held in all directions changes their reactions only.
template <int Dim>
void find_held_loads(const Setup<Dim>& setup, std::vector<std::string>& found) {
  const Mesh<Dim>& mesh = setup.mesh;
  std::set<int> tags;
  for (const auto& load : setup.neumann) tags.insert(load.tag);
  for (const auto& load : setup.pressure) tags.insert(tag_without_fluid(setup.fluids, load.tag));
  for (const Cavity& cavity : setup.cavities) tags.insert(cavity.surfaces.begin(), cavity.surfaces.end());
  if (tags.empty() || setup.dirichlet.empty()) return;
  std::set<int> free_tags;
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0 + setup.time.dt).held;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    for (const int v : mesh.facet(f))
      for (int c = 0; c < Dim; ++c)
        if (!held[Dim * v + c]) free_tags.insert(mesh.facet_tag(f));
  for (const int tag : tags)
    if (!free_tags.contains(tag))
      found.push_back(fmt::format("a load acts on the surface {}, of which all vertices are held: it moves nothing",
                                  set_text(setup.names.surfaces, tag)));
}

template <int Dim>
void find_loose_bodies(const Setup<Dim>& setup, std::vector<std::string>& found) {
  if (setup.time.has_inertia()) return;
  const auto [bodies, parts] = find_loose_parts(setup);
  if (parts == 0) return;
  std::string names;
  for (const int body : bodies) names += (names.empty() ? "" : ", ") + set_text(setup.names.bodies, body);
  const bool has_friction = setup.contact.has_friction();
  found.push_back(fmt::format("{} of the bodies' parts have neither inertia nor a held vertex (id {}): {}", parts, names,
                              !setup.contact.enabled ? "nothing keeps them in place"
                              : has_friction         ? "only contact and friction can keep them in place"
                                                     : "only contact can keep them in place, and without friction it does "
                                                       "not keep them from sliding off"));
}

/// By body, the surface of which all vertices are held in all directions [m^(Dim-1)].
template <int Dim>
std::map<int, double> bonded_surfaces(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0 + setup.time.dt).held;
  std::map<int, double> surfaces;
  for (const FacetId f : mesh.live_facets()) {
    const auto is_held = [&](int v) { return std::all_of(&held[Dim * v], &held[Dim * v] + Dim, std::identity()); };
    if (std::ranges::all_of(mesh.facet(f), is_held)) surfaces[mesh.body(cell_of_facet(mesh, f))] += facet_measure(mesh, f);
  }
  return surfaces;
}

/// Linear elements that are too stiff: nearly incompressible bodies, and thin ones with few cells through the thickness.
template <int Dim>
void find_locking(const Setup<Dim>& setup, std::vector<std::string>& found) {
  constexpr double kIncompressible = 0.485, kSlender = 0.15;
  // Beams of n layers of linear triangles bend too little: forces are off by 3.3 / n^2, and remeshing makes the layers
  // finer.
  constexpr double kOfLayers = 3.3;
  constexpr double kBonded = 0.4;  // of the surface: such a body does not bend
  const double few_layers = setup.remesh.enabled ? 3 : 8;
  std::map<int, double> bonded = bonded_surfaces(setup);
  for (const auto& [body, size] : body_sizes(setup.mesh)) {
    const Material& material = setup.materials.at(body);
    if (rigid_body_of(material)) continue;
    const std::string name = set_text(setup.names.bodies, body);
    const auto order = setup.order.find(body);
    if (order != setup.order.end() && order->second == 2) continue;
    const double layers = size.thickness / size.mean_edge;
    const char* help =
        "quadratic elements (/space/discr_order: 2), remeshing (/space/remesh/enabled) or a finer mesh (n_refs) help: "
        "compare";
    const bool keeps_volume =
        (Dim == 3 || material.plane_strain || setup.mesh.is_axisymmetric()) && material.volume == VolumeForm::pointwise;
    const bool is_thin =
        size.thickness < kSlender * size.diagonal && layers < few_layers && bonded[body] < kBonded * size.surface;
    if (setup.remesh.enabled) {
      if (is_thin)
        found.push_back(
            fmt::format("body {}: thin, with about {:.2g} linear elements through its thickness: where it bends they are "
                        "too stiff until "
                        "remeshing has refined them; compare with quadratic elements (/space/discr_order: 2)",
                        name, layers));
      if (keeps_volume && material.poisson_ratio >= kIncompressible)
        found.push_back(fmt::format(
            "body {}: nu = {:.4g} with linear elements, which lock: remeshing takes a part of that away, but forces may "
            "stay too large, by a tenth to a third where that was measured; compare with {} (/materials/*/volume)",
            name, material.poisson_ratio,
            setup.mesh.is_axisymmetric() || setup.remesh.curve.enabled
                ? "a fixed mesh, where volumes are averaged over patches"
                : "volumes that are averaged over patches"));
    } else if (keeps_volume && material.poisson_ratio >= kIncompressible)
      found.push_back(fmt::format(
          "body {}: nu = {:.4g} with linear elements, about {:.2g} of them through its thickness: they "
          "lock, forces are too large, often several times; {}{}",
          name, material.poisson_ratio, layers,
          may_average_volume(material, setup.mesh.is_axisymmetric() ? 3 : Dim) ? "patches (/materials/*/volume), " : "",
          help));
    else if (is_thin)
      found.push_back(
          fmt::format("body {}: thin, with about {:.2g} linear elements through its thickness: where it bends, forces are "
                      "{}; {}",
                      name, layers,
                      layers < 2 ? std::string("several times too large")
                                 : fmt::format("too large by about {:.0f} %", 100 * kOfLayers / (layers * layers)),
                      help));
  }
}

template <int Dim>
void find_wrong_gravity(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  if (!setup.body_acceleration) return;
  const Vec<Dim> a = setup.body_acceleration(figures.center, setup.time.t0);
  const double most = a.maxCoeff();
  if (most == a.norm() && !is_outside(most, kGravity))
    found.push_back("bodies fall along " + vector_text<Dim>(a / setup.units.factor("m/s^2")) + " " +
                    setup.units.name("m/s^2") + ": a scene's rhs pushes in the negative direction, gravity down y is [0, " +
                    fmt::format("{:.4g}", setup.units.from_si(9.81, "m/s^2")) + "]");
  for (const double factor : {1e-6, 1e-3, 1e3, 1e6})  // of millimetres, and of milliseconds
    if (!is_outside(a.norm() / factor, kGravity))
      found.push_back(fmt::format("bodies accelerate by {}: is gravity meant, {}?", setup.units.text(a.norm(), "m/s^2"),
                                  setup.units.text(a.norm() / factor, "m/s^2")));
}

/// Before a run: what Newton steps of the length where it ends are worth in the stiffest body, against a split.
template <int Dim>
void find_loose_tolerance(const Simulation<Dim>& simulation, std::vector<std::string>& found) {
  constexpr double kFraction = 0.01;
  const Setup<Dim>& setup = simulation.setup();
  if (!setup.remesh.enabled || setup.remesh.sizing_field.enabled || setup.newton.norm != NewtonNorm::euclidean) return;
  double stiffness = 0;
  for (const auto& [body, size] : body_sizes(setup.mesh))
    if (!rigid_body_of(setup.materials.at(body)))
      stiffness = std::max(stiffness, setup.materials.at(body).youngs_modulus * std::pow(size.mean_edge, Dim - 2));
  const double step = setup.newton.step_tolerance, worth = stiffness * step * step / 2;
  const double split = *setup.remesh.split.acceptance_tolerance;
  if (worth > kFraction * split)
    found.push_back(fmt::format(
        "Newton ends at steps of {}, which are worth about {}; a split is made for {}{}: refinement "
        "may see the residual, not the solution; a smaller /solver/nonlinear/x_delta, or none of these tolerances",
        setup.units.text(step, "m", 2), setup.units.text(worth, "J", 2), setup.units.text(split, "J", 2),
        setup.follows_stored_energy.split ? " at most" : ""));
}

template <int Dim>
void find_near_surfaces(const Simulation<Dim>& simulation, std::vector<std::string>& found) {
  const Setup<Dim>& setup = simulation.setup();
  if (!setup.contact.enabled) return;
  const State<Dim>& state = simulation.state();
  const double dhat = setup.contact.dhat;
  Workspace workspace;
  const ContactSurface<Dim> contact = contact_surface(setup, state.mesh, state.chords);
  const ContactEnergy<Dim> energy(contact.surface, setup.contact, 1, 1);
  const double gap = energy.min_distance(contact.positions(state.history.x[0]), workspace);
  if (gap < dhat && !setup.contact.resolve_overlap)  // which has its own words
    found.push_back(fmt::format("gap {} at the start is below d-hat = {}: surfaces push each other from the start",
                                setup.units.text(gap, "m", 6), setup.units.text(dhat, "m", 6)));
  constexpr double kSmall = 0.02, kLarge = 0.1;
  for (const auto& [body, size] : body_sizes(setup.mesh))
    if (dhat > kSmall * size.thickness)
      found.push_back(fmt::format(
          "d-hat = {} is {:.2g} % of the thickness of body {}, {}: surfaces stand off by up to that, as if what "
          "presses were thicker: forces may be too large by {} percent; /contact/dhat = \"auto\" takes a thousandth",
          setup.units.text(dhat, "m"), 100 * dhat / size.thickness, set_text(setup.names.bodies, body),
          setup.units.text(size.thickness, "m"), dhat > kLarge * size.thickness ? "tens of" : "some"));
  double shortest = kInfinity;
  const std::vector<Vec<Dim>> rest = setup.proxy ? setup.proxy->rest : state.mesh.rest();
  const CollisionSurface surface = contact_surface(setup, state.mesh).surface;  // of nodes alone
  for (const auto& [a, b] : surface.edges)
    if (surface.counts[a]) shortest = std::min(shortest, (rest[a] - rest[b]).norm());
  if (dhat > shortest)
    found.push_back(fmt::format("d-hat = {} is above the shortest surface edge, {}: surfaces feel themselves",
                                setup.units.text(dhat, "m", 6), setup.units.text(shortest, "m", 6)));
}

/// Amplitude after a step of angle `phase` [rad] of a free oscillation, over that before it.
double damping_of(const TimeOptions& time, double phase) {
  const std::complex<double> i(0, 1);
  if (time.integrator == Integrator::newmark) return 1;
  if (time.integrator == Integrator::implicit_euler || time.bdf_order == 1) return 1 / std::sqrt(1 + phase * phase);
  return std::abs((2.0 + std::sqrt(1.0 + 2.0 * i * phase)) / (3.0 - 2.0 * i * phase));  // the root of BDF2
}

/// Whether impacts or loads are strong enough for waves: by the strain that they make, a speed over that of waves.
template <int Dim>
bool has_waves(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, double wave_speed) {
  constexpr double kStrain = 1e-3;
  if (driven_speed(setup, figures.size, figures.center) > kStrain * wave_speed) return true;
  const double strong = kStrain * range_of_moduli(setup, figures).first;
  const double t = setup.time.t0 + setup.time.dt;  // what is there at once
  return std::any_of(setup.neumann.begin(), setup.neumann.end(),
                     [&](const auto& c) { return c.traction(figures.center, t).norm() > strong; }) ||
         std::any_of(setup.pressure.begin(), setup.pressure.end(),
                     [&](const auto& c) { return std::abs(c.pressure(figures.center, t)) > strong; });
}

template <int Dim>
void foretell_waves(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& words) {
  double speed = 0;
  for (const auto& [body, of_body] : figures.bodies) {
    const Material& m = setup.materials.at(body);
    speed = std::max(speed, std::sqrt((m.lame_lambda(Dim) + 2 * m.lame_mu()) / m.density));
  }
  if (setup.time.adaptive.enabled || !has_waves(setup, figures, speed)) return;
  const Units& units = setup.units;
  const double dt = setup.time.dt;
  words.push_back(
      fmt::format("waves run at up to {}: through the shortest edge ({}) in {}, through the bodies ({}) in {}; dt = {}",
                  units.text(speed, "m/s"), units.text(figures.edges.shortest, "m", 3),
                  units.text(figures.edges.shortest / speed, "s", 2), units.text(figures.size, "m", 3),
                  units.text(figures.size / speed, "s", 2), units.text(dt, "s", 6)));
  const double period = 2 * figures.size / speed, phase = 2 * std::numbers::pi * dt / period;
  const bool is_low_order = setup.time.integrator != Integrator::bdf || setup.time.bdf_order <= 2;
  if (!is_low_order) return;
  const auto lost = [&](const TimeOptions& time) { return 100 * (1 - std::pow(damping_of(time, phase), period / dt)); };
  TimeOptions bdf2;
  bdf2.integrator = Integrator::bdf;
  std::string text = fmt::format(
      "the bodies' longest wave, of period {} ({:.3g} steps), loses {:.2g} % of its "
      "amplitude a period by the integrator",
      units.text(period, "s", 2), period / dt, lost(setup.time));
  if (setup.time.integrator == Integrator::implicit_euler)
    text += fmt::format(" (BDF2: {:.2g} %); shorter waves, as impacts make them, lose more", lost(bdf2));
  words.push_back(text);
}

}  // namespace

template <int Dim>
std::vector<std::string> find_suspicious(const Simulation<Dim>& simulation) {
  const Setup<Dim>& setup = simulation.setup();
  const MeshFigures<Dim> figures(setup.mesh);
  std::vector<std::string> found;
  find_odd_units(setup, figures, found);
  find_odd_friction(setup, found);
  find_hard_meshes(figures, found);
  find_wrong_gravity(setup, figures, found);
  find_held(setup, found);
  find_contradictions(setup, found);
  find_held_loads(setup, found);
  find_odd_stiffness(setup, figures, found);
  find_loose_bodies(setup, found);
  find_locking(setup, found);
  find_loose_tolerance(simulation, found);
  find_near_surfaces(simulation, found);
  find_unresolved(simulation, found);
  find_long_steps(setup, figures.size, figures.center, found);
  return found;
}

template <int Dim>
std::vector<std::string> foretell(const Setup<Dim>& setup) {
  const MeshFigures<Dim> figures(setup.mesh);
  const Units& units = setup.units;
  std::vector<std::string> words;
  double mass = 0;
  std::set<bool> plane_strain;
  for (const auto& [body, of_body] : figures.bodies) {
    const Material& material = setup.materials.at(body);
    mass += material.density * of_body.volume;
    plane_strain.insert(material.plane_strain);
  }
  if (setup.mesh.is_axisymmetric())
    words.push_back("bodies of revolution about x = 0: masses, forces and energies of the full turn");
  else if (Dim == 2)
    words.push_back(fmt::format("{}, for a thickness of 1 {}",
                                plane_strain.size() > 1 ? "plane stress and plane strain, by body"
                                : *plane_strain.begin() ? "plane strain"
                                                        : "plane stress",
                                setup.units.length()));
  Vec<Dim> acceleration = Vec<Dim>::Zero();
  if (setup.body_acceleration) acceleration = setup.body_acceleration(figures.center, setup.time.t0);
  words.push_back(setup.body_acceleration
                      ? "bodies accelerate by " + vector_text<Dim>(acceleration / units.factor("m/s^2")) + " " +
                            units.name("m/s^2") + " (at their centre, at the start)"
                      : std::string("no gravity"));
  const auto [softest, stiffest] = range_of_moduli(setup, figures);
  words.push_back(fmt::format("total mass {}, weight {}; moduli {:.4g} to {}", units.text(mass, "kg"),
                              units.text(mass * acceleration.norm(), "N"), units.from_si(softest, "Pa"),
                              units.text(stiffest, "Pa")));
  for (const auto& [body, fraction] : fractions_of_rounds(setup.mesh))
    if (fraction > kRoundFraction)
      words.push_back(fmt::format(
          "the facets of body {} are off the rounds that they may stand for by about {:.2g} % of its volume: a finer mesh "
          "follows rounds, remeshing keeps the facets",
          set_text(setup.names.bodies, body), 100 * fraction));
  if (setup.time.has_inertia()) foretell_waves(setup, figures, words);
  return words;
}

template std::vector<std::string> find_suspicious(const Simulation<2>&);
template std::vector<std::string> find_suspicious(const Simulation<3>&);
template std::vector<std::string> foretell(const Setup<2>&);
template std::vector<std::string> foretell(const Setup<3>&);

}  // namespace itr::cli
