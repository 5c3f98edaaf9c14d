// SPDX-License-Identifier: MIT
#include "flight_guard.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "simulation/named.hpp"

namespace itr {

namespace {

constexpr double kFar = 10, kFarthest = 100;  ///< times the extent: of loose parts, of any node

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

}  // namespace

template <int Dim>
FlightGuard<Dim>::FlightGuard(ConstVectorView start, const DofMap& dofs, ConstVectorView target,
                              std::span<const LoosePart<Dim>> loose)
    : start_(start), loose_(loose), extent_(extent_of<Dim>(start, dofs, target)) {}

template <int Dim>
bool FlightGuard<Dim>::has_flown(ConstVectorView d) {
  for (const LoosePart<Dim>& part : loose_) {
    if (!(d.segment<Dim>(Dim * part.nodes.front()).norm() > kFar * extent_)) continue;
    flown_ = &part;
    return true;
  }
  return d.lpNorm<Eigen::Infinity>() > kFarthest * extent_;
}

template <int Dim>
std::string FlightGuard<Dim>::describe(const Units& units) const {
  if (!flown_)
    return fmt::format(
        "loads move bodies that their conditions hold by {:g} times the extent of the scene: they exceed what the bodies "
        "can "
        "carry, and there is no equilibrium near; smaller loads or steps, or dynamics (/time/quasistatic = false)",
        kFarthest);
  return fmt::format(
      "loads push a body that its conditions do not hold, the one at {}, and nothing comes in its way: there is no "
      "equilibrium; hold it (a point, or rollers on a side), or take dynamics (/time/quasistatic = false)",
      point_text<Dim>(start_.segment<Dim>(Dim * flown_->nodes.front()), units, 3));
}

template class FlightGuard<2>;
template class FlightGuard<3>;

}  // namespace itr
