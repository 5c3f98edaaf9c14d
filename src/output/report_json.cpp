// SPDX-License-Identifier: MIT
#include "report_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/hdf5.hpp"
#include "itr/core/error.hpp"
#include "units.hpp"

namespace itr::output {

std::string json_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      out += c;
    }
  }
  return out + '"';
}

namespace {

std::string number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }

std::string energy_json(const EnergyReport& e) {
  const auto where_there = [](const char* name, double energy) {
    return energy == 0 ? "" : fmt::format(R"("{}":{},)", name, number(energy));
  };
  return fmt::format(R"({{"inertia":{},"elastic":{},"body":{},"contact":{},"friction":{},{}{}"total":{}}})",
                     number(e.inertia), number(e.elastic), number(e.body), number(e.contact), number(e.friction),
                     where_there("damping", e.damping), where_there("host", e.host), number(e.total));
}

std::string count_json(const OperationCount& count) {
  std::string refused;
  for (int i = 0; i < kRefusals; ++i)
    if (count.refused[i] > 0)
      refused += fmt::format(R"({}"{}":{})", refused.empty() ? "" : ",", name(static_cast<Refusal>(i)), count.refused[i]);
  return fmt::format(R"({{"tried":{},"relaxed":{},"accepted":{},"refused":{{{}}}}})", count.tried, count.relaxed,
                     count.accepted, refused);
}

std::string seconds_json(const StepSeconds& s) {
  const double parts = s.assembly + s.linear_solve + s.line_search + s.ccd + s.remesh + s.projection + s.output;
  return fmt::format(
      R"({{"assembly":{},"linear_solve":{},"line_search":{},"ccd":{},"remesh":{},"projection":{},"output":{},"rest":{},"total":{}}})",
      number(s.assembly), number(s.linear_solve), number(s.line_search), number(s.ccd), number(s.remesh),
      number(s.projection), number(s.output), number(s.total - parts), number(s.total));
}

std::string norms_json(const DisplacementNorms& n) {
  return fmt::format(R"({{"l2":{},"h1":{},"h1_semi":{},"linf":{},"linf_grad":{},"lp":{}}})", number(n.l2), number(n.h1),
                     number(n.h1_semi), number(n.linf), number(n.linf_grad), number(n.lp));
}

std::string versions_json() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return fmt::format(R"({{"itr":{},"compiler":{},"eigen":"{}.{}.{}","hdf5":"{}.{}.{}"}})", json_string(ITR_VERSION),
                     json_string(__VERSION__), EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION, major, minor,
                     release);
}

/// The momentum that edits changed, of all bodies; empty where none did.
std::string remeshing_json(const StepReport& r) {
  if (r.remeshing.empty()) return "";
  std::vector<double> sum(r.remeshing.front().linear.size());
  for (const MomentumChange& change : r.remeshing)
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += change.linear[i];
  std::string numbers;
  for (const double value : sum) numbers += (numbers.empty() ? "" : ",") + number(value);
  return fmt::format(R"("remeshing_momentum":[{}],)", numbers);
}

/// Members that a step's line and the summary share.
std::string common_members(const StepReport& r) {
  return fmt::format(
      R"("vertices":{},"elements":{},"unknowns":{},"newton_iterations":{},"factorizations":{},"linear_solves":{},)"
      R"("reused_factors":{},"linear_iterations":{},"energy":{},"energy_before_remesh":{},)"
      R"("splits":{},"curves":{},"straightens":{},"collapses":{},"swaps":{},"smooths":{},"bound_by_dhat":{},"reverted_remeshes":{},)"
      R"("min_distance":{},"min_volume_ratio":{},"history_loss":{},)"
      R"("indefinite":{},"damped_steps":{},"refined_quadrature":{},"seconds":{},"processor_seconds":{},"peak_rss_mb":{})",
      r.vertices, r.elements, r.unknowns, r.newton_iterations, r.factorizations, r.linear_solves, r.reused_factors,
      r.linear_iterations, energy_json(r.energy), number(r.energy_before_remesh), count_json(r.splits), count_json(r.curves),
      count_json(r.straightens), count_json(r.collapses), count_json(r.swaps), count_json(r.smooths), r.bound_by_dhat,
      r.reverted_remeshes, number(r.min_distance), number(r.min_volume_ratio), number(r.history_loss), r.indefinite,
      r.damped_steps, r.refined_quadrature, seconds_json(r.seconds), number(r.processor_seconds), number(r.peak_rss_mb));
}

}  // namespace

std::string step_json(const StepReport& report) {
  return fmt::format(
      R"({{"step":{},"t":{},"order":{},"cut_steps":{},{},{}"residual_worth":{},"split_tolerance":{},"best_refused_split":{},"trial_seconds":{}}})",
      report.step, number(report.t), report.order, report.cut_steps, common_members(report), remeshing_json(report),
      number(report.residual_worth), number(report.split_tolerance), number(report.best_refused_split),
      number(report.trial_seconds));
}

void Totals::add(const StepReport& report) {
  const StepReport before = total_;
  const bool is_first = before.vertices == 0;
  total_ = report;
  total_.add_effort(before);
  if (report.step > 0) gain_ += report.energy_before_remesh - report.energy.total - report.history_loss;
  if (is_first) return;
  total_.min_distance = std::min(before.min_distance, report.min_distance);
  total_.min_volume_ratio = std::min(before.min_volume_ratio, report.min_volume_ratio);
  total_.peak_rss_mb = std::max(before.peak_rss_mb, report.peak_rss_mb);
}

namespace {

/// Calls `visit` with every number of a report, in a fixed order.
template <typename Report, typename Visit>
void for_each_number(Report& r, Visit&& visit) {
  for (auto* n : {&r.step, &r.vertices, &r.elements, &r.unknowns, &r.newton_iterations, &r.factorizations, &r.linear_solves,
                  &r.reused_factors, &r.linear_iterations, &r.indefinite, &r.bound_by_dhat, &r.reverted_remeshes,
                  &r.damped_steps, &r.refined_quadrature, &r.cut_steps})
    visit(*n);
  for (auto* count : {&r.splits, &r.collapses, &r.swaps, &r.smooths}) {
    visit(count->tried);
    visit(count->relaxed);
    visit(count->accepted);
  }
  auto& e = r.energy;
  for (auto* x : {&e.inertia, &e.elastic, &e.body, &e.contact, &e.friction, &e.damping, &e.total}) visit(*x);
  auto& s = r.seconds;
  for (auto* x : {&s.assembly, &s.linear_solve, &s.line_search, &s.ccd, &s.remesh, &s.projection, &s.output, &s.total})
    visit(*x);
  for (auto* x : {&r.t, &r.energy_before_remesh, &r.history_loss, &r.min_distance, &r.min_volume_ratio, &r.processor_seconds,
                  &r.peak_rss_mb})
    visit(*x);
  // Last: states that were saved before there were any do not have them.
  for (auto* count : {&r.curves, &r.straightens}) {
    visit(count->tried);
    visit(count->relaxed);
    visit(count->accepted);
  }
  for (auto* count : {&r.splits, &r.curves, &r.straightens, &r.collapses, &r.swaps, &r.smooths})
    for (auto& refused : count->refused) visit(refused);
}

}  // namespace

std::vector<double> Totals::save() const {
  std::vector<double> values = {gain_};
  for_each_number(total_, [&](auto number) { values.push_back(static_cast<double>(number)); });
  return values;
}

void Totals::restore(const std::vector<double>& values) {
  const std::size_t expected = save().size();
  const bool is_of_first_version = values.size() == expected - 6 - 6 * kRefusals;
  if (values.size() != expected && !is_of_first_version)
    throw InputError({"", "saved totals", std::to_string(values.size()) + " numbers", std::to_string(expected)});
  gain_ = values[0];
  std::size_t next = 1;
  for_each_number(total_, [&](auto& number) {
    if (next < values.size()) number = static_cast<std::remove_reference_t<decltype(number)>>(values[next++]);
  });
}

std::string Totals::summary_json(const RunInfo& info, const Units& units, const std::string& outcome,
                                 const std::string& solver, const DisplacementNorms& norms,
                                 const std::string& members) const {
  const StepReport total = in_units(total_, units);
  return fmt::format(
      R"({{"scene":{},"outcome":{},"backend":{},"solver":{},"threads":{},"versions":{},"units":{{"length":{},"mass":{},"time":{}}},)"
      R"("steps":{},"cut_steps":{},"t":{},{},"energy_decrease_by_remeshing":{},{},"norms":{}}})"
      "\n",
      json_string(info.scene), json_string(outcome), json_string(info.backend), json_string(solver), info.threads,
      versions_json(), json_string(units.length()), json_string(units.mass()), json_string(units.time()), total.step,
      total.cut_steps, number(total.t), common_members(total), number(units.from_si(gain_, "J")), members,
      norms_json(in_units(norms, units)));
}

}  // namespace itr::output
