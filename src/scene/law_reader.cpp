// SPDX-License-Identifier: MIT
#include "law_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "defaults.hpp"
#include "energy/polyfem/ideal_cell.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

std::vector<LawName> name_laws() {
  const std::vector<std::string> linear = {"E", "nu", "lambda", "mu", "plane_strain"};
  std::vector<std::string> tensor = linear;
  tensor.insert(tensor.end(), {"elasticity_tensor", "fiber_direction"});
  std::vector<LawName> laws = {
      {"NeoHookean", MaterialLaw::neo_hookean, linear},
      {"LinearElasticity", MaterialLaw::linear, linear},
      {"HookeLinearElasticity", MaterialLaw::linear, tensor},  // from E and nu its C is that of the Lame parameters
      {"SaintVenant", MaterialLaw::saint_venant_kirchhoff, tensor},
      {"FixedCorotational", MaterialLaw::fixed_corotated, linear},
      {"MooneyRivlin", MaterialLaw::mooney_rivlin, {"c1", "c2", "k"}},
      {"MooneyRivlin3Param", MaterialLaw::mooney_rivlin, {"c1", "c2", "c3", "d1"}},
      {"MaterialSum", MaterialLaw::own, {"models", "plane_stress"}},
  };
  for (const LawRow& row : law_rows()) {
    LawName law{row.type, MaterialLaw::own, {"plane_stress"}, &row};
    for (const LawCoefficient& coefficient : row.coefficients) law.keys.emplace_back(coefficient.key);
    if (row.has_lame) law.keys.insert(law.keys.end(), {"E", "nu"});
    if (row.fibre) law.keys.emplace_back("fiber_direction");
    if (law.type == "AMIPS") law.keys.emplace_back("use_rest_pose");
    laws.push_back(law);
  }
  return laws;
}
const std::vector<LawName>& laws() {
  static const std::vector<LawName> all = name_laws();
  return all;
}

bool is_in(LawCoefficient::Range range, double value) {
  using Range = LawCoefficient::Range;
  switch (range) {
    case Range::positive:
      return value > 0;
    case Range::not_zero:
      return value != 0;
    case Range::share:
      return value >= 0 && value <= 1;
    case Range::third:
      return value >= 0 && value <= 1.0 / 3;
    case Range::compressible:
      return is_poisson_ratio(value);
    case Range::above_one:
      return value > 1;
    default:
      return true;
  }
}
const char* words_of(LawCoefficient::Range range) {
  constexpr const char* kWords[] = {"a number",           "a number > 0",         "a number that is not 0",
                                    "a number of [0, 1]", "a number of [0, 1/3]", "a number of (-1, 0.5)",
                                    "a number > 1"};
  return kWords[static_cast<std::size_t>(range)];
}

class SumReader {
 public:
  SumReader(const Node& node, int dimension, std::vector<Requirement>& requirements)
      : node_(node), dimension_(dimension), requirements_(requirements) {}

  LawSum read(const LawName& law, int invariants) {
    LawSum sum;
    sum.is_plane_stress = node_["plane_stress"].boolean(false);
    if (sum.is_plane_stress && dimension_ == 3)
      node_["plane_stress"].fail("true in " + in_space(node_), "it in a plane only");
    sum.dimension = sum.is_plane_stress ? 3 : invariants;
    if (law.row) {
      sum.terms.push_back(read_term(node_, *law.row, false, sum));
      return sum;
    }
    if (node_["models"].items().empty()) node_["models"].fail("a list of laws");
    for (const Node& model : node_["models"].items())
      sum.terms.push_back(read_term(model, *read_law(model, true).row, true, sum));
    return sum;
  }

 private:
  LawSum::Term read_term(const Node& node, const LawRow& row, bool in_sum, const LawSum& sum) {
    LawSum::Term term{&row, read_coefficients(node, row, in_sum, sum.dimension)};
    if (std::string_view(row.type) == "AMIPS" && !node["use_rest_pose"].boolean(false)) {
      const Node pose = node["use_rest_pose"];
      if (in_sum) pose.fail("true in a sum");
      if (sum.is_plane_stress) pose.fail("true in plane stress");
      if (!is_polyfem_set(Node(node.document())))
        pose.fail("true: else the energy depends on the mesh, which only PolyFEM's set of defaults does");
      term.row = &ideal_cell_law();
    }
    if (!row.fibre) return term;
    if (is_activation(node["activation"])) term.share = read_share(node["activation"]);
    if (sum.is_plane_stress) node_["plane_stress"].fail("true, with fibres", "false: fibres are in plane strain only");
    term.direction = read_direction(node["fiber_direction"]);
    return term;
  }

  /// Whether it is an expression, which may vary in space and time.
  static bool is_activation(const Node& value) {
    return value.exists() && value.json().is_string() && value.pointer().ends_with("/activation");
  }
  static std::function<double(const Vec<3>&, double)> read_share(const Node& node) {
    InputError::Parts parts{node.document().file.string(), node.pointer(), abbreviate(node.json()), "values of [0, 1]"};
    return [f = read_scalar_function<3>(node, node["no such key"]).function, parts](const Vec<3>& X, double t) {
      const double share = f(X, t);
      if (share >= 0 && share <= 1) return share;
      InputError::Parts wrong = parts;
      wrong.found = fmt::format("{}, which is {} somewhere", parts.found, share);
      throw InputError(wrong);
    };
  }

  /// As the row lists them.
  static LawValues read_coefficients(const Node& node, const LawRow& row, bool in_sum, int dimension) {
    LawValues values;
    if (row.has_lame && (node.has("E") || node.has("nu"))) {
      if (node.has("lambda") || node.has("mu")) node.fail("E and nu, or lambda and mu, not both");
      const double E = read_in_range(node["E"], LawCoefficient::Range::positive);
      const double nu = read_in_range(node["nu"], LawCoefficient::Range::compressible);
      values = {{Material{.plane_strain = dimension == 3}.lame_lambda(E, nu, dimension)}, {Material::lame_mu(E, nu)}};
    }
    for (const LawCoefficient& coefficient : std::span(row.coefficients).subspan(values.size())) {
      const Node value = node[coefficient.key];
      if (is_activation(value)) {
        values.push_back({1});
        continue;
      }
      if (!value.exists() && coefficient.fallback) {
        values.push_back({*coefficient.fallback});
      } else if (!value.exists() && in_sum && std::string_view(coefficient.key) == "K") {
        values.push_back({0});
      } else if (coefficient.is_list) {
        if (value.items().empty()) value.fail("a list of numbers");
        values.emplace_back();
        for (const Node& item : value.items()) values.back().push_back(read_in_range(item, coefficient.range));
        if (!coefficient.has_own_length && values.back().size() != values.front().size())
          value.fail("a list of length " + std::to_string(values.back().size()),
                     "that of " + std::string(row.coefficients[0].key) + ": " + std::to_string(values.front().size()));
      } else {
        values.push_back({read_in_range(value, coefficient.range)});
      }
    }
    return values;
  }

  static double read_in_range(const Node& node, LawCoefficient::Range range) {
    if (!node.exists()) node.fail(words_of(range));
    const ScalarValue value = read_scalar(node, 0);
    if (value.function) node.fail(std::string(words_of(range)) + ", a constant");
    if (!std::isfinite(value.constant) || !is_in(range, value.constant)) node.fail(words_of(range));
    return value.constant;
  }

  /// A fibre's direction, scaled to length 1. In 2D it may have a component across the plane.
  std::function<Vec<3>(const Vec<3>&)> read_direction(const Node& node) {
    const std::vector<Node> items = node.items();
    if (static_cast<int>(items.size()) < dimension_ || items.size() > 3)
      node.fail("the fibres' direction: a number or an expression for each component");
    std::array<ScalarValue, 3> components;
    bool varies = false;
    for (std::size_t c = 0; c < items.size(); ++c) {
      components[c] = read_scalar(items[c], 0);
      varies = varies || components[c].function;
    }
    const auto at = [components](const Vec<3>& X) { return Vec<3>(components[0](X), components[1](X), components[2](X)); };
    const SpaceFunction length = [at](const Vec<3>& X) { return at(X).norm(); };
    requirements_.push_back(requirement_of(node, {length(Vec<3>::Zero()), varies ? length : SpaceFunction()}, is_positive,
                                           "a direction of length > 0"));
    return [at, wanted = requirements_.back()](const Vec<3>& X) {
      const Vec<3> direction = at(X);
      const double length = direction.norm();
      if (!(length > 0 && std::isfinite(length))) wanted.check(X);
      return Vec<3>(direction / length);
    };
  }

  Node node_;
  int dimension_;
  std::vector<Requirement>& requirements_;  ///< on lengths of directions, too
};

}  // namespace

const LawName& read_law(const Node& node, bool in_sum) {
  if (!node.json().is_object()) node.fail("a material");
  if (!node.has("type")) node["type"].fail("the material law");
  std::vector<const LawName*> known;
  std::vector<std::string> types;
  for (const LawName& law : laws()) {
    if (law.row ? law.row->only_in_sums && !in_sum : in_sum) continue;
    known.push_back(&law);
    types.push_back(law.type);
  }
  const LawName& law = *known[static_cast<std::size_t>(node["type"].choice(types, 0))];
  const auto has = [&](const std::string& key) {
    return std::find(law.keys.begin(), law.keys.end(), key) != law.keys.end();
  };
  for (const LawName& other : laws())
    for (const std::string& key : other.keys)
      if (node.has(key) && (!has(key) || (in_sum && key == "plane_stress")))
        node[key].fail("a key that " + law.type + " does not have" + (in_sum ? " in a sum" : ""), "no such key");
  return law;
}

void Requirement::check(const Vec<3>& X) const {
  const double here = value(X);
  if (std::isfinite(here) && is_met(here)) return;
  InputError::Parts wrong = parts;
  if (value.function)
    wrong.found =
        fmt::format("{}, which is {:g} at X = ({:g})", parts.found, here / unit, fmt::join(Vec<3>(X / length), ", "));
  throw InputError(wrong);
}

Requirement requirement_of(const Node& node, ScalarValue value, bool (*is_met)(double), const char* expected) {
  const Units& units = node.document().units;
  Requirement requirement{
      std::move(value),
      is_met,
      {node.document().file.string(), node.pointer(), node.exists() ? abbreviate(node.json()) : "nothing", expected},
      units.factor(node.unit()),
      units.factor("m")};
  if (!requirement.value.function) requirement.check(Vec<3>::Zero());
  return requirement;
}

std::string in_space(const Node& node) { return is_axisymmetric(node) ? "an axisymmetric scene" : "a 3D scene"; }

LawSum read_sum_of_laws(const Node& node, const LawName& law, int dimension, int invariants,
                        std::vector<Requirement>& requirements) {
  return SumReader(node, dimension, requirements).read(law, invariants);
}

}  // namespace itr::scene
