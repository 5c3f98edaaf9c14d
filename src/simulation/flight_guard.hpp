// SPDX-License-Identifier: MIT
#pragma once

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <span>
#include <string>

#include "energy/least_motion.hpp"
#include "fem/hessian_sink.hpp"
#include "itr/core.hpp"
#include "simulation/named.hpp"

namespace itr {

/// Diagonal of the box of the positions that a solve begins with, and of those that held dofs move to [m].
template <int Dim>
double extent_of(ConstVectorView start, const DofMap& dofs, ConstVectorView target) {
  Eigen::AlignedBox<double, Dim> box;
  for (Eigen::Index i = 0; i < start.size(); i += Dim) {
    const Vec<Dim> here = start.segment<Dim>(i);
    box.extend(here);
    for (int c = 0; c < Dim; ++c) {
      if (dofs.unknown[i + c] != kNone) continue;
      Vec<Dim> there = here;
      there[c] = target[i + c];
      box.extend(there);
    }
  }
  return box.diagonal().norm();
}

/// Ends solves without inertia in which loads carry bodies farther than anything of the scene could meet them.
template <int Dim>
class FlightGuard {
 public:
  /// `start`: positions where the step begins, of obstacles too; `target`: those to which held dofs move; `loose`: parts
  /// that conditions do not hold. All of them must outlive this.
  FlightGuard(ConstVectorView start, const DofMap& dofs, ConstVectorView target, std::span<const LoosePart<Dim>> loose)
      : start_(start), loose_(loose), extent_(extent_of<Dim>(start, dofs, target)) {}
  /// Whether a loose part, or any node, has gone too far by the displacements d.
  bool has_flown(ConstVectorView d) {
    for (const LoosePart<Dim>& part : loose_) {
      if (!(d.segment<Dim>(Dim * part.nodes.front()).norm() > kFar * extent_)) continue;
      flown_ = &part;
      return true;
    }
    return d.lpNorm<Eigen::Infinity>() > kFarthest * extent_;
  }
  /// The reason, once that is so.
  std::string describe(const Units& units) const {
    if (!flown_)
      return fmt::format(
          "loads move bodies that their conditions hold by {:g} times the extent of the scene: they exceed what the bodies "
          "can carry, and there is no equilibrium near; smaller loads or steps, or dynamics (/time/quasistatic = false)",
          kFarthest);
    return fmt::format(
        "loads push a body that its conditions do not hold, the one at {}, and nothing comes in its way: there is no "
        "equilibrium; hold it (a point, or rollers on a side), or take dynamics (/time/quasistatic = false)",
        point_text<Dim>(start_.template segment<Dim>(Dim * flown_->nodes.front()), units, 3));
  }

 private:
  static constexpr double kFar = 10, kFarthest = 100;  ///< times the extent: of loose parts, of any node

  ConstVectorView start_;
  std::span<const LoosePart<Dim>> loose_;
  double extent_;                          ///< of bodies, obstacles and targets [m]
  const LoosePart<Dim>* flown_ = nullptr;  ///< null: a body that conditions hold
};

}  // namespace itr
