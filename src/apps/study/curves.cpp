// SPDX-License-Identifier: MIT
#include "curves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace itr::cli::study {

namespace {

using Kind = Series::Kind;

bool is_among(const Row& row, const std::vector<std::string>& series) {
  if (row.run.series->name == std::string(kReference)) return false;
  if (series.empty()) return row.run.series->kind != Kind::solvers && row.run.series->kind != Kind::time_steps;
  return std::find(series.begin(), series.end(), row.run.series->name) != series.end();
}

template <typename ErrorOf>
std::vector<Point> collect(const Results& results, const std::vector<std::string>& series, const Cost& cost,
                           const ErrorOf& error_of) {
  std::vector<Point> found;
  for (const auto& row : results.rows) {
    if (!is_among(row, series) || !row.certified || flies(results, row)) continue;
    const std::optional<double> error = error_of(row);
    if (error && *error > 0 && row.*cost.value > 0) found.push_back({&row, *error, row.*cost.value});
  }
  std::stable_sort(found.begin(), found.end(), [](const Point& a, const Point& b) { return a.error > b.error; });
  return found;
}

}  // namespace

std::vector<Point> points(const Results& results, const std::vector<std::string>& series, const Measure& measure,
                          const Cost& cost) {
  return collect(results, series, cost, [&](const Row& row) { return told_error(results, row, measure); });
}

std::vector<Point> points_reached(const Results& results, const std::vector<std::string>& series, const Measure& measure,
                                  const Cost& cost) {
  return collect(results, series, cost, [&](const Row& row) -> std::optional<double> {
    if (!row.errors) return std::nullopt;
    const double error = (*row.errors).*measure.value;
    return results.worth ? std::max(error, (*results.worth).*measure.value) : error;
  });
}

std::vector<Point> front(const std::vector<Point>& all) {
  std::vector<Point> kept;
  for (std::size_t i = all.size(); i-- > 0;) {  // the least error first
    if (kept.empty() || all[i].cost < kept.back().cost) kept.push_back(all[i]);
  }
  std::reverse(kept.begin(), kept.end());
  return kept;
}

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
  return spread > 1e-12 * n * xx ? (n * xy - x * y) / spread : std::numeric_limits<double>::quiet_NaN();
}

const std::vector<std::string>& linear_uniform() {
  static const std::vector<std::string> names = {"uniform", "rows"};
  return names;
}

bool is_judged(const Measure& measure) {
  return measure.value == &Errors::l2 || measure.value == &Errors::h1 || measure.value == &Errors::energy;
}

std::string show(double error, const Measure& measure) {
  if (*measure.unit) return fmt::format("{:.2g} {}", error, measure.unit);
  return error < 1e-3 ? fmt::format("{:.2g} %", 100 * error) : fmt::format("{:.3g} %", 100 * error);
}

}  // namespace itr::cli::study
