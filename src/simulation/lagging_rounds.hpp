// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

/// How rounds of lagging end.
enum class RoundsEnd {
  settled,  ///< another round changes nothing, to the solver's tolerances
  asked,    ///< as many as the scene asks for, or forces to its tolerance
  most,     ///< as many as there may be
  cycle,    ///< an earlier round has been reached again
  stalled   ///< forces have not come nearer for long
};

const char* to_string(RoundsEnd end);

/// Aitken's factor for the relaxation of rounds: how far to go along what a round would change (Küttler & Wall 2008).
class Relaxation {
 public:
  /// The factor after a round that leaves lagged forces off by `residual` [N].
  double factor(VectorX residual);

 private:
  VectorX last_;  ///< residual
  double factor_ = 1;
};

/// Whether rounds that reached x, after `previous` (newest last), are over. Lagging need not converge: it can go round in
/// circles, and then every further round repeats an earlier one. `diagonal`: of the bodies [m].
std::optional<RoundsEnd> has_recurred(const VectorX& x, const std::vector<VectorX>& previous, double step_tolerance,
                                      double diagonal);

}  // namespace itr
