// SPDX-License-Identifier: MIT
#include "itr/mesh.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <map>
#include <string>

#include "core/check.hpp"
#include "core/connected_parts.hpp"
#include "geometry/measures.hpp"
#include "itr/core.hpp"

namespace itr {

namespace {

/// Whether the order of distinct ids is an even permutation of ascending order.
template <std::size_t N>
bool is_even(const std::array<int, N>& ids) {
  bool even = true;
  for (std::size_t i = 0; i < N; ++i)
    for (std::size_t j = i + 1; j < N; ++j) even = even != (ids[i] > ids[j]);
  return even;
}

void erase_value(std::vector<int>& list, int value) { list.erase(std::find(list.begin(), list.end(), value)); }

}  // namespace

template <>
MeshTypes<2>::Facet opposite_facet<2>(const MeshTypes<2>::Cell& c, int k) {
  return {c[(k + 1) % 3], c[(k + 2) % 3]};
}

template <>
MeshTypes<3>::Facet opposite_facet<3>(const MeshTypes<3>::Cell& c, int k) {
  static constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  return {c[kFaces[k][0]], c[kFaces[k][1]], c[kFaces[k][2]]};
}

template <int Dim>
Mesh<Dim>::Mesh(std::vector<Vec<Dim>> rest, std::vector<Cell> cells, std::vector<int> body)
    : num_vertices_(static_cast<int>(rest.size())), rest_(std::move(rest)) {
  ITR_CHECK(cells.size() == body.size(), cells.size(), body.size());
  vertex_alive_.assign(rest_.size(), 1);
  vertex_tag_.assign(rest_.size(), kNoTag);
  steps_apart_.assign(rest_.size(), kApart);
  cells_of_.resize(rest_.size());
  facets_of_.resize(rest_.size());
  std::map<Facet, std::pair<int, Facet>> facets;  // sorted vertices -> number of cells, outward facet of the first
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const auto place = [&] { return "cell " + std::to_string(c); };
    for (const int v : cells[c])
      if (v < 0 || v >= node_slots())
        throw InputError({"", place(), "vertex index " + std::to_string(v), "0 to " + std::to_string(node_slots() - 1)});
    add_cell(cells[c], body[c], kNone);
    if (!(volume_.back() > 0 && std::isfinite(volume_.back())))
      throw InputError({"", place(), "rest volume " + std::to_string(volume_.back()),
                        "a positive, finite one (not degenerate or inverted)"});
    for (int k = 0; k <= Dim; ++k) {
      const Facet facet = opposite_facet<Dim>(cells[c], k);
      auto& entry = facets.try_emplace(ascending(facet), 0, facet).first->second;
      if (++entry.first > 2) throw InputError({"", place(), "a facet with more than two cells", "a manifold mesh"});
      if (entry.first == 2 && is_even(facet) == is_even(entry.second))
        throw InputError({"", place(), "a cell that lies on another one of the same facet, or is there twice",
                          "cells that do not overlap"});
    }
  }
  for (const auto& [key, entry] : facets)
    if (entry.first == 1) add_facet(entry.second, kNoTag);
  const std::vector<int> part = connected_parts<Dim + 1>(rest_.size(), cells_);
  for (std::size_t c = 0; c < cells_.size(); ++c) part_[c] = part[cells_[c][0]];
  renew_revision();
}

template <int Dim>
void Mesh<Dim>::renew_revision() {
  static std::atomic<std::uint64_t> last{0};
  revision_ = ++last;
}

template <int Dim>
void Mesh<Dim>::set_facets(const std::vector<Facet>& facets, const std::vector<int>& tags) {
  ITR_CHECK(facets.size() == tags.size(), facets.size(), tags.size());
  std::vector<Facet> found;
  for (const Facet& facet : facets) {
    const bool in_range = std::all_of(facet.begin(), facet.end(), [&](int v) { return v >= 0 && v < node_slots(); });
    const FacetId f = in_range ? find_facet(facet) : kNone;
    if (f == kNone)
      throw InputError({"", "facet " + std::to_string(found.size()), "one that is not on the boundary", "a boundary facet"});
    found.push_back(ascending(facet));
  }
  std::sort(found.begin(), found.end());
  if (static_cast<int>(found.size()) != num_facets_ || std::adjacent_find(found.begin(), found.end()) != found.end())
    throw InputError({"", "facets", std::to_string(found.size()), std::to_string(num_facets_) + " different ones"});
  for (auto& list : facets_of_) list.clear();
  facets_.clear();
  facet_tag_.clear();
  num_facets_ = 0;
  for (std::size_t f = 0; f < facets.size(); ++f) add_facet(facets[f], tags[f]);
  renew_revision();
}

template <int Dim>
bool Mesh<Dim>::is_compact() const {
  return num_nodes() == node_slots() && num_cells_ == cell_slots() && num_facets_ == facet_slots() &&
         std::find(vertex_alive_.begin(), vertex_alive_.begin() + num_vertices_, 0) == vertex_alive_.begin() + num_vertices_;
}

template <int Dim>
std::array<Vec<Dim>, Dim + 1> Mesh<Dim>::corners(CellId c) const {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = rest_[cells_[c][k]];
  return p;
}

template <int Dim>
void Mesh<Dim>::update_geometry(CellId c) {
  const auto p = corners(c);
  const Mat<Dim> edges = edge_matrix<Dim>(p);
  volume_[c] = simplex_volume<Dim>(edges);
  quality_[c] = simplex_quality<Dim>(p);
  inverse_edges_[c] = edges.inverse();
}

template <int Dim>
void Mesh<Dim>::add_cell(const Cell& cell, int body, int part) {
  const int c = cell_slots();
  cells_.push_back(cell);
  body_.push_back(body);
  part_.push_back(part);
  volume_.push_back(0);
  quality_.push_back(0);
  inverse_edges_.emplace_back();
  update_geometry(c);
  for (const int v : cell) cells_of_[v].push_back(c);
  ++num_cells_;
}

template <int Dim>
Vec<Dim> Mesh<Dim>::barycenter(CellId c) const {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const VertexId v : cells_[c]) sum += rest_[v];
  return sum / (Dim + 1);
}

template <int Dim>
RestPoint<Dim> Mesh<Dim>::point(VertexId v) const {
  if (cells_of_[v].empty()) return rest_[v];
  const CellId c = cells_of_[v][0];
  return {rest_[v], barycenter(c) - rest_[v], part_[c]};
}

template <int Dim>
RestPoint<Dim> Mesh<Dim>::middle(const EdgeKey& edge) const {
  const Vec<Dim> X = (rest_[edge[0]] + rest_[edge[1]]) / 2;
  for (const CellId c : cells_of_[edge[0]])
    if (std::find(cells_[c].begin(), cells_[c].end(), edge[1]) != cells_[c].end()) return {X, barycenter(c) - X, part_[c]};
  return X;
}

template <int Dim>
void Mesh<Dim>::add_facet(const Facet& facet, int tag) {
  const int f = facet_slots();
  facets_.push_back(facet);
  facet_tag_.push_back(tag);
  for (const int v : facet) facets_of_[v].push_back(f);
  ++num_facets_;
}

template <int Dim>
void Mesh<Dim>::remove_cell(CellId c) {
  for (const int v : cells_[c]) erase_value(cells_of_[v], c);
  cells_[c].fill(kNone);
  --num_cells_;
}

template <int Dim>
void Mesh<Dim>::remove_facet(FacetId f) {
  for (const int v : facets_[f]) erase_value(facets_of_[v], f);
  facets_[f].fill(kNone);
  --num_facets_;
}

template <int Dim>
std::vector<CellId> Mesh<Dim>::cells_of_edge(const EdgeKey& edge) const {
  std::vector<CellId> found;
  found.reserve(Dim == 2 ? 2 : 8);
  for (const CellId c : cells_of_[edge[0]])
    if (std::find(cells_[c].begin(), cells_[c].end(), edge[1]) != cells_[c].end()) found.push_back(c);
  std::sort(found.begin(), found.end());
  return found;
}

template <int Dim>
bool Mesh<Dim>::are_joined(VertexId a, VertexId b) const {
  return std::any_of(cells_of_[a].begin(), cells_of_[a].end(),
                     [&](CellId c) { return std::find(cells_[c].begin(), cells_[c].end(), b) != cells_[c].end(); });
}

template <int Dim>
std::vector<FacetId> Mesh<Dim>::facets_of_edge(const EdgeKey& edge) const {
  std::vector<FacetId> found;
  for (const FacetId f : facets_of_[edge[0]])
    if (std::find(facets_[f].begin(), facets_[f].end(), edge[1]) != facets_[f].end()) found.push_back(f);
  return found;
}

template <int Dim>
bool Mesh<Dim>::is_on_interface(VertexId v) const {
  return std::any_of(cells_of_[v].begin(), cells_of_[v].end(), [&](CellId c) { return body_[c] != body_[cells_of_[v][0]]; });
}

template <int Dim>
FacetId Mesh<Dim>::find_facet(const Facet& vertices) const {
  const Facet key = ascending(vertices);
  for (const FacetId f : facets_of_[vertices[0]])
    if (ascending(facets_[f]) == key) return f;
  return kNone;
}

template <int Dim>
std::vector<EdgeKey> Mesh<Dim>::edges() const {
  std::vector<EdgeKey> all;
  for (VertexId v = 0; v < node_slots(); ++v) {
    const auto first = static_cast<std::ptrdiff_t>(all.size());
    for (const CellId c : cells_of_[v])
      for (const VertexId w : cells_[c])
        if (w > v) all.push_back({v, w});
    std::sort(all.begin() + first, all.end());
    all.erase(std::unique(all.begin() + first, all.end()), all.end());
  }
  return all;
}

template <int Dim>
double Mesh<Dim>::total_volume() const {
  double sum = 0;
  for (const CellId c : live_cells()) sum += volume_[c];
  return sum;
}

template <int Dim>
bool Mesh<Dim>::is_curved(CellId c) const {
  if (!has_nodes()) return false;
  const Cell& cell = cells_[c];
  for (int i = 0; i <= Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j)
      if (node_of(cell[i], cell[j]) != kNone) return true;
  return false;
}

template <int Dim>
VertexId Mesh<Dim>::add_node(const EdgeKey& edge) {
  const VertexId node = node_slots();
  ITR_CHECK(edge[0] < edge[1] && node_of(edge[0], edge[1]) == kNone, edge[0], edge[1]);
  if (static_cast<int>(nodes_from_.size()) <= edge[0]) nodes_from_.resize(edge[0] + 1);
  nodes_from_[edge[0]].emplace_back(edge[1], node);
  edge_of_node_.resize(node + 1, {kNone, kNone});
  edge_of_node_[node] = edge;
  ++num_curved_;
  rest_.push_back((rest_[edge[0]] + rest_[edge[1]]) / 2);
  vertex_alive_.push_back(0);
  vertex_tag_.push_back(kNoTag);
  steps_apart_.push_back(std::min(steps_apart_[edge[0]], steps_apart_[edge[1]]));
  cells_of_.emplace_back();
  facets_of_.emplace_back();
  renew_revision();
  return node;
}

/// Removes the slots behind the vertices, of a mesh that has others nowhere.
template <int Dim>
void Mesh<Dim>::remove_nodes() {
  num_curved_ = 0;
  nodes_from_.clear();
  edge_of_node_.clear();
  rest_.resize(num_vertices_);
  vertex_alive_.assign(num_vertices_, 1);
  vertex_tag_.resize(num_vertices_);
  steps_apart_.resize(num_vertices_);
  cells_of_.resize(num_vertices_);
  facets_of_.resize(num_vertices_);
}

template <int Dim>
void Mesh<Dim>::set_curved_edges(const std::vector<EdgeKey>& edges) {
  ITR_CHECK(is_compact(), node_slots(), num_vertices_);
  for (const auto& [a, b] : edges)
    if (a < 0 || b <= a || b >= num_vertices_ || !are_joined(a, b))
      throw InputError({"", "curved edges", std::to_string(a) + "-" + std::to_string(b), "edges of the mesh"});
  if (std::adjacent_find(edges.begin(), edges.end(), std::greater_equal<>()) != edges.end())
    throw InputError({"", "curved edges", "rows in another order", "ascending rows"});
  remove_nodes();
  for (const EdgeKey& edge : edges) add_node(edge);
  renew_revision();
}

template <int Dim>
std::vector<EdgeKey> Mesh<Dim>::curved_edges() const {
  std::vector<EdgeKey> edges;
  edges.reserve(num_curved_);
  for (const EdgeKey& edge : edge_of_node_)
    if (edge[0] != kNone) edges.push_back(edge);
  std::sort(edges.begin(), edges.end());
  return edges;
}

template <int Dim>
VertexId Mesh<Dim>::apply(const Edit<Dim>& edit) {
  VertexId created = kNone;
  std::uint8_t steps_apart = kApart;
  if (edit.value)
    for (int k = 0; k < edit.value->num_parents; ++k)
      steps_apart = std::min(steps_apart, steps_apart_[edit.value->parents[k]]);
  if (edit.value && edit.value->vertex == kNewVertex) {
    created = node_slots();
    rest_.push_back(edit.value->rest);
    vertex_alive_.push_back(1);
    vertex_tag_.push_back(edit.value->tag);
    steps_apart_.push_back(steps_apart);
    cells_of_.emplace_back();
    facets_of_.emplace_back();
    ++num_vertices_;
  } else if (edit.value) {
    rest_[edit.value->vertex] = edit.value->rest;
    steps_apart_[edit.value->vertex] = steps_apart;
  }
  const auto resolve = [&](auto ids) {
    for (int& v : ids)
      if (v == kNewVertex) v = created;
    return ids;
  };
  const int part = edit.removed_cells.empty() ? kNone : part_[edit.removed_cells[0]];
  for (const CellId c : edit.removed_cells) remove_cell(c);
  for (const FacetId f : edit.removed_facets) remove_facet(f);
  for (const auto& cell : edit.inserted_cells) {
    add_cell(resolve(cell.vertices), cell.body, part);
    ITR_CHECK(volume_.back() > 0, volume_.back());
  }
  for (const auto& facet : edit.inserted_facets) add_facet(resolve(facet.vertices), facet.tag);
  if (edit.removed_vertex != kNone) {
    const VertexId v = edit.removed_vertex;
    ITR_CHECK(cells_of_[v].empty() && facets_of_[v].empty(), v);
    vertex_alive_[v] = 0;
    --num_vertices_;
  }
  for (const EdgeKey& curved : edit.removed_nodes) {
    const VertexId node = node_of(curved[0], curved[1]);
    ITR_CHECK(node != kNone, curved[0], curved[1]);
    edge_of_node_[node] = {kNone, kNone};
    std::erase_if(nodes_from_[std::min(curved[0], curved[1])], [&](const auto& entry) { return entry.second == node; });
    --num_curved_;
  }
  for (const auto& node : edit.inserted_nodes) {
    const EdgeKey ends = resolve(node.edge);
    add_node(edge_key(ends[0], ends[1]));
  }
  renew_revision();
  return created;
}

template <int Dim>
MeshRenumbering Mesh<Dim>::compact() {
  MeshRenumbering map{std::vector<VertexId>(node_slots(), kNone), std::vector<CellId>(cell_slots(), kNone),
                      std::vector<FacetId>(facet_slots(), kNone)};
  int vertices = 0, cells = 0, facets = 0;
  for (int v = 0; v < node_slots(); ++v) {
    if (!vertex_alive_[v]) continue;
    map.vertex[v] = vertices;
    vertex_tag_[vertices] = vertex_tag_[v];
    steps_apart_[vertices] = steps_apart_[v];
    rest_[vertices++] = rest_[v];
  }
  const std::vector<EdgeKey> curved = curved_edges();
  for (std::size_t i = 0; i < curved.size(); ++i)
    map.vertex[node_of(curved[i][0], curved[i][1])] = vertices + static_cast<int>(i);
  const auto renumber = [&](auto ids) {
    for (int& v : ids) v = map.vertex[v];
    return ids;
  };
  cells_of_.assign(vertices, {});
  facets_of_.assign(vertices, {});
  for (const CellId c : live_cells()) {
    const int to = map.cell[c] = cells++;
    cells_[to] = renumber(cells_[c]);
    body_[to] = body_[c];
    part_[to] = part_[c];
    volume_[to] = volume_[c];
    quality_[to] = quality_[c];
    inverse_edges_[to] = inverse_edges_[c];
    for (const int v : cells_[to]) cells_of_[v].push_back(to);
  }
  for (const FacetId f : live_facets()) {
    const int to = map.facet[f] = facets++;
    facets_[to] = renumber(facets_[f]);
    facet_tag_[to] = facet_tag_[f];
    for (const int v : facets_[to]) facets_of_[v].push_back(to);
  }
  remove_nodes();
  cells_.resize(cells);
  body_.resize(cells);
  part_.resize(cells);
  volume_.resize(cells);
  quality_.resize(cells);
  inverse_edges_.resize(cells);
  facets_.resize(facets);
  facet_tag_.resize(facets);
  for (const EdgeKey& edge : curved) add_node(renumber(edge));
  renew_revision();
  return map;
}

template <int Dim>
std::string Mesh<Dim>::find_defect() const {
  std::map<Facet, std::pair<int, Facet>> seen;
  int alive = 0;
  for (const CellId c : live_cells()) {
    ++alive;
    if (!(volume_[c] > 0)) return "cell " + std::to_string(c) + " has rest volume " + std::to_string(volume_[c]);
    if (volume_[c] != simplex_volume<Dim>(corners(c))) return "cell " + std::to_string(c) + " has an outdated volume";
    for (const int v : cells_[c]) {
      if (!vertex_alive_[v]) return "cell " + std::to_string(c) + " uses dead vertex " + std::to_string(v);
      if (std::count(cells_of_[v].begin(), cells_of_[v].end(), c) != 1) return "adjacency of vertex " + std::to_string(v);
    }
    for (int k = 0; k <= Dim; ++k) {
      const Facet facet = opposite_facet<Dim>(cells_[c], k);
      if (++seen.try_emplace(ascending(facet), 0, facet).first->second.first > 2) return "facet with more than two cells";
    }
  }
  if (alive != num_cells_) return "wrong number of cells";
  int boundary = 0;
  for (const auto& [key, entry] : seen) {
    if (entry.first != 1) continue;
    ++boundary;
    const FacetId f = find_facet(key);
    if (f == kNone) return "boundary facet at vertex " + std::to_string(key[0]) + " is missing";
    if (is_even(facets_[f]) != is_even(entry.second)) return "facet " + std::to_string(f) + " is oriented inward";
  }
  if (boundary != num_facets_) return "a facet that is not on the boundary";
  const auto is_node = [](const EdgeKey& edge) { return edge[0] != kNone; };
  if (std::count_if(edge_of_node_.begin(), edge_of_node_.end(), is_node) != num_curved_) return "wrong number of nodes";
  for (VertexId node = 0; node < static_cast<int>(edge_of_node_.size()); ++node) {
    const EdgeKey& edge = edge_of_node_[node];
    if (!is_node(edge)) continue;
    if (!vertex_alive_[edge[0]] || !vertex_alive_[edge[1]] || !are_joined(edge[0], edge[1]))
      return "node " + std::to_string(node) + " of an edge that is gone";
    if (vertex_alive_[node] || node_of(edge[0], edge[1]) != node) return "node " + std::to_string(node) + " is of two edges";
  }
  std::ptrdiff_t listed = 0;
  for (const auto& nodes : nodes_from_) listed += std::ssize(nodes);
  if (listed != num_curved_) return "wrong number of curved edges";
  return {};
}

template <int Dim>
std::vector<EdgeKey> edges_of_order_2(const Mesh<Dim>& mesh, const std::map<int, int>& order) {
  const auto is_quadratic = [&](CellId c) {
    const auto entry = order.find(mesh.body(c));
    return entry != order.end() && entry->second == 2;
  };
  if (std::none_of(order.begin(), order.end(), [](const auto& entry) { return entry.second == 2; })) return {};
  std::vector<EdgeKey> curved, straight, result;
  for (const CellId c : mesh.live_cells()) {
    auto& edges = is_quadratic(c) ? curved : straight;
    const auto vertices = ascending(mesh.cell(c));
    for (int i = 0; i <= Dim; ++i)
      for (int j = i + 1; j <= Dim; ++j) edges.push_back({vertices[i], vertices[j]});
  }
  for (auto* edges : {&curved, &straight}) {
    std::sort(edges->begin(), edges->end());
    edges->erase(std::unique(edges->begin(), edges->end()), edges->end());
  }
  std::set_difference(curved.begin(), curved.end(), straight.begin(), straight.end(), std::back_inserter(result));
  return result;
}

template class Mesh<2>;
template class Mesh<3>;
template std::vector<EdgeKey> edges_of_order_2<2>(const Mesh<2>&, const std::map<int, int>&);
template std::vector<EdgeKey> edges_of_order_2<3>(const Mesh<3>&, const std::map<int, int>&);

}  // namespace itr
