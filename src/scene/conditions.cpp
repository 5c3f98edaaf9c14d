// SPDX-License-Identifier: MIT
#include "conditions.hpp"

#include <algorithm>
#include <set>

#include "function.hpp"
#include "selection.hpp"

namespace itr::scene {

namespace {

template <int Dim>
class ConditionReader {
 public:
  ConditionReader(const Node& root, Setup<Dim>& setup, std::vector<std::string>& warnings)
      : boundary_(root["boundary_conditions"]),
        initial_(root["initial_conditions"]),
        geometry_(root["geometry"]),
        setup_(setup),
        warnings_(warnings) {
    for (FacetId f = 0; f < setup_.mesh.facet_slots(); ++f) facet_tags_.insert(setup_.mesh.facet_tag(f));
    for (VertexId v = 0; v < setup_.mesh.node_slots(); ++v) point_tags_.insert(setup_.mesh.vertex_tag(v));
    for (auto* tags : {&facet_tags_, &point_tags_}) tags->erase(kNoTag);
    for (CellId c = 0; c < setup_.mesh.cell_slots(); ++c) bodies_.insert(setup_.mesh.body(c));
  }

  void read(ObstacleGeometry<Dim> geometry) {
    obstacle_ids_.insert(geometry.id.begin(), geometry.id.end());
    obstacle_ids_.erase(kNoTag);
    read_body_acceleration();
    read_dirichlet();
    read_neumann();
    read_pressure();
    read_motions(geometry);
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

  /// `rhs` stands on the left side of PolyFEM's equation: positive values push in the negative direction.
  void read_body_acceleration() {
    const Node rhs = boundary_["rhs"];
    if (!rhs.exists()) return;
    warn_of_components(rhs, Dim, warnings_);
    const ValueFunction<Dim> value = read_function<Dim>(rhs, -1);
    if (value.is_zero) return;
    check_defined<Dim>(value.function, all_vertices(), times(), rhs);
    setup_.body_acceleration = value.function;
  }

  void read_dirichlet() {
    std::set<int> seen;
    for (const Node& node : boundary_["dirichlet_boundary"].items()) {
      warn_of_components(node["value"], Dim, warnings_);
      const Function function = read_value(node);
      warn_of_components(node["dimension"], Dim, warnings_);
      const std::array<bool, Dim> components = read_components(node["dimension"]);
      const bool is_free = std::none_of(components.begin(), components.end(), [](bool b) { return b; });
      for (const int tag : tags_of(node, seen)) {
        check_defined<Dim>(function, vertices_with(tag), times(), node["value"]);
        if (!is_free) setup_.dirichlet.push_back({tag, components, function});
      }
    }
  }

  void read_neumann() {
    std::set<int> seen;
    for (const Node& node : boundary_["neumann_boundary"].items()) {
      warn_of_components(node["value"], Dim, warnings_);
      const ValueFunction<Dim> value = read_function<Dim>(node["value"], node["interpolation"]);
      for (const int tag : loaded_tags(node, seen)) {
        check_defined<Dim>(value.function, vertices_with(tag), times(), node["value"]);
        if (value.is_zero) continue;
        setup_.neumann.push_back({tag, value.function});
      }
    }
  }

  void read_pressure() {
    std::set<int> seen;
    for (const Node& node : boundary_["pressure_boundary"].items()) {
      const ScalarFunction<Dim> value = read_scalar_function<Dim>(node["value"], node["interpolation"]);
      const Function as_vector = [f = value.function](const Vec<Dim>& X, double t) {
        return Vec<Dim>::Constant(f(X, t)).eval();
      };
      for (const int tag : loaded_tags(node, seen)) {
        check_defined<Dim>(as_vector, vertices_with(tag), times(), node["value"]);
        if (value.is_zero) continue;
        setup_.pressure.push_back({tag, value.function});
      }
    }
  }

  /// Warns of obstacles that an entry of `displacements` moves already; two Dirichlet conditions of one id are told of
  /// elsewhere.
  void warn_of_second_motions(const std::vector<Node>& displacements) {
    std::set<int> moved;
    const auto id_of = [&](const Node& node) { return is_all(node["id"]) ? kNoTag : read_condition_id(node["id"]); };
    const auto warn = [&](const Node& node) {
      warnings_.push_back(node.pointer() +
                          ": an entry before it, in obstacle_displacements, moves the same obstacle and wins");
    };
    for (const Node& node : displacements)
      if (is_all(node["id"]))
        moved = obstacle_ids_;
      else if (obstacle_ids_.contains(id_of(node)) && !moved.insert(id_of(node)).second)
        warn(node);
    for (const Node& node : boundary_["dirichlet_boundary"].items())
      if (moved.contains(id_of(node))) warn(node);
  }

  /// The first entry with an obstacle's id moves it; obstacle_displacements come before dirichlet_boundary.
  void read_motions(ObstacleGeometry<Dim>& geometry) {
    std::vector<Node> entries = boundary_["obstacle_displacements"].items();
    for (const Node& node : entries) warn_of_components(node["value"], Dim, warnings_);
    for (const Node& node : entries)
      if (!is_all(node["id"]) && !obstacle_ids_.contains(read_condition_id(node["id"]))) {
        const int id = read_condition_id(node["id"]);
        if (!facet_tags_.contains(id) && !point_tags_.contains(id))
          refuse_unused(node["id"], "an obstacle's id: " + id_list(obstacle_ids_));
        warnings_.push_back(node["id"].pointer() + ": " + std::to_string(id) +
                            " is a surface of a body, which this does not move; obstacles: " + id_list(obstacle_ids_));
      }
    warn_of_second_motions(entries);
    for (const Node& node : boundary_["dirichlet_boundary"].items()) entries.push_back(node);
    Obstacles<Dim>& obstacles = geometry.obstacles;
    std::vector<char> is_taken(obstacles.rest.size(), false);
    for (const Node& node : entries) {
      const bool matches_all = is_all(node["id"]);
      const int id = matches_all ? kNoTag : read_condition_id(node["id"]);
      const ValueFunction<Dim> value = read_function<Dim>(node["value"], node["interpolation"]);
      std::vector<Vec<Dim>> moved;
      for (std::size_t v = 0; v < obstacles.rest.size(); ++v) {
        if (is_taken[v] || (!matches_all && id != geometry.id[v])) continue;
        is_taken[v] = true;
        if (value.is_zero) continue;  // fixed
        obstacles.motion[v] = static_cast<int>(obstacles.motions.size());
        moved.push_back(obstacles.rest[v]);
      }
      if (moved.empty()) continue;
      check_defined<Dim>(value.function, moved, times(), node["value"]);
      obstacles.motions.push_back(value.function);
    }
  }

  std::vector<InitialCondition<Dim>> read_initial(const char* name) {
    std::vector<InitialCondition<Dim>> conditions;
    std::set<int> seen;
    for (const Node& node : initial_[name].items()) {
      if (!node.has("id")) node["id"].fail("the id of a body");
      const int body = read_id(node["id"], 0);
      warn_of_components(node["value"], Dim, warnings_);
      const ValueFunction<Dim> value = read_function<Dim>(node["value"]);
      if (!bodies_.contains(body)) refuse_unused(node["id"], "the id of a body: " + id_list(bodies_));
      if (!seen.insert(body).second) {
        warnings_.push_back(node.pointer() + ": an entry before it has the same id and wins");
        continue;
      }
      check_defined<Dim>(value.function, vertices_of_body(body), {setup_.time.t0}, node["value"]);
      if (!value.is_zero) conditions.push_back({body, value.function});
    }
    return conditions;
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

  int read_condition_id(const Node& node) const {
    if (!node.exists() || !node.json().is_number()) node.fail("an id, or \"all\"");
    return read_id(node, 0);
  }

  /// Tags of facets and points that a condition acts on, without those that an entry before it has taken.
  std::vector<int> tags_of(const Node& node, std::set<int>& seen) {
    std::set<int> tags = facet_tags_;
    tags.insert(point_tags_.begin(), point_tags_.end());
    return tags_of(node, tags, seen);
  }
  /// Reads tags of facets, since points and obstacles bear no loads.
  std::vector<int> loaded_tags(const Node& node, std::set<int>& seen) {
    const Node id = node["id"];
    if (!is_all(id) && !facet_tags_.contains(read_condition_id(id))) {
      const std::string surfaces = "the id of a surface of a body: " + id_list(facet_tags_);
      const int tag = read_condition_id(id);
      if (point_tags_.contains(tag)) id.fail(abbreviate(id.json()) + ", an id of points, which have no area", surfaces);
      if (obstacle_ids_.contains(tag)) id.fail(abbreviate(id.json()) + ", an obstacle, which bears no loads", surfaces);
      refuse_unused(id, surfaces, why_unused(id));
    }
    return tags_of(node, facet_tags_, seen);
  }
  std::vector<int> tags_of(const Node& node, const std::set<int>& tags, std::set<int>& seen) {
    std::vector<int> taken;
    if (is_all(node["id"])) {
      for (const int tag : tags)
        if (tag > 0 && seen.insert(tag).second) taken.push_back(tag);
      return taken;
    }
    const int tag = read_condition_id(node["id"]);
    const bool is_of_bodies = tag > 0 && tags.contains(tag);
    if (!is_of_bodies && !obstacle_ids_.contains(tag))
      refuse_unused(node["id"],
                    "the id of a surface, above 0: " + id_list(tags) +
                        (obstacle_ids_.empty() ? "" : "; or of an obstacle: " + id_list(obstacle_ids_)),
                    why_unused(node["id"]));
    if (!seen.insert(tag).second)
      warnings_.push_back(node.pointer() + ": an entry before it has the same id and wins");
    else if (is_of_bodies)
      taken.push_back(tag);
    return taken;
  }

  static std::string id_list(const std::set<int>& ids) {
    return ids.empty() ? "there is none" : list_ids(std::vector<int>(ids.begin(), ids.end()));
  }
  [[noreturn]] static void refuse_unused(const Node& id, const std::string& expected, const std::string& why = "") {
    id.fail(abbreviate(id.json()) + ", which nothing has" + why, expected);
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

  Node boundary_, initial_, geometry_;
  Setup<Dim>& setup_;
  std::vector<std::string>& warnings_;
  std::set<int> facet_tags_, point_tags_, bodies_, obstacle_ids_;
};

}  // namespace

template <int Dim>
void read_conditions(const Node& root, ObstacleGeometry<Dim> obstacles, Setup<Dim>& setup,
                     std::vector<std::string>& warnings) {
  ConditionReader<Dim>(root, setup, warnings).read(std::move(obstacles));
}

template void read_conditions(const Node&, ObstacleGeometry<2>, Setup<2>&, std::vector<std::string>&);
template void read_conditions(const Node&, ObstacleGeometry<3>, Setup<3>&, std::vector<std::string>&);

}  // namespace itr::scene
