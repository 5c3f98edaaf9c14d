// SPDX-License-Identifier: MIT
// Vector values of a scene (docs/theory.md, "Conditions") into functions of rest position and time.
#pragma once

#include "itr/setup.hpp"
#include "node.hpp"

namespace itr::scene {

/// A number, or an expression of rest position.
struct ScalarValue {
  double constant = 0;
  SpaceFunction function;  ///< empty for a constant
  double operator()(const Vec<3>& X) const { return function ? function(X) : constant; }
};
ScalarValue read_scalar(const Node& node, double fallback);

template <int Dim>
struct ValueFunction {
  SpaceTimeFunction<Dim> function;
  bool is_zero = false;  ///< all components are the constant 0
};

/// Missing components are 0, extra ones are passed over; `sign` multiplies the value.
template <int Dim>
ValueFunction<Dim> read_function(const Node& value, double sign = 1);
/// Reads a function times a factor of time by component, or one for all; `interpolation` may be absent.
template <int Dim>
ValueFunction<Dim> read_function(const Node& value, const Node& interpolation);

/// Times from `begin` to `end` [s] at which such a value, or scalar value, is not smooth, as far as that follows from t
/// alone.
std::vector<double> find_kinks(const Node& value, const Node& interpolation, double begin, double end);

/// One component of the latter: `value` is a number or an expression.
template <int Dim>
struct ScalarFunction {
  std::function<double(const Vec<Dim>& X, double t)> function;
  bool is_zero = false;  ///< the constant 0
  bool uses_space = false;
};
template <int Dim>
ScalarFunction<Dim> read_scalar_function(const Node& value, const Node& interpolation);

/// Throws InputError at `value` if the function has no finite value at one of the points at one of the times.
template <int Dim>
void check_defined(const SpaceTimeFunction<Dim>& function, const std::vector<Vec<Dim>>& points,
                   const std::vector<double>& times, const Node& value);

}  // namespace itr::scene
