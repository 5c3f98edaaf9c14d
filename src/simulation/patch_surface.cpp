// SPDX-License-Identifier: MIT
#include "simulation/patch_surface.hpp"

#include <algorithm>
#include <span>
#include <unordered_map>

#include "energy/contact/surface_builder.hpp"
#include "fem/refined_chords.hpp"
#include "geometry/bvh.hpp"
#include "simulation/closed_faces.hpp"

namespace itr {

namespace {

/// Facets of the mesh at vertices that move, ascending.
template <int Dim>
std::vector<FacetId> facets_of_moving(const Mesh<Dim>& mesh, std::span<const int> vertices,
                                      const std::vector<char>& moving) {
  std::vector<FacetId> facets;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (!moving[i]) continue;
    std::vector<FacetId> of_edge;
    const EdgeKey edge = mesh.edge_of_node(vertices[i]);
    if (edge[0] != kNone) of_edge = mesh.facets_of_edge(edge);
    const auto at = edge[0] == kNone ? mesh.facets_of(vertices[i]) : std::span<const FacetId>(of_edge);
    facets.insert(facets.end(), at.begin(), at.end());
  }
  std::sort(facets.begin(), facets.end());
  facets.erase(std::unique(facets.begin(), facets.end()), facets.end());
  return facets;
}

/// Boxes that hold facets on their way from `x` to `goal`, which is by the numbers that `known` has.
template <int Dim>
std::vector<Box<Dim>> swept_boxes(const Mesh<Dim>& mesh, const std::vector<FacetId>& facets,
                                  const std::unordered_map<int, int>& known, const VectorX& x, const VectorX& goal,
                                  double reach) {
  std::vector<Box<Dim>> boxes;
  std::vector<typename MeshTypes<Dim>::Facet> chords;
  for (const FacetId f : facets) {
    Box<Dim> box;
    chords.clear();
    add_chord_facets(mesh, f, chords);
    for (const auto& chord : chords)
      for (const int v : chord) {
        box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
        box.include(Vec<Dim>(goal.segment<Dim>(Dim * known.at(v))));
      }
    boxes.push_back(box.inflated(reach));
  }
  return boxes;
}

}  // namespace

template <int Dim>
PatchSurface<Dim> patch_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles, const TransferPatch<Dim>& patch,
                                const std::vector<char>& moving, const VectorX& x, const VectorX& goal, double reach,
                                int age) {
  PatchSurface<Dim> result;
  const auto& vertices = patch.new_cells.vertices;
  const std::vector<FacetId> own = facets_of_moving<Dim>(mesh, vertices, moving);
  if (own.empty()) return result;

  std::unordered_map<int, int> known;  // from ids in fields to those in the patch
  for (std::size_t i = 0; i < vertices.size(); ++i) known[vertices[i]] = static_cast<int>(i);
  const Bvh<Dim> tree(swept_boxes<Dim>(mesh, own, known, x, goal, reach));
  std::vector<int> hits;
  const auto is_near = [&](std::span<const int> ids) {
    Box<Dim> box;
    for (const int v : ids) box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
    hits.clear();
    tree.query(box, hits);
    return !hits.empty();
  };

  std::vector<Vec<Dim>> rest = patch.new_cells.rest;
  const int bodies = mesh.num_nodes();
  const auto local = [&](int v) {
    const auto [it, is_new] = known.try_emplace(v, static_cast<int>(rest.size()));
    if (is_new) {
      rest.push_back(v < bodies ? mesh.rest(v) : obstacles.rest[v - bodies]);
      result.others.push_back(v);
    }
    return it->second;
  };
  SurfaceBuilder<Dim> builder(mesh.is_axisymmetric());
  const auto add = [&](auto ids) {
    if (!is_near(ids)) return;
    for (int& v : ids) v = local(v);
    builder.add(ids);
  };
  for (const auto& chord : boundary_chords(mesh)) add(chord);  // own ones are near themselves
  for_each_simplex(obstacles, bodies, add);

  std::vector<char> counts(rest.size(), 0);
  std::copy(moving.begin(), moving.end(), counts.begin());
  result.surface = builder.build(rest, std::move(counts));
  result.surface.closed = closed_faces<Dim>(rest, reach, 0, [&](int i) {
    const int own_ones = static_cast<int>(vertices.size()), v = i < own_ones ? vertices[i] : result.others[i - own_ones];
    return v < bodies && is_closed(mesh, v, age);
  });
  return result;
}

template PatchSurface<2> patch_surface<2>(const Mesh<2>&, const Obstacles<2>&, const TransferPatch<2>&,
                                          const std::vector<char>&, const VectorX&, const VectorX&, double, int);
template PatchSurface<3> patch_surface<3>(const Mesh<3>&, const Obstacles<3>&, const TransferPatch<3>&,
                                          const std::vector<char>&, const VectorX&, const VectorX&, double, int);

}  // namespace itr
