// SPDX-License-Identifier: MIT
#include "law_sum.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "isotropic.hpp"
#include "strain.hpp"

namespace itr {

namespace {

StretchSum respond(const LawSum& sum, const Vec<3>& strains, double log_J, const CellVolume& volume = {}) {
  StretchResponse response(sum.dimension, strains, log_J, volume.is_split, volume.deviator, volume.has_bulk);
  for (const LawSum::Term& term : sum.terms)
    if (term.row->add) term.row->add(term.values, response);
  if (volume.is_split) response.add_to_cell(volume_in_cell(volume, log_J));
  return response.sum();
}

/// Finds the response with a third strain that makes its stress 0, by Newton's method between strains of either sign. The
/// third strain is then in `strains`.
StretchSum respond_in_plane_stress(const LawSum& sum, Vec<3>& strains, double log_J) {
  constexpr double kEnough = 2e-15, kMostChange = 0.5;
  constexpr int kMostIterations = 200;
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  strains[2] = -log_J / 2;
  for (int i = 0; i < kMostIterations; ++i) {
    StretchSum response = respond(sum, strains, log_J + strains[2]);
    const double slope = response.second(2, 2), stress = response.first[2];
    if (!std::isfinite(stress)) break;
    if (stress != 0) (stress < 0 ? low : high) = strains[2];
    double change = slope > 0 ? -stress / slope : (stress < 0 ? kMostChange : -kMostChange);
    change = std::clamp(change, -kMostChange, kMostChange);
    double next = strains[2] + change;
    if (!(low < next && next < high)) next = (low + high) / 2;
    const bool is_done = std::abs(change) <= kEnough * strains.lpNorm<Eigen::Infinity>() || next == strains[2];
    if (slope > 0 && is_done) {
      response.second -= response.second.col(2) * response.second.row(2).eval() / slope;
      return response;
    }
    strains[2] = next;
  }
  StretchSum none;
  none.value = std::numeric_limits<double>::infinity();
  return none;
}

/// F = U diag(exp(strains)) V^T with strains of the precision of G.
template <int Dim>
struct Principal {
  Mat<Dim> U, V;
  Vec<3> strains = Vec<3>::Zero();

  explicit Principal(const Strain<Dim>& strain) {
    if (!strain.is_small) {
      const SingularValues<Dim> svd = singular_values(strain.F);
      U = svd.U;
      V = svd.V;
      strains.template head<Dim>() = svd.s.array().log();
      return;
    }
    const Eigen::SelfAdjointEigenSolver<Mat<Dim>> solver(strain.A);
    V = solver.eigenvectors();
    for (int i = 0; i < Dim; ++i) {
      strains[i] = std::log1p(solver.eigenvalues()[i]) / 2;
      U.col(i) = strain.F * V.col(i) * std::exp(-strains[i]);
    }
  }
};

/// x = M : C J^(-2/d) - 1 of a fibre at F, with its derivatives: M = kappa I + (1 - d kappa) a a^T.
template <int Dim>
class FibreStretch {
 public:
  FibreStretch(const LawSum& sum, const LawSum::Term& term, const Vec<3>& direction, const Strain<Dim>& strain)
      : strain_(strain), share_(2.0 / sum.dimension) {
    const double kappa = term.row->dispersion < 0 ? 0 : term.values[static_cast<std::size_t>(term.row->dispersion)][0];
    const Vec<Dim> a = direction.template head<Dim>();
    M_ = (1 - sum.dimension * kappa) * a * a.transpose();
    M_.diagonal().array() += kappa;
    scale_change_ = std::expm1(-share_ * strain.log_J);
    change_ = (M_.array() * strain.A.array()).sum();
  }
  double value() const { return scale_change_ + scale() * change_; }
  Mat<Dim> gradient() const { return scale() * (2 * strain_.F * M_ - share_ * (1 + change_) * strain_.inverse_transpose()); }
  /// With L = F^-T, d(L) = -L dF^T L.
  Mat<Dim * Dim> hessian() const {
    const Mat<Dim> L = strain_.inverse_transpose(), slope = 2 * strain_.F * M_;
    const auto by_columns = [](const Mat<Dim>& A) { return Eigen::Map<const Vec<Dim * Dim>>(A.data()); };
    const auto l = by_columns(L), g = by_columns(slope);
    Mat<Dim* Dim> H = share_ * share_ * (1 + change_) * l * l.transpose() - share_ * (l * g.transpose() + g * l.transpose());
    for (int j = 0; j < Dim; ++j)
      for (int i = 0; i < Dim; ++i)
        for (int q = 0; q < Dim; ++q)
          for (int p = 0; p < Dim; ++p)
            H(i + Dim * j, p + Dim * q) += share_ * (1 + change_) * L(i, q) * L(p, j) + (i == p ? 2 * M_(j, q) : 0);
    return scale() * H;
  }

 private:
  double scale() const { return 1 + scale_change_; }

  const Strain<Dim>& strain_;
  double share_, scale_change_, change_;  ///< 2/d, J^(-2/d) - 1, M : (C - I)
  Mat<Dim> M_;
};

/// Calls visit(x, factor * w(x)) for all fibres.
template <int Dim, typename Visit>
void visit_fibres(const LawSum& sum, const Vec<3>& X, const Strain<Dim>& strain, double factor, const Visit& visit) {
  for (const LawSum::Term& term : sum.terms) {
    if (!term.row->fibre) continue;
    const FibreStretch<Dim> stretch(sum, term, term.direction(X), strain);
    const FibreResponse w = term.row->fibre(term.values, stretch.value());
    const double share = term.share ? factor * term.share(X, sum.time) : factor;
    visit(stretch, FibreResponse{share * w.value, share * w.first, share * w.second});
  }
}

/// By W_i = first_i / s_i, with differences by those of strains, so that equal stretches do not divide 0 by 0.
template <int Dim>
StretchStiffness<Dim> stiffness_of(const StretchSum& response, const Vec<Dim>& s) {
  StretchStiffness<Dim> stiffness;
  const auto& t = response.first;
  for (int i = 0, pair = 0; i < Dim; ++i) {
    for (int j = 0; j < Dim; ++j) stiffness.scaling(i, j) = (response.second(i, j) - (i == j ? t[i] : 0)) / (s[i] * s[j]);
    for (int j = i + 1; j < Dim; ++j, ++pair) {
      const double by_stretches =
          response.divided[3 - i - j] / (std::sqrt(s[i] * s[j]) * sinh_ratio(std::log(s[i] / s[j]) / 2));
      stiffness.symmetric[pair] = (by_stretches * (s[i] + s[j]) - (t[i] + t[j])) / (2 * s[i] * s[j]);
      stiffness.skew[pair] = (t[i] / s[i] + t[j] / s[j]) / (s[i] + s[j]);
    }
  }
  return stiffness;
}

}  // namespace

StretchSum response_to(const LawSum& sum, Vec<3> strains, double log_J, const CellVolume& volume) {
  return sum.is_plane_stress ? respond_in_plane_stress(sum, strains, log_J) : respond(sum, strains, log_J, volume);
}

template <int Dim>
double thickness(const Mat<Dim>& F, const ElasticModuli& moduli) {
  const LawSum* sum = sum_of(moduli);
  if (!sum || !sum->is_plane_stress) return 1;
  const Mat<Dim> elastic = F * moduli.growth.inverse.template topLeftCorner<Dim, Dim>();
  const Strain<Dim> strain(Mat<Dim>(elastic - Mat<Dim>::Identity()));
  Vec<3> strains = Principal<Dim>(strain).strains;
  respond_in_plane_stress(*sum, strains, strain.log_J);
  return std::exp(strains[2]) * (1 + moduli.growth.strain(2, 2));
}

template <int Dim>
double sum_density(const Mat<Dim>& G, const LawSum& sum, const Vec<3>& X, const CellVolume& volume) {
  const Strain<Dim> strain(G);
  double W = response_to(sum, Principal<Dim>(strain).strains, strain.log_J, volume).value;
  visit_fibres<Dim>(sum, X, strain, volume.deviator, [&](const auto&, const FibreResponse& w) { W += w.value; });
  return W;
}

template <int Dim>
Mat<Dim> sum_stress(const Mat<Dim>& G, const LawSum& sum, const Vec<3>& X, const CellVolume& volume) {
  const Strain<Dim> strain(G);
  const Principal<Dim> principal(strain);
  const StretchSum response = response_to(sum, principal.strains, strain.log_J, volume);
  const Vec<Dim> nominal = (response.first.array() * (-principal.strains.array()).exp()).template head<Dim>();
  Mat<Dim> P = principal.U * nominal.asDiagonal() * principal.V.transpose();
  visit_fibres<Dim>(sum, X, strain, volume.deviator,
                    [&](const auto& x, const FibreResponse& w) { P += w.first * x.gradient(); });
  return P;
}

template <int Dim>
EigenSystem<Dim> sum_eigensystem(const Mat<Dim>& F, const LawSum& sum, const Vec<3>& X, const CellVolume& volume) {
  const SingularValues<Dim> svd = singular_values(F);
  Vec<3> strains = Vec<3>::Zero();
  strains.template head<Dim>() = svd.s.array().log();
  const StretchSum response = response_to(sum, strains, strains.sum(), volume);
  const EigenSystem<Dim> isotropic = eigensystem_of<Dim>(svd, stiffness_of<Dim>(response, svd.s));
  if (!sum.terms.back().row->fibre) return isotropic;
  Mat<Dim* Dim> H = Mat<Dim * Dim>::Zero();
  const auto add_square = [&](double factor, const Mat<Dim>& A) {
    const Eigen::Map<const Vec<Dim * Dim>> a(A.data());
    H += factor * a * a.transpose();
  };
  for (std::size_t k = 0; k < isotropic.values.size(); ++k) add_square(isotropic.values[k], isotropic.modes[k]);
  const Strain<Dim> strain(Mat<Dim>(F - Mat<Dim>::Identity()));
  visit_fibres<Dim>(sum, X, strain, volume.deviator, [&](const auto& x, const FibreResponse& w) {
    add_square(w.second, x.gradient());
    H += w.first * x.hessian();
  });
  return decompose<Dim>(H);
}

double LawSum::density(const Eigen::Ref<const MatrixX>& F) const {
  const Vec<3> X = Vec<3>::Zero();
  if (F.rows() == 2) return sum_density<2>(Mat<2>(F - Mat<2>::Identity()), *this, X);
  return sum_density<3>(Mat<3>(F - Mat<3>::Identity()), *this, X);
}

void LawSum::stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const {
  const Vec<3> X = Vec<3>::Zero();
  if (F.rows() == 2)
    P = sum_stress<2>(Mat<2>(F - Mat<2>::Identity()), *this, X);
  else
    P = sum_stress<3>(Mat<3>(F - Mat<3>::Identity()), *this, X);
}

void LawSum::hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const {
  const Vec<3> X = Vec<3>::Zero();
  const auto compose = [&]<int Dim>(const EigenSystem<Dim>& system) {
    H.setZero();
    for (int k = 0; k < Dim * Dim; ++k) {
      const Eigen::Map<const Vec<Dim * Dim>> mode(system.modes[k].data());
      H += system.values[k] * mode * mode.transpose();
    }
  };
  if (F.rows() == 2)
    compose(sum_eigensystem<2>(Mat<2>(F), *this, X));
  else
    compose(sum_eigensystem<3>(Mat<3>(F), *this, X));
}

#define ITR_INSTANTIATE(Dim)                                                                                        \
  template double sum_density<Dim>(const Mat<Dim>&, const LawSum&, const Vec<3>&, const CellVolume&);               \
  template Mat<Dim> sum_stress<Dim>(const Mat<Dim>&, const LawSum&, const Vec<3>&, const CellVolume&);              \
  template EigenSystem<Dim> sum_eigensystem<Dim>(const Mat<Dim>&, const LawSum&, const Vec<3>&, const CellVolume&); \
  template double thickness<Dim>(const Mat<Dim>&, const ElasticModuli&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
