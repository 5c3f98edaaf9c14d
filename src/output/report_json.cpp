// SPDX-License-Identifier: MIT
#include "report_json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/hdf5.hpp"
#include "itr/core.hpp"
#include "simulation/report_fields.hpp"
#include "units.hpp"

namespace itr::output {

std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

namespace {

constexpr const char* kGain = "energy_decrease_by_remeshing";

Json to_json(int value) { return value; }

/// Whole numbers have no point: readers may compare texts with those of earlier versions.
Json to_json(double value) {
  constexpr double kMostDigits = 1e16;
  if (!std::isfinite(value)) return nullptr;
  if (value == std::trunc(value) && std::abs(value) < kMostDigits) return static_cast<std::int64_t>(value);
  return value;
}

Json to_json(const EnergyReport& energy) {
  Json json;
  for_each_field(kEnergyFields, [&](const auto& field) {
    const double value = energy.*field.member;
    const bool is_optional = field.member == &EnergyReport::damping || field.member == &EnergyReport::host;
    if (value != 0 || !is_optional) json[field.name] = to_json(value);
  });
  return json;
}

Json to_json(const OperationCount& count) {
  Json refused = Json::object();
  for (int i = 0; i < kRefusals; ++i)
    if (count.refused[i] > 0) refused[std::string(name(static_cast<Refusal>(i)))] = count.refused[i];
  return {{"tried", count.tried}, {"relaxed", count.relaxed}, {"accepted", count.accepted}, {"refused", refused}};
}

Json to_json(const StepSeconds& seconds) {
  Json json;
  double parts = 0;
  for_each_field(kSecondsFields, [&](const auto& field) {
    const double value = seconds.*field.member;
    if (field.member == &StepSeconds::total) json["rest"] = to_json(value - parts);
    json[field.name] = to_json(value);
    parts += value;
  });
  return json;
}

/// The momentum that edits changed, of all bodies.
Json to_json(const std::vector<MomentumChange>& changes) {
  std::vector<double> sum(changes.front().linear.size());
  for (const MomentumChange& change : changes)
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += change.linear[i];
  Json json;
  for (const double value : sum) json.push_back(to_json(value));
  return json;
}

/// Trials that an adaptive step replaced.
Json to_json(const std::vector<RejectedStep>& rejections) {
  Json json;
  for (const RejectedStep& step : rejections)
    json.push_back({{"dt", to_json(step.dt)}, {"error", to_json(step.error)}, {"reason", step.reason}});
  return json;
}

/// The errors of the energy by source, or why there are none.
Json to_json(const ErrorReport& errors) {
  if (!errors.no_bar.empty()) return {{"no_bar", errors.no_bar}, {"seconds", to_json(errors.seconds)}};
  Json energy;
  for (int s = 0; s < kErrorSources; ++s) energy[std::string(name(static_cast<ErrorSource>(s)))] = to_json(errors.energy[s]);
  return {{"energy", energy}, {"seconds", to_json(errors.seconds)}};
}

bool is_there(const ErrorReport& errors, unsigned) { return errors.is_asked; }
template <typename Value>
bool is_there(const Value& value, unsigned shown) {
  if constexpr (std::is_arithmetic_v<Value>)
    return !(shown & if_any) || value != 0;
  else if constexpr (requires { value.empty(); })
    return !value.empty();
  else
    return true;
}

/// Adds the fields of `report` that are shown there.
void add_fields(const StepReport& report, unsigned shown, Json& json) {
  for_each_field(kStepFields, [&](const auto& field) {
    const auto& value = report.*field.member;
    if ((field.shown & shown) && is_there(value, field.shown)) json[field.name] = to_json(value);
  });
}

Json to_json(const DisplacementNorms& n) {
  return {{"l2", to_json(n.l2)},
          {"h1", to_json(n.h1)},
          {"h1_semi", to_json(n.h1_semi)},
          {"linf", to_json(n.linf)},
          {"linf_grad", to_json(n.linf_grad)},
          {"lp", to_json(n.lp)}};
}

Json versions_json() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return {{"itr", ITR_VERSION},
          {"compiler", __VERSION__},
          {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"hdf5", fmt::format("{}.{}.{}", major, minor, release)}};
}

}  // namespace

Json step_json(const StepReport& report) {
  Json json;
  add_fields(report, in_step, json);
  return json;
}

void Totals::add(const StepReport& report) {
  const StepReport before = total_;
  total_ = report;
  if (before.vertices > 0) add_up(total_, before);
  if (report.step > 0)
    gain_ += report.energy_before_remesh + report.shape_energy - report.energy.total - report.history_loss;
}

namespace {

void from_json(const Json& json, int& value) { value = json.get<int>(); }
/// Only distances where nothing is near are not finite.
void from_json(const Json& json, double& value) {
  value = json.is_null() ? std::numeric_limits<double>::infinity() : json.get<double>();
}
void from_json(const Json& json, OperationCount& count) {
  count.tried = json.at("tried").get<int>();
  count.relaxed = json.at("relaxed").get<int>();
  count.accepted = json.at("accepted").get<int>();
  for (int i = 0; i < kRefusals; ++i)
    count.refused[i] = json.at("refused").value(std::string(name(static_cast<Refusal>(i))), 0);
}
/// Members that `json` lacks keep their values.
template <typename Fields, typename Whole>
void read_fields(const Fields& fields, const Json& json, Whole& whole);
void from_json(const Json& json, EnergyReport& energy) { read_fields(kEnergyFields, json, energy); }
void from_json(const Json& json, StepSeconds& seconds) { read_fields(kSecondsFields, json, seconds); }
/// Reads nothing: momentum by body, rejected trials and errors are in no total.
void from_json(const Json&, std::vector<MomentumChange>&) {}
void from_json(const Json&, std::vector<RejectedStep>&) {}
void from_json(const Json&, ErrorReport&) {}

template <typename Fields, typename Whole>
void read_fields(const Fields& fields, const Json& json, Whole& whole) {
  for_each_field(fields, [&](const auto& field) {
    if (const auto found = json.find(field.name); found != json.end()) from_json(*found, whole.*field.member);
  });
}

}  // namespace

std::string Totals::save() const {
  Json json;
  json[kGain] = to_json(gain_);
  add_fields(total_, everywhere, json);
  return text_of(json);
}

void Totals::restore(const std::string& saved) {
  try {
    const Json json = Json::parse(saved);
    from_json(json.at(kGain), gain_);
    read_fields(kStepFields, json, total_);
  } catch (const Json::exception& error) {
    throw InputError({"", "saved totals", error.what(), "fields of a report by name"});
  }
}

std::string totals_of_list(std::span<const double> numbers) {
  static constexpr const char* kScalars[] = {"energy_decrease_by_remeshing",
                                             "step",
                                             "vertices",
                                             "elements",
                                             "unknowns",
                                             "newton_iterations",
                                             "factorizations",
                                             "linear_solves",
                                             "reused_factors",
                                             "linear_iterations",
                                             "indefinite",
                                             "bound_by_dhat",
                                             "reverted_remeshes",
                                             "damped_steps",
                                             "refined_quadrature",
                                             "cut_steps"};
  static constexpr const char* kEnergies[] = {"inertia", "elastic", "body", "contact", "friction", "damping", "total"};
  static constexpr const char* kSeconds[] = {"assembly", "linear_solve", "line_search", "ccd",
                                             "remesh",   "projection",   "output",      "total"};
  static constexpr const char* kLast[] = {
      "t", "energy_before_remesh", "history_loss", "min_distance", "min_volume_ratio", "processor_seconds", "peak_rss_mb"};
  static constexpr const char* kCounts[] = {"tried", "relaxed", "accepted"};
  constexpr std::size_t kFirstLength = 16 + 4 * 3 + 7 + 8 + 7, kLength = kFirstLength + 6 + 6 * kRefusals;
  if (numbers.size() != kFirstLength && numbers.size() != kLength)
    throw InputError({"", "saved totals", std::to_string(numbers.size()) + " numbers", std::to_string(kLength)});
  Json json;
  std::size_t next = 0;
  const auto take = [&] { return next < numbers.size() ? to_json(numbers[next++]) : Json(0); };
  const auto take_counts = [&](std::initializer_list<const char*> operations) {
    for (const char* operation : operations)
      for (const char* count : kCounts) json[operation][count] = take();
  };
  for (const char* scalar : kScalars) json[scalar] = take();
  take_counts({"splits", "collapses", "swaps", "smooths"});
  for (const char* energy : kEnergies) json["energy"][energy] = take();
  for (const char* part : kSeconds) json["seconds"][part] = take();
  for (const char* scalar : kLast) json[scalar] = take();
  take_counts({"curves", "straightens"});
  for (const char* operation : {"splits", "curves", "straightens", "collapses", "swaps", "smooths"})
    for (int i = 0; i < kRefusals; ++i) json[operation]["refused"][std::string(name(static_cast<Refusal>(i)))] = take();
  return text_of(json);
}

std::string Totals::summary_json(const RunInfo& info, const Units& units, const std::string& outcome,
                                 const std::string& solver, const DisplacementNorms& norms, const Json& members) const {
  const StepReport total = in_units(total_, units);
  Json json{
      {"scene", info.scene},       {"outcome", outcome},
      {"backend", info.backend},   {"solver", solver},
      {"threads", info.threads},   {"versions", versions_json()},
      {"defaults", info.defaults}, {"units", {{"length", units.length()}, {"mass", units.mass()}, {"time", units.time()}}},
      {"steps", total.step},       {"cut_steps", total.cut_steps},
      {"t", to_json(total.t)}};
  if (info.interference_energy != 0) json["interference_energy"] = to_json(units.from_si(info.interference_energy, "J"));
  add_fields(total, in_summary, json);
  json[kGain] = to_json(units.from_si(gain_, "J"));
  json.update(members);
  json["norms"] = to_json(in_units(norms, units));
  return text_of(json) + "\n";
}

}  // namespace itr::output
