// SPDX-License-Identifier: MIT
#include "growth.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <limits>

#include "itr/core.hpp"
#include "law_sum.hpp"
#include "strain.hpp"

namespace itr {

namespace {

/// How many directions the eigenstrain of a law in `dim` dimensions acts in.
int growth_dimension(const Material& material, int dim) {
  if (dim == 3) return 3;
  if (const LawSum* sum = sum_of(material)) return sum->dimension == 3 && !sum->is_plane_stress ? 3 : 2;
  const bool is_of_plane = material.law == MaterialLaw::own || material.law == MaterialLaw::mooney_rivlin;
  return material.plane_strain && !is_of_plane ? 3 : 2;
}

template <int LawDim, int Dim>
Mat<LawDim> embed(const Mat<Dim>& A, double across) {
  Mat<LawDim> B = Mat<LawDim>::Identity() * across;
  B.template topLeftCorner<Dim, Dim>() = A;
  return B;
}

template <int LawDim>
Mat<LawDim> corner(const Mat<3>& A) {
  return A.topLeftCorner<LawDim, LawDim>();
}

/// F_e - I.
template <int LawDim, int Dim>
DisplacementGradient<LawDim> elastic_part(const Mat<Dim>& G, const Growth& growth) {
  const Mat<LawDim> change = embed<LawDim, Dim>(G, 0) - corner<LawDim>(growth.strain);
  if (growth.is_subtracted) return {change};
  return {change * corner<LawDim>(growth.inverse)};
}

template <int LawDim, int Dim>
double density_in(const Mat<Dim>& G, const ElasticModuli& moduli) {
  const DisplacementGradient<LawDim> at = elastic_part<LawDim, Dim>(G, moduli.growth);
  const ElasticModuli law = without_growth(moduli);
  if (!moduli.growth.is_subtracted) return moduli.growth.volume * elastic_density<LawDim>(at, law);
  if (!(G.trace() + sum_of_minors(G) > -1)) return std::numeric_limits<double>::infinity();
  return elastic_stress<LawDim>(at, law).cwiseProduct(at.G).sum() / 2;  // whatever the sign of det F_e
}

template <int LawDim, int Dim>
Mat<Dim> stress_in(const Mat<Dim>& G, const ElasticModuli& moduli) {
  const Growth& growth = moduli.growth;
  Mat<LawDim> P = elastic_stress<LawDim>(elastic_part<LawDim, Dim>(G, growth), without_growth(moduli));
  if (!growth.is_subtracted) P = growth.volume * P * corner<LawDim>(growth.inverse).transpose();
  return P.template topLeftCorner<Dim, Dim>();
}

template <int LawDim, int Dim>
EigenSystem<Dim> eigensystem_in(const Mat<Dim>& F, const ElasticModuli& moduli) {
  const Mat<LawDim> inverse = corner<LawDim>(moduli.growth.inverse);
  EigenSystem<LawDim> system =
      elastic_eigensystem<LawDim>(Mat<LawDim>(embed<LawDim, Dim>(F, 1) * inverse), without_growth(moduli));
  for (std::size_t k = 0; k < system.values.size(); ++k) {
    system.values[k] *= moduli.growth.volume;
    system.modes[k] = Mat<LawDim>(system.modes[k] * inverse.transpose());
  }
  if constexpr (LawDim == Dim) {
    return system;
  } else {
    Mat<Dim* Dim> H = Mat<Dim * Dim>::Zero();
    for (std::size_t k = 0; k < system.values.size(); ++k) {
      const Mat<Dim> mode = system.modes[k].template topLeftCorner<Dim, Dim>();
      const Eigen::Map<const Vec<Dim * Dim>> flat(mode.data());
      H += system.values[k] * flat * flat.transpose();
    }
    return decompose<Dim>(H);
  }
}

}  // namespace

template <int Dim>
Growth growth_at(const Material& material, const Vec<3>& X) {
  Growth growth;
  growth.dimension = growth_dimension(material, Dim);
  growth.strain = material.eigenstrain(X, material.eigenstrain_time);
  growth.is_subtracted = material.law == MaterialLaw::linear || (material.own && material.own->has_small_strain());
  if (!is_eigenstrain(growth.strain))
    throw InputError({"", "eigenstrain",
                      fmt::format("{:g} at X = ({:g}), t = {:g} s", fmt::join(growth.strain.reshaped(), ", "),
                                  fmt::join(X, ", "), material.eigenstrain_time),
                      "a symmetric strain of principal values > -1"});
  if (growth.dimension == 2) {
    const LawSum* sum = sum_of(material);
    if (!sum || !sum->is_plane_stress) growth.strain(2, 2) = 0;
  }
  const Mat<3> F = Mat<3>::Identity() + growth.strain;
  growth.inverse = F.inverse();
  growth.volume = F.determinant();
  return growth;
}

Mat<3> elastic_gradient(const Mat<3>& G, const Growth& growth) { return growth ? elastic_part<3, 3>(G, growth).G : G; }

ElasticModuli without_growth(const ElasticModuli& moduli) {
  ElasticModuli law = moduli;
  law.growth = {};
  return law;
}

template <int Dim>
double grown_density(const Mat<Dim>& G, const ElasticModuli& moduli) {
  return moduli.growth.dimension == Dim ? density_in<Dim, Dim>(G, moduli) : density_in<3, Dim>(G, moduli);
}

template <int Dim>
Mat<Dim> grown_stress(const Mat<Dim>& G, const ElasticModuli& moduli) {
  return moduli.growth.dimension == Dim ? stress_in<Dim, Dim>(G, moduli) : stress_in<3, Dim>(G, moduli);
}

template <int Dim>
EigenSystem<Dim> grown_eigensystem(const Mat<Dim>& F, const ElasticModuli& moduli) {
  // The Hessian of a law of small strains is the same at all strains.
  if (moduli.growth.is_subtracted) return elastic_eigensystem<Dim>(F, without_growth(moduli));
  return moduli.growth.dimension == Dim ? eigensystem_in<Dim, Dim>(F, moduli) : eigensystem_in<3, Dim>(F, moduli);
}

#define ITR_INSTANTIATE(Dim)                                                  \
  template Growth growth_at<Dim>(const Material&, const Vec<3>&);             \
  template double grown_density<Dim>(const Mat<Dim>&, const ElasticModuli&);  \
  template Mat<Dim> grown_stress<Dim>(const Mat<Dim>&, const ElasticModuli&); \
  template EigenSystem<Dim> grown_eigensystem<Dim>(const Mat<Dim>&, const ElasticModuli&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
