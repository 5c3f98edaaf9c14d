// SPDX-License-Identifier: MIT
// Request and report of the solution of one linear system by one call.
#pragma once

#include <limits>

#include "itr/solver.hpp"

namespace itr::linear {

/// Definiteness of a symmetric matrix, as far as a solver has found it out.
enum class Definiteness { unknown, positive, indefinite };

struct SystemReport {
  Outcome outcome = Outcome::ok;
  double residual = std::numeric_limits<double>::infinity();  ///< relative, of the solution; infinite where there is none
  Definiteness definiteness = Definiteness::unknown;
  int negative_eigenvalues = 0;  ///< of an indefinite matrix; 0 where they were not counted
};

/// One with too few digits is one, too.
inline bool has_solution(Outcome outcome) { return outcome == Outcome::ok || outcome == Outcome::not_converged; }

/// Accuracy that the caller asks for.
struct Asked {
  double residual = 0;         ///< relative
  double loose = residual;     ///< enough where each digit costs iterations
  bool if_indefinite = false;  ///< also of a matrix that was found indefinite
  bool goes_on = false;        ///< the system is the one of the call before, and its solution has too few digits
};

/// Report of a factorisation with this outcome: definiteness, and negative eigenvalues where the solver counts them.
SystemReport describe(Outcome outcome, const Solver& solver);

/// The report of a system whose matrix has been factorised, with its solution by `solve` if that is what was asked.
template <typename Solve>
SystemReport with_solution(SystemReport factorized, const Asked& asked, const Solve& solve) {
  if (factorized.outcome != Outcome::ok) return factorized;
  if (factorized.definiteness == Definiteness::indefinite && !asked.if_indefinite) {
    factorized.outcome = Outcome::not_positive_definite;
    return factorized;
  }
  const SolveReport solved = solve();
  factorized.outcome = solved.outcome;
  factorized.residual = solved.relative_residual;
  if (solved.outcome == Outcome::not_positive_definite) factorized.definiteness = Definiteness::indefinite;
  return factorized;
}

}  // namespace itr::linear
