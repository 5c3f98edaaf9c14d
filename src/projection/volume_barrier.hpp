// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "energy/energy.hpp"
#include "fem/cell_set.hpp"

namespace itr {

/// dJ/dx at the element's vertices, stacked: cofactor of F times the shape gradients.
template <int Dim>
Vec<Dim*(Dim + 1)> volume_gradient(const Mat<Dim>& F, double J, const Mat<Dim>& inverse_edges) {
  const Mat<Dim> columns = J * F.inverse().transpose() * inverse_edges.transpose();
  Vec<Dim*(Dim + 1)> gradient;
  gradient.template head<Dim>() = -columns.rowwise().sum();
  for (int k = 0; k < Dim; ++k) gradient.template segment<Dim>(Dim * (k + 1)) = columns.col(k);
  return gradient;
}

/// scale * sum over elements of rest volume * b(J), b(J) = -(J - Jhat)^2 ln(J / Jhat) / Jhat^2 of the volume ratio J below
/// Jhat: keeps a projection free of inversion (paper eq. 10, with a threshold relative to each element).
template <int Dim>
class VolumeBarrier final : public Energy {
 public:
  /// `cells` must outlive this.
  VolumeBarrier(const CellSet<Dim>& cells, double activation_ratio, double scale)
      : cells_(cells), activation_(activation_ratio), scale_(scale) {}
  std::string_view name() const override { return "volume barrier"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = 0;
    for (const auto& element : cells_.straight()) {
      const double r = deformation_gradient<Dim>(element, x).determinant() / activation_;
      if (!(r > 0)) return std::numeric_limits<double>::infinity();
      if (r < 1) sum -= element.volume * (r - 1) * (r - 1) * std::log(r);
    }
    return scale_ * sum;
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    for (const auto& element : cells_.straight()) {
      const Mat<Dim> F = deformation_gradient<Dim>(element, x);
      const double J = F.determinant(), r = J / activation_;
      if (r >= 1) continue;
      const double slope = (1 - r) * (2 * std::log(r) - 1 / r + 1) / activation_;
      const auto local = volume_gradient<Dim>(F, J, element.inverse_edges);
      for (int k = 0; k <= Dim; ++k)
        gradient.segment<Dim>(Dim * element.vertices[k]) +=
            scale_ * element.volume * slope * local.template segment<Dim>(Dim * k);
    }
  }
  /// The part of the Hessian along dJ/dx; the part with the curvature of J itself is left out: it is not positive.
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (const auto& element : cells_.straight()) {
      const Mat<Dim> F = deformation_gradient<Dim>(element, x);
      const double J = F.determinant(), r = J / activation_;
      if (r >= 1) continue;
      const double curvature = ((1 / r + 2) / r - 2 * std::log(r) - 3) / (activation_ * activation_);
      const auto local = volume_gradient<Dim>(F, J, element.inverse_edges);
      const Mat<Dim*(Dim + 1)> block = scale_ * element.volume * curvature * local * local.transpose();
      sink.add<Dim>(element.vertices, block.data());
    }
  }

 private:
  const CellSet<Dim>& cells_;
  double activation_;
  double scale_;
};

}  // namespace itr
