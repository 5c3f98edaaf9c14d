// SPDX-License-Identifier: MIT
// Laws with an eigenstrain (Growth), made of the law at F_e (docs/theory.md, "Eigenstrain").
#pragma once

#include "energy/elastic/laws.hpp"

namespace itr {

/// The eigenstrain of a material at X. It acts across the plane, too, where the law is that of plane strain. Throws
/// InputError where I + strain is not positive definite.
template <int Dim>
Growth growth_at(const Material& material, const Vec<3>& X);
/// F_e - I where F - I = G in space, of laws that are not of a plane alone.
Mat<3> elastic_gradient(const Mat<3>& G, const Growth& growth);
/// Volume by that which the law sees: of densities by those of the law.
inline double volume_ratio(const Growth& growth) { return growth.is_subtracted ? 1 : growth.volume; }
/// The law that sees F_e.
ElasticModuli without_growth(const ElasticModuli& moduli);

// Functions of moduli with an eigenstrain.

template <int Dim>
double grown_density(const Mat<Dim>& G, const ElasticModuli& moduli);
template <int Dim>
Mat<Dim> grown_stress(const Mat<Dim>& G, const ElasticModuli& moduli);
template <int Dim>
EigenSystem<Dim> grown_eigensystem(const Mat<Dim>& F, const ElasticModuli& moduli);

}  // namespace itr
