// SPDX-License-Identifier: MIT
#include "commands.hpp"
#include "energy/rigid_body.hpp"
#include "energy/support.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "accuracy.hpp"
#include "advice.hpp"
#include "core/connected_parts.hpp"
#include "energy/elastic/law_table.hpp"
#include "energy/elastic/patched_volume.hpp"
#include "fem/quadrature.hpp"
#include "geometry/shape.hpp"
#include "itr/core.hpp"
#include "linear/choice.hpp"
#include "mesh/rest_box.hpp"
#include "mesh_figures.hpp"
#include "simulation/barrier_stiffness.hpp"
#include "simulation/named.hpp"
#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"

namespace itr::cli {

namespace {

constexpr const char* kLaws[] = {"neo-Hookean",     "linear elastic", "St. Venant-Kirchhoff",
                                 "fixed corotated", "Mooney-Rivlin",  "own"};  ///< by MaterialLaw
static_assert(std::size(kLaws) == static_cast<std::size_t>(MaterialLaw::own) + 1);

void term(const char* name, bool is_in, const std::string& reason) {
  fmt::print("  {:10} {:3}  {}\n", name, is_in ? "yes" : "no", reason);
}

/// The components of a unit vector, of which round-off is 0.
template <int Dim>
std::string direction_text(const Vec<3>& direction) {
  constexpr double kRoundOff = 1e-12;
  std::vector<std::string> components;
  for (int c = 0; c < Dim; ++c)
    components.push_back(fmt::format("{:.7g}", std::abs(direction[c]) < kRoundOff ? 0 : direction[c]));
  return fmt::format("({})", fmt::join(components, ", "));
}

template <int Dim>
std::string describe(const Shape& shape, const Units& units) {
  constexpr int kDigits = 7;
  const std::string center = point_text<Dim>(shape.center.head<Dim>(), units, kDigits);
  const std::string axis = direction_text<Dim>(shape.axis);
  const auto length = [&](double value) { return units.text(value, "m", kDigits); };
  using enum Shape::Kind;
  switch (shape.kind) {
    case plane:
      return fmt::format("{} through {}, normal {}", Dim == 2 ? "line" : "plane", center, axis);
    case sphere:
      return fmt::format("{} of radius {} around {}", Dim == 2 ? "circle" : "sphere", length(shape.radius), center);
    case cylinder:
      return fmt::format("cylinder of radius {} around the axis {} through {}", length(shape.radius), axis, center);
    case cone:
      return fmt::format("cone of {:.7g} degrees between surface and axis {}, apex {}", 180 / std::numbers::pi * shape.angle,
                         axis, center);
    case torus:
      return fmt::format("torus of radii {} and {} (tube) around {}, axis {}", length(shape.radius),
                         length(shape.tube_radius), center, axis);
    case fitted:
      return "curves through its vertices";
  }
  return "";
}

std::string coefficients_text(const ContactOptions& contact) {
  std::string text = fmt::format("mu = {}", contact.friction_coefficient);
  for (std::size_t i = 0; i < contact.friction_pairs.size(); ++i) {
    const FrictionPair& pair = contact.friction_pairs[i];
    text += fmt::format(", pair {}: {}", i, pair.statics);
    if (pair.kinetic != pair.statics) text += fmt::format(" to {}", pair.kinetic);
    if (!pair.has_two()) continue;
    const FrictionAcross& across = *pair.across;
    text += fmt::format(" along ({:g}, {:g}, {:g}), {}", across.direction[0], across.direction[1], across.direction[2],
                        across.statics);
    if (across.kinetic != across.statics) text += fmt::format(" to {}", across.kinetic);
    text += " across";
  }
  return text;
}

std::string describe(const TimeOptions& time, const Units& units) {
  if (time.is_static) return "one static solve";
  const std::string scheme = time.integrator == Integrator::newmark          ? "Newmark"
                             : time.integrator == Integrator::implicit_euler ? "implicit Euler"
                                                                             : "BDF" + std::to_string(time.bdf_order);
  if (time.adaptive.enabled) {
    const AdaptiveTimeOptions& adaptive = time.adaptive;
    std::string text = fmt::format("{}{}, from {} to {} by steps of {} to {} for a tolerance of {:g}",
                                   time.quasistatic ? "quasistatic, " : "", scheme, units.text(adaptive.begin, "s", 8),
                                   units.text(adaptive.end, "s", 8), units.text(adaptive.dt_min, "s", 3),
                                   units.text(adaptive.dt_max, "s", 3), adaptive.tolerance);
    if (!adaptive.kinks.empty())
      text += fmt::format("; {} of them end where values are not smooth in time", adaptive.kinks.size());
    return text;
  }
  return fmt::format("{}{}, {} steps of {} from {}", time.quasistatic ? "quasistatic, " : "", scheme, time.steps,
                     units.text(time.dt, "s", 8), units.text(time.t0, "s", 8));
}

template <int Dim>
class Explanation {
 public:
  /// Throws InputError for what `run` would refuse.
  Explanation(const Setup<Dim>& setup, linear::Registry& registry, const scene::Scene& scene,
              std::vector<std::string> warnings)
      : registry_(registry),
        simulation_(setup, registry_, Logger([this](LogLevel, std::string_view text) { chosen_.emplace_back(text); })),
        setup_(simulation_.setup()),
        defaults_(scene.defaults),
        accuracy_(scene.accuracy),
        warnings_(std::move(warnings)) {
    for (std::string& found : find_suspicious(simulation_)) warnings_.push_back(std::move(found));
  }

  /// `results`: the units that they are in.
  void print(const Units& results) {
    if (const Units& units = setup_.units; !units.is_si())
      fmt::print("units\n  {}, {}, {}: forces in {}, stresses in {}, energies in {}{}; results {}\n", units.length(),
                 units.mass(), units.time(), units.name("N"), units.name("Pa"), units.name("J"),
                 Dim == 2 && !setup_.mesh.is_axisymmetric() ? ", by " + units.length() + " of thickness" : "",
                 results.is_si() ? "in SI units" : "too");
    bodies();
    fmt::print("time\n  {}\n", describe(setup_.time, setup_.units));
    fmt::print("in words\n");
    for (const auto& sentence : foretell(setup_)) fmt::print("  {}\n", sentence);
    for (const auto& sentence : chosen_) fmt::print("  {}\n", sentence);
    terms();
    const linear::MatrixTraits matrix = unknowns();
    fmt::print("linear solver\n  {}\n", solver(matrix));
    if (setup_.contact.enabled) contact();
    shapes();
    defaults();
    if (accuracy_.value > 0) fmt::print("accuracy\n");
    for (const std::string& line : describe_accuracy(accuracy_)) fmt::print("  {}\n", line);
    fmt::print("warnings\n");
    if (warnings_.empty()) fmt::print("  none\n");
    for (const auto& warning : warnings_) fmt::print("  warning: {}\n", warning);
  }

 private:
  /// Prints the set of defaults and what it gives for keys that the scene leaves out.
  void defaults() const {
    fmt::print("defaults\n  {}{}\n", defaults_.name,
               defaults_.unlike_polyfem.empty() ? "" : ": those of PolyFEM, which docs/scenes.md lists, but for these:");
    for (const auto& row : defaults_.values) fmt::print("  {} = {}: {}\n", row.pointer, row.value, row.reason);
    for (const auto& difference : defaults_.unlike_polyfem) fmt::print("  {}\n", difference);
    if (!defaults_.information.empty()) fmt::print("  {}\n", defaults_.information);
  }

  void bodies() {
    const Mesh<Dim>& mesh = setup_.mesh;
    const MeshFigures<Dim> figures(mesh);
    const Units& units = setup_.units;
    const bool is_area = Dim == 2 && !mesh.is_axisymmetric();
    fmt::print("bodies ({}D{})\n", Dim, mesh.is_axisymmetric() ? ", axisymmetric" : "");
    for (const auto& [id, sum] : figures.bodies) {
      const Material& material = setup_.materials.at(id);
      const auto order = setup_.order.find(id);
      const std::string name = set_text(setup_.names.bodies, id);
      fmt::print("  id {}{}: {} {} elements, {} {}, {}, E {}, nu {:.4g}{}, rho {:.4g} {}, mass {}\n", id,
                 name == std::to_string(id) ? "" : " (" + name + ")", sum.cells,
                 order != setup_.order.end() && order->second == 2 ? "quadratic" : "linear", is_area ? "area" : "volume",
                 units.text(sum.volume, is_area ? "m^2" : "m^3"),
                 rigid_body_of(material) ? "rigid, by a stiff term"
                 : sum_of(material)      ? sum_of(material)->name()
                                         : kLaws[static_cast<std::size_t>(material.law)],
                 units.text(material.youngs_modulus, "Pa"), material.poisson_ratio,
                 material.volume == VolumeForm::patches ? " (volume averaged over patches)" : "",
                 units.from_si(material.density, "kg/m^3"), units.name("kg/m^3"),
                 units.text(material.density * sum.volume, "kg"));
    }
    fmt::print("  {} vertices, {} elements, edges {:.4g} to {}, worst quality {:.3g} (1: regular; element {})\n",
               mesh.num_vertices(), mesh.num_cells(), units.from_si(figures.edges.shortest, "m"),
               units.text(figures.edges.longest, "m"), figures.worst_quality, figures.worst_cell);
    if (const Mesh<Dim>& curved = simulation_.state().mesh; curved.has_nodes())
      fmt::print(
          "  {} of {} edges are curved and carry a node: {} nodes in all; elasticity by {} points a cell with curved "
          "edges\n",
          curved.num_curved(), mesh.edges().size(), curved.num_nodes(), quadrature<Dim>(setup_.quadrature_degree).size());
  }

  void terms() {
    fmt::print("energy terms\n");
    term("inertia", !setup_.time.is_static && !setup_.time.quasistatic,
         setup_.time.is_static     ? "no /time: static"
         : setup_.time.quasistatic ? "/time/quasistatic"
         : setup_.lump_mass        ? "dynamics, lumped mass"
                                   : "dynamics, consistent mass");
    term("elastic", true, "always");
    std::string loads;
    if (setup_.body_acceleration) loads = "/boundary_conditions/rhs";
    if (!setup_.neumann.empty()) loads += (loads.empty() ? "" : ", ") + std::to_string(setup_.neumann.size()) + " tractions";
    term("body", !loads.empty(), loads.empty() ? "no body force, no tractions" : loads);
    term("pressure", !setup_.pressure.empty(),
         setup_.pressure.empty() ? "no pressure on a boundary" : std::to_string(setup_.pressure.size()) + " boundaries");
    const bool is_damped = !setup_.damping.empty() && !setup_.time.is_static;
    term("damping", is_damped,
         is_damped                ? "/solver/rayleigh_damping"
         : setup_.damping.empty() ? "no /solver/rayleigh_damping"
                                  : "no /time: static");
    std::string cavities;
    for (const Cavity& cavity : setup_.cavities)
      cavities += fmt::format("{}{}: {}", cavities.empty() ? "" : ", ", cavity.name,
                              cavity.bulk_modulus > 0 ? "fluid" : fmt::format("gas, exponent {}", cavity.exponent));
    term("cavities", !setup_.cavities.empty(),
         setup_.cavities.empty() ? "no /boundary_conditions/pressure_cavity" : cavities);
    const std::size_t springs = springs_of<Dim>(setup_.nodal_loads).size();
    const std::size_t points = couplings_of<Dim>(setup_.nodal_loads).size();
    if (springs > 0) term("springs", true, std::to_string(springs) + " of /springs");
    if (points > 0) term("points", true, std::to_string(points) + " of /couplings");
    term("ties", !setup_.ties.empty(), setup_.ties.empty() ? "no /ties" : std::to_string(setup_.ties.size()) + " pairs");
    term("contact", setup_.contact.enabled,
         !setup_.contact.enabled     ? "/contact/enabled is false"
         : setup_.contact.convergent ? "convergent form"
                                     : "/contact/enabled");
    term("friction", setup_.contact.has_friction(),
         setup_.contact.has_friction() ? coefficients_text(setup_.contact)
         : !setup_.contact.enabled     ? "no contact"
                                       : "no coefficient of friction, or no iterations for it");
    term("remeshing", setup_.remesh.enabled,
         setup_.remesh.enabled ? "/space/remesh/enabled" : "/space/remesh/enabled is false");
  }

  /// Pairs of nodes that share a cell or a patch.
  static std::set<std::array<int, 2>> coupled_nodes(const CellSet<Dim>& cells) {
    std::set<std::array<int, 2>> pairs;
    for (const auto& element : cells.elements)
      for_each_node(element, [&](int a) {
        for_each_node(element, [&](int b) {
          if (a < b) pairs.insert({a, b});
        });
      });
    for (std::size_t i = 0; cells.patches && i < cells.patches->count(); ++i)
      for (const int a : cells.patches->nodes_of(i))
        for (const int b : cells.patches->nodes_of(i))
          if (a < b) pairs.insert({a, b});
    return pairs;
  }

  /// Traits of the matrix that the elements give; contact adds to it. Held vertices that move through contact are counted as
  /// held.
  linear::MatrixTraits unknowns() {
    const Mesh<Dim>& mesh = simulation_.state().mesh;
    const auto held = held_dofs(setup_, mesh, setup_.time.t0 + setup_.time.dt).held;
    const int bodies = Dim * mesh.num_nodes();
    const auto free = [&](int v) {
      return static_cast<int>(std::count(held.begin() + Dim * v, held.begin() + Dim * (v + 1), 0));
    };
    linear::MatrixTraits matrix;
    matrix.block_size = Dim;
    matrix.may_be_indefinite = setup_.newton.indefinite == IndefiniteHessian::accept;
    for (int v = 0; v < mesh.num_nodes(); ++v) {
      matrix.order += free(v);
      matrix.nonzeros += free(v) * (free(v) + 1) / 2;
    }
    CellSet<Dim> cells = whole_mesh(mesh, {});
    add_patches(setup_.materials, cells);
    for (const auto& [a, b] : coupled_nodes(cells)) matrix.nonzeros += free(a) * free(b);
    constexpr double kEntryBytes = 12, kMegabyte = 1e6;
    fmt::print("unknowns\n  {} of {} ({} held); matrix {:.1f} MB, factor of a direct solver up to about {:.1f} MB{}\n",
               matrix.order, bodies, bodies - matrix.order, kEntryBytes * static_cast<double>(matrix.nonzeros) / kMegabyte,
               linear::estimate_factor_bytes(matrix) / kMegabyte,
               setup_.remesh.enabled ? ", more as the mesh is refined" : "");
    return matrix;
  }

  std::string solver(const linear::MatrixTraits& matrix) const {
    std::string name = simulation_.solver_name();
    if (name == "auto") {
      const linear::Pick pick = linear::pick_solver(matrix, registry_);
      name = pick.name + ", " + pick.reason;
    }
    return fmt::format("{} (asked for: {})", name, fmt::join(setup_.linear.solvers, ", "));
  }

  /// Surfaces and which of them can meet; what is near at the start.
  void contact() {
    const ContactSurface<Dim> contact = contact_surface(setup_, simulation_.state().mesh, simulation_.state().chords);
    const CollisionSurface& surface = contact.surface;
    const VectorX x = contact.positions(simulation_.state().history.x[0]);
    const auto component = connected_parts<2>(surface.counts.size(), surface.edges);
    std::set<int> moving, fixed;
    for (const int v : surface.vertices) (surface.counts[v] ? moving : fixed).insert(component[v]);
    const std::size_t m = moving.size(), f = fixed.size();
    fmt::print(
        "contact\n  {} surfaces of bodies, {} of obstacles; pairs that can touch: {} body-body, {} within a body, "
        "{} body-obstacle (obstacles among themselves are not searched)\n",
        m, f, m * (m - 1) / 2, m, m * f);
    if (setup_.proxy) fmt::print("  a collision mesh touches in place of the bodies' boundary\n");
    fmt::print("  {} surface vertices, {} edges", surface.vertices.size(), surface.edges.size());
    if (Dim == 3) fmt::print(", {} triangles", surface.triangles.size());
    Workspace workspace;
    const ContactEnergy<Dim> energy(surface, setup_.contact, 1, 1);
    fmt::print("; d-hat {}, {} pairs nearer than that at the start\n", setup_.units.text(setup_.contact.dhat, "m"),
               energy.active(x, workspace).size());
  }

  /// Geometries of surfaces of bodies: their numbers may come from vertices.
  void shapes() const {
    if (!setup_.shapes.empty()) fmt::print("shapes\n");
    for (const auto& shape : setup_.shapes)
      fmt::print("  surface {}: {}\n", fmt::join(shape->surfaces, ", "), describe<Dim>(*shape, setup_.units));
  }

  linear::Registry& registry_;
  std::vector<std::string> chosen_;  ///< what the simulation says of what the scene leaves open
  const Simulation<Dim> simulation_;
  const Setup<Dim>& setup_;
  const scene::ChosenDefaults& defaults_;
  const scene::Accuracy& accuracy_;
  std::vector<std::string> warnings_;
};

using Json = nlohmann::ordered_json;

constexpr double kSameVolume = 1e-9;  ///< relative

/// Lowest and highest corner of the box that the bodies fill together; null if they fill none.
template <int Dim>
Json filled_box(const Mesh<Dim>& mesh, const Units& units) {
  const auto box = rest_box(mesh);
  double volume = 0;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) volume += mesh.volume(c);
  if (box.isEmpty() || std::abs(volume - box.volume()) > kSameVolume * box.volume()) return nullptr;
  Json corners = Json::array();
  for (const Vec<Dim>& corner : {Vec<Dim>(box.min()), Vec<Dim>(box.max())}) {
    Json& place = corners.emplace_back();
    for (int k = 0; k < Dim; ++k) place.push_back(units.from_si(corner[k], "m"));
  }
  return corners;
}

/// Values of keys that the scene has or leaves to Setup::choose_defaults, by pointer, with remeshing enabled.
template <int Dim>
Json chosen_settings(Setup<Dim> setup, const Json& scene) {
  const std::string stiffness = "/solver/contact/barrier_stiffness";
  const bool is_open = setup.contact.enabled && !scene.contains(Json::json_pointer(stiffness));
  const bool has_open_dhat = setup.contact.enabled && setup.contact.dhat == 0;
  if (is_open) setup.contact.adaptive_stiffness = false, setup.contact.barrier_stiffness = 0;
  setup.remesh.enabled = true;
  setup.choose_defaults();
  Json settings = Json::object();
  if (is_open) settings[stiffness] = setup.contact.barrier_stiffness / barrier_unit(setup.units, setup.contact);
  if (has_open_dhat) settings["/contact/dhat"] = setup.units.from_si(setup.contact.dhat, "m");
  const auto add = [&](const char* operation, const std::optional<double>& tolerance) {
    if (tolerance)
      settings[fmt::format("/space/remesh/{}/acceptance_tolerance", operation)] = setup.units.from_si(*tolerance, "J");
  };
  add("split", setup.remesh.split.acceptance_tolerance);
  add("collapse", setup.remesh.collapse.acceptance_tolerance);
  add("swap", setup.remesh.swap.acceptance_tolerance);
  add("smooth", setup.remesh.smooth.acceptance_tolerance);
  add("curve", setup.remesh.curve.acceptance_tolerance);
  add("straighten", setup.remesh.straighten.acceptance_tolerance);
  return settings;
}

Json available_solvers() {
  Json names = Json::array();
  linear::Registry registry;
  for (const auto& row : registry.list())
    if (row.available) names.push_back(row.name);
  return names;
}

template <int Dim>
Json facts(const Setup<Dim>& setup, const Json& scene) {
  const Units& units = setup.units;
  const auto& contact = setup.contact;
  std::set<int> bodies;
  for (CellId c = 0; c < setup.mesh.cell_slots(); ++c) bodies.insert(setup.mesh.body(c));
  return {{"version", ITR_VERSION},
          {"scene", scene},
          {"dim", Dim},
          {"units",
           {{"length", units.length()},
            {"mass", units.mass()},
            {"time", units.time()},
            {"in_si", {{"m", units.factor("m")}, {"s", units.factor("s")}, {"J", units.factor("J")}}}}},
          {"time",
           {{"static", setup.time.is_static},
            {"quasistatic", setup.time.quasistatic},
            {"dt", setup.time.adaptive.enabled ? Json("auto") : Json(units.from_si(setup.time.dt, "s"))},
            {"steps", setup.time.adaptive.enabled ? Json() : Json(setup.time.steps)}}},
          {"cells", setup.mesh.num_cells()},
          {"bodies", bodies},
          {"box", filled_box(setup.mesh, units)},
          {"contact", contact.enabled},
          {"friction", contact.has_friction()},
          {"settings", chosen_settings(setup, scene)},
          {"solvers", available_solvers()}};
}

}  // namespace

int explain(const RunOptions& options) {
  scene::Scene scene = scene::read(options.scene, options.overrides);
  linear::Registry registry;
  registry.allow_mpi_start();
  std::visit(
      [&](auto& setup) {
        const SolverChoice choice = choose_solver(setup.linear, options, registry);
        for (const auto& warning : choice.warnings) scene.warnings.push_back(warning);
        Explanation(setup, registry, scene, scene.warnings).print(scene.output.units);
      },
      scene.setup);
  return done;
}

int print_facts(const RunOptions& options) {
  const scene::Scene scene = scene::read(options.scene, options.overrides);
  const Json merged = Json::parse(scene.identity);
  const Json found = std::visit([&](const auto& setup) { return facts(setup, merged); }, scene.setup);
  fmt::print("{}\n", found.dump(1));
  return done;
}

}  // namespace itr::cli
