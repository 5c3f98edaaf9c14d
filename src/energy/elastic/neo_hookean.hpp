// SPDX-License-Identifier: MIT
// Compressible neo-Hookean density W = mu/2 (tr F^T F - d - 2 ln J) + lambda/2 (ln J)^2 (docs/theory.md, "Materials").
#pragma once

#include "itr/types.hpp"

namespace itr {

struct LameParameters {
  double mu = 0;        ///< [Pa]
  double lambda = 0;    ///< [Pa]
  double pressure = 0;  ///< p of a term p (J - 1), see CellVolume [Pa]
};

/// W(F) [J/m^Dim]; +infinity where det F <= 0.
template <int Dim>
double neo_hookean_density(const Mat<Dim>& F, const LameParameters& lame);
/// First Piola-Kirchhoff stress dW/dF.
template <int Dim>
Mat<Dim> neo_hookean_stress(const Mat<Dim>& F, const LameParameters& lame);

/// The Hessian of W as a sum of eigenvalue * (mode x mode): exact, and projected by clamping eigenvalues.
template <int Dim>
struct EigenSystem {
  std::array<double, Dim * Dim> values;
  std::array<Mat<Dim>, Dim * Dim> modes;  ///< orthonormal in the Frobenius product, but with an eigenstrain
};
template <int Dim>
EigenSystem<Dim> neo_hookean_eigensystem(const Mat<Dim>& F, const LameParameters& lame);

/// Only the modes with negative eigenvalues, which a projection takes out: there are few.
template <int Dim>
struct NegativeModes {
  int count = 0;
  std::array<double, Dim * Dim> values;
  std::array<Mat<Dim>, Dim * Dim> modes;
};
template <int Dim>
NegativeModes<Dim> neo_hookean_negative_modes(const Mat<Dim>& F, const LameParameters& lame);

}  // namespace itr
