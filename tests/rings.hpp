// SPDX-License-Identifier: MIT
// Quarters of concentric rings between rollers on the axes, and Lame's press fit of two.
#pragma once

#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "itr/itr.hpp"
#include "simulation/cell_stress.hpp"

namespace itr {

struct Ring {
  double inner, outer;  ///< radii [m]
  int around, through;  ///< cells
};

/// Bodies 1, 2, ... in this order; facets on the axes have the tags 1 (x = 0) and 2 (y = 0).
inline Setup<2> quarter_rings(const std::vector<Ring>& rings) {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> bodies;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const auto& [inner, outer, around, through] = rings[r];
    const int first = static_cast<int>(rest.size());
    for (int i = 0; i <= through; ++i)
      for (int j = 0; j <= around; ++j) {
        const double angle = std::numbers::pi / 2 * j / around, radius = inner + (outer - inner) * i / through;
        rest.emplace_back(j == around ? 0 : radius * std::cos(angle), j == 0 ? 0 : radius * std::sin(angle));
      }
    for (int i = 0; i < through; ++i)
      for (int j = 0; j < around; ++j) {
        const int a = first + i * (around + 1) + j, b = a + 1, c = a + around + 1, d = c + 1;
        cells.push_back({a, c, d});
        cells.push_back({a, d, b});
        bodies.insert(bodies.end(), 2, static_cast<int>(r) + 1);
      }
  }
  Setup<2> setup;
  setup.mesh = Mesh<2>(rest, cells, bodies);
  for (const FacetId f : setup.mesh.live_facets())
    for (int c = 0; c < 2; ++c)
      if (setup.mesh.rest(setup.mesh.facet(f)[0])[c] == 0 && setup.mesh.rest(setup.mesh.facet(f)[1])[c] == 0)
        setup.mesh.set_facet_tag(f, 1 + c);
  for (int c = 0; c < 2; ++c) {
    DirichletCondition<2> roller{1 + c, {}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }};
    roller.components[static_cast<std::size_t>(c)] = true;
    setup.dirichlet.push_back(roller);
  }
  setup.remesh.curve.for_stability = false;  // rings of a quarter do not buckle
  return setup;
}

/// The pressure between rings a..b and b..c of one material in plane stress that overlap by so much of the radius [Pa].
inline double press_fit_pressure(double a, double b, double c, double E, double nu, double overlap) {
  const double outer = (c * c + b * b) / (c * c - b * b) + nu, inner = (b * b + a * a) / (b * b - a * a) - nu;
  return overlap * E / (b * (outer + inner));
}

/// The radial stress of a body at a radius, by the least squares fit of A + B / r^2 to its cells.
inline double mean_radial_stress(const Simulation<2>& simulation, int body, double at) {
  const auto& mesh = simulation.mesh();
  const std::vector<double> stress = cell_stress(simulation).cauchy;
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (mesh.body(c) != body) continue;
    const Vec<2> X = mesh.barycenter(c), e = X.normalized();
    Mat<2> s;
    for (int k = 0; k < 4; ++k) s(k / 2, k % 2) = stress[static_cast<std::size_t>(4 * c + k)];
    const double w = mesh.volume(c), x = 1 / X.squaredNorm(), y = e.dot(s * e);
    n += w;
    sx += w * x;
    sy += w * y;
    sxx += w * x * x;
    sxy += w * x * y;
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  return sy / n + slope * (1 / (at * at) - sx / n);
}

}  // namespace itr
