// SPDX-License-Identifier: MIT
#pragma once

#include "energy/energy.hpp"
#include "fem/cell_set.hpp"

namespace itr {

/// scale * sum over elements of rest volume * b(J), b(J) = -(J - Jhat)^2 ln(J / Jhat) / Jhat^2 of the volume ratio J below
/// Jhat: keeps a projection free of inversion (paper eq. 10, with a threshold relative to each element).
template <int Dim>
class VolumeBarrier final : public Energy {
 public:
  /// `cells` must outlive this.
  VolumeBarrier(const CellSet<Dim>& cells, double activation_ratio, double scale)
      : cells_(cells), activation_(activation_ratio), scale_(scale) {}
  std::string_view name() const override { return "volume barrier"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;

 private:
  const CellSet<Dim>& cells_;
  double activation_;
  double scale_;
};

}  // namespace itr
