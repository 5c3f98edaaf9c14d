// SPDX-License-Identifier: MIT
#include "doubts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "curves.hpp"

namespace itr::cli::study {

namespace {

using Kind = Series::Kind;

constexpr double kHighestOrder = 4;           ///< of linear elements, and of steps of remeshing, with room
constexpr double kHighestQuadraticOrder = 5;  ///< energies of quadratic elements have 4

/// The least share of the reference's size that a run is off, or infinity where no run is told of.
double nearest(const Results& results, const Measure& measure) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& point : points(results, {}, measure, costs()[0]))  // a reference without a size cannot be far from
    least = std::min(least, relative_error(results, *point.row, measure).value_or(0));
  return least;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "`" : ", `") + name + "`";
  return text;
}

std::string about_flights(const Results& results) {
  std::vector<std::string> names;
  double farthest = 0;
  for (const auto& row : results.rows) {
    if (!row.finished || !flies(results, row)) continue;
    names.push_back(row.run.name);
    farthest = std::max(farthest, row.flight);
  }
  if (names.empty()) return "";
  return fmt::format(
      "A body flies away, by up to {:.3g} times the size of the scene, in {}: nothing seems to hold it. These runs "
      "are left out.",
      farthest, listed(names));
}

std::string about_missing(const Results& results, const char* what, const char* option, const char* measure,
                          double Errors::*value) {
  const auto is_missing = [&](const Row& row) { return row.errors && std::isnan((*row.errors).*value); };
  if (std::none_of(results.rows.begin(), results.rows.end(), is_missing)) return "";
  return fmt::format("Frames of the reference have no {} (/output/paraview/options/{}): of the {} no errors are told.", what,
                     option, measure);
}

std::string about_large_errors(const Results& results, const Measure& measure) {
  std::vector<std::string> names;
  for (const auto& point : points(results, {}, measure, costs()[0]))
    if (is_large(results, *point.row, measure)) names.push_back(point.row->run.name);
  if (names.empty()) return "";
  return fmt::format("{}: {} {} off by {:g} % and more of the reference; nothing is recommended of {}.", measure.label,
                     listed(names), names.size() > 1 ? "are" : "is", 100 * kLargeError, names.size() > 1 ? "them" : "it");
}

/// In equilibrium without friction, of two states the one of lower potential is nearer to the limit.
std::string about_better_runs(const Results& results) {
  const auto is_reference = [&](const Row& row) { return row.run.name == results.reference_run; };
  const auto reference = std::find_if(results.rows.begin(), results.rows.end(), is_reference);
  if (reference == results.rows.end() || results.is_dynamic || results.has_friction) return "";
  const Row* best = &*reference;
  for (const auto& row : results.rows)
    if (row.finished && row.certified && is_against_reference(row) && row.potential < best->potential) best = &row;
  if (best == &*reference) return "";
  return fmt::format(
      "`{}` ends with a potential lower than the reference's, by {:.2g} J: it is nearer to the limit, and the better "
      "reference (`--reference`).",
      best->run.name, reference->potential - best->potential);
}

std::string about_worth(const Results& results) {
  if (!results.worth)
    return "What the reference is worth is not known: there is no second one to hold it against (`--second-reference`).";
  std::string text;
  for (const auto& measure : measures())
    if (is_judged(measure) && !std::isnan((*results.worth).*measure.value))
      text +=
          fmt::format("{}{} ({})", text.empty() ? "" : ", ", show((*results.worth).*measure.value, measure), measure.name);
  return fmt::format("The reference is worth {}: by so much {} differs from it. Smaller errors are not told.", text,
                     results.second_reference);
}

}  // namespace

std::vector<Order> orders(const Results& results) {
  std::vector<Order> found;
  for (const auto& series : all_series()) {
    if (series.kind == Kind::solvers || series.kind == Kind::time_steps) continue;
    for (const auto& measure : measures()) {
      const auto by_seconds = points(results, {series.name}, measure, costs()[0]);
      if (by_seconds.size() < 3) continue;
      const double in_size = -results.dim * slope(points(results, {series.name}, measure, costs()[1]));
      found.push_back({series.name, measure.name, in_size, -slope(by_seconds), static_cast<int>(by_seconds.size())});
    }
  }
  return found;
}

bool is_impossible(const Order& order) {
  return order.in_size > (order.series == "uniform-p2" ? kHighestQuadraticOrder : kHighestOrder);
}

bool is_large(const Results& results, const Row& row, const Measure& measure) {
  const auto share = relative_error(results, row, measure);
  return share && *share > kLargeError;
}

bool can_recommend(const Results& results, const Measure& measure) {
  return results.refused.empty() && nearest(results, measure) <= kLargeError &&
         can_recommend(results, measure, linear_uniform().front());
}

bool can_recommend(const Results& results, const Measure& measure, const std::string& series) {
  const auto all = orders(results);
  return std::none_of(all.begin(), all.end(), [&](const Order& order) {
    return order.series == series && order.measure == measure.name && is_impossible(order);
  });
}

std::vector<std::string> doubts(const Results& results) {
  if (!results.refused.empty())
    return {fmt::format("Nothing is said of errors: {} is no reference, since {}.", results.reference, results.refused)};
  std::vector<std::string> sentences;
  const auto add = [&](std::string sentence) {
    if (!sentence.empty()) sentences.push_back(std::move(sentence));
  };
  add(about_flights(results));
  add(about_missing(results, "kinetic energy", "kinetic_energy", "energy", &Errors::energy));
  add(about_missing(results, "momentum", "momentum", "momentum", &Errors::momentum));
  for (const auto& measure : measures()) {
    if (!is_judged(measure)) continue;
    const double least = nearest(results, measure);
    if (std::isfinite(least) && least > kLargeError)
      add(fmt::format(
          "{}: no run is nearer to the reference than {:.3g} % of it. Either it or all runs are elsewhere; nothing "
          "is recommended.",
          measure.label, 100 * least));
    else
      add(about_large_errors(results, measure));
  }
  for (const auto& order : orders(results)) {
    const auto measure = std::find_if(measures().begin(), measures().end(),
                                      [&](const Measure& m) { return std::string(m.name) == order.measure; });
    if (is_impossible(order) && is_judged(*measure))
      add(fmt::format(
          "{}, `{}`: an order of {:.2g}, which no mesh gives; the errors come from something else (another branch, "
          "a reference as coarse as the runs), and nothing is recommended of them.",
          measure->label, order.series, order.in_size));
  }
  int warning_runs = 0;
  for (const auto& row : results.rows) warning_runs += !row.warnings.empty();
  if (warning_runs > 0) add(fmt::format("{} of {} runs gave warnings, listed below.", warning_runs, results.rows.size()));
  add(about_better_runs(results));
  add(about_worth(results));
  return sentences;
}

}  // namespace itr::cli::study
