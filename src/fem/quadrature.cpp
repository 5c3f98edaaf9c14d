// SPDX-License-Identifier: MIT
// Points and weights: Gauss-Legendre; Strang and Fix (1973), Dunavant (1985) on triangles; Keast (1986), Walkington (2000)
// on tetrahedra.
#include "fem/quadrature.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "itr/core.hpp"

namespace itr {

namespace {

template <int Dim>
using Rule = std::vector<QuadraturePoint<Dim>>;

/// Adds all points whose coordinates are these in some order.
template <int Dim>
void add_orbit(std::array<double, Dim + 1> coordinates, double fraction, Rule<Dim>& rule) {
  std::sort(coordinates.begin(), coordinates.end());
  do {
    rule.push_back({coordinates, fraction});
  } while (std::next_permutation(coordinates.begin(), coordinates.end()));
}

Rule<1> make_rule(int degree, std::array<double, 2>) {
  Rule<1> rule;
  if (degree <= 1) {
    rule.push_back({{0.5, 0.5}, 1});
  } else if (degree <= 3) {
    const double near = 0.5 + 0.5 / std::sqrt(3.0);
    add_orbit<1>({near, 1 - near}, 0.5, rule);
  } else {
    const double near = 0.5 + 0.5 * std::sqrt(0.6);
    add_orbit<1>({near, 1 - near}, 5.0 / 18, rule);
    rule.push_back({{0.5, 0.5}, 8.0 / 18});
  }
  return rule;
}

Rule<2> make_rule(int degree, std::array<double, 3>) {
  Rule<2> rule;
  const auto add = [&](double a, double fraction) { add_orbit<2>({a, a, 1 - 2 * a}, fraction, rule); };
  const auto add_center = [&](double fraction) { rule.push_back({{1.0 / 3, 1.0 / 3, 1.0 / 3}, fraction}); };
  if (degree <= 1) {
    add_center(1);
  } else if (degree == 2) {
    add(1.0 / 6, 1.0 / 3);
  } else if (degree <= 4) {
    add(0.44594849091596488632, 0.22338158967801146570);
    add(0.09157621350977074346, 0.10995174365532186764);
  } else {
    const double root = std::sqrt(15.0);
    add_center(9.0 / 40);
    add((6 - root) / 21, (155 - root) / 1200);
    add((6 + root) / 21, (155 + root) / 1200);
  }
  return rule;
}

Rule<3> make_rule(int degree, std::array<double, 4>) {
  Rule<3> rule;
  const auto add = [&](double a, double fraction) { add_orbit<3>({a, a, a, 1 - 3 * a}, fraction, rule); };
  if (degree <= 1) {
    rule.push_back({{0.25, 0.25, 0.25, 0.25}, 1});
  } else if (degree == 2) {
    add((5 - std::sqrt(5.0)) / 20, 0.25);
  } else {  // degree 5
    add(0.31088591926330060980, 0.11268792571801585080);
    add(0.09273525031089122640, 0.07349304311636194934);
    const double a = 0.04550370412564964949;
    add_orbit<3>({a, a, 0.5 - a, 0.5 - a}, 0.04254602077708146643, rule);
  }
  return rule;
}

}  // namespace

template <int Dim>
const Rule<Dim>& quadrature(int degree) {
  static const auto rules = [] {
    std::array<Rule<Dim>, kMostQuadratureDegree> all;
    for (int d = 1; d <= kMostQuadratureDegree; ++d) all[d - 1] = make_rule(d, std::array<double, Dim + 1>{});
    return all;
  }();
  if (degree < 1 || degree > kMostQuadratureDegree)
    throw InputError({"", "quadrature", "degree " + std::to_string(degree), "1 to 5"});
  return rules[degree - 1];
}

namespace {

template <int Dim>
using Simplex = std::array<std::array<double, Dim + 1>, Dim + 1>;  ///< barycentric coordinates of its corners

template <int Dim>
std::array<double, Dim + 1> middle(const std::array<double, Dim + 1>& a, const std::array<double, Dim + 1>& b) {
  std::array<double, Dim + 1> result;
  for (int k = 0; k <= Dim; ++k) result[k] = (a[k] + b[k]) / 2;
  return result;
}

void refine(const Simplex<2>& s, std::vector<Simplex<2>>& children) {
  const auto m01 = middle<2>(s[0], s[1]), m12 = middle<2>(s[1], s[2]), m02 = middle<2>(s[0], s[2]);
  children.insert(children.end(), {Simplex<2>{s[0], m01, m02}, {m01, s[1], m12}, {m02, m12, s[2]}, {m01, m12, m02}});
}

void refine(const Simplex<3>& s, std::vector<Simplex<3>>& children) {
  const auto m01 = middle<3>(s[0], s[1]), m02 = middle<3>(s[0], s[2]), m03 = middle<3>(s[0], s[3]),
             m12 = middle<3>(s[1], s[2]), m13 = middle<3>(s[1], s[3]), m23 = middle<3>(s[2], s[3]);
  children.insert(children.end(), {Simplex<3>{s[0], m01, m02, m03},
                                   {m01, s[1], m12, m13},
                                   {m02, m12, s[2], m23},
                                   {m03, m13, m23, s[3]},
                                   {m01, m12, m02, m13},  // the octahedron, around its axis m02-m13
                                   {m01, m02, m03, m13},
                                   {m02, m12, m23, m13},
                                   {m02, m23, m03, m13}});
}

/// Degree 3: 2D corners, midpoints of edges and the centre; 3D corners and centres of faces.
Rule<2> closed_rule(std::array<double, 3>) {
  Rule<2> rule;
  add_orbit<2>({1, 0, 0}, 1.0 / 20, rule);
  add_orbit<2>({0.5, 0.5, 0}, 2.0 / 15, rule);
  rule.push_back({{1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 20});
  return rule;
}
Rule<3> closed_rule(std::array<double, 4>) {
  Rule<3> rule;
  add_orbit<3>({1, 0, 0, 0}, 1.0 / 40, rule);
  add_orbit<3>({1.0 / 3, 1.0 / 3, 1.0 / 3, 0}, 9.0 / 40, rule);
  return rule;
}

template <int Dim>
Rule<Dim> on_refined(const Rule<Dim>& rule, int refinements) {
  Simplex<Dim> whole{};
  for (int k = 0; k <= Dim; ++k) whole[k][k] = 1;
  std::vector<Simplex<Dim>> parts = {whole};
  for (int i = 0; i < refinements; ++i) {
    std::vector<Simplex<Dim>> finer;
    for (const auto& part : parts) refine(part, finer);
    parts = std::move(finer);
  }
  Rule<Dim> result;
  for (const auto& part : parts)
    for (const auto& point : rule) {
      std::array<double, Dim + 1> weights{};
      for (int corner = 0; corner <= Dim; ++corner)
        for (int k = 0; k <= Dim; ++k) weights[k] += point.weights[corner] * part[corner][k];
      result.push_back({weights, point.fraction / static_cast<double>(parts.size())});
    }
  return result;
}

}  // namespace

template <int Dim>
const Rule<Dim>& closed_quadrature(int level) {
  static const auto rules = [] {
    std::array<Rule<Dim>, kMostClosedLevel> all;
    for (int l = 0; l < kMostClosedLevel; ++l) all[l] = on_refined<Dim>(closed_rule(std::array<double, Dim + 1>{}), l);
    return all;
  }();
  if (level < 1 || level > kMostClosedLevel)
    throw InputError({"", "quadrature", "level " + std::to_string(level), "1 to " + std::to_string(kMostClosedLevel)});
  return rules[level - 1];
}

template const Rule<2>& closed_quadrature<2>(int);
template const Rule<3>& closed_quadrature<3>(int);
template const Rule<1>& quadrature<1>(int);
template const Rule<2>& quadrature<2>(int);
template const Rule<3>& quadrature<3>(int);

}  // namespace itr
