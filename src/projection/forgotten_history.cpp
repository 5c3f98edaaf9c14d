// SPDX-License-Identifier: MIT
#include "projection/forgotten_history.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "geometry/intersection.hpp"

namespace itr {

namespace {

template <int Dim>
Simplex<Dim> simplex_of(const TransferMesh<Dim>& mesh, std::size_t cell) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest[mesh.cells[cell][k]];
  return Simplex<Dim>(p);
}

template <int Dim>
VectorX lumped_masses(const TransferMesh<Dim>& mesh) {
  VectorX masses = VectorX::Zero(static_cast<Eigen::Index>(mesh.rest.size()));
  for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
    const double mass = mesh.density[c] * simplex_of(mesh, c).volume;
    for (const int v : mesh.cells[c]) masses[v] += mass / (Dim + 1);
  }
  return masses;
}

/// Where a point is in a mesh that covers it: vertices and weights.
template <int Dim>
struct Place {
  std::array<int, Dim + 1> vertices{};
  Vec<Dim + 1> weights = Vec<Dim + 1>::Unit(0);

  Place(const TransferMesh<Dim>& mesh, const Vec<Dim>& X) {
    for (std::size_t v = 0; v < mesh.rest.size(); ++v)
      if (mesh.rest[v] == X) {
        vertices.fill(static_cast<int>(v));
        return;
      }
    double deepest = -std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      const Vec<Dim + 1> here = simplex_of(mesh, c).barycentric(X);
      if (here.minCoeff() <= deepest) continue;
      deepest = here.minCoeff();
      vertices = mesh.cells[c];
      weights = here;
    }
  }
  Vec<Dim> value(const MatrixX& rows) const {
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (int k = 0; k <= Dim; ++k) sum += weights[k] * rows.row(vertices[k]).transpose();
    return sum;
  }
};

template <int Dim>
ForgottenHistory forgotten_by_vertices(const TransferMesh<Dim>& old_patch, const TransferMesh<Dim>& new_patch,
                                       const MatrixX& old_predictor, const MatrixX& new_predictor, const MatrixX& new_x) {
  ForgottenHistory forgotten{MatrixX::Zero(new_predictor.rows(), Dim), 0};
  const VectorX old_mass = lumped_masses(old_patch), new_mass = lumped_masses(new_patch);
  const MatrixX step = new_x - new_predictor;
  double squares = -new_mass.dot(step.rowwise().squaredNorm());
  for (Eigen::Index j = 0; j < old_mass.size(); ++j) {
    const Place<Dim> place(new_patch, old_patch.rest[j]);
    const Vec<Dim> gap = place.value(new_predictor) - old_predictor.row(j).transpose();
    squares += old_mass[j] * (gap.squaredNorm() + place.value(step).squaredNorm());
    for (int k = 0; k <= Dim; ++k)
      forgotten.residual.row(place.vertices[k]) += place.weights[k] * old_mass[j] * gap.transpose();
  }
  forgotten.loss = squares / 2;
  return forgotten;
}

}  // namespace

template <int Dim>
ForgottenHistory forgotten_history(MassKind kind, const TransferMesh<Dim>& old_patch, const TransferMesh<Dim>& new_patch,
                                   const MatrixX& old_predictor, const MatrixX& new_predictor, const MatrixX& new_x) {
  if (kind == MassKind::lumped) return forgotten_by_vertices(old_patch, new_patch, old_predictor, new_predictor, new_x);
  TouchedCells all{std::vector<int>(old_patch.cells.size()), std::vector<int>(new_patch.cells.size())};
  std::iota(all.old_cells.begin(), all.old_cells.end(), 0);
  std::iota(all.new_cells.begin(), all.new_cells.end(), 0);
  TouchedDifference difference = touched_difference(old_patch, new_patch, all, old_predictor, new_predictor);
  return {-difference.residual, std::max(0.0, difference.squares.sum() / 2)};
}

template ForgottenHistory forgotten_history<2>(MassKind, const TransferMesh<2>&, const TransferMesh<2>&, const MatrixX&,
                                               const MatrixX&, const MatrixX&);
template ForgottenHistory forgotten_history<3>(MassKind, const TransferMesh<3>&, const TransferMesh<3>&, const MatrixX&,
                                               const MatrixX&, const MatrixX&);

}  // namespace itr
