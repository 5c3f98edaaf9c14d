// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "defaults.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

constexpr double kMostSteps = 1e9;
constexpr int kMostCuts = 20;

void read_integrator(const Node& node, TimeOptions& options) {
  const bool is_object = node.exists() && node.json().is_object();
  const Node name = is_object ? node["type"] : node;
  if (is_object && !name.exists()) name.fail("the type of integrator");
  const int index =
      name.choice({"ImplicitEuler", "ImplicitNewmark", "BDF", "BDF1", "BDF2", "BDF3", "BDF4", "BDF5", "BDF6"}, 0);
  options.integrator = std::array{Integrator::implicit_euler, Integrator::newmark, Integrator::bdf}[std::min(index, 2)];
  const auto refuse = [&](const char* key, const char* owner) {
    if (node.has(key)) node[key].fail("it beside the type " + abbreviate(name.json()), std::string("it with ") + owner);
  };
  if (index != 1)
    for (const char* key : {"beta", "gamma", "energy_growth_limit"}) refuse(key, "ImplicitNewmark only");
  if (index != 2) refuse("steps", "BDF only: BDF1 to BDF6 have their order in the name");
  if (index > 2) options.bdf_order = index - 2;
  if (index == 2) {
    if (!is_object) name.fail("BDF1 to BDF6, or an object with type and steps");
    options.bdf_order = node["steps"].integer_at_least(1, 1);
    if (options.bdf_order > 6) node["steps"].fail("1 to 6");
  }
  options.newmark_beta = node["beta"].positive(0.25);
  options.newmark_gamma = node["gamma"].positive(0.5);
  options.energy_growth_limit = node["energy_growth_limit"].positive(options.energy_growth_limit);
  if (options.newmark_beta > 0.5) node["beta"].fail("a number of (0, 0.5]");
  if (options.newmark_gamma > 1) node["gamma"].fail("a number of (0, 1]");
}

/// Steps that are chosen by their errors between t0 and tend. Where a length or a number of steps is asked for before the
/// run, it is a thousandth of the run, and a thousand.
void read_adaptive_steps(const Node& time, TimeOptions& options) {
  constexpr int kNominalSteps = 1000;
  constexpr double kLeast = 1e-7, kMost = 0.1;  // of the run
  AdaptiveTimeOptions& adaptive = options.adaptive;
  adaptive.enabled = true;
  if (!time.has("tend")) time["tend"].fail("the end of the run, beside dt \"auto\"");
  if (time.has("time_steps")) time["time_steps"].fail("no number of steps beside dt \"auto\"");
  adaptive.begin = options.t0;
  adaptive.end = time["tend"].number(0);
  const double duration = adaptive.end - adaptive.begin;
  adaptive.tolerance = time["tolerance"].positive(adaptive.tolerance);
  adaptive.dt_min = time["dt_min"].positive(kLeast * duration);
  adaptive.dt_max = time["dt_max"].positive(kMost * duration);
  if (adaptive.dt_max < adaptive.dt_min) time["dt_max"].fail("a number >= dt_min");
  if (time.has("output_dt")) adaptive.output_dt = time["output_dt"].positive(0);
  options.steps = kNominalSteps;
  options.dt = std::clamp(duration / kNominalSteps, adaptive.dt_min, adaptive.dt_max);
}

/// Two of tend, dt, time_steps; a third must agree with them.
void read_steps(const Node& time, TimeOptions& options, std::vector<std::string>& warnings) {
  const Node tend = time["tend"], dt = time["dt"], steps = time["time_steps"];
  const Units& units = time.document().units;
  Json found = Json::object();
  for (const char* key : {"dt", "tend", "time_steps"})
    if (time.has(key)) found[key] = time[key].json();
  if (found.size() < 2) time.fail(abbreviate(found), "two of tend, dt and time_steps");
  if (tend.exists() && !(tend.number(0) > options.t0))
    tend.fail(fmt::format("a time after t0 = {:g}", units.from_si(options.t0, "s")));
  if (dt.exists() && dt.json() == "auto") return read_adaptive_steps(time, options);
  for (const char* key : {"tolerance", "dt_min", "dt_max", "output_dt"})
    if (time.has(key)) time[key].fail("it with dt \"auto\" only");
  const double duration = tend.number(0) - options.t0;
  options.steps = steps.integer_at_least(1, 1);
  options.dt = dt.exists() ? dt.positive(1) : duration / options.steps;
  if (!tend.exists()) return;
  if (steps.exists()) {
    if (std::abs(options.steps * options.dt - duration) > 1e-12 * std::max(1.0, duration))
      time.fail(abbreviate(found), "tend = t0 + dt * time_steps, or only two of them");
    return;
  }
  const double ratio = duration / options.dt, nearest = std::round(ratio);
  // Decimal fractions are not exact: 0.07 / 0.01 is a little more than 7.
  const bool is_whole = std::abs(ratio - nearest) <= 1e-9 * nearest;
  const double count = is_whole ? nearest : std::ceil(ratio);
  if (count > kMostSteps) dt.fail("at most 1e9 steps");
  options.steps = static_cast<int>(count);
  if (is_whole) return;
  std::ostringstream end;
  end << tend.pointer() << ": " << tend.without_units().number(0) << " " << units.time()
      << " is no whole number of steps: the run ends at " << units.from_si(options.t0 + count * options.dt, "s") << " "
      << units.time();
  warnings.push_back(end.str());
}

void read_acceptance(const Node& node, bool& enabled, std::optional<double>& tolerance) {
  enabled = node["enabled"].boolean(enabled);
  if (node.has("acceptance_tolerance")) tolerance = node["acceptance_tolerance"].number(0);
}

double read_fraction(const Node& node, double fallback) {
  const double value = node.number(fallback);
  if (!(value >= 0 && value <= 1)) node.fail("a number of [0, 1]");
  return value;
}

}  // namespace

Units read_units(const Node& root) {
  const Node node = root["units"];
  const auto choose = [&](const char* key, const std::vector<std::string>& names, const char* si) {
    const int found = node[key].choice(names, -1);
    return found < 0 ? std::string(si) : names[static_cast<std::size_t>(found)];
  };
  Units units(choose("length", Units::length_names(), "m"), choose("mass", Units::mass_names(), "kg"),
              choose("time", Units::time_names(), "s"));
  units.has_steps = root.has("time");
  return units;
}

TimeOptions read_time(const Node& root, std::vector<std::string>& warnings) {
  TimeOptions options;
  const Node time = root["time"];
  if (!time.exists()) {
    options.is_static = true;
    return options;
  }
  options.t0 = time["t0"].number(0);
  options.quasistatic = time["quasistatic"].boolean(false);
  options.step_cuts = time["step_cuts"].integer_at_least(0, 0);
  if (options.step_cuts > kMostCuts) time["step_cuts"].fail("at most " + std::to_string(kMostCuts));
  read_steps(time, options, warnings);
  read_integrator(time["integrator"], options);
  if (options.adaptive.enabled && options.integrator == Integrator::bdf && options.bdf_order > 2)
    time["integrator"].fail("BDF1 or BDF2 beside dt \"auto\"");
  return options;
}

void warn_of_idle_keys(const Node& root, const TimeOptions& time, bool has_obstacles, std::vector<std::string>& warnings) {
  const auto warn = [&](const Node& node, const char* text) { warnings.push_back(node.pointer() + ": " + text); };
  const Node contact = root["contact"], remesh = root["space"]["remesh"], initial = root["initial_conditions"];
  if (contact.exists() && !contact.has("enabled") && !contact.json().empty())
    warn(contact, "without \"enabled\": true nothing collides");
  else if (!contact["enabled"].boolean(false) && has_obstacles)
    warn(contact["enabled"], "not true, so nothing collides: bodies pass through the obstacles");
  else if (!contact["enabled"].boolean(false) && contact["friction_coefficient"].number(0) > 0)
    warn(contact["friction_coefficient"], "without /contact/enabled = true there is no friction");
  else if (!contact["enabled"].boolean(false) && contact.has("friction_pairs"))
    warn(contact["friction_pairs"], "without /contact/enabled = true there is no friction");
  if (remesh.exists() && !remesh.has("enabled") && !remesh.json().empty())
    warn(remesh, "without \"enabled\": true the mesh stays as it is");
  if (const Node curve = remesh["curve"]; curve.has("acceptance_tolerance") && !curve["enabled"].boolean(false))
    warn(curve["acceptance_tolerance"], "without /space/remesh/curve/enabled = true no edge becomes curved");
  for (const char* operation : {"straighten", "collapse", "swap", "smooth"})
    if (const Node tolerance = remesh[operation]["acceptance_tolerance"]; tolerance.number(0) > 0)
      warn(tolerance,
           "positive: only what lowers the energy by so much is done, and hardly anything is; -1e-8 allows a rise");
  if ((time.is_static || time.quasistatic) && !initial["velocity"].items().empty())
    warn(initial["velocity"], "without inertia (a static or quasistatic scene) a velocity has no effect");
  if (initial["acceleration"].exists() && (time.is_static || time.quasistatic || time.integrator != Integrator::newmark))
    warn(initial["acceleration"], "only ImplicitNewmark begins with an acceleration");
}

double characteristic_length(const Node& root, const TimeOptions& time) {
  return root["units"]["characteristic_length"].positive(1) * (time.is_static ? 1 : time.dt);
}

ContactOptions read_contact(const Node& root, double shortest_edge, std::vector<std::string>& warnings) {
  const Node contact = root["contact"], solver = root["solver"]["contact"];
  const Units& units = root.document().units;
  ContactOptions options;
  options.enabled = contact["enabled"].boolean(false);
  const bool is_auto = contact.has("dhat") && contact["dhat"].json() == "auto";
  options.dhat = is_auto ? 0 : contact["dhat"].positive(1e-3);
  const double fraction = contact["dhat_percentage"].positive(0.8);
  if (options.enabled && options.dhat > shortest_edge) {
    if (!contact.has("dhat"))
      options.dhat = fraction * shortest_edge;
    else
      warnings.push_back(fmt::format("{}: {} is longer than the shortest edge of the surfaces, {}",
                                     contact["dhat"].pointer(), units.text(options.dhat, "m", 6),
                                     units.text(shortest_edge, "m", 6)));
  }
  options.resolve_overlap = contact["initial_overlap"].choice({"refuse", "resolve"}, 0) == 1;
  if (options.resolve_overlap && !options.enabled)
    contact["initial_overlap"].fail("\"resolve\" without contact", "it where /contact/enabled is true");
  options.convergent = contact["use_convergent_formulation"].boolean(false);
  const Node averages = contact["average_gaps"];
  options.may_average_gaps = options.enabled && averages.exists() && averages.json() == "auto";
  options.average_gaps = options.enabled && !options.may_average_gaps && averages.boolean(false);
  options.friction_coefficient = contact["friction_coefficient"].non_negative(0);
  const Node epsv = contact["epsv"];
  options.friction_velocity = epsv.exists() && epsv.json() == "auto" ? 0 : epsv.positive(1e-3);
  const Node stiffness = solver["barrier_stiffness"];
  const bool is_from_bodies = stiffness.exists() && stiffness.json() == "auto";
  options.adaptive_stiffness = !stiffness.exists() || stiffness.json() == "adaptive";
  const Node first = solver["initial_barrier_stiffness"];
  // The plain form's barrier is in m^4, its stiffness an energy by that.
  const double unit = options.convergent ? units.factor("Pa") : units.factor("J") / std::pow(units.factor("m"), 4);
  if (options.adaptive_stiffness) options.barrier_stiffness = first.exists() ? unit * first.positive(1) : 1;
  if (!is_from_bodies && !options.adaptive_stiffness) options.barrier_stiffness = unit * stiffness.positive(1);
  options.friction_iterations = solver["friction_iterations"].integer(1);
  options.friction_tolerance = solver["friction_convergence_tol"].non_negative(1e-2);
  const Node adhesion = contact["adhesion"];
  if (!adhesion["adhesion_enabled"].boolean(false)) return options;
  AdhesionOptions& pull = options.adhesion;
  pull.peak = adhesion["dhat_p"].positive(pull.peak);
  pull.reach = adhesion["dhat_a"].positive(pull.reach);
  if (!(pull.reach > pull.peak)) adhesion["dhat_a"].fail("a distance beyond dhat_p");
  pull.strength = adhesion["adhesion_strength"].positive(1e-3);
  pull.tangential_coefficient = adhesion["tangential_adhesion_coefficient"].non_negative(0);
  pull.velocity = adhesion["epsa"].positive(pull.velocity);
  pull.iterations = solver["tangential_adhesion_iterations"].integer(pull.iterations);
  pull.is_by_step = is_polyfem_set(root);
  return options;
}

LaggedRegularization read_lagged_regularization(const Node& root, const TimeOptions& time,
                                                std::vector<std::string>& warnings) {
  const Node advanced = root["solver"]["advanced"], weight = advanced["lagged_regularization_weight"];
  LaggedRegularization options{weight.non_negative(0), advanced["lagged_regularization_iterations"].integer_at_least(0, 1)};
  if (options.weight > 0 && !time.is_static) warnings.push_back(weight.pointer() + ": only static scenes are regularized");
  return options;
}

namespace {

constexpr const char* kPaperKeys[] = {"x_delta", "grad_norm", "f_delta"};
constexpr const char* kMainKeys[] = {"x_delta_tol",     "grad_norm_tol",        "rel_grad_norm_tol",
                                     "rel_x_delta_tol", "newton_decrement_tol", "norm_type"};

/// The first key of a vocabulary that a scene has; that of the energy is in /advanced.
template <std::size_t N>
Node find_any(const Node& nonlinear, const char* const (&keys)[N], const char* energy_key) {
  for (const char* key : keys)
    if (nonlinear.has(key)) return nonlinear[key];
  return nonlinear["advanced"][energy_key];
}

/// At either of the two places where PolyFEM has had it.
Node first_gradient_node(const Node& nonlinear) {
  return nonlinear.has("first_grad_norm_tol") ? nonlinear["first_grad_norm_tol"]
                                              : nonlinear["advanced"]["first_grad_norm_tol"];
}

/// docs/theory.md, "Tolerances": tolerances in the paper's sense, Euclidean norms times h.
void read_paper_tolerances(const Node& nonlinear, double length, NewtonOptions& options) {
  const Node advanced = nonlinear["advanced"];
  const Units& units = nonlinear.document().units;
  options.step_tolerance = length * nonlinear["x_delta"].non_negative(0);
  options.gradient_tolerance = length * nonlinear["grad_norm"].non_negative(0);
  options.first_gradient_tolerance = length * units.factor("N s") * first_gradient_node(nonlinear).non_negative(0);
  const Node energy = advanced.has("f_delta") ? advanced["f_delta"] : nonlinear["f_delta"];
  options.energy_tolerance = length * energy.non_negative(0);
  options.energy_steps = advanced["f_delta_step_tol"].integer_at_least(1, 100);
}

/// docs/theory.md, "Tolerances": norms that do not depend on the mesh, tolerances times the scene's scales.
void read_main_tolerances(const Node& root, const SceneScale& scale, NewtonOptions& options) {
  const Node nonlinear = root["solver"]["nonlinear"], advanced = root["solver"]["advanced"];
  const Node given_length = advanced["characteristic_length"];
  const double given = given_length.number(-1), length = given > 0 ? given : scale.diagonal;
  const double force = advanced["characteristic_force_density"].positive(1e4);
  options.norm = std::array{NewtonNorm::l2, NewtonNorm::linf,
                            NewtonNorm::euclidean}[nonlinear["norm_type"].choice({"L2", "Linf", "Euclidean"}, 0)];
  const Units& units = root.document().units;
  double gradient_scale = 1, step_scale = 1;
  // The scales lack a dimension that their tolerances bring: for a gradient, that of h^2.
  double gradient_unit = units.factor("N s^2"), step_unit = units.factor("m");
  if (options.norm != NewtonNorm::euclidean) gradient_unit = units.factor("s^2"), step_unit = 1;
  const auto gradient = [&](const Node& node) { return gradient_scale * gradient_unit * node.non_negative(0); };
  if (options.norm == NewtonNorm::l2) {
    const double root_of_volume = std::pow(length, 0.5 * scale.dimension);
    gradient_scale = force * root_of_volume;
    step_scale = length * root_of_volume;
  } else if (options.norm == NewtonNorm::linf) {
    gradient_scale = force;
    step_scale = length;
  }
  options.step_tolerance = step_scale * step_unit * nonlinear["x_delta_tol"].non_negative(0);
  options.gradient_tolerance = gradient(nonlinear["grad_norm_tol"]);
  options.first_gradient_tolerance = gradient(first_gradient_node(nonlinear));
  options.relative_gradient_tolerance = nonlinear["rel_grad_norm_tol"].non_negative(0);
  options.relative_step_tolerance = nonlinear["rel_x_delta_tol"].non_negative(0);
  options.decrement_tolerance = nonlinear["newton_decrement_tol"].non_negative(0);
  options.energy_tolerance = nonlinear["advanced"]["f_delta_tol"].non_negative(0);
  options.energy_steps = nonlinear["advanced"]["f_delta_step_tol"].integer_at_least(1, 100);
}

/// Peers' norms were made by an L D L^T, which takes indefinite directions: such a scene asks for the same with any solver.
IndefiniteHessian indefinite_by_solver(const Node& root) {
  const auto names = root["solver"]["linear"]["solver"].items();
  const std::string first = names.empty() ? "" : names.front().string("");
  const bool is_ldlt = first.starts_with("Eigen::") && first.ends_with("LDLT");
  return is_ldlt ? IndefiniteHessian::accept : IndefiniteHessian::project;
}

}  // namespace

NewtonOptions read_newton(const Node& root, double characteristic_length, const SceneScale& scale) {
  const Node nonlinear = root["solver"]["nonlinear"];
  NewtonOptions options;
  options.force_tolerance = nonlinear["force_tol"].non_negative(options.force_tolerance);
  options.max_iterations = nonlinear["max_iterations"].integer_at_least(1, options.max_iterations);
  const Node paper_key = find_any(nonlinear, kPaperKeys, "f_delta");
  const Node main_key = find_any(nonlinear, kMainKeys, "f_delta_tol");
  if (paper_key.exists() && main_key.exists())
    paper_key.fail("it beside " + main_key.pointer(), "one vocabulary of tolerances, not two");
  if (paper_key.exists())
    read_paper_tolerances(nonlinear, characteristic_length, options);
  else
    read_main_tolerances(root, scale, options);
  const Node newton = nonlinear["Newton"];
  options.project_to_psd = newton["use_psd_projection"].boolean(true);
  // PolyFEM leaves a fallback strategy after one step more than that.
  options.projected_iterations =
      1 + nonlinear["iterations_per_strategy"].integer_at_least(1, options.projected_iterations - 1);
  if (const Node force = newton["force_psd_projection"]; force.boolean(false)) {
    if (!options.project_to_psd) force.fail("true", "false beside use_psd_projection = false");
    options.projected_iterations = 0;
  }
  options.indefinite = indefinite_by_solver(root);
  return options;
}

LinearOptions read_linear(const Node& root) {
  const Node node = root["solver"]["linear"];
  LinearOptions options;
  std::vector<std::string> names;
  for (const Node& name : node["solver"].items())
    if (!name.string("").empty()) names.push_back(name.string(""));
  if (!names.empty()) options.solvers = names;
  for (const Node& name : node["fallback"].items()) options.fallback.push_back(name.string(""));
  const Node of_solvers = node["options"];
  if (!of_solvers.exists()) return options;
  if (!of_solvers.json().is_object()) of_solvers.fail("an object of solver names");
  for (const auto& [solver, values] : of_solvers.json().items()) {
    if (!values.is_object()) of_solvers[solver].fail("an object of option names");
    for (const auto& [key, value] : values.items()) {
      if (!value.is_string() && !value.is_number()) of_solvers[solver][key].fail("a text or a number");
      options.options[solver][key] = value.is_string() ? value.get<std::string>() : value.dump();
    }
  }
  return options;
}

RemeshOptions read_remesh(const Node& root) {
  const Node node = root["space"]["remesh"];
  RemeshOptions options;
  options.enabled = node["enabled"].boolean(false);
  options.sizing_field.enabled = node["type"].choice({"physics", "sizing_field"}, 0) == 1;
  options.sizing_field.rel_min_edge_length =
      node["sizing_field"]["rel_min_edge_length"].non_negative(options.sizing_field.rel_min_edge_length);
  options.screening =
      static_cast<Screening>(node["screening"].choice({"energy-percentile", "bounds"}, static_cast<int>(options.screening)));
  options.relative_tolerance = node["relative_tolerance"].positive(options.relative_tolerance);

  const Node split = node["split"], collapse = node["collapse"], swap = node["swap"], smooth = node["smooth"];
  read_acceptance(split, options.split.enabled, options.split.acceptance_tolerance);
  options.split.culling_threshold = read_fraction(split["culling_threshold"], options.split.culling_threshold);
  options.split.max_depth = split["max_depth"].integer_at_least(0, options.split.max_depth);
  if (split.has("min_edge_length")) options.split.min_edge_length = split["min_edge_length"].non_negative(0);

  read_acceptance(node["curve"], options.curve.enabled, options.curve.acceptance_tolerance);
  if (node["curve"].has("enabled")) options.curve.for_stability = options.curve.enabled;
  options.straighten.enabled = options.curve.enabled;
  read_acceptance(node["straighten"], options.straighten.enabled, options.straighten.acceptance_tolerance);

  read_acceptance(collapse, options.collapse.enabled, options.collapse.acceptance_tolerance);
  options.collapse.culling_threshold = read_fraction(collapse["culling_threshold"], options.collapse.culling_threshold);
  options.collapse.rel_max_edge_length = collapse["rel_max_edge_length"].non_negative(options.collapse.rel_max_edge_length);

  read_acceptance(swap, options.swap.enabled, options.swap.acceptance_tolerance);
  read_acceptance(smooth, options.smooth.enabled, options.smooth.acceptance_tolerance);
  return options;
}

OutputOptions read_output(const Node& root) {
  const Node output = root["output"];
  OutputOptions options;
  if (output["units"].choice({"scene", "SI"}, 0) == 0) options.units = root.document().units;
  options.skip_frames = output["paraview"]["skip_frame"].integer_at_least(1, options.skip_frames);
  options.vtu = output["paraview"]["vtu"].boolean(false);
  options.checkpoint_period = output["checkpoint_period"].non_negative(options.checkpoint_period);
  return options;
}

std::vector<DampingOptions> read_damping(const Node& root, const TimeOptions& time) {
  std::vector<DampingOptions> damping;
  for (const Node& node : root["solver"]["rayleigh_damping"].items()) {
    DampingOptions options;
    options.term = static_cast<DampingOptions::Term>(node["form"].choice({"elasticity", "contact"}, 0));
    if (!node.has("form")) node["form"].fail("\"elasticity\" or \"contact\"");
    const Node stiffness = node["stiffness"], ratio = node["stiffness_ratio"];
    if (stiffness.exists() == ratio.exists()) node.fail(abbreviate(node.json()), "one of stiffness and stiffness_ratio");
    const double h = time.dt;
    if (ratio.exists() && time.adaptive.enabled) ratio.fail("stiffness beside /time/dt \"auto\": a ratio is by dt");
    options.coefficient = stiffness.exists() ? stiffness.non_negative(0) : 0.75 * ratio.non_negative(0) * h * h * h;
    options.lagging_rounds = node["lagging_iterations"].integer_at_least(1, 1);
    if (options.coefficient > 0) damping.push_back(options);
  }
  return damping;
}

FieldOptions read_fields(const Node& root) {
  const Node asked = root["output"]["paraview"]["options"];
  const auto is_asked = [&](const char* key) { return asked[key].boolean(false); };
  return {.contact_forces = is_asked("contact_forces"),
          .friction_forces = is_asked("friction_forces"),
          .reaction_forces = is_asked("reaction_forces"),
          .von_mises = is_asked("scalar_values"),
          .stress = is_asked("tensor_values"),
          .kinetic_energy = is_asked("kinetic_energy"),
          .momentum = is_asked("momentum"),
          .pressure = is_asked("hydrostatic_pressure"),
          .stretches = is_asked("principal_stretches"),
          .contact_pressure = is_asked("contact_pressure")};
}

bool read_lump_mass(const Node& root) { return root["solver"]["advanced"]["lump_mass_matrix"].boolean(false); }

std::map<int, int> read_order(const Node& root, const LabelIds& labels, const std::set<int>& bodies) {
  const auto order_of = [](const Node& node) {
    const int order = node.integer_at_least(1, 1);
    if (order > 2) node.fail("1 or 2: higher orders are not supported");
    return order;
  };
  std::map<int, int> order;
  for (const Node& entry : root["space"]["discr_order"].items()) {
    if (!entry.json().is_object()) {
      for (const int body : bodies) order[body] = order_of(entry);
      continue;
    }
    const Label label = read_label(entry["id"], 0);
    if (labels.of(label).empty()) {
      if (!entry.has("id")) entry["id"].fail("the id of a body");
      labels.refuse(entry["id"], label, "the id of a body: ");
    }
    for (const int id : labels.of(label)) order[id] = order_of(entry["order"]);
  }
  return order;
}

int read_quadrature_degree(const Node& root) {
  const Node node = root["space"]["advanced"]["quadrature_order"];
  const int degree = node.integer(-1);
  if (degree == -1) return kElasticDegree;
  if (degree < 1 || degree > kMostQuadratureDegree) node.fail("1 to 5, or -1");
  return degree;
}

}  // namespace itr::scene
