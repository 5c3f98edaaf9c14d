// SPDX-License-Identifier: MIT
#include "function.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "expression.hpp"
#include "interpolation.hpp"
#include "polyfem/python_value.hpp"

namespace itr::scene {

namespace {

Expression parse_expression(const Node& node) {
  try {
    return Expression(node.string(""));
  } catch (const ExpressionError& error) {
    node.fail(abbreviate(node.json()) + ", with " + error.what(), "an expression");
  }
}

/// Place and time in the units of a scene, which its expressions are of; and where in the scene a value stands, for errors
/// long after it was read.
struct SceneUnits {
  double length = 1, time = 1;  ///< in SI units
  InputError::Parts value;      ///< file, pointer, the value's text, and what is expected
  explicit SceneUnits(const Node& node)
      : length(node.document().units.factor("m")),
        time(node.document().units.factor("s")),
        value{node.document().file.string(), node.pointer(), node.exists() ? abbreviate(node.json()) : "nothing",
              "a value there"} {}

  /// Throws InputError: the value is not finite at X and t.
  template <int Dim>
  [[noreturn]] void fail(const Vec<Dim>& X, double t) const {
    InputError::Parts parts = value;
    parts.found = fmt::format("{}, which has no finite value at X = ({:g}), t = {:g}", value.found,
                              fmt::join(Vec<Dim>(X / length), ", "), t / time);
    throw InputError(parts);
  }
  template <int Dim>
  Expression::Variables operator()(const Vec<Dim>& X, double t) const {
    return {X[0] / length, X[1] / length, Dim == 3 ? X[Dim - 1] / length : 0, t / time};
  }
};

/// One component: a number, an expression where there are variables in it, or a function of Python; times g(t).
struct Component {
  double constant = 0;
  double unit = 1;  ///< of the values of expressions and of Python
  std::optional<Expression> expression;
  std::function<double(double x, double y, double z, double t)> python;
  Interpolation scale;

  double operator()(const Expression::Variables& variables) const {
    double value = expression ? unit * (*expression)(variables) : constant;
    if (python) value = unit * python(variables.x, variables.y, variables.z, variables.t);
    return scale.is_one() ? value : value * scale(variables.t);
  }
  bool is_constant() const { return !expression && !python && (scale.is_one() || constant == 0); }
};

Component read_component(const Node& node) {
  Component component;
  if (node.json().is_number()) {
    component.constant = node.number(0);
  } else if (node.json().is_string()) {
    Expression expression = parse_expression(node);
    component.unit = node.document().units.factor(node.unit());
    if (expression.is_constant())
      component.constant = component.unit * expression({});
    else
      component.expression = std::move(expression);
  } else if (is_python_value(node.json())) {
    component.unit = node.document().units.factor(node.unit());
    component.python = read_python_value(node);
  } else {
    node.fail("a number, an expression, or a function of a Python file");
  }
  if (!std::isfinite(component.constant))
    node.fail(abbreviate(node.json()) + ", which has no finite value", "one with a value");
  return component;
}

template <int Dim>
std::array<Component, Dim> read_components(const Node& value) {
  if (!value.exists() || !value.json().is_array()) value.fail("a list of numbers or expressions");
  const std::vector<Node> values = value.items();
  std::array<Component, Dim> components;
  for (std::size_t c = 0; c < std::min<std::size_t>(Dim, values.size()); ++c) components[c] = read_component(values[c]);
  return components;
}

template <int Dim>
ValueFunction<Dim> combine(const std::array<Component, Dim>& components, const SceneUnits& units, double sign) {
  if (std::all_of(components.begin(), components.end(), [](const Component& c) { return c.is_constant(); })) {
    Vec<Dim> constant;
    for (int c = 0; c < Dim; ++c) constant[c] = sign * components[c].constant;
    return {[constant](const Vec<Dim>&, double) { return constant; }, constant.isZero(0)};
  }
  return {[components, units, sign](const Vec<Dim>& X, double t) {
            const Expression::Variables variables = units.operator()<Dim>(X, t);
            Vec<Dim> result;
            for (int c = 0; c < Dim; ++c) result[c] = sign * components[c](variables);
            if (!result.allFinite()) units.fail<Dim>(X, t);
            return result;
          },
          false};
}

}  // namespace

ScalarValue read_scalar(const Node& node, double fallback) {
  if (!node.exists() || !node.json().is_string()) return {node.number(fallback), {}};
  if (node.json().get<std::string>().ends_with(".txt"))
    node.fail(abbreviate(node.json()) + ", a file",
              "a number or an expression of place; ids give parts of a mesh their own");
  Expression expression = parse_expression(node);
  if (expression.uses_time()) node.fail(abbreviate(node.json()), "a value that does not change with time");
  const double unit = node.document().units.factor(node.unit());
  if (!expression.is_constant())
    return {0, [e = std::move(expression), unit, units = SceneUnits(node)](const Vec<3>& X) {
              return unit * e(units.operator()<3>(X, 0));
            }};
  const double value = unit * expression({});
  if (!std::isfinite(value)) node.fail("an expression with a finite value");
  return {value, {}};
}

template <int Dim>
ValueFunction<Dim> read_function(const Node& value, double sign) {
  return combine<Dim>(read_components<Dim>(value), SceneUnits(value), sign);
}

template <int Dim>
ValueFunction<Dim> read_function(const Node& value, const Node& interpolation) {
  std::array<Component, Dim> components = read_components<Dim>(value);
  const std::vector<Node> scales = interpolation.without_units().items();  // of the scene's time
  if (scales.empty()) return combine<Dim>(components, SceneUnits(value), 1);
  if (scales.size() > 1 && scales.size() < Dim) interpolation.fail("one entry, or one a component");
  for (std::size_t c = 0; c < Dim; ++c) components[c].scale = Interpolation(scales.size() == 1 ? scales[0] : scales[c]);
  return combine<Dim>(components, SceneUnits(value), 1);
}

template <int Dim>
ScalarFunction<Dim> read_scalar_function(const Node& value, const Node& interpolation) {
  if (!value.exists()) value.fail("a number or an expression");
  const std::vector<Node> scales = interpolation.without_units().items();  // of the scene's time
  if (scales.size() > 1) interpolation.fail("one entry: the value has one component");
  Component component = read_component(value);
  if (!scales.empty()) component.scale = Interpolation(scales[0]);
  if (component.is_constant())
    return {[constant = component.constant](const Vec<Dim>&, double) { return constant; }, component.constant == 0, false};
  return {[component, units = SceneUnits(value)](const Vec<Dim>& X, double t) {
            const double result = component(units.operator()<Dim>(X, t));
            if (!std::isfinite(result)) units.fail<Dim>(X, t);
            return result;
          },
          false, component.python || (component.expression && component.expression->uses_space())};
}

std::vector<double> find_kinks(const Node& value, const Node& interpolation, double begin, double end) {
  const double unit = value.document().units.factor("s");
  std::vector<double> found;
  const auto add = [&](const std::vector<double>& kinks, double factor) {
    for (const double kink : kinks)
      if (const double t = factor * kink; t > begin && t < end) found.push_back(t);
  };
  for (const Node& component : value.items())
    if (component.json().is_string()) add(parse_expression(component).kinks(begin / unit, end / unit), unit);
  for (const Node& factor : interpolation.without_units().items())
    add(Interpolation(factor).kinks(begin / unit, end / unit), unit);
  return found;
}

template <int Dim>
void check_defined(const SpaceTimeFunction<Dim>& function, const std::vector<Vec<Dim>>& points,
                   const std::vector<double>& times, const Node& value) {
  for (const double t : times)
    for (const Vec<Dim>& X : points)
      if (!function(X, t).allFinite()) SceneUnits(value).fail<Dim>(X, t);
}

#define ITR_INSTANTIATE(Dim)                                                                                           \
  template ValueFunction<Dim> read_function(const Node&, double);                                                      \
  template ValueFunction<Dim> read_function(const Node&, const Node&);                                                 \
  template ScalarFunction<Dim> read_scalar_function(const Node&, const Node&);                                         \
  template void check_defined(const SpaceTimeFunction<Dim>&, const std::vector<Vec<Dim>>&, const std::vector<double>&, \
                              const Node&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
