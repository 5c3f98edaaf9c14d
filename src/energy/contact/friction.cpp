// SPDX-License-Identifier: MIT
// f0(y) = y^2 (1 - y / (3 eps)) / eps + eps / 3 below eps, y above: the potential whose derivative f1 rises smoothly from 0
// to 1 over the slip speeds below eps (IPC, Li et al. 2020, eq. 15).
#include "energy/contact/friction.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace itr {

namespace {

double f0(double y, double eps) { return y < eps ? y * y * (1 - y / (3 * eps)) / eps + eps / 3 : y; }
double f1_over_y(double y, double eps) { return y < eps ? (2 - y / eps) / eps : 1 / y; }
double f2(double y, double eps) { return y < eps ? 2 * (1 - y / eps) / eps : 0; }

// Adhesion has these, which let go: the polynomials go on to 2 eps, where f1 is 0 again.
double fading_f0(double y, double eps) { return y < 2 * eps ? y * y * (1 - y / (3 * eps)) / eps : 4 * eps / 3; }
double fading_f1_over_y(double y, double eps) { return y < 2 * eps ? (2 - y / eps) / eps : 0; }
double fading_f2(double y, double eps) { return y < 2 * eps ? 2 * (1 - y / eps) / eps : 0; }

/// Derivative by the slip velocity v of w(v), where y / f1(y) w = v for y = |v|, linearised at any w (Chan, Golub & Mulet
/// 1999); of f1(y) v / y where w is that. Symmetrised; its eigenvalues are >= 0 for |w| <= 1.
template <int N>
Mat<N> linearised_ratio(const Vec<N>& v, const Vec<N>& w, double eps) {
  const double y = v.norm(), isotropic = f1_over_y(y, eps);
  Mat<N> inner = Mat<N>::Identity();
  if (y > 0) {
    const double slope = y < eps ? 1 / (eps * eps * isotropic * isotropic) : 1;  // of y / f1(y)
    const Mat<N> turn = slope / (2 * y) * w * v.transpose();
    inner -= turn + turn.transpose();
  }
  return isotropic * inner;
}

Eigen::Matrix<double, 2, 1> tangent_basis(const Vec<2>& normal) { return {-normal[1], normal[0]}; }
Eigen::Matrix<double, 3, 2> tangent_basis(const Vec<3>& normal) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = normal.unitOrthogonal();
  basis.col(1) = normal.cross(basis.col(0));
  return basis;
}

}  // namespace

template <int Dim>
FrictionEnergy<Dim>::FrictionEnergy(const ContactEnergy<Dim>& contact, ConstVectorView x, Workspace& workspace,
                                    const ContactOptions& options, const VelocityRule& velocity, double scale) {
  renew(contact, x, workspace, options, velocity.rate, velocity.reference, scale);
}

template <int Dim>
void FrictionEnergy<Dim>::renew(const ContactEnergy<Dim>& contact, ConstVectorView x, Workspace& workspace,
                                const ContactOptions& options, double velocity_rate, ConstVectorView velocity_reference,
                                double scale) {
  rate_ = velocity_rate;
  reference_ = velocity_reference;
  epsv_ = contact.law() == ContactLaw::adhesion ? options.adhesion.velocity : options.friction_velocity;
  scale_ = scale;
  is_primal_dual_ = false;
  lets_go_ = contact.law() == ContactLaw::adhesion;
  pairs_.clear();
  for (const auto& s : contact.active(x, workspace)) {
    if (s.is_mollified()) continue;
    const PairDistance<Dim> q = contact.distance(s, x);
    const double distance = std::sqrt(q.squared);
    Pair pair{.vertices = s.vertices,
              .size = s.size(),
              .coefficients = q.coefficients,
              .tangents = tangent_basis(Vec<Dim>(q.separation / distance)),
              .force = 0};
    pair.force = lets_go_ ? options.adhesion.tangential_coefficient * s.weight * options.adhesion.lagged_pull()
                          : options.friction_coefficient * s.weight * contact.stiffness() *
                                -contact.barrier_first(q.squared) * 2 * distance;
    pairs_.push_back(pair);
  }
}

template <int Dim>
auto FrictionEnergy<Dim>::slip_velocity(const Pair& pair, ConstVectorView x) const -> Vec<kTangents> {
  Vec<Dim> relative = Vec<Dim>::Zero();
  const ConstVectorView reference = reference_.view();
  for (int k = 0; k < pair.size; ++k) {
    const int dof = Dim * pair.vertices[k];
    relative += pair.coefficients[k] * (x.segment<Dim>(dof) - reference.segment<Dim>(dof));
  }
  return rate_ * (pair.tangents.transpose() * relative);
}

template <int Dim>
void FrictionEnergy<Dim>::begin_solve(ConstVectorView x, bool is_near) {
  is_primal_dual_ = true;
  for (Pair& pair : pairs_) {
    pair.slip = slip_velocity(pair, x);
    pair.ratio.setZero();
    if (is_near) pair.ratio = f1_over_y(pair.slip.norm(), epsv_) * pair.slip;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::follow(ConstVectorView x, double fraction) {
  for (Pair& pair : pairs_) {
    const Vec<kTangents> slip = slip_velocity(pair, x);
    const Mat<kTangents> derivative = linearised_ratio<kTangents>(pair.slip, pair.ratio, epsv_);
    const Vec<kTangents> at_slip = f1_over_y(pair.slip.norm(), epsv_) * pair.slip;
    pair.ratio += fraction * (at_slip - pair.ratio) + derivative * (slip - pair.slip);
    pair.ratio /= std::max(1.0, pair.ratio.norm());
    pair.slip = slip;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::relax(const FrictionEnergy& before, double factor) {
  const auto is_before = [](const Pair& a, const Pair& b) { return a.vertices < b.vertices; };
  std::vector<Pair> old = before.pairs_, relaxed;
  std::stable_sort(old.begin(), old.end(), is_before);
  std::stable_sort(pairs_.begin(), pairs_.end(), is_before);
  const double rest = std::max(0.0, 1 - factor);  // of pairs that are no more
  const auto keep = [&](const Pair& gone) {
    relaxed.push_back(gone);
    relaxed.back().force *= rest;
  };
  auto next = old.begin();
  for (Pair pair : pairs_) {
    for (; next != old.end() && is_before(*next, pair); ++next)
      if (rest > 0) keep(*next);
    if (next != old.end() && !is_before(pair, *next)) {
      pair.force = std::max(0.0, next->force + factor * (pair.force - next->force));
      ++next;
    } else {
      pair.force *= std::min(1.0, factor);
    }
    relaxed.push_back(pair);
  }
  for (; next != old.end() && rest > 0; ++next) keep(*next);
  pairs_ = std::move(relaxed);
}

template <int Dim>
double FrictionEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = 0;
  for (const auto& pair : pairs_) sum += pair.force * (lets_go_ ? fading_f0 : f0)(slip_velocity(pair, x).norm(), epsv_);
  return scale_ / rate_ * sum;
}

template <int Dim>
void FrictionEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  for (const auto& pair : pairs_) {
    const Vec<kTangents> v = slip_velocity(pair, x);
    const Vec<Dim> force =
        scale_ * pair.force * (lets_go_ ? fading_f1_over_y : f1_over_y)(v.norm(), epsv_) * (pair.tangents * v);
    for (int k = 0; k < pair.size; ++k) gradient.segment<Dim>(Dim * pair.vertices[k]) += pair.coefficients[k] * force;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 4 * Dim, 4 * Dim> block;
  for (const auto& pair : pairs_) {
    const Vec<kTangents> v = slip_velocity(pair, x);
    const double y = v.norm(), isotropic = (lets_go_ ? fading_f1_over_y : f1_over_y)(y, epsv_);
    // Along v the second derivative is f2, across it f1 / y. Friction's are >= 0, so only the sign of the force can spoil
    // it.
    double along = lets_go_ ? fading_f2(y, epsv_) : f2(y, epsv_);
    if (psd != PsdProjection::none) along = std::max(along, 0.0);
    Mat<kTangents> inner = isotropic * Mat<kTangents>::Identity();
    if (is_primal_dual_)
      inner = linearised_ratio<kTangents>(v, pair.ratio, epsv_);
    else if (y > 0)
      inner += (along - isotropic) / (y * y) * v * v.transpose();
    const double force = projected(pair.force, psd);
    if (force == 0) continue;
    const Mat<Dim> world = scale_ * rate_ * force * pair.tangents * inner * pair.tangents.transpose();
    const int dofs = Dim * pair.size;
    block.resize(dofs, dofs);
    for (int i = 0; i < pair.size; ++i)
      for (int j = 0; j < pair.size; ++j)
        block.template block<Dim, Dim>(Dim * i, Dim * j) = pair.coefficients[i] * pair.coefficients[j] * world;
    sink.add<Dim>(std::span(pair.vertices.data(), pair.size), block.data());
  }
}

template class FrictionEnergy<2>;
template class FrictionEnergy<3>;

}  // namespace itr
