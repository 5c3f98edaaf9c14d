// SPDX-License-Identifier: MIT
#include "itr/transfer.hpp"

#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/connected_parts.hpp"
#include "fem/mass.hpp"
#include "geometry/bvh.hpp"
#include "geometry/intersection.hpp"

namespace itr {

namespace {

/// Nodal values, k together for each vertex.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <int Dim>
std::array<Vec<Dim>, Dim + 1> corners(const TransferMesh<Dim>& mesh, int cell) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest[mesh.cells[cell][k]];
  return p;
}

template <int Dim>
Box<Dim> box_of(const std::array<Vec<Dim>, Dim + 1>& p) {
  Box<Dim> box;
  for (const auto& q : p) box.include(q);
  return box;
}

template <int Dim>
double cell_mass(const TransferMesh<Dim>& mesh, int cell) {
  return mesh.density[cell] * simplex_volume<Dim>(corners<Dim>(mesh, cell));
}

/// The consistent or lumped mass matrix of a cell by unit mass, in an axisymmetric mesh with the turn.
template <int Dim>
Mat<kQuadraticNodes<Dim>> unit_mass(const TransferMesh<Dim>& mesh, std::size_t cell, MassKind kind) {
  const CurvedEdges curved = mesh.curved_edges(cell);
  if (mesh.axisymmetric) return turned_mass<Dim>(kind, curved, corners<Dim>(mesh, static_cast<int>(cell)));
  return constant_quadratic_mass<Dim>(kind, curved);
}

/// A vertex, or the node of a curved edge.
template <int Dim>
int node_of(const TransferMesh<Dim>& mesh, std::size_t cell, int i) {
  return i <= Dim ? mesh.cells[cell][static_cast<std::size_t>(i)] : mesh.nodes[cell][static_cast<std::size_t>(i)];
}

/// Shape functions of all nodes of a cell at barycentric coordinates.
template <int Dim>
Vec<kQuadraticNodes<Dim>> shapes_at(CurvedEdges curved, const Vec<Dim + 1>& weights) {
  std::array<double, Dim + 1> l;
  for (int k = 0; k <= Dim; ++k) l[k] = weights[k];
  return quadratic_shapes<Dim>(curved, l);
}

/// Values of a column at the nodes of a cell.
template <int Dim>
Vec<kQuadraticNodes<Dim>> values_in(const TransferMesh<Dim>& mesh, int cell, const MatrixX& u, Eigen::Index column) {
  const CurvedEdges curved = mesh.curved_edges(cell);
  Vec<kQuadraticNodes<Dim>> values = Vec<kQuadraticNodes<Dim>>::Zero();
  for (int i = 0; i <= Dim; ++i) values[i] = u(mesh.cells[cell][i], column);
  for (int i = Dim + 1; i < kQuadraticNodes<Dim>; ++i)
    if (has_node<Dim>(curved, i)) values[i] = u(mesh.nodes[cell][i], column);
  return values;
}

/// Adds the difference of an old and a new cell where one of them has curved edges.
template <int Dim>
void add_curved_difference(const TransferMesh<Dim>& old_mesh, int old_cell, const TransferMesh<Dim>& new_mesh, int new_cell,
                           const std::vector<OverlapPiece<Dim>>& pieces, const MatrixX& u_old, const MatrixX& u_bar,
                           TouchedDifference& difference) {
  const CurvedEdges old_curved = old_mesh.curved_edges(old_cell), new_curved = new_mesh.curved_edges(new_cell);
  const double density = old_mesh.density[old_cell];
  for (const OverlapPiece<Dim>& piece : pieces)
    for (const auto& point : quadrature<Dim>(degree_with_turn(kMassDegree, old_mesh.axisymmetric))) {
      Vec<Dim + 1> in_new = Vec<Dim + 1>::Zero(), in_old = in_new;
      for (int k = 0; k <= Dim; ++k) {
        in_new += point.weights[k] * piece.in_a[k];
        in_old += point.weights[k] * piece.in_b[k];
      }
      const auto new_shapes = shapes_at<Dim>(new_curved, in_new), old_shapes = shapes_at<Dim>(old_curved, in_old);
      double weight = density * point.fraction * piece.volume;
      if (old_mesh.axisymmetric) {
        double R = 0;
        for (int k = 0; k <= Dim; ++k) R += in_old[k] * old_mesh.rest[old_mesh.cells[old_cell][k]][0];
        weight *= 2 * std::numbers::pi * R;
      }
      for (Eigen::Index column = 0; column < u_old.cols(); ++column) {
        const double gap = old_shapes.dot(values_in<Dim>(old_mesh, old_cell, u_old, column)) -
                           new_shapes.dot(values_in<Dim>(new_mesh, new_cell, u_bar, column));
        for (int i = 0; i < kQuadraticNodes<Dim>; ++i)
          if (has_node<Dim>(new_curved, i))
            difference.residual(node_of(new_mesh, new_cell, i), column) += weight * new_shapes[i] * gap;
        difference.squares[column] += weight * gap * gap;
      }
    }
}

/// The density-weighted mass matrix on the entries that are not fixed, under constraints that prescribe moments of the
/// solution: integrals of rho p u over each connected part for p = 1 and the coordinates.
template <int Dim>
class ConstrainedMass {
 public:
  ConstrainedMass(const TransferMesh<Dim>& mesh, std::span<const char> fixed, Eigen::Index columns)
      : part_(parts_of(mesh)), columns_(columns) {
    const auto n = static_cast<Eigen::Index>(mesh.rest.size());
    VectorX lumped = VectorX::Zero(n);
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(mesh.cells.size() * (Dim + 1) * (Dim + 1));
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      const double mass = cell_mass(mesh, static_cast<int>(c));
      if (const CurvedEdges curved = mesh.curved_edges(c); curved || mesh.axisymmetric) {
        const auto matrix = unit_mass(mesh, c, MassKind::consistent), diagonal = unit_mass(mesh, c, MassKind::lumped);
        for (int i = 0; i < kQuadraticNodes<Dim>; ++i) {
          if (!has_node<Dim>(curved, i)) continue;
          lumped[node_of(mesh, c, i)] += mass * diagonal(i, i);
          for (int j = 0; j < kQuadraticNodes<Dim>; ++j)
            if (has_node<Dim>(curved, j))
              entries.emplace_back(node_of(mesh, c, i), node_of(mesh, c, j), mass * matrix(i, j));
        }
        continue;
      }
      const ElementMass<Dim> element(MassKind::consistent, mass);
      for (const int i : mesh.cells[c]) {
        lumped[i] += mass / (Dim + 1);
        for (const int j : mesh.cells[c]) entries.emplace_back(i, j, element.off + (i == j ? element.extra : 0));
      }
    }
    mass_.resize(n, n);
    mass_.setFromTriplets(entries.begin(), entries.end());
    inverse_.resize(n, columns);
    for (Eigen::Index v = 0; v < n; ++v)
      for (Eigen::Index k = 0; k < columns; ++k) {
        const bool is_free = lumped[v] > 0 && (fixed.empty() || !fixed[v * columns + k]);
        inverse_(v, k) = is_free ? 1 / lumped[v] : 0;
      }
    set_polynomials(mesh);
    weights_ = mass_ * polynomials_;
    set_grams();
  }

  void product(const Rows& x, Rows& y) const { y.noalias() = mass_ * x; }
  /// Moments by part (Dim + 1 rows) and column: of all entries of a residual, or of a solution.
  Rows moments_of_residual(const Rows& r) const { return moments(polynomials_, r); }
  Rows moments(const Rows& d) const { return moments(weights_, d); }
  /// Adds to d the least change, in the lumped norm, that adds these moments.
  void add_moments(const Rows& moments, Rows& d) const {
    const Rows multipliers = solve_grams(moments);
    for (Eigen::Index v = 0; v < d.rows(); ++v) d.row(v) += inverse_.row(v).cwiseProduct(force(v, multipliers));
  }
  /// z = r by the lumped mass, without moments: r loses the forces of the constraints, which would drown the rest (Gould,
  /// Hribar & Nocedal 2001).
  void precondition(Rows& r, Rows& z) const {
    z = r.cwiseProduct(inverse_);
    const Rows multipliers = solve_grams(moments(z));
    for (Eigen::Index v = 0; v < r.rows(); ++v) r.row(v) -= force(v, multipliers);
    z = r.cwiseProduct(inverse_);
  }
  /// Integrals of rho u, summed over the parts.
  VectorX integrals(const Rows& moments) const {
    VectorX sum = VectorX::Zero(columns_);
    for (int p = 0; p < num_parts_; ++p) sum += moments.row((Dim + 1) * p).transpose();
    return sum;
  }

 private:
  /// 1 and the coordinates, about the middle of each part and by its size.
  void set_polynomials(const TransferMesh<Dim>& mesh) {
    num_parts_ = part_.empty() ? 0 : *std::max_element(part_.begin(), part_.end()) + 1;
    std::vector<Box<Dim>> boxes(num_parts_);
    for (std::size_t v = 0; v < part_.size(); ++v) boxes[part_[v]].include(mesh.rest[v]);
    polynomials_.resize(inverse_.rows(), Dim + 1);
    for (std::size_t v = 0; v < part_.size(); ++v) {
      const Box<Dim>& box = boxes[part_[v]];
      const Vec<Dim> offset = mesh.rest[v] - 0.5 * (box.min + box.max);
      const double size = (box.max - box.min).norm();
      polynomials_.row(v) << 1, offset.transpose() / (size > 0 ? size : 1);
    }
  }

  void set_grams() {
    grams_.assign(num_parts_ * columns_, Mat<Dim + 1>::Zero());
    for (Eigen::Index v = 0; v < inverse_.rows(); ++v)
      for (Eigen::Index k = 0; k < columns_; ++k)
        if (inverse_(v, k) > 0)
          grams_[part_[v] * columns_ + k] += inverse_(v, k) * weights_.row(v).transpose() * weights_.row(v);
    for (auto& gram : grams_) {  // from here on their inverses
      const auto lu = Eigen::FullPivLU<Mat<Dim + 1>>(gram).setThreshold(1e-10);
      const double constant = gram(0, 0);
      if (lu.isInvertible()) {
        gram = lu.inverse();
      } else {
        gram.setZero();
        if (constant > 0) gram(0, 0) = 1 / constant;
      }
    }
  }

  /// Force of the constraints on a vertex.
  auto force(Eigen::Index v, const Rows& multipliers) const {
    return weights_.row(v).lazyProduct(multipliers.middleRows<Dim + 1>((Dim + 1) * part_[v]));
  }

  template <typename Polynomials>
  Rows moments(const Polynomials& polynomials, const Rows& values) const {
    Rows sum = Rows::Zero((Dim + 1) * num_parts_, columns_);
    for (Eigen::Index v = 0; v < values.rows(); ++v)
      sum.middleRows<Dim + 1>((Dim + 1) * part_[v]) += polynomials.row(v).transpose().lazyProduct(values.row(v));
    return sum;
  }

  Rows solve_grams(const Rows& moments) const {
    Rows multipliers(moments.rows(), columns_);
    for (int p = 0; p < num_parts_; ++p)
      for (Eigen::Index k = 0; k < columns_; ++k)
        multipliers.block<Dim + 1, 1>((Dim + 1) * p, k) =
            grams_[p * columns_ + k] * moments.block<Dim + 1, 1>((Dim + 1) * p, k);
    return multipliers;
  }

  std::vector<int> part_;  ///< by vertex
  int num_parts_ = 0;
  Eigen::Index columns_;
  Rows inverse_;  ///< of the lumped mass; 0 at fixed entries
  Eigen::SparseMatrix<double, Eigen::RowMajor> mass_;
  Eigen::Matrix<double, Eigen::Dynamic, Dim + 1, Eigen::RowMajor> polynomials_, weights_;  ///< nodal values; M times them
  std::vector<Mat<Dim + 1>> grams_;                                                        ///< by part and column
};

}  // namespace

template <int Dim>
std::vector<int> parts_of(const TransferMesh<Dim>& mesh) {
  std::vector<int> part = connected_parts<Dim + 1>(mesh.rest.size(), mesh.cells);
  for (std::size_t c = 0; c < mesh.curved.size(); ++c)
    for (int i = Dim + 1; i < kQuadraticNodes<Dim>; ++i)
      if (has_node<Dim>(mesh.curved[c], i)) part[mesh.nodes[c][i]] = part[mesh.cells[c][0]];
  std::vector<int> used(part);  // alone, each node was a part
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (int& p : part) p = static_cast<int>(std::lower_bound(used.begin(), used.end(), p) - used.begin());
  return part;
}

template <int Dim>
TouchedDifference touched_difference(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                                     const TouchedCells& touched, const MatrixX& u_old, const MatrixX& u_bar) {
  const Eigen::Index k = u_old.cols();
  TouchedDifference difference{MatrixX::Zero(static_cast<Eigen::Index>(new_mesh.rest.size()), k), VectorX::Zero(k)};
  std::vector<Box<Dim>> boxes;
  std::vector<Simplex<Dim>> old_simplices;
  for (const int c : touched.old_cells) {
    old_simplices.emplace_back(corners<Dim>(old_mesh, c));
    boxes.push_back(box_of<Dim>(old_simplices.back().corners));
  }
  const Bvh<Dim> tree(boxes);
  std::vector<int> hits;
  OverlapIntegrals<Dim> overlap;
  std::vector<OverlapPiece<Dim>> pieces;
  for (const int c : touched.new_cells) {
    const auto& new_cell = new_mesh.cells[c];
    const Simplex<Dim> simplex(corners<Dim>(new_mesh, c));
    hits.clear();
    tree.query(box_of<Dim>(simplex.corners), hits);
    std::sort(hits.begin(), hits.end());
    for (const int hit : hits) {
      if (new_mesh.axisymmetric || new_mesh.curved_edges(c) || old_mesh.curved_edges(touched.old_cells[hit])) {
        list_overlap(simplex, old_simplices[hit], pieces);
        add_curved_difference(old_mesh, touched.old_cells[hit], new_mesh, c, pieces, u_old, u_bar, difference);
        continue;
      }
      if (!integrate_overlap(simplex, old_simplices[hit], overlap)) continue;
      const auto& old_cell = old_mesh.cells[touched.old_cells[hit]];
      const double density = old_mesh.density[touched.old_cells[hit]];
      for (Eigen::Index column = 0; column < k; ++column) {
        // Constants are in both spaces; without them the squares lose no digits.
        const double shift = u_bar(new_cell[0], column);
        Vec<Dim + 1> old_values, new_values;
        for (int i = 0; i <= Dim; ++i) {
          old_values[i] = u_old(old_cell[i], column) - shift;
          new_values[i] = u_bar(new_cell[i], column) - shift;
        }
        const Vec<Dim + 1> transferred = overlap.ab * old_values, represented = overlap.aa * new_values;
        for (int i = 0; i <= Dim; ++i)
          difference.residual(new_cell[i], column) += density * (transferred[i] - represented[i]);
        difference.squares[column] +=
            density * (new_values.dot(represented - 2 * transferred) + old_values.dot(overlap.bb * old_values));
      }
    }
  }
  return difference;
}

template <int Dim>
MatrixX solve_projection(const TransferMesh<Dim>& mesh, const MatrixX& residual, std::span<const char> fixed,
                         TransferReport& report) {
  // With the lumped mass as preconditioner (the diagonal but for a factor) the consistent one has eigenvalues in a range
  // that does not depend on the mesh (Wathen 1987). Steps are without moments, so each iterate has those that it is to have.
  constexpr int kMaxIterations = 200;
  constexpr double kRoundOff = 1e-14;
  const Eigen::Index k = residual.cols();
  const ConstrainedMass<Dim> mass(mesh, fixed, k);
  Rows r = residual, z(r.rows(), k), d = Rows::Zero(r.rows(), k), product(r.rows(), k);
  const Rows moments = mass.moments_of_residual(r);
  mass.add_moments(moments, d);
  mass.product(d, product);
  r -= product;
  mass.precondition(r, z);
  Rows p = z;
  VectorX rz = r.cwiseProduct(z).colwise().sum().transpose(), first = rz, step(k), ratio(k);
  int iteration = 0;
  for (; iteration < kMaxIterations && (rz.array() > kRoundOff * kRoundOff * first.array()).any(); ++iteration) {
    mass.product(p, product);
    const VectorX curvature = p.cwiseProduct(product).colwise().sum().transpose();
    for (Eigen::Index c = 0; c < k; ++c) step[c] = curvature[c] > 0 ? rz[c] / curvature[c] : 0;
    d += p * step.asDiagonal();
    r -= product * step.asDiagonal();
    mass.precondition(r, z);
    const VectorX next = r.cwiseProduct(z).colwise().sum().transpose();
    for (Eigen::Index c = 0; c < k; ++c) ratio[c] = rz[c] > 0 ? next[c] / rz[c] : 0;
    p = z + p * ratio.asDiagonal();
    rz = next;
  }
  mass.add_moments(moments - mass.moments(d), d);  // what round-off took
  report.iterations = std::max(report.iterations, iteration);
  for (Eigen::Index c = 0; c < k; ++c)
    if (first[c] > 0)
      report.relative_residual = std::max(report.relative_residual, std::sqrt(std::max(0.0, rz[c]) / first[c]));
  report.lost = mass.integrals(moments - mass.moments(d));
  return d;
}

template <int Dim>
VectorX mass_squares(const TransferMesh<Dim>& mesh, const MatrixX& d) {
  MatrixX product = MatrixX::Zero(d.rows(), d.cols());
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const double mass = cell_mass(mesh, static_cast<int>(c));
    const CurvedEdges curved = mesh.curved_edges(c);
    if (!curved && !mesh.axisymmetric) {
      ElementMass<Dim>(MassKind::consistent, mass).add_product(mesh.cells[c], d, product);
      continue;
    }
    const auto matrix = unit_mass(mesh, c, MassKind::consistent);
    for (int i = 0; i < kQuadraticNodes<Dim>; ++i)
      for (int j = 0; j < kQuadraticNodes<Dim>; ++j)
        if (has_node<Dim>(curved, i) && has_node<Dim>(curved, j))
          product.row(node_of(mesh, c, i)) += mass * matrix(i, j) * d.row(node_of(mesh, c, j));
  }
  return d.cwiseProduct(product).colwise().sum().transpose();
}

template <int Dim>
MatrixX project_l2(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh, const TouchedCells& touched,
                   const MatrixX& u_old, const MatrixX& u_bar, std::span<const char> fixed, TransferReport& report) {
  report.lost = VectorX::Zero(u_bar.cols());
  if (touched.new_cells.empty()) return u_bar;
  const TouchedDifference difference = touched_difference(old_mesh, new_mesh, touched, u_old, u_bar);
  const MatrixX d = solve_projection(new_mesh, difference.residual, fixed, report);
  // ||u_bar + d - u_old||^2
  report.l2_error_squared =
      difference.squares.sum() - 2 * d.cwiseProduct(difference.residual).sum() + mass_squares(new_mesh, d).sum();
  return u_bar + d;
}

#define ITR_INSTANTIATE(Dim)                                                                                                \
  template std::vector<int> parts_of<Dim>(const TransferMesh<Dim>&);                                                        \
  template TouchedDifference touched_difference<Dim>(const TransferMesh<Dim>&, const TransferMesh<Dim>&,                    \
                                                     const TouchedCells&, const MatrixX&, const MatrixX&);                  \
  template MatrixX solve_projection<Dim>(const TransferMesh<Dim>&, const MatrixX&, std::span<const char>, TransferReport&); \
  template VectorX mass_squares<Dim>(const TransferMesh<Dim>&, const MatrixX&);                                             \
  template MatrixX project_l2<Dim>(const TransferMesh<Dim>&, const TransferMesh<Dim>&, const TouchedCells&, const MatrixX&, \
                                   const MatrixX&, std::span<const char>, TransferReport&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
