// SPDX-License-Identifier: MIT
// The energy of a split edge's cells, some of which have curved edges, as a quadratic function of the nodes that the split
// adds: all together, since those of neighbouring edges move together.
#pragma once

#include <array>

#include <boost/container/small_vector.hpp>
#include "fem/held_rule.hpp"
#include "local_problem.hpp"
#include "remesh/placed_cell.hpp"

namespace itr {

/// See edit_split.cpp for the nodes that a split adds. The functions stay, so that the energy changes by quadrature alone.
/// Loads on facets are left out.
template <int Dim>
class SplitModel {
 public:
  SplitModel(const RemeshState<Dim>& state, const EdgeKey& edge)
      : state_(state), mesh_(state.mesh), edge_(edge), model_(state.context, mesh_.part_of_vertex(edge[0]), true) {
    is_curved_ = mesh_.node_of(edge[0], edge[1]) != kNone;
    ends_.push_back(kNone);
    if (is_curved_) ends_.insert(ends_.end(), {edge[0], edge[1]});
    for (const CellId c : mesh_.cells_of_edge(edge)) find_nodes(c);
    for (const Cell& cell : cells_) add(cell);
    hold();
  }

  /// By which the energy falls where the nodes find their minimum; NaN where there is none.
  double gain() const { return gain_ + model_.relaxation(); }

 private:
  struct Cell {
    CellId id;
    CurvedCell<Dim> nodes;
    std::array<int, Dim + 1> added;  ///< by vertex, the place of the node between it and the middle; kNone: straight
  };
  void find_nodes(CellId c) {
    Cell& cell = cells_.emplace_back();
    cell.id = c;
    cell.nodes = cell_before(mesh_, c);
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = cell.nodes.nodes[k];
      cell.added[k] = kNone;
      if (v == edge_[0] || v == edge_[1]) {
        if (is_curved_) cell.added[k] = v == edge_[0] ? 1 : 2;
      } else if (is_facet_curved(cell.nodes, k)) {
        const auto at = std::find(ends_.begin(), ends_.end(), v);
        cell.added[k] = static_cast<int>(at - ends_.begin());
        if (at == ends_.end()) ends_.push_back(v);
      }
    }
  }
  /// Whether an edge of the triangle of the split edge and a vertex is curved.
  bool is_facet_curved(const CurvedCell<Dim>& cell, int vertex) const {
    bool found = is_curved_;
    for_each_edge<Dim>([&](int edge, int i, int j) {
      const int other = i == vertex ? j : i;
      if ((i == vertex || j == vertex) && (cell.nodes[other] == edge_[0] || cell.nodes[other] == edge_[1]))
        found = found || cell.edges >> edge & 1;
    });
    return found;
  }

  void add(const Cell& cell) {
    const int body = mesh_.body(cell.id);
    PlacedCell<Dim> whole = place(mesh_, state_.fields, state_.context, cell.nodes, no_edit<Dim>());
    if (!state_.fields.levels.empty()) whole.level = state_.fields.levels[cell.id];
    for_each_edge<Dim>([&](int edge, int i, int j) {
      if (cell.nodes.edges >> edge & 1) return;
      for (QuadraticCell<Dim>* values : {&whole.x, &whole.step})
        values->col(Dim + 1 + edge) = (values->col(i) + values->col(j)) / 2;
    });
    if (cell.nodes.edges) {  // else the energy stays
      CellModel<Dim> before(state_.context, mesh_.part(cell.id));
      before.add(whole, body);
      gain_ += before.elastic_energy() + model_.elastic_energy();
    }
    for (const VertexId end : edge_) {
      const int moved = index_in(cell, end), other = index_in(cell, end == edge_[0] ? edge_[1] : edge_[0]);
      auto places = CellModel<Dim>::still();
      const PlacedCell<Dim> half = half_of(cell, moved, other, whole, places);
      model_.add(half, body, places);
    }
    if (cell.nodes.edges) gain_ -= model_.elastic_energy();
  }
  int index_in(const Cell& cell, VertexId v) const {
    return static_cast<int>(std::find(cell.nodes.nodes.begin(), cell.nodes.nodes.begin() + Dim + 1, v) -
                            cell.nodes.nodes.begin());
  }

  /// With the middle of the edge in the place of its end `moved`. `places` are set for the nodes that the split adds.
  PlacedCell<Dim> half_of(const Cell& cell, int moved, int other, const PlacedCell<Dim>& whole,
                          typename CellModel<Dim>::Places& places) const {
    PlacedCell<Dim> half = whole;
    half.curved = 0;
    half.rest[moved] = (whole.rest[moved] + whole.rest[other]) / 2;
    places[moved] = 0;
    const int split = edge_between(moved, other);
    half.x.col(moved) = whole.x.col(split);
    half.step.col(moved) = whole.step.col(split);
    for_each_edge<Dim>([&](int edge, int i, int j) {
      const int k = Dim + 1 + edge;
      if (i != moved && j != moved) {
        half.curved = static_cast<CurvedEdges>(half.curved | (cell.nodes.edges & 1 << edge));
        return;
      }
      const int at = i == moved ? j : i;
      if (cell.added[at] == kNone) return;
      half.curved = static_cast<CurvedEdges>(half.curved | 1 << edge);
      places[k] = cell.added[at];
      const auto set = [&](const QuadraticCell<Dim>& from, QuadraticCell<Dim>& to) {
        if (at == other) {
          to.col(k) = 0.375 * from.col(other) - 0.125 * from.col(moved) + 0.75 * from.col(split);
          return;
        }
        const int to_moved = edge_between(moved, at), to_other = edge_between(other, at);
        // Shape functions of a quadratic triangle at (1/4, 1/4, 1/2); straight edges have the mean of their ends.
        to.col(k) = 0.5 * (from.col(to_moved) + from.col(to_other)) + 0.25 * from.col(split) -
                    0.125 * (from.col(moved) + from.col(other));
      };
      set(whole.x, half.x);
      set(whole.step, half.step);
    });
    return half;
  }
  static int edge_between(int a, int b) {
    int found = 0;
    for_each_edge<Dim>([&](int edge, int i, int j) {
      if ((i == a && j == b) || (i == b && j == a)) found = Dim + 1 + edge;
    });
    return found;
  }

  /// Facets and tags after the split, as HeldRule asks for them at the new vertex and at edges to it.
  struct View {
    const Mesh<Dim>& mesh;
    EdgeKey split;
    int vertex_tag(VertexId v) const { return v == kNewVertex ? mesh.edge_tag(split) : mesh.vertex_tag(v); }
    template <std::size_t N, typename F>
    friend void for_each_facet_tag(const View& view, const std::array<VertexId, N>& ends, const F& f) {
      for (const FacetId facet : view.mesh.facets_of_edge(view.split))
        if (N == 1 || has_all(view.mesh.facet(facet), std::array{ends[0]})) f(view.mesh.facet_tag(facet));
    }
  };

  void hold() {
    const HeldRule<Dim> rule(state_.context.held_components);
    const View view{mesh_, edge_};
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      const auto tags =
          i == 0 ? rule.tags_at(view, std::array{kNewVertex}) : rule.tags_at(view, EdgeKey{ends_[i], kNewVertex});
      model_.hold(i, tags);
    }
  }

  const RemeshState<Dim>& state_;
  const Mesh<Dim>& mesh_;
  EdgeKey edge_;
  bool is_curved_ = false;
  boost::container::small_vector<VertexId, 16> ends_;  ///< other ends of the added nodes' edges; first the new vertex
  boost::container::small_vector<Cell, 12> cells_;
  double gain_ = 0;       ///< by quadrature
  CellModel<Dim> model_;  ///< of the halves
};

}  // namespace itr
