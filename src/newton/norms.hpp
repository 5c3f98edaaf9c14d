// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "newton/newton.hpp"

namespace itr {

/// Norms over the unknowns. What they refer to must outlive them.
class Norms {
 public:
  /// `weights` are D of `kind` by dof; empty for the Euclidean one.
  Norms(const DofMap& dofs, NewtonNorm kind, std::span<const double> weights)
      : dofs_(dofs), kind_(kind), weights_(weights) {}

  double of_gradient(ConstVectorView gradient) const {
    return norm(gradient, [&](double g, Eigen::Index i) {
      if (kind_ == NewtonNorm::euclidean) return g;
      return kind_ == NewtonNorm::l2 ? g / std::sqrt(weights_[i]) : g / weights_[i];
    });
  }
  /// Norm over all dofs, held ones included.
  double of_forces(ConstVectorView forces) const {
    double sum = 0, largest = 0;
    for (Eigen::Index i = 0; i < forces.size(); ++i) {
      double entry = forces[i];
      if (kind_ == NewtonNorm::l2) entry /= std::sqrt(weights_[i]);
      if (kind_ == NewtonNorm::linf) entry /= weights_[i];
      sum += entry * entry;
      largest = std::max(largest, entry);
    }
    return kind_ == NewtonNorm::linf ? largest : std::sqrt(sum);
  }
  double of_step(ConstVectorView step) const {
    return norm(step, [&](double p, Eigen::Index i) { return kind_ == NewtonNorm::l2 ? p * std::sqrt(weights_[i]) : p; });
  }
  /// Dot product of two fields over the unknowns, whatever the norm.
  double dot(ConstVectorView a, ConstVectorView b) const {
    double sum = 0;
    for (Eigen::Index i = 0; i < a.size(); ++i)
      if (dofs_.unknown[i] != kNone) sum += a[i] * b[i];
    return sum;
  }

 private:
  template <typename Weighted>
  double norm(ConstVectorView field, const Weighted& weighted) const {
    double sum = 0, largest = 0;
    for (Eigen::Index i = 0; i < field.size(); ++i) {
      if (dofs_.unknown[i] == kNone) continue;
      const double entry = weighted(field[i], i);
      sum += entry * entry;
      largest = std::max(largest, std::abs(entry));
    }
    return kind_ == NewtonNorm::linf ? largest : std::sqrt(sum);
  }

  const DofMap& dofs_;
  NewtonNorm kind_;
  std::span<const double> weights_;
};

}  // namespace itr
