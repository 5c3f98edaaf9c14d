// SPDX-License-Identifier: MIT
#include "plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "itr/core/error.hpp"
#include "itr/linear/registry.hpp"
#include "rows.hpp"

namespace itr::cli::study {

namespace {

using Json = nlohmann::json;
using Kind = Series::Kind;
using Overrides = std::vector<scene::Override>;

constexpr double kFactors[] = {4, 1, 1.0 / 4, 1.0 / 16};  ///< of the scene's tolerance
constexpr double kReferenceShare = 1.0 / 16;              ///< its tolerance by the smallest of the study
constexpr int kReferenceTries = 3;                        ///< of tolerances, where none is asked for
constexpr double kNextTry = 1.0 / 16;                     ///< of the tolerance before, which split nothing
constexpr double kSecondShare = 4;                        ///< the second reference's tolerance by the first's
/// Rounds of friction: a remeshed step solves twice, so only friction that has converged is the same on all meshes.
constexpr int kFrictionRounds = 50;

Overrides operator+(Overrides a, const Overrides& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Splits and collapses by energy as this library decides them; rows below change that.
Overrides remeshed(const Overrides& changes = {}) {
  Overrides all = {{"/space/remesh/enabled", "true"},
                   {"/space/remesh/type", "\"physics\""},
                   {"/space/remesh/screening", "\"bounds\""},
                   {"/space/remesh/curve/enabled", "false"},
                   {"/space/remesh/straighten/enabled", "false"},
                   {"/space/remesh/swap/enabled", "false"},
                   {"/space/remesh/smooth/enabled", "false"}};
  for (const auto& change : changes) {
    const auto same = [&](const scene::Override& o) { return o.pointer == change.pointer; };
    const auto found = std::find_if(all.begin(), all.end(), same);
    if (found == all.end())
      all.push_back(change);
    else
      *found = change;
  }
  return all;
}

const scene::Override kFixed = {"/space/remesh/enabled", "false"};
const scene::Override kQuadratic = {"/space/discr_order", "2"};
const scene::Override kCurve = {"/space/remesh/curve/enabled", "true"},
                      kStraighten = {"/space/remesh/straighten/enabled", "true"};
const scene::Override kSwap = {"/space/remesh/swap/enabled", "true"}, kSmooth = {"/space/remesh/smooth/enabled", "true"};

/// The scene as its options ask for, merged.
class Source {
 public:
  explicit Source(const Options& options) : scene_(scene::read(options.scene, options.overrides)) {
    json_ = Json::parse(scene_.identity);
    const auto look = [&](auto setup) {
      dim = static_cast<int>(setup.mesh.rest(0).size());
      units = setup.units;
      time = setup.time;
      if constexpr (std::is_same_v<decltype(setup), Setup<3>>) box = find_box(setup.mesh);
      num_cells = setup.mesh.num_cells();
      has_contact = setup.contact.enabled;
      body = setup.mesh.body(0);
      for (CellId c = 0; c < setup.mesh.cell_slots(); ++c) has_one_body &= setup.mesh.body(c) == body;
      const bool is_open = setup.contact.enabled && !has("/solver/contact/barrier_stiffness");
      if (is_open) setup.contact.adaptive_stiffness = false, setup.contact.barrier_stiffness = 0;
      setup.remesh.enabled = true;
      setup.choose_defaults();
      remesh = setup.remesh;
      // Remeshing's choice holds for all runs: they are to have one limit.
      const double unit = setup.contact.convergent ? units.factor("Pa") : units.factor("J") / std::pow(units.factor("m"), 4);
      if (is_open)
        pinned = {{"/solver/contact/barrier_stiffness", fmt::format("{}", setup.contact.barrier_stiffness / unit)}};
      const auto& contact = setup.contact;
      has_friction = contact.enabled && contact.friction_coefficient > 0 && contact.friction_iterations != 0;
      if (has_friction) pin_friction(options.overrides);
    };
    std::visit(look, scene_.setup);
    if (json_["geometry"].is_array()) {
      for (std::size_t i = 0; i < json_["geometry"].size(); ++i)
        find_body(json_["geometry"][i], fmt::format("/geometry/{}", i));
    } else {
      find_body(json_["geometry"], "/geometry");
    }
  }

  int dim = 0;
  Units units;  ///< of the scene's keys; all that is told of its runs is in SI units
  TimeOptions time;
  RemeshOptions remesh;          ///< with its defaults chosen
  Overrides pinned;              ///< what the scene leaves open and all runs have to agree on
  std::string notes;             ///< the same in words
  std::optional<RowsOfBox> box;  ///< that the bodies fill together
  int num_cells = 0, body = 0;   ///< before refinement; the first cell's
  bool has_one_body = true, has_contact = false, has_friction = false;

  bool has(const std::string& pointer) const { return json_.contains(Json::json_pointer(pointer)); }
  /// Every body refined so many times more than the scene has it.
  Overrides refined(int more) const {
    Overrides all;
    for (const auto& [pointer, own] : bodies_) all.push_back({pointer + "/n_refs", std::to_string(own + more)});
    return all;
  }
  /// The bodies' mesh replaced by one in a file; none where that would lose what only the scene's own file says.
  std::optional<Overrides> with_mesh(const std::filesystem::path& file) const {
    if (bodies_.size() != 1) return std::nullopt;
    const std::string& pointer = bodies_.front().first;
    if (has(pointer + "/array") || has("/contact/collision_mesh")) return std::nullopt;
    if (!has_one_body && !has(pointer + "/volume_selection")) return std::nullopt;
    Overrides all = {{pointer + "/mesh", Json(file.generic_string()).dump()}, {pointer + "/n_refs", "0"}};
    if (!units.is_si() || has(pointer + "/unit")) all.push_back({pointer + "/unit", "\"m\""});
    if (has(pointer + "/transformation")) all.push_back({pointer + "/transformation", "{}"});
    return all;
  }
  /// As messages name a level.
  std::string level_label(int more) const { return fmt::format("n_refs {}", bodies_.front().second + more); }

 private:
  void find_body(const Json& geometry, const std::string& pointer) {
    if (geometry.value("is_obstacle", false) || !geometry.value("enabled", true)) return;
    bodies_.emplace_back(pointer, geometry.value("n_refs", 0));
  }

  /// Rounds until nothing moves any more, on all meshes alike; what the study's own `--set` says of them stays.
  void pin_friction(const Overrides& asked) {
    const auto pin = [&](const char* pointer, const std::string& value) {
      const auto is_it = [&](const scene::Override& o) { return o.pointer == pointer; };
      if (std::none_of(asked.begin(), asked.end(), is_it)) pinned.push_back({pointer, value});
    };
    pin("/solver/contact/friction_iterations", std::to_string(kFrictionRounds));
    pin("/solver/contact/friction_convergence_tol", "0");
    notes += "friction lagged until it does not change, at most " + json_friction_rounds() + " rounds a solve";
  }

  std::string json_friction_rounds() const {
    for (const auto& one : pinned)
      if (one.pointer == "/solver/contact/friction_iterations") return one.value;
    return std::to_string(json_["solver"]["contact"]["friction_iterations"].get<int>());
  }

  scene::Scene scene_;
  Json json_;
  std::vector<std::pair<std::string, int>> bodies_;  ///< pointer and own n_refs
};

bool contains(const Overrides& all, const scene::Override& one) {
  return std::any_of(all.begin(), all.end(),
                     [&](const scene::Override& o) { return o.pointer == one.pointer && o.value == one.value; });
}

/// The tolerances of the operations of a series, in the ratio of the split's to the scene's own.
Overrides with_tolerance(const Source& source, const Series& series, double tolerance) {
  const double own = *source.remesh.split.acceptance_tolerance;
  Overrides all = {{"/space/remesh/split/acceptance_tolerance", fmt::format("{}", source.units.from_si(tolerance, "J"))}};
  const auto scale = [&](const char* operation, double value) {
    all.push_back({fmt::format("/space/remesh/{}/acceptance_tolerance", operation),
                   fmt::format("{}", source.units.from_si(value * tolerance / own, "J"))});
  };
  scale("collapse", *source.remesh.collapse.acceptance_tolerance);
  if (contains(series.overrides, kSwap)) scale("swap", *source.remesh.swap.acceptance_tolerance);
  if (contains(series.overrides, kSmooth)) scale("smooth", *source.remesh.smooth.acceptance_tolerance);
  const auto &curve = source.remesh.curve.acceptance_tolerance, &straighten = source.remesh.straighten.acceptance_tolerance;
  if (contains(series.overrides, kCurve) && curve) scale("curve", *curve);
  if (contains(series.overrides, kCurve) && straighten) scale("straighten", *straighten);
  return all;
}

/// Reaches the same end in steps of dt / parts.
Overrides with_time_step(const Source& source, int parts, int skip) {
  Overrides all = {{"/output/paraview/skip_frame", std::to_string(skip * parts)}};
  if (source.has("/time/dt"))
    all.push_back({"/time/dt", fmt::format("{}", source.units.from_si(source.time.dt / parts, "s"))});
  if (source.has("/time/time_steps")) all.push_back({"/time/time_steps", std::to_string(source.time.steps * parts)});
  return all;
}

std::vector<std::string> solvers_there() {
  linear::Registry registry;
  std::vector<std::string> names;
  for (const auto& row : registry.list())
    if (row.available && row.name != "dense" && row.name != "auto") names.push_back(row.name);
  return names;
}

std::string folder_name(std::string text) {
  std::replace(text.begin(), text.end(), ':', '-');
  return text;
}

class Planner {
 public:
  explicit Planner(const Options& options) : options_(options), source_(options) {
    levels_ = options.levels > 0 ? options.levels : source_.dim == 2 ? 3 : 2;
    plan_.notes = source_.notes;
    skip_ = std::max(1, source_.time.steps / std::max(1, options.frames));
    tolerances_ = options.tolerances;
    const double own = *source_.remesh.split.acceptance_tolerance;
    if (tolerances_.empty())
      for (const double factor : kFactors) tolerances_.push_back(own * factor);
    std::sort(tolerances_.begin(), tolerances_.end(), std::greater<>());
    starts_ = options.starts.empty() ? std::vector<int>{0} : options.starts;
    plan_.dim = source_.dim;
    plan_.has_contact = source_.has_contact;
    plan_.has_friction = source_.has_friction;
    plan_.is_dynamic = !source_.time.is_static && !source_.time.quasistatic;
  }

  Plan make() {
    plan_.finest = fmt::format("uniform-{}", levels_);
    plan_.coarser = fmt::format("uniform-{}", levels_ - 1);
    if (options_.reference.empty()) add_references();
    for (const auto& series : all_series())
      if (is_asked(series)) add(series);
    return std::move(plan_);
  }

 private:
  bool is_asked(const Series& series) const {
    const auto& asked = options_.series;
    if (asked.empty()) return series.is_default;
    const auto has = [&](const std::string& name) { return std::find(asked.begin(), asked.end(), name) != asked.end(); };
    return has(series.name) || has("all");
  }

  PlannedRun complete(PlannedRun run) const {
    if (!source_.units.is_si()) run.overrides.insert(run.overrides.begin(), {"/output/units", "\"SI\""});
    run.overrides.insert(run.overrides.begin(), {{"/output/paraview/skip_frame", std::to_string(skip_)},
                                                 {"/output/paraview/options/kinetic_energy", "true"},
                                                 {"/output/paraview/options/momentum", "true"}});
    run.overrides.insert(run.overrides.begin(), source_.pinned.begin(), source_.pinned.end());
    run.overrides.insert(run.overrides.begin(), options_.overrides.begin(), options_.overrides.end());
    if (run.solver.empty()) run.solver = options_.solver;
    return run;
  }

  void add(PlannedRun run) { plan_.runs.push_back(complete(std::move(run))); }

  /// The finest level, split on where that gains least of all, and never coarsened: its space has all of the uniform ones.
  /// Beside series with quadratic functions it has them too. A second one, coarser by a level and by its tolerance, tells
  /// what it is worth.
  void add_references() {
    static const scene::Override keep = {"/space/remesh/collapse/enabled", "false"};
    static const char* const what = "what the others are compared with";
    static const Series linear_series = {kReference, Kind::levels, true, what, remeshed({keep})};
    // Only what is distorted becomes straight.
    static const scene::Override at_no_gain = {"/space/remesh/straighten/acceptance_tolerance", "1e100"};
    static const Series quadratic_series = {kReference, Kind::levels, true, what,
                                            remeshed({keep, kQuadratic, kCurve, kStraighten, at_no_gain})};
    const auto has_curves = [&](const Series& one) {
      return is_asked(one) && one.kind == Kind::tolerances && (contains(one.overrides, kCurve) || is_quadratic(one));
    };
    const bool curves = std::any_of(all_series().begin(), all_series().end(), has_curves);
    const Series& series = curves ? quadratic_series : linear_series;
    const double asked = options_.reference_tolerance;
    const double tolerance = asked > 0 ? asked : kReferenceShare * tolerances_.back();
    const auto split_on = [&](std::string name, int level, double by) {
      return PlannedRun{std::move(name),
                        &series,
                        fmt::format("{}{}, split on to {:g} J", curves ? "order 2, " : "", source_.level_label(level), by),
                        of_order(series) + source_.refined(level) + with_tolerance(source_, series, by),
                        "",
                        ""};
    };
    const int finest = levels_ - curves;
    plan_.references.push_back(complete(split_on(kReference, finest, tolerance)));
    for (double next = tolerance * kNextTry; asked == 0 && plan_.references.size() < kReferenceTries; next *= kNextTry)
      plan_.references.push_back(complete(split_on(fmt::format("{}-{:g}", kReference, next), finest, next)));
    PlannedRun second = split_on(kSecondReference, std::max(finest - 1, 0), kSecondShare * tolerance);
    second.reference = kReference;
    add(std::move(second));
  }

  static bool is_quadratic(const Series& series) { return contains(series.overrides, kQuadratic); }

  /// Where the scene asks for quadratic elements, linear ones.
  Overrides linear(const Overrides& overrides) const {
    return source_.has("/space/discr_order") ? overrides + Overrides{{"/space/discr_order", "1"}} : overrides;
  }

  /// A series' overrides, with the order of its elements.
  Overrides of_order(const Series& series) const {
    return is_quadratic(series) ? series.overrides : linear(series.overrides);
  }

  /// A run for each level by about as many cells in rows, where the bodies are one box.
  void add_rows(const Series& series) {
    if (!source_.box) return;
    const auto folder = directory_of(options_) / "meshes";
    for (int level = 0; level <= levels_; ++level) {
      const auto file = folder / fmt::format("rows-{}.msh", level);
      const auto mesh = source_.with_mesh(path_in_scene(file));
      if (!mesh) return;
      const auto n = source_.box->counts(source_.num_cells * std::pow(8.0, level));
      std::filesystem::create_directories(folder);
      write_rows(*source_.box, n, source_.has_one_body ? source_.body : 0, file);
      add({fmt::format("{}-{}", series.name, level), &series, fmt::format("{} x {} x {} cubes", n[0], n[1], n[2]),
           linear(series.overrides) + *mesh, "", kReference});
    }
  }

  /// As the scene may name a file: from the working folder, so that what is stored holds no place of this machine.
  static std::filesystem::path path_in_scene(const std::filesystem::path& file) { return std::filesystem::proximate(file); }

  void add(const Series& series) {
    switch (series.kind) {
      case Kind::levels:
        // A level of quadratic elements has about as many unknowns as the next one of linear elements.
        for (int level = 0; level <= levels_ - is_quadratic(series); ++level)
          add({fmt::format("{}-{}", series.name, level), &series, source_.level_label(level),
               of_order(series) + source_.refined(level), "", kReference});
        return;
      case Kind::rows:
        add_rows(series);
        return;
      case Kind::tolerances:
        for (const int start : starts_)
          for (const double tolerance : tolerances_) add_remeshed(series, start, tolerance);
        return;
      case Kind::solvers:
        for (const auto& solver : solvers_there())
          add({fmt::format("{}-{}", series.name, folder_name(solver)), &series, solver,
               linear(series.overrides) + source_.refined(levels_ - 1), solver, kReference});
        return;
      case Kind::time_steps:
        for (const int parts : {1, 2, 4})
          add({fmt::format("{}-{}", series.name, parts), &series, fmt::format("dt {:g} s", source_.time.dt / parts),
               linear(series.overrides) + source_.refined(levels_ - 1) + with_time_step(source_, parts, skip_), "",
               fmt::format("{}-4", series.name)});
        return;
    }
  }

  void add_remeshed(const Series& series, int start, double tolerance) {
    std::string name = fmt::format("{}-{:g}", series.name, tolerance), label = fmt::format("tolerance {:g} J", tolerance);
    if (start > 0) name += fmt::format("-from-{}", start), label += ", from " + source_.level_label(start);
    add({name, &series, label, of_order(series) + source_.refined(start) + with_tolerance(source_, series, tolerance), "",
         kReference});
  }

  const Options& options_;
  Source source_;
  int levels_, skip_;
  std::vector<double> tolerances_;
  std::vector<int> starts_;
  Plan plan_;
};

}  // namespace

const std::vector<Series>& all_series() {
  static const std::vector<Series> table = {
      {"uniform", Kind::levels, true, "uniform refinement, linear elements (P1)", {kFixed}},
      {"rows", Kind::rows, true, "in 3D, where the body is a box: as many linear elements in rows", {kFixed}},
      {"uniform-p2", Kind::levels, true, "uniform refinement, quadratic elements (P2)", {kFixed, kQuadratic}},
      {"itr", Kind::tolerances, true, "splits and collapses", remeshed()},
      {"swaps", Kind::tolerances, true, "splits, collapses and swaps", remeshed({kSwap})},
      {"smoothing", Kind::tolerances, true, "splits, collapses, swaps and smoothing", remeshed({kSwap, kSmooth})},
      {"hp", Kind::tolerances, false, "splits, curved edges and collapses", remeshed({kCurve, kStraighten})},
      {"hp-smoothing", Kind::tolerances, false, "`hp`, swaps and smoothing",
       remeshed({kCurve, kStraighten, kSwap, kSmooth})},
      {"p", Kind::tolerances, false, "curved edges alone",
       remeshed({kCurve, kStraighten, {"/space/remesh/split/enabled", "false"}})},
      {"splits-p2", Kind::tolerances, false, "splits of quadratic elements", remeshed({kQuadratic})},
      {"culling", Kind::tolerances, false, "`smoothing`, the paper's culling by energy",
       remeshed({kSwap, kSmooth, {"/space/remesh/screening", "\"energy-percentile\""}})},
      {"sizing-field", Kind::levels, false, "the sizing-field baseline, from each uniform level",
       remeshed({{"/space/remesh/type", "\"sizing_field\""}})},
      {"solvers", Kind::solvers, false, "the linear solvers that are there, without remeshing", {kFixed}},
      {"time", Kind::time_steps, false, "dt, dt/2 and dt/4 without remeshing, against dt/4", {kFixed}},
  };
  return table;
}

std::filesystem::path directory_of(const Options& options) {
  return options.directory.empty() ? std::filesystem::path("study") / options.scene.stem() : options.directory;
}

Plan make_plan(const Options& options) {
  std::string names = "all";
  for (const auto& series : all_series()) names += fmt::format(", {}", series.name);
  for (const auto& name : options.series) {
    const auto is_it = [&](const Series& series) { return name == series.name; };
    if (name != "all" && std::none_of(all_series().begin(), all_series().end(), is_it))
      throw InputError({"", "--series", "\"" + name + "\"", "some of " + names});
  }
  return Planner(options).make();
}

}  // namespace itr::cli::study
