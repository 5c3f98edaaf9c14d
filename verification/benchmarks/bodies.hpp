// SPDX-License-Identifier: MIT
// Irregular meshes of a square and a cube, a little out of shape.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "energy/elastic/neo_hookean.hpp"
#include "random_tets.hpp"
#include "square_mesh.hpp"

namespace itr {

/// Positions of its vertices, squeezed in x, stretched across, and not smooth.
template <int Dim>
VectorX strained(const Mesh<Dim>& mesh, double noise, std::mt19937& random) {
  std::uniform_real_distribution<double> offset(-noise, noise);
  VectorX x(Dim * mesh.node_slots());
  for (int v = 0; v < mesh.node_slots(); ++v)
    for (int c = 0; c < Dim; ++c) x[Dim * v + c] = (c == 0 ? 0.8 : 1.05) * mesh.rest(v)[c] + 0.2 * offset(random);
  return x;
}

template <int Dim>
struct Body;

/// Perturbed squares, n along a side, with diagonals at random.
template <>
struct Body<2> {
  std::mt19937 random{1};
  Mesh<2> mesh;
  Strata<2> strata;
  VectorX x;

  explicit Body(int n) {
    std::uniform_real_distribution<double> noise(-0.2 / n, 0.2 / n);
    const auto place = [&](int i, int j) {
      Vec<2> p = Vec<2>(i, j) / n;
      if (i > 0 && i < n) p[0] += noise(random);
      if (j > 0 && j < n) p[1] += noise(random);
      return p;
    };
    Grid grid = make_grid(n, place, [&](int, int) { return random() % 2 == 0; });
    std::vector<int> body(grid.cells.size(), 1);
    mesh = Mesh<2>(std::move(grid.rest), std::move(grid.cells), std::move(body));
    strata = Strata<2>(mesh);
    x = strained(mesh, 0.2 / n, random);
  }
};

/// Perturbed cubes of six cells each, n along a side, then changed by random operations.
template <>
struct Body<3> {
  std::mt19937 random{1};
  Mesh<3> mesh;
  Strata<3> strata;
  VectorX x;

  explicit Body(int n) {
    std::uniform_real_distribution<double> noise(-0.2 / n, 0.2 / n);
    const auto place = [&](int i, int j, int k) {
      Vec<3> p = Vec<3>(i, j, k) / n;
      const int at[] = {i, j, k};
      for (int c = 0; c < 3; ++c)
        if (at[c] > 0 && at[c] < n) p[c] += noise(random);
      return p;
    };
    mesh = make_cubes(n, place, [](int, int, int) { return 1; });
    strata = Strata<3>(mesh);
    for (int i = mesh.num_cells() / 10; i > 0; --i)
      if (const auto proposal = propose_at_random(mesh, strata, static_cast<Operation>(random() % 5), random))
        apply(mesh, strata, *proposal.edit);
    strata.compact(mesh.compact());
    x = strained(mesh, 0.2 / n, random);
  }

  std::vector<EdgeKey> edges(std::size_t count) {
    std::vector<EdgeKey> all = mesh.edges();
    std::shuffle(all.begin(), all.end(), random);
    all.resize(std::min(count, all.size()));
    return all;
  }
  /// Elastic energy at frozen positions.
  CellCost elastic_cost() const {
    return [this](const Mesh<3>::Cell& cell, int, const Edit<3>&) {
      std::array<Vec<3>, 4> X, p;
      for (int k = 0; k < 4; ++k) X[k] = mesh.rest(cell[k]), p[k] = x.segment<3>(3 * cell[k]);
      const Mat<3> edges = edge_matrix<3>(X);
      return simplex_volume<3>(edges) * neo_hookean_density<3>(edge_matrix<3>(p) * edges.inverse(), {1e5, 2e5});
    };
  }
};

}  // namespace itr
