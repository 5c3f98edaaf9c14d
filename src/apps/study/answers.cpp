// SPDX-License-Identifier: MIT
#include "answers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "curves.hpp"

namespace itr::cli::study {

namespace {

using Kind = Series::Kind;

constexpr int kDecades = 6;  ///< of errors, at most, in a table
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kQuadratic = "uniform-p2";

bool is_any_of(const std::string& name, const std::vector<std::string>& names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The step-th of ..., 0.1, 0.2, 0.5, 1, ... from the largest not above `value`, downward.
double ladder_below(double value, int step) {
  constexpr double kRungs[] = {1, 2, 5};
  int rung = static_cast<int>(std::floor(3 * std::log10(value))) + 1;
  const auto at = [&](int r) { return kRungs[((r % 3) + 3) % 3] * std::pow(10, std::floor(r / 3.0)); };
  while (at(rung) > value) --rung;
  return at(rung + step);
}

/// "0.3", "0.3 to 0.5"
std::string range(const std::vector<double>& values) {
  const auto [least, largest] = std::minmax_element(values.begin(), values.end());
  const std::string low = fmt::format("{:.2g}", *least), high = fmt::format("{:.2g}", *largest);
  return low == high ? low : low + " to " + high;
}

/// "at 5 %", "from 5 % to 2 %"
std::string from_to(const std::vector<double>& errors, const Measure& measure) {
  const std::string first = show(errors.front(), measure), last = show(errors.back(), measure);
  return first == last ? "at " + first : "from " + first + " to " + last;
}

/// Uniform refinement's costs, by fronts.
struct Uniform {
  std::vector<Point> linear, quadratic, linear_unknowns;

  Uniform(const Results& results, const Measure& measure, bool with_quadratic)
      : linear(front(points_reached(results, linear_uniform(), measure, costs()[0]))),
        linear_unknowns(front(points_reached(results, linear_uniform(), measure, costs()[1]))) {
    if (with_quadratic) quadratic = front(points_reached(results, {kQuadratic}, measure, costs()[0]));
  }
  bool empty() const { return linear.empty() && quadratic.empty(); }
  /// The lesser of both.
  std::optional<double> cost_at(double error) const {
    const auto a = study::cost_at(linear, error), b = study::cost_at(quadratic, error);
    return a && b ? std::min(*a, *b) : a ? a : b;
  }
  Verdict::Point finest() const {
    Verdict::Point finest;
    finest.error = std::numeric_limits<double>::infinity();
    for (const auto* all : {&linear, &quadratic}) {
      if (all->empty()) continue;
      finest.error = std::min(finest.error, all->back().error);
      finest.seconds = std::max(finest.seconds, all->back().cost);
    }
    return finest;
  }
};

std::optional<Verdict> judge(const Results& results, const Series& series, const Measure& measure) {
  const Uniform uniform(results, measure, series.name != std::string(kQuadratic));
  const auto own = points(results, {series.name}, measure, costs()[0]), best = front(own);
  if (uniform.empty() || own.empty()) return std::nullopt;
  Verdict verdict{&series, &measure, {}, true, {}, {}, 0, uniform.finest()};
  verdict.is_recommended = can_recommend(results, measure) && can_recommend(results, measure, series.name);
  const auto ratio = [](double cost, std::optional<double> by) { return by ? cost / *by : kNan; };
  for (const auto& point : own) {
    const auto beats = [&](const Point& p) { return p.error <= point.error && p.cost <= point.cost && p.row != point.row; };
    const auto better = std::find_if(best.begin(), best.end(), beats);
    verdict.points.push_back({.run = point.row->run.name,
                              .error = point.error,
                              .seconds = point.cost,
                              .time_ratio = ratio(point.cost, cost_at(uniform.linear, point.error)),
                              .quadratic_ratio = ratio(point.cost, cost_at(uniform.quadratic, point.error)),
                              .unknowns_ratio = ratio(point.row->unknowns, cost_at(uniform.linear_unknowns, point.error)),
                              .beaten_by = better == best.end() ? "" : better->row->run.name,
                              .is_large = is_large(results, *point.row, measure)});
    if (verdict.points.back().is_large) continue;
    if (verdict.largest_error == 0) verdict.largest_error = point.error;
    const auto cost = uniform.cost_at(point.error);
    const bool pays = point.cost < cost.value_or(verdict.finest_uniform.seconds);
    if (!pays && !cost) {
      if (!verdict.untold_from) verdict.untold_from = point.error;
      continue;
    }
    if (!pays) verdict.pays_from.reset();
    if (pays && !verdict.pays_from) verdict.pays_from = point.error;
  }
  verdict.is_recommended &= verdict.largest_error > 0;
  if (!verdict.is_recommended) verdict.pays_from.reset();
  return verdict;
}

std::string in_words(const Verdict& verdict) {
  const Measure& measure = *verdict.measure;
  const std::string head = fmt::format("{}, `{}` ({}):", measure.label, verdict.series->name, verdict.series->what);
  if (!verdict.is_recommended) return head + " nothing is recommended.";
  std::string text = head;
  std::vector<double> times, quadratic, sizes, errors;
  const Verdict::Point* last = nullptr;
  std::string beaten;
  for (const auto& point : verdict.points) {
    if (point.is_large) continue;
    last = &point;
    if (!point.beaten_by.empty())
      beaten += fmt::format("{}`{}` by `{}`", beaten.empty() ? "" : ", ", point.run, point.beaten_by);
    if (!std::isnan(point.quadratic_ratio)) quadratic.push_back(point.quadratic_ratio);
    if (std::isnan(point.time_ratio) || std::isnan(point.unknowns_ratio)) continue;
    times.push_back(point.time_ratio), sizes.push_back(point.unknowns_ratio), errors.push_back(point.error);
  }
  if (!times.empty())
    text += fmt::format(" {} of uniform refinement's time at equal error, with {} of its unknowns, {}.", range(times),
                        range(sizes), from_to(errors, measure));
  if (!quadratic.empty()) text += fmt::format(" {} of the time that it takes with quadratic elements.", range(quadratic));
  if (std::isnan(last->time_ratio) && std::isnan(last->quadratic_ratio))
    text +=
        fmt::format(" {} takes it {:.3g} s; uniform refinement has come to {} after {:.3g} s.", show(last->error, measure),
                    last->seconds, show(verdict.finest_uniform.error, measure), verdict.finest_uniform.seconds);
  if (!beaten.empty()) text += fmt::format(" Beaten in both error and time: {}.", beaten);
  if (verdict.untold_from == verdict.largest_error) return text + " Whether it pays, a finer uniform level would tell.";
  if (!verdict.pays_from)
    text += " It does not pay here";
  else if (*verdict.pays_from == verdict.largest_error)
    text += " It pays at all of these errors";
  else
    text += fmt::format(" It pays from {} on", show(*verdict.pays_from, measure));
  if (verdict.untold_from)
    text += fmt::format("; from {} on a finer uniform level would tell", show(*verdict.untold_from, measure));
  return text + ".";
}

/// Compares the runs with dt and dt/2, beside the error of the mesh.
std::string time_step_answer(const Results& results, const Measure& measure) {
  std::vector<const Row*> steps;
  const Row* space = nullptr;
  for (const auto& row : results.rows) {
    if (row.run.series->kind == Kind::time_steps && row.errors) steps.push_back(&row);
  }
  if (steps.size() < 2) return "";
  for (const auto& row : results.rows)  // the same mesh, that of the finest level but one
    if (row.errors && std::string(row.run.series->name) == "uniform" && row.vertices == steps[0]->vertices) space = &row;
  if (!space) return "";
  const double whole = (*steps[0]->errors).*measure.value, half = (*steps[1]->errors).*measure.value,
               mesh = (*space->errors).*measure.value;
  if (!(whole > 0 && half > 0)) return "";
  return fmt::format("{}, on the mesh of {}: {} is {} off dt/4, {} is {} off; the mesh's own error is {}. So {} rules.",
                     measure.label, space->run.name, steps[0]->run.label, show(whole, measure), steps[1]->run.label,
                     show(half, measure), show(mesh, measure), whole > mesh ? "the time step" : "the mesh");
}

std::string solver_answer(const Results& results) {
  std::vector<const Row*> rows;
  for (const auto& row : results.rows)
    if (row.run.series->kind == Kind::solvers && row.finished) rows.push_back(&row);
  if (rows.empty()) return "";
  std::stable_sort(rows.begin(), rows.end(),
                   [](const Row* a, const Row* b) { return a->processor_seconds < b->processor_seconds; });
  std::string text = "Linear solvers, processor seconds without remeshing:";
  const char* separator = " ";
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (const Row* row : rows) {
    text += fmt::format("{}{} {:.3g}", separator, row->run.label, row->processor_seconds);
    separator = ", ";
    if (!row->errors) continue;
    low = std::min(low, row->errors->h1), high = std::max(high, row->errors->h1);
  }
  return text + (high > 0 ? fmt::format("; their H1 errors agree to {:.1e} of it.", (high - low) / high) : ".");
}

bool is_uniform(const Row& row) { return is_any_of(row.run.series->name, {"uniform", "rows", kQuadratic}); }

/// Runs that a table may recommend: uniform ones, and those of series that a verdict does not speak against.
std::vector<Point> candidates_of(const Results& results, const Measure& measure, const std::vector<Verdict>& all) {
  std::vector<Point> kept;
  for (const auto& point : points_reached(results, {}, measure, costs()[0])) {
    if (is_large(results, *point.row, measure)) continue;
    const auto is_it = [&](const Verdict& v) { return v.measure == &measure && v.series == point.row->run.series; };
    const auto verdict = std::find_if(all.begin(), all.end(), is_it);
    if (verdict == all.end() ? is_uniform(*point.row) : verdict->is_recommended) kept.push_back(point);
  }
  return kept;
}

std::string failures(const Results& results) {
  std::string text;
  for (const auto& row : results.rows) {
    if (row.finished && row.certified) continue;
    text += fmt::format("{}{}: {}", text.empty() ? "Failed: " : "; ", row.run.name,
                        row.finished ? "a frame has an intersection or an inversion" : row.reason);
  }
  return text.empty() ? text : text + ".";
}

}  // namespace

std::vector<Verdict> verdicts(const Results& results) {
  std::vector<Verdict> found;
  for (const auto& measure : measures()) {
    if (!is_judged(measure)) continue;
    for (const auto& series : all_series())
      if (series.kind == Kind::tolerances || is_any_of(series.name, {"sizing-field", kQuadratic}))
        if (auto verdict = judge(results, series, measure)) found.push_back(std::move(*verdict));
  }
  return found;
}

std::vector<std::string> answers(const Results& results) {
  std::vector<std::string> sentences;
  const auto add = [&](std::string sentence) {
    if (!sentence.empty()) sentences.push_back(std::move(sentence));
  };
  const auto all = verdicts(results);
  for (const auto& measure : measures()) {
    if (!is_judged(measure)) continue;
    for (const auto& verdict : all)
      if (verdict.measure == &measure && can_recommend(results, measure)) add(in_words(verdict));
    add(time_step_answer(results, measure));
  }
  add(solver_answer(results));
  add(failures(results));
  return sentences;
}

std::string choices_table(const Results& results) {
  std::string rows;
  std::vector<const Row*> chosen;
  const auto all = verdicts(results);
  for (const auto& measure : measures()) {
    if (!is_judged(measure) || !can_recommend(results, measure)) continue;
    const auto candidates = candidates_of(results, measure, all);
    if (candidates.empty()) continue;
    const Uniform uniform(results, measure, true);
    for (int step = 0; step > -3 * kDecades; --step) {
      const double target = ladder_below(candidates.front().error, step);
      const auto cost = uniform.cost_at(target);
      // Answers compare remeshing's run with a uniform mesh of its error, as this does.
      const auto is_chosen = [&](const Point& p) {
        return p.error <= target && (is_uniform(*p.row) || !cost || p.cost < *cost);
      };
      const Point* cheapest = nullptr;
      for (const auto& point : candidates)
        if (is_chosen(point) && (!cheapest || point.cost < cheapest->cost)) cheapest = &point;
      if (!cheapest) break;
      const Row& row = *cheapest->row;
      rows +=
          fmt::format("| {} | {} | `{}` | {} | {:.3g} | {} | {:.0f} |\n", measure.name, show(target, measure), row.run.name,
                      row.vertices, cheapest->cost, cost ? fmt::format("{:.3g}", *cost) : "not reached", row.memory_mb);
      if (std::find(chosen.begin(), chosen.end(), &row) == chosen.end()) chosen.push_back(&row);
    }
  }
  if (rows.empty()) return rows;
  std::string text =
      "| error | at most | run | vertices | processor s | that of uniform refinement, between its levels | MB |\n"
      "|---|---|---|---|---|---|---|\n" +
      rows + "\n";
  for (const Row* row : chosen) {
    text += fmt::format("- `{}`: `itr run {}", row->run.name, results.scene);
    for (const auto& set : row->run.overrides)
      if (!set.pointer.starts_with("/output")) text += fmt::format(" --set '{}={}'", set.pointer, set.value);
    if (!row->run.solver.empty()) text += " --solver " + row->run.solver;
    text += "`\n";
  }
  return text;
}

}  // namespace itr::cli::study
