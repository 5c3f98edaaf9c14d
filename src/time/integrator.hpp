// SPDX-License-Identifier: MIT
// Implicit time integrators as minimisation: predictor x-hat, scaling alpha h^2, and how velocity and acceleration follow
// from new positions (docs/theory.md, "Time").
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "core/cell_history.hpp"
#include "itr/options.hpp"
#include "itr/types.hpp"

namespace itr {

/// Past states, newest first; interleaved fields of one mesh.
struct History {
  std::vector<VectorX> x;  ///< [m]
  std::vector<VectorX> v;  ///< [m/s]
  std::vector<VectorX> a;  ///< [m/s^2]; of Newmark, and of two states where steps are adaptive
  double dt = 0;           ///< of the step that led to x[0] [s]; 0: as long as the next one
  /// Newmark only: the next step is one of implicit Euler, which dissipates (see TimeOptions::energy_growth_limit).
  bool damp_next = false;
  std::shared_ptr<const CellHistory> viscous{};    ///< null: no body is viscoelastic
  std::shared_ptr<const CellHistory> softening{};  ///< null: no body softens
};

/// Requirement on the length of a step, whose square enters energies; and whether a number meets it.
inline constexpr const char* kStepLength = "a number > 0 of which a double holds the square";
inline bool is_step_length(double dt) { return dt > 0 && std::isnormal(dt * dt); }

/// The error in time that one step adds.
struct LocalError {
  VectorX x;  ///< [m]
  VectorX v;  ///< [m/s]; empty where the past has too few accelerations
};

class TimeIntegrator {
 public:
  explicit TimeIntegrator(const TimeOptions& options) : options_(options) {}

  /// How many past states the next step uses: BDF starts with order 1 and grows as states become available.
  int order(const History& history) const;
  /// Order of accuracy of the next step's velocities: 0 in statics, 1 for implicit Euler and the first step of BDF.
  int accuracy(const History& history) const;
  /// How many past states need to be kept.
  int depth() const;
  /// How many past accelerations need to be kept.
  int acceleration_depth() const;
  /// Whether the next step is one of the trapezoidal rule: no dissipation, so a bad step can create energy.
  bool is_trapezoidal(const History& history) const;
  bool uses_acceleration() const { return options_.integrator == Integrator::newmark; }
  /// h by the length of the step before; 1 where that is not known.
  double ratio(const History& history) const { return history.dt > 0 ? options_.dt / history.dt : 1; }

  /// x-hat: where the body flies without forces [m].
  VectorX predictor(const History& history) const;
  /// x-hat minus the newest positions, without the round-off of positions [m].
  VectorX predicted_increment(const History& history) const;
  /// alpha h^2 [s^2]; 1 for statics.
  double scaling(const History& history) const;
  /// dv/dx [1/s].
  double velocity_rate(const History& history) const;
  /// The positions at which the velocity would vanish: v = velocity_rate * (x - reference).
  VectorX velocity_reference(const History& history) const;

  /// Velocity at the positions x.
  VectorX velocity(const VectorX& x, const History& history) const;
  /// Velocity at the newest positions plus `increment`, without the round-off of positions.
  VectorX velocity_after(const VectorX& increment, const History& history) const;
  VectorX acceleration(const VectorX& v, const History& history) const;
  /// The leading term of the local error of a step of this increment, by differences of accelerations (order 2) or of
  /// velocities and accelerations (order 1).
  LocalError local_error(const VectorX& increment, const History& history) const;
  /// C of the local error C h^(p+1) d^(p+1)x/dt^(p+1), where p is `accuracy`.
  double error_constant(const History& history) const;
  /// Whether local_error knows it: not of BDF from order 3 on, nor of Newmark with damping.
  bool knows_local_error(const History& history) const;
  /// The part of x-hat by a step's local error: exact motions fulfil the formulas of the step up to minus that error.
  VectorX predictor_error(const LocalError& error, const History& history) const;
  /// Makes errors of past states, which are linear in each other as these are, those after a step with an error of its own:
  /// `of_x` are those of the new positions.
  void push_errors(const VectorX& of_x, const LocalError& error, History& errors) const;
  /// Makes x the newest state; `increment` is x minus the newest positions, before it was rounded.
  void push(VectorX x, const VectorX& increment, History& history) const;
  void push(const VectorX& x, History& history) const { push(x, x - history.x[0], history); }

 private:
  bool is_newmark(const History& history) const;
  VectorX reference_increment(const History& history) const;

  TimeOptions options_;
};

}  // namespace itr
