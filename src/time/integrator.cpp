// SPDX-License-Identifier: MIT
#include "time/integrator.hpp"

#include <algorithm>
#include <array>

namespace itr {

namespace {

struct BdfRow {
  std::array<double, 6> past;  ///< weights of past states, newest first
  double b;                    ///< weight of h times the derivative
};

/// Backward differentiation formulas of order 1 to 6.
BdfRow bdf(int order, double ratio) {
  if (order == 2 && ratio != 1) {
    const double d = 1 + 2 * ratio, grown = (1 + ratio) * (1 + ratio);
    return {{grown / d, -ratio * ratio / d}, (1 + ratio) / d};
  }
  constexpr auto row = [](double d, std::array<double, 6> n, double b) {
    for (double& w : n) w /= d;
    return BdfRow{n, b / d};
  };
  static constexpr std::array<BdfRow, 6> kRows = {row(1, {1}, 1),
                                                  row(3, {4, -1}, 2),
                                                  row(11, {18, -9, 2}, 6),
                                                  row(25, {48, -36, 16, -3}, 12),
                                                  row(137, {300, -300, 200, -75, 12}, 60),
                                                  row(147, {360, -450, 400, -225, 72, -10}, 60)};
  return kRows[order - 1];
}

VectorX combine(const BdfRow& row, int order, const std::vector<VectorX>& past) {
  VectorX sum = row.past[0] * past[0];
  for (int i = 1; i < order; ++i) sum += row.past[i] * past[i];
  return sum;
}

/// The sum of the weights is 1: what positions add to that of the newest one.
VectorX combine_increments(const BdfRow& row, int order, const std::vector<VectorX>& past) {
  VectorX sum = VectorX::Zero(past[0].size());
  for (int i = 1; i < order; ++i) sum += row.past[i] * (past[i] - past[0]);
  return sum;
}

}  // namespace

bool TimeIntegrator::is_newmark(const History& history) const {
  return options_.integrator == Integrator::newmark && !history.damp_next;
}

bool TimeIntegrator::is_trapezoidal(const History& history) const {
  return is_newmark(history) && !options_.quasistatic && options_.newmark_beta == 0.25 && options_.newmark_gamma == 0.5;
}

int TimeIntegrator::depth() const { return options_.integrator == Integrator::bdf ? options_.bdf_order : 1; }

int TimeIntegrator::acceleration_depth() const {
  if (options_.adaptive.enabled && options_.has_inertia()) return 2;
  return uses_acceleration() ? 1 : 0;
}

int TimeIntegrator::order(const History& history) const {
  return std::min<int>(depth(), static_cast<int>(history.x.size()));
}

int TimeIntegrator::accuracy(const History& history) const {
  if (options_.is_static) return 0;
  if (is_newmark(history)) return options_.newmark_gamma == 0.5 ? 2 : 1;
  return order(history);
}

VectorX TimeIntegrator::predicted_increment(const History& history) const {
  const double h = options_.dt;
  if (is_newmark(history)) return h * history.v[0] + h * h * (0.5 - options_.newmark_beta) * history.a[0];
  const int k = order(history);
  const BdfRow row = bdf(k, ratio(history));
  return combine_increments(row, k, history.x) + row.b * h * combine(row, k, history.v);
}

VectorX TimeIntegrator::predictor(const History& history) const { return history.x[0] + predicted_increment(history); }

double TimeIntegrator::scaling(const History& history) const {
  if (options_.is_static) return 1;
  const double h = options_.dt;
  if (is_newmark(history)) return options_.newmark_beta * h * h;
  const double b = bdf(order(history), ratio(history)).b;
  return b * b * h * h;
}

double TimeIntegrator::velocity_rate(const History& history) const {
  if (options_.is_static) return 1;
  if (is_newmark(history)) return options_.newmark_gamma / (options_.newmark_beta * options_.dt);
  return 1 / (bdf(order(history), ratio(history)).b * options_.dt);
}

/// The positions of no velocity minus the newest ones.
VectorX TimeIntegrator::reference_increment(const History& history) const {
  if (is_newmark(history)) {
    const double beta = options_.newmark_beta, gamma = options_.newmark_gamma, h = options_.dt;
    return ((1 - gamma / beta) * history.v[0] + (1 - gamma / (2 * beta)) * h * history.a[0]) * (-beta * h / gamma);
  }
  const int k = order(history);
  return combine_increments(bdf(k, ratio(history)), k, history.x);
}

VectorX TimeIntegrator::velocity_reference(const History& history) const {
  return history.x[0] + reference_increment(history);
}

VectorX TimeIntegrator::velocity(const VectorX& x, const History& history) const {
  return velocity_after(x - history.x[0], history);
}

VectorX TimeIntegrator::velocity_after(const VectorX& increment, const History& history) const {
  return velocity_rate(history) * (increment - reference_increment(history));
}

VectorX TimeIntegrator::acceleration(const VectorX& v, const History& history) const {
  const double h = options_.dt;
  if (is_newmark(history))
    return (v - history.v[0] - (1 - options_.newmark_gamma) * h * history.a[0]) / (options_.newmark_gamma * h);
  const int k = order(history);
  const BdfRow row = bdf(k, ratio(history));
  return (v - combine(row, k, history.v)) / (row.b * h);
}

double TimeIntegrator::error_constant(const History& history) const {
  if (is_newmark(history)) return 1.0 / 12;
  if (order(history) == 1) return 0.5;
  const double w = ratio(history);
  return (1 + w) * (1 + w) / (6 * w * (1 + 2 * w));
}

LocalError TimeIntegrator::local_error(const VectorX& increment, const History& history) const {
  const double h = options_.dt, C = error_constant(history);
  const VectorX v = velocity_after(increment, history), a = acceleration(v, history);
  const std::vector<VectorX>& past = history.a;
  LocalError error;
  if (accuracy(history) < 2 || past.empty()) {
    error.x = C * h * (v - history.v[0]);
    if (!past.empty()) error.v = C * h * (a - past[0]);
    return error;
  }
  error.x = C * h * h * (a - past[0]);
  if (past.size() > 1)
    error.v = 2 * C * h * h * h / (h + history.dt) * ((a - past[0]) / h - (past[0] - past[1]) / history.dt);
  return error;
}

bool TimeIntegrator::knows_local_error(const History& history) const {
  return options_.has_inertia() && accuracy(history) <= 2 &&
         (!is_newmark(history) || (options_.newmark_beta == 0.25 && options_.newmark_gamma == 0.5));
}

VectorX TimeIntegrator::predictor_error(const LocalError& error, const History& history) const {
  if (is_newmark(history) || error.v.size() == 0) return -error.x;
  return -error.x - error.v / velocity_rate(history);
}

void TimeIntegrator::push_errors(const VectorX& of_x, const LocalError& error, History& errors) const {
  const History before = errors;
  push(of_x, errors);
  errors.v[0] += velocity_rate(before) * error.x;
  if (!errors.a.empty()) errors.a[0] += error.x / scaling(before);
  if (error.v.size() == 0) return;
  if (is_newmark(before)) {
    errors.v[0] -= error.v;
  } else if (!errors.a.empty()) {
    errors.a[0] += velocity_rate(before) * error.v;
  }
}

void TimeIntegrator::push(VectorX x, const VectorX& increment, History& history) const {
  VectorX v = velocity_after(increment, history);
  VectorX a = acceleration_depth() > 0 ? acceleration(v, history) : VectorX();
  const auto push_front = [](std::vector<VectorX>& past, VectorX newest, int depth) {
    past.insert(past.begin(), std::move(newest));
    past.resize(std::min<std::size_t>(past.size(), depth));
  };
  history.damp_next = false;
  history.dt = options_.dt;
  push_front(history.x, std::move(x), depth());
  push_front(history.v, std::move(v), depth());
  push_front(history.a, std::move(a), acceleration_depth());
}

}  // namespace itr
