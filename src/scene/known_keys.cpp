// SPDX-License-Identifier: MIT
// The table of all keys of a scene (scene-format §1.6): which are read, which only concern output or speed, which must have
// their default because what they ask for is not built. What is read is checked by its reader.
#include "known_keys.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include "itr/core/check.hpp"
#include "itr/scene/scene.hpp"

namespace itr::scene {

namespace {

enum class Role {
  read,     ///< honoured
  ignored,  ///< output or speed, or how PolyFEM gets to a result that does not depend on it; with all that is below
  only,     ///< supported with the one value that follows `=`
  refused   ///< changes results, not built
};

struct Group {
  const char* prefix;  ///< `*` stands for the elements of a list
  Role role;
  const char* keys;  ///< separated by spaces, each with `:kind` where that says all about its values
};

/// What a value may be: as the reader checks it and as the schema says it.
struct Kind {
  const char* name;
  void (*check)(const Node&);
  const char* schema;
};

constexpr Kind kKinds[] = {
    {"number", [](const Node& node) { node.number(0); }, R"({"type":"number"})"},
    {"positive", [](const Node& node) { node.positive(1); }, R"({"type":"number","exclusiveMinimum":0})"},
    {"non_negative", [](const Node& node) { node.non_negative(0); }, R"({"type":"number","minimum":0})"},
    {"integer", [](const Node& node) { node.integer(0); }, R"({"type":"integer"})"},
    {"natural", [](const Node& node) { node.integer_at_least(0, 0); }, R"({"type":"integer","minimum":0})"},
    {"count", [](const Node& node) { node.integer_at_least(1, 1); }, R"({"type":"integer","minimum":1})"},
    {"boolean", [](const Node& node) { node.boolean(false); }, R"({"type":"boolean"})"},
    {"string", [](const Node& node) { node.string(""); }, R"({"type":"string"})"},
};

constexpr const char* kSelectionKeys =
    "id id_offset box threshold center radius p1 p2 axis position point normal offset relative";

constexpr Group kGroups[] = {
    {"", Role::ignored, "tests output"},
    {"/units", Role::only, "length=\"m\" mass=\"kg\" time=\"s\""},
    {"/units", Role::read, "characteristic_length:positive"},
    {"/input/data", Role::only, "state=\"\""},
    {"/input/data", Role::ignored, "reorder u_path"},

    {"/geometry/*", Role::read, "mesh:string type enabled:boolean is_obstacle:boolean extract n_refs"},
    {"/geometry/*", Role::only, "unit=\"\""},
    {"/geometry/*", Role::refused, "curve_selection"},
    {"/geometry/*/array", Role::read, "offset size relative"},
    {"/geometry/*/transformation", Role::read, "translation rotation rotation_mode scale dimensions"},
    {"/geometry/*/advanced", Role::read, "normalize_mesh refinement_location"},
    {"/geometry/*/advanced", Role::only, "force_linear_geometry=false min_component=-1"},
    {"/geometry/*/volume_selection", Role::read, "*"},
    {"/geometry/*/volume_selection/*", Role::read, kSelectionKeys},
    {"/geometry/*/surface_selection", Role::read, "*"},
    {"/geometry/*/surface_selection/*", Role::read, kSelectionKeys},
    {"/geometry/*/surface_selection/*", Role::only, "boundary_only=true"},
    {"/geometry/*/surface_selection/*", Role::refused, "file"},
    {"/geometry/*/volume_selection/*", Role::refused, "file"},
    {"/geometry/*/point_selection", Role::read, "*"},
    {"/geometry/*/point_selection/*", Role::read, kSelectionKeys},
    {"/geometry/*/point_selection/*", Role::only, "boundary_only=true"},
    {"/geometry/*/point_selection/*", Role::refused, "file"},
    {"/geometry/*", Role::refused, "height point normal fps mesh_sequence"},

    {"/materials/*", Role::read, "type id E nu lambda mu rho plane_strain:boolean c1 c2 c3 d1 k"},
    {"/materials/*", Role::only, "phi=0 psi=0"},
    {"/materials/*", Role::refused, "elasticity_tensor alphas mus Ds models"},

    {"/boundary_conditions", Role::read, "rhs"},
    {"/boundary_conditions", Role::only,
     "pressure_cavity=[] normal_aligned_neumann_boundary=[] normal_aligned_dirichlet_boundary=[]"},
    {"/boundary_conditions/dirichlet_boundary/*", Role::read, "id value dimension"},
    {"/boundary_conditions/neumann_boundary/*", Role::read, "id value"},
    {"/boundary_conditions/pressure_boundary/*", Role::read, "id value"},
    {"/boundary_conditions/obstacle_displacements/*", Role::read, "id value"},
    {"/boundary_conditions/dirichlet_boundary/*/interpolation/*", Role::read, "type from to points values extend"},
    {"/boundary_conditions/neumann_boundary/*/interpolation/*", Role::read, "type from to points values extend"},
    {"/boundary_conditions/pressure_boundary/*/interpolation/*", Role::read, "type from to points values extend"},
    {"/boundary_conditions/obstacle_displacements/*/interpolation/*", Role::read, "type from to points values extend"},
    {"/initial_conditions/solution/*", Role::read, "id value"},
    {"/initial_conditions/velocity/*", Role::read, "id value"},
    {"/initial_conditions/acceleration", Role::read, "*"},  // also the word "consistent"
    {"/initial_conditions/acceleration/*", Role::read, "id value"},

    {"/time", Role::read,
     "t0:number tend:number dt:positive time_steps:count integrator quasistatic:boolean step_cuts:integer"},
    {"/time/integrator", Role::read, "type steps beta gamma energy_growth_limit"},

    {"/contact", Role::read,
     "enabled:boolean dhat:positive dhat_percentage:positive epsv:positive friction_coefficient:non_negative "
     "use_convergent_formulation:boolean"},
    {"/contact", Role::only, "use_area_weighting=true use_improved_max_operator=true use_physical_barrier=true"},
    {"/contact/collision_mesh", Role::read, "enabled:boolean mesh:string linear_map:string"},
    {"/contact/collision_mesh", Role::refused, "max_edge_length tessellation_type"},

    {"/solver", Role::ignored, "max_threads"},
    {"/solver/rayleigh_damping/*", Role::read, "form stiffness stiffness_ratio lagging_iterations"},
    {"/solver/linear", Role::read, "solver fallback options reuse_factors:boolean"},
    {"/solver/linear", Role::ignored, "precond enable_overwrite_solver max_iter tolerance Eigen AMGCL Hypre Pardiso MUMPS"},
    {"/solver/contact", Role::read,
     "barrier_stiffness initial_barrier_stiffness friction_iterations:integer friction_convergence_tol:non_negative"},
    // Any conservative CCD leads to the same converged solutions, and so does any way to the Dirichlet values: their
    // elimination in the end is exact.
    {"/solver/contact/CCD", Role::ignored, "broad_phase tolerance max_iterations"},
    {"/solver/augmented_lagrangian", Role::ignored, "initial_weight scaling max_weight eta error nonlinear"},

    {"/solver/nonlinear", Role::only, "solver=\"Newton\" allow_out_of_iterations=false"},
    {"/solver/nonlinear", Role::read, "max_iterations:count f_delta:non_negative"},
    {"/solver/nonlinear", Role::read, "x_delta:non_negative grad_norm:non_negative"},
    {"/solver/nonlinear", Role::read,
     "x_delta_tol:non_negative grad_norm_tol:non_negative rel_grad_norm_tol:non_negative rel_x_delta_tol:non_negative "
     "newton_decrement_tol:non_negative norm_type:string first_grad_norm_tol:non_negative"},
    {"/solver/nonlinear", Role::read, "iterations_per_strategy:count"},
    {"/solver/nonlinear", Role::ignored, "use_grad_norm"},
    {"/solver/nonlinear/advanced", Role::read,
     "first_grad_norm_tol:non_negative f_delta:non_negative f_delta_tol:non_negative f_delta_step_tol"},
    {"/solver/nonlinear/advanced", Role::ignored, "derivative_along_delta_x_tol apply_gradient_fd gradient_fd_eps"},
    {"/solver/nonlinear/line_search", Role::read, "method"},
    {"/solver/nonlinear/line_search", Role::ignored,
     "use_grad_norm_tol min_step_size max_step_size_iter min_step_size_final max_step_size_iter_final "
     "default_init_step_size step_ratio Armijo RobustArmijo"},
    {"/solver/nonlinear/Newton", Role::read,
     "use_psd_projection:boolean force_psd_projection:boolean psd_projection:string projected_iterations:integer "
     "extend_steps:boolean indefinite:string"},
    {"/solver/nonlinear/Newton", Role::ignored,
     "residual_tolerance reg_weight_min reg_weight_max reg_weight_inc use_psd_projection_in_regularized"},

    {"/solver/advanced", Role::read, "lump_mass_matrix:boolean"},
    {"/solver/advanced", Role::only,
     "lagged_regularization_weight=0 lagged_regularization_iterations=1 check_inversion=\"Discrete\""},
    {"/solver/advanced", Role::read, "characteristic_length characteristic_force_density"},
    {"/solver/advanced", Role::ignored, "cache_size"},

    {"/space", Role::read, "discr_order"},
    {"/space/advanced", Role::only,
     "bc_method=\"sample\" quadrature_order=-1 mass_quadrature_order=-1 n_boundary_samples=-1"},
    {"/space/remesh", Role::read, "enabled:boolean type:string screening:string sweeps:count history:string"},
    {"/space/remesh/split", Role::read,
     "enabled:boolean acceptance_tolerance:number culling_threshold:non_negative max_depth:natural "
     "min_edge_length:non_negative"},
    {"/space/remesh/collapse", Role::read,
     "enabled:boolean acceptance_tolerance:number culling_threshold:non_negative max_depth:natural "
     "rel_max_edge_length:non_negative abs_max_edge_length:non_negative"},
    {"/space/remesh/swap", Role::read, "enabled:boolean acceptance_tolerance:number max_depth:natural"},
    {"/space/remesh/smooth", Role::read, "enabled:boolean acceptance_tolerance:number max_iters:count"},
    {"/space/remesh/local_relaxation", Role::read,
     "local_mesh_n_ring:natural local_mesh_max_cells:count local_mesh_rel_area:non_negative max_nl_iterations:count"},
};

struct Entry {
  Role role;
  Json only;
  const Kind* kind = nullptr;
};

const Kind& kind_of(const std::string& name) {
  const auto* found =
      std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& kind) { return name == kind.name; });
  ITR_CHECK(found != std::end(kKinds), name);
  return *found;
}

class KeyTable {
 public:
  KeyTable() {
    for (const Group& group : kGroups) {
      std::istringstream keys(group.keys);
      for (std::string key; keys >> key;) add(group, key);
    }
  }

  const Entry* find(const std::string& pattern) const {
    const auto found = entries_.find(pattern);
    return found == entries_.end() ? nullptr : &found->second;
  }

  /// Keys that may stand below a pattern, or null if none may.
  const std::set<std::string>* children(const std::string& pattern) const {
    const auto found = children_.find(pattern);
    return found == children_.end() ? nullptr : &found->second;
  }

  /// A pointer elsewhere in the scene with this key, or nothing.
  std::string place_of(const std::string& key) const {
    for (const auto& [pattern, entry] : entries_)
      if (pattern.ends_with("/" + key)) return pattern;
    return "";
  }

 private:
  void add(const Group& group, const std::string& key) {
    const auto mark = key.find_first_of("=:");
    const std::string pattern = std::string(group.prefix).append("/").append(key, 0, mark);
    Entry& entry = entries_[pattern] = {group.role, Json()};
    if (mark != std::string::npos && key[mark] == '=') entry.only = Json::parse(key.substr(mark + 1));
    if (mark != std::string::npos && key[mark] == ':') entry.kind = &kind_of(key.substr(mark + 1));
    for (std::string child = pattern; !child.empty();) {
      const auto slash = child.rfind('/');
      children_[child.substr(0, slash)].insert(child.substr(slash + 1));
      child.resize(slash);
    }
  }

  std::map<std::string, Entry> entries_;
  std::map<std::string, std::set<std::string>> children_;
};

const KeyTable& key_table() {
  static const KeyTable table;
  return table;
}

[[noreturn]] void refuse_unknown(const Node& parent, const std::string& key, const std::set<std::string>& known) {
  std::vector<std::string> names(known.begin(), known.end());
  std::string expected;
  if (const std::string near = nearest_name(key, names); !near.empty())
    expected = "\"" + near + "\" perhaps; ";
  else if (const std::string place = key_table().place_of(key); !place.empty())
    expected = "it at " + place + " perhaps; ";
  expected += "known here:";
  for (const auto& name : names) expected += " " + name;
  parent[key].fail("an unknown key", expected);
}

void check_keys(const Node& node, const std::string& pattern) {
  const Entry* entry = key_table().find(pattern);
  if (entry && entry->role == Role::ignored) return;
  if (entry && entry->role == Role::refused) node.fail(abbreviate(node.json()), "no such key: it is not supported yet");
  if (entry && entry->role == Role::only) {
    if (node.json() != entry->only) node.fail(abbreviate(entry->only) + ": others are not supported yet");
    return;
  }
  if (entry && entry->kind) entry->kind->check(node);
  const std::set<std::string>* children = key_table().children(pattern);
  if (!children) return;
  if (children->contains("*")) {
    for (const Node& item : node.items()) check_keys(item, pattern + "/*");
    return;
  }
  if (!node.json().is_object()) {
    if (entry) return;
    node.fail("an object");
  }
  for (const auto& [key, value] : node.json().items()) {
    if (!children->contains(key)) refuse_unknown(node, key, *children);
    check_keys(node[key], std::string(pattern).append("/").append(key));
  }
}

/// Of the values at a pattern: what check_keys lets pass.
Json schema_of(const std::string& pattern) {
  const Entry* entry = key_table().find(pattern);
  if (entry && entry->role == Role::ignored) return {{"description", "does not change results"}};
  if (entry && entry->role == Role::refused) return {{"not", Json::object()}, {"description", "not supported yet"}};
  if (entry && entry->role == Role::only) return {{"const", entry->only}};
  if (entry && entry->kind) return Json::parse(entry->kind->schema);
  const std::set<std::string>* children = key_table().children(pattern);
  if (!children) return Json::object();
  if (children->contains("*")) {
    const Json item = schema_of(pattern + "/*");
    return {{"anyOf", {{{"type", "array"}, {"items", item}}, item}}};  // one that stands for a list of one
  }
  Json object = {{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
  for (const auto& key : *children) object["properties"][key] = schema_of(std::string(pattern).append("/").append(key));
  if (!entry) return object;
  return {{"anyOf", {object, {{"not", {{"type", "object"}}}}}}};
}

}  // namespace

std::string json_schema() {
  Json schema = schema_of("");
  schema["$schema"] = "http://json-schema.org/draft-07/schema#";
  schema["title"] = "Scene of ITR, after `common` and `patch` are merged";
  schema["required"] = {"geometry", "materials"};
  // Beside what the merged scene has, a file may say how it is merged.
  for (const char* key : {"root_path", "common"}) schema["properties"][key] = {{"type", "string"}};
  schema["properties"]["patch"] = {{"type", "array"}};
  return schema.dump(2);
}

void check_keys(const Document& document) { check_keys(Node(document), ""); }

}  // namespace itr::scene
