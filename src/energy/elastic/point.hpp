// SPDX-License-Identifier: MIT
// A law at one deformation gradient F: its energy density and derivatives by the positions of a cell's vertices. Sums over
// cells (ElasticEnergy) and predictions of gains (remesh) are made of it.
#pragma once

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "energy/elastic/laws.hpp"
#include "fem/cell_set.hpp"
#include "strain.hpp"

namespace itr {

/// Neo-Hookean elasticity (itr/energy/elastic/neo_hookean.hpp) at a displacement gradient.
template <int Dim>
class NeoHookeanPoint {
 public:
  NeoHookeanPoint(const DisplacementGradient<Dim>& at, const LameParameters& lame) : strain_(at.G), lame_(lame) {}

  double density() const {
    if (!(strain_.J() > 0)) return std::numeric_limits<double>::infinity();
    return lame_.mu / 2 * strain_.trace_minus_log() + lame_.lambda / 2 * strain_.log_J * strain_.log_J +
           lame_.pressure * strain_.J_minus_1;
  }
  Mat<Dim> inverse() const { return strain_.F.inverse(); }
  /// F^-T (mu (C - I) + lambda ln J + p J), in which nothing cancels.
  Mat<Dim> stress(const Mat<Dim>& inverse) const {
    Mat<Dim> inner = lame_.mu * strain_.A;
    inner.diagonal().array() += lame_.lambda * strain_.log_J + lame_.pressure * strain_.J();
    return inverse.transpose() * inner;
  }

  /// Second derivatives times a weight, by vertices whose shape functions have the gradients g_i and g_j.
  struct Stiffness {
    double c, lambda, mu;  ///< times the weight; c = mu - lambda ln J - p J, and p J is part of lambda

    /// The part of components a of i and b of j that depends on F: h = F^-T g.
    template <typename Column>
    double operator()(const Column& h_i, const Column& h_j, int a, int b) const {
      return c * h_j[a] * h_i[b] + lambda * h_i[a] * h_j[b];
    }
    /// Term that is added where a = b.
    template <typename Column>
    double diagonal(const Column& g_i, const Column& g_j) const {
      return mu * g_i.dot(g_j);
    }
  };
  Stiffness stiffness(double weight) const {
    const double pJ = lame_.pressure * strain_.J();
    return {weight * (lame_.mu - lame_.lambda * strain_.log_J - pJ), weight * (lame_.lambda + pJ), weight * lame_.mu};
  }

 private:
  Strain<Dim> strain_;
  LameParameters lame_;
};

/// Any law at F, and its derivatives by the position of one vertex.
template <int Dim>
class ElasticPoint {
 public:
  ElasticPoint(const Mat<Dim>& F, const ElasticModuli& moduli) : ElasticPoint(DisplacementGradient<Dim>::of(F), moduli) {}
  ElasticPoint(const DisplacementGradient<Dim>& at, const ElasticModuli& moduli) : is_neo_hookean_(moduli.is_neo_hookean()) {
    if (is_neo_hookean_) {  // with one inverse and one logarithm
      const NeoHookeanPoint<Dim> point(at, moduli.lame);
      inverse_ = point.inverse();
      density_ = point.density();
      stress_ = point.stress(inverse_);
      stiffness_ = point.stiffness(1);
    } else {
      density_ = elastic_density<Dim>(at, moduli);
      stress_ = elastic_stress<Dim>(at, moduli);
      system_ = elastic_eigensystem<Dim>(at.F(), moduli);
    }
  }
  double density() const { return density_; }
  /// On a vertex whose shape function has this gradient, by volume.
  Vec<Dim> gradient(const Vec<Dim>& shape) const { return stress_ * shape; }
  /// Between two vertices.
  Mat<Dim> hessian(const Vec<Dim>& of_row, const Vec<Dim>& of_column) const {
    Mat<Dim> sum = Mat<Dim>::Zero();
    if (is_neo_hookean_) {
      const Vec<Dim> h_row = inverse_.transpose() * of_row, h_column = inverse_.transpose() * of_column;
      for (int b = 0; b < Dim; ++b)
        for (int a = 0; a < Dim; ++a) sum(a, b) = stiffness_(h_row, h_column, a, b);
      sum.diagonal().array() += stiffness_.diagonal(of_row, of_column);
      return sum;
    }
    for (std::size_t k = 0; k < system_.values.size(); ++k)
      sum += system_.values[k] * (system_.modes[k] * of_row) * (system_.modes[k] * of_column).transpose();
    return sum;
  }
  Mat<Dim> hessian(const Vec<Dim>& shape) const {
    Mat<Dim> sum = Mat<Dim>::Zero();
    if (is_neo_hookean_) {
      const Vec<Dim> h = inverse_.transpose() * shape;
      for (int b = 0; b < Dim; ++b)
        for (int a = 0; a < Dim; ++a) sum(a, b) = stiffness_(h, h, a, b);
      sum.diagonal().array() += stiffness_.diagonal(shape, shape);
      return sum;
    }
    for (std::size_t k = 0; k < system_.values.size(); ++k) {
      const Vec<Dim> w = system_.modes[k] * shape;
      sum += system_.values[k] * w * w.transpose();
    }
    return sum;
  }

 private:
  bool is_neo_hookean_;
  double density_;
  Mat<Dim> stress_, inverse_;
  typename NeoHookeanPoint<Dim>::Stiffness stiffness_{};
  EigenSystem<Dim> system_;  ///< of other laws
};

}  // namespace itr
