// SPDX-License-Identifier: MIT
// Random tetrahedral meshes and operations on them, and what operations must conserve.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "geometry/measures.hpp"
#include "itr/mesh.hpp"
#include "mesh/strata.hpp"
#include "propose_split.hpp"
#include "remesh/edits.hpp"

namespace itr {

/// Places the vertices of n^3 cubes in the unit cube.
inline auto unit_grid(int n) {
  return [n](int i, int j, int k) { return Vec<3>(Vec<3>(i, j, k) / n); };
}

/// n^3 cubes of six tetrahedra each (Kuhn), those for which `body(i, j, k)` is not kNone; boundary facets on the planes x,
/// y, z = 0 or 1 have tags 2 * axis + side, others 6. Vertices at `place(i, j, k)`; unused ones are left out.
template <typename Place, typename Body>
Mesh<3> make_cubes(int n, Place&& place, Body&& body) {
  constexpr int kOrders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
  std::vector<Vec<3>> rest;
  std::vector<std::array<int, 3>> grid;
  std::vector<Mesh<3>::Cell> cells;
  std::vector<int> bodies;
  std::map<std::array<int, 3>, int> ids;
  const auto id = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = ids.try_emplace(at, static_cast<int>(rest.size()));
    if (is_new) rest.push_back(place(at[0], at[1], at[2])), grid.push_back(at);
    return entry->second;
  };
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int b = body(i, j, k);
        if (b == kNone) continue;
        for (int order = 0; order < 6; ++order) {
          std::array<int, 3> at{i, j, k};
          Mesh<3>::Cell cell{id(at)};
          for (int step = 0; step < 3; ++step) {
            ++at[kOrders[order][step]];
            cell[step + 1] = id(at);
          }
          if (order >= 3) std::swap(cell[2], cell[3]);  // odd orders
          cells.push_back(cell);
          bodies.push_back(b);
        }
      }
  Mesh<3> mesh(rest, cells, bodies);
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    int tag = 6;
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side)
        if (std::ranges::all_of(mesh.facet(f), [&](int v) { return grid[v][axis] == side * n; })) tag = 2 * axis + side;
    mesh.set_facet_tag(f, tag);
  }
  return mesh;
}

/// Worst quality of the alive cells.
template <int Dim>
double worst_cell(const Mesh<Dim>& mesh) {
  double worst = 1;
  for (int c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
    worst = std::min(worst, simplex_quality<Dim>(p));
  }
  return worst;
}

inline VertexId apply(Mesh<3>& mesh, Strata<3>& strata, const Edit<3>& edit) {
  const VertexId created = mesh.apply(edit);
  strata.follow(edit, created);
  return created;
}

/// A turned and shifted cube with holes, bodies and tags at random, some of its surface flat and some rough; with `slivers`
/// some vertices are pushed near to the plane of a facet opposite.
inline Mesh<3> random_tets(int n, std::mt19937& random, bool slivers) {
  const auto unit = [&] { return std::uniform_real_distribution<double>(-1, 1)(random); };
  const Mat<3> turn = Eigen::Quaterniond(unit(), unit(), unit(), unit()).normalized().toRotationMatrix();
  const Vec<3> shift(unit(), unit(), unit());
  const int bodies = 1 + static_cast<int>(random() % 3), holes = static_cast<int>(random() % 4),
            cut = static_cast<int>(random() % n);
  std::map<std::array<int, 3>, int> body;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) body[{i, j, k}] = bodies == 1 || i < cut ? 1 : bodies == 2 || random() % 2 ? 2 : 3;
  for (int hole = 0; hole < holes; ++hole)
    body[{static_cast<int>(random() % n), static_cast<int>(random() % n), static_cast<int>(random() % n)}] = kNone;
  const auto body_at = [&](int i, int j, int k) {
    return i < 0 || j < 0 || k < 0 || i >= n || j >= n || k >= n ? kNone : body.at({i, j, k});
  };
  const bool rough = random() % 2;
  const auto place = [&](int i, int j, int k) {
    std::set<int> around;
    for (int corner = 0; corner < 8; ++corner) around.insert(body_at(i - corner % 2, j - corner / 2 % 2, k - corner / 4));
    const bool moves = around.size() == 1 || (rough && 2 * k > n);
    Vec<3> p = Vec<3>(i, j, k) / n;
    if (moves) p += 0.12 / n * Vec<3>(unit(), unit(), unit());
    return Vec<3>(turn * p + shift);
  };
  Mesh<3> mesh = make_cubes(n, place, body_at);
  if (!slivers) return mesh;
  Strata<3> strata(mesh);
  for (int v = 0; v < mesh.node_slots(); ++v) {
    if (random() % 3) continue;
    const auto around = mesh.cells_of(v);
    const CellId c = around[random() % around.size()];
    Vec<3> opposite = Vec<3>::Zero();
    for (const int w : mesh.cell(c))
      if (w != v) opposite += mesh.rest(w) / 3;
    const Vec<3> target = mesh.rest(v) + (1 - 1e-3 * (1 + unit())) * (opposite - mesh.rest(v));
    if (const auto move = propose_move<3>(mesh, strata, v, target, {.fraction = 0, .floor = 0}))
      apply(mesh, strata, *move.edit);
  }
  mesh.compact();
  return mesh;
}

/// Quantities that no operation may change.
struct Invariants {
  std::map<int, double> volume, area;           ///< by body; by tag
  std::map<int, double> patch_area;             ///< by patch, interfaces included
  std::map<int, long> body_euler, patch_euler;  ///< vertices - edges + triangles - tetrahedra
  long euler = 0;
  double features = 0;                                      ///< length of all edges of features
  std::map<Stratum, std::set<std::array<double, 3>>> held;  ///< places of corners

  Invariants(const Mesh<3>& mesh, const Strata<3>& strata) {
    struct Complex {
      std::set<int> vertices;
      std::set<EdgeKey> edges;
      std::set<std::array<int, 3>> triangles;
      long cells = 0;
      void add(std::array<int, 3> t) {
        t = ascending(t);
        vertices.insert(t.begin(), t.end());
        edges.insert({{t[0], t[1]}, {t[0], t[2]}, {t[1], t[2]}});
        triangles.insert(t);
      }
      long euler() const { return long(vertices.size()) - long(edges.size()) + long(triangles.size()) - cells; }
    };
    Complex all;
    std::map<int, Complex> by_body, by_patch;
    const auto area_of = [&](const std::array<int, 3>& t) {
      return 0.5 * Vec<3>(mesh.rest(t[1]) - mesh.rest(t[0])).cross(Vec<3>(mesh.rest(t[2]) - mesh.rest(t[0]))).norm();
    };
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      if (!mesh.is_cell_alive(c)) continue;
      volume[mesh.body(c)] += mesh.volume(c);
      for (Complex* complex : {&all, &by_body[mesh.body(c)]}) {
        ++complex->cells;
        for (int k = 0; k < 4; ++k) complex->add(opposite_facet<3>(mesh.cell(c), k));
      }
      for (int k = 0; k < 4; ++k) {
        const auto face = opposite_facet<3>(mesh.cell(c), k);
        if (const int patch = strata.interface_patch(face);
            patch != kNone && by_patch[patch].triangles.count(ascending(face)) == 0) {
          by_patch[patch].add(face);
          patch_area[patch] += area_of(face);
        }
      }
    }
    for (int f = 0; f < mesh.facet_slots(); ++f) {
      if (!mesh.is_facet_alive(f)) continue;
      area[mesh.facet_tag(f)] += area_of(mesh.facet(f));
      patch_area[strata.patch(f)] += area_of(mesh.facet(f));
      by_patch[strata.patch(f)].add(mesh.facet(f));
    }
    euler = all.euler();
    for (const auto& [body, complex] : by_body) body_euler[body] = complex.euler();
    for (const auto& [patch, complex] : by_patch) patch_euler[patch] = complex.euler();
    for (const auto& [a, b] : all.edges)
      if (strata.edge(mesh, {a, b}) >= Stratum::feature) features += (mesh.rest(a) - mesh.rest(b)).norm();
    for (const int v : all.vertices)
      if (strata.vertex(v) == Stratum::corner)
        held[strata.vertex(v)].insert({mesh.rest(v)[0], mesh.rest(v)[1], mesh.rest(v)[2]});
  }

  /// Describes the differences, in words; nothing where only round-off differs.
  std::string difference(const Invariants& other, double tolerance) const {
    const auto near = [&](const auto& a, const auto& b) {
      return std::ranges::equal(a, b, [&](const auto& x, const auto& y) {
        return x.first == y.first && std::abs(x.second - y.second) <= tolerance;
      });
    };
    if (!near(volume, other.volume)) return "volume of a body";
    if (!near(area, other.area)) return "area of a tag";
    if (!near(patch_area, other.patch_area)) return "area of a patch";
    if (euler != other.euler || body_euler != other.body_euler) return "topology of a body";
    if (patch_euler != other.patch_euler) return "topology of a patch";
    if (std::abs(features - other.features) > tolerance) return "length of features";
    if (held != other.held) return "a corner";
    return {};
  }
};

enum class Operation { split, collapse, edge_removal, facet_removal, move };

/// 1 / quality: what makes good cells.
inline CellCost shape_cost(const Mesh<3>& mesh) {
  return [&mesh](const Mesh<3>::Cell& cell, int, const Edit<3>&) {
    return 1 / simplex_quality<3>({mesh.rest(cell[0]), mesh.rest(cell[1]), mesh.rest(cell[2]), mesh.rest(cell[3])});
  };
}

/// An operation at a random edge, facet or vertex, in time that does not grow with the mesh.
inline Proposal<3> propose_at_random(const Mesh<3>& mesh, const Strata<3>& strata, Operation operation, std::mt19937& random,
                                     const QualityRule& rule = {}) {
  CellId c;
  do c = static_cast<CellId>(random() % mesh.cell_slots());
  while (!mesh.is_cell_alive(c));
  const auto& cell = mesh.cell(c);
  const unsigned i = random() % 4, j = (i + 1 + random() % 3) % 4;
  const EdgeKey edge{std::min(cell[i], cell[j]), std::max(cell[i], cell[j])};
  switch (operation) {
    case Operation::split:
      return propose_split<3>(mesh, edge);
    case Operation::collapse:
      return propose_collapse<3>(mesh, strata, edge, rule);
    case Operation::edge_removal:
      return propose_edge_removal(mesh, strata, edge, shape_cost(mesh), rule);
    case Operation::facet_removal:
      return propose_facet_removal(mesh, opposite_facet<3>(cell, static_cast<int>(i)), rule);
    default: {
      if (random() % 2)
        return propose_move<3>(mesh, strata, cell[i], best_shaped_position<3>(mesh, strata, cell[i], 2), rule);
      const double s = std::uniform_real_distribution<double>(-0.3, 0.6)(random);
      return propose_move<3>(mesh, strata, cell[i], mesh.rest(cell[i]) + s * (mesh.rest(cell[j]) - mesh.rest(cell[i])),
                             rule);
    }
  }
}

}  // namespace itr
