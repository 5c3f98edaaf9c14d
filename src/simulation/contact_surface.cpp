// SPDX-License-Identifier: MIT
#include "simulation/contact_surface.hpp"

#include <algorithm>
#include <utility>

#include "energy/contact/friction.hpp"
#include "energy/contact/surface_builder.hpp"
#include "fem/refined_chords.hpp"
#include "simulation/closed_faces.hpp"

namespace itr {

namespace {

template <int Dim>
ContactSurface<Dim> refined_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles, const ChordLevels& levels) {
  const RefinedChords<Dim> chords = refine_chords(mesh, levels);
  std::vector<Vec<Dim>> rest = mesh.rest();
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
  return {surface_of_facets<Dim>(chords.facets, std::move(rest), obstacles, mesh.is_axisymmetric()),
          std::make_shared<VertexMap<Dim>>(weights, VectorX::Zero(Dim * (own + others)))};
}

bool has_refined(const ChordLevels& levels) {
  return std::any_of(levels.begin(), levels.end(), [](int level) { return level > 0; });
}

}  // namespace

template <int Dim>
ClosedSurface<Dim> body_boundary(const Mesh<Dim>& mesh, ConstVectorView x, const ChordLevels& levels) {
  std::vector<Vec<Dim>> points(mesh.num_nodes());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = vertex_of<Dim>(x, static_cast<int>(i));
  if (!has_refined(levels)) return {std::move(points), boundary_chords(mesh)};
  const RefinedChords<Dim> chords = refine_chords(mesh, levels);
  for (const auto& weights : chords.points)
    points.push_back(combined<Dim>(weights, [&](int node) { return vertex_of<Dim>(x, node); }));
  return {std::move(points), chords.facets};
}

template <int Dim>
CollisionSurface collision_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles) {
  return surface_of_facets<Dim>(boundary_chords(mesh), mesh.rest(), obstacles, mesh.is_axisymmetric());
}

/// y = X_proxy + W (x - X) for the proxy's vertices, y = x for the obstacles'.
template <int Dim>
std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  const CollisionProxy<Dim>& proxy = *setup.proxy;
  const int vertices = mesh.num_nodes(), own = static_cast<int>(proxy.rest.size());
  const int obstacles = static_cast<int>(setup.obstacles.rest.size());
  std::vector<Eigen::Triplet<double>> entries;
  VectorX offset = VectorX::Zero(Dim * (own + obstacles));
  const std::vector<Vec<Dim>>& rest = mesh.rest();
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

/// Closed faces of a surface without a proxy.
template <int Dim>
ClosedFaces closed_faces_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, int age,
                            const ContactSurface<Dim>& contact) {
  if (!has_closed_faces(mesh, age)) return {};
  std::vector<Vec<Dim>> rest = mesh.rest();
  rest.insert(rest.end(), setup.obstacles.rest.begin(), setup.obstacles.rest.end());
  const auto is_node_closed = [&](int node) { return node < mesh.num_nodes() && is_closed(mesh, node, age); };
  ClosedFaces faces = closed_faces<Dim>(rest, setup.contact.reach_of_closed(), coincidence(mesh), is_node_closed);
  if (!contact.map) return faces;
  faces.rest = contact.positions(faces.rest);
  faces.is_closed.resize(contact.surface.area.size());
  for (std::size_t i = 0; i < faces.is_closed.size(); ++i) {
    const auto sources = contact.map->sources(static_cast<int>(i));
    faces.is_closed[i] = std::any_of(sources.begin(), sources.end(), is_node_closed);
  }
  return faces;
}

/// Which sides of friction pairs the vertices of a surface without a proxy are of: points of refined chords are of those
/// that all of their nodes are of.
template <int Dim>
std::vector<std::uint64_t> friction_sides_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                             const ContactSurface<Dim>& contact) {
  const auto& pairs = setup.contact.friction_pairs;
  if (pairs.empty()) return {};
  std::vector<std::uint64_t> of_nodes;
  for (int node = 0; node < mesh.num_nodes(); ++node) of_nodes.push_back(friction_sides_of_node(mesh, node, pairs));
  for (int v = 0; v < static_cast<int>(setup.obstacles.rest.size()); ++v)
    of_nodes.push_back(friction_sides_of_obstacle(v, pairs));
  if (!contact.map) return of_nodes;
  std::vector<std::uint64_t> sides(contact.surface.area.size(), ~std::uint64_t{0});
  for (std::size_t i = 0; i < sides.size(); ++i)
    for (const int source : contact.map->sources(static_cast<int>(i))) sides[i] &= of_nodes[source];
  return sides;
}

template <int Dim>
VectorX rest_of_surface(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ContactSurface<Dim>& contact) {
  const std::vector<Vec<Dim>>&nodes = mesh.rest(), &others = setup.obstacles.rest;
  VectorX rest(static_cast<Eigen::Index>(Dim * (nodes.size() + others.size())));
  int point = 0;
  for (const auto* points : {&nodes, &others})
    for (const Vec<Dim>& X : *points) vertex_of<Dim>(rest, point++) = X;
  return contact.map ? contact.map->positions(rest) : rest;
}

template <int Dim>
ContactSurface<Dim> contact_surface(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels, int age) {
  if (!setup.proxy) {
    ContactSurface<Dim> contact{};
    if (has_refined(levels))
      contact = refined_surface(mesh, setup.obstacles, levels);
    else
      contact.surface = collision_surface(mesh, setup.obstacles);
    contact.surface.closed = closed_faces_of(setup, mesh, age, contact);
    contact.surface.friction_sides = friction_sides_of(setup, mesh, contact);
    if (setup.contact.has_turning_friction()) contact.surface.rest = rest_of_surface(setup, mesh, contact);
    return contact;
  }
  const CollisionProxy<Dim>& proxy = *setup.proxy;
  SurfaceBuilder<Dim> builder(mesh.is_axisymmetric());
  for_each_simplex(proxy, 0, [&](const auto& ids) { builder.add(ids); });
  ContactSurface<Dim> contact{builder.build(proxy.rest, std::vector<char>(proxy.rest.size(), 1), setup.obstacles),
                              proxy_map(setup, mesh), true};
  contact.surface.retraction = proxy.retraction;
  return contact;
}

#define ITR_INSTANTIATE(Dim)                                                                         \
  template ClosedSurface<Dim> body_boundary(const Mesh<Dim>&, ConstVectorView, const ChordLevels&);  \
  template CollisionSurface collision_surface(const Mesh<Dim>&, const Obstacles<Dim>&);              \
  template std::shared_ptr<const VertexMap<Dim>> proxy_map(const StepSetup<Dim>&, const Mesh<Dim>&); \
  template ContactSurface<Dim> contact_surface(const StepSetup<Dim>&, const Mesh<Dim>&, const ChordLevels&, int);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
