// SPDX-License-Identifier: MIT
#include "itr/simulation/frame.hpp"

#include <algorithm>

namespace itr {

void add_changes(const std::vector<MomentumChange>& changes, double factor, std::vector<MomentumChange>& sum) {
  for (const MomentumChange& change : changes) {
    auto of_body = std::find_if(sum.begin(), sum.end(), [&](const auto& other) { return other.body == change.body; });
    if (of_body == sum.end()) {
      const std::vector<double> linear(change.linear.size()), angular(change.angular.size());
      of_body = sum.insert(sum.end(), {change.body, linear, angular});
    }
    for (std::size_t i = 0; i < change.linear.size(); ++i) of_body->linear[i] += factor * change.linear[i];
    for (std::size_t i = 0; i < change.angular.size(); ++i) of_body->angular[i] += factor * change.angular[i];
  }
}

StepSeconds& StepSeconds::operator+=(const StepSeconds& other) {
  assembly += other.assembly;
  linear_solve += other.linear_solve;
  line_search += other.line_search;
  ccd += other.ccd;
  remesh += other.remesh;
  projection += other.projection;
  output += other.output;
  total += other.total;
  return *this;
}

void StepReport::add_effort(const StepReport& before) {
  newton_iterations += before.newton_iterations;
  linear_solves += before.linear_solves;
  factorizations += before.factorizations;
  reused_factors += before.reused_factors;
  linear_iterations += before.linear_iterations;
  indefinite += before.indefinite;
  splits += before.splits;
  curves += before.curves;
  straightens += before.straightens;
  collapses += before.collapses;
  swaps += before.swaps;
  smooths += before.smooths;
  history_loss += before.history_loss;
  add_changes(before.remeshing, 1, remeshing);
  bound_by_dhat += before.bound_by_dhat;
  reverted_remeshes += before.reverted_remeshes;
  cut_steps += before.cut_steps;
  damped_steps += before.damped_steps;
  seconds += before.seconds;
  processor_seconds += before.processor_seconds;
}

void StepReport::forget_operations() {
  for (auto* operations : {&splits, &curves, &straightens, &collapses, &swaps, &smooths}) operations->accepted = 0;
  history_loss = 0;
  remeshing.clear();
}

}  // namespace itr
