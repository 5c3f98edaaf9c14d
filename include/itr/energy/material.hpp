// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

enum class MaterialLaw { neo_hookean };

/// What a body is made of. In 2D all is per unit thickness.
struct Material {
  MaterialLaw law = MaterialLaw::neo_hookean;
  double youngs_modulus = 1e5;  ///< E [Pa]
  double poisson_ratio = 0.3;
  double density = 1;         ///< rho [kg/m^3]; 2D: [kg/m^2]
  bool plane_strain = false;  ///< 2D: lambda = E nu / ((1 + nu)(1 - 2 nu)) instead of nu E / (1 - nu^2)

  double lame_mu() const { return youngs_modulus / (2 * (1 + poisson_ratio)); }
  double lame_lambda(int dim) const {
    const double E = youngs_modulus, nu = poisson_ratio;
    return dim == 2 && !plane_strain ? nu * E / (1 - nu * nu) : E * nu / ((1 + nu) * (1 - 2 * nu));
  }
};

}  // namespace itr
