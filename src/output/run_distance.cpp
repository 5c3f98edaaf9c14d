// SPDX-License-Identifier: MIT
#include "run_distance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "distance.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kSameShape = 1e-6;  ///< fraction of the volume that two meshes of one shape may leave uncovered
constexpr double kSameTime = 1e-9;   ///< relative
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Kind {
  bool is_static = false;   ///< its t is 1, whatever the unit of time
  bool is_dynamic = false;  ///< has kinetic energy and momentum
};

/// The kind of the scene that the run has saved.
Kind kind_of(const fs::path& folder) {
  const auto saved = find_saved_state(folder);
  if (!saved) throw InputError({(folder / "frames").string(), "", "no frame", "frames of a run"});
  const Json scene = Json::parse(saved->scene, nullptr, false);
  if (!scene.is_object()) throw InputError({saved->file.string(), "/checkpoint/scene", "no JSON object", "a scene"});
  const Json time = scene.value("time", Json());
  if (time.is_null()) return {true, false};
  return {false, !(time.is_object() && time.value("quasistatic", false))};
}

/// A stored time of a run, in SI units.
struct Moment {
  fs::path file;
  FrameTotals totals;
  double energy = 0;  ///< kinetic, elastic, body and contact [J]
  double stored = 0;  ///< kinetic, elastic and contact [J]
};

double energy_of(const Json& step, const char* term, const fs::path& folder) {
  const Json::json_pointer place(std::string("/energy/") + term);
  if (step.contains(place) && step[place].is_number()) return step[place].get<double>();
  throw InputError({(folder / "steps.jsonl").string(), place.to_string(), "no number", "the energy of each step [J]"});
}

std::vector<Moment> read_moments(const fs::path& folder, const Kind& kind) {
  const std::vector<Json> steps = read_steps(folder);
  std::vector<Moment> moments;
  for (auto& [file, totals] : list_frames(folder)) {
    if (totals.step >= static_cast<int>(steps.size())) continue;
    const Json& step = steps[static_cast<std::size_t>(totals.step)];
    const Units& units = totals.units;
    if (!kind.is_static) totals.t = units.to_si(totals.t, "s");
    for (double& component : totals.momentum) component = units.to_si(component, "kg m/s");
    double stored = kind.is_dynamic ? totals.kinetic_energy.value_or(kUnknown) : 0;
    for (const char* term : {"elastic", "contact"}) stored += energy_of(step, term, folder);
    const double all = stored + energy_of(step, "body", folder);
    moments.push_back({file, totals, units.to_si(all, "J"), units.to_si(stored, "J")});
  }
  return moments;
}

using Pairs = std::vector<std::pair<const Moment*, const Moment*>>;

/// Moments of both runs at one time, without those of step 0.
Pairs find_pairs(const std::vector<Moment>& moments, const std::vector<Moment>& references) {
  Pairs pairs;
  for (const Moment& moment : moments) {
    if (moment.totals.step == 0) continue;
    const double t = moment.totals.t;
    const auto is_same_time = [&](const Moment& m) { return std::abs(m.totals.t - t) <= kSameTime * std::abs(t); };
    const auto found = std::find_if(references.begin(), references.end(), is_same_time);
    if (found != references.end()) pairs.emplace_back(&moment, &*found);
  }
  return pairs;
}

double length_of_difference(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return kUnknown;
  double sum = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(sum);
}

FrameDistance distance_of_same_shapes(const fs::path& frame, const fs::path& reference) {
  const FrameDistance distance = frame_distance(frame, reference);
  if (distance.uncovered > kSameShape)
    throw InputError(
        {frame.string(), "/mesh/rest",
         fmt::format("bodies of which {:.2g} is not in those of the reference, or the reverse", distance.uncovered),
         "the same shapes at rest as in " + reference.string()});
  return distance;
}

RunDistance compare(const Pairs& pairs, bool is_dynamic) {
  struct Squares {
    double l2 = 0, h1 = 0, reference_l2 = 0, reference_h1 = 0, energy = 0, momentum = 0, reference_energy = 0;
  } sum;
  RunDistance distance;
  for (const auto& [moment, reference] : pairs) {
    const FrameDistance at = distance_of_same_shapes(moment->file, reference->file);
    sum.l2 += at.l2 * at.l2;
    sum.h1 += at.h1_semi * at.h1_semi;
    sum.reference_l2 += at.reference_l2 * at.reference_l2;
    sum.reference_h1 += at.reference_h1_semi * at.reference_h1_semi;
    sum.energy += std::pow(moment->energy - reference->energy, 2);
    sum.reference_energy += reference->stored * reference->stored;
    if (is_dynamic) sum.momentum += std::pow(length_of_difference(moment->totals.momentum, reference->totals.momentum), 2);
    distance.surface = std::max(distance.surface, at.surface);
    ++distance.times;
  }
  const auto ratio = [](double part, double whole) { return whole > 0 ? std::sqrt(part / whole) : std::sqrt(part); };
  distance.l2 = ratio(sum.l2, sum.reference_l2);
  distance.h1 = ratio(sum.h1, sum.reference_h1);
  distance.energy = std::sqrt(sum.energy / distance.times);
  distance.momentum = std::sqrt(sum.momentum / distance.times);
  distance.reference_energy = std::sqrt(sum.reference_energy / distance.times);
  return distance;
}

}  // namespace

std::vector<Json> read_steps(const fs::path& folder) {
  const std::string name = (folder / "steps.jsonl").string();
  std::vector<Json> steps;
  std::ifstream file(name);
  for (std::string line; std::getline(file, line);) {
    steps.push_back(Json::parse(line, nullptr, false));
    if (steps.back().is_discarded())
      throw InputError({name, fmt::format("line {}", steps.size()), line.substr(0, 40), "JSON"});
  }
  if (steps.size() < 2) throw InputError({name, "", fs::exists(name) ? "no step" : "no such file", "a run that finished"});
  return steps;
}

RunDistance run_distance(const fs::path& folder, const fs::path& reference, Times times) {
  if (!fs::is_directory(folder)) throw InputError({folder.string(), "", "no such folder", "a folder of a run"});
  const Kind kind = kind_of(folder);
  const std::vector<Moment> moments = read_moments(folder, kind), references = read_moments(reference, kind);
  Pairs pairs = find_pairs(moments, references);
  if (pairs.empty())
    throw InputError({reference.string(), "frames", "no frame at a time of " + folder.string(), "frames at the same times"});
  if (times == Times::last) pairs.erase(pairs.begin(), pairs.end() - 1);
  return compare(pairs, kind.is_dynamic);
}

Json to_json(const RunDistance& distance) {
  return {{"l2", distance.l2},
          {"h1", distance.h1},
          {"surface", distance.surface},
          {"energy", distance.energy},
          {"momentum", distance.momentum},
          {"reference_energy", distance.reference_energy},
          {"times", distance.times}};
}

}  // namespace itr::output
