// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "energy/increment.hpp"
#include "itr/core.hpp"

namespace itr {

/// Conditions that a term holds by an augmented Lagrangian: a solve is repeated with new multipliers until they are met
/// (Hestenes 1969; Powell 1969).
class Constraint {
 public:
  virtual ~Constraint() = default;
  /// By which part of the largest force those of `at` are off the multipliers; 0 where only round-off keeps conditions open.
  virtual double error_at(const Increment& at) const = 0;
  /// Makes the forces at `at` the multipliers.
  virtual void update(const Increment& at) = 0;
  virtual void stiffen(double factor) = 0;
  /// Says what is open at `at`, for a step that fails.
  virtual std::string describe(const Increment& at, const Units& units) const = 0;
};

}  // namespace itr
