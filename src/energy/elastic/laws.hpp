// SPDX-License-Identifier: MIT
// Stored-energy densities W(F) of all laws, F = dx/dX of det F = J > 0, d the dimension (docs/theory.md, "Materials"):
//   neo-Hookean             mu/2 (tr F^T F - d - 2 ln J) + lambda/2 (ln J)^2
//   linear                  mu e:e + lambda/2 (tr e)^2,  e = (F + F^T)/2 - I
//   St. Venant-Kirchhoff    mu E:E + lambda/2 (tr E)^2,  E = (F^T F - I)/2
//   fixed corotated         mu sum (s_i - 1)^2 + lambda/2 (J - 1)^2,  s_i the singular values of F
//   Mooney-Rivlin           c1 (I1 - d) + c2 (I2 - d) + c3 (I1 - d)(I2 - d) + k/2 (ln J)^2 + D (J - 1)^2,
//                           I1, I2 the invariants of J^(-2/d) F F^T; the constant that makes W(I) = 0 is left out
//   sums of laws            energy/elastic/law_table.hpp
// Only the first is infinite at J = 0; the state's own rule, no inverted cell, holds for all of them.
#pragma once

#include "energy/elastic/neo_hookean.hpp"
#include "energy/elastic/volume_response.hpp"
#include "itr/options.hpp"

namespace itr {

/// Terms that a cell has instead of U(J), the volumetric part of its law, where U is a function of the mean J over patches
/// (fem/volume_patches.hpp): bulk/4 (J^2 - 1 - 2 ln J) + pressure (J - 1).
struct CellVolume {
  bool is_split = false;
  double bulk = 0;       ///< that the other part of the law lacks to resist as neo-Hookean cells of lambda = 0 do [Pa]
  double pressure = 0;   ///< dU/dJ of the patches [Pa]
  double deviator = 1;   ///< Material::deviator, of sums of laws
  bool has_bulk = true;  ///< false: of a sum of laws only the part that changes of shape have
};

/// The eigenstrain of a law: F = F_e F_g with F_g = I + strain, and the law sees F_e. Its density times det F_g is that of
/// the body. Of laws of small strains the strain is subtracted.
struct Growth {
  int dimension = 0;  ///< of F_g: 2 where the law is one of the plane; 0: there is none
  bool is_subtracted = false;
  double volume = 1;  ///< det F_g; in plane stress with the growth across the plane
  Mat<3> strain = Mat<3>::Zero(), inverse = Mat<3>::Identity();  ///< F_g - I, F_g^-1

  explicit operator bool() const { return dimension != 0; }
};

/// A law with its moduli at one place.
struct ElasticModuli {
  MaterialLaw law = MaterialLaw::neo_hookean;
  LameParameters lame{};
  MooneyRivlinModuli mooney_rivlin{};
  const OwnLaw* own = nullptr;  ///< of MaterialLaw::own: the material's
  Vec<3> X = Vec<3>::Zero();    ///< rest position, which directions of fibres depend on
  CellVolume volume{};
  Growth growth{};

  /// Whether the neo-Hookean closed forms of F hold.
  bool is_neo_hookean() const { return law == MaterialLaw::neo_hookean && !growth; }
  void set_pressure(double pressure) { lame.pressure = volume.pressure = pressure; }
};

/// Moduli of a material at rest position X.
template <int Dim>
ElasticModuli elastic_moduli(const Material& material, const Vec<Dim>& X);
/// Parts a law (one of may_average_volume, energy/elastic/law_table.hpp): its density at F is that of without_volume<Dim>
/// plus volume_energy at J = det F.
template <int Dim>
ElasticModuli without_volume(ElasticModuli whole);
/// The part of a law that resists changes of shape: of laws of Lame's parameters that with lambda = -2/3 mu, of others
/// without U(J).
ElasticModuli shape_part(ElasticModuli whole);
/// U and its derivatives by J at J = 1 + change.
template <int Dim>
VolumeResponse volume_energy(const ElasticModuli& whole, double change);
/// Density [kg/m^Dim] of a material at rest position X.
template <int Dim>
double mass_density(const Material& material, const Vec<Dim>& X);

/// G = F - I = du/dX. Densities and stresses are computed from it, because F itself rounds small strains away.
template <int Dim>
struct DisplacementGradient {
  Mat<Dim> G;
  static DisplacementGradient of(const Mat<Dim>& F) { return {F - Mat<Dim>::Identity()}; }
  Mat<Dim> F() const { return G + Mat<Dim>::Identity(); }
};

/// W [J/m^Dim]; +infinity where det F <= 0.
template <int Dim>
double elastic_density(const DisplacementGradient<Dim>& at, const ElasticModuli& moduli);
template <int Dim>
double elastic_density(const Mat<Dim>& F, const ElasticModuli& moduli) {
  return elastic_density<Dim>(DisplacementGradient<Dim>::of(F), moduli);
}
/// First Piola-Kirchhoff stress dW/dF [Pa].
template <int Dim>
Mat<Dim> elastic_stress(const DisplacementGradient<Dim>& at, const ElasticModuli& moduli);
template <int Dim>
Mat<Dim> elastic_stress(const Mat<Dim>& F, const ElasticModuli& moduli) {
  return elastic_stress<Dim>(DisplacementGradient<Dim>::of(F), moduli);
}
/// The exact Hessian d2W/dF2 by eigenvalues and modes; leaving out negative values projects it.
template <int Dim>
EigenSystem<Dim> elastic_eigensystem(const Mat<Dim>& F, const ElasticModuli& moduli);

}  // namespace itr
