// SPDX-License-Identifier: MIT
#include "itr/simulation/frame.hpp"

namespace itr {

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
}

}  // namespace itr
