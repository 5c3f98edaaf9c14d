// SPDX-License-Identifier: MIT
// Random meshes with curved edges and fields on them, and operations on these.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "apply_edit.hpp"
#include "random_mesh.hpp"
#include "random_tets.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

template <int Dim>
Mesh<Dim> small_mesh(std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_mesh(2, random);
  else
    return random_tets(2, random, false);
}

template <int Dim>
const Edit<Dim> kNoEdit{.kind = Edit<Dim>::Kind::split};

/// The function that a field is on a cell, at barycentric coordinates.
template <int Dim>
Vec<Dim> value_at(const Mesh<Dim>& mesh, const VectorX& field, CellId c, const std::array<double, Dim + 1>& l) {
  const CurvedCell<Dim> cell = curved_cell<Dim>(mesh.cell(c), [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
  return cell.values(field, kNoEdit<Dim>) * quadratic_shapes<Dim>(kAllCurved<Dim>, l);
}

template <int Dim>
struct Probe {
  Vec<Dim> X;
  int body;
  std::vector<Vec<Dim>> values;  ///< of each field
};

template <int Dim>
struct CurvedScene {
  std::mt19937 random;
  Mesh<Dim> mesh;
  RemeshFields<Dim> fields;
  Strata<Dim> strata;
  std::vector<Probe<Dim>> probes;

  /// A fraction of the edges is curved, on the surface or not; fields differ from rest positions by so much.
  explicit CurvedScene(unsigned seed, double curved = 0.4, double noise = 0.1, bool on_surface = true)
      : random(seed), mesh(small_mesh<Dim>(random)) {
    mesh.compact();
    strata = Strata<Dim>(mesh);
    for (const EdgeKey& edge : mesh.edges())
      if (std::uniform_real_distribution<double>(0, 1)(random) < curved &&
          (on_surface || mesh.facets_of_edge(edge).empty())) {
        mesh.add_node(edge);
        strata.add_nodes(1);
      }
    for (VectorX* field : {&fields.x, &fields.predictor}) *field = noisy(noise);
    fields.past_positions = {noisy(noise)};
    fields.past_rates = {noisy(1)};
    for (CellId c = 0; c < mesh.cell_slots(); ++c)
      for (int i = 0; i < 3; ++i) add_probe(c);
  }
  VectorX noisy(double noise) {
    std::uniform_real_distribution<double> off(-noise, noise);
    VectorX field(Dim * mesh.node_slots());
    for (int v = 0; v < mesh.node_slots(); ++v)
      for (int k = 0; k < Dim; ++k) field[Dim * v + k] = mesh.rest(v)[k] + off(random);
    return field;
  }
  void add_probe(CellId c) {
    std::uniform_real_distribution<double> part(0.05, 1);
    std::array<double, Dim + 1> l;
    double sum = 0;
    for (double& w : l) sum += w = part(random);
    Probe<Dim> probe{Vec<Dim>::Zero(), mesh.body(c), {}};
    for (int k = 0; k <= Dim; ++k) probe.X += (l[k] /= sum) * mesh.rest(mesh.cell(c)[k]);
    fields.for_each([&](const VectorX& field) { probe.values.push_back(value_at<Dim>(mesh, field, c, l)); });
    probes.push_back(probe);
  }
  void apply(const Edit<Dim>& edit) { apply_edit(edit, mesh, fields, strata); }
  EdgeKey edge() {
    const auto edges = mesh.edges();
    return edges[random() % edges.size()];
  }
  /// In time that does not grow with the mesh.
  EdgeKey any_edge() {
    CellId c;
    do c = static_cast<CellId>(random() % mesh.cell_slots());
    while (!mesh.is_cell_alive(c));
    const auto& cell = mesh.cell(c);
    const unsigned i = random() % (Dim + 1), j = (i + 1 + random() % Dim) % (Dim + 1);
    return {std::min(cell[i], cell[j]), std::max(cell[i], cell[j])};
  }
  /// Removes dead slots.
  void compact() {
    const auto map = mesh.compact();
    strata.compact(map);
    fields.for_each([&](VectorX& field) {
      VectorX kept(Dim * mesh.node_slots());
      for (std::size_t v = 0; v < map.vertex.size(); ++v)
        if (map.vertex[v] != kNone) kept.segment<Dim>(Dim * map.vertex[v]) = field.segment<Dim>(Dim * static_cast<int>(v));
      field = kept;
    });
  }
  /// Largest change of a field at a probe.
  double largest_change() {
    double largest = 0;
    for (const Probe<Dim>& probe : probes) {
      double deepest = -1;
      std::array<double, Dim + 1> l{};
      CellId cell = kNone;
      for (CellId c = 0; c < mesh.cell_slots(); ++c) {
        if (!mesh.is_cell_alive(c) || mesh.body(c) != probe.body) continue;
        const Vec<Dim> w = mesh.inverse_rest_edges(c) * (probe.X - mesh.rest(mesh.cell(c)[0]));
        const double depth = std::min(w.minCoeff(), 1 - w.sum());
        if (depth <= deepest) continue;
        deepest = depth;
        cell = c;
        l[0] = 1 - w.sum();
        for (int k = 0; k < Dim; ++k) l[k + 1] = w[k];
      }
      EXPECT_GT(deepest, -1e-9);
      std::size_t i = 0;
      fields.for_each([&](const VectorX& field) {
        largest = std::max(largest, (value_at<Dim>(mesh, field, cell, l) - probe.values[i++]).norm());
      });
    }
    return largest;
  }
};

/// An operation of any kind at a random edge, or at one of its ends, that has to keep `rule`.
template <int Dim>
Proposal<Dim> propose_any(CurvedScene<Dim>& scene, const QualityRule& rule = {.fraction = 0.05, .floor = 0.02}) {
  const EdgeKey edge = scene.any_edge();
  const bool is_curved = scene.mesh.node_of(edge[0], edge[1]) != kNone;
  switch (scene.random() % 7) {
    case 0:
      return propose_split(scene.mesh, edge);
    case 1:
      if (is_curved && scene.random() % 2) return {.edit = make_chords(scene.mesh, edge)};
      return {.edit = is_curved ? make_straighten(scene.mesh, edge) : make_curve(scene.mesh, edge)};
    case 2:
    case 3:
      return propose_collapse(scene.mesh, scene.strata, edge, rule);
    case 4:
    case 5:
      if constexpr (Dim == 2) {
        return propose_diagonal_swap(scene.mesh, scene.strata, edge, rule);
      } else {
        const auto cells = scene.mesh.cells_of_edge(edge);
        if (scene.random() % 2)
          return propose_facet_removal(
              scene.mesh, opposite_facet<3>(scene.mesh.cell(cells[0]), static_cast<int>(scene.random() % 4)), rule);
        return propose_edge_removal(scene.mesh, scene.strata, edge, shape_cost(scene.mesh), rule);
      }
    default:
      return propose_move(scene.mesh, scene.strata, edge[0], best_shaped_position(scene.mesh, scene.strata, edge[0], 3),
                          rule);
  }
}

}  // namespace itr
