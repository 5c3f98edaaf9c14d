// SPDX-License-Identifier: MIT
#include "law_table.hpp"

#include <algorithm>
#include <cmath>

#include "energy/polyfem/ideal_cell.hpp"
#include "strain.hpp"
#include "stretch_response.hpp"

namespace itr {

namespace {

using Range = LawCoefficient::Range;

constexpr LawCoefficient list(const char* key, Range range = Range::any) { return {key, range, true}; }
constexpr LawCoefficient kBulk = {"K", Range::positive};

/// U = K/4 (J^2 - 1 - 2 ln J).
void add_bulk(double K, StretchResponse& at) {
  const VolumeResponse U = square_bulk(K, at.log_J());
  at.add_volume(U.value, U.first, U.second);
}

/// k/2 (ln J)^2.
void add_log_bulk(double k, StretchResponse& at) {
  const double log_J = at.log_J();
  at.add_volume(k / 2 * log_J * log_J, k * log_J, k);
}

/// sum_i C_i x^i with x = I1 - d of isochoric stretches.
void add_yeoh(const LawValues& v, StretchResponse& at) {
  const StretchSum S = at.isochoric_powers(2);
  double f = 0, d1 = 0, d2 = 0;
  for (std::size_t i = v[0].size(); i-- > 0;) {  // Horner's rule, for f / x
    d2 = 2 * d1 + S.value * d2;
    d1 = f + S.value * d1;
    f = v[0][i] + S.value * f;
  }
  at.add(S.value * f, f + S.value * d1, 2 * d1 + S.value * d2, S);
  add_bulk(v[1][0], at);
}

/// sum_p mu_p / alpha_p sum_i (t_i^alpha_p - 1), t the isochoric stretches.
void add_ogden(const LawValues& v, StretchResponse& at) {
  for (std::size_t p = 0; p < v[0].size(); ++p) at.add(v[0][p] / v[1][p], at.isochoric_powers(v[1][p]));
  add_bulk(v[2][0], at);
}

/// mu sum_i c_i / lambda_m^(2 i - 2) (I^i - d^i), five terms of the inverse Langevin function (Arruda and Boyce 1993).
void add_arruda_boyce(const LawValues& v, StretchResponse& at) {
  constexpr double kSeries[] = {1.0 / 2, 1.0 / 20, 11.0 / 1050, 19.0 / 7000, 519.0 / 673750};
  const double mu = v[0][0], limit = v[1][0], at_rest = at.dimension();
  const StretchSum S = at.isochoric_powers(2);
  const double I = at_rest + S.value;
  double f = 0, d1 = 0, d2 = 0, factor = mu;
  double power = 1, lower = 0, quotient = 1;  // I^(i-1), I^(i-2), (I^i - d^i) / x
  for (int i = 1; i <= 5; ++i) {
    f += factor * kSeries[i - 1] * quotient * S.value;
    d1 += factor * kSeries[i - 1] * i * power;
    d2 += factor * kSeries[i - 1] * i * (i - 1) * lower;
    lower = power;
    power *= I;
    quotient = power + at_rest * quotient;
    factor /= limit * limit;
  }
  at.add(f, d1, d2, S);
  add_bulk(v[2][0], at);
}

void add_mooney_rivlin(const LawValues& v, StretchResponse& at) {
  at.add(v[0][0], at.isochoric_powers(2));
  at.add(v[1][0], at.isochoric_powers(-2));
  add_bulk(v[2][0], at);
}

/// sum_p 2 mu_p / alpha_p^2 (sum_i (s_i^alpha_p - 1) + (J^(-alpha_p beta_p) - 1) / beta_p), beta = nu / (1 - 2 nu).
void add_hyperfoam(const LawValues& v, StretchResponse& at) {
  for (std::size_t p = 0; p < v[0].size(); ++p) {
    const double alpha = v[1][p], beta = v[2][p] / (1 - 2 * v[2][p]), factor = 2 * v[0][p] / (alpha * alpha);
    at.add(factor, at.powers(alpha));
    if (beta == 0) continue;
    const double y = -alpha * beta * at.log_J();
    at.add_volume(factor / beta * minus_expm1(y), -factor * alpha * std::expm1(y),
                  factor * alpha * alpha * beta * std::exp(y));
  }
}

void add_hencky(const LawValues& v, StretchResponse& at) {
  at.add_squares(v[1][0]);
  add_log_bulk(v[0][0], at);
}

void add_neo_hookean(const LawValues& v, StretchResponse& at) {
  at.add(v[1][0] / 2, at.powers(2));
  add_log_bulk(v[0][0], at);
}

/// sum_p 2 mu_p / alpha_p^2 sum_i (t_i^alpha_p - 1) + sum_k (J - 1)^(2 k) / D_k.
void add_unconstrained_ogden(const LawValues& v, StretchResponse& at) {
  for (std::size_t p = 0; p < v[0].size(); ++p) at.add(2 * v[0][p] / (v[1][p] * v[1][p]), at.isochoric_powers(v[1][p]));
  const double change = std::expm1(at.log_J()), J = 1 + change;
  double lower = 1;  // change^(2 k - 2)
  for (std::size_t k = 0; k < v[2].size(); ++k, lower *= change * change) {
    const double D = v[2][k], m = 2.0 * static_cast<double>(k + 1);
    at.add_volume(lower * change * change / D, m * lower * change * J / D, m * lower * J * ((m - 1) * J + change) / D);
  }
}

/// sum_p c_p / m_p^2 sum_i (t_i^m_p - 1) + k/2 (ln J)^2.
void add_incompressible_ogden(const LawValues& v, StretchResponse& at) {
  for (std::size_t p = 0; p < v[0].size(); ++p) at.add(v[0][p] / (v[1][p] * v[1][p]), at.isochoric_powers(v[1][p]));
  add_log_bulk(v[2][0], at);
}

/// 100 mu (1 / (1 + (J / J0 - 1)^3) - 1) below J0, 0 above it.
void add_inversion_barrier(const LawValues& v, StretchResponse& at) {
  constexpr double kSize = 100;
  const double J = std::exp(at.log_J()), limit = v[2][0], t = J / limit - 1;
  if (t >= 0) return;
  const double q = 1 + t * t * t, factor = kSize * v[1][0];
  const double first = -factor * 3 * t * t / (limit * q * q);
  const double second = factor * (18 * t * t * t * t - 6 * t * q) / (limit * limit * q * q * q);
  at.add_volume(-factor * t * t * t / q, first * J, (second * J + first) * J);
}

/// k1 / (2 k2) (exp(k2 x^2) - 1) of stretched fibres.
FibreResponse hgo_fibre(const LawValues& v, double x) {
  if (x <= 0) return {0, 0, 0};
  const double k1 = v[0][0], k2 = v[1][0], y = k2 * x * x, growth = std::exp(y);
  return {k1 / (2 * k2) * std::expm1(y), k1 * x * growth, k1 * (1 + 2 * y) * growth};
}

/// -T/2 x: T > 0 pushes along the fibre, as PolyFEM has it.
FibreResponse active_fibre(const LawValues& v, double x) {
  const double tension = v[0][0] * v[1][0];
  return {-tension / 2 * x, -tension / 2, 0};
}

const std::vector<LawRow>& rows() {
  static const std::vector<LawRow> all = {
      {"Yeoh", {list("C"), kBulk}, add_yeoh},
      {"Ogden", {list("mus"), list("alphas", Range::not_zero), kBulk}, add_ogden},
      {"ArrudaBoyce", {{"mu", Range::positive}, {"lambda_m", Range::above_one}, kBulk}, add_arruda_boyce},
      {"IsochoricMooneyRivlin", {{"c1", Range::any}, {"c2", Range::any}, kBulk}, add_mooney_rivlin},
      {"Hyperfoam", {list("mus"), list("alphas", Range::not_zero), list("nus", Range::compressible)}, add_hyperfoam},
      {"Hencky", {{"lambda", Range::any}, {"mu", Range::positive}}, add_hencky, nullptr, true},
      {"NeoHookean", {{"lambda", Range::any}, {"mu", Range::positive}}, add_neo_hookean, nullptr, true, true},
      {"UnconstrainedOgden",
       {list("mus"), list("alphas", Range::not_zero), {"Ds", Range::positive, true, std::nullopt, true}},
       add_unconstrained_ogden},
      {"IncompressibleOgden", {list("c"), list("m", Range::not_zero), {"k", Range::positive}}, add_incompressible_ogden},
      {"IsochoricNeoHookean",
       {{"lambda", Range::any}, {"mu", Range::positive}},
       [](const LawValues& v, StretchResponse& at) { at.add(v[1][0] / 2, at.isochoric_powers(2)); },
       nullptr,
       true},
      {"VolumePenalty", {{"k", Range::positive}}, [](const LawValues& v, StretchResponse& at) { add_bulk(v[0][0], at); }},
      {"InversionBarrier",
       {{"lambda", Range::any}, {"mu", Range::positive}, {"JBarrierThreshold", Range::positive, false, 0.5}},
       add_inversion_barrier,
       nullptr,
       true,
       true},
      {"AMIPS",
       {{"weight", Range::positive, false, 1}},
       [](const LawValues& v, StretchResponse& at) { at.add(v[0][0], at.isochoric_powers(2)); }},
      {"HGOFiber",
       {{"k1", Range::positive}, {"k2", Range::positive}, {"kappa", Range::third, false, 0}},
       nullptr,
       hgo_fibre,
       false,
       false,
       2},
      {"ActiveFiber", {{"Tmax", Range::any}, {"activation", Range::share}}, nullptr, active_fibre},
  };
  return all;
}

}  // namespace

std::span<const LawRow> law_rows() { return rows(); }

std::string LawSum::name() const {
  std::string text;
  for (const Term& term : terms) text += (text.empty() ? "" : " + ") + std::string(term.row->type);
  return text;
}

VolumeResponse volume_response(const LawSum& sum, double log_J) {
  StretchResponse at(sum.dimension, Vec<3>::Zero(), log_J, true);
  for (const LawSum::Term& term : sum.terms)
    if (term.row->add) term.row->add(term.values, at);
  return at.volume();
}

/// As in plane strain and in 3D nu = 0.48 has; a law that is the sum of two such parts, lambda / mu = 24.
bool is_nearly_incompressible(const Material& material, int dim) {
  constexpr double kRatio = 24 * (1 - 1e-9);
  if (!may_average_volume(material, dim)) return false;
  if (const LawSum* sum = sum_of(material)) {
    const RestModuli rest = rest_moduli(*sum);
    return rest.bulk - 2 * rest.shear / sum->dimension >= kRatio * rest.shear;
  }
  if (material.law == MaterialLaw::mooney_rivlin) {
    const MooneyRivlinModuli& m = material.mooney_rivlin;
    return m.log_k + 2 * m.volume_d - 2 * material.lame_mu() / dim >= kRatio * material.lame_mu();
  }
  return material.lame_lambda(dim) >= kRatio * material.lame_mu();
}

bool may_average_volume(const Material& material, int dim) {
  if (material.has_varying_moduli()) return false;
  if (const LawSum* sum = sum_of(material)) return !sum->is_plane_stress && volume_response(*sum, 0).second > 0;
  if (material.law == MaterialLaw::mooney_rivlin) return true;
  return material.law == MaterialLaw::neo_hookean && (dim == 3 || material.plane_strain) && material.lame_lambda(dim) > 0;
}

std::string why_not_viscous(const Material& material, int dim) {
  if (is_of_ideal_cell(material)) return "AMIPS without a rest pose";
  if (material.law == MaterialLaw::mooney_rivlin && dim == 2)
    return "MooneyRivlin in 2D, which has invariants of the plane; IsochoricMooneyRivlin has those of space";
  if (material.law != MaterialLaw::own)
    return dim == 2 && !material.plane_strain ? "plane stress; \"plane_strain\": true can be viscoelastic" : "";
  const LawSum* sum = sum_of(material);
  if (!sum) return "an elasticity_tensor or a law of a program, of which no part is known to be the deviator's";
  if (sum->is_plane_stress) return "plane stress; plane strain can be viscoelastic";
  if (sum->dimension == 2) return "invariants of the plane, of PolyFEM's defaults; ITR's are those of space";
  for (const LawSum::Term& term : sum->terms) {
    const std::string_view type = term.row->type;
    if (term.share) return "a fibre whose activation varies";
    if (type == "Hyperfoam" || type == "NeoHookean" || type == "ActiveFiber")
      return std::string(type) + " in a law, which has no isochoric part; IsochoricNeoHookean, Yeoh and Ogden have one";
  }
  return "";
}

std::string why_not_softening(const Material& material, int dim) {
  if (!material.prony.empty()) return "a material that is viscoelastic (prony)";
  if (material.eigenstrain) return "a material that has an eigenstrain";
  if (material.law != MaterialLaw::own && material.law != MaterialLaw::mooney_rivlin)
    return "a law without an isochoric part; IsochoricNeoHookean, Yeoh and Ogden have one";
  return why_not_viscous(material, dim);
}

RestModuli rest_moduli(const LawSum& sum) {
  StretchResponse at(sum.dimension, Vec<3>::Zero(), 0);
  for (const LawSum::Term& term : sum.terms)
    if (term.row->add) term.row->add(term.values, at);
  const double shear = at.sum().divided[2] / 2;
  return {shear, at.sum().second.sum() / (sum.dimension * sum.dimension)};
}

Material material_of(const LawSum& sum, int dim) {
  const auto own = std::make_shared<LawSum>(sum);
  std::stable_partition(own->terms.begin(), own->terms.end(), [](const LawSum::Term& term) { return !term.row->fibre; });
  const auto [shear, bulk] = rest_moduli(sum);
  Material material{.law = MaterialLaw::own, .own = own};
  if (sum.dimension == 3) {
    material.poisson_ratio = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear));
    material.plane_strain = dim == 2 && !sum.is_plane_stress;
  } else {  // E and nu of plane stress that give these moduli back, but for bodies that none has
    material.plane_strain = bulk >= 3 * shear;
    material.poisson_ratio = (bulk - shear) / (material.plane_strain ? 2 * bulk : bulk + shear);
  }
  material.youngs_modulus = 2 * shear * (1 + material.poisson_ratio);
  return material;
}

}  // namespace itr
