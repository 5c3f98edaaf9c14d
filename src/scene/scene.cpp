// SPDX-License-Identifier: MIT
#include "itr/scene.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "accuracy.hpp"
#include "defaults.hpp"
#include "geometry.hpp"
#include "mesh/facet_tags.hpp"
#include "mesh/rest_box.hpp"
#include "mesh_sequence.hpp"
#include "polyfem/geometric_contact.hpp"
#include "polyfem/periodic.hpp"
#include "polyfem/python_value.hpp"
#include "readers.hpp"
#include "rigid.hpp"
#include "selection_file.hpp"
#include "shapes.hpp"
#include "supports.hpp"
#include "transformation.hpp"

namespace itr::scene {

bool is_axisymmetric(const Node& node) { return Node(node.document())["axisymmetric"].boolean(false); }

namespace {

/// Shortest edge of the surfaces that can touch: the bodies' boundary or its proxy, and the obstacles.
template <int Dim>
double shortest_surface_edge(const Setup<Dim>& setup) {
  double shortest = std::numeric_limits<double>::infinity();
  const auto include = [&](const auto& surface) {
    for (const auto& [a, b] : surface.edges) shortest = std::min(shortest, (surface.rest[a] - surface.rest[b]).norm());
  };
  include(setup.obstacles);
  if (setup.proxy) {
    include(*setup.proxy);
    return shortest;
  }
  const Mesh<Dim>& mesh = setup.mesh;
  double body_edge = std::numeric_limits<double>::infinity();
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j)
        body_edge = std::min(body_edge, (mesh.rest(mesh.facet(f)[i]) - mesh.rest(mesh.facet(f)[j])).norm());
  const bool has_curved = std::any_of(setup.order.begin(), setup.order.end(), [](const auto& o) { return o.second == 2; });
  shortest = std::min(shortest, has_curved ? body_edge / 2 : body_edge);
  return shortest;
}

template <int Dim>
std::set<int> body_ids(const Mesh<Dim>& mesh) {
  std::set<int> ids;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) ids.insert(mesh.body(c));
  return ids;
}

/// Ids and names of a geometry that a program brings: every number stands for itself.
template <int Dim>
Sets sets_of(const Node& root, const Geometry<Dim>& geometry) {
  Sets sets;
  add_penetrated(root, sets.surfaces);
  std::set<int> surfaces = facet_tags(geometry.mesh);
  surfaces.insert(geometry.id.begin(), geometry.id.end());
  for (VertexId v = 0; v < geometry.mesh.num_vertices(); ++v) surfaces.insert(geometry.mesh.vertex_tag(v));
  surfaces.erase(kNoTag);
  /// Parts of a boundary that are in others, too, have its number.
  const auto fill = [](const std::set<int>& ids, const auto& names, bool have_number, LabelIds& labels) {
    for (const int id : ids) {
      std::set<Label> of_id;
      for (const auto& [name, with] : names)
        if (std::find(with.begin(), with.end(), id) != with.end())
          of_id.insert({{have_number ? with.front() : id}, {0, name}});
      labels.key(of_id.empty() ? std::set<Label>{{id}} : of_id, id);
    }
    labels.choose();
  };
  fill(body_ids(geometry.mesh), geometry.bodies, false, sets.bodies);
  fill(surfaces, geometry.surfaces, true, sets.surfaces);
  return sets;
}

template <int Dim>
void read_axisymmetric(const Node& root, Mesh<Dim>& mesh) {
  const bool is_asked = is_axisymmetric(root);
  if (is_asked && Dim == 3) root["axisymmetric"].fail("true in a 3D scene", "it in 2D only");
  if constexpr (Dim == 2) mesh.set_axisymmetric(is_asked);
}

/// All but geometry and the contact that comes with it.
template <int Dim>
void read_model(const Node& root, const Sets& sets, const std::vector<ShapeEntry>& shapes, ObstacleGeometry<Dim> obstacles,
                Setup<Dim>& setup, std::vector<std::string>& warnings) {
  setup.time = read_time(root, warnings);
  setup.remesh = read_remesh(root);
  setup.linear = read_linear(root);
  setup.damping = read_damping(root, setup.time);
  setup.fields = read_fields(root);
  setup.lump_mass = read_lump_mass(root);
  setup.lagged_load_tolerance = root["solver"]["advanced"]["lagged_load_tolerance"].positive(setup.lagged_load_tolerance);
  setup.lagging_tolerance = root["solver"]["lagging_tolerance"].non_negative(0);
  setup.lagged_regularization = read_lagged_regularization(root, setup.time, warnings);
  setup.order = read_order(root, sets.bodies, body_ids(setup.mesh));
  setup.quadrature_degree = read_quadrature_degree(root);
  setup.newton = read_newton(root, characteristic_length(root, setup.time), {Dim, rest_box(setup.mesh).diagonal().norm()});
  setup.materials = read_materials(root, sets.bodies, setup.mesh, warnings);
  read_rigid_bodies(root, sets.bodies, setup);
  read_conditions<Dim>(root, sets, std::move(obstacles), setup, warnings);
  read_preset_problem<Dim>(root, sets.bodies, setup);
  setup.ties = read_ties<Dim>(root, sets, setup.mesh, setup.time);
  read_periodic_boundary<Dim>(root, sets, setup);
  read_supports<Dim>(root, sets, setup);
  add_shapes<Dim>(shapes, setup);
  warn_of_idle_keys(root, setup.time, !setup.obstacles.rest.empty(), warnings);
}

/// Adds curves of what has a name of its own: cavities, springs and coupled points.
template <int Dim>
void add_named_curves(const Node& root, const Setup<Dim>& setup, std::vector<ForceTarget>& curves) {
  const auto add = [&](const char* list, const char* what, const auto& named, const std::array<double, 3>& about) {
    for (const Node& node : root["output"]["forces"].items())
      if (node["name"].string("") == named.name)
        node["name"].fail("\"" + named.name + "\", the name of a " + what, "another name");
    if (std::ranges::find(curves, named.name, &ForceTarget::name) != curves.end())
      throw InputError({root.document().file.string(), std::string("/") + list, "two parts of the name " + named.name,
                        "names that differ"});
    curves.push_back({.name = named.name, .surfaces = named.surfaces, .about = about});
  };
  for (const Cavity& cavity : setup.cavities) add("boundary_conditions/pressure_cavity", "cavity", cavity, {});
  for (const auto& spring : springs_of<Dim>(setup.nodal_loads)) add("springs", "spring", *spring, {});
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads))
    add("couplings", "coupling", *coupling, {coupling->point[0], coupling->point[1], coupling->point[2]});
}

template <int Dim>
Setup<Dim> read_setup(const Node& root, const Geometries& geometries, MeshFiles& files, PartNames& parts,
                      std::vector<std::string>& warnings) {
  Setup<Dim> setup;
  setup.units = root.document().units;
  Sets sets;
  setup.mesh = read_bodies<Dim>(root, geometries, files, sets, warnings);
  read_axisymmetric(root, setup.mesh);
  setup.names = {sets.bodies.names(), sets.surfaces.names()};
  for (const auto* list : {&geometries.bodies, &geometries.obstacles})
    for (const Node& geometry : *list) {
      warn_of_radians(geometry["transformation"], warnings);
      for (const char* key : {"translation", "dimensions", "scale"})
        warn_of_components(geometry["transformation"][key], Dim, warnings, true);
    }
  std::set<int> surfaces = sets.facet_tags(setup.mesh);
  for (const Node& geometry : geometries.obstacles)
    if (const int id = read_obstacle_id(geometry, sets); id != kNoTag) surfaces.insert(id);
  const std::vector<ShapeEntry> shapes = read_shapes<Dim>(root, sets, surfaces);
  ObstacleGeometry<Dim> obstacles = read_obstacles<Dim>(geometries, files, setup.mesh, sets, shapes, warnings);
  parts = name_parts<Dim>(geometries, obstacles, sets);
  std::vector<ForceTarget> curves = read_forces<Dim>(root, parts, sets, setup.mesh);
  read_model<Dim>(root, sets, shapes, std::move(obstacles), setup, warnings);
  add_named_curves(root, setup, curves);
  setup.fields.curves = std::move(curves);
  setup.fields.points = read_points<Dim>(root);
  setup.fields.error_bars = root["output"]["error_bars"].boolean(false);
  setup.proxy = read_collision_mesh<Dim>(root, geometries, setup, files, warnings);
  setup.contact = read_contact(root, shortest_surface_edge(setup), warnings);
  setup.contact.friction_pairs = read_friction_pairs<Dim>(root, parts, sets, setup.mesh);
  read_geometric_contact(root, setup);
  return setup;
}

/// f(name) for each name of a Python file below a node.
template <typename Function>
void for_each_python_file(const Node& node, const Function& f) {
  if (!node.exists() || !node.json().is_structured()) return;
  if (is_python_value(node.json())) return f(node["file_name"]);
  if (node.json().is_array())
    for (const Node& item : node.items()) for_each_python_file(item, f);
  else
    for (const auto& [key, value] : node.json().items()) for_each_python_file(node[key], f);
}

/// f(value, what it is) for each value of the scene that names a file.
template <typename Function>
void for_each_file(const Node& root, const Geometries& geometries, const Function& f) {
  for (const auto* list : {&geometries.bodies, &geometries.obstacles})
    for (const Node& geometry : *list) {
      if (!is_flat_obstacle(geometry)) f(geometry["mesh"], MeshFiles::kMesh);
      for (const Node& frame : geometry["mesh_sequence"].items()) f(frame["mesh"], MeshFiles::kMesh);
      for (const char* selection : {"volume_selection", "surface_selection", "point_selection"})
        if (const Node name = find_selection_file(geometry[selection]); name.exists()) f(name, "a file of ids");
    }
  for (const char* part : {"boundary_conditions", "initial_conditions"})
    for_each_python_file(root[part], [&](const Node& name) { f(name, "a Python file"); });
  if (!has_collision_mesh(root) || is_cut_boundary(root)) return;
  const Node node = root["contact"]["collision_mesh"];
  f(node["mesh"], MeshFiles::kMesh);
  f(node["linear_map"], MeshFiles::kWeights);
}

std::string make_identity(Json identity, const std::string& defaults, const Node& root, const Geometries& geometries,
                          MeshFiles& files) {
  identity["defaults"] = defaults;
  identity.erase("output");
  identity.erase("tests");
  if (identity.contains("solver") && identity["solver"].is_object()) identity["solver"].erase("max_threads");
  Json hashes = Json::object();
  for_each_file(root, geometries,
                [&](const Node& name, const char* what) { hashes[name.pointer()] = files.hash(name, what); });
  identity["files"] = std::move(hashes);
  return identity.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

namespace {

/// With dt given, tend and time_steps only say how many steps there are.
Change::Of kind_of_change(const std::string& path, bool has_step) {
  if (path == "/time/tend" || path == "/time/time_steps") return has_step ? Change::Of::length : Change::Of::scene;
  for (const char* prefix :
       {"/solver", "/space/remesh", "/time/step_cuts", "/time/tolerance", "/time/dt_min", "/time/dt_max"})
    if (path.starts_with(prefix)) return Change::Of::solving;
  return Change::Of::scene;
}

}  // namespace

std::string defaults_of(const std::string& identity) {
  const Json scene = Json::parse(identity, nullptr, false);
  return scene.is_object() ? scene.value("defaults", "") : "";
}

std::vector<Change> find_changes(const std::string& before, const std::string& now) {
  const Json old_scene = Json::parse(before, nullptr, false), new_scene = Json::parse(now, nullptr, false);
  if (old_scene.is_discarded()) return {{"the scene of the saved state cannot be read"}};
  const Json::json_pointer step("/time/dt");
  const bool has_step = old_scene.contains(step) && new_scene.contains(step);
  std::vector<Change> changes;
  for (const Json& change : Json::diff(old_scene, new_scene)) {
    const std::string path = change["path"], operation = change["op"];
    const Json::json_pointer pointer(path);
    if (path.starts_with("/files/")) {
      changes.push_back({pointer.back() + ": the file has another content"});
      continue;
    }
    const auto value_in = [&](const Json& scene) { return scene.contains(pointer) ? abbreviate(scene[pointer]) : "absent"; };
    changes.push_back(
        {path + ": was " + value_in(old_scene) + ", is " + (operation == "remove" ? "absent" : abbreviate(change["value"])),
         kind_of_change(path, has_step)});
  }
  return changes;
}

Scene read(const std::filesystem::path& file, const std::vector<Override>& overrides) {
  Document document = load_document(file, overrides);
  Scene scene;
  const Node root(document);
  document.units = read_units(root);
  convert_quantities(document);
  check_keys(document, scene.warnings);
  MeshFiles files;
  const Json as_written = document.json;
  expand_mesh_sequences(document);
  scene.accuracy = apply_accuracy(document);
  scene.defaults = apply_defaults(document);
  const Geometries geometries = list_geometries(root);
  scene.identity = make_identity(as_written, scene.defaults.name, root, geometries, files);
  scene.max_threads = root["solver"]["max_threads"].integer_at_least(0, 0);
  scene.directory = root["output"]["directory"].string("");
  scene.warnings.insert(scene.warnings.end(), document.warnings.begin(), document.warnings.end());
  for_each_file(root, geometries, [&](const Node& name, const char*) {
    warn_of_working_folder(name.pointer(), name.string(""), document.root, document.file, scene.warnings);
  });
  const int dimension = find_dimension(geometries, files);
  document.units.dim = is_axisymmetric(root) ? 3 : dimension;  // nothing is by thickness
  scene.output = read_output(root);
  if (dimension == 2)
    scene.setup = read_setup<2>(root, geometries, files, scene.parts, scene.warnings);
  else
    scene.setup = read_setup<3>(root, geometries, files, scene.parts, scene.warnings);
  std::visit([&](auto& setup) { apply_accuracy(root, scene.accuracy, setup); }, scene.setup);
  std::visit([&](const auto& setup) { scene.output.times = setup.time.adaptive; }, scene.setup);
  return scene;
}

template <int Dim>
Setup<Dim> make_setup(Geometry<Dim> geometry, const std::string& options, const std::vector<Override>& overrides,
                      std::vector<std::string>& warnings) {
  Document document = parse_document(options, "options", overrides);
  convert_quantities(document);
  check_keys(document, warnings);
  apply_defaults(document);
  const Node root(document);
  for (const char* key : {"geometry", "output"})
    if (root.has(key)) root[key].fail("the key", "no such key: the program brings these itself");
  if (root.has("accuracy")) root["accuracy"].fail("the key", "no such key: a program chooses steps and tolerances itself");
  if (!read_units(root).is_si()) root["units"].fail("SI units: a program brings its geometry in metres");
  const Sets sets = sets_of(root, geometry);
  Setup<Dim> setup;
  setup.names = {sets.bodies.names(), sets.surfaces.names()};
  setup.mesh = std::move(geometry.mesh);
  read_axisymmetric(root, setup.mesh);
  geometry.obstacles.motion.assign(geometry.obstacles.rest.size(), kNone);
  read_model<Dim>(root, sets, read_shapes<Dim>(root, sets, sets.facet_tags(setup.mesh)),
                  {std::move(geometry.obstacles), std::move(geometry.id)}, setup, warnings);
  setup.contact = read_contact(root, shortest_surface_edge(setup), warnings);
  read_geometric_contact(root, setup);
  return setup;
}

int read_max_threads(const std::string& options, const std::vector<Override>& overrides) {
  const Document document = parse_document(options, "options", overrides);
  return Node(document)["solver"]["max_threads"].integer_at_least(0, 0);
}

template Setup<2> make_setup<2>(Geometry<2>, const std::string&, const std::vector<Override>&, std::vector<std::string>&);
template Setup<3> make_setup<3>(Geometry<3>, const std::string&, const std::vector<Override>&, std::vector<std::string>&);

}  // namespace itr::scene
