// SPDX-License-Identifier: MIT
#include "itr/simulation/advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <set>

#include "barrier_stiffness.hpp"
#include "itr/geometry/measures.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSliver = 0.1;                  ///< quality below which an element is one
constexpr double kLargeRatio = 1e3;              ///< of stiffnesses or of element sizes, from which systems are hard
constexpr double kUsualLength[] = {1e-4, 1e3};   ///< of a scene in metres
constexpr double kUsualDensity[] = {10, 3e4};    ///< of solids [kg/m^3]
constexpr double kUsualModulus[] = {1e3, 1e13};  ///< [Pa]
constexpr double kStiffnessRange = 20;           ///< of the barrier's, either way; a hundredfold costs 3 to 9 times
constexpr double kGravity[] = {9.7, 9.9};        ///< [m/s^2]

bool is_outside(double value, const double (&range)[2]) { return value < range[0] || value > range[1]; }

template <int Dim>
std::string vector_text(const Vec<Dim>& v) {
  std::string text;
  for (int c = 0; c < Dim; ++c) text += (c ? ", " : "") + (v[c] == 0 ? "0" : fmt::format("{:+.4g}", v[c]));
  return "(" + text + ")";
}

template <int Dim>
struct MeshFigures {
  double shortest = kInfinity, longest = 0, worst_quality = 1, size = 0;
  CellId worst_cell = 0;
  int slivers = 0;
  Vec<Dim> center = Vec<Dim>::Zero();

  explicit MeshFigures(const Mesh<Dim>& mesh) {
    for (const auto& [a, b] : mesh.edges()) {
      const double length = (mesh.rest(a) - mesh.rest(b)).norm();
      shortest = std::min(shortest, length);
      longest = std::max(longest, length);
    }
    Vec<Dim> low = Vec<Dim>::Constant(kInfinity), high = -low;
    for (CellId c = 0; c < mesh.cell_slots(); ++c) {
      if (!mesh.is_cell_alive(c)) continue;
      std::array<Vec<Dim>, Dim + 1> corners;
      for (int i = 0; i <= Dim; ++i) {
        corners[i] = mesh.rest(mesh.cell(c)[i]);
        low = low.cwiseMin(corners[i]);
        high = high.cwiseMax(corners[i]);
      }
      const double quality = simplex_quality<Dim>(corners);
      slivers += quality < kSliver;
      if (quality < worst_quality) worst_quality = quality, worst_cell = c;
    }
    size = (high - low).maxCoeff();
    center = (low + high) / 2;
  }
};

template <int Dim>
std::map<int, double> volumes_by_body(const Mesh<Dim>& mesh) {
  std::map<int, double> volumes;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.is_cell_alive(c)) volumes[mesh.body(c)] += mesh.volume(c);
  return volumes;
}

template <int Dim>
void find_odd_units(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  if (is_outside(figures.size, kUsualLength))
    found.push_back(fmt::format("the bodies span {:.3g} m: are lengths in metres?", figures.size));
  const bool has_mass = (!setup.time.is_static && !setup.time.quasistatic) || setup.body_acceleration;
  for (const auto& [body, volume] : volumes_by_body(setup.mesh)) {
    const Material& material = setup.materials.at(body);
    if (is_outside(material.youngs_modulus, kUsualModulus))
      found.push_back(fmt::format("body {}: E = {:.3g} Pa is unusual: are moduli in Pa?", body, material.youngs_modulus));
    if (has_mass && is_outside(material.density, kUsualDensity))
      found.push_back(
          fmt::format("body {}: rho = {:.3g} kg/m^{} is unusual: are densities in kg/m^3?", body, material.density, Dim));
  }
}

template <int Dim>
void find_hard_meshes(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  if (figures.slivers > 0)
    found.push_back(fmt::format("{} slivers (quality below {}), the worst is element {} with {:.2g}", figures.slivers,
                                kSliver, figures.worst_cell, figures.worst_quality));
  double softest = kInfinity, stiffest = 0;
  for (const auto& [body, volume] : volumes_by_body(setup.mesh)) {
    softest = std::min(softest, setup.materials.at(body).youngs_modulus);
    stiffest = std::max(stiffest, setup.materials.at(body).youngs_modulus);
  }
  if (stiffest > kLargeRatio * softest)
    found.push_back(fmt::format("stiffness ratio {:.2g} between bodies", stiffest / softest));
  if (figures.longest > kLargeRatio * figures.shortest)
    found.push_back(fmt::format("edges differ in length by a factor of {:.2g}", figures.longest / figures.shortest));
}

/// Newton takes the fewest iterations where the barrier is about as stiff as the bodies (verification/newton).
template <int Dim>
void find_odd_stiffness(const Setup<Dim>& setup, std::vector<std::string>& found) {
  const ContactOptions& contact = setup.contact;
  if (!contact.enabled || contact.adaptive_stiffness || !(contact.barrier_stiffness > 0)) return;
  double softest = kInfinity, stiffest = 0;
  for (const auto& [body, volume] : volumes_by_body(setup.mesh)) {
    softest = std::min(softest, setup.materials.at(body).youngs_modulus);
    stiffest = std::max(stiffest, setup.materials.at(body).youngs_modulus);
  }
  const double low = barrier_stiffness_for(setup, contact, softest), high = barrier_stiffness_for(setup, contact, stiffest);
  if (contact.barrier_stiffness >= low / kStiffnessRange && contact.barrier_stiffness <= kStiffnessRange * high) return;
  const bool is_stiff = contact.barrier_stiffness > high;
  found.push_back(
      fmt::format("barrier stiffness {:.3g} is {:.2g} times what suits the {} body, {:.3g}: Newton may take many "
                  "times the iterations{}",
                  contact.barrier_stiffness, contact.barrier_stiffness / (is_stiff ? high : low),
                  is_stiff ? "stiffest" : "softest", is_stiff ? high : low, is_stiff ? "" : ", and gaps are narrow"));
}

template <int Dim>
void find_held(const Setup<Dim>& setup, std::vector<std::string>& found) {
  const Space space = space_of_orders(setup.mesh, setup.order);
  const std::vector<char> held = held_dofs(setup, setup.mesh, setup.time.t0 + setup.time.dt, space).held;
  if (std::all_of(held.begin(), held.begin() + Dim * num_nodes(setup.mesh, space), [](char h) { return h != 0; }))
    found.emplace_back("every vertex is held: there is nothing to solve for");
}

/// Connected parts of the mesh without a held vertex.
template <int Dim>
int count_loose_parts(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0 + setup.time.dt).held;
  std::vector<int> part(mesh.vertex_slots());
  for (std::size_t v = 0; v < part.size(); ++v) part[v] = static_cast<int>(v);
  const auto find = [&](int v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  for (const auto& [a, b] : mesh.edges()) part[find(a)] = find(b);
  std::set<int> parts, fixed;
  for (VertexId v = 0; v < mesh.vertex_slots(); ++v) {
    if (!mesh.is_vertex_alive(v)) continue;
    parts.insert(find(v));
    for (int c = 0; c < Dim; ++c)
      if (held[Dim * v + c]) fixed.insert(find(v));
  }
  return static_cast<int>(parts.size() - fixed.size());
}

template <int Dim>
void find_loose_bodies(const Setup<Dim>& setup, std::vector<std::string>& found) {
  if (!setup.time.is_static && !setup.time.quasistatic) return;
  if (const int loose = count_loose_parts(setup); loose > 0)
    found.push_back(
        fmt::format("{} of the bodies' parts have neither inertia nor a held vertex: {}", loose,
                    setup.contact.enabled ? "only contact can keep them in place" : "nothing keeps them in place"));
}

template <int Dim>
void find_wrong_gravity(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& found) {
  if (!setup.body_acceleration) return;
  const Vec<Dim> a = setup.body_acceleration(figures.center, setup.time.t0);
  const double most = a.maxCoeff();
  if (most == a.norm() && !is_outside(most, kGravity))
    found.push_back("bodies fall along " + vector_text<Dim>(a) +
                    " m/s^2: a scene's rhs pushes in the negative direction, gravity down y is [0, 9.81]");
}

template <int Dim>
void find_near_surfaces(const Simulation<Dim>& simulation, std::vector<std::string>& found) {
  const Setup<Dim>& setup = simulation.setup();
  if (!setup.contact.enabled) return;
  const ContactSurface<Dim> contact = contact_surface(setup, simulation.state().mesh, simulation.state().space);
  const CollisionSurface& surface = contact.surface;
  const double dhat = setup.contact.activation_distance;
  Workspace workspace;
  const ContactEnergy<Dim> energy(surface, setup.contact, 1, 1);
  const double gap = energy.min_distance(contact.positions(simulation.state().history.x[0]), workspace);
  if (gap < dhat)
    found.push_back(fmt::format(
        "gap {:.3g} m at the start is below d-hat = {:.3g} m: surfaces push each other from the start", gap, dhat));
  double shortest = kInfinity;
  const std::vector<Vec<Dim>> rest =
      setup.proxy ? setup.proxy->rest : node_rest_positions(simulation.state().mesh, simulation.state().space);
  for (const auto& [a, b] : surface.edges)
    if (surface.counts[a]) shortest = std::min(shortest, (rest[a] - rest[b]).norm());
  if (dhat > shortest)
    found.push_back(fmt::format("d-hat = {:.3g} m is above the shortest surface edge, {:.3g} m: surfaces feel themselves",
                                dhat, shortest));
}

/// Amplitude after a step of angle `phase` [rad] of a free oscillation, over that before it.
double damping_of(const TimeOptions& time, double phase) {
  const std::complex<double> i(0, 1);
  if (time.integrator == Integrator::newmark) return 1;
  if (time.integrator == Integrator::implicit_euler || time.bdf_order == 1) return 1 / std::sqrt(1 + phase * phase);
  return std::abs((2.0 + std::sqrt(1.0 + 2.0 * i * phase)) / (3.0 - 2.0 * i * phase));  // the root of BDF2
}

template <int Dim>
void foretell_waves(const Setup<Dim>& setup, const MeshFigures<Dim>& figures, std::vector<std::string>& words) {
  double speed = 0;
  for (const auto& [body, volume] : volumes_by_body(setup.mesh)) {
    const Material& m = setup.materials.at(body);
    speed = std::max(speed, std::sqrt((m.lame_lambda(Dim) + 2 * m.lame_mu()) / m.density));
  }
  const double dt = setup.time.dt;
  words.push_back(
      fmt::format("waves run at up to {:.4g} m/s: through the shortest edge ({:.3g} m) in {:.2g} s, through the bodies "
                  "({:.3g} m) in {:.2g} s; dt = {:g} s",
                  speed, figures.shortest, figures.shortest / speed, figures.size, figures.size / speed, dt));
  const double period = 2 * figures.size / speed, phase = 2 * std::numbers::pi * dt / period;
  const bool is_low_order = setup.time.integrator != Integrator::bdf || setup.time.bdf_order <= 2;
  if (!is_low_order) return;
  const auto lost = [&](const TimeOptions& time) { return 100 * (1 - std::pow(damping_of(time, phase), period / dt)); };
  TimeOptions bdf2;
  bdf2.integrator = Integrator::bdf;
  std::string text = fmt::format(
      "the bodies' longest wave, of period {:.2g} s ({:.3g} steps), loses {:.2g} % of its "
      "amplitude a period by the integrator",
      period, period / dt, lost(setup.time));
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
  find_hard_meshes(setup, figures, found);
  find_wrong_gravity(setup, figures, found);
  find_held(setup, found);
  find_odd_stiffness(setup, found);
  find_loose_bodies(setup, found);
  find_near_surfaces(simulation, found);
  return found;
}

template <int Dim>
std::vector<std::string> foretell(const Setup<Dim>& setup) {
  const MeshFigures<Dim> figures(setup.mesh);
  std::vector<std::string> words;
  double mass = 0, softest = kInfinity, stiffest = 0;
  std::set<bool> plane_strain;
  for (const auto& [body, volume] : volumes_by_body(setup.mesh)) {
    const Material& material = setup.materials.at(body);
    mass += material.density * volume;
    softest = std::min(softest, material.youngs_modulus);
    stiffest = std::max(stiffest, material.youngs_modulus);
    plane_strain.insert(material.plane_strain);
  }
  if (Dim == 2)
    words.push_back(fmt::format("{}, for a thickness of 1 m", plane_strain.size() > 1
                                                                  ? "plane stress and plane strain, by body"
                                                              : *plane_strain.begin() ? "plane strain"
                                                                                      : "plane stress"));
  Vec<Dim> acceleration = Vec<Dim>::Zero();
  if (setup.body_acceleration) acceleration = setup.body_acceleration(figures.center, setup.time.t0);
  words.push_back(setup.body_acceleration
                      ? "bodies accelerate by " + vector_text<Dim>(acceleration) + " m/s^2 (at their centre, at the start)"
                      : std::string("no gravity"));
  words.push_back(fmt::format("total mass {:.4g} kg, weight {:.4g} N; moduli {:.4g} to {:.4g} Pa", mass,
                              mass * acceleration.norm(), softest, stiffest));
  if (!setup.time.is_static && !setup.time.quasistatic) foretell_waves(setup, figures, words);
  return words;
}

template std::vector<std::string> find_suspicious(const Simulation<2>&);
template std::vector<std::string> find_suspicious(const Simulation<3>&);
template std::vector<std::string> foretell(const Setup<2>&);
template std::vector<std::string> foretell(const Setup<3>&);

}  // namespace itr
