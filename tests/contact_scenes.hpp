// SPDX-License-Identifier: MIT
// Surfaces with many pairs within d-hat.
#pragma once

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "energy/contact/surface.hpp"
#include "itr/options.hpp"

namespace itr {

/// An open zigzag of obstacle edges below vertices of bodies, closer than dhat in some places.
struct ContactScene {
  CollisionSurface surface;
  VectorX x;
  ContactScene(unsigned seed, bool convergent) {
    options.enabled = true;
    options.dhat = 0.2;
    options.convergent = convergent;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-0.04, 0.04);
    const int n = 8;  // two polylines of n vertices, one above the other
    x.resize(4 * n);
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 2>> edges;
    for (int line = 0; line < 2; ++line)
      for (int i = 0; i < n; ++i) {
        const int v = line * n + i;
        rest.emplace_back(0.3 * i, line);
        x.segment<2>(2 * v) << 0.3 * i + 0.1 * line + noise(random), 0.12 * line + noise(random);
        if (i + 1 < n) edges.push_back({v, v + 1});
      }
    surface = make_collision_surface<2>(edges, {}, {}, rest, std::vector<char>(2 * n, 1));
  }
  ContactOptions options;
};

/// Two sheets of triangles, one above the other and turned by `angle`; parallel edges where it is 0.
struct ContactScene3 {
  CollisionSurface surface;
  VectorX x;
  ContactOptions options;
  /// Sheets of n x n vertices: from 8 on pairs are found by trees, and in several blocks.
  ContactScene3(unsigned seed, bool convergent, double angle, double roughness, int n = 4) {
    options.enabled = true;
    options.dhat = 0.2;
    options.convergent = convergent;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-roughness, roughness);
    std::vector<Vec<3>> rest;
    std::vector<std::array<int, 3>> triangles;
    for (int sheet = 0; sheet < 2; ++sheet)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const int v = static_cast<int>(rest.size());
          const double c = std::cos(angle * sheet), s = std::sin(angle * sheet), a = 0.3 * i + 0.08 * sheet, b = 0.3 * j;
          rest.emplace_back(c * a - s * b, s * a + c * b, 0.12 * sheet);
          if (i + 1 < n && j + 1 < n) {
            triangles.push_back({v, v + n, v + n + 1});
            triangles.push_back({v, v + n + 1, v + 1});
          }
        }
    x.resize(3 * rest.size());
    for (std::size_t v = 0; v < rest.size(); ++v)
      x.segment<3>(3 * v) = rest[v] + Vec<3>(noise(random), noise(random), noise(random));
    surface = make_collision_surface<3>({}, triangles, {}, rest, std::vector<char>(rest.size(), 1));
  }
};

}  // namespace itr
