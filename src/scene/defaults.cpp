// SPDX-License-Identifier: MIT
#include "defaults.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "key_table.hpp"

namespace itr::scene {

namespace {

constexpr const char* kItr = "itr-1";  ///< a change of a value or a row is a new version
constexpr const char* kPolyfem = "polyfem-1";
constexpr const char* kOf01 = "itr-0";  ///< PolyFEM's but for the barrier stiffness, as itr 0.1 had them
constexpr std::string_view kStiffness = "/solver/contact/barrier_stiffness";

bool has_time(const Node& root) { return root.has("time"); }
bool is_dynamic(const Node& root) { return has_time(root) && !root["time"]["quasistatic"].boolean(false); }
bool has_contact(const Node& root) { return root["contact"]["enabled"].boolean(false); }
bool has_friction(const Node& root) {
  const Node contact = root["contact"];
  return has_contact(root) &&
         (contact["friction_coefficient"].non_negative(0) > 0 || !contact["friction_pairs"].items().empty());
}
bool is_of_order_2(const Node& root) {
  return std::ranges::any_of(root["space"]["discr_order"].items(),
                             [](const Node& order) { return (order.has("order") ? order["order"] : order).json() == 2; });
}
/// Whether coarse surfaces may slide as smooth ones do, as far as the scene alone tells (can_average_gaps).
bool slides_without_inertia(const Node& root) {
  return has_friction(root) && !is_dynamic(root) && !is_of_order_2(root) && !root["axisymmetric"].boolean(false) &&
         !root["space"]["remesh"]["enabled"].boolean(false) && root["contact"]["friction_pairs"].items().empty();
}
bool has_open_stiffness(const Node& root) {
  return has_contact(root) && !root["solver"]["contact"].has("initial_barrier_stiffness");
}
bool is_lagged(const Node& root) {
  return has_friction(root) || !root["boundary_conditions"]["pressure_boundary"].items().empty() ||
         !root["solver"]["rayleigh_damping"].items().empty();
}
bool always(const Node& /*root*/) { return true; }

constexpr Default kItrDefaults[] = {
    {"/time/integrator", "\"BDF2\"", is_dynamic, "takes hardly any energy from motion; implicit Euler takes much"},
    {"/time/step_cuts", "4", has_time, "a step that fails, or in which friction does not settle, is taken in parts"},
    {"/contact/dhat", "\"auto\"", has_contact, "surfaces stand off by little beside thicknesses, gaps and motions"},
    {"/contact/use_convergent_formulation", "true", has_contact, "contact converges with the mesh"},
    {"/contact/average_gaps", "\"auto\"", slides_without_inertia, "coarse surfaces slide as smooth ones do"},
    {"/contact/epsv", "\"auto\"", has_friction, "what sticks hardly creeps, in any unit of time and number of steps"},
    {"/solver/contact/barrier_stiffness", "\"auto\"", has_open_stiffness, "suits the bodies, and is the same in each step"},
    {"/solver/contact/friction_iterations", "-1", has_friction, "friction is of the contact forces of its own step"},
    {"/solver/lagging_tolerance", "1e-3", is_lagged, "forces that are lagged are those of the solution"},
    {"/solver/linear/solver", "\"auto\"", always, "the fastest solver that is there"},
};

constexpr const char* kUnlikePolyfem[] = {
    "Newmark's object form takes beta as beta",
    "planes and grounds collide",
    "an element whose body has no material is an error",
    "metrics of the sizing field are not halved on the boundary",
    "linf_grad is the true maximum",
    "operations of remeshing are judged by energies on one support",
    "lengths and volumes that PolyFEM has as constants are relative to the scene",
};

/// Pointers of keys that only PolyFEM has, the first few.
std::string polyfem_keys(const Node& root) {
  constexpr std::size_t kMost = 3;
  std::vector<std::string> found;
  for (const Key& key : keys()) {
    if (key.role != Role::ignored) continue;
    for (const std::string& pattern : expand(key.pointer))
      if (pattern.find('*') == pattern.npos && root.json().contains(Json::json_pointer(pattern))) found.push_back(pattern);
  }
  const std::size_t shown = std::min(kMost, found.size());
  return fmt::format("{}{}", fmt::join(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                     found.size() > shown ? ", ..." : "");
}

}  // namespace

std::span<const Default> itr_defaults() { return kItrDefaults; }

const std::vector<std::string>& names_of_sets() {
  static const std::vector<std::string> names = {"itr", "polyfem", kItr, kPolyfem, kOf01};
  return names;
}

/// The set that a scene asks for, by its name.
static const std::string& asked_set(const Node& root) {
  return names_of_sets()[root["defaults"].choice(names_of_sets(), 0)];
}

bool is_polyfem_set(const Node& root) { return asked_set(root).starts_with("polyfem"); }

bool averages_volume(const Node& root) { return !is_polyfem_set(root) && asked_set(root) != kOf01; }

ChosenDefaults apply_defaults(Document& document) {
  ChosenDefaults chosen;
  const Node root(document);
  const bool is_polyfem = is_polyfem_set(root);
  chosen.is_asked_for = root.has("defaults");
  chosen.name = is_polyfem ? kPolyfem : asked_set(root) == kOf01 ? kOf01 : kItr;
  if (is_polyfem) {
    chosen.unlike_polyfem.assign(std::begin(kUnlikePolyfem), std::end(kUnlikePolyfem));
    return chosen;
  }
  if (const std::string keys = polyfem_keys(root); !chosen.is_asked_for && !keys.empty())
    chosen.information = fmt::format(
        "{}: keys of PolyFEM, in a scene that chooses no defaults: it gets ITR's; --defaults polyfem, or \"defaults\": "
        "\"polyfem\" in the scene, gives PolyFEM's",
        keys);
  Json with_defaults = document.json;
  for (const Default& row : kItrDefaults) {
    const Json::json_pointer pointer(row.pointer);
    if (chosen.name == kOf01 && row.pointer != kStiffness) continue;
    if (with_defaults.contains(pointer) || !row.is_needed(root)) continue;
    with_defaults[pointer] = Json::parse(row.value);
    chosen.values.push_back({row.pointer, row.value, row.reason});
  }
  document.json = std::move(with_defaults);
  return chosen;
}

}  // namespace itr::scene
