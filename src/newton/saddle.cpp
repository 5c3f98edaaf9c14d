// SPDX-License-Identifier: MIT
#include "saddle.hpp"

#include <algorithm>
#include <cmath>

#include "core/timer.hpp"
#include "curvature.hpp"

namespace itr {

namespace {

constexpr double kResolved = 1e4;  ///< times its round-off: the change of energy that the first step exceeds
constexpr int kMostDoublings = 12;

}  // namespace

Saddle::Saddle(const Task& task, Iterate& at, Direction& direction, Search& search)
    : task_(task),
      at_(at),
      direction_(direction),
      search_(search),
      candidate_(task.workspace.get<Kept>().candidate.resize(at.x().size())) {}

bool Saddle::is_here() {
  if (task_.options.indefinite == IndefiniteHessian::accept || !task_.has_unknowns()) return false;
  return asks_products() ? curvature_by_products() < 0 : direction_.is_hessian_indefinite();
}

/// Iterations may tell of negative curvature that they meet, but those from a symmetric right-hand side meet none without
/// that symmetry.
bool Saddle::asks_products() const { return task_.extras.must_be_minimum && !task_.system.sees_all_directions(); }

/// Asks once for each x.
double Saddle::curvature_by_products() {
  if (known_at_ == at_.revision()) return curvature_;
  known_at_ = at_.revision();
  const auto assemble = [this](PsdProjection psd) { direction_.assemble(psd); };
  const ScopedTimer timer(task_.summary.linear_seconds);
  const auto found = find_negative_curvature_by_products(task_.system, assemble, task_.dofs.num_unknowns, eigenvector_);
  return curvature_ = found.value_or(0);
}

/// Goes along an eigenvector of a negative eigenvalue as long as that lowers the energy.
bool Saddle::descend() {
  VectorView way = direction_.step().way;
  if (!find_way(way)) return false;
  for (int k = 0; k < kMostDoublings; ++k, way *= 2) {
    if (at_.free_share(way) < 1) return false;
    candidate_ = at_.x() + way;
    const double value = at_.value_at(candidate_);
    if (!(value < at_.value())) continue;
    at_.move_to(candidate_, value);
    search_.go_on(way);
    return true;
  }
  return false;
}

/// The shortest step whose change of energy exceeds round-off, down the slope. If the slope is round-off, the sign of the
/// eigenvector decides, which is the same for all linear solvers; the other branch may be as low.
bool Saddle::find_way(VectorView way) {
  VectorX eigenvector;
  double curvature = 0;
  if (asks_products()) {
    curvature = curvature_by_products();
    eigenvector = eigenvector_;
  } else {
    direction_.assemble(PsdProjection::none);
    const ScopedTimer timer(task_.summary.linear_seconds);
    curvature = find_negative_curvature(task_.system, task_.dofs.num_unknowns, eigenvector);
  }
  if (!(curvature < 0)) return false;
  way.setZero();
  for (Eigen::Index i = 0; i < way.size(); ++i)
    if (task_.dofs.unknown[i] != kNone) way[i] = eigenvector[task_.dofs.unknown[i]];
  const double resolved = kResolved * at_.value_round_off();
  way *= std::max(task_.options.step_tolerance, std::sqrt(2 * resolved / -curvature));
  if (way.dot(at_.gradient()) > resolved) way = -way;
  return true;
}

}  // namespace itr
