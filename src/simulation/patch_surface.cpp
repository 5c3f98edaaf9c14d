// SPDX-License-Identifier: MIT
#include "simulation/patch_surface.hpp"

#include <algorithm>
#include <span>
#include <unordered_map>

#include "geometry/bvh.hpp"

namespace itr {

template <int Dim>
PatchSurface<Dim> patch_surface(const Mesh<Dim>& mesh, const Space& space, const Obstacles<Dim>& obstacles,
                                const TransferPatch<Dim>& patch, const std::vector<char>& moving, const VectorX& x,
                                const VectorX& goal, double reach) {
  PatchSurface<Dim> result;
  const auto& vertices = patch.new_cells.vertices;
  std::vector<FacetId> own;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (!moving[i]) continue;
    std::vector<FacetId> of_edge;
    const int node = vertices[i] - mesh.vertex_slots();
    if (node >= 0) of_edge = mesh.facets_of_edge(space.curved_edges()[node]);
    const auto at = node < 0 ? mesh.facets_of(vertices[i]) : std::span<const FacetId>(of_edge);
    own.insert(own.end(), at.begin(), at.end());
  }
  if (own.empty()) return result;
  std::sort(own.begin(), own.end());
  own.erase(std::unique(own.begin(), own.end()), own.end());

  std::unordered_map<int, int> known;  // from ids in fields to those in the patch
  for (std::size_t i = 0; i < vertices.size(); ++i) known[vertices[i]] = static_cast<int>(i);
  std::vector<Box<Dim>> boxes;
  std::vector<typename MeshTypes<Dim>::Facet> chords;
  for (const FacetId f : own) {
    Box<Dim> box;
    chords.clear();
    add_chord_facets<Dim>(mesh.facet(f), space, mesh.vertex_slots(), chords);
    for (const auto& chord : chords)
      for (const int v : chord) {
        box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
        box.include(Vec<Dim>(goal.segment<Dim>(Dim * known.at(v))));
      }
    boxes.push_back(box.inflated(reach));
  }
  const Bvh<Dim> tree(boxes);
  std::vector<int> hits;
  const auto is_near = [&](std::span<const int> ids) {
    Box<Dim> box;
    for (const int v : ids) box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
    hits.clear();
    tree.query(box, hits);
    return !hits.empty();
  };

  std::vector<Vec<Dim>> rest = patch.new_cells.rest;
  const int bodies = num_nodes(mesh, space);
  const auto rest_of = [&](int v) -> Vec<Dim> {
    if (v >= bodies) return obstacles.rest[v - bodies];
    if (v < mesh.vertex_slots()) return mesh.rest(v);
    const auto& [a, b] = space.curved_edges()[v - mesh.vertex_slots()];
    return (mesh.rest(a) + mesh.rest(b)) / 2;
  };
  const auto local = [&](int v) {
    const auto [it, is_new] = known.try_emplace(v, static_cast<int>(rest.size()));
    if (is_new) {
      rest.push_back(rest_of(v));
      result.others.push_back(v);
    }
    return it->second;
  };
  std::vector<std::array<int, 2>> edges;
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> points;
  const auto add = [&](const auto& primitive, int first) {
    auto ids = primitive;
    for (int& v : ids) v += first;
    if (!is_near(ids)) return;
    for (int& v : ids) v = local(v);
    if constexpr (std::tuple_size_v<std::remove_cvref_t<decltype(primitive)>> == 2)
      edges.push_back(ids);
    else
      triangles.push_back(ids);
  };
  chords.clear();  // own ones are near themselves
  for (int f = 0; f < mesh.facet_slots(); ++f) add_chord_facets<Dim>(mesh.facet(f), space, mesh.vertex_slots(), chords);
  for (const auto& chord : chords) add(chord, 0);
  for (const auto& edge : obstacles.edges) add(edge, bodies);
  for (const auto& triangle : obstacles.triangles) add(triangle, bodies);
  for (int o = 0; o < static_cast<int>(obstacles.rest.size()); ++o)
    if (const int v = bodies + o; is_near(std::span(&v, 1))) points.push_back(local(v));

  std::vector<char> counts(rest.size(), 0);
  std::copy(moving.begin(), moving.end(), counts.begin());
  result.surface = make_collision_surface<Dim>(std::move(edges), std::move(triangles), points, rest, std::move(counts));
  return result;
}

template PatchSurface<2> patch_surface<2>(const Mesh<2>&, const Space&, const Obstacles<2>&, const TransferPatch<2>&,
                                          const std::vector<char>&, const VectorX&, const VectorX&, double);
template PatchSurface<3> patch_surface<3>(const Mesh<3>&, const Space&, const Obstacles<3>&, const TransferPatch<3>&,
                                          const std::vector<char>&, const VectorX&, const VectorX&, double);

}  // namespace itr
