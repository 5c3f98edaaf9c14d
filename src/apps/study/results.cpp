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

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kFormOfErrors = "3: ";  ///< of what is kept in folders: changes with what Errors has or means

/// Text that identifies the frames of a folder, for as long as nobody writes there.
std::string stamp(const fs::path& folder) {
  std::string text;
  for (const auto& frame : output::list_frames(folder))
    text += fmt::format("{} {} ", frame.totals.step, fs::last_write_time(frame.file).time_since_epoch().count());
  return text;
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
  const std::vector<Json> steps = output::read_steps(folder);
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

Errors measure_errors(const fs::path& folder, const fs::path& reference) {
  const std::string key = kFormOfErrors + stamp(folder) + "/ " + stamp(reference);
  const fs::path file = folder / "errors.json";
  if (const auto kept = read_kept(file, key)) return *kept;
  const Errors errors = output::run_distance(folder, reference);
  std::ofstream(file) << Json{{"of", key}, {"errors", output::to_json(errors)}}.dump(1) << '\n';
  return errors;
}

}  // namespace itr::cli::study
