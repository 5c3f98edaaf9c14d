// SPDX-License-Identifier: MIT
#include "error_bars.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

namespace itr::cli {

namespace {

/// Estimated errors by source, in a result's own unit.
using BySource = std::array<double, kErrorSources>;
constexpr int kTime = static_cast<int>(ErrorSource::time);  ///< the last one

struct Peak {
  std::string step;
  double size = -1;  ///< of the force
  BySource errors{};
};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream text(line);
  for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
  if (line.ends_with(',')) cells.emplace_back();
  return cells;
}

double number(const std::string& cell) { return cell.empty() ? std::nan("") : std::strtod(cell.c_str(), nullptr); }

/// The largest vector of each name in a text of rows, of columns that begin so. Errors are those along it.
std::map<std::string, Peak> find_peaks(const std::string& rows, const std::string& prefix) {
  std::map<std::string, Peak> peaks;
  std::istringstream text(rows);
  std::string line;
  std::getline(text, line);
  std::map<std::string, std::size_t> columns;
  for (std::size_t i = 0; const std::string& name : split(line)) columns[name] = i++;
  while (std::getline(text, line)) {
    const std::vector<std::string> cells = split(line);
    std::map<std::string, double> force;
    double size = 0;
    for (const char* axis : {"x", "y", "z"})
      if (const auto column = columns.find(prefix + axis); column != columns.end()) {
        const double value = force[column->first] = number(cells.at(column->second));
        size = std::hypot(size, value);
      }
    Peak& peak = peaks[cells.at(2)];
    if (!(size > peak.size)) continue;
    peak = {cells[0], size, {}};
    for (int s = 0; s < kErrorSources; ++s)
      for (const auto& [name, value] : force) {
        const auto column = columns.find(fmt::format("{}_error_{}", name, itr::name(static_cast<ErrorSource>(s))));
        const double error = column == columns.end() ? std::nan("") : number(cells.at(column->second));
        peak.errors[s] += size == 0 ? 0 : value / size * error;
      }
  }
  return peaks;
}

/// "1.6 % (mesh 0.9, dhat 0.4): refine the mesh first", of a value of this size.
std::string describe(double size, BySource errors) {
  const std::string unknown = std::isfinite(errors[kTime]) ? "" : "; that of the time steps is not known";
  constexpr double kWorthNaming = 0.05;  // of the sum
  double sum = 0;
  for (double& error : errors) {
    if (!std::isfinite(error)) error = 0;
    sum += std::abs(error);
  }
  std::string parts;
  for (int s = 0; s < kErrorSources; ++s)
    if (std::abs(errors[s]) > kWorthNaming * sum)
      parts += fmt::format("{}{} {:.2g}", parts.empty() ? "" : ", ", name(static_cast<ErrorSource>(s)),
                           100 * std::abs(errors[s]) / size);
  const auto largest =
      std::max_element(errors.begin(), errors.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  return fmt::format("{:.2g} % ({}{}): {}", 100 * sum / size, parts, unknown,
                     advice_of(static_cast<ErrorSource>(largest - errors.begin())));
}

/// Whether there is a bar: that of time may be missing where others are there.
bool is_known(const BySource& errors) {
  return std::all_of(errors.begin(), errors.begin() + kTime, [](double error) { return std::isfinite(error); });
}

}  // namespace

std::string advice_of(ErrorSource source) {
  static constexpr std::array<const char*, kErrorSources> kAdvice{
      "refine the mesh first",
      "a smaller /contact/dhat first",
      "a smaller /contact/epsv first",
      "more /solver/contact/friction_iterations first",
      "a smaller tolerance of /solver/nonlinear first",
      "a smaller /time/dt (or /time/tolerance with dt \"auto\") first"};
  return kAdvice.at(static_cast<std::size_t>(source));
}

std::optional<std::array<double, kErrorSources>> relative_peak_error(const std::string& name, const std::string& forces,
                                                                     const std::string& points) {
  for (const auto& [rows, prefix] : {std::pair(&forces, "all_"), std::pair(&points, "u_")}) {
    if (rows->find(fmt::format("{}x_error_", prefix)) == rows->npos) continue;  // nobody asked for bars
    const auto peaks = find_peaks(*rows, prefix);
    const auto found = peaks.find(name);
    if (found == peaks.end()) continue;
    BySource errors = found->second.errors;
    if (!(found->second.size > 0) || !is_known(errors)) return std::nullopt;
    for (double& error : errors) error = std::abs(error) / found->second.size;
    return errors;
  }
  return std::nullopt;
}

std::vector<std::string> describe_errors(const std::string& forces, const StepReport& last, const Units& units) {
  std::vector<std::string> lines;
  if (!last.errors.is_asked) return lines;
  for (const auto& [name, peak] : find_peaks(forces, "all_")) {
    if (!(peak.size > 0)) continue;
    const std::string force = fmt::format("{:.4g} {}", peak.size, units.name("N"));
    if (is_known(peak.errors))
      lines.push_back(fmt::format("peak force on {} {} +- {}", name, force, describe(peak.size, peak.errors)));
    else
      lines.push_back(
          fmt::format("peak force on {} {}, no bar: see `bars` of step {} in steps.jsonl", name, force, peak.step));
  }
  if (!lines.empty()) return lines;
  const double size = std::abs(last.energy.total);
  if (!last.errors.no_bar.empty())
    lines.push_back("no bar on the energy: " + last.errors.no_bar);
  else if (size > 0)
    lines.push_back(
        fmt::format("energy {} +- {}", units.text(last.energy.total, "J", 4), describe(size, last.errors.energy)));
  return lines;
}

}  // namespace itr::cli
