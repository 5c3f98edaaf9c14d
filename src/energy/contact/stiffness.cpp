// SPDX-License-Identifier: MIT
#include "energy/contact/stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/bvh.hpp"

namespace itr {

namespace {

constexpr double kSmallestGap = 1e-8;    ///< of the scene's diagonal: the least stiffness is for gaps like that
constexpr double kClosingGap = 1e-9;     ///< of the scene's diagonal: contacts that close below it need more stiffness
constexpr double kLeastHessian = 1e11;   ///< of the average mass: the barrier's second derivative at the smallest gap
constexpr double kLargestByLeast = 100;  ///< largest stiffness, relative to the least

ContactOptions plain_form(ContactOptions options) {
  options.convergent = false;
  return options;
}

}  // namespace

template <int Dim>
AdaptiveStiffness<Dim>::AdaptiveStiffness(const CollisionSurface& surface, const ContactOptions& options,
                                          double average_mass, double scale, const VertexMap<Dim>* map)
    : surface_(surface),
      plain_(surface, plain_form(options), 1, 1),
      actual_(surface, options, 1, 1),
      dhat_(options.dhat),
      convergent_(options.convergent),
      average_mass_(average_mass),
      scale_(scale),
      map_(map) {}

template <int Dim>
double AdaptiveStiffness<Dim>::bounding_diagonal(ConstVectorView x) const {
  Box<Dim> box;
  for (const int v : surface_.vertices) box.include(Vec<Dim>(x.segment<Dim>(Dim * v)));
  return surface_.vertices.empty() ? 0 : (box.max - box.min).norm();
}

template <int Dim>
void AdaptiveStiffness<Dim>::initialize(ConstVectorView x, const VectorX& gradient, BarrierStiffness& stiffness,
                                        Workspace& workspace) const {
  const double Dhat = dhat_ * dhat_;
  double d0 = std::pow(kSmallestGap * bounding_diagonal(x), 2);
  if (d0 >= Dhat) d0 = Dhat / 2;
  const double least = kLeastHessian * average_mass_ / (4 * d0 * plain_.barrier_second(d0));
  stiffness.largest = kLargestByLeast * least;
  VectorX barrier = VectorX::Zero(x.size());
  plain_.add_gradient(x, barrier, workspace);
  if (map_) {
    VectorX of_dofs = VectorX::Zero(gradient.size());
    map_->add_gradient(barrier, of_dofs);
    barrier = std::move(of_dofs);
  }
  const double norm_squared = barrier.squaredNorm();
  stiffness.value = norm_squared > 0 ? -barrier.dot(gradient) / norm_squared : 1;
  stiffness.value = std::clamp(stiffness.value, least, stiffness.largest);
  if (convergent_) {  // that form of the barrier differs from the plain one by this; without contacts, by its unit
    const double actual = actual_.value(x, workspace);
    const double ratio = actual > 0 ? plain_.value(x, workspace) / actual : dhat_ * dhat_ * dhat_;
    stiffness.value *= ratio;
    stiffness.largest *= ratio;
  }
  stiffness.value /= scale_;
  stiffness.largest /= scale_;
}

template <int Dim>
bool AdaptiveStiffness<Dim>::update(ConstVectorView x, BarrierStiffness& stiffness, Workspace& workspace) const {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& s : actual_.active(x, workspace)) least = std::min(least, actual_.distance(s, x).squared);
  const double previous = std::exchange(stiffness.previous_squared_distance, least);
  const double closing = std::pow(kClosingGap * bounding_diagonal(x), 2);
  if (!(previous < closing && least < closing && least < previous)) return false;
  const double value = std::min(stiffness.largest, 2 * stiffness.value);
  return std::exchange(stiffness.value, value) != value;
}

template class AdaptiveStiffness<2>;
template class AdaptiveStiffness<3>;

}  // namespace itr
