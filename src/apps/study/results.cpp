// SPDX-License-Identifier: MIT
#include "results.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "itr/core/error.hpp"
#include "output/certify.hpp"
#include "output/distance.hpp"

namespace itr::cli::study {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kSameShape = 1e-6;  ///< share of the volume that two meshes of one shape may leave uncovered
constexpr double kSameTime = 1e-9;   ///< relative
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kFormOfErrors = "3: ";  ///< of what is kept in folders: changes with what Errors has or means

std::vector<Json> read_steps(const fs::path& folder) {
  std::vector<Json> steps;
  std::ifstream file(folder / "steps.jsonl");
  for (std::string line; std::getline(file, line);) {
    steps.push_back(Json::parse(line, nullptr, false));
    if (steps.back().is_discarded())
      throw InputError(
          {(folder / "steps.jsonl").string(), fmt::format("line {}", steps.size()), line.substr(0, 40), "JSON"});
  }
  if (steps.size() < 2) throw InputError({(folder / "steps.jsonl").string(), "", "no step", "a run that finished"});
  return steps;
}

/// A stored time of a run, in SI units.
struct Moment {
  fs::path file;
  output::FrameTotals totals;
  double energy = 0;  ///< kinetic, elastic, body and contact [J]
  double stored = 0;  ///< the same without body [J]
};

std::vector<Moment> read_moments(const fs::path& folder, const Plan& plan) {
  const std::vector<Json> steps = read_steps(folder);
  std::vector<Moment> moments;
  for (auto& [file, totals] : output::list_frames(folder)) {
    if (totals.step >= static_cast<int>(steps.size())) continue;
    const Json& energy = steps[totals.step]["energy"];
    const Units& units = totals.units;
    if (!plan.is_static) totals.t = units.to_si(totals.t, "s");
    for (double& component : totals.momentum) component = units.to_si(component, "kg m/s");
    double stored = plan.is_dynamic ? totals.kinetic_energy.value_or(kUnknown) : 0;
    for (const char* term : {"elastic", "contact"}) stored += energy[term].get<double>();
    const double all = stored + energy["body"].get<double>();
    moments.push_back({file, totals, units.to_si(all, "J"), units.to_si(stored, "J")});
  }
  return moments;
}

/// Text that identifies the frames of a folder, for as long as nobody writes there.
std::string stamp(const std::vector<Moment>& moments) {
  std::string text;
  for (const auto& moment : moments)
    text += fmt::format("{} {} ", moment.totals.step, fs::last_write_time(moment.file).time_since_epoch().count());
  return text;
}

Json to_json(const Errors& e) {
  return {{"l2", e.l2},
          {"h1", e.h1},
          {"surface", e.surface},
          {"energy", e.energy},
          {"momentum", e.momentum},
          {"reference_energy", e.reference_energy},
          {"times", e.times}};
}

std::optional<Errors> read_kept(const fs::path& file, const std::string& key) {
  std::ifstream stream(file);
  const Json kept = stream ? Json::parse(stream, nullptr, false) : Json();
  if (!kept.is_object() || kept.value("of", "") != key) return std::nullopt;
  const Json& e = kept["errors"];
  const auto number = [](const Json& value) { return value.is_number() ? value.get<double>() : kUnknown; };
  return Errors{e["l2"],   e["h1"], e["surface"], number(e["energy"]), number(e["momentum"]), number(e["reference_energy"]),
                e["times"]};
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return kUnknown;
  double sum = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(sum);
}

Errors compare(const std::vector<Moment>& moments, const std::vector<Moment>& references, bool is_dynamic) {
  struct Squares {
    double l2 = 0, h1 = 0, reference_l2 = 0, reference_h1 = 0, energy = 0, momentum = 0, reference_energy = 0;
  } sum;
  Errors errors;
  for (const auto& moment : moments) {
    if (moment.totals.step == 0) continue;
    const double t = moment.totals.t;
    const auto is_same_time = [&](const Moment& m) { return std::abs(m.totals.t - t) <= kSameTime * std::abs(t); };
    const auto found = std::find_if(references.begin(), references.end(), is_same_time);
    if (found == references.end()) continue;
    const output::FrameDistance at = output::frame_distance(moment.file, found->file);
    if (at.uncovered > kSameShape)
      throw InputError({moment.file.string(), "/mesh/rest",
                        fmt::format("bodies of which {:.2g} is not in those of the reference, or the reverse", at.uncovered),
                        "the same shapes at rest as in " + found->file.string()});
    sum.l2 += at.l2 * at.l2;
    sum.h1 += at.h1_semi * at.h1_semi;
    sum.reference_l2 += at.reference_l2 * at.reference_l2;
    sum.reference_h1 += at.reference_h1_semi * at.reference_h1_semi;
    sum.energy += std::pow(moment.energy - found->energy, 2);
    sum.reference_energy += found->stored * found->stored;
    if (is_dynamic) sum.momentum += std::pow(distance(moment.totals.momentum, found->totals.momentum), 2);
    errors.surface = std::max(errors.surface, at.surface);
    ++errors.times;
  }
  if (errors.times == 0) return errors;
  const auto ratio = [](double part, double whole) { return whole > 0 ? std::sqrt(part / whole) : std::sqrt(part); };
  errors.l2 = ratio(sum.l2, sum.reference_l2);
  errors.h1 = ratio(sum.h1, sum.reference_h1);
  errors.energy = std::sqrt(sum.energy / errors.times);
  errors.momentum = std::sqrt(sum.momentum / errors.times);
  errors.reference_energy = std::sqrt(sum.reference_energy / errors.times);
  return errors;
}

/// "step 12: what" as "what": the same of many steps is one.
std::string without_step(const std::string& text) {
  const auto colon = text.find(": ");
  const bool has_step = text.starts_with("step ") && colon != std::string::npos &&
                        std::all_of(text.begin() + 5, text.begin() + static_cast<std::ptrdiff_t>(colon),
                                    [](unsigned char c) { return std::isdigit(c); });
  return has_step ? text.substr(colon + 2) : text;
}

std::vector<Warning> read_warnings(const fs::path& log) {
  const std::string mark = "warning: ";
  std::vector<Warning> warnings;
  std::set<std::string> seen;  // a run that goes on, or is done already, says again what its scene gives cause to
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(mark) || !seen.insert(line).second) continue;
    const std::string text = without_step(line.substr(mark.size()));
    const auto same = std::find_if(warnings.begin(), warnings.end(), [&](const Warning& w) { return w.text == text; });
    if (same == warnings.end())
      warnings.push_back({text, 1});
    else
      ++same->times;
  }
  return warnings;
}

/// Whether a violation is that surfaces meet.
bool is_of_surfaces(const std::string& violation) {
  const auto has = [&](const char* part) { return violation.find(part) != std::string::npos; };
  return has(" intersect") || has(" inside of ") || has(" is on ");
}

}  // namespace

Row read_row(const PlannedRun& run, const fs::path& folder, const fs::path& log, bool has_contact) {
  Row row;
  row.run = run;
  const std::vector<Json> steps = read_steps(folder);
  for (std::size_t i = 1; i < steps.size(); ++i) {
    const Json& step = steps[i];
    row.unknowns += step["unknowns"].get<double>() / static_cast<double>(steps.size() - 1);
    row.seconds += step["seconds"]["total"].get<double>() - step["seconds"]["output"].get<double>();
    row.processor_seconds += step["processor_seconds"].get<double>();
    row.newton_iterations += step["newton_iterations"].get<int>();
    row.memory_mb = std::max(row.memory_mb, step["peak_rss_mb"].get<double>());
  }
  row.steps = static_cast<int>(steps.size()) - 1;
  row.first_vertices = steps.front()["vertices"];
  row.vertices = steps.back()["vertices"];
  row.potential = steps.back()["energy"]["total"];
  row.finished = true;
  const output::Certificate certificate = output::certify(folder);
  row.certified = certificate.frames > 0 && std::all_of(certificate.violations.begin(), certificate.violations.end(),
                                                        [&](const auto& v) { return !has_contact && is_of_surfaces(v); });
  for (const auto& frame : output::list_frames(folder)) row.flight = std::max(row.flight, output::flight(frame.file));
  row.warnings = read_warnings(log);
  return row;
}

Errors measure_errors(const fs::path& folder, const fs::path& reference, const Plan& plan) {
  const std::vector<Moment> moments = read_moments(folder, plan), references = read_moments(reference, plan);
  const std::string key = kFormOfErrors + stamp(moments) + "/ " + stamp(references);
  const fs::path file = folder / "errors.json";
  if (const auto kept = read_kept(file, key)) return *kept;
  const Errors errors = compare(moments, references, plan.is_dynamic);
  if (errors.times == 0)
    throw InputError({reference.string(), "frames", "no frame at a time of " + folder.string(), "frames at the same times"});
  std::ofstream(file) << Json{{"of", key}, {"errors", to_json(errors)}}.dump(1) << '\n';
  return errors;
}

}  // namespace itr::cli::study
