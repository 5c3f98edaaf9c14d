// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>

#include "combined_conditions.hpp"
#include "defaults.hpp"
#include "eigenstrain.hpp"
#include "fluids.hpp"
#include "function.hpp"
#include "mesh/facet_tags.hpp"
#include "polyfem/python_value.hpp"
#include "readers.hpp"
#include "selection_file.hpp"
#include "supports.hpp"

namespace itr::scene {

namespace {

template <int Dim>
class ConditionReader {
 public:
  ConditionReader(const Node& root, const Sets& sets, Setup<Dim>& setup, std::vector<std::string>& warnings)
      : sets_(sets),
        boundary_(root["boundary_conditions"]),
        initial_(root["initial_conditions"]),
        geometry_(root["geometry"]),
        eigenstrains_(eigenstrain_components(root)),
        setup_(setup),
        warnings_(warnings),
        facet_tags_(sets.facet_tags(setup.mesh)) {
    for (VertexId v = 0; v < setup_.mesh.node_slots(); ++v) point_tags_.insert(setup_.mesh.vertex_tag(v));
    point_tags_.erase(kNoTag);
  }

  void read(ObstacleGeometry<Dim> geometry) {
    obstacle_ids_.insert(geometry.id.begin(), geometry.id.end());
    obstacle_ids_.erase(kNoTag);
    read_body_acceleration();
    read_dirichlet();
    read_neumann();
    read_normal_neumann();
    read_nodal_neumann();
    read_pressure();
    read_cavities();
    read_motions(geometry);
    for (const Node& value : eigenstrains_) end_steps_at_kinks(value, value["no such key"]);
    setup_.obstacles = std::move(geometry.obstacles);
    setup_.initial_displacement = read_initial("solution");
    setup_.initial_velocity = read_initial("velocity");
    const Node acceleration = initial_["acceleration"];
    if (acceleration.exists() && acceleration.json().is_string()) {
      acceleration.choice({"consistent"}, 0);
      setup_.consistent_initial_acceleration = true;
    } else {
      setup_.initial_acceleration = read_initial("acceleration");
    }
  }

 private:
  using Function = SpaceTimeFunction<Dim>;

  /// Sets that entries of one list before another one act on.
  struct Seen {
    std::set<Label> labels;
    std::set<int> tags;
    bool has_all = false;
  };

  /// `rhs` stands on the left side of PolyFEM's equation: positive values push in the negative direction.
  void read_body_acceleration() {
    const Node rhs = boundary_["rhs"];
    if (!rhs.exists()) return;
    const std::vector<Node> items = rhs.items();
    if (!items.empty() && items.front().json().is_object() && !is_python_value(items.front().json()))
      return read_accelerations_of_bodies(items);
    warn_of_components(rhs, Dim, warnings_);
    const ValueFunction<Dim> value = read_function<Dim>(rhs, -1);
    if (value.is_zero) return;
    check_defined<Dim>(value.function, all_vertices(), times(), rhs);
    end_steps_at_kinks(rhs, rhs["interpolation"]);
    setup_.body_acceleration = value.function;
  }

  /// One for each of several bodies, which then share no vertices: a point's connected part tells whose it is.
  void read_accelerations_of_bodies(const std::vector<Node>& items) {
    std::map<int, std::set<int>> bodies;  // by part
    for (CellId c = 0; c < setup_.mesh.cell_slots(); ++c) bodies[setup_.mesh.part(c)].insert(setup_.mesh.body(c));
    std::map<int, Function> of_part;
    std::set<int> seen;
    for (const Node& item : items) {
      if (!item.json().is_object()) item.fail("an id and its value");
      for (const auto& [key, ignored] : item.json().items())
        if (key != "id" && key != "value") item[key].fail("an unknown key", "id and value");
      const Node value = item["value"];
      warn_of_components(value, Dim, warnings_);
      const ValueFunction<Dim> function = read_function<Dim>(value, -1);
      end_steps_at_kinks(value, value["interpolation"]);
      for (const int body : bodies_of(item["id"])) {
        if (!seen.insert(body).second) {
          warnings_.push_back(item.pointer() + ": an entry before it has the same id and wins");
          continue;
        }
        check_defined<Dim>(function.function, vertices_of_body(body), times(), value);
        for (const auto& [part, of_it] : bodies) {
          if (!of_it.contains(body)) continue;
          if (of_it.size() > 1)
            item["id"].fail(abbreviate(item["id"].json()) + ", a body that shares vertices with others",
                            "bodies that share none, or one rhs for all");
          of_part.emplace(part, function.function);
        }
      }
    }
    setup_.body_acceleration = [of_part](const RestPoint<Dim>& X, double t) {
      const auto found = of_part.find(X.part);
      return found == of_part.end() ? Vec<Dim>(Vec<Dim>::Zero()) : found->second(X, t);
    };
  }

  void hold(const Node& node, DirichletCondition<Dim> added) {
    if (!add_condition(setup_.dirichlet, std::move(added)))
      warnings_.push_back(node.pointer() +
                          ": an entry before it holds a part of this set in the same directions and wins there");
  }

  /// Steps whose lengths are chosen end where values are not smooth in time.
  void end_steps_at_kinks(const Node& value, const Node& interpolation) {
    AdaptiveTimeOptions& adaptive = setup_.time.adaptive;
    if (!adaptive.enabled) return;
    for (const double kink : find_kinks(value, interpolation, adaptive.begin, adaptive.end)) adaptive.kinks.push_back(kink);
    std::sort(adaptive.kinks.begin(), adaptive.kinks.end());
    adaptive.kinks.erase(std::unique(adaptive.kinks.begin(), adaptive.kinks.end()), adaptive.kinks.end());
  }

  /// Asks about points in time that the run does not come to: a wrong unit of time looks like that.
  void warn_of_interpolation(const Node& interpolation) {
    constexpr double kLeastFraction = 0.01;
    const Units& units = interpolation.document().units;
    for (const Node& factor : interpolation.items()) {
      const std::vector<double> points = factor["points"].numbers();
      if (points.size() < 2 || factor["extend"].string("").starts_with("repeat")) continue;
      const double begin = times().front(), end = times().back();
      const double shared = std::min(end, points.back()) - std::max(begin, points.front());
      const double last = end + setup_.time.dt / 2;  // times of steps are rounded
      const auto met = std::count_if(points.begin(), points.end(), [&](double t) { return t >= begin && t <= last; });
      if (met < 2 && shared < kLeastFraction * (points.back() - points.front()))
        warnings_.push_back(fmt::format("{}: the points go from {} to {}, the run from {} to {}: it hardly meets them",
                                        factor["points"].pointer(), units.text(points.front(), "s"),
                                        units.text(points.back(), "s"), units.text(begin, "s"), units.text(end, "s")));
    }
  }

  void read_dirichlet() {
    Seen seen;
    for (const Node& node : boundary_["dirichlet_boundary"].items()) {
      warn_of_interpolation(node["interpolation"]);
      warn_of_components(node["value"], Dim, warnings_);
      const Function function = read_value(node);
      end_steps_at_kinks(node["value"], node["interpolation"]);
      warn_of_components(node["dimension"], Dim, warnings_);
      const std::array<bool, Dim> components = read_components(node["dimension"]);
      const bool is_free = std::none_of(components.begin(), components.end(), [](bool b) { return b; });
      for (const int tag : tags_of(node, seen)) {
        check_defined<Dim>(function, vertices_with(tag), times(), node["value"]);
        if (!is_free) hold(node, {tag, components, function});
      }
    }
  }

  void read_neumann() {
    Seen seen;
    for (const Node& node : boundary_["neumann_boundary"].items()) {
      warn_of_interpolation(node["interpolation"]);
      warn_of_components(node["value"], Dim, warnings_);
      const ValueFunction<Dim> value = read_function<Dim>(node["value"], node["interpolation"]);
      end_steps_at_kinks(node["value"], node["interpolation"]);
      for (const int tag : loaded_tags(node, seen)) {
        check_defined<Dim>(value.function, vertices_with(tag), times(), node["value"]);
        if (value.is_zero) continue;
        add_load<Dim>(setup_.neumann, NeumannCondition<Dim>{tag, value.function}, &NeumannCondition<Dim>::traction);
      }
    }
  }

  /// Tractions along the outward normals at rest, positive: pulls.
  void read_normal_neumann() {
    Seen seen;
    for (const Node& node : boundary_["normal_aligned_neumann_boundary"].items()) {
      if (!setup_.time.is_static)
        node.fail("it with /time",
                  "a static scene, where normals are those at rest; pressure_boundary follows them in time");
      warn_of_interpolation(node["interpolation"]);
      const ScalarFunction<Dim> value = read_scalar_function<Dim>(node["value"], node["interpolation"]);
      const Function along_normal = [f = value.function](const RestPoint<Dim>& X, double t) {
        return Vec<Dim>(-f(X, t) * X.inward.stableNormalized());
      };
      for (const int tag : loaded_tags(node, seen)) {
        check_defined<Dim>(along_normal, vertices_with(tag), times(), node["value"]);
        if (!value.is_zero)
          add_load<Dim>(setup_.neumann, NeumannCondition<Dim>{tag, along_normal}, &NeumannCondition<Dim>::traction);
      }
    }
  }

  /// Forces on the vertices of a point_selection; one function for all, since the mesh is searched for it.
  void read_nodal_neumann() {
    std::map<VertexId, Function> forces;
    for (const Node& node : boundary_["nodal_neumann_boundary"].items()) {
      warn_of_interpolation(node["interpolation"]);
      warn_of_components(node["value"], Dim, warnings_);
      const Function function = read_value(node);
      end_steps_at_kinks(node["value"], node["interpolation"]);
      const std::vector<int>& tags = ids_of(node["id"]);
      if (std::none_of(tags.begin(), tags.end(), [&](int tag) { return point_tags_.contains(tag); }))
        node["id"].fail(abbreviate(node["id"].json()) + ", which no vertex has" + why_unused(node["id"]),
                        "the id of a point_selection: " + sets_.surfaces.list(&point_tags_));
      std::vector<Vec<Dim>> loaded;
      for (VertexId v = 0; v < setup_.mesh.num_vertices(); ++v) {
        if (std::find(tags.begin(), tags.end(), setup_.mesh.vertex_tag(v)) == tags.end()) continue;
        if (!forces.emplace(v, function).second) continue;
        loaded.push_back(setup_.mesh.rest(v));
      }
      check_defined<Dim>(function, loaded, times(), node["value"]);
    }
    if (!forces.empty()) setup_.nodal_loads.push_back(make_nodal_load(setup_.mesh, std::move(forces)));
  }

  /// Remembers the term of the last time, which patches ask for, too.
  static TermFactory<Dim> make_nodal_load(Mesh<Dim> mesh, std::map<VertexId, Function> forces) {
    struct Last {
      std::mutex mutex;
      double t = std::numeric_limits<double>::quiet_NaN();
      TermFactory<Dim> term;
    };
    const auto term_at = [=, last = std::make_shared<Last>()](double t) {
      const std::lock_guard lock(last->mutex);
      if (last->t != t) {
        VectorX nodal = VectorX::Zero(Dim * mesh.num_nodes());
        for (const auto& [v, force] : forces) nodal.template segment<Dim>(Dim * v) = force(mesh.rest(v), t);
        last->term = point_forces<Dim>(mesh, nodal);
        last->t = t;
      }
      return last->term;
    };
    return [term_at](const CellSet<Dim>& cells, double t, double scale) { return term_at(t)(cells, t, scale); };
  }

  void read_pressure() {
    Seen seen;
    for (const Node& node : boundary_["pressure_boundary"].items()) {
      warn_of_interpolation(node["interpolation"]);
      const ScalarFunction<Dim> value = read_scalar_function<Dim>(node["value"], node["interpolation"]);
      end_steps_at_kinks(node["value"], node["interpolation"]);
      const Function as_vector = [f = value.function](const Vec<Dim>& X, double t) {
        return Vec<Dim>::Constant(f(X, t)).eval();
      };
      const std::vector<int> tags = loaded_tags(node, seen);
      for (const int tag : tags) check_defined<Dim>(as_vector, vertices_with(tag), times(), node["value"]);
      const auto press = [&](int tag) {
        if (!value.is_zero)
          add_load<Dim>(setup_.pressure, PressureCondition<Dim>{tag, value.function}, &PressureCondition<Dim>::pressure);
      };
      if (const std::optional<Fluid> fluid = read_fluid(node, tags, sets_, facet_tags_, setup_.fluids)) {
        std::vector<int>& named = setup_.names.surfaces["wet " + text_of(read_condition_label(node["id"]))];
        for (const auto& [before, wet] : fluid->wet) {
          press(wet);
          named.push_back(wet);
        }
        setup_.fluids.push_back(*fluid);
      } else {
        for (const int tag : tags) press(tag);
      }
    }
  }

  void read_cavities() {
    std::set<std::string> names;
    for (const Node& node : boundary_["pressure_cavity"].items()) {
      Cavity cavity{.surfaces = surfaces_of_cavity(node["id"]), .pressure = read_overpressure(node)};
      cavity.name = read_curve_name(node, "cavity");
      if (!names.insert(cavity.name).second) node["name"].fail("a name that no cavity before it has");
      cavity.external_pressure = node["external_pressure"].non_negative(cavity.external_pressure);
      const bool is_fluid = node["law"].choice({"gas", "fluid"}, 0) == 1;
      if (node.has("bulk_modulus") != is_fluid)
        node["bulk_modulus"].fail(is_fluid ? "the bulk modulus of the fluid" : "\"law\": \"fluid\" beside it");
      if (is_fluid && node.has("exponent")) node["exponent"].fail("none: an exponent is of a gas");
      cavity.bulk_modulus = is_fluid ? node["bulk_modulus"].positive(1) : 0;
      cavity.exponent = node["exponent"].positive(cavity.exponent);
      setup_.cavities.push_back(std::move(cavity));
    }
  }

  std::vector<int> surfaces_of_cavity(const Node& ids) const {
    if (ids.items().empty()) ids.fail("the surfaces of the cavity");
    std::set<int> tags;
    for (const Node& id : ids.items()) {
      const std::size_t before = tags.size();
      for (const int tag : ids_of(id))
        if (facet_tags_.contains(tag)) tags.insert(tag);
      if (tags.size() == before)
        id.fail(abbreviate(id.json()) + ", which no surface of a body has" + why_unused(id),
                "the id of one: " + sets_.surfaces.list(&facet_tags_));
    }
    return {tags.begin(), tags.end()};
  }

  std::function<double(double t)> read_overpressure(const Node& node) {
    warn_of_interpolation(node["interpolation"]);
    const Node value = node["value"];
    if (!value.exists()) value.fail("the overpressure in the cavity at rest");
    const ScalarFunction<Dim> pressure = read_scalar_function<Dim>(value, node["interpolation"]);
    end_steps_at_kinks(value, node["interpolation"]);
    const Vec<Dim> origin = Vec<Dim>::Zero(), elsewhere = Vec<Dim>::LinSpaced(0.7, 1.3);
    check_defined<Dim>([&](const Vec<Dim>& X, double t) { return Vec<Dim>::Constant(pressure.function(X, t)).eval(); },
                       {origin}, times(), value);
    for (const double t : times())
      if (pressure.function(origin, t) != pressure.function(elsewhere, t))
        value.fail(abbreviate(value.json()) + ", which varies in space", "one pressure for the cavity, in time at most");
    return [f = pressure.function, origin](double t) { return f(origin, t); };
  }

  /// Labels of obstacles, and names that the scene does not ask for.
  std::string list_obstacles() const {
    std::string list = obstacle_ids_.empty() ? "" : sets_.surfaces.list(&obstacle_ids_);
    for (const Node& geometry : geometry_.items())
      if (const std::string name = geometry["name"].string("");
          !name.empty() && (geometry["is_obstacle"].boolean(false) || is_flat_obstacle(geometry)) &&
          sets_.surfaces.of({0, name}).empty())
        list += (list.empty() ? "\"" : ", \"") + name + "\"";
    return list.empty() ? "there is none" : list;
  }

  /// Warns of obstacles that an entry of `displacements` moves already; two Dirichlet conditions of one id are told of
  /// elsewhere.
  void warn_of_second_motions(const std::vector<Node>& displacements) {
    std::set<int> moved;
    const auto warn = [&](const Node& node) {
      warnings_.push_back(node.pointer() +
                          ": an entry before it, in obstacle_displacements, moves the same obstacle and wins");
    };
    for (const Node& node : displacements) {
      if (is_all(node["id"]))
        moved = obstacle_ids_;
      else if (const int id = obstacle_of(node["id"]); id != kNoTag && !moved.insert(id).second)
        warn(node);
    }
    for (const Node& node : boundary_["dirichlet_boundary"].items())
      if (!is_all(node["id"]) && moved.contains(obstacle_of(node["id"]))) warn(node);
  }

  /// The first entry with an obstacle's id moves it; obstacle_displacements come before dirichlet_boundary.
  void read_motions(ObstacleGeometry<Dim>& geometry) {
    std::vector<Node> entries = boundary_["obstacle_displacements"].items();
    for (const Node& node : entries) {
      warn_of_interpolation(node["interpolation"]);
      warn_of_components(node["value"], Dim, warnings_);
    }
    for (const Node& node : entries)
      if (!is_all(node["id"]) && obstacle_of(node["id"]) == kNoTag) {
        if (ids_of(node["id"]).empty())
          node["id"].fail(abbreviate(node["id"].json()) + ", which nothing has",
                          "an obstacle's surface_selection, or its name: " + list_obstacles());
        warnings_.push_back(
            node["id"].pointer() + ": " + text_of(read_condition_label(node["id"])) +
            " is a surface of a body, which this does not move; obstacles: " + sets_.surfaces.list(&obstacle_ids_));
      }
    warn_of_second_motions(entries);
    for (const Node& node : boundary_["dirichlet_boundary"].items()) entries.push_back(node);
    Obstacles<Dim>& obstacles = geometry.obstacles;
    std::vector<char> is_taken(obstacles.rest.size(), false);
    for (std::size_t v = 0; v < obstacles.rest.size(); ++v) is_taken[v] = obstacles.motion[v] != kNone;
    const std::vector<char> is_of_sequence = is_taken;
    for (const Node& node : entries) {
      const bool matches_all = is_all(node["id"]);
      const int id = matches_all ? kNoTag : obstacle_of(node["id"]);
      for (std::size_t v = 0; v < obstacles.rest.size(); ++v)
        if (is_of_sequence[v] && id != kNoTag && id == geometry.id[v])
          node["id"].fail(abbreviate(node["id"].json()) + ", an obstacle that its mesh_sequence moves", "another one");
      const ValueFunction<Dim> value = read_function<Dim>(node["value"], node["interpolation"]);
      std::vector<Vec<Dim>> moved;
      for (std::size_t v = 0; v < obstacles.rest.size(); ++v) {
        if (is_taken[v] || (!matches_all && (id == kNoTag || id != geometry.id[v]))) continue;
        is_taken[v] = true;
        if (value.is_zero) continue;  // fixed
        obstacles.motion[v] = static_cast<int>(obstacles.motions.size());
        moved.push_back(obstacles.rest[v]);
      }
      if (moved.empty()) continue;
      check_defined<Dim>(value.function, moved, times(), node["value"]);
      obstacles.motions.push_back(value.function);
      end_steps_at_kinks(node["value"], node["interpolation"]);
    }
  }

  std::vector<InitialCondition<Dim>> read_initial(const char* name) {
    std::vector<InitialCondition<Dim>> conditions;
    std::set<Label> seen;
    std::set<int> taken;
    for (const Node& node : initial_[name].items()) {
      warn_of_components(node["value"], Dim, warnings_);
      const ValueFunction<Dim> value = read_function<Dim>(node["value"]);
      const std::vector<int>& bodies = bodies_of(node["id"]);
      bool is_new = seen.insert(read_label(node["id"], 0)).second;
      for (const int body : bodies) {
        if (!taken.insert(body).second) {
          is_new = false;
          continue;
        }
        check_defined<Dim>(value.function, vertices_of_body(body), {setup_.time.t0}, node["value"]);
        if (!value.is_zero) conditions.push_back({body, value.function});
      }
      if (!is_new) warnings_.push_back(node.pointer() + ": an entry before it has the same id and wins");
    }
    return conditions;
  }

  const std::vector<int>& bodies_of(const Node& id) const {
    if (!id.exists()) id.fail("the id of a body");
    const Label label = read_label(id, 0);
    if (sets_.bodies.of(label).empty()) sets_.bodies.refuse(id, label, "the id of a body: ");
    return sets_.bodies.of(label);
  }

  Function read_value(const Node& node) const { return read_function<Dim>(node["value"], node["interpolation"]).function; }

  std::array<bool, Dim> read_components(const Node& node) const {
    std::array<bool, Dim> components;
    components.fill(true);
    const std::vector<Node> flags = node.items();
    if (node.exists() && (!node.json().is_array() || flags.size() < Dim)) node.fail("true or false for each component");
    for (std::size_t c = 0; c < Dim && c < flags.size(); ++c) components[c] = flags[c].boolean(true);
    return components;
  }

  static bool is_all(const Node& id) { return id.exists() && id.json() == "all"; }

  static Label read_condition_label(const Node& node) {
    if (!node.exists() || !(node.json().is_number() || node.json().is_string())) node.fail("a number, a name, or \"all\"");
    return read_label(node, 0);
  }

  /// Tags of facets and points, and ids of obstacles.
  const std::vector<int>& ids_of(const Node& id) const { return sets_.surfaces.of(read_condition_label(id)); }

  /// The id of the obstacles with this label; kNoTag: there is none.
  int obstacle_of(const Node& id) const {
    for (const int tag : ids_of(id))
      if (obstacle_ids_.contains(tag)) return tag;
    return kNoTag;
  }

  /// Tags of facets and points that a condition acts on, none where an entry before it has the same id.
  std::vector<int> tags_of(const Node& node, Seen& seen) {
    std::set<int> tags = facet_tags_;
    tags.insert(point_tags_.begin(), point_tags_.end());
    return tags_of(node, tags, seen);
  }
  /// Reads tags of facets, since points and obstacles bear no loads.
  std::vector<int> loaded_tags(const Node& node, Seen& seen) {
    const Node id = node["id"];
    const auto has_any = [](const std::vector<int>& ids, const std::set<int>& tags) {
      return std::any_of(ids.begin(), ids.end(), [&](int tag) { return tags.contains(tag); });
    };
    if (!is_all(id) && !has_any(ids_of(id), facet_tags_)) {
      const std::string expected = "the id of a surface of a body: ";
      if (has_any(ids_of(id), point_tags_))
        id.fail(abbreviate(id.json()) + ", an id of points, which have no area",
                expected + sets_.surfaces.list(&facet_tags_));
      if (has_any(ids_of(id), obstacle_ids_))
        id.fail(abbreviate(id.json()) + ", an obstacle, which bears no loads", expected + sets_.surfaces.list(&facet_tags_));
      sets_.surfaces.refuse(id, read_condition_label(id), expected, why_unused(id));
    }
    return tags_of(node, facet_tags_, seen);
  }
  std::vector<int> tags_of(const Node& node, const std::set<int>& tags, Seen& seen) {
    std::vector<int> taken;
    if (is_all(node["id"])) {
      for (const int tag : tags)
        if (tag > 0 && seen.tags.insert(tag).second) taken.push_back(tag);
      seen.has_all = true;
      return taken;
    }
    const Label label = read_condition_label(node["id"]);
    const bool is_zero = label.name.empty() && label.number <= 0;
    if (ids_of(node["id"]).empty() && label.name.empty() && (has_ids_of_files() || is_side_of_box(label.number))) {
      warnings_.push_back(node["id"].pointer() + ": " + text_of(label) + ", which nothing has: the entry does nothing");
      return taken;
    }
    if ((ids_of(node["id"]).empty() || is_zero) && obstacle_of(node["id"]) == kNoTag)
      sets_.surfaces.refuse(node["id"], label, "the id of a surface or an obstacle, above 0: ", why_unused(node["id"]));
    if (seen.has_all || !seen.labels.insert(label).second) {
      warnings_.push_back(node.pointer() + ": an entry before it has the same id and wins");
      return taken;
    }
    for (const int tag : ids_of(node["id"]))
      if (!is_zero && tags.contains(tag)) taken.push_back(tag);
    seen.tags.insert(taken.begin(), taken.end());
    return taken;
  }

  /// Whether files of ids say what is selected: then conditions may be those of several meshes.
  bool has_ids_of_files() const {
    const std::vector<Node> geometries = geometry_.items();
    return std::any_of(geometries.begin(), geometries.end(), has_selection_files);
  }

  /// Whether a `threshold` gives this number to a side of a mesh's box: in PolyFEM's scenes no facet needs to be near it.
  bool is_side_of_box(int number) const {
    constexpr int kRest = 7;  // the number of what is at no side
    if (!is_polyfem_set(Node(geometry_.document()))) return false;
    for (const Node& geometry : geometry_.items())
      for (const Node& rule : geometry["surface_selection"].items())
        if (rule.json().is_object() && rule.has("threshold")) {
          const int side = number - rule["id_offset"].integer(0);
          if (side == kRest || (side > 0 && side <= 2 * Dim)) return true;
        }
    return false;
  }

  /// The warning that was given of a selection which would have this id if anything were in it.
  std::string why_unused(const Node& id) const {
    for (const Node& geometry : geometry_.items())
      for (const char* selection : {"surface_selection", "point_selection"})
        for (const Node& rule : geometry[selection].items())
          if (rule.json().is_object() && rule.has("id") && rule["id"].json() == id.json())
            for (const std::string& warning : warnings_)
              if (warning.starts_with(rule.pointer() + ": ")) return " (" + warning + ")";
    return "";
  }

  /// Where functions of time are tried before anything is computed: both ends, after the first step, in the middle.
  std::vector<double> times() const {
    const TimeOptions& time = setup_.time;
    if (time.is_static) return {time.t0, 1};
    const double duration = time.dt * time.steps;
    return {time.t0, time.t0 + time.dt, time.t0 + duration / 2, time.t0 + duration};
  }

  std::vector<Vec<Dim>> points(const std::set<int>& vertices) const {
    std::vector<Vec<Dim>> result;
    result.reserve(vertices.size());
    for (const int v : vertices) result.push_back(setup_.mesh.rest(v));
    return result;
  }

  std::vector<Vec<Dim>> vertices_with(int tag) const {
    std::set<int> vertices;
    for (FacetId f = 0; f < setup_.mesh.facet_slots(); ++f)
      if (setup_.mesh.facet_tag(f) == tag) vertices.insert(setup_.mesh.facet(f).begin(), setup_.mesh.facet(f).end());
    for (VertexId v = 0; v < setup_.mesh.node_slots(); ++v)
      if (setup_.mesh.vertex_tag(v) == tag) vertices.insert(v);
    return points(vertices);
  }

  std::vector<Vec<Dim>> vertices_of_body(int body) const {
    std::set<int> vertices;
    for (CellId c = 0; c < setup_.mesh.cell_slots(); ++c)
      if (setup_.mesh.body(c) == body) vertices.insert(setup_.mesh.cell(c).begin(), setup_.mesh.cell(c).end());
    return points(vertices);
  }

  std::vector<Vec<Dim>> all_vertices() const {
    std::vector<Vec<Dim>> result;
    result.reserve(setup_.mesh.node_slots());
    for (VertexId v = 0; v < setup_.mesh.node_slots(); ++v) result.push_back(setup_.mesh.rest(v));
    return result;
  }

  const Sets& sets_;
  Node boundary_, initial_, geometry_;
  std::vector<Node> eigenstrains_;
  Setup<Dim>& setup_;
  std::vector<std::string>& warnings_;
  std::set<int> facet_tags_, point_tags_, obstacle_ids_;
};

}  // namespace

template <int Dim>
void read_conditions(const Node& root, const Sets& sets, ObstacleGeometry<Dim> obstacles, Setup<Dim>& setup,
                     std::vector<std::string>& warnings) {
  ConditionReader<Dim>(root, sets, setup, warnings).read(std::move(obstacles));
}

template void read_conditions(const Node&, const Sets&, ObstacleGeometry<2>, Setup<2>&, std::vector<std::string>&);
template void read_conditions(const Node&, const Sets&, ObstacleGeometry<3>, Setup<3>&, std::vector<std::string>&);

}  // namespace itr::scene
