// SPDX-License-Identifier: MIT
#include "accuracy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "defaults.hpp"

namespace itr::scene {

namespace {

constexpr AccuracyShares kShares;
/// Error of an adaptive mesh by the root of its split tolerance, both by the stored energy: 1 to 7 in scenes in the plane.
/// Bars correct the first; the other is of runs in which the tolerance stays.
constexpr double kFirstMeshError = 1.5, kMeshError = 3;
constexpr double kOfStored = 0.1;    ///< tolerance of splits by /space/remesh/relative_tolerance and what is stored
constexpr double kDhatError = 0.01;  ///< of the energy that the d-hat of "auto" changes: the part of motions that it may be
constexpr double kEnergyOfTime = 0.25;  ///< by /time/tolerance: what BDF2 and Newmark change of a free oscillation
constexpr double kEnergyOfImpact = 1;   ///< an impact may lose the tolerance
constexpr double kEnergyOfEuler = 2;    ///< implicit Euler takes in a period

constexpr const char* kRelative = "/space/remesh/relative_tolerance";
constexpr const char* kSplit = "/space/remesh/split/acceptance_tolerance";

/// Parts of a scene with which there are neither error bars nor steps that choose their lengths.
constexpr std::pair<const char*, const char*> kWithoutBars[] = {
    {"/couplings", "coupled points"},
    {"/springs", "springs"},
    {"/ties", "tied surfaces"},
    {"/boundary_conditions/pressure_cavity", "cavities"},
};

bool stands(const Document& document, const char* pointer) { return document.json.contains(Json::json_pointer(pointer)); }

void refuse_without_bars(const Node& root) {
  const Node accuracy = root["accuracy"];
  const auto refuse = [&](const std::string& what) {
    accuracy.fail("it beside " + what,
                  "a scene whose errors can be estimated: there are no error bars where there are " + what);
  };
  for (const Node& geometry : root["geometry"].items())
    if (geometry.has("rigid")) refuse("rigid bodies");
  for (const auto& [pointer, what] : kWithoutBars)
    if (stands(root.document(), pointer) && !root.document().json.at(Json::json_pointer(pointer)).empty()) refuse(what);
  if (is_polyfem_set(root)) accuracy.fail("it beside PolyFEM's defaults", "\"defaults\": \"itr\": it chooses from these");
}

/// Puts values where a document has none, and tells of both.
class Filler {
 public:
  Filler(Document& document, Accuracy& accuracy) : document_(document), accuracy_(accuracy) {}

  /// Returns whether the scene leaves the key open.
  bool fill(const char* pointer, const Json& value, const std::string& reason) {
    if (stands(document_, pointer) && document_.json[Json::json_pointer(pointer)] == value) return false;
    if (keep(pointer)) return false;
    document_.json[Json::json_pointer(pointer)] = value;
    accuracy_.derived.push_back(
        {pointer, value.is_number() ? fmt::format("{:.3g}", value.get<double>()) : value.dump(), reason});
    return true;
  }

  /// Says of a value of the scene that it stays. Returns whether there is one.
  bool keep(const char* pointer) {
    if (!stands(document_, pointer) || document_.json[Json::json_pointer(pointer)] == "auto") return false;
    accuracy_.kept.push_back(fmt::format("{} = {} stays, as the scene sets it", pointer,
                                         abbreviate(document_.json[Json::json_pointer(pointer)])));
    return true;
  }

 private:
  Document& document_;
  Accuracy& accuracy_;
};

bool is_first_order(const Node& integrator) {
  const Node type = integrator.has("type") ? integrator["type"] : integrator;
  const std::string name = type.string("");
  return name == "ImplicitEuler" || name == "BDF1" || (name == "BDF" && integrator["steps"].integer(1) == 1);
}

void fill_time(const Document& document, double accuracy, Filler& filler) {
  const Node root(document), time = root["time"];
  if (!time.exists() || filler.keep("/time/dt") || filler.keep("/time/time_steps")) return;
  if (!time.has("tend")) time["tend"].fail("the end of the run, beside /accuracy");
  const double share = kShares.time * accuracy;
  const bool is_quasistatic = time["quasistatic"].boolean(false), has_contact = root["contact"]["enabled"].boolean(false);
  const bool is_euler = !is_quasistatic && is_first_order(time["integrator"]);
  filler.fill("/time/dt", "auto", "steps as long as /time/tolerance allows");
  if (is_quasistatic)
    filler.fill("/time/tolerance", std::sqrt(share),
                fmt::format("its square, {:.2g}, is how far energies between two increments are off", share));
  else
    filler.fill("/time/tolerance",
                share / (is_euler      ? kEnergyOfEuler
                         : has_contact ? kEnergyOfImpact
                                       : kEnergyOfTime),
                is_euler      ? "implicit Euler takes twice as much of the energy in a period of an oscillation"
                : has_contact ? "an impact may lose so much of the energy"
                              : "a period of an oscillation changes energies by about a quarter of it");
}

void fill_contact(const Document& document, double accuracy, Filler& filler) {
  const Node root(document), contact = root["contact"];
  const bool has_friction =
      contact["enabled"].boolean(false) && (contact["friction_coefficient"].number(0) > 0 || contact.has("friction_pairs"));
  if (!has_friction) return;
  filler.keep("/contact/epsv");  // "auto" lets what sticks creep by a thousandth
  filler.fill("/solver/lagging_tolerance", kShares.friction * accuracy,
              "so much of a force may be that of an iterate before");
}

template <int Dim>
void check_goal(const Node& root, const std::string& of, const Setup<Dim>& setup) {
  if (of == "energy") return;
  std::vector<std::string> names = {"energy"};
  for (const auto& curve : setup.fields.curves) names.push_back(curve.name);
  for (const auto& point : setup.fields.points) names.push_back(point.name);
  if (std::ranges::find(names, of) == names.end())
    root["accuracy"]["of"].fail(
        fmt::format("one of {}: \"energy\", and names of /output/forces and /output/points", fmt::join(names, ", ")));
}

}  // namespace

Accuracy apply_accuracy(Document& document) {
  Accuracy accuracy;
  const Node root(document), node = root["accuracy"];
  if (!node.exists()) return accuracy;
  const bool is_object = node.json().is_object();
  if (is_object && !node.has("value")) node["value"].fail("the error to aim at");
  accuracy.value = (is_object ? node["value"] : node).positive(0);
  if (is_object) accuracy.of = node["of"].string(accuracy.of);
  refuse_without_bars(root);
  Filler filler(document, accuracy);
  fill_time(document, accuracy.value, filler);
  fill_contact(document, accuracy.value, filler);
  filler.fill("/output/error_bars", true, "they tell at the end what was reached");
  return accuracy;
}

template <int Dim>
void apply_accuracy(const Node& root, Accuracy& accuracy, Setup<Dim>& setup) {
  if (accuracy.value == 0) return;
  check_goal(root, accuracy.of, setup);
  if (setup.time.has_inertia() && !setup.time.adaptive.enabled && !setup.fields.kinetic_energy) {
    setup.fields.kinetic_energy = true;
    accuracy.derived.push_back(
        {"/output/paraview/options/kinetic_energy", "true", "errors are parts of the largest energy"});
  }
  setup.validate();
  Setup<Dim> chosen = setup;
  if (setup.time.adaptive.enabled)  // d-hat goes with what the first 20 steps prescribe: here that is a fifth of the run
    chosen.time.dt = (setup.time.adaptive.end - setup.time.adaptive.begin) / 100;
  chosen.choose_defaults();
  const auto sets = [&](const char* pointer) { return stands(root.document(), pointer); };
  const auto keep = [&](const char* pointer) {
    accuracy.kept.push_back(fmt::format("{} stays, as the scene sets it", pointer));
  };
  if (setup.contact.enabled && setup.contact.dhat == 0) {
    const double part = std::min(1.0, kShares.dhat * accuracy.value / kDhatError);
    setup.contact.dhat = part * chosen.contact.dhat;
    accuracy.derived.push_back(
        {"/contact/dhat", fmt::format("{:.3g}", setup.units.from_si(setup.contact.dhat, "m")),
         fmt::format("{:.3g} of that of \"auto\", which changes energies by about {:g}", part, kDhatError)});
  } else if (setup.contact.enabled) {
    keep("/contact/dhat");
  }
  if (!setup.remesh.enabled) {
    accuracy.kept.push_back(
        "the mesh is fixed, as /space/remesh/enabled is not true: its error is estimated, and nothing reduces it");
    return;
  }
  for (const char* pointer : {kRelative, kSplit})
    if (sets(pointer)) return keep(pointer);
  const bool is_of_stored = chosen.follows_stored_energy.split;
  accuracy.follows_bars = is_of_stored && !setup.time.has_inertia() && setup.fields.error_bars;
  const double error = kShares.mesh * accuracy.value / (accuracy.follows_bars ? kFirstMeshError : kMeshError);
  setup.remesh.relative_tolerance = error * error / (is_of_stored ? kOfStored : 1);
  accuracy.derived.push_back({kRelative, fmt::format("{:.3g}", setup.remesh.relative_tolerance),
                              fmt::format("errors of meshes go with its root{}",
                                          accuracy.follows_bars ? "; it follows the error bars from there" : "")});
}

template void apply_accuracy(const Node&, Accuracy&, Setup<2>&);
template void apply_accuracy(const Node&, Accuracy&, Setup<3>&);

}  // namespace itr::scene
