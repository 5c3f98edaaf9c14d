// SPDX-License-Identifier: MIT
#pragma once

#include "core/process.hpp"
#include "core/timer.hpp"
#include "itr/frame.hpp"
#include "linear/reuse.hpp"

namespace itr {

/// The time and the linear solves since it was made.
class EffortClock {
 public:
  explicit EffortClock(const linear::ReusingSolver& solver) : solver_(solver) {}

  void tell(StepReport& report) const {
    const linear::SolveCounts& now = solver_.counts();
    report.linear_solves += now.solves - solves_before_.solves;
    report.factorizations += now.factorizations - solves_before_.factorizations;
    report.reused_factors += now.reused - solves_before_.reused;
    report.linear_iterations += now.iterations - solves_before_.iterations;
    report.seconds.total = seconds_now() - start_;
    report.processor_seconds = processor_seconds_now() - processor_start_;
  }

 private:
  const linear::ReusingSolver& solver_;
  linear::SolveCounts solves_before_ = solver_.counts();
  double start_ = seconds_now(), processor_start_ = processor_seconds_now();
};

}  // namespace itr
