// SPDX-License-Identifier: MIT
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "edit_checks.hpp"
#include "geometry/cofactors.hpp"
#include "old_fields.hpp"

namespace itr {

namespace {

/// Edge matrix of the regular simplex of edge length 1.
template <int Dim>
Mat<Dim> regular_edges() {
  Mat<Dim> edges = Mat<Dim>::Zero();
  edges(0, 0) = 1;
  edges(0, 1) = 0.5;
  edges(1, 1) = std::sqrt(3.0) / 2;
  if constexpr (Dim == 3) edges.col(2) << 0.5, std::sqrt(3.0) / 6, std::sqrt(2.0 / 3.0);
  return edges;
}

/// Sum of the AMIPS measure tr(J^T J) / det(J)^(2/Dim) over the cells around a vertex, by its position.
template <int Dim>
class StarShape {
 public:
  StarShape(const Mesh<Dim>& mesh, VertexId vertex)
      : inverse_(regular_edges<Dim>().inverse()), row_(-(inverse_.transpose() * Vec<Dim>::Ones())) {
    for (const CellId c : mesh.cells_of(vertex)) {
      // The moving vertex goes first, by an even permutation.
      auto cell = mesh.cell(c);
      const auto k = std::find(cell.begin(), cell.end(), vertex) - cell.begin();
      if constexpr (Dim == 2) {
        std::rotate(cell.begin(), cell.begin() + k, cell.end());
      } else if (k != 0) {
        std::swap(cell[0], cell[k]);
        std::swap(cell[k % 3 + 1], cell[(k + 1) % 3 + 1]);
      }
      Mat<Dim> others;
      for (int i = 0; i < Dim; ++i) others.col(i) = mesh.rest(cell[i + 1]);
      others_.push_back(others);
    }
  }

  /// Infinite where a cell is not positively oriented. Adds to the derivatives, where they are wanted.
  double operator()(const Vec<Dim>& X, Vec<Dim>* gradient, Mat<Dim>* hessian) const {
    double sum = 0;
    for (const Mat<Dim>& others : others_) {
      // J = E R^-1 is affine in X, tr(J^T J) quadratic, det J affine.
      const Mat<Dim> edges = others.colwise() - X;
      const Mat<Dim> J = edges * inverse_;
      const double det = J.determinant();
      if (det <= 0) return std::numeric_limits<double>::infinity();
      const double numerator = J.squaredNorm();
      constexpr double kPower = 2.0 / Dim;
      const double denominator = Dim == 2 ? det : std::cbrt(det * det);
      sum += numerator / denominator;
      if (!gradient) continue;
      const Vec<Dim> dn = 2 * J * row_, dd = cofactors(J) * row_;  // dJ = dX * row^T
      *gradient += dn / denominator - kPower * numerator * dd / (denominator * det);
      *hessian += 2 * row_.squaredNorm() / denominator * Mat<Dim>::Identity() -
                  kPower * (dn * dd.transpose() + dd * dn.transpose()) / (denominator * det) +
                  kPower * (kPower + 1) * numerator * dd * dd.transpose() / (denominator * det * det);
    }
    return sum;
  }

 private:
  Mat<Dim> inverse_;
  Vec<Dim> row_;
  std::vector<Mat<Dim>> others_;  ///< columns: the cells' other vertices
};

/// Least measure over the positions that a projector lets the vertex reach.
template <int Dim>
Vec<Dim> minimise(const StarShape<Dim>& measure, Vec<Dim> X, const Mat<Dim>* projector, int max_iterations) {
  for (int i = 0; i < max_iterations; ++i) {
    Vec<Dim> gradient = Vec<Dim>::Zero();
    Mat<Dim> hessian = Mat<Dim>::Zero();
    const double before = measure(X, &gradient, &hessian);
    if (projector) {
      const Mat<Dim>& P = *projector;
      gradient = P * gradient;
      hessian = P * hessian * P + hessian.trace() * (Mat<Dim>::Identity() - P);
    }
    Vec<Dim> step = -hessian.ldlt().solve(gradient);
    if (!(step.dot(gradient) < 0)) step = -gradient * (hessian.trace() > 0 ? 1 / hessian.trace() : 0);
    double scale = 1;
    while (scale > 1e-6 && !(measure(X + scale * step, nullptr, nullptr) < before)) scale /= 2;
    if (scale <= 1e-6) break;
    X += scale * step;
  }
  return X;
}

/// The nodes of curved edges at the vertex move with it.
template <int Dim>
void move_nodes(const Mesh<Dim>& mesh, VertexId vertex, Edit<Dim>& edit) {
  std::vector<VertexId> ends;
  for (const CellId c : edit.removed_cells)
    for (const VertexId v : mesh.cell(c))
      if (mesh.node_of(vertex, v) != kNone && std::find(ends.begin(), ends.end(), v) == ends.end()) ends.push_back(v);
  for (const VertexId v : ends) {
    edit.removed_nodes.push_back(edge_key(vertex, v));
    insert_node(mesh, vertex, v, edit);
  }
}

}  // namespace

template <int Dim>
Proposal<Dim> propose_move(const Mesh<Dim>& mesh, const Strata<Dim>& strata, VertexId vertex, const Vec<Dim>& target,
                           const QualityRule& rule) {
  if (!mesh.is_vertex_alive(vertex) || mesh.cells_of(vertex).empty()) return refused<Dim>(Refusal::gone);
  const Stratum stratum = strata.vertex(vertex);
  if (stratum == Stratum::non_manifold) return refused<Dim>(Refusal::non_manifold);
  if (stratum == Stratum::corner) return refused<Dim>(Refusal::held);
  const Vec<Dim>& from = mesh.rest(vertex);
  const Vec<Dim> place =
      stratum == Stratum::volume ? target : Vec<Dim>(from + strata.tangent_projector(mesh, vertex) * (target - from));
  Edit<Dim> edit{.kind = Edit<Dim>::Kind::smooth};
  typename Edit<Dim>::Value value{vertex, place};
  constexpr double kOutside = 1e-9;  // by round-off
  const auto around = mesh.cells_of(vertex);
  if (!find_parents(mesh, around, place, -kOutside, value)) return refused<Dim>(Refusal::outside);
  const double least = rule.least(worst_quality<Dim>(mesh, around));
  for (const CellId c : around) {
    const double quality = quality_with<Dim>(mesh, mesh.cell(c), vertex, place);
    if (!(quality > 0 && quality >= least)) return refused<Dim>(Refusal::shape);
  }
  edit.value = value;
  edit.removed_cells.reserve(around.size());
  edit.inserted_cells.reserve(around.size());
  for (const CellId c : around) {
    edit.removed_cells.push_back(c);
    edit.inserted_cells.push_back({mesh.cell(c), mesh.body(c)});
  }
  for (const FacetId f : mesh.facets_of(vertex)) {
    edit.removed_facets.push_back(f);
    edit.inserted_facets.push_back({mesh.facet(f), mesh.facet_tag(f), f});
  }
  move_nodes(mesh, vertex, edit);
  return {.edit = std::move(edit)};
}

template <int Dim>
Vec<Dim> best_shaped_position(const Mesh<Dim>& mesh, const Strata<Dim>& strata, VertexId vertex, int max_iterations) {
  const Mat<Dim> projector = strata.tangent_projector(mesh, vertex);
  return minimise<Dim>(StarShape<Dim>(mesh, vertex), mesh.rest(vertex), &projector, max_iterations);
}

template Proposal<2> propose_move<2>(const Mesh<2>&, const Strata<2>&, VertexId, const Vec<2>&, const QualityRule&);
template Proposal<3> propose_move<3>(const Mesh<3>&, const Strata<3>&, VertexId, const Vec<3>&, const QualityRule&);
template Vec<2> best_shaped_position<2>(const Mesh<2>&, const Strata<2>&, VertexId, int);
template Vec<3> best_shaped_position<3>(const Mesh<3>&, const Strata<3>&, VertexId, int);

}  // namespace itr
