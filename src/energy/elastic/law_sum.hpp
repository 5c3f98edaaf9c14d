// SPDX-License-Identifier: MIT
// Sums of laws (law_table.hpp) at a deformation gradient: isotropic ones by its principal strains, fibres by the stretch
// along them. In 2D F33 is 1, or what makes the stress across the plane 0.
#pragma once

#include <Eigen/Eigenvalues>

#include "energy/elastic/laws.hpp"
#include "law_table.hpp"
#include "stretch_response.hpp"

namespace itr {

/// Density and stress take G = F - I, of det F > 0. X is the rest position, which directions of fibres may depend on. Where
/// `volume` is split, its terms stand for the volumetric parts.
template <int Dim>
double sum_density(const Mat<Dim>& G, const LawSum& sum, const Vec<3>& X, const CellVolume& volume = {});
template <int Dim>
Mat<Dim> sum_stress(const Mat<Dim>& G, const LawSum& sum, const Vec<3>& X, const CellVolume& volume = {});
template <int Dim>
EigenSystem<Dim> sum_eigensystem(const Mat<Dim>& F, const LawSum& sum, const Vec<3>& X, const CellVolume& volume = {});

/// The response to in-plane strains (3D: to all) of the isotropic terms. In plane stress the third strain is eliminated: W
/// is infinite where there is none that makes the stress across the plane 0.
StretchSum response_to(const LawSum& sum, Vec<3> strains, double log_J, const CellVolume& volume = {});

/// The terms of a split law that stand for its volumetric part in a cell, by ln J.
VolumeResponse volume_in_cell(const CellVolume& volume, double log_J);

/// The sum that a law is; null if it is another one.
inline const LawSum* sum_of(const ElasticModuli& moduli) { return dynamic_cast<const LawSum*>(moduli.own); }

/// F33 of a sum in plane stress; 1 of other laws and in 3D.
template <int Dim>
double thickness(const Mat<Dim>& F, const ElasticModuli& moduli);

/// Decomposes a symmetric d2W/dF2, whose rows and columns are F by columns.
template <int Dim>
EigenSystem<Dim> decompose(const Mat<Dim * Dim>& H) {
  const Eigen::SelfAdjointEigenSolver<Mat<Dim * Dim>> eigen(H);
  EigenSystem<Dim> system;
  for (int k = 0; k < Dim * Dim; ++k) {
    system.values[k] = eigen.eigenvalues()[k];
    system.modes[k] = Eigen::Map<const Mat<Dim>>(eigen.eigenvectors().col(k).data());
  }
  return system;
}

}  // namespace itr
