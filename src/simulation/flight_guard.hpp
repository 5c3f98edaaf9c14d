// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <string>

#include "energy/least_motion.hpp"
#include "fem/hessian_sink.hpp"
#include "itr/core.hpp"

namespace itr {

/// Ends solves without inertia in which loads carry bodies farther than anything of the scene could meet them.
template <int Dim>
class FlightGuard {
 public:
  /// `start`: positions where the step begins, of obstacles too; `target`: those to which held dofs move; `loose`: parts
  /// that conditions do not hold. All of them must outlive this.
  FlightGuard(ConstVectorView start, const DofMap& dofs, ConstVectorView target, std::span<const LoosePart<Dim>> loose);
  /// Whether a loose part, or any node, has gone too far by the displacements d.
  bool has_flown(ConstVectorView d);
  /// The reason, once that is so.
  std::string describe(const Units& units) const;

 private:
  ConstVectorView start_;
  std::span<const LoosePart<Dim>> loose_;
  double extent_;                          ///< of bodies, obstacles and targets [m]
  const LoosePart<Dim>* flown_ = nullptr;  ///< null: a body that conditions hold
};

}  // namespace itr
