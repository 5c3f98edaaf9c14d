// SPDX-License-Identifier: MIT
// The energy of a split edge's cells, some of which have curved edges, as a quadratic function of the nodes that the split
// adds: all together, since those of neighbouring edges move together.
#pragma once

#include <Eigen/Cholesky>
#include <array>
#include <limits>

#include <boost/container/small_vector.hpp>
#include "energy/elastic/point.hpp"
#include "fem/held_rule.hpp"
#include "itr/fem/mass.hpp"
#include "local_problem.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

/// See edit_split.cpp for the nodes that a split adds. The functions stay, so that the energy changes by quadrature alone.
/// Loads on facets and JacobianBarrier are left out.
template <int Dim>
class SplitModel {
 public:
  SplitModel(const RemeshState<Dim>& state, const EdgeKey& edge) : state_(state), mesh_(state.mesh), edge_(edge) {
    is_curved_ = mesh_.node_of(edge[0], edge[1]) != kNone;
    ends_.push_back(kNone);
    if (is_curved_) ends_.insert(ends_.end(), {edge[0], edge[1]});
    for (const CellId c : mesh_.cells_of_edge(edge)) find_nodes(c);
    const auto size = static_cast<Eigen::Index>(Dim * ends_.size());
    gradient_ = VectorX::Zero(size);
    hessian_ = MatrixX::Zero(size, size);
    for (const Cell& cell : cells_) add(cell);
    hold();
  }

  /// By which the energy falls where the nodes find their minimum; NaN where there is none.
  double gain() const {
    const Eigen::LLT<MatrixX> llt(hessian_);
    if (llt.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
    return gain_ + 0.5 * gradient_.dot(llt.solve(gradient_));
  }

 private:
  static constexpr int kNodes = kQuadraticNodes<Dim>;

  struct Cell {
    CellId id;
    CurvedCell<Dim> nodes;
    std::array<int, Dim + 1> added;  ///< by vertex, the place of the node between it and the middle; kNone: straight
  };
  /// A half of a cell: values at its nodes, and the places of those that the split adds.
  struct Half {
    CurvedEdges edges = 0;
    QuadraticCell<Dim> x, way;
    std::array<int, kNodes> place;
  };

  void find_nodes(CellId c) {
    Cell& cell = cells_.emplace_back();
    cell.id = c;
    cell.nodes = curved_cell<Dim>(mesh_.cell(c), [&](VertexId a, VertexId b) { return mesh_.node_of(a, b); });
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
    const StepContext<Dim>& context = state_.context;
    const Material& material = context.materials.at(mesh_.body(cell.id));
    const double sV = context.scaling * mesh_.volume(cell.id), mass = material.density * mesh_.volume(cell.id);
    const ElasticModuli moduli = elastic_moduli<Dim>(material, mesh_.rest(cell.nodes.nodes[0]));
    const auto linear = barycentric_gradients<Dim>(mesh_.inverse_rest_edges(cell.id));
    const Edit<Dim> none{};
    const QuadraticCell<Dim> x = cell.nodes.values(state_.fields.x, none);
    QuadraticCell<Dim> way = QuadraticCell<Dim>::Zero();
    if (context.has_inertia) way = x - cell.nodes.values(state_.fields.predictor, none);
    const int level = state_.fields.levels.empty() ? 0 : state_.fields.levels[cell.id];
    const auto& rule = !cell.nodes.edges ? quadrature<Dim>(1) : cell_quadrature<Dim>(level, context.quadrature_degree);
    if (cell.nodes.edges)
      for (const auto& point : rule)
        gain_ += sV * point.share * elastic_density<Dim>(gradient_at(x, cell.nodes.edges, point.weights, linear), moduli);
    for (const VertexId end : edge_) {
      const int moved = index_in(cell, end), other = index_in(cell, end == edge_[0] ? edge_[1] : edge_[0]);
      Eigen::Matrix<double, Dim, Dim + 1> of_half = linear;
      of_half.col(moved) = 2 * linear.col(moved);
      of_half.col(other) = linear.col(other) - linear.col(moved);
      const Half half = half_of(cell, moved, other, x, way);
      for (const auto& point : rule) add_elasticity(half, point, of_half, moduli, sV / 2, cell.nodes.edges != 0);
      if (context.has_inertia || context.loads.acceleration) add_mass_and_weight(half, cell, mass / 2);
    }
  }
  int index_in(const Cell& cell, VertexId v) const {
    return static_cast<int>(std::find(cell.nodes.nodes.begin(), cell.nodes.nodes.begin() + Dim + 1, v) -
                            cell.nodes.nodes.begin());
  }

  Mat<Dim> gradient_at(const QuadraticCell<Dim>& x, CurvedEdges edges, const std::array<double, Dim + 1>& l,
                       const Eigen::Matrix<double, Dim, Dim + 1>& linear) const {
    return x * quadratic_gradients<Dim, Dim>(edges, l, linear).transpose();
  }

  /// With the middle of the edge in the place of its end `moved`.
  Half half_of(const Cell& cell, int moved, int other, const QuadraticCell<Dim>& x, const QuadraticCell<Dim>& way) const {
    Half half;
    half.x = x;
    half.way = way;
    half.place.fill(kNone);
    half.place[moved] = 0;
    int split = 0;
    for_each_edge<Dim>([&](int edge, int i, int j) {
      if ((i == moved && j == other) || (i == other && j == moved)) split = Dim + 1 + edge;
    });
    half.x.col(moved) = x.col(split);
    half.way.col(moved) = way.col(split);
    for_each_edge<Dim>([&](int edge, int i, int j) {
      const int k = Dim + 1 + edge;
      if (i != moved && j != moved) {
        half.edges = static_cast<CurvedEdges>(half.edges | (cell.nodes.edges & 1 << edge));
        return;
      }
      const int at = i == moved ? j : i;
      const int place = cell.added[at];
      half.x.col(k) = (half.x.col(moved) + half.x.col(at)) / 2;
      half.way.col(k) = (half.way.col(moved) + half.way.col(at)) / 2;
      if (place == kNone) return;
      half.edges = static_cast<CurvedEdges>(half.edges | 1 << edge);
      half.place[k] = place;
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
      set(x, half.x);
      set(way, half.way);
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

  void add_elasticity(const Half& half, const QuadraturePoint<Dim>& point, const Eigen::Matrix<double, Dim, Dim + 1>& linear,
                      const ElasticModuli& moduli, double volume, bool has_nodes) {
    const auto shapes = quadratic_gradients<Dim, Dim>(half.edges, point.weights, linear);
    const Mat<Dim> F = half.x * shapes.transpose();
    const ElasticPoint<Dim> response(F, moduli);
    const double weight = volume * point.share;
    if (has_nodes) gain_ -= weight * response.density();
    for (int i = 0; i < kNodes; ++i) {
      if (half.place[i] == kNone) continue;
      const int row = Dim * half.place[i];
      const Vec<Dim> shape = shapes.col(i);
      gradient_.template segment<Dim>(row) += weight * response.gradient(shape);
      for (int j = 0; j < kNodes; ++j)
        if (half.place[j] != kNone && half.place[j] <= half.place[i])
          hessian_.template block<Dim, Dim>(row, Dim * half.place[j]) += weight * response.hessian(shape, shapes.col(j));
    }
  }

  void add_mass_and_weight(const Half& half, const Cell& cell, double mass) {
    const StepContext<Dim>& context = state_.context;
    const Mat<kNodes>& unit = constant_quadratic_mass<Dim>(MassKind::consistent, half.edges);
    const QuadraticCell<Dim> forces = mass * half.way * unit;
    Vec<Dim> load = Vec<Dim>::Zero();
    if (context.loads.acceleration) {
      Vec<Dim> center = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) center += mesh_.rest(cell.nodes.nodes[k]) / (Dim + 1);
      load = context.scaling * mass * context.loads.acceleration(center);
    }
    for (int i = 0; i < kNodes; ++i) {
      if (half.place[i] == kNone) continue;
      const int row = Dim * half.place[i];
      gradient_.template segment<Dim>(row) -= unit.row(i).sum() * load;  // shape functions have the sum 1
      if (!context.has_inertia) continue;
      gradient_.template segment<Dim>(row) += forces.col(i);
      for (int j = 0; j < kNodes; ++j)
        if (half.place[j] != kNone && half.place[j] <= half.place[i])
          hessian_.template block<Dim, Dim>(row, Dim * half.place[j]).diagonal().array() += mass * unit(i, j);
    }
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
      for (int c = 0; c < Dim; ++c)
        if (tags[c] != kNoTag) hold_dof(static_cast<Eigen::Index>(Dim * i) + c);
    }
  }
  void hold_dof(Eigen::Index i) {
    hessian_.row(i).setZero();
    hessian_.col(i).setZero();
    hessian_(i, i) = 1;
    gradient_[i] = 0;
  }

  const RemeshState<Dim>& state_;
  const Mesh<Dim>& mesh_;
  EdgeKey edge_;
  bool is_curved_ = false;
  boost::container::small_vector<VertexId, 16> ends_;  ///< other ends of the added nodes' edges; first the new vertex
  boost::container::small_vector<Cell, 12> cells_;
  double gain_ = 0;
  VectorX gradient_;
  MatrixX hessian_;  ///< lower triangle of blocks
};

}  // namespace itr
