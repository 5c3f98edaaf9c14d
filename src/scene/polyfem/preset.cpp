// SPDX-License-Identifier: MIT
// PolyFEM's preset problem ElasticExact: the body forces and the displacements of the boundary that a given polynomial field
// of displacements needs, so that a solution shows the error of its mesh.
#include <array>
#include <cmath>
#include <span>

#include "../readers.hpp"
#include "mesh/facet_tags.hpp"

namespace itr::scene {

namespace {

/// factor * x^powers[0] y^powers[1] z^powers[2] in one row of the field.
struct Monomial {
  int row;
  double factor;
  std::array<int, 3> powers;
};
constexpr Monomial kPlane[] = {{0, 1, {0, 3, 0}}, {0, 1, {2, 0, 0}}, {0, 1, {1, 1, 0}},
                               {1, 3, {4, 0, 0}}, {1, 1, {1, 2, 0}}, {1, 1, {1, 0, 0}}};
constexpr Monomial kSpace[] = {{0, 1, {1, 1, 0}}, {0, 1, {2, 0, 0}},  {0, 1, {0, 3, 0}}, {0, 6, {0, 0, 1}},
                               {1, 1, {1, 0, 1}}, {1, -1, {0, 0, 3}}, {1, 1, {1, 2, 0}}, {1, 3, {4, 0, 0}},
                               {2, 1, {1, 1, 1}}, {2, 1, {0, 2, 2}},  {2, -2, {1, 0, 0}}};

/// The derivative by the coordinates `by` of a monomial at X.
template <int Dim>
double derivative(Monomial m, std::initializer_list<int> by, const Vec<Dim>& X) {
  for (const int c : by) m.factor *= m.powers[static_cast<std::size_t>(c)]--;
  if (m.factor == 0) return 0;
  for (int c = 0; c < Dim; ++c) m.factor *= std::pow(X[c], m.powers[static_cast<std::size_t>(c)]);
  return m.factor;
}

template <int Dim>
struct Field {
  Vec<Dim> u = Vec<Dim>::Zero();
  Mat<Dim> gradient = Mat<Dim>::Zero();
  std::array<Mat<Dim>, Dim> second;

  Field(const Vec<Dim>& X, double t) {
    second.fill(Mat<Dim>::Zero());
    const double scale = t / (Dim == 2 ? 50 : 80);
    for (Monomial m : Dim == 2 ? std::span<const Monomial>(kPlane) : std::span<const Monomial>(kSpace)) {
      m.factor *= scale;
      u[m.row] += derivative<Dim>(m, {}, X);
      for (int i = 0; i < Dim; ++i) {
        gradient(m.row, i) += derivative<Dim>(m, {i}, X);
        for (int j = 0; j < Dim; ++j) second[static_cast<std::size_t>(m.row)](i, j) += derivative<Dim>(m, {i, j}, X);
      }
    }
  }
};

}  // namespace

template <int Dim>
void read_preset_problem(const Node& root, const LabelIds& bodies, Setup<Dim>& setup) {
  const Node preset = root["preset_problem"];
  if (!preset.exists()) return;
  if (root.has("boundary_conditions")) preset.fail("it beside boundary_conditions", "one of the two");
  if (setup.mesh.is_axisymmetric()) preset.fail("it in an axisymmetric scene", "a field in the plane or in space");
  if (!root.document().units.is_si()) preset.fail("it with /units", "SI units");
  // PolyFEM's forces are those of a stiffness that is not turned.
  Document plain = root.document();
  const auto forget = [](Json& material) { material.erase("fiber_direction"); };
  Json& materials = plain.json["materials"];
  if (materials.is_object()) forget(materials);
  if (materials.is_array() && materials.size() != 1) root["materials"].fail("several beside preset_problem", "one material");
  if (materials.is_array()) forget(materials.front());
  std::vector<std::string> unused;
  const Material material = read_materials<Dim>(Node(plain), bodies, setup.mesh, unused).begin()->second;
  setup.body_acceleration = [material](const RestPoint<Dim>& X, double t) {
    const Field<Dim> field(X, t);
    // PolyFEM multiplies the force by the density, as it does an rhs.
    return holding_force<Dim>(material, X, field.gradient, field.second);
  };
  std::array<bool, Dim> all;
  all.fill(true);
  for (const int tag : facet_tags(setup.mesh))
    if (tag > 0) setup.dirichlet.push_back({tag, all, [](const RestPoint<Dim>& X, double t) { return Field<Dim>(X, t).u; }});
}

template void read_preset_problem<2>(const Node&, const LabelIds&, Setup<2>&);
template void read_preset_problem<3>(const Node&, const LabelIds&, Setup<3>&);

}  // namespace itr::scene
