// SPDX-License-Identifier: MIT
#include "simulation/closed_faces.hpp"

#include <set>
#include <vector>

#include "energy/contact/candidates.hpp"
#include "energy/contact/pairs.hpp"
#include "mesh/rest_box.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

namespace {

constexpr std::uint8_t kMostSteps = 16;  ///< more than any history has

/// Calls visit(kind, vertices) for the pairs of primitives of bodies that coincide at rest, of which one `counts`.
template <int Dim, typename Visit>
void for_each_coincident_pair(const Mesh<Dim>& mesh, std::vector<char> counts, const Visit& visit) {
  CollisionSurface surface = collision_surface<Dim>(mesh, {});
  counts.resize(surface.counts.size());
  for (std::size_t v = 0; v < counts.size(); ++v) surface.counts[v] &= counts[v];
  const std::vector<Vec<Dim>>& nodes = mesh.rest();
  const Eigen::Map<const VectorX> rest(nodes[0].data(), Dim * static_cast<Eigen::Index>(nodes.size()));
  const double near = coincidence(mesh);
  ContactCandidates<Dim> candidates;
  candidates.update(surface, rest, near);
  for (const auto& [kind, pairs] : candidates.all())
    for (const auto& pair : *pairs) {
      const auto vertices = vertices_of(surface, kind, pair);
      if (pair_distance_squared<Dim>(kind, gather<Dim>(vertices, pair_size(kind), rest).data()) <= near * near)
        visit(kind, vertices);
    }
}

/// Calls visit(vertex) for the vertex, or the ends of the curved edge, that a node belongs to.
template <int Dim, typename Visit>
void for_each_vertex_of_node(const Mesh<Dim>& mesh, int node, const Visit& visit) {
  const EdgeKey edge = mesh.edge_of_node(node);
  if (edge[0] == kNone) return visit(node);
  for (const VertexId end : edge) visit(end);
}

template <int Dim>
bool is_of_one_part(const Mesh<Dim>& mesh, const std::array<int, 4>& nodes, int count) {
  int part = kNone;
  bool is = true;
  for (int k = 0; k < count; ++k)
    for_each_vertex_of_node(mesh, nodes[k], [&](VertexId v) {
      if (part == kNone) part = mesh.part_of_vertex(v);
      is = is && mesh.part_of_vertex(v) == part;
    });
  return is;
}

template <int Dim>
std::vector<char> closed_nodes(const Mesh<Dim>& mesh) {
  std::vector<char> closed(mesh.num_nodes());
  for (std::size_t node = 0; node < closed.size(); ++node) closed[node] = is_closed(mesh, static_cast<int>(node));
  return closed;
}

/// By vertex, whether it is of a facet that a tie may bond: where it is closed it stays so.
template <int Dim>
std::vector<char> tied_vertices(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  std::vector<char> tied(mesh.num_vertices(), 0);
  std::set<int> tags;
  for (const Tie& tie : setup.ties)
    if (!tie.jump)
      for (const auto* side : {&tie.a, &tie.b}) tags.insert(side->begin(), side->end());
  if (tags.empty()) return tied;
  for (const FacetId f : mesh.live_facets())
    if (tags.contains(mesh.facet_tag(f)))
      for (const VertexId v : mesh.facet(f)) tied[v] = 1;
  return tied;
}

}  // namespace

template <int Dim>
bool is_closed(const Mesh<Dim>& mesh, int node, int age) {
  bool closed = false;
  for_each_vertex_of_node(mesh, node, [&](VertexId v) { closed = closed || mesh.steps_apart(v) <= age; });
  return closed;
}

template <int Dim>
bool has_closed_faces(const Mesh<Dim>& mesh, int age) {
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.steps_apart(v) <= age) return true;
  return false;
}

template <int Dim>
double coincidence(const Mesh<Dim>& mesh) {
  const auto box = rest_box(mesh);
  return coincidence<Dim>(box.min(), box.max());
}

template <int Dim>
void close_coincident_faces(const StepSetup<Dim>& setup, Mesh<Dim>& mesh) {
  if (setup.proxy) return;
  const CellSet<Dim> cells = setup.ties.empty() ? CellSet<Dim>() : whole_mesh(mesh, {});
  for (const auto& mortar : mortars_of(setup, mesh, cells))
    if (!setup.ties[mortar.tie].jump)
      for (const VertexId v : mortar.vertices) mesh.set_steps_apart(v, 0);
  std::vector<char> bonded(mesh.num_vertices(), 0);
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) bonded[v] = mesh.steps_apart(v) == 0;
  const std::vector<char> all(mesh.num_nodes(), 1);
  for_each_coincident_pair<Dim>(mesh, all, [&](PairKind kind, const std::array<int, 4>& vertices) {
    // Bodies that coincide are in contact where a start without overlap is found.
    if (setup.contact.resolve_overlap && !is_of_one_part(mesh, vertices, pair_size(kind))) return;
    std::set<int> parts;  // that a tie closes here already
    for (int k = 0; k < pair_size(kind); ++k)
      for_each_vertex_of_node(mesh, vertices[k], [&](VertexId v) {
        if (bonded[v]) parts.insert(mesh.part_of_vertex(v));
      });
    if (parts.size() > 1) return;
    for (int k = 0; k < pair_size(kind); ++k)
      for_each_vertex_of_node(mesh, vertices[k], [&](VertexId v) { mesh.set_steps_apart(v, 0); });
  });
}

template <int Dim>
bool has_only_tied_faces(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  const std::vector<char> tied = tied_vertices(setup, mesh);
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.steps_apart(v) == 0 && !tied[v]) return false;
  return true;
}

template <int Dim>
void open_faces(const StepSetup<Dim>& setup, const ChordLevels& chords, const VectorX& x, Mesh<Dim>& mesh) {
  std::vector<char> stay = tied_vertices(setup, mesh);
  if (has_closed_faces(mesh) && !has_only_tied_faces(setup, mesh)) {
    const double dhat = setup.contact.enabled ? setup.contact.dhat : setup.contact.reach_of_closed();
    const auto visit = [&](PairKind kind, const std::array<int, 4>& vertices) {
      if (pair_distance_squared<Dim>(kind, gather<Dim>(vertices, pair_size(kind), x).data()) >= dhat * dhat) return;
      for (int k = 0; k < pair_size(kind); ++k) for_each_vertex_of_node(mesh, vertices[k], [&](VertexId v) { stay[v] = 1; });
    };
    for_each_coincident_pair(mesh, closed_nodes(mesh), visit);
  }
  std::vector<VertexId> opened;
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
    const std::uint8_t steps = mesh.steps_apart(v);
    if (steps == kApart || (steps == 0 && stay[v])) continue;
    if (steps == 0) opened.push_back(v);
    mesh.set_steps_apart(v, steps < kMostSteps ? static_cast<std::uint8_t>(steps + 1) : kApart);
  }
  if (opened.empty()) return;
  const ContactSurface<Dim> contact = contact_surface(setup, mesh, chords);
  if (has_intersection<Dim>(contact.surface, contact.positions(x)))  // of others that are near at rest
    for (const VertexId v : opened) mesh.set_steps_apart(v, 0);
}

template <int Dim>
Overlap<Dim> find_overlap(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ContactSurface<Dim>& contact,
                          const ClosedSurface<Dim>& boundary) {
  std::vector<char> left_out;
  if (!setup.ties.empty()) {
    const std::vector<char> tied = tied_vertices(setup, mesh);
    const auto is_tied = [&](int node) {
      bool is = false;
      if (node < mesh.num_nodes()) for_each_vertex_of_node(mesh, node, [&](VertexId v) { is = is || tied[v]; });
      return is;
    };
    left_out.resize(contact.surface.area.size());
    for (int i = 0; i < static_cast<int>(left_out.size()); ++i)
      left_out[i] = contact.map ? std::ranges::any_of(contact.map->sources(i), is_tied) : is_tied(i);
  }
  return boundary.find_overlap(contact.surface.closed, left_out);
}

#define ITR_INSTANTIATE(Dim)                                                                              \
  template bool is_closed(const Mesh<Dim>&, int, int);                                                    \
  template bool has_closed_faces(const Mesh<Dim>&, int);                                                  \
  template double coincidence(const Mesh<Dim>&);                                                          \
  template void close_coincident_faces(const StepSetup<Dim>&, Mesh<Dim>&);                                \
  template bool has_only_tied_faces(const StepSetup<Dim>&, const Mesh<Dim>&);                             \
  template void open_faces(const StepSetup<Dim>&, const ChordLevels&, const VectorX&, Mesh<Dim>&);        \
  template Overlap<Dim> find_overlap(const StepSetup<Dim>&, const Mesh<Dim>&, const ContactSurface<Dim>&, \
                                     const ClosedSurface<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
