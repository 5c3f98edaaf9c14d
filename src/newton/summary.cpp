// SPDX-License-Identifier: MIT
#include <algorithm>

#include "newton/newton.hpp"

namespace itr {

const char* to_string(Termination termination) {
  switch (termination) {
    case Termination::gradient:
      return "gradient below tolerance";
    case Termination::step:
      return "step below tolerance";
    case Termination::decrement:
      return "Newton decrement below tolerance";
    case Termination::energy:
      return "energy change below tolerance";
    case Termination::round_off:
      return "converged to the round-off of forces, above the tolerances asked for";
    case Termination::saddle:
      return "the Hessian has negative eigenvalues, but no way along them lowers the energy";
    case Termination::iterations:
      return "out of iterations";
    case Termination::no_descent:
      return "no step lowers the energy";
    case Termination::infeasible:
      return "not feasible";
    case Termination::cancelled:
      return "cancelled";
    case Termination::lagging:
      return "loads do not settle";
  }
  return "";
}

void NewtonSummary::add_effort(const NewtonSummary& other) {
  if (iterations == 0) linear_residual = other.linear_residual;
  iterations += other.iterations;
  indefinite += other.indefinite;
  blocked += other.blocked;
  if (blocked_step.size() == 0) {
    blocked_from = other.blocked_from;
    blocked_step = other.blocked_step;
  }
  assembly_seconds += other.assembly_seconds;
  linear_seconds += other.linear_seconds;
  line_search_seconds += other.line_search_seconds;
  ccd_seconds += other.ccd_seconds;
}

}  // namespace itr
