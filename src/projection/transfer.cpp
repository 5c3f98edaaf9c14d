// SPDX-License-Identifier: MIT
#include "itr/projection/transfer.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "itr/geometry/bvh.hpp"
#include "itr/geometry/intersection.hpp"
#include "itr/geometry/measures.hpp"

namespace itr {

namespace {

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

/// Barycentric coordinates of points with respect to a simplex.
template <int Dim>
class Barycentric {
 public:
  explicit Barycentric(const std::array<Vec<Dim>, Dim + 1>& p) : origin_(p[0]), inverse_(edge_matrix<Dim>(p).inverse()) {}
  Vec<Dim + 1> operator()(const Vec<Dim>& X) const {
    Vec<Dim + 1> weights;
    weights.template tail<Dim>() = inverse_ * (X - origin_);
    weights[0] = 1 - weights.template tail<Dim>().sum();
    return weights;
  }

 private:
  Vec<Dim> origin_;
  Mat<Dim> inverse_;
};

/// Integral over the intersection of two cells of phi_i^new phi_j^old: both are linear on every piece, so the mass matrix of
/// the piece gives it exactly.
template <int Dim>
Mat<Dim + 1> cross_mass(const std::array<Vec<Dim>, Dim + 1>& new_cell, const std::array<Vec<Dim>, Dim + 1>& old_cell,
                        std::vector<std::array<Vec<Dim>, Dim + 1>>& pieces) {
  Mat<Dim + 1> sum = Mat<Dim + 1>::Zero();
  pieces.clear();
  intersect_simplices<Dim>(new_cell, old_cell, pieces);
  if (pieces.empty()) return sum;
  const Barycentric<Dim> in_new(new_cell), in_old(old_cell);
  for (const auto& piece : pieces) {
    Mat<Dim + 1> at_new, at_old;  // columns: corners of the piece
    for (int k = 0; k <= Dim; ++k) {
      at_new.col(k) = in_new(piece[k]);
      at_old.col(k) = in_old(piece[k]);
    }
    const Vec<Dim + 1> total_new = at_new.rowwise().sum(), total_old = at_old.rowwise().sum();
    const double weight = simplex_volume<Dim>(piece) / ((Dim + 1) * (Dim + 2));
    sum += weight * (at_new * at_old.transpose() + total_new * total_old.transpose());
  }
  return sum;
}

/// y += M x with the density-weighted consistent mass of some cells.
template <int Dim, typename Cells>
void add_mass_product(const TransferMesh<Dim>& mesh, const Cells& cells, const MatrixX& x, MatrixX& y) {
  for (const int c : cells) {
    const auto& cell = mesh.cells[c];
    const double mass = mesh.density[c] * simplex_volume<Dim>(corners<Dim>(mesh, c)) / ((Dim + 1) * (Dim + 2));
    Eigen::RowVectorXd total = Eigen::RowVectorXd::Zero(x.cols());
    for (const int v : cell) total += x.row(v);
    for (const int v : cell) y.row(v) += mass * (total + x.row(v));
  }
}

/// The consistent mass matrix as an operator, with volumes and rows at hand.
template <int Dim>
class MassOperator {
 public:
  MassOperator(const TransferMesh<Dim>& mesh, std::span<const char> fixed) : mesh_(mesh), fixed_(fixed) {
    diagonal_ = VectorX::Zero(static_cast<Eigen::Index>(mesh.rest.size()));
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      share_.push_back(mesh.density[c] * simplex_volume<Dim>(corners<Dim>(mesh, static_cast<int>(c))) /
                       ((Dim + 1) * (Dim + 2)));
      for (const int v : mesh.cells[c]) diagonal_[v] += 2 * share_[c];
    }
  }
  bool is_free(Eigen::Index v) const { return !fixed_[v] && diagonal_[v] > 0; }
  double diagonal(Eigen::Index v) const { return diagonal_[v]; }
  void apply(const VectorX& x, VectorX& y) const {
    y.setZero(x.size());
    for (std::size_t c = 0; c < share_.size(); ++c) {
      double total = 0;
      for (const int v : mesh_.cells[c]) total += x[v];
      for (const int v : mesh_.cells[c]) y[v] += share_[c] * (total + x[v]);
    }
    for (Eigen::Index v = 0; v < y.size(); ++v)
      if (!is_free(v)) y[v] = 0;
  }

 private:
  const TransferMesh<Dim>& mesh_;
  std::span<const char> fixed_;
  std::vector<double> share_;
  VectorX diagonal_;
};

/// Jacobi-preconditioned conjugate gradients from zero until the residual no longer falls. The preconditioned consistent
/// mass matrix has eigenvalues in [1/2, (Dim + 2) / 2] whatever the mesh (Wathen 1987), so some dozens of iterations do.
template <int Dim>
VectorX solve_mass(const MassOperator<Dim>& mass, VectorX residual, TransferReport& report) {
  constexpr int kMaxIterations = 200;
  constexpr double kRoundOff = 1e-16;
  const auto precondition = [&](const VectorX& r) {
    VectorX z = VectorX::Zero(r.size());
    for (Eigen::Index v = 0; v < r.size(); ++v)
      if (mass.is_free(v)) z[v] = r[v] / mass.diagonal(v);
    return z;
  };
  for (Eigen::Index v = 0; v < residual.size(); ++v)
    if (!mass.is_free(v)) residual[v] = 0;
  VectorX solution = VectorX::Zero(residual.size());
  const double start = residual.norm();
  if (start == 0) return solution;
  VectorX z = precondition(residual), p = z, product;
  double rz = residual.dot(z);
  int iteration = 0;
  for (; iteration < kMaxIterations && residual.norm() > kRoundOff * start; ++iteration) {
    mass.apply(p, product);
    const double step = rz / p.dot(product);
    solution += step * p;
    residual -= step * product;
    z = precondition(residual);
    const double next = residual.dot(z);
    p = z + next / rz * p;
    rz = next;
  }
  report.iterations = std::max(report.iterations, iteration);
  report.relative_residual = std::max(report.relative_residual, residual.norm() / start);
  return solution;
}

}  // namespace

template <int Dim>
MatrixX touched_cross_mass_product(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                                   const TouchedCells& touched, const MatrixX& u_old) {
  MatrixX product = MatrixX::Zero(static_cast<Eigen::Index>(new_mesh.rest.size()), u_old.cols());
  std::vector<Box<Dim>> boxes;
  for (const int c : touched.old_cells) boxes.push_back(box_of<Dim>(corners<Dim>(old_mesh, c)));
  const Bvh<Dim> tree(boxes);
  std::vector<int> hits;
  std::vector<std::array<Vec<Dim>, Dim + 1>> pieces;
  for (const int c : touched.new_cells) {
    const auto p = corners<Dim>(new_mesh, c);
    hits.clear();
    tree.query(box_of<Dim>(p), hits);
    std::sort(hits.begin(), hits.end());
    for (const int hit : hits) {
      const int o = touched.old_cells[hit];
      const Mat<Dim + 1> block = old_mesh.density[o] * cross_mass<Dim>(p, corners<Dim>(old_mesh, o), pieces);
      for (int i = 0; i <= Dim; ++i)
        for (int j = 0; j <= Dim; ++j) product.row(new_mesh.cells[c][i]) += block(i, j) * u_old.row(old_mesh.cells[o][j]);
    }
  }
  return product;
}

template <int Dim>
void patch_cross_mass(const TransferMesh<Dim>& old_patch, const TransferMesh<Dim>& new_patch, MatrixX& A) {
  A.setZero(static_cast<Eigen::Index>(new_patch.rest.size()), static_cast<Eigen::Index>(old_patch.rest.size()));
  std::vector<std::array<Vec<Dim>, Dim + 1>> pieces;
  for (std::size_t c = 0; c < new_patch.cells.size(); ++c) {
    const auto p = corners<Dim>(new_patch, static_cast<int>(c));
    const Box<Dim> box = box_of<Dim>(p);
    for (std::size_t o = 0; o < old_patch.cells.size(); ++o) {
      const auto q = corners<Dim>(old_patch, static_cast<int>(o));
      if (!box.overlaps(box_of<Dim>(q))) continue;
      const Mat<Dim + 1> block = old_patch.density[o] * cross_mass<Dim>(p, q, pieces);
      for (int i = 0; i <= Dim; ++i)
        for (int j = 0; j <= Dim; ++j) A(new_patch.cells[c][i], old_patch.cells[o][j]) += block(i, j);
    }
  }
}

template <int Dim>
MatrixX project_l2(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh, const TouchedCells& touched,
                   const MatrixX& u_old, const MatrixX& u_bar, std::span<const char> fixed, TransferReport& report) {
  if (touched.new_cells.empty()) return u_bar;
  const MatrixX transferred = touched_cross_mass_product(old_mesh, new_mesh, touched, u_old);
  MatrixX represented = MatrixX::Zero(u_bar.rows(), u_bar.cols());
  add_mass_product(new_mesh, touched.new_cells, u_bar, represented);
  const MatrixX residual = transferred - represented;
  const MassOperator<Dim> mass(new_mesh, fixed);
  MatrixX u_new = u_bar;
  for (Eigen::Index k = 0; k < u_bar.cols(); ++k) u_new.col(k) += solve_mass<Dim>(mass, residual.col(k), report);
  // ||u_new - u_old||^2 = ||u_bar - u_old||^2 - ||u_new - u_bar||^2 on the touched cells, by the orthogonality of the
  // projection.
  MatrixX old_squares = MatrixX::Zero(u_old.rows(), u_old.cols());
  add_mass_product(old_mesh, touched.old_cells, u_old, old_squares);
  report.l2_error_squared = u_old.cwiseProduct(old_squares).sum() + u_bar.cwiseProduct(represented - 2 * transferred).sum() -
                            (u_new - u_bar).cwiseProduct(residual).sum();
  return u_new;
}

#define ITR_INSTANTIATE(Dim)                                                                                                \
  template MatrixX touched_cross_mass_product<Dim>(const TransferMesh<Dim>&, const TransferMesh<Dim>&, const TouchedCells&, \
                                                   const MatrixX&);                                                         \
  template void patch_cross_mass<Dim>(const TransferMesh<Dim>&, const TransferMesh<Dim>&, MatrixX&);                        \
  template MatrixX project_l2<Dim>(const TransferMesh<Dim>&, const TransferMesh<Dim>&, const TouchedCells&, const MatrixX&, \
                                   const MatrixX&, std::span<const char>, TransferReport&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
