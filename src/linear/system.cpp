// SPDX-License-Identifier: MIT
#include "linear/system.hpp"

namespace itr::linear {

SystemReport describe(Outcome outcome, const Solver& solver) {
  SystemReport report;
  report.outcome = outcome;
  if (outcome == Outcome::not_positive_definite) report.definiteness = Definiteness::indefinite;
  if (outcome != Outcome::ok) return report;
  report.negative_eigenvalues = solver.statistics().negative_pivots;
  if (report.negative_eigenvalues > 0)
    report.definiteness = Definiteness::indefinite;
  else if (solver.capabilities().tells_definiteness)
    report.definiteness = Definiteness::positive;
  return report;
}

}  // namespace itr::linear
