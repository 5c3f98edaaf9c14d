// SPDX-License-Identifier: MIT
#include "simulation/contact_surface.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "fem/refined_chords.hpp"

namespace itr {

namespace {

/// The surface of what moves with bodies, given by its primitives and rest positions, and the obstacles after it.
template <int Dim>
CollisionSurface with_obstacles(std::vector<std::array<int, 2>> edges, std::vector<std::array<int, 3>> triangles,
                                std::vector<int> points, std::vector<Vec<Dim>> rest, std::vector<char> counts,
                                const Obstacles<Dim>& obstacles) {
  const int bodies = static_cast<int>(rest.size()), total = bodies + static_cast<int>(obstacles.rest.size());
  rest.insert(rest.end(), obstacles.rest.begin(), obstacles.rest.end());
  counts.resize(total, 0);
  for (const auto& [a, b] : obstacles.edges) edges.push_back({bodies + a, bodies + b});
  for (const auto& [a, b, c] : obstacles.triangles) triangles.push_back({bodies + a, bodies + b, bodies + c});
  for (int v = bodies; v < total; ++v) points.push_back(v);
  return make_collision_surface<Dim>(std::move(edges), std::move(triangles), points, rest, std::move(counts));
}

template <int Dim>
std::vector<typename Mesh<Dim>::Facet> boundary_chords(const Mesh<Dim>& mesh, const Space& space) {
  std::vector<typename Mesh<Dim>::Facet> chords;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    if (mesh.is_facet_alive(f)) add_chord_facets<Dim>(mesh.facet(f), space, mesh.vertex_slots(), chords);
  return chords;
}

/// The surface through all nodes and these points, and the obstacles.
template <int Dim>
CollisionSurface chord_surface(const std::vector<typename Mesh<Dim>::Facet>& chords, std::vector<Vec<Dim>> rest,
                               const Obstacles<Dim>& obstacles) {
  std::vector<std::array<int, 2>> edges;
  std::vector<std::array<int, 3>> triangles;
  std::vector<char> counts(rest.size(), 0);
  for (const auto& facet : chords) {
    for (const int v : facet) counts[v] = 1;
    if constexpr (Dim == 2)
      edges.push_back(facet);
    else
      triangles.push_back(facet);
  }
  return with_obstacles<Dim>(std::move(edges), std::move(triangles), {}, std::move(rest), std::move(counts), obstacles);
}

template <int Dim>
ContactSurface<Dim> refined_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles, const Space& space,
                                    const ChordLevels& levels) {
  const RefinedChords<Dim> chords = refine_chords(mesh, space, levels);
  std::vector<Vec<Dim>> rest = node_rest_positions(mesh, space);
  const int nodes = static_cast<int>(rest.size()), own = nodes + static_cast<int>(chords.points.size());
  const int others = static_cast<int>(obstacles.rest.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int node = 0; node < nodes; ++node) entries.emplace_back(node, node, 1);
  for (int point = nodes; point < own; ++point) {
    const auto& weights = chords.points[point - nodes];
    for (const auto& [node, weight] : weights) entries.emplace_back(point, node, weight);
    rest.push_back(combined<Dim>(weights, [&](int node) { return rest[node]; }));
  }
  for (int o = 0; o < others; ++o) entries.emplace_back(own + o, nodes + o, 1);
  typename VertexMap<Dim>::Weights weights(own + others, nodes + others);
  weights.setFromTriplets(entries.begin(), entries.end());
  return {chord_surface<Dim>(chords.facets, std::move(rest), obstacles),
          std::make_shared<VertexMap<Dim>>(weights, VectorX::Zero(Dim * (own + others)))};
}

bool has_refined(const ChordLevels& levels) {
  return std::any_of(levels.begin(), levels.end(), [](int level) { return level > 0; });
}

}  // namespace

template <int Dim>
ClosedSurface<Dim> body_boundary(const Mesh<Dim>& mesh, ConstVectorView x, const Space& space, const ChordLevels& levels) {
  std::vector<Vec<Dim>> points(num_nodes(mesh, space));
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = vertex_of<Dim>(x, static_cast<int>(i));
  if (!has_refined(levels)) return {std::move(points), boundary_chords(mesh, space)};
  const RefinedChords<Dim> chords = refine_chords(mesh, space, levels);
  for (const auto& weights : chords.points)
    points.push_back(combined<Dim>(weights, [&](int node) { return vertex_of<Dim>(x, node); }));
  return {std::move(points), chords.facets};
}

template <int Dim>
CollisionSurface collision_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles, const Space& space) {
  return chord_surface<Dim>(boundary_chords(mesh, space), node_rest_positions(mesh, space), obstacles);
}

/// y = X_proxy + W (x - X) for the proxy's vertices, y = x for the obstacles'.
template <int Dim>
std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const Space& space) {
  const CollisionProxy<Dim>& proxy = *setup.proxy;
  const int vertices = num_nodes(mesh, space), own = static_cast<int>(proxy.rest.size());
  const int obstacles = static_cast<int>(setup.obstacles.rest.size());
  std::vector<Eigen::Triplet<double>> entries;
  VectorX offset = VectorX::Zero(Dim * (own + obstacles));
  const std::vector<Vec<Dim>> rest = node_rest_positions(mesh, space);
  for (int i = 0; i < own; ++i) vertex_of<Dim>(offset, i) = proxy.rest[i];
  for (int i = 0; i < own; ++i)
    for (typename Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(proxy.weights, i); it; ++it) {
      entries.emplace_back(i, static_cast<int>(it.col()), it.value());
      vertex_of<Dim>(offset, i) -= it.value() * rest[static_cast<std::size_t>(it.col())];
    }
  for (int o = 0; o < obstacles; ++o) entries.emplace_back(own + o, vertices + o, 1);
  typename VertexMap<Dim>::Weights weights(own + obstacles, vertices + obstacles);
  weights.setFromTriplets(entries.begin(), entries.end());
  return std::make_shared<VertexMap<Dim>>(weights, std::move(offset));
}

template <int Dim>
ContactSurface<Dim> contact_surface(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const Space& space,
                                    const ChordLevels& levels) {
  if (!setup.proxy && has_refined(levels)) return refined_surface(mesh, setup.obstacles, space, levels);
  if (!setup.proxy) return {collision_surface(mesh, setup.obstacles, space), nullptr};
  const CollisionProxy<Dim>& proxy = *setup.proxy;
  std::vector<int> points(proxy.rest.size());
  std::iota(points.begin(), points.end(), 0);
  std::vector<char> counts(proxy.rest.size(), 1);
  return {
      with_obstacles<Dim>(proxy.edges, proxy.triangles, std::move(points), proxy.rest, std::move(counts), setup.obstacles),
      proxy_map(setup, mesh, space), true};
}

#define ITR_INSTANTIATE(Dim)                                                                                       \
  template ClosedSurface<Dim> body_boundary(const Mesh<Dim>&, ConstVectorView, const Space&, const ChordLevels&);  \
  template CollisionSurface collision_surface(const Mesh<Dim>&, const Obstacles<Dim>&, const Space&);              \
  template std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>&, const Mesh<Dim>&, const Space&); \
  template ContactSurface<Dim> contact_surface(const StepSetup<Dim>&, const Mesh<Dim>&, const Space&, const ChordLevels&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
