// SPDX-License-Identifier: MIT
#include "eigenstrain.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <sstream>
#include <string>

#include "energy/elastic/law_table.hpp"
#include "function.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

using Component = ScalarFunction<3>;

class EigenstrainReader {
 public:
  EigenstrainReader(const Node& entry, int dimension, const Material& material)
      : node_(entry["eigenstrain"]), dimension_(dimension), material_(material) {}

  void read(Material& material) {
    if (node_.json().is_array())
      read_list();
    else
      read_isotropic();
    if (is_zero_) return;
    const Units& units = node_.document().units;
    const InputError::Parts parts{node_.document().file.string(), node_.pointer(), abbreviate(node_.json()), expected_};
    material.eigenstrain_varies = uses_space_;
    material.eigenstrain = [components = components_, parts, length = units.factor("m"), second = units.factor("s")](
                               const Vec<3>& X, double t) {
      Mat<3> strain = Mat<3>::Zero();
      for (const auto& [i, j, component] : components) strain(i, j) = strain(j, i) = component.function(X, t);
      if (is_eigenstrain(strain)) return strain;
      std::ostringstream found;
      found << parts.found << ", which is ";
      const Eigen::IOFormat in_rows(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ");
      if (strain == Mat<3>(strain(0, 0) * Mat<3>::Identity()))
        found << strain(0, 0);
      else
        found << "(" << strain.format(in_rows) << ")";
      found << fmt::format(" at X = ({:g}), t = {:g}", fmt::join(Vec<3>(X / length), ", "), t / second);
      InputError::Parts wrong = parts;
      wrong.found = found.str();
      throw InputError(wrong);
    };
    if (is_constant_) material.eigenstrain(Vec<3>::Zero(), 0);
  }

 private:
  struct Entry {
    int i, j;
    Component component;
  };

  /// Whether it is not 0.
  bool add(const Node& value, int i, int j) {
    Component component = read_scalar_function<3>(value, value["no such key"]);
    is_zero_ = is_zero_ && component.is_zero;
    is_constant_ = is_constant_ && value.json().is_number();
    uses_space_ = uses_space_ || component.uses_space;
    if (component.is_zero) return false;
    components_.push_back({i, j, std::move(component)});
    return true;
  }

  void read_isotropic() {
    if (dimension_ == 2 && material_.law == MaterialLaw::own && !sum_of(material_))
      node_.fail("one number for an elasticity_tensor of the plane, which does not say what a strain across it does",
                 "a list of two rows");
    for (int i = 0; i < 3; ++i) add(node_, i, i);
    expected_ = "a number > -1";
  }

  void read_list() {
    const std::vector<Node> rows = node_.items();
    const bool may_have_two = dimension_ == 2;
    if (rows.size() != 3 && !(may_have_two && rows.size() == 2))
      node_.fail(may_have_two ? "two or three rows, or as many numbers" : "three rows, or three numbers");
    const bool is_diagonal = !rows[0].json().is_array();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto k = static_cast<int>(i);
      if (is_diagonal) {
        add_checked(rows[i], k, k);
        continue;
      }
      const std::vector<Node> row = rows[i].json().is_array() ? rows[i].items() : std::vector<Node>();
      if (row.size() != rows.size()) rows[i].fail("a row of " + std::to_string(rows.size()) + " components");
      for (std::size_t j = 0; j <= i; ++j) read_component(rows, row, i, j);
    }
    expected_ = "principal values > -1";
  }

  void read_component(const std::vector<Node>& rows, const std::vector<Node>& row, std::size_t i, std::size_t j) {
    const Node other = rows[j].items()[i];
    if (row[j].json() != other.json())
      row[j].fail(abbreviate(row[j].json()) + ", but " + abbreviate(other.json()) + " in " + other.pointer(),
                  "a symmetric tensor");
    add_checked(row[j], static_cast<int>(i), static_cast<int>(j));
  }

  /// Adds a component of a list, which may be other than 0 only where the law has it.
  void add_checked(const Node& value, int i, int j) {
    if (!add(value, i, j) || i < 2) return;
    if (j == 2) return check_across(value);
    if (dimension_ == 2 || is_axisymmetric(node_)) value.fail("a shear out of the plane", "0");
  }

  /// Refuses a strain across the plane that nothing would come of.
  void check_across(const Node& value) const {
    if (dimension_ == 3) return;
    const LawSum* sum = sum_of(material_);
    if (sum ? sum->dimension == 3 : material_.plane_strain) return;
    value.fail("a strain across the plane, for a law " +
                   std::string(sum || material_.law == MaterialLaw::own || material_.law == MaterialLaw::mooney_rivlin
                                   ? "of the plane alone"
                                   : "of plane stress, which does not know of one"),
               "0");
  }

  Node node_;
  int dimension_;
  const Material& material_;
  std::vector<Entry> components_;
  const char* expected_ = "";
  bool is_zero_ = true, is_constant_ = true, uses_space_ = false;
};

void add_leaves(const Node& value, std::vector<Node>& leaves) {
  if (!value.exists()) return;
  if (!value.json().is_array()) return leaves.push_back(value);
  for (const Node& item : value.items()) add_leaves(item, leaves);
}

}  // namespace

void read_eigenstrain(const Node& entry, int dimension, Material& material) {
  if (entry.has("eigenstrain")) EigenstrainReader(entry, dimension, material).read(material);
}

std::vector<Node> eigenstrain_components(const Node& root) {
  std::vector<Node> leaves;
  for (const Node& entry : root["materials"].items()) add_leaves(entry["eigenstrain"], leaves);
  return leaves;
}

}  // namespace itr::scene
