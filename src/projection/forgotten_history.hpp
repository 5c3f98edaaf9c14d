// SPDX-License-Identifier: MIT
// History that an edit of the mesh forgets, for the trial that decides about the edit (docs/theory.md, "The rules",
// rule b).
#pragma once

#include "fem/mass.hpp"
#include "itr/transfer.hpp"

namespace itr {

/// By how much the inertia of the new mesh, 1/2 ||x - xhat_new||^2, differs from 1/2 ||x - xhat_old||^2 for a function x of
/// the new mesh: residual . (x - xhat_new) + loss. To be given to InertiaEnergy::set_unrepresented_history.
struct ForgottenHistory {
  MatrixX residual;  ///< num_new_vertices x Dim
  double loss = 0;
};

/// `old_patch` and `new_patch` are the cells that the edit removes and inserts; `old_predictor`, `new_predictor` and the
/// positions `new_x` from which the trial starts have a row for each of their vertices. With consistent mass norms are
/// integrals, and an edit after which the new mesh contains the old one forgets nothing. With lumped mass, of which
/// simulations refuse to remesh curved edges, norms are sums over the vertices of the old mesh, by their masses there: for
/// both sides of the comparison, so that no edit, a split neither, gains by another rule of integration. What differs in x
/// alone is taken at `new_x`.
template <int Dim>
ForgottenHistory forgotten_history(MassKind kind, const TransferMesh<Dim>& old_patch, const TransferMesh<Dim>& new_patch,
                                   const MatrixX& old_predictor, const MatrixX& new_predictor, const MatrixX& new_x);

}  // namespace itr
