// SPDX-License-Identifier: MIT
#include "itr/setup.hpp"
#include "energy/rigid_body.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "energy/cavity.hpp"
#include "energy/mortar.hpp"
#include "fem/locator.hpp"
#include "geometry/shape.hpp"
#include "itr/core.hpp"
#include "mesh/cell_of_facet.hpp"
#include "mesh/facet_tags.hpp"
#include "simulation/coupled_points.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/force_target.hpp"
#include "simulation/named.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

namespace {

[[noreturn]] void refuse(const std::string& place, const std::string& found, const std::string& expected) {
  throw InputError({"", place, found, expected});
}

void require(bool ok, const std::string& place, double found, const std::string& expected) {
  if (!ok || !std::isfinite(found)) refuse(place, fmt::format("{:g}", found), expected);
}

void require_positive(const std::string& place, double value) { require(value > 0, place, value, "a number > 0"); }
void require_not_negative(const std::string& place, double value) { require(value >= 0, place, value, "a number >= 0"); }
void require_at_least(const std::string& place, int value, int least) {
  require(value >= least, place, value, fmt::format("an integer >= {}", least));
}

std::string element(const char* list, std::size_t index) { return fmt::format("{}[{}]", list, index); }

void check_time(const TimeOptions& time) {
  require(is_step_length(time.dt), "/time/dt", time.dt, kStepLength);
  require(true, "/time/t0", time.t0, "a number");
  require_at_least("/time/time_steps", time.steps, 1);
  require(time.bdf_order >= 1 && time.bdf_order <= 6, "/time/integrator/steps", time.bdf_order, "1 to 6");
  require(time.newmark_beta > 0 && time.newmark_beta <= 0.5, "/time/integrator/beta", time.newmark_beta,
          "a number of (0, 0.5]");
  require(time.newmark_gamma > 0 && time.newmark_gamma <= 1, "/time/integrator/gamma", time.newmark_gamma,
          "a number of (0, 1]");
  if (!(time.energy_growth_limit > 0))
    refuse("/time/integrator/energy_growth_limit", fmt::format("{}", time.energy_growth_limit), "a number > 0");
  require(time.step_cuts >= 0 && time.step_cuts <= 20, "/time/step_cuts", time.step_cuts, "0 to 20");
}

/// Two coefficients of friction: their directions, and that they fall by one ratio.
void check_across(const std::string& place, const FrictionPair& pair, int dim) {
  const FrictionAcross& across = *pair.across;
  require_not_negative(place + "/static", across.statics);
  require_not_negative(place + "/kinetic", across.kinetic);
  require(across.kinetic <= across.statics, place + "/kinetic", across.kinetic,
          fmt::format("at most the static coefficient, {}", across.statics));
  constexpr double kSameRatio = 1.001e-3;
  require(
      std::abs(pair.kinetic * across.statics - across.kinetic * pair.statics) <= kSameRatio * pair.statics * across.statics,
      place + "/kinetic", across.kinetic, "kinetic by static as the same ratio in both directions");
  if (!pair.has_two()) return;
  if (dim == 2) refuse(place, "two coefficients", "one coefficient: in the plane, surfaces slide along one line only");
  require_positive(place + "/direction", across.direction.norm());
}

void check_contact(const ContactOptions& contact, int dim) {
  if (!contact.enabled) return;
  require_not_negative("/contact/dhat", contact.dhat);
  require_not_negative("/solver/contact/barrier_stiffness", contact.barrier_stiffness);
  require_not_negative("/contact/friction_coefficient", contact.friction_coefficient);
  const auto& pairs = contact.friction_pairs;
  require(pairs.size() <= kMostFrictionPairs, "/contact/friction_pairs", static_cast<double>(pairs.size()),
          fmt::format("at most {}", kMostFrictionPairs));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string place = fmt::format("/contact/friction_pairs/{}", i);
    require_not_negative(place + "/static", pairs[i].statics);
    require_not_negative(place + "/kinetic", pairs[i].kinetic);
    require(pairs[i].kinetic <= pairs[i].statics, place + "/kinetic", pairs[i].kinetic,
            fmt::format("at most the static coefficient, {}", pairs[i].statics));
    if (pairs[i].across) check_across(place, pairs[i], dim);
  }
  require_not_negative("/contact/epsv", contact.friction_velocity);
  require_not_negative("/solver/contact/friction_convergence_tol", contact.friction_tolerance);
}

void check_newton(const NewtonOptions& newton) {
  require_at_least("/solver/nonlinear/max_iterations", newton.max_iterations, 1);
  require_not_negative("/solver/nonlinear/force_tol", newton.force_tolerance);
  require_not_negative("newton.step_tolerance", newton.step_tolerance);
  require_not_negative("newton.gradient_tolerance", newton.gradient_tolerance);
  require_not_negative("newton.first_gradient_tolerance", newton.first_gradient_tolerance);
  require_not_negative("newton.relative_step_tolerance", newton.relative_step_tolerance);
  require_not_negative("newton.relative_gradient_tolerance", newton.relative_gradient_tolerance);
  require_not_negative("newton.decrement_tolerance", newton.decrement_tolerance);
  require_not_negative("newton.energy_tolerance", newton.energy_tolerance);
}

void check_remeshing(const RemeshOptions& remesh) {
  if (!remesh.enabled) return;
  const auto fraction = [](const char* place, double value) {
    require(value >= 0 && value <= 1, place, value, "a number of [0, 1]");
  };
  require_positive("/space/remesh/relative_tolerance", remesh.relative_tolerance);
  require_positive("/space/remesh/split/acceptance_tolerance", remesh.split.acceptance_tolerance.value_or(1));
  require_positive("/space/remesh/curve/acceptance_tolerance", remesh.curve.acceptance_tolerance.value_or(1));
  require(true, "/space/remesh/straighten/acceptance_tolerance", remesh.straighten.acceptance_tolerance.value_or(0),
          "a number");
  require_not_negative("/space/remesh/split/min_edge_length", remesh.split.min_edge_length.value_or(0));
  require(true, "/space/remesh/collapse/acceptance_tolerance", remesh.collapse.acceptance_tolerance.value_or(0), "a number");
  require(true, "/space/remesh/swap/acceptance_tolerance", remesh.swap.acceptance_tolerance.value_or(0), "a number");
  require(true, "/space/remesh/smooth/acceptance_tolerance", remesh.smooth.acceptance_tolerance.value_or(0), "a number");
  fraction("/space/remesh/split/culling_threshold", remesh.split.culling_threshold);
  fraction("/space/remesh/collapse/culling_threshold", remesh.collapse.culling_threshold);
  require_at_least("/space/remesh/split/max_depth", remesh.split.max_depth, 0);
  require_at_least("remesh.local.rings", remesh.local.rings, 0);
  require_at_least("remesh.local.max_iterations", remesh.local.max_iterations, 1);
  require_not_negative("/space/remesh/sizing_field/rel_min_edge_length", remesh.sizing_field.rel_min_edge_length);
}

template <std::size_t N>
void check_primitives(const char* list, const std::vector<std::array<int, N>>& primitives, std::size_t vertices) {
  for (std::size_t i = 0; i < primitives.size(); ++i)
    for (const int v : primitives[i])
      if (v < 0 || static_cast<std::size_t>(v) >= vertices)
        refuse(element(list, i), fmt::format("vertex {}", v), fmt::format("0 to {} - 1", vertices));
}

template <int Dim>
void check_positions(const char* list, const std::vector<Vec<Dim>>& positions) {
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (!positions[v].allFinite()) refuse(element(list, v), "a position that is not finite", "numbers");
}

template <int Dim>
void check_obstacles(const Obstacles<Dim>& obstacles) {
  check_positions<Dim>("obstacles.rest", obstacles.rest);
  check_primitives("obstacles.edges", obstacles.edges, obstacles.rest.size());
  check_primitives("obstacles.triangles", obstacles.triangles, obstacles.rest.size());
  if (obstacles.motion.size() != obstacles.rest.size())
    refuse("obstacles.motion", fmt::format("{} entries", obstacles.motion.size()),
           fmt::format("{}, one a vertex", obstacles.rest.size()));
  const int motions = static_cast<int>(obstacles.motions.size());
  for (std::size_t v = 0; v < obstacles.motion.size(); ++v)
    if (obstacles.motion[v] != kNone && (obstacles.motion[v] < 0 || obstacles.motion[v] >= motions))
      refuse(element("obstacles.motion", v), std::to_string(obstacles.motion[v]),
             fmt::format("kNone, or 0 to {} - 1", motions));
  for (std::size_t i = 0; i < obstacles.motions.size(); ++i)
    if (!obstacles.motions[i]) refuse(element("obstacles.motions", i), "no function", "one of position and time");
  const int corners = Dim, vertices = static_cast<int>(obstacles.rest.size());
  for (std::size_t i = 0; i < obstacles.flats.size(); ++i)
    if (obstacles.flats[i] < 0 || obstacles.flats[i] > vertices - corners)
      refuse(element("obstacles.flats", i), std::to_string(obstacles.flats[i]),
             fmt::format("the first of {} vertices, of {}", corners, vertices));
}

template <typename List, typename Member>
void check_functions(const char* name, const List& list, Member member) {
  for (std::size_t i = 0; i < list.size(); ++i)
    if (!(list[i].*member)) refuse(element(name, i), "no function", "one of position and time");
}

template <int Dim>
void check_materials(const Setup<Dim>& setup) {
  std::set<int> bodies;
  for (const CellId c : setup.mesh.live_cells()) bodies.insert(setup.mesh.body(c));
  for (const int body : bodies)
    if (!setup.materials.contains(body))
      refuse("/materials", fmt::format("no material with the id {}, which elements have", body), "one for every body");
  for (const auto& [id, material] : setup.materials) {
    const std::string place = fmt::format("/materials (id {})", id);
    const double nu = material.poisson_ratio;
    require_positive(place + "/E", material.youngs_modulus);
    require(nu > -1 && nu < 0.5, place + "/nu", nu, "a number of (-1, 0.5)");
    if (rigid_body_of(material) && !setup.time.has_inertia())
      require_not_negative(place + "/rho", material.density);  // a tool without mass
    else
      require_positive(place + "/rho", material.density);
    require_positive(place + "/deviator", material.deviator);
    double relaxed = 0;
    for (const PronyTerm& term : material.prony) {
      require_positive(place + "/prony/g", term.g);
      require_positive(place + "/prony/tau", term.tau);
      relaxed += term.g;
    }
    require(relaxed < 1, place + "/prony/g", relaxed, "shares of a sum below 1");
    if (const auto& mullins = material.mullins) {
      require(std::isfinite(mullins->r) && mullins->r > 1, place + "/mullins/r", mullins->r, "a number > 1");
      require_not_negative(place + "/mullins/m", mullins->m);
      require_not_negative(place + "/mullins/beta", mullins->beta);
      require(mullins->m + mullins->beta > 0, place + "/mullins/m", mullins->m, "a number > 0 where beta is 0");
    }
  }
}

/// A vertex where facets with these tags end: in 2D they do not go on there, in 3D an edge there has one of them; kNone:
/// they close, with or without the axis.
template <int Dim>
VertexId find_rim(const Mesh<Dim>& mesh, const std::vector<int>& tags) {
  std::map<std::array<VertexId, Dim - 1>, int> sides;  // facets that go one way there less those that go the other
  for (const FacetId f : mesh.live_facets()) {
    if (std::ranges::find(tags, mesh.facet_tag(f)) == tags.end()) continue;
    const auto& facet = mesh.facet(f);
    for (int k = 0; k < Dim; ++k)
      if constexpr (Dim == 2)
        sides[{facet[k]}] += k == 0 ? 1 : -1;
      else
        sides[{std::min(facet[k], facet[(k + 1) % 3]), std::max(facet[k], facet[(k + 1) % 3])}] +=
            facet[k] < facet[(k + 1) % 3] ? 1 : -1;
  }
  for (const auto& [at, count] : sides)
    if (count != 0 && !mesh.is_on_axis(at[0])) return at[0];
  return kNone;
}

template <int Dim>
void check_cavities(const Setup<Dim>& setup) {
  if (setup.cavities.empty()) return;
  const CellSet<Dim> cells = whole_mesh(setup.mesh, {});
  VectorX rest(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) rest.template segment<Dim>(Dim * v) = cells.rest[v];
  for (std::size_t i = 0; i < setup.cavities.size(); ++i) {
    const Cavity& cavity = setup.cavities[i];
    const std::string place = fmt::format("/boundary_conditions/pressure_cavity/{}", i);
    require_positive(place + "/exponent", cavity.exponent);
    require_not_negative(place + "/bulk_modulus", cavity.bulk_modulus);
    require_not_negative(place + "/external_pressure", cavity.external_pressure);
    if (const VertexId end = find_rim(setup.mesh, cavity.surfaces); end != kNone)
      refuse(place + "/id",
             fmt::format("a surface that does not close: it ends at {} {}",
                         point_text<Dim>(setup.mesh.rest(end), setup.units, 6), setup.units.length()),
             "surfaces that close around the cavity");
    const double volume = CavityEnergy<Dim>(cells, CavityLoad{cavity.surfaces}, 1).volume(rest);
    if (!(volume > 0))
      refuse(place + "/id", volume < 0 ? "a surface around the body" : "no surface", "surfaces around a cavity in it");
  }
}

/// Refuses tags that no surface has.
void check_surfaces(const std::string& place, const std::vector<int>& tags, const std::set<int>& with_facets) {
  if (tags.empty()) refuse(place, "no surfaces", "at least one");
  for (const int tag : tags)
    if (!with_facets.contains(tag)) refuse(place, fmt::format("{}, which no surface has", tag), "the id of a surface");
}

template <int Dim>
void check_ties(const Setup<Dim>& setup) {
  constexpr double kSameShape = 0.999;  ///< of opposite sides of periodic cells
  if (setup.ties.empty()) return;
  const std::set<int> with_facets = known_tags(setup, setup.mesh);
  for (std::size_t i = 0; i < setup.ties.size(); ++i)
    for (const auto& [key, tags] : {std::pair{"a", &setup.ties[i].a}, std::pair{"b", &setup.ties[i].b}})
      check_surfaces(fmt::format("/ties/{}/{}", i, key), *tags, with_facets);
  const CellSet<Dim> cells = whole_mesh(setup.mesh, {});
  const std::vector<Mortar<Dim>> mortars = mortars_of(setup, setup.mesh, cells);
  for (std::size_t i = 0; i < mortars.size(); ++i)
    if (setup.ties[i].jump && mortars[i].covered < kSameShape)
      refuse(fmt::format("/ties/{}/periodic", i),
             fmt::format("surfaces of which one, moved upon the other, covers {:.1f} % of it", 100 * mortars[i].covered),
             "opposite sides of a cell, which differ by a translation only");
    else if (mortars[i].covered == 0)
      refuse(fmt::format("/ties/{}", i),
             fmt::format("surfaces that are {} apart, or do not face each other",
                         setup.units.text(distance_of_sides(cells, setup.ties[i]), "m", 3)),
             "surfaces that touch, or are apart by less than a tenth of their edges");
    else if (mortars[i].covered < kLeastCovered)
      refuse(
          fmt::format("/ties/{}", i),
          fmt::format("surfaces of which neither covers the other: at most {:.1f} % of one side", 100 * mortars[i].covered),
          fmt::format("one side that the other covers, by {:g} % at least: give the part that is bonded an id of its own",
                      100 * kLeastCovered));
}

void check_stiffness(const std::string& place, const Mat<3>& stiffness, int dim) {
  Mat<3> used = Mat<3>::Zero();
  used.topLeftCorner(dim, dim) = stiffness.topLeftCorner(dim, dim);
  if (!used.allFinite() || used != used.transpose() ||
      !(Eigen::SelfAdjointEigenSolver<Mat<3>>(used).eigenvalues()[0] >= -1e-12 * used.norm()))
    refuse(place, "a stiffness that is not symmetric, or negative somewhere", "a symmetric one that is nowhere negative");
}

/// Nodes that conditions hold, that other rigid surfaces have, or that are of rigid bodies do not go with a coupling.
template <int Dim>
void check_nodes_of_couplings(const Setup<Dim>& setup) {
  constexpr std::size_t kMostNodes = 1000;
  const std::vector<char> held = held_dofs(setup, setup.mesh, setup.time.t0).held;
  const auto surfaces = coupled_surfaces<Dim>(setup, whole_mesh(setup.mesh, {}));
  std::map<int, std::size_t> rigid;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const std::vector<int>& nodes = surfaces[i].mean.nodes;
    const std::string place = fmt::format("/couplings/{}/id", i);
    if (nodes.size() > kMostNodes)
      refuse(place, fmt::format("surfaces of {} nodes, which are all coupled to each other", nodes.size()),
             fmt::format("at most {}; a rigid geometry that is tied to them (/ties) has no such limit", kMostNodes));
    if (!surfaces[i].coupling->is_rigid) continue;
    for (const int v : nodes) {
      if (!rigid.try_emplace(v, i).second)
        refuse(place, fmt::format("a rigid surface that shares vertex {} with another one", v), "one that shares none");
      for (int c = 0; c < Dim; ++c)
        if (held[Dim * v + c])
          refuse(place, fmt::format("a rigid surface of which a condition holds vertex {}", v),
                 "what is held of its point in `held`, and no condition at the surface");
    }
  }
}

/// Refuses a point that is farther from the bodies than chords of a round are: half an edge of the nearest cell.
template <int Dim>
void check_near(const Setup<Dim>& setup, const Locator<Dim>& locator, const Vec<Dim>& X, std::size_t i) {
  const auto place = locator.find(X);
  Vec<Dim> nearest = Vec<Dim>::Zero();
  double longest = 0;
  const auto rest = [&](int k) { return setup.mesh.rest(place.nodes[k]); };
  for (int k = 0; k <= Dim; ++k) {
    nearest += place.weights[k] * rest(k);
    for (int l = 0; l < k; ++l) longest = std::max(longest, (rest(k) - rest(l)).norm());
  }
  if ((X - nearest).norm() <= longest / 2) return;
  const auto text = [&](const Vec<Dim>& at) {
    return fmt::format("{} {}", point_text<Dim>(at, setup.units, 6), setup.units.length());
  };
  throw InputError({"", fmt::format("/output/points/{}/rest", i),
                    fmt::format("{}, {} away from all bodies", text(X), setup.units.text((X - nearest).norm(), "m", 3)),
                    "a point of a body at rest; the nearest one is " + text(nearest)});
}

/// A connected part at a place: a cell of it there, and the tags of its surface there.
struct PartAt {
  CellId cell;
  std::set<int> tags;

  bool has_any(const std::vector<int>& of) const {
    return std::ranges::any_of(of, [&](int tag) { return tags.contains(tag); });
  }
};

template <int Dim>
std::vector<PartAt> parts_at(const Mesh<Dim>& mesh, const Vec<Dim>& X) {
  constexpr double kRoundOff = 1e-9;
  std::map<int, PartAt> parts;
  for (const CellId c : mesh.live_cells()) {
    const auto& cell = mesh.cell(c);
    const auto weights = barycentric_weights<Dim>(mesh.rest(cell[0]), mesh.inverse_rest_edges(c), X);
    if (*std::ranges::min_element(weights) < -kRoundOff) continue;
    PartAt& part = parts.try_emplace(mesh.part(c), PartAt{c, {}}).first->second;
    for (const VertexId v : cell)
      for (const FacetId f : mesh.facets_of(v)) {
        if (cell_of_facet(mesh, f) != c) continue;
        bool is_there = true;
        for (int k = 0; k <= Dim; ++k) is_there = is_there && (weights[k] <= kRoundOff || holds(mesh.facet(f), cell[k]));
        if (is_there) part.tags.insert(mesh.facet_tag(f));
      }
  }
  std::vector<PartAt> found;
  for (auto& [number, part] : parts) found.push_back(std::move(part));
  return found;
}

/// The first of parts at a place that ties do not bond to the first one there, by others or not; kNone: there is none.
CellId find_loose(std::vector<PartAt> parts, const std::vector<Tie>& ties) {
  if (parts.empty()) return kNone;
  std::vector<PartAt> bonded{parts.front()};
  parts.erase(parts.begin());
  for (std::size_t i = 0; i < bonded.size(); ++i)
    for (const Tie& tie : ties) {
      if (tie.jump) continue;
      for (const auto& [own, other] : {std::pair{&tie.a, &tie.b}, std::pair{&tie.b, &tie.a}}) {
        if (!bonded[i].has_any(*own)) continue;
        const auto rest =
            std::stable_partition(parts.begin(), parts.end(), [&](const PartAt& p) { return !p.has_any(*other); });
        bonded.insert(bonded.end(), rest, parts.end());
        parts.erase(rest, parts.end());
      }
    }
  return parts.empty() ? kNone : parts.front().cell;
}

/// Refuses points at places that two connected parts share, of which either may move away.
template <int Dim>
void check_points(const Setup<Dim>& setup) {
  if (setup.fields.points.empty()) return;
  const Mesh<Dim>& mesh = setup.mesh;
  const Locator<Dim> locator(mesh);
  for (std::size_t i = 0; i < setup.fields.points.size(); ++i) {
    const Vec<Dim> X(setup.fields.points[i].rest.data());
    check_near(setup, locator, X, i);
    const std::vector<PartAt> parts = parts_at(mesh, X);
    const CellId loose = find_loose(parts, setup.ties);
    if (loose == kNone) continue;
    const auto name = [&](CellId of) { return set_text(setup.names.bodies, mesh.body(of)); };
    throw InputError({"", fmt::format("/output/points/{}/rest", i),
                      fmt::format("{} {}, where bodies {} and {} both are", point_text<Dim>(X, setup.units, 6),
                                  setup.units.length(), name(parts.front().cell), name(loose)),
                      "a place of one body, such as one a little inside of it"});
  }
}

template <int Dim>
void check_supports(const Setup<Dim>& setup) {
  const auto springs = springs_of<Dim>(setup.nodal_loads);
  const auto couplings = couplings_of<Dim>(setup.nodal_loads);
  if (springs.empty() && couplings.empty()) return;
  const std::set<int> with_facets = known_tags(setup, setup.mesh);
  for (std::size_t i = 0; i < springs.size(); ++i) {
    check_surfaces(fmt::format("/springs/{}/id", i), springs[i]->surfaces, with_facets);
    check_stiffness(fmt::format("/springs/{}/stiffness", i), springs[i]->stiffness, Dim);
  }
  std::map<int, std::string> taken;  // by tag: what else moves the surface
  for (const auto& condition : setup.dirichlet) taken[condition.tag] = "that a Dirichlet condition holds";
  for (const Tie& tie : setup.ties)
    for (const auto* side : {&tie.a, &tie.b})
      for (const int tag : *side) taken[tag] = "that is tied";
  for (const CellId c : setup.mesh.live_cells())
    if (rigid_body_of(setup.materials.at(setup.mesh.body(c))))
      for (const VertexId v : setup.mesh.cell(c))
        for (const FacetId f : setup.mesh.facets_of(v))
          taken[setup.mesh.facet_tag(f)] = "of a rigid body, which has forces, a mass and held components of its own";
  for (std::size_t i = 0; i < couplings.size(); ++i) {
    const Coupling& coupling = *couplings[i];
    const std::string place = fmt::format("/couplings/{}", i);
    check_surfaces(place + "/id", coupling.surfaces, with_facets);
    check_stiffness(place + "/stiffness", coupling.stiffness, Dim);
    require_not_negative(place + "/mass", coupling.mass);
    for (const int tag : coupling.surfaces)
      if (const auto [entry, is_free] = taken.try_emplace(tag, "that another coupling has"); !is_free)
        refuse(place + "/id", "a surface " + entry->second, "a surface that nothing else moves");
    if (!coupling.has_conditions() && !coupling.force && !coupling.moment && coupling.mass == 0 &&
        coupling.stiffness.isZero(0))
      refuse(place, "a point on which nothing acts", "force, moment, mass, stiffness, held or \"kind\": \"rigid\"");
  }
  check_nodes_of_couplings(setup);
}

template <int Dim>
void check_rigid(const Setup<Dim>& setup) {
  if (!has_rigid_bodies(setup.materials)) return;
  const Mesh<Dim>& mesh = setup.mesh;
  std::map<VertexId, const RigidBody*> owner;  // null: of bodies that deform
  for (const CellId c : mesh.live_cells())
    for (const VertexId v : mesh.cell(c)) {
      const RigidBody* const body = rigid_body_of(setup.materials.at(mesh.body(c)));
      if (owner.try_emplace(v, body).first->second != body)
        refuse("/geometry/*/rigid", fmt::format("a rigid body that shares vertex {} with another body", v),
               "one that shares none");
    }
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0).held;
  for (const auto& [v, body] : owner)
    for (int c = 0; body && c < Dim; ++c)
      if (held[Dim * v + c])
        refuse("/boundary_conditions/dirichlet_boundary", "a condition on a rigid body",
               "what stays of its motion in /geometry/*/rigid/held, or an obstacle in its place");
}

/// Surfaces that cannot move at rest.
template <int Dim>
std::set<int> tied_or_coupled(const Setup<Dim>& setup) {
  std::set<int> tags;
  for (const Tie& tie : setup.ties)
    for (const auto* side : {&tie.a, &tie.b}) tags.insert(side->begin(), side->end());
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads))
    tags.insert(coupling->surfaces.begin(), coupling->surfaces.end());
  return tags;
}

template <int Dim>
void check_shapes(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const std::set<int> kept = tied_or_coupled(setup);
  for (std::size_t i = 0; i < setup.shapes.size(); ++i) {
    const Shape& shape = *setup.shapes[i];
    for (const int tag : shape.surfaces)
      if (kept.contains(tag))
        refuse(fmt::format("/shapes/{}/surface", i), fmt::format("surface {}, which is tied or coupled", tag),
               "a surface whose vertices may move at rest");
    for (const FacetId f : mesh.live_facets())
      if (std::ranges::find(shape.surfaces, mesh.facet_tag(f)) != shape.surfaces.end() &&
          rigid_body_of(setup.materials.at(mesh.body(cell_of_facet(mesh, f)))))
        refuse(fmt::format("/shapes/{}/surface", i), "a surface of a rigid body", "one of a body that is remeshed");
  }
}

template <int Dim>
void check_proxy(const Setup<Dim>& setup) {
  if (!setup.proxy) return;
  const CollisionProxy<Dim>& proxy = *setup.proxy;
  const auto rows = static_cast<Eigen::Index>(proxy.rest.size()), vertices = Eigen::Index{setup.mesh.num_vertices()};
  const Eigen::Index nodes = setup.mesh.node_slots() + std::ssize(edges_of_order_2(setup.mesh, setup.order));
  if (proxy.weights.rows() != rows || (proxy.weights.cols() != vertices && proxy.weights.cols() != nodes))
    refuse("weights of the collision mesh", fmt::format("{} x {}", proxy.weights.rows(), proxy.weights.cols()),
           nodes == vertices ? fmt::format("{} x {}", rows, vertices)
                             : fmt::format("{} x {}, or {} with the nodes of curved edges", rows, vertices, nodes));
  check_primitives("proxy.edges", proxy.edges, proxy.rest.size());
  check_primitives("proxy.triangles", proxy.triangles, proxy.rest.size());
}

}  // namespace

template <int Dim>
void StepSetup<Dim>::validate() const {
  check_time(time);
  check_contact(contact, Dim);
  check_newton(newton);
  check_remeshing(remesh);
  check_obstacles(obstacles);
  check_functions("dirichlet", dirichlet, &DirichletCondition<Dim>::displacement);
  check_functions("neumann", neumann, &NeumannCondition<Dim>::traction);
  check_functions("pressure", pressure, &PressureCondition<Dim>::pressure);
  require_positive("/solver/advanced/lagged_load_tolerance", lagged_load_tolerance);
  require_not_negative("/solver/lagging_tolerance", lagging_tolerance);
  for (std::size_t i = 0; i < damping.size(); ++i) {
    require_not_negative(element("damping", i) + ".coefficient", damping[i].coefficient);
    require_at_least(element("damping", i) + ".lagging_rounds", damping[i].lagging_rounds, 1);
  }
}

template <int Dim>
void Setup<Dim>::validate() const {
  if (mesh.num_cells() == 0) refuse("mesh", "no cells", "at least one");
  StepSetup<Dim>::validate();
  if (mesh.is_axisymmetric())
    for (const VertexId v : mesh.live_vertices())
      if (!(mesh.rest(v)[0] >= 0))
        refuse("mesh", fmt::format("vertex {} at r = {}", v, this->units.text(mesh.rest(v)[0], "m", 6)),
               "r >= 0 in an axisymmetric scene");
  check_materials(*this);
  check_proxy(*this);
  check_cavities(*this);
  refuse_idle_fluids(*this, mesh);
  check_ties(*this);
  check_rigid(*this);
  check_shapes(*this);
  check_supports(*this);
  check_points(*this);
  for (std::size_t i = 0; i < this->fields.curves.size(); ++i)
    refuse_unknown(this->fields.curves[i], mesh, known_tags(*this, mesh), this->obstacles.rest.size(),
                   element("fields.curves", i));
  for (const auto& [name, list] :
       {std::pair{"initial_displacement", &initial_displacement}, std::pair{"initial_velocity", &initial_velocity},
        std::pair{"initial_acceleration", &initial_acceleration}})
    check_functions(name, *list, &InitialCondition<Dim>::value);
}

template void StepSetup<2>::validate() const;
template void StepSetup<3>::validate() const;
template void Setup<2>::validate() const;
template void Setup<3>::validate() const;

}  // namespace itr
