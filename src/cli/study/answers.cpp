// SPDX-License-Identifier: MIT
#include "answers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace itr::cli::study {

namespace {

using Kind = Series::Kind;

constexpr int kDecades = 6;  ///< of errors, at most, in a table
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A run with an error and a cost, both positive.
struct Point {
  const Row* row;
  double error, cost;
};

/// Of one series (or, without a name, of all but those that vary something else than the mesh), the largest error first.
std::vector<Point> points(const Results& results, const char* series, const Measure& measure, const Cost& cost) {
  std::vector<Point> found;
  for (const auto& row : results.rows) {
    const bool is_meant = series ? std::string(series) == row.run.series->name
                                 : row.run.series->kind != Kind::solvers && row.run.series->kind != Kind::time_steps;
    if (!is_meant || !row.errors || !row.certified) continue;
    const Point point{&row, (*row.errors).*measure.value, row.*cost.value};
    if (point.error > 0 && point.cost > 0) found.push_back(point);
  }
  std::stable_sort(found.begin(), found.end(), [](const Point& a, const Point& b) { return a.error > b.error; });
  return found;
}

/// Those that no other run beats in both.
std::vector<Point> front(const std::vector<Point>& all) {
  std::vector<Point> kept;
  for (std::size_t i = all.size(); i-- > 0;) {  // the least error first
    if (kept.empty() || all[i].cost < kept.back().cost) kept.push_back(all[i]);
  }
  std::reverse(kept.begin(), kept.end());
  return kept;
}

/// What an error costs, by straight lines in logarithms; the cheapest run's cost for larger errors; none for smaller ones.
std::optional<double> cost_at(const std::vector<Point>& front, double error) {
  if (front.empty() || error < front.back().error) return std::nullopt;
  if (error >= front.front().error) return front.front().cost;
  const auto after = std::find_if(front.begin(), front.end(), [&](const Point& p) { return p.error <= error; });
  const Point &a = *(after - 1), &b = *after;
  const double share = std::log(error / a.error) / std::log(b.error / a.error);
  return a.cost * std::pow(b.cost / a.cost, share);
}

double slope(const std::vector<Point>& all) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& p : all) {
    const double u = std::log(p.cost), v = std::log(p.error);
    n += 1, x += u, y += v, xx += u * u, xy += u * v;
  }
  const double spread = n * xx - x * x;
  return spread > 1e-12 * n * xx ? (n * xy - x * y) / spread : kNan;
}

std::string show(double error, const Measure& measure) {
  if (*measure.unit) return fmt::format("{:.2g} {}", error, measure.unit);
  return error < 1e-3 ? fmt::format("{:.2g} %", 100 * error) : fmt::format("{:.3g} %", 100 * error);
}

/// Those that answers are about; the others are in tables and plots.
bool is_judged(const Measure& measure) {
  return measure.value == &Errors::l2 || measure.value == &Errors::h1 || measure.value == &Errors::energy;
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
std::string range(double a, double b) {
  const std::string low = fmt::format("{:.2g}", std::min(a, b)), high = fmt::format("{:.2g}", std::max(a, b));
  return low == high ? low : low + " to " + high;
}

std::optional<Verdict> judge(const Results& results, const Series& series, const Measure& measure) {
  const Cost &time = costs()[0], &unknowns = costs()[1];
  const auto uniform = front(points(results, "uniform", measure, time));
  const auto uniform_unknowns = front(points(results, "uniform", measure, unknowns));
  const auto own = front(points(results, series.name, measure, time));
  if (uniform.empty() || own.empty()) return std::nullopt;
  Verdict verdict{&series, &measure, {}, {}, {}, own.front().error, {}};
  verdict.finest_uniform = {uniform.back().error, 0, 0, 0};
  for (const auto& point : points(results, "uniform", measure, time))
    verdict.finest_uniform.seconds = std::max(verdict.finest_uniform.seconds, point.cost);
  for (const auto& point : own) {
    const auto cost = cost_at(uniform, point.error), size = cost_at(uniform_unknowns, point.error);
    verdict.points.push_back(
        {point.error, point.cost, cost ? point.cost / *cost : kNan, size ? point.row->unknowns / *size : kNan});
    const bool pays = point.cost < cost.value_or(verdict.finest_uniform.seconds);
    if (!pays && !cost) {
      if (!verdict.untold_from) verdict.untold_from = point.error;
      continue;
    }
    if (!pays) verdict.pays_from.reset();
    if (pays && !verdict.pays_from) verdict.pays_from = point.error;
  }
  return verdict;
}

std::string in_words(const Verdict& verdict) {
  const Measure& measure = *verdict.measure;
  std::string text = fmt::format("{}, `{}` ({}):", measure.label, verdict.series->name, verdict.series->what);
  std::vector<double> times, sizes, errors;
  for (const auto& point : verdict.points) {
    if (std::isnan(point.time_ratio) || std::isnan(point.unknowns_ratio)) continue;
    times.push_back(point.time_ratio), sizes.push_back(point.unknowns_ratio), errors.push_back(point.error);
  }
  if (!times.empty()) {
    const auto [fast, slow] = std::minmax_element(times.begin(), times.end());
    const auto [few, many] = std::minmax_element(sizes.begin(), sizes.end());
    text +=
        fmt::format(" {} of uniform refinement's time at equal error, with {} of its unknowns, from {} to {}.",
                    range(*fast, *slow), range(*few, *many), show(errors.front(), measure), show(errors.back(), measure));
  }
  if (const auto& last = verdict.points.back(); std::isnan(last.time_ratio))
    text +=
        fmt::format(" {} takes it {:.3g} s; uniform refinement has come to {} after {:.3g} s.", show(last.error, measure),
                    last.seconds, show(verdict.finest_uniform.error, measure), verdict.finest_uniform.seconds);
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

/// Of the runs with dt and dt/2, against what the mesh leaves.
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

std::vector<Order> orders(const Results& results) {
  std::vector<Order> found;
  for (const auto& series : all_series()) {
    if (series.kind == Kind::solvers || series.kind == Kind::time_steps) continue;
    for (const auto& measure : measures()) {
      const auto by_seconds = points(results, series.name, measure, costs()[0]);
      if (by_seconds.size() < 3) continue;
      const double in_size = -results.dim * slope(points(results, series.name, measure, costs()[1]));
      found.push_back({series.name, measure.name, in_size, -slope(by_seconds), static_cast<int>(by_seconds.size())});
    }
  }
  return found;
}

std::vector<Verdict> verdicts(const Results& results) {
  std::vector<Verdict> found;
  for (const auto& measure : measures()) {
    if (!is_judged(measure)) continue;
    for (const auto& series : all_series())
      if (series.kind == Kind::tolerances || std::string(series.name) == "sizing-field")
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
      if (verdict.measure == &measure) add(in_words(verdict));
    add(time_step_answer(results, measure));
  }
  add(solver_answer(results));
  add(failures(results));
  return sentences;
}

std::string choices_table(const Results& results) {
  std::string rows;
  std::vector<const Row*> chosen;
  for (const auto& measure : measures()) {
    if (!is_judged(measure)) continue;
    const auto all = front(points(results, nullptr, measure, costs()[0]));
    const auto uniform = front(points(results, "uniform", measure, costs()[0]));
    if (all.empty()) continue;
    for (int step = 0; step > -3 * kDecades; --step) {
      const double target = ladder_below(all.front().error, step);
      const auto cheapest = std::find_if(all.begin(), all.end(), [&](const Point& p) { return p.error <= target; });
      if (cheapest == all.end()) break;
      const Row& row = *cheapest->row;
      const auto cost = cost_at(uniform, target);
      rows +=
          fmt::format("| {} | {} | `{}` | {} | {:.3g} | {} | {:.0f} |\n", measure.name, show(target, measure), row.run.name,
                      row.vertices, cheapest->cost, cost ? fmt::format("{:.3g}", *cost) : "not reached", row.memory_mb);
      if (std::find(chosen.begin(), chosen.end(), &row) == chosen.end()) chosen.push_back(&row);
    }
  }
  if (rows.empty()) return rows;
  std::string text =
      "| error | at most | run | vertices | processor s | uniform refinement's, between its levels | MB |\n"
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
