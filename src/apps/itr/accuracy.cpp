// SPDX-License-Identifier: MIT
#include "accuracy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "error_bars.hpp"
#include "scene/accuracy.hpp"
#include "simulation/remesh_step.hpp"

namespace itr::cli {

namespace {

using Json = nlohmann::json;

constexpr double kMeshShare = scene::AccuracyShares{}.mesh;
constexpr double kAgain = 1.25, kTooFine = 0.5;  ///< of what the mesh may be wrong by
constexpr double kAimed = 0.7;                   ///< of it, by a coarser mesh
constexpr int kMostTrials = 3;
constexpr int kMostHalvings = 6, kMostDoublings = 2;  ///< of the tolerance, at once
constexpr int kLeastHalvings = -4;                    ///< in all: of easy steps that follow each other
constexpr double kUnresolved = 0.5;                   ///< of the energy: a larger bar tells nothing
constexpr double kGrowsFast = 2;                      ///< the energy in a step
constexpr double kHelps = 0.9;                        ///< of the error before, that of a finer mesh at most

bool is_first_order(const TimeOptions& time) {
  return time.integrator == Integrator::implicit_euler || (time.integrator == Integrator::bdf && time.bdf_order == 1);
}

/// 0 where it is none: numbers that are not finite are null.
double number(const Json& object, const std::string& key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : 0;
}

}  // namespace

AccuracyWatch::AccuracyWatch(const scene::Accuracy& asked, const TimeOptions& time, const RemeshOptions& remesh,
                             bool depends_on_path)
    : asked_(asked),
      time_(time),
      is_remeshed_(remesh.enabled),
      depends_on_path_(depends_on_path),
      first_tolerance_(remesh.relative_tolerance) {}

double AccuracyWatch::relative_tolerance() const { return std::ldexp(first_tolerance_, -halvings_); }

void AccuracyWatch::go_on(const std::string& steps, const Units& units) {
  is_resumed_ = true;
  if (time_.has_inertia()) return;
  std::istringstream lines(steps);
  double stored = 0;
  for (std::string line; std::getline(lines, line);) {
    const Json step = Json::parse(line, nullptr, false);
    if (!step.is_object() || step.value("step", 0) == 0) continue;
    StepReport report;
    const auto joules = [&](const Json& object, std::string_view key) {
      return units.to_si(number(object, std::string(key)), "J");
    };
    report.energy.contact = joules(step["energy"], "contact");
    stored = std::max(stored, joules(step["energy"], "elastic") + report.energy.contact);
    report.time_error = number(step, "time_error");
    const Json bars = step.value("bars", Json::object());
    report.errors.is_asked = !bars.empty();
    report.errors.no_bar = bars.value("no_bar", "");
    for (int s = 0; s < kTime && bars.contains("energy"); ++s)
      report.errors.energy[s] = joules(bars["energy"], name(static_cast<ErrorSource>(s)));
    if (const double split = joules(step, "split_tolerance"); asked_.follows_bars && split > 0 && stored > 0)
      halvings_ = static_cast<int>(std::lround(std::log2(first_tolerance_ * kStoredFraction * stored / split)));
    add(report, stored);
  }
}

double AccuracyWatch::mesh_error(const StepReport& report, double energy) const {
  return energy > 0 ? std::abs(report.errors.energy[static_cast<std::size_t>(ErrorSource::mesh)]) / energy /
                          (kMeshShare * asked_.value)
                    : 0;
}

bool AccuracyWatch::is_steered(double energy, bool is_last) const {
  return asked_.follows_bars && (is_last || energy < kGrowsFast * energy_);
}

/// Errors of meshes go with the root of the tolerance.
std::optional<double> AccuracyWatch::finer(const StepReport& report, double energy, bool is_last) {
  const double error = mesh_error(report, energy);
  if (!is_steered(energy, is_last) || error <= kAgain) return std::nullopt;
  const bool helps = trials_ == 0 || error < kHelps * error_before_;
  if (trials_ == kMostTrials || !helps) {
    if (!helps) halvings_ -= last_halvings_;
    ++coarse_steps_;
    return std::nullopt;
  }
  ++trials_;
  error_before_ = error;
  last_halvings_ = std::clamp(static_cast<int>(std::lround(2 * std::log2(error))), 1, kMostHalvings);
  halvings_ += last_halvings_;
  return relative_tolerance();
}

void AccuracyWatch::add(const StepReport& report, double energy) {
  ++steps_;
  trials_ = 0;
  const double error = mesh_error(report, energy);
  if (is_steered(energy, false) && error > 0 && error < kTooFine)
    halvings_ =
        std::max(halvings_ - std::clamp(static_cast<int>(2 * std::log2(kAimed / error)), 0, kMostDoublings), kLeastHalvings);
  has_contact_ = has_contact_ || report.energy.contact > 0;
  worst_chord_ = std::max(worst_chord_, report.time_error);
  time_sum_ += is_first_order(time_) ? report.time_error * std::sqrt(energy)  // of one sign
                                     : report.time_error * report.time_error * energy;
  energy_ = std::max(energy_, energy);
  Parts parts{};
  double sum = 0, worst = 0;
  for (int s = 0; s < kTime; ++s) {
    parts[s] = std::abs(report.errors.energy[s]);
    sum += parts[s];
    worst += worst_[s];
  }
  parts[kTime] = std::abs(report.errors.energy[kTime]);
  if (report.errors.is_asked && report.errors.no_bar.empty() && sum <= kUnresolved * energy) {
    if (sum > worst) worst_ = parts;
    return;
  }
  ++steps_without_bar_;
  no_bar_ = !report.errors.is_asked        ? "/output/error_bars is false"
            : report.errors.no_bar.empty() ? "it would exceed half of the energy"
                                           : report.errors.no_bar;
}

/// Estimates how far steps put the energy off. Of implicit Euler errors add up; others are taken as independent of each
/// other.
double AccuracyWatch::time_error() const {
  if (!time_.adaptive.enabled || energy_ == 0) return 0;
  if (!time_.has_inertia())  // energies of increments are those of equilibria, and a peak between them may be missed
    return depends_on_path_ || asked_.of != "energy" ? worst_chord_ * worst_chord_ : 0;
  const double impact = has_contact_ ? time_.adaptive.tolerance : 0;
  return impact + (is_first_order(time_) ? 2 * time_sum_ / std::sqrt(energy_) : std::sqrt(time_sum_ / energy_));
}

std::string AccuracyWatch::advice(int source) const {
  if (source == kTime) return "a smaller /time/tolerance first";
  if (source > 0) return advice_of(static_cast<ErrorSource>(source));
  if (!is_remeshed_) return "refine the mesh first, which is fixed as /space/remesh/enabled is not true";
  if (!asked_.follows_bars)
    return time_.has_inertia()
               ? "a smaller /space/remesh/relative_tolerance first, which follows no bars where there is inertia"
               : "a smaller tolerance of remeshing first, which stays as the scene sets it";
  if (coarse_steps_ > 0)
    return fmt::format(
        "refine the mesh first, which in {} of {} steps was no finer after {} trials (refusals in steps.jsonl)",
        coarse_steps_, steps_, kMostTrials);
  return "refine the mesh first";
}

std::string AccuracyWatch::describe(const std::string& forces, const std::string& points) const {
  Parts parts = worst_;
  for (double& part : parts) part = energy_ > 0 ? part / energy_ : 0;
  if (asked_.of != "energy") {
    parts = {};
    const auto error = relative_peak_error(asked_.of, forces, points);
    if (!error)
      return fmt::format("accuracy of {}: {:.3g} % asked; no bar, see `bars` in steps.jsonl", asked_.of, 100 * asked_.value);
    std::ranges::copy(*error, parts.begin());
  } else if (steps_ == 0 || steps_without_bar_ == steps_) {
    return fmt::format("accuracy of the energy: {:.3g} % asked; no bar in any step: {}", 100 * asked_.value,
                       no_bar_.empty() ? "none was taken" : no_bar_);
  }
  const bool has_time = time_.adaptive.enabled || time_.is_static || std::isfinite(parts[kTime]);
  if (time_.adaptive.enabled || !has_time) parts[kTime] = time_error();
  double sum = 0;
  std::string list;
  for (int s = 0; s <= kTime; ++s) {
    sum += parts[s];
    if (parts[s] > 0)
      list += fmt::format("{}{} {:.2g}", list.empty() ? "" : ", ", name(static_cast<ErrorSource>(s)), 100 * parts[s]);
  }
  std::string text = fmt::format("accuracy of {}: {:.3g} % asked, {:.2g} % estimated ({})",
                                 asked_.of == "energy" ? "the energy" : asked_.of, 100 * asked_.value, 100 * sum, list);
  if (!has_time) text += ", without the error of the steps, as the scene sets /time/dt";
  if (is_resumed_ && time_.has_inertia()) text += ", of the steps since it was resumed";
  if (steps_without_bar_ > 0) text += fmt::format(", no bar in {} of {} steps: {}", steps_without_bar_, steps_, no_bar_);
  if (sum <= asked_.value) return text + ": reached";
  const auto largest = std::max_element(parts.begin(), parts.end()) - parts.begin();
  return text + ": not reached: " + advice(static_cast<int>(largest));
}

std::vector<std::string> describe_accuracy(const scene::Accuracy& accuracy) {
  std::vector<std::string> lines;
  for (const auto& [pointer, value, reason] : accuracy.derived)
    lines.push_back(fmt::format("accuracy {:g}: {} = {}: {}", accuracy.value, pointer, value, reason));
  for (const std::string& text : accuracy.kept) lines.push_back(fmt::format("accuracy {:g}: {}", accuracy.value, text));
  return lines;
}

}  // namespace itr::cli
