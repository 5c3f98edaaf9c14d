// SPDX-License-Identifier: MIT
// Two bricks that are tied, with any meshes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "energy/tie.hpp"
#include "fem/cell_set.hpp"
#include "simulation/state.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

using Plane = Setup<2>;

inline constexpr int kBelow = 1, kLeft = 2, kFront = 3, kFree = 4, kAbove = 5, kOfA = 6, kOfB = 7;  ///< tags

/// Boxes of a grid over a brick, with simplices around their diagonals.
template <int Dim>
struct Brick {
  std::array<int, Dim> boxes;
  Vec<Dim> least, most;
};

template <int Dim>
void add(const Brick<Dim>& brick, int body, std::vector<Vec<Dim>>& rest, std::vector<std::array<int, Dim + 1>>& cells,
         std::vector<int>& bodies) {
  const int first = static_cast<int>(rest.size());
  std::array<int, Dim> stride;
  int points = 1, boxes = 1;
  for (int c = 0; c < Dim; ++c) {
    stride[c] = points;
    points *= brick.boxes[c] + 1;
    boxes *= brick.boxes[c];
  }
  for (int p = 0; p < points; ++p) {
    Vec<Dim> X;
    for (int c = 0; c < Dim; ++c) {
      const double part = static_cast<double>(p / stride[c] % (brick.boxes[c] + 1)) / brick.boxes[c];
      X[c] = brick.least[c] + part * (brick.most[c] - brick.least[c]);
    }
    rest.push_back(X);
  }
  for (int b = 0; b < boxes; ++b) {
    int corner = first, left = b;
    for (int c = 0; c < Dim; ++c) {
      corner += left % brick.boxes[c] * stride[c];
      left /= brick.boxes[c];
    }
    const auto at = [&](int i) {
      int v = corner;
      for (int c = 0; c < Dim; ++c) v += (i >> c & 1) * stride[c];
      return v;
    };
    if constexpr (Dim == 2) {
      cells.push_back({at(0), at(1), at(3)});
      cells.push_back({at(0), at(3), at(2)});
    } else {
      for (const auto& [i, j] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
        cells.push_back({at(0), at(i), at(j), at(7)});
    }
    bodies.resize(cells.size(), body);
  }
}

/// Body 1 below the plane at `height` of the last axis, body 2 above it. Both begin at the origin.
template <int Dim>
Mesh<Dim> two_bricks(const Brick<Dim>& a, const Brick<Dim>& b) {
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<int> bodies;
  add(a, 1, rest, cells, bodies);
  add(b, 2, rest, cells, bodies);
  Mesh<Dim> mesh(rest, cells, bodies);
  for (const FacetId f : mesh.live_facets()) {
    const auto is_at = [&](int c, double value) {
      return std::ranges::all_of(mesh.facet(f), [&](VertexId v) { return std::abs(mesh.rest(v)[c] - value) < 1e-9; });
    };
    const bool is_of_a = mesh.body(mesh.cells_of(mesh.facet(f)[0])[0]) == 1;
    int tag = kFree;
    if (is_at(0, 0)) tag = kLeft;
    if (Dim == 3 && is_at(1, 0)) tag = kFront;
    if (is_at(Dim - 1, a.least[Dim - 1])) tag = kBelow;
    if (is_at(Dim - 1, b.most[Dim - 1])) tag = kAbove;
    if (is_of_a && is_at(Dim - 1, a.most[Dim - 1])) tag = kOfA;
    if (!is_of_a && is_at(Dim - 1, b.least[Dim - 1])) tag = kOfB;
    mesh.set_facet_tag(f, tag);
  }
  return mesh;
}

template <int Dim>
Mesh<Dim> two_cubes(int n, int m, double gap = 0) {
  Brick<Dim> a, b;
  a.boxes.fill(n);
  b.boxes.fill(m);
  a.least = Vec<Dim>::Zero();
  a.most = b.most = Vec<Dim>::Ones();
  b.least = (1 + gap) * Vec<Dim>::Unit(Dim - 1);
  b.most[Dim - 1] = 2 + gap;
  return two_bricks(a, b);
}

template <int Dim>
Setup<Dim> tied(Mesh<Dim> mesh) {
  Setup<Dim> setup;
  setup.mesh = std::move(mesh);
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.ties = {{{kOfA}, {kOfB}}};
  setup.time = {.is_static = true};
  return setup;
}

/// Rollers below and at the sides.
template <int Dim>
void put_on_rollers(Setup<Dim>& setup) {
  const auto hold = [&](int tag, int c) {
    DirichletCondition<Dim> condition{tag, {}, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }};
    condition.components[c] = true;
    setup.dirichlet.push_back(condition);
  };
  hold(kBelow, Dim - 1);
  hold(kLeft, 0);
  if (Dim == 3) hold(kFront, 1);
  // The rollers of an edge belong to the largest tag there: those of the sides hold the bottom, too.
}

template <int Dim>
void pull(Setup<Dim>& setup, double traction) {
  setup.neumann.push_back({kAbove, [=](const Vec<Dim>&, double) { return Vec<Dim>(traction * Vec<Dim>::Unit(Dim - 1)); }});
}

template <int Dim>
void ask_for_forces(Setup<Dim>& setup) {
  setup.fields = {true, true, true, true, true, true, true};
  setup.fields.applied_forces = true;
  setup.fields.curves = {{.name = "a", .surfaces = {kOfA}},
                         {.name = "b", .surfaces = {kOfB}},
                         {.name = "bodies", .bodies = {1, 2}},
                         {.name = "upper", .bodies = {2}}};
}

/// The largest entry by which deformation gradients differ from that of the first cell, less 1 itself.
template <int Dim>
double spread_of_strain(const Simulation<Dim>& simulation) {
  const auto& state = simulation.state();
  const CellSet<Dim> cells = whole_mesh(state.mesh, {});
  const Mat<Dim> first = deformation_gradient<Dim>(cells.elements[0], state.history.x[0]);
  double largest = 0;
  for (const auto& element : cells.elements)
    largest = std::max(largest, (deformation_gradient<Dim>(element, state.history.x[0]) - first).cwiseAbs().maxCoeff());
  return largest / (first - Mat<Dim>::Identity()).norm();
}

template <int Dim>
double largest_gap(const Simulation<Dim>& simulation) {
  const auto& state = simulation.state();
  const CellSet<Dim> cells = whole_mesh(state.mesh, simulation.setup().obstacles.rest);
  const auto mortars = mortars_of<Dim>(simulation.setup(), state.mesh, cells);
  const TieEnergy<Dim> tie(cells, mortars, simulation.setup().materials, false, 1);
  return tie.largest_gap(VectorX(state.history.x[0] - rest_positions<Dim>(cells)));
}

/// The place and the reason that a setup is refused for; empty: it is not.
template <int Dim>
std::string refusal_of(const Setup<Dim>& setup) {
  linear::Registry registry;
  try {
    Simulation<Dim> simulation(setup, registry);
  } catch (const InputError& error) {
    return error.parts().place + ": " + error.parts().found;
  }
  return "";
}

}  // namespace itr
