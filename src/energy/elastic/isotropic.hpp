// SPDX-License-Identifier: MIT
// Isotropic densities as functions of four invariants of F: what they share is the way from derivatives by invariants to
// the eigensystem of d2W/dF2 (after Smith et al. 2019, "Analytic eigensystems for isotropic distortion energies").
#pragma once

#include "energy/elastic/laws.hpp"

namespace itr {

/// Derivatives of W by (a, q, t, J) = (tr C, tr C^2, sum s_i, det F) with C = F^T F.
struct InvariantDerivatives {
  enum Index { a, q, t, J };
  Vec<4> first = Vec<4>::Zero();
  Mat<4> second = Mat<4>::Zero();
};

/// Densities and stresses take G = F - I.
template <int Dim>
double saint_venant_density(const Mat<Dim>& G, const LameParameters& lame);
template <int Dim>
Mat<Dim> saint_venant_stress(const Mat<Dim>& G, const LameParameters& lame);
template <int Dim>
InvariantDerivatives saint_venant_derivatives(const Vec<Dim>& s, const LameParameters& lame);

template <int Dim>
double fixed_corotated_density(const Mat<Dim>& G, const LameParameters& lame);
template <int Dim>
Mat<Dim> fixed_corotated_stress(const Mat<Dim>& G, const LameParameters& lame);
template <int Dim>
InvariantDerivatives fixed_corotated_derivatives(const Vec<Dim>& s, const LameParameters& lame);

template <int Dim>
double mooney_rivlin_density(const Mat<Dim>& G, const MooneyRivlinModuli& moduli);
template <int Dim>
Mat<Dim> mooney_rivlin_stress(const Mat<Dim>& G, const MooneyRivlinModuli& moduli);
template <int Dim>
InvariantDerivatives mooney_rivlin_derivatives(const Vec<Dim>& s, const MooneyRivlinModuli& moduli);

/// F = U diag(s) V^T with s >= 0, for det F > 0 (in 2D the smaller singular value has the sign of det F).
template <int Dim>
struct SingularValues {
  Mat<Dim> U, V;
  Vec<Dim> s;
};
SingularValues<2> singular_values(const Mat<2>& F);
SingularValues<3> singular_values(const Mat<3>& F);

/// Second derivatives of W by singular values s, and the values of the symmetric and the skew mode of the pairs (0, 1),
/// (0, 2), (1, 2): (W_i - W_j) / (s_i - s_j) and (W_i + W_j) / (s_i + s_j).
template <int Dim>
struct StretchStiffness {
  static constexpr int kPairs = Dim * (Dim - 1) / 2;
  Mat<Dim> scaling;
  Vec<kPairs> symmetric, skew;
};
template <int Dim>
EigenSystem<Dim> eigensystem_of(const SingularValues<Dim>& svd, const StretchStiffness<Dim>& stiffness);

/// Modes and values: d of scaling, with the eigenvalues of d2W/ds_i ds_j, and a symmetric and a skew one for each pair.
template <int Dim>
EigenSystem<Dim> isotropic_eigensystem(const SingularValues<Dim>& svd, const InvariantDerivatives& W);

}  // namespace itr
