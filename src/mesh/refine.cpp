// SPDX-License-Identifier: MIT
#include "mesh/refine.hpp"

#include <algorithm>
#include <map>

#include "core/check.hpp"

namespace itr {

namespace {

/// Midpoints of edges, numbered behind the old vertices in the order of their edges' vertices.
template <int Dim>
class Midpoints {
 public:
  Midpoints(const Mesh<Dim>& mesh, std::vector<Vec<Dim>>& rest) {
    for (const EdgeKey& edge : mesh.edges()) {
      ids_[edge] = static_cast<VertexId>(rest.size());
      rest.push_back(0.5 * (mesh.rest(edge[0]) + mesh.rest(edge[1])));
    }
  }

  VertexId operator()(VertexId a, VertexId b) const { return ids_.at(edge_key(a, b)); }

 private:
  std::map<EdgeKey, VertexId> ids_;
};

std::array<std::array<VertexId, 3>, 4> children(const std::array<VertexId, 3>& c, const Midpoints<2>& mid) {
  const VertexId m01 = mid(c[0], c[1]), m02 = mid(c[0], c[2]), m12 = mid(c[1], c[2]);
  return {{{c[0], m01, m02}, {c[1], m12, m01}, {c[2], m02, m12}, {m01, m12, m02}}};
}

/// The diagonal of the inner octahedron is chosen by the numbers of the vertices, as in PolyFEM (which sorts the vertices of
/// tetrahedra), so that meshes refined twice are the same as there.
std::array<std::array<VertexId, 4>, 8> children(const std::array<VertexId, 4>& cell, const Midpoints<3>& mid) {
  std::array<VertexId, 4> c = cell;
  bool is_odd = false;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) is_odd ^= cell[i] > cell[j];
  std::sort(c.begin(), c.end());
  const VertexId m01 = mid(c[0], c[1]), m02 = mid(c[0], c[2]), m03 = mid(c[0], c[3]);
  const VertexId m12 = mid(c[1], c[2]), m13 = mid(c[1], c[3]), m23 = mid(c[2], c[3]);
  std::array<std::array<VertexId, 4>, 8> result = {{{c[0], m01, m02, m03},
                                                    {m01, c[1], m12, m13},
                                                    {m02, m12, c[2], m23},
                                                    {m03, m13, m23, c[3]},
                                                    // around the diagonal m01 - m23 of the octahedron
                                                    {m01, m23, m02, m03},
                                                    {m01, m23, m03, m13},
                                                    {m01, m23, m13, m12},
                                                    {m01, m23, m12, m02}}};
  if (is_odd)
    for (auto& child : result) std::swap(child[0], child[1]);
  return result;
}

std::array<std::array<VertexId, 2>, 2> children_of_facet(const std::array<VertexId, 2>& f, const Midpoints<2>& mid) {
  const VertexId m = mid(f[0], f[1]);
  return {{{f[0], m}, {m, f[1]}}};
}

std::array<std::array<VertexId, 3>, 4> children_of_facet(const std::array<VertexId, 3>& f, const Midpoints<3>& mid) {
  const VertexId m01 = mid(f[0], f[1]), m02 = mid(f[0], f[2]), m12 = mid(f[1], f[2]);
  return {{{f[0], m01, m02}, {f[1], m12, m01}, {f[2], m02, m12}, {m01, m12, m02}}};
}

}  // namespace

template <int Dim>
Mesh<Dim> refine_uniformly(const Mesh<Dim>& mesh) {
  ITR_CHECK(mesh.num_vertices() == mesh.node_slots(), mesh.num_vertices(), mesh.node_slots());
  std::vector<Vec<Dim>> rest;
  rest.reserve(mesh.node_slots());
  for (VertexId v = 0; v < mesh.node_slots(); ++v) rest.push_back(mesh.rest(v));
  const Midpoints<Dim> mid(mesh, rest);

  std::vector<typename Mesh<Dim>::Cell> cells;
  std::vector<int> body;
  for (const CellId c : mesh.live_cells()) {
    for (const auto& child : children(mesh.cell(c), mid)) {
      cells.push_back(child);
      body.push_back(mesh.body(c));
    }
  }

  std::vector<std::pair<typename Mesh<Dim>::Facet, int>> tagged;
  for (const FacetId f : mesh.live_facets())
    if (mesh.facet_tag(f) != kNoTag)
      for (const auto& child : children_of_facet(mesh.facet(f), mid)) tagged.emplace_back(child, mesh.facet_tag(f));

  Mesh<Dim> refined(std::move(rest), std::move(cells), std::move(body));
  for (const auto& [facet, tag] : tagged) refined.set_facet_tag(refined.find_facet(facet), tag);
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) refined.set_vertex_tag(v, mesh.vertex_tag(v));
  for (const EdgeKey& edge : mesh.edges()) refined.set_vertex_tag(mid(edge[0], edge[1]), mesh.edge_tag(edge));
  if constexpr (Dim == 2) refined.set_axisymmetric(mesh.is_axisymmetric());
  return refined;
}

template Mesh<2> refine_uniformly(const Mesh<2>&);
template Mesh<3> refine_uniformly(const Mesh<3>&);

}  // namespace itr
