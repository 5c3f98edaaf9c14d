// SPDX-License-Identifier: MIT
#include "simulation/constraint_rounds.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace itr {

void close_constraints(std::span<Constraint* const> constraints, const VectorX& base, const VectorX& d,
                       const std::function<NewtonSummary()>& solve, const Units& units, NewtonSummary& summary) {
  constexpr double kTolerance = 1e-7;  // of the forces
  constexpr double kSlow = 0.1, kFactor = 10;
  constexpr int kMostRounds = 20;
  std::vector<double> errors;
  const auto find_errors = [&] {
    std::vector<double> found;
    for (const Constraint* constraint : constraints) found.push_back(constraint->error_at({base, d}));
    return std::exchange(errors, std::move(found));
  };
  find_errors();
  for (int round = 0; summary.converged() && std::ranges::max(errors) > kTolerance; ++round) {
    if (round == kMostRounds) {
      summary.termination = Termination::lagging;
      summary.message = constraints[std::ranges::max_element(errors) - errors.begin()]->describe({base, d}, units);
      return;
    }
    for (Constraint* constraint : constraints) constraint->update({base, d});
    NewtonSummary next = solve();
    next.add_effort(summary);
    summary = std::move(next);
    const std::vector<double> before = find_errors();
    for (std::size_t i = 0; i < errors.size(); ++i)
      if (errors[i] > kSlow * before[i] && round % 2 == 1) constraints[i]->stiffen(kFactor);
  }
}

}  // namespace itr
