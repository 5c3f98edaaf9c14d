// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "defaults.hpp"
#include "energy/elastic/law_table.hpp"
#include "function.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

/// How the laws are called, and which keys beside type, id and rho they have.
struct LawName {
  std::string type;
  MaterialLaw law;
  std::vector<std::string> keys;
  const LawRow* row = nullptr;  ///< of a law that may be summed
};

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

bool is_axisymmetric(const Node& node) { return Node(node.document())["axisymmetric"].boolean(false); }
/// The scene, where laws are those of space.
std::string in_space(const Node& node) { return is_axisymmetric(node) ? "an axisymmetric scene" : "a 3D scene"; }

/// Reads the law of an entry, one of the terms of a sum if it is `in_sum`. Throws InputError for keys of other laws.
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

/// A scalar of a material and what it must be. It outlives the scene that it was read from.
struct Requirement {
  ScalarValue value;
  bool (*is_met)(double);
  InputError::Parts parts;  ///< file, pointer, the value's text, and what is expected
  double unit, length;      ///< of the value, of places, in SI units

  void check(const Vec<3>& X) const {
    const double here = value(X);
    if (std::isfinite(here) && is_met(here)) return;
    InputError::Parts wrong = parts;
    if (value.function) {
      std::ostringstream found;
      found << parts.found << ", which is " << here / unit << " at X = (" << X.transpose() / length << ")";
      wrong.found = found.str();
    }
    throw InputError(wrong);
  }
};

bool is_positive(double value) { return value > 0; }
bool is_poisson_ratio(double value) { return value > -1 && value < 0.5; }

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
    default:
      return true;
  }
}
const char* words_of(LawCoefficient::Range range) {
  constexpr const char* kWords[] = {"a number",           "a number > 0",         "a number that is not 0",
                                    "a number of [0, 1]", "a number of [0, 1/3]", "a number of (-1, 0.5)"};
  return kWords[static_cast<std::size_t>(range)];
}

/// The value must meet `is_met`: at once if it is constant, else wherever it is used.
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

/// Reads laws of the table, alone or in a MaterialSum.
class SumReader {
 public:
  SumReader(const Node& node, int dimension) : node_(node), dimension_(dimension) {}

  /// `invariants`: their dimension where the sum is not in plane stress.
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
  /// Lengths of directions.
  std::vector<Requirement>& requirements() { return requirements_; }

 private:
  LawSum::Term read_term(const Node& node, const LawRow& row, bool in_sum, const LawSum& sum) {
    LawSum::Term term{&row, read_coefficients(node, row, in_sum, sum.dimension)};
    if (std::string_view(row.type) == "AMIPS" && !node["use_rest_pose"].boolean(false))
      node["use_rest_pose"].fail("true: else the energy would depend on the mesh, which remeshing changes");
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
  std::vector<Requirement> requirements_;
};

class MaterialReader {
 public:
  /// `is_polyfem`: as PolyFEM, which has invariants of two dimensions in 2D. `has_patches`: nearly incompressible bodies
  /// average their volume.
  MaterialReader(const Node& node, int dimension, bool is_polyfem, bool has_patches)
      : node_(node), dimension_(dimension), shear_factor_(is_polyfem ? 2 : 1), has_patches_(has_patches) {
    const LawName& law = read_law(node, false);
    material_.law = law.law;
    if (law.law == MaterialLaw::mooney_rivlin)
      read_mooney_rivlin();
    else if (law.law == MaterialLaw::own)
      read_sum(law, is_polyfem ? dimension : 3);
    else if (node.has("elasticity_tensor"))
      read_tensor();
    else if (node.has("lambda") || node.has("mu"))
      read_lame();
    else
      read_moduli();
    // An isotropic law is the same in all directions.
    if ((law.law == MaterialLaw::linear || law.law == MaterialLaw::saint_venant_kirchhoff) && has_directions())
      read_directions();
    require("rho", read_scalar(node["rho"], 1), is_positive, "a number > 0");
    material_.density = requirements_.back().value.constant;
    material_.density_at = requirements_.back().value.function;
  }

  /// At the barycenters of the elements that have the material.
  Material checked(const std::vector<Vec<3>>& points, std::vector<std::string>& warnings) const {
    for (const Requirement& requirement : requirements_)
      if (requirement.value.function)
        for (const Vec<3>& X : points) requirement.check(X);
    const auto largest = [&](const SpaceFunction& f, double constant) {
      if (!f) return constant;
      double most = -1;
      for (const Vec<3>& X : points) most = std::max(most, f(X));
      return most;
    };
    Material material = material_;
    if (lambda_) set_lame(points, material, warnings);
    // Remeshing and quadrature ask at other points than these.
    const auto guard = [&](SpaceFunction& f) {
      if (!f) return;
      f = [f, requirements = requirements_](const Vec<3>& X) {
        for (const Requirement& requirement : requirements)
          if (requirement.value.function) requirement.check(X);
        return f(X);
      };
    };
    guard(material.youngs_modulus_at);
    guard(material.poisson_ratio_at);
    guard(material.density_at);
    material.youngs_modulus = largest(material.youngs_modulus_at, material.youngs_modulus);
    material.poisson_ratio = largest(material.poisson_ratio_at, material.poisson_ratio);
    material.density = largest(material.density_at, material.density);
    material.volume = read_volume(material);
    return material;
  }

 private:
  void require(const char* key, ScalarValue value, bool (*is_met)(double), const char* expected) {
    requirements_.push_back(requirement_of(node_[key], std::move(value), is_met, expected));
  }

  VolumeForm read_volume(const Material& material) const {
    static const std::vector<std::string> forms = {"pointwise", "patches"};
    const Node volume = node_["volume"];
    const bool by_default = has_patches_ && is_nearly_incompressible(material, dimension_);
    const auto form = static_cast<VolumeForm>(volume.choice(forms, by_default ? 1 : 0));
    if (form == VolumeForm::patches && !may_average_volume(material, dimension_))
      volume.fail("\"patches\" for a law without a part U(det F), with moduli that vary, or in plane stress",
                  "\"pointwise\" there");
    return form;
  }

  ScalarValue read_required(const char* key) const {
    if (!node_.has(key)) node_[key].fail("a number");
    return read_scalar(node_[key], 0);
  }

  double read_number(const char* key) const {
    const ScalarValue value = read_required(key);
    if (value.function) node_[key].fail("a constant: E, nu, lambda, mu and rho may vary");
    return value.constant;
  }

  void read_moduli() {
    const ScalarValue E = read_required("E"), nu = read_required("nu");
    material_.youngs_modulus = E.constant;
    material_.poisson_ratio = nu.constant;
    material_.youngs_modulus_at = E.function;
    material_.poisson_ratio_at = nu.function;
    read_plane_strain();
    require("E", E, is_positive, "a number > 0");
    require("nu", nu, is_poisson_ratio, "a number of (-1, 0.5)");
  }

  void read_plane_strain() {
    material_.plane_strain = node_["plane_strain"].boolean(false);
    if (material_.plane_strain && dimension_ == 3)
      node_["plane_strain"].fail("true in " + in_space(node_), "it in a plane only");
  }

  void read_lame() {
    if (node_.has("E") || node_.has("nu")) node_.fail("E and nu, or lambda and mu, not both");
    for (const char* key : {"lambda", "mu"})
      if (!node_.has(key)) node_[key].fail("both of lambda and mu");
    read_plane_strain();
    lambda_ = read_required("lambda");
    mu_ = read_required("mu");
    require("mu", *mu_, is_positive, "a number > 0");
    const bool in_plane = dimension_ == 2 && !material_.plane_strain;
    // A multiple of the bulk modulus over a positive number, so that the check has one value to show.
    const auto bulk = [lambda = *lambda_, mu = *mu_, in_plane](const Vec<3>& X) {
      return in_plane ? lambda(X) + mu(X) : 3 * lambda(X) + 2 * mu(X);
    };
    const bool varies = lambda_->function || mu_->function;
    require("lambda", {bulk(Vec<3>::Zero()), varies ? SpaceFunction(bulk) : SpaceFunction()}, is_positive,
            in_plane ? "lambda + mu > 0" : "3 lambda + 2 mu > 0");
  }

  /// Whether lambda and mu are those of no material in plane stress: its nu would be 0.5 or more.
  bool is_beyond_plane_stress(const std::vector<Vec<3>>& points) const {
    const auto is_beyond = [&](const Vec<3>& X) { return (*lambda_)(X) >= 2 * (*mu_)(X); };
    if (!lambda_->function && !mu_->function) return is_beyond(Vec<3>::Zero());
    return std::any_of(points.begin(), points.end(), is_beyond);
  }

  /// Sets E and nu that give lambda and mu back: energies take these as they are given.
  void set_lame(const std::vector<Vec<3>>& points, Material& material, std::vector<std::string>& warnings) const {
    if (dimension_ == 2 && !material.plane_strain && is_beyond_plane_stress(points)) {
      material.plane_strain = true;
      const std::string text =
          node_["lambda"].pointer() + ": of 2 mu or more, which no material has in plane stress: taken as plane strain";
      if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
    }
    const bool is_plane_stress = dimension_ == 2 && !material.plane_strain;
    const auto poisson = [lambda = *lambda_, mu = *mu_, is_plane_stress](const Vec<3>& X) {
      return lambda(X) / (is_plane_stress ? lambda(X) + 2 * mu(X) : 2 * (lambda(X) + mu(X)));
    };
    const auto young = [mu = *mu_, poisson](const Vec<3>& X) { return 2 * mu(X) * (1 + poisson(X)); };
    if (lambda_->function || mu_->function) {
      material.youngs_modulus_at = young;
      material.poisson_ratio_at = poisson;
    } else {
      material.youngs_modulus = young(Vec<3>::Zero());
      material.poisson_ratio = poisson(Vec<3>::Zero());
    }
  }

  /// Moduli, and the E and nu of small strains: those of shear 2 (c1 + c2) and bulk k + 2 d1.
  void read_mooney_rivlin() {
    MooneyRivlinModuli& m = material_.mooney_rivlin;
    const bool has_three = node_["type"].string("") == "MooneyRivlin3Param";
    m.c1 = read_number("c1");
    m.c2 = read_number("c2");
    (has_three ? m.volume_d : m.log_k) = read_number(has_three ? "d1" : "k");
    if (has_three) m.c3 = read_number("c3");
    const double shear = 2 * (dimension_ == 3 ? m.c1 + m.c2 : m.c1 - m.c3), bulk = m.log_k + 2 * m.volume_d;
    if (!(shear > 0)) node_["c1"].fail(dimension_ == 3 ? "c1 + c2 > 0" : "c1 - c3 > 0 (in 2D the second invariant is 1)");
    if (!(bulk > 0)) node_[has_three ? "d1" : "k"].fail("a number > 0");
    material_.youngs_modulus = 9 * bulk * shear / (3 * bulk + shear);
    material_.poisson_ratio = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear));
  }

  /// The sum, and E and nu of small strains without fibres.
  void read_sum(const LawName& law, int invariants) {
    SumReader reader(node_, dimension_);
    LawSum sum = reader.read(law, invariants);
    const auto [shear, bulk] = rest_moduli(sum);
    const auto refuse = [&](const char* what, double found) {
      std::ostringstream text;
      text << "a " << what << " modulus of " << found / node_.document().units.factor("Pa") << " at rest";
      node_.fail(text.str(), "one > 0" + std::string(law.row ? "" : " of the sum"));
    };
    if (!(shear > 0)) refuse("shear", shear);
    if (!(bulk > 0)) refuse("bulk", bulk);
    material_ = material_of(sum, dimension_);
    const auto has_share = [](const LawSum::Term& term) { return static_cast<bool>(term.share); };
    if (std::any_of(sum.terms.begin(), sum.terms.end(), has_share)) {
      material_.own_at = [own = std::static_pointer_cast<const LawSum>(material_.own)](double t) {
        auto at_t = std::make_shared<LawSum>(*own);
        at_t->time = t;
        return at_t;
      };
      ask_for_each_place();
    }
    for (Requirement& requirement : reader.requirements()) {
      if (requirement.value.function) ask_for_each_place();
      requirements_.push_back(std::move(requirement));
    }
  }

  /// A modulus that varies makes everybody ask for the law of each place.
  void ask_for_each_place() {
    material_.youngs_modulus_at = [E = material_.youngs_modulus](const Vec<3>&) { return E; };
  }

  /// A law of all anisotropy by its entries, turned by a matrix of directions.
  void read_tensor() {
    const Node list = node_["elasticity_tensor"];
    for (const char* key : {"E", "nu", "lambda", "mu"})
      if (node_.has(key)) node_[key].fail("it beside elasticity_tensor", "one of the two");
    const MatrixX C = stiffness_of(list, list.numbers());
    if (!(C.selfadjointView<Eigen::Upper>().eigenvalues().minCoeff() > 0))
      list.fail(abbreviate(list.json()) + ", of a stiffness that is not positive definite", "one that is");
    material_ = tensor_material(has_directions() ? turned(C, read_directions()) : C, material_.law == MaterialLaw::linear);
  }

  MatrixX stiffness_of(const Node& list, const std::vector<double>& entries) const {
    const Eigen::Index rows = dimension_ == 2 ? 3 : 6;
    MatrixX C = MatrixX::Zero(rows, rows);
    if (static_cast<Eigen::Index>(entries.size()) == rows * (rows + 1) / 2) {  // row by row of the upper triangle
      for (Eigen::Index i = 0, k = 0; i < rows; ++i)
        for (Eigen::Index j = i; j < rows; ++j, ++k) C(i, j) = C(j, i) = entries[static_cast<std::size_t>(k)];
      return C;
    }
    // PolyFEM's shear moduli in the orthotropic form count twice.
    const double shears = shear_factor_;
    if (dimension_ == 2 && entries.size() == 4) {
      const double E1 = entries[0], E2 = entries[1], nu12 = entries[2];
      C.topLeftCorner(2, 2) << 1 / E1, -nu12 / E1, -nu12 / E1, 1 / E2;
      C(2, 2) = 1 / (shears * entries[3]);
    } else if (dimension_ == 3 && entries.size() == 9) {
      const double E1 = entries[0], E2 = entries[1], E3 = entries[2], nu12 = entries[3], nu13 = entries[4],
                   nu23 = entries[5];
      C.topLeftCorner(3, 3) << 1 / E1, -nu12 / E1, -nu13 / E1, -nu12 / E1, 1 / E2, -nu23 / E2, -nu13 / E1, -nu23 / E2,
          1 / E3;
      for (int k = 0; k < 3; ++k) C(3 + k, 3 + k) = 1 / (shears * entries[static_cast<std::size_t>(6 + k)]);
    } else if (dimension_ == 3 && entries.size() == 5) {
      const double Et = entries[0], Ea = entries[1], nu_t = entries[2], nu_a = entries[3], Ga = entries[4];
      C.topLeftCorner(3, 3) << 1 / Et, -nu_t / Et, -nu_a / Ea, -nu_t / Et, 1 / Et, -nu_a / Ea, -nu_a / Ea, -nu_a / Ea,
          1 / Ea;
      C(3, 3) = C(4, 4) = 1 / Ga;
      C(5, 5) = 2 * (1 + nu_t) / Et;
    } else {
      list.fail(dimension_ == 2
                    ? "6 entries of the stiffness row by row, or 4: E1, E2, nu12, G12"
                    : "21 entries of the stiffness row by row, or 9: E1, E2, E3, nu12, nu13, nu23, G23, G13, G12, "
                      "or 5: E across the axis 3, E along it, nu across, nu along, G along");
    }
    return C.inverse();
  }

  bool has_directions() const { return node_.has("fiber_direction") && !node_["fiber_direction"].json().empty(); }
  /// An orthogonal matrix: its columns are the axes of the material.
  MatrixX read_directions() const {
    const Node list = node_["fiber_direction"];
    std::vector<double> entries;
    for (const Node& row : list.items())
      for (const Node& entry : row.items()) {
        if (!entry.json().is_number()) entry.fail("a number: directions that vary are of HGOFiber and ActiveFiber only");
        entries.push_back(entry.number(0));
      }
    const Eigen::Index n = dimension_;
    constexpr double kOrthogonal = 1e-6;
    if (static_cast<Eigen::Index>(entries.size()) == n * n) {
      const MatrixX R = Eigen::Map<const MatrixX>(entries.data(), n, n).transpose();
      if ((R * R.transpose() - MatrixX::Identity(n, n)).norm() < kOrthogonal) return R;
    }
    list.fail("the rows of an orthogonal matrix, of which the columns are the material's axes");
  }

  Node node_;
  int dimension_;
  double shear_factor_;
  bool has_patches_;
  Material material_;
  std::vector<Requirement> requirements_;
  std::optional<ScalarValue> lambda_, mu_;  ///< instead of E and nu
};

/// Barycenters of a body's elements.
template <int Dim>
std::map<int, std::vector<Vec<3>>> barycenters_by_body(const Mesh<Dim>& mesh) {
  std::map<int, std::vector<Vec<3>>> points;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    Vec<3> sum = Vec<3>::Zero();
    for (const int v : mesh.cell(c)) sum.template head<Dim>() += mesh.rest(v);
    points[mesh.body(c)].push_back(sum / (Dim + 1));
  }
  return points;
}

template <int Dim>
std::vector<int> elements_of(const Mesh<Dim>& mesh, int body) {
  std::vector<int> elements;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.body(c) == body) elements.push_back(c);
  return elements;
}

/// The bodies of an entry. A number that no cell has is one of a list for several meshes; a name that nothing has is wrong.
template <typename Bodies>
std::vector<std::pair<Label, int>> ids_of(const Node& entry, const LabelIds& bodies, const Bodies& of_mesh) {
  std::vector<std::pair<Label, int>> ids;
  const auto add = [&](const Label& label) {
    for (const int id : bodies.of(label)) ids.emplace_back(label, id);
    if (bodies.of(label).empty() && !of_mesh.contains(label.number)) ids.emplace_back(label, label.number);
  };
  for (const Node& id : entry["id"].items()) {
    const Label label = id.json().is_string() ? read_label(id, 0) : Label{id.integer(0)};
    if (!label.name.empty() && bodies.of(label).empty()) bodies.refuse(id, label, "the id of a body: ");
    add(label);
  }
  if (!entry.has("id")) add({0});
  return ids;
}

}  // namespace

LawSum read_law_sum(const Node& node, int dimension) {
  const LawName& law = read_law(node, false);
  if (law.law != MaterialLaw::own) node["type"].fail("a law from Yeoh on (docs/theory.md, \"Sums of laws\")");
  return SumReader(node, dimension).read(law, dimension);
}

template <int Dim>
std::map<int, Material> read_materials(const Node& root, const LabelIds& bodies, const Mesh<Dim>& mesh,
                                       std::vector<std::string>& warnings) {
  const Node node = root["materials"];
  if (!node.exists()) node.fail("the materials of the bodies");
  const auto points = barycenters_by_body(mesh);
  const bool has_inertia = root.has("time") && !root["time"]["quasistatic"].boolean(false);
  for (const Node& entry : node.items())
    if ((has_inertia || root["boundary_conditions"].has("rhs")) && !entry.has("rho"))
      warnings.push_back(entry["rho"].pointer() + ": not given, so it is 1 kg/m^3");
  const bool is_polyfem = is_polyfem_set(root);
  // Quadratic tetrahedra do without: their patches have 65 nodes, which takes several times as long at equal error.
  const Node order = root["space"]["discr_order"];
  const bool is_cheap = Dim == 2 || !order.exists() || order.json() == 1;
  const bool has_patches =
      averages_volume(root) && is_cheap && !root["space"]["remesh"]["enabled"].boolean(false) && !is_axisymmetric(root);
  const int space = is_axisymmetric(root) ? 3 : Dim;
  std::map<int, Material> materials;
  if (!node.json().is_array()) {  // one for everything, whatever its id
    MaterialReader reader(node, space, is_polyfem, has_patches);
    for (const auto& [body, of_body] : points) materials[body] = reader.checked(of_body, warnings);
    return materials;
  }
  std::map<int, Label> first_label;
  for (const Node& entry : node.items()) {
    MaterialReader reader(entry, space, is_polyfem, has_patches);
    for (const auto& [label, id] : ids_of(entry, bodies, points)) {
      const auto of_body = points.find(id);
      const Material material = reader.checked(of_body == points.end() ? std::vector<Vec<3>>{} : of_body->second, warnings);
      const auto [first, is_new] = first_label.emplace(id, label);
      if (!is_new && first->second != label)
        entry.fail("a second material, of \"" + text_of(label) + "\", for elements " + list_ids(elements_of(mesh, id)) +
                       ", which are in \"" + text_of(first->second) + "\" too",
                   "one for every body");
      if (!materials.insert_or_assign(id, material).second)
        warnings.push_back(entry.pointer() + ": replaces the material before it of id " + text_of(label));
    }
  }
  for (const auto& [body, of_body] : points)
    if (!materials.contains(body))
      node.fail("no material with the id " + std::to_string(body) + ", which elements " + list_ids(elements_of(mesh, body)) +
                    " have",
                "one for every body");
  return materials;
}

template std::map<int, Material> read_materials(const Node&, const LabelIds&, const Mesh<2>&, std::vector<std::string>&);
template std::map<int, Material> read_materials(const Node&, const LabelIds&, const Mesh<3>&, std::vector<std::string>&);

}  // namespace itr::scene
