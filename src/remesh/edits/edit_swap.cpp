// SPDX-License-Identifier: MIT

#include "edit_checks.hpp"
#include "mesh/edge_ring.hpp"
#include "old_fields.hpp"

namespace itr {

namespace {

/// A planar polygon of ring vertices around an edge a-b, counterclockwise seen from b, to be cut into triangles, each of
/// which is the base of a cell to a and of one to b.
struct Polygon {
  std::vector<VertexId> vertices;
  int body;
};

/// The cut of least cost by dynamic programming over the polygon's stretches (Klincsek 1980).
class LeastCut {
 public:
  /// `draft` removes the edge, with a node for each edge that a cut may make if that edge is curved.
  LeastCut(const Mesh<3>& mesh, const Edit<3>& draft, const Polygon& polygon, double least_quality, const CellCost& cost)
      : mesh_(mesh), draft_(draft), polygon_(polygon), least_quality_(least_quality), cost_of_(cost) {
    const int n = static_cast<int>(polygon.vertices.size());
    for (int length = 2; length < n; ++length)
      for (int i = 0; i + length < n; ++i) {
        Stretch best{.cost = HUGE_VAL};
        for (int k = i + 1; k < i + length; ++k) {
          const double parts = stretches_[i][k].cost + stretches_[k][i + length].cost;
          if (!(parts < HUGE_VAL)) continue;
          const double cost = parts + triangle_cost(i, k, i + length);
          if (cost < best.cost) best = {cost, k};
        }
        stretches_[i][i + length] = best;
      }
  }

  double cost() const { return stretches_[0][polygon_.vertices.size() - 1].cost; }
  /// Whether only the caller's cost stood in the way of some triangle.
  bool cost_forbids() const { return cost_forbids_; }

  void append_cells(std::vector<Edit<3>::NewCell>& cells) const {
    append(0, static_cast<int>(polygon_.vertices.size()) - 1, cells);
  }
  /// The edges that the cut makes inside of the polygon.
  std::vector<EdgeKey> diagonals() const {
    std::vector<EdgeKey> found;
    append_diagonals(0, static_cast<int>(polygon_.vertices.size()) - 1, found);
    return found;
  }

 private:
  struct Stretch {  ///< polygon from vertex i to j, closed by the edge i-j
    double cost = 0;
    int apex = kNone;  ///< of the triangle at that edge
  };

  std::array<Mesh<3>::Cell, 2> cells_on(int i, int k, int j) const {
    const VertexId u = polygon_.vertices[i], v = polygon_.vertices[k], w = polygon_.vertices[j];
    return {{{u, w, v, draft_.edge[0]}, {u, v, w, draft_.edge[1]}}};
  }
  double triangle_cost(int i, int k, int j) {
    double sum = 0;
    const auto cells = cells_on(i, k, j);
    for (const auto& cell : cells) {
      const double quality = quality_with<3>(mesh_, cell, kNone, Vec<3>::Zero());
      if (!(quality > 0 && quality >= least_quality_)) return HUGE_VAL;
    }
    for (const auto& cell : cells) sum += cost_of_(cell, polygon_.body, draft_);
    if (sum < HUGE_VAL) return sum;
    cost_forbids_ = true;
    return HUGE_VAL;
  }
  void append(int i, int j, std::vector<Edit<3>::NewCell>& cells) const {
    if (j - i < 2) return;
    const int k = stretches_[i][j].apex;
    for (const auto& cell : cells_on(i, k, j)) cells.push_back({cell, polygon_.body});
    append(i, k, cells);
    append(k, j, cells);
  }
  void append_diagonals(int i, int j, std::vector<EdgeKey>& found) const {
    if (j - i < 2) return;
    const int k = stretches_[i][j].apex;
    for (const auto& [from, to] : {std::pair(i, k), std::pair(k, j)})
      if (to - from > 1) found.push_back({polygon_.vertices[from], polygon_.vertices[to]});
    append_diagonals(i, k, found);
    append_diagonals(k, j, found);
  }

  const Mesh<3>& mesh_;
  const Edit<3>& draft_;
  const Polygon& polygon_;
  double least_quality_;
  const CellCost& cost_of_;
  bool cost_forbids_ = false;
  std::array<std::array<Stretch, kLongestRing + 1>, kLongestRing + 1> stretches_{};
};

/// The ring as polygons of one body each: itself in the volume, the fan at the surface, one on each side of an interface.
/// The polygons' closing edges are then in the patch.
std::vector<Polygon> polygons_of(const Mesh<3>& mesh, const EdgeRing& ring) {
  const int n = static_cast<int>(ring.vertices.size());
  const auto body = [&](int i) { return mesh.body(ring.cells[i]); };
  std::vector<int> cuts;  // ring vertices between cells of different bodies
  if (ring.closed)
    for (int i = 0; i < n; ++i)
      if (body(i) != body((i + n - 1) % n)) cuts.push_back(i);
  if (cuts.empty()) return {{ring.vertices, body(0)}};
  std::vector<Polygon> polygons;
  for (std::size_t p = 0; p < cuts.size(); ++p) {
    const int begin = cuts[p], end = cuts[(p + 1) % cuts.size()];
    Polygon polygon{{}, body(begin)};
    for (int i = begin; i != end; i = (i + 1) % n) polygon.vertices.push_back(ring.vertices[i]);
    polygon.vertices.push_back(ring.vertices[end]);
    polygons.push_back(polygon);
  }
  return polygons;
}

/// Where the edge is curved, so is whatever edge its removal makes.
Edit<3> draft_removal(const Mesh<3>& mesh, const EdgeKey& edge, const std::vector<CellId>& cells,
                      const std::vector<Polygon>& polygons) {
  Edit<3> draft{.kind = Edit<3>::Kind::swap, .edge = edge, .removed_cells = cells};
  if (mesh.node_of(edge[0], edge[1]) == kNone) return draft;
  draft.removed_nodes.push_back(edge);
  for (const auto& [vertices, body] : polygons)
    for (std::size_t i = 0; i < vertices.size(); ++i)
      for (std::size_t j = i + 1; j < vertices.size(); ++j)
        if (!mesh.are_joined(vertices[i], vertices[j]) && draft.inserted_node(edge_key(vertices[i], vertices[j])) == kNone)
          insert_node(mesh, vertices[i], vertices[j], draft);
  return draft;
}

/// The two facets at the edge swap in their plane: a-b gives way to u-v.
void swap_facets(const Mesh<3>& mesh, const Strata<3>& strata, const EdgeRing& ring, Edit<3>& edit) {
  const auto [a, b] = edit.edge;
  const auto sheets = strata.sheets_of_edge(mesh, edit.edge);
  std::array<VertexId, 2> apex{};
  for (int i = 0; i < 2; ++i)
    for (const int v : sheets[i].vertices)
      if (v != a && v != b) apex[i] = v;
  if (sheets[0].is_boundary) {
    edit.removed_facets = mesh.facets_of_edge(edit.edge);
    const FacetId parent = edit.removed_facets[0];
    const VertexId first = ring.vertices.front(), last = ring.vertices.back();
    edit.inserted_facets = {{{first, b, last}, mesh.facet_tag(parent), parent},
                            {{first, last, a}, mesh.facet_tag(parent), parent}};
  } else {
    for (const auto& sheet : sheets) edit.removed_interfaces.push_back(ascending(sheet.vertices));
    for (const VertexId end : {a, b})
      edit.inserted_interfaces.push_back({ascending(Mesh<3>::Facet{apex[0], apex[1], end}), edit.removed_interfaces[0]});
  }
}

}  // namespace

Proposal<3> propose_edge_removal(const Mesh<3>& mesh, const Strata<3>& strata, const EdgeKey& edge, const CellCost& cost,
                                 const QualityRule& rule) {
  const auto ring = ring_of_edge(mesh, edge);
  if (!ring) return refused<3>(mesh.cells_of_edge(edge).empty() ? Refusal::gone : Refusal::non_manifold);
  const Stratum along = strata.edge(mesh, edge);
  if (along != Stratum::volume && along != Stratum::surface) return refused<3>(Refusal::held);
  if (ring->vertices.size() > kLongestRing) return refused<3>(Refusal::long_ring);
  const double least = rule.least(worst_quality<3>(mesh, ring->cells));

  const auto polygons = polygons_of(mesh, *ring);
  const Edit<3> draft = draft_removal(mesh, edge, ring->cells, polygons);
  Edit<3> edit = draft;
  for (const Polygon& polygon : polygons) {
    if (polygon.vertices.size() < 3) return refused<3>(Refusal::shape);  // a flat cell on a patch
    const LeastCut cut(mesh, draft, polygon, least, cost);
    if (!(cut.cost() < HUGE_VAL)) return refused<3>(cut.cost_forbids() ? Refusal::cost : Refusal::shape);
    for (const auto& [u, v] : cut.diagonals())
      if (mesh.are_joined(u, v)) return refused<3>(Refusal::exists);
    cut.append_cells(edit.inserted_cells);
  }
  if (along == Stratum::surface) {
    const auto& closing = polygons[0].vertices;
    if (mesh.are_joined(closing.front(), closing.back())) return refused<3>(Refusal::exists);
    if (has_tag(mesh, edge) || has_tag<3>(mesh, {closing.front(), closing.back()})) return refused<3>(Refusal::held);
    swap_facets(mesh, strata, *ring, edit);
  }
  std::erase_if(edit.inserted_nodes, [&](const auto& node) {
    return std::none_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
      return holds(cell.vertices, node.edge[0]) && holds(cell.vertices, node.edge[1]);
    });
  });
  return {.edit = std::move(edit)};
}

Proposal<3> propose_facet_removal(const Mesh<3>& mesh, const MeshTypes<3>::Facet& facet, const QualityRule& rule) {
  std::vector<CellId> cells;
  for (const CellId c : mesh.cells_of(facet[0]))
    if (holds(mesh.cell(c), facet[1]) && holds(mesh.cell(c), facet[2])) cells.push_back(c);
  if (cells.empty()) return refused<3>(Refusal::gone);
  if (cells.size() == 1 || mesh.body(cells[0]) != mesh.body(cells[1])) return refused<3>(Refusal::held);
  const auto opposite = [&](CellId c) {
    const auto& cell = mesh.cell(c);
    return *std::find_if(cell.begin(), cell.end(), [&](int v) { return !holds(facet, v); });
  };
  const VertexId d = opposite(cells[0]), e = opposite(cells[1]);
  if (mesh.are_joined(d, e)) return refused<3>(Refusal::exists);
  Edit<3> edit{.kind = Edit<3>::Kind::swap, .edge = edge_key(d, e), .removed_cells = cells};
  const double least = rule.least(worst_quality<3>(mesh, cells));
  for (const VertexId v : facet) {  // one vertex of the facet after the other gives way to the far end
    const auto cell = replaced(mesh.cell(cells[0]), v, e);
    const double quality = quality_with<3>(mesh, cell, kNone, Vec<3>::Zero());
    if (!(quality > 0 && quality >= least)) return refused<3>(Refusal::shape);
    edit.inserted_cells.push_back({cell, mesh.body(cells[0])});
  }
  const auto is_curved = [&](int i, int j) { return mesh.node_of(facet[i], facet[j]) != kNone; };
  if (is_curved(0, 1) && is_curved(0, 2) && is_curved(1, 2)) insert_node(mesh, d, e, edit);
  return {.edit = std::move(edit)};
}

Proposal<2> propose_diagonal_swap(const Mesh<2>& mesh, const Strata<2>& strata, const EdgeKey& edge,
                                  const QualityRule& rule) {
  const auto cells = mesh.cells_of_edge(edge);
  if (cells.empty()) return refused<2>(Refusal::gone);
  if (strata.edge(mesh, edge) != Stratum::volume) return refused<2>(Refusal::held);
  std::array<VertexId, 2> opposite;
  for (int i = 0; i < 2; ++i)
    for (const int v : mesh.cell(cells[i]))
      if (v != edge[0] && v != edge[1]) opposite[i] = v;
  if (mesh.are_joined(opposite[0], opposite[1])) return refused<2>(Refusal::exists);
  Edit<2> edit{.kind = Edit<2>::Kind::swap, .edge = edge, .removed_cells = cells};
  const double least = rule.least(worst_quality<2>(mesh, cells));
  // In each triangle one end of the edge gives way to the other triangle's far vertex; that keeps the orientation.
  for (const VertexId end : edge) {
    const auto cell = replaced(mesh.cell(cells[0]), end, opposite[1]);
    const double quality = quality_with<2>(mesh, cell, kNone, Vec<2>::Zero());
    if (!(quality > 0 && quality >= least)) return refused<2>(Refusal::shape);
    edit.inserted_cells.push_back({cell, mesh.body(cells[0])});
  }
  if (mesh.node_of(edge[0], edge[1]) != kNone) {
    edit.removed_nodes.push_back(edge);
    insert_node(mesh, opposite[0], opposite[1], edit);
  }
  return {.edit = std::move(edit)};
}

}  // namespace itr
