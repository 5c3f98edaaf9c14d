// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <memory>

#include "itr/core/types.hpp"

namespace itr {

/// Stored-energy densities; their formulas are in energy/elastic/laws.hpp.
enum class MaterialLaw { neo_hookean, linear, saint_venant_kirchhoff, fixed_corotated, mooney_rivlin, own };

/// A scalar function of rest position X [m]; in 2D X_3 = 0. Empty: none.
using SpaceFunction = std::function<double(const Vec<3>& X)>;

/// Coefficients of the Mooney-Rivlin laws. Two- and three-term forms leave the others 0.
struct MooneyRivlinModuli {
  double c1 = 0;        ///< of the first isochoric invariant [Pa]
  double c2 = 0;        ///< of the second [Pa]
  double c3 = 0;        ///< of their product [Pa]
  double log_k = 0;     ///< k of k/2 (ln J)^2 [Pa]
  double volume_d = 0;  ///< d of d (J - 1)^2 [Pa]
};

/// An energy density W(F) of a program, for F with positive determinant; other F count as infinite. W must be
/// frame-indifferent: W(R F) = W(F). Several threads call it at a time.
class OwnLaw {
 public:
  virtual ~OwnLaw() = default;
  virtual double density(const Eigen::Ref<const MatrixX>& F) const = 0;  ///< [J/m^Dim]
  /// First Piola-Kirchhoff stress dW/dF, Dim x Dim [Pa].
  virtual void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const = 0;
  /// d2W/dF2, Dim^2 x Dim^2, symmetric: F by columns [Pa].
  virtual void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const = 0;
};

/// The material of a body. In 2D all values are per unit thickness.
struct Material {
  MaterialLaw law = MaterialLaw::neo_hookean;
  double youngs_modulus = 1e5;  ///< E [Pa]; of small strains where the law has other moduli; the largest where it varies
  double poisson_ratio = 0.3;   ///< as for E
  double density = 1;           ///< rho [kg/m^3], in 2D too
  bool plane_strain = false;    ///< 2D: lambda = E nu / ((1 + nu)(1 - 2 nu)) instead of nu E / (1 - nu^2)
  MooneyRivlinModuli mooney_rivlin{};
  std::shared_ptr<const OwnLaw> own{};  ///< of MaterialLaw::own; E and nu then are those of small strains, a scale

  /// Functions that replace the constants above, sampled at the rest barycentre of each element. Empty: the constant.
  SpaceFunction youngs_modulus_at{}, poisson_ratio_at{}, density_at{};

  double lame_mu() const { return lame_mu(youngs_modulus, poisson_ratio); }
  double lame_lambda(int dim) const { return lame_lambda(youngs_modulus, poisson_ratio, dim); }
  bool has_varying_moduli() const { return youngs_modulus_at || poisson_ratio_at; }

  static double lame_mu(double E, double nu) { return E / (2 * (1 + nu)); }
  double lame_lambda(double E, double nu, int dim) const {
    return dim == 2 && !plane_strain ? nu * E / (1 - nu * nu) : E * nu / ((1 + nu) * (1 - 2 * nu));
  }
};

}  // namespace itr
