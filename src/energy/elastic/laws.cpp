// SPDX-License-Identifier: MIT
#include "energy/elastic/laws.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.hpp"
#include "growth.hpp"
#include "isotropic.hpp"
#include "itr/core.hpp"
#include "law_sum.hpp"
#include "point.hpp"
#include "strain.hpp"

namespace itr {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <int Dim>
Vec<3> in_space(const Vec<Dim>& X) {
  Vec<3> point = Vec<3>::Zero();
  point.template head<Dim>() = X;
  return point;
}

template <int Dim>
Mat<Dim> small_strain(const Mat<Dim>& G) {
  return 0.5 * (G + G.transpose());
}

/// The Hessian of the linear law does not depend on F: traces, symmetric shears, and nothing for rotations.
template <int Dim>
EigenSystem<Dim> linear_eigensystem(const LameParameters& lame) {
  EigenSystem<Dim> system;
  int k = 0;
  system.values[k] = 2 * lame.mu + Dim * lame.lambda;
  system.modes[k++] = Mat<Dim>::Identity() / std::sqrt(double(Dim));
  for (int i = 1; i < Dim; ++i) {  // (1, -1, 0) / sqrt 2, (1, 1, -2) / sqrt 6
    Vec<Dim> diagonal = Vec<Dim>::Zero();
    for (int j = 0; j < i; ++j) diagonal[j] = 1;
    diagonal[i] = -i;
    system.values[k] = 2 * lame.mu;
    system.modes[k++] = Mat<Dim>(diagonal.normalized().asDiagonal());
  }
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j)
      for (const double sign : {1.0, -1.0}) {
        Mat<Dim> mode = Mat<Dim>::Zero();
        mode(i, j) = std::sqrt(0.5);
        mode(j, i) = sign * mode(i, j);
        system.values[k] = sign > 0 ? 2 * lame.mu : 0;
        system.modes[k++] = mode;
      }
  return system;
}

/// U(J) of a law without what its cells keep, by ln J.
template <int Dim>
VolumeResponse volume_part(const ElasticModuli& whole, double log_J) {
  if (const LawSum* sum = sum_of(whole)) return volume_response(*sum, log_J);
  if (whole.law == MaterialLaw::neo_hookean) {
    const double lambda = whole.lame.lambda;
    return {lambda / 2 * log_J * log_J, lambda * log_J, lambda};
  }
  const MooneyRivlinModuli& m = whole.mooney_rivlin;
  const double change = std::expm1(log_J), J = 1 + change;
  return {m.log_k / 2 * log_J * log_J + m.volume_d * change * change, m.log_k * log_J + 2 * m.volume_d * change * J,
          m.log_k + 2 * m.volume_d * J * (J + change)};
}

template <int Dim>
EigenSystem<Dim> own_eigensystem(const Mat<Dim>& F, const OwnLaw& law) {
  MatrixX H(Dim * Dim, Dim * Dim);
  law.hessian(F, H);
  return decompose<Dim>(H);
}

/// The value of a function of a material at X. Throws InputError unless it lies in (low, high), as Setup::validate asks of
/// constants.
template <int Dim>
double value_at(const SpaceFunction& f, const Vec<Dim>& X, const char* name, double low, double high) {
  const double value = f(in_space<Dim>(X));
  if (low < value && value < high) return value;
  throw InputError({"", name, fmt::format("{} at ({:.6g})", value, fmt::join(X, ", ")),
                    fmt::format("a number of ({:g}, {:g})", low, high)});
}

}  // namespace

template <int Dim>
ElasticModuli elastic_moduli(const Material& material, const Vec<Dim>& X) {
  double E = material.youngs_modulus, nu = material.poisson_ratio;
  if (material.youngs_modulus_at) E = value_at<Dim>(material.youngs_modulus_at, X, "E", 0, kInfinity);
  if (material.poisson_ratio_at) nu = value_at<Dim>(material.poisson_ratio_at, X, "nu", -1, 0.5);
  const double mu = Material::lame_mu(E, nu), f = material.deviator;
  MooneyRivlinModuli m = material.mooney_rivlin;
  m.c1 *= f;
  m.c2 *= f;
  m.c3 *= f;
  ElasticModuli moduli{.law = material.law,
                       .lame = {f * mu, material.lame_lambda(E, nu, Dim) + 2.0 / 3 * (1 - f) * mu},
                       .mooney_rivlin = m,
                       .own = material.own.get(),
                       .X = in_space<Dim>(X),
                       .volume = {.deviator = f}};
  if (material.eigenstrain) moduli.growth = growth_at<Dim>(material, moduli.X);
  return moduli;
}

ElasticModuli shape_part(ElasticModuli whole) {
  if (whole.law == MaterialLaw::own)
    whole.volume.has_bulk = false;
  else if (whole.law == MaterialLaw::mooney_rivlin)
    whole.mooney_rivlin.log_k = whole.mooney_rivlin.volume_d = 0;
  else
    whole.lame.lambda = -2.0 / 3 * whole.lame.mu;
  return whole;
}

VolumeResponse volume_in_cell(const CellVolume& volume, double log_J) {
  const VolumeResponse u = square_bulk(volume.bulk, log_J);
  const double change = volume.pressure * std::expm1(log_J), pJ = volume.pressure + change;
  return {u.value + change, u.first + pJ, u.second + pJ};
}

template <int Dim>
ElasticModuli without_volume(ElasticModuli whole) {
  ElasticModuli cell = whole;
  cell.volume.is_split = true;
  if (whole.law == MaterialLaw::neo_hookean) {
    cell.lame.lambda = 0;
  } else if (const LawSum* sum = sum_of(whole)) {
    const RestModuli rest = rest_moduli(*sum);
    const double left = rest.bulk - volume_response(*sum, 0).second;
    cell.volume.bulk = std::max(0.0, 2 * rest.shear / sum->dimension - left);
  } else {
    cell.mooney_rivlin.log_k = cell.mooney_rivlin.volume_d = 0;
    cell.volume.bulk = 2 * whole.lame.mu / Dim;
  }
  return cell;
}

template <int Dim>
VolumeResponse volume_energy(const ElasticModuli& whole, double change) {
  if (whole.growth) {
    const double g = whole.growth.volume;
    const VolumeResponse U = volume_energy<Dim>(without_growth(whole), (change - (g - 1)) / g);
    return {g * U.value, U.first, U.second / g};
  }
  const double log_J = std::log1p(change), J = 1 + change;
  const VolumeResponse all = volume_part<Dim>(whole, log_J);
  const VolumeResponse kept = square_bulk(without_volume<Dim>(whole).volume.bulk, log_J);
  const double first = all.first - kept.first;
  return {all.value - kept.value, first / J, (all.second - kept.second - first) / (J * J)};
}

template <int Dim>
double mass_density(const Material& material, const Vec<Dim>& X) {
  return material.density_at ? value_at<Dim>(material.density_at, X, "rho", 0, kInfinity) : material.density;
}

template <int Dim>
double elastic_density(const DisplacementGradient<Dim>& at, const ElasticModuli& moduli) {
  if (moduli.growth) return grown_density<Dim>(at.G, moduli);
  if (moduli.law == MaterialLaw::neo_hookean) return NeoHookeanPoint<Dim>(at, moduli.lame).density();
  const Mat<Dim>& G = at.G;
  if (!(G.trace() + sum_of_minors(G) > -1)) return std::numeric_limits<double>::infinity();
  const LameParameters& lame = moduli.lame;
  switch (moduli.law) {
    case MaterialLaw::linear: {
      const Mat<Dim> e = small_strain<Dim>(G);
      return lame.mu * e.squaredNorm() + lame.lambda / 2 * e.trace() * e.trace();
    }
    case MaterialLaw::saint_venant_kirchhoff:
      return saint_venant_density<Dim>(G, lame);
    case MaterialLaw::fixed_corotated:
      return fixed_corotated_density<Dim>(G, lame);
    case MaterialLaw::own:
      if (const LawSum* sum = sum_of(moduli)) return sum_density<Dim>(G, *sum, moduli.X, moduli.volume);
      return moduli.own->density(at.F());
    default: {
      const double W = mooney_rivlin_density<Dim>(G, moduli.mooney_rivlin);
      return moduli.volume.is_split ? W + volume_in_cell(moduli.volume, Strain<Dim>(G).log_J).value : W;
    }
  }
}

template <int Dim>
Mat<Dim> elastic_stress(const DisplacementGradient<Dim>& at, const ElasticModuli& moduli) {
  if (moduli.growth) return grown_stress<Dim>(at.G, moduli);
  const Mat<Dim>& G = at.G;
  const LameParameters& lame = moduli.lame;
  switch (moduli.law) {
    case MaterialLaw::neo_hookean: {
      const NeoHookeanPoint<Dim> point(at, lame);
      return point.stress(point.inverse());
    }
    case MaterialLaw::linear: {
      const Mat<Dim> e = small_strain<Dim>(G);
      return 2 * lame.mu * e + lame.lambda * e.trace() * Mat<Dim>::Identity();
    }
    case MaterialLaw::saint_venant_kirchhoff:
      return saint_venant_stress<Dim>(G, lame);
    case MaterialLaw::fixed_corotated:
      return fixed_corotated_stress<Dim>(G, lame);
    case MaterialLaw::own: {
      if (const LawSum* sum = sum_of(moduli)) return sum_stress<Dim>(G, *sum, moduli.X, moduli.volume);
      MatrixX P(Dim, Dim);
      moduli.own->stress(at.F(), P);
      return P;
    }
    default: {
      const Mat<Dim> P = mooney_rivlin_stress<Dim>(G, moduli.mooney_rivlin);
      if (!moduli.volume.is_split) return P;
      const Strain<Dim> strain(G);
      return P + volume_in_cell(moduli.volume, strain.log_J).first * strain.inverse_transpose();
    }
  }
}

template <int Dim>
EigenSystem<Dim> elastic_eigensystem(const Mat<Dim>& F, const ElasticModuli& moduli) {
  if (moduli.growth) return grown_eigensystem<Dim>(F, moduli);
  if (moduli.law == MaterialLaw::neo_hookean) return neo_hookean_eigensystem<Dim>(F, moduli.lame);
  if (moduli.law == MaterialLaw::linear) return linear_eigensystem<Dim>(moduli.lame);
  if (moduli.law == MaterialLaw::own) {
    const LawSum* sum = sum_of(moduli);
    return sum ? sum_eigensystem<Dim>(F, *sum, moduli.X, moduli.volume) : own_eigensystem<Dim>(F, *moduli.own);
  }
  const SingularValues<Dim> svd = singular_values(F);
  switch (moduli.law) {
    case MaterialLaw::saint_venant_kirchhoff:
      return isotropic_eigensystem<Dim>(svd, saint_venant_derivatives<Dim>(svd.s, moduli.lame));
    case MaterialLaw::fixed_corotated:
      return isotropic_eigensystem<Dim>(svd, fixed_corotated_derivatives<Dim>(svd.s, moduli.lame));
    default: {
      using I = InvariantDerivatives;
      I W = mooney_rivlin_derivatives<Dim>(svd.s, moduli.mooney_rivlin);
      if (moduli.volume.is_split) {
        const double J = svd.s.prod();
        const VolumeResponse U = volume_in_cell(moduli.volume, std::log(J));
        W.first[I::J] += U.first / J;
        W.second(I::J, I::J) += (U.second - U.first) / (J * J);
      }
      return isotropic_eigensystem<Dim>(svd, W);
    }
  }
}

#define ITR_INSTANTIATE(Dim)                                                                     \
  template ElasticModuli elastic_moduli<Dim>(const Material&, const Vec<Dim>&);                  \
  template double mass_density<Dim>(const Material&, const Vec<Dim>&);                           \
  template ElasticModuli without_volume<Dim>(ElasticModuli);                                     \
  template VolumeResponse volume_energy<Dim>(const ElasticModuli&, double);                      \
  template double elastic_density<Dim>(const DisplacementGradient<Dim>&, const ElasticModuli&);  \
  template Mat<Dim> elastic_stress<Dim>(const DisplacementGradient<Dim>&, const ElasticModuli&); \
  template EigenSystem<Dim> elastic_eigensystem<Dim>(const Mat<Dim>&, const ElasticModuli&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
