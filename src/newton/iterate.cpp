// SPDX-License-Identifier: MIT
#include "iterate.hpp"

#include <limits>

#include "core/timer.hpp"

namespace itr {

Iterate::Iterate(const Task& task, VectorView x)
    : task_(task), x_(x), gradient_(task.workspace.get<Kept>().gradient.resize(x.size())), value_(value_at(x)) {}

double Iterate::value_at(ConstVectorView x) const {
  const ScopedTimer timer(task_.summary.line_search_seconds);
  return task_.energy.value(x, task_.workspace);
}

void Iterate::gradient_at(ConstVectorView x, VectorView gradient) const {
  const ScopedTimer timer(task_.summary.assembly_seconds);
  gradient.setZero();
  task_.energy.add_gradient(x, gradient, task_.workspace);
}

double Iterate::free_share(ConstVectorView way) const {
  const ScopedTimer timer(task_.summary.ccd_seconds);
  return task_.energy.max_step(x_, way, task_.workspace);
}

void Iterate::update_gradient() {
  const ScopedTimer timer(task_.summary.assembly_seconds);
  VectorView sizes = task_.workspace.get<Kept>().sizes.resize(x_.size());
  sizes.setZero();
  gradient_.setZero();
  task_.energy.add_gradient_and_sizes(x_, gradient_, sizes, task_.workspace);
  has_gradient_ = true;
  gradient_norm_ = task_.norms.of_gradient(gradient_);
  force_size_ = task_.norms.of_forces(sizes);
  work_ = sizes.dot(x_.cwiseAbs());
}

double Iterate::value_round_off() const {
  if (value_round_off_at_ != revision_) {
    const ScopedTimer timer(task_.summary.line_search_seconds);
    value_round_off_ = task_.energy.value_round_off(x_, task_.workspace);
    if (value_round_off_at_ == kNone) first_round_off_ = value_round_off_;
    value_round_off_at_ = revision_;
  }
  return value_round_off_;
}

/// Round-off costs as much as a gradient. It is asked for where the first one, and what forces have done since, leave it
/// open.
bool Iterate::is_unresolved(const Step& step) const {
  constexpr double kSafe = 1e4;
  const double decrement = decrement_of(step);
  const bool is_open = value_round_off_at_ == kNone ||
                       decrement < kSafe * (first_round_off_ + std::numeric_limits<double>::epsilon() * work_);
  return is_open && decrement < value_round_off();
}

double Iterate::gradient_round_off() const {
  if (gradient_round_off_at_ != revision_) {
    const ScopedTimer timer(task_.summary.assembly_seconds);
    VectorView round_off = task_.workspace.get<Kept>().round_off.resize(x_.size());
    round_off.setZero();
    task_.energy.add_gradient_round_off(x_, round_off, task_.workspace);
    gradient_round_off_ = task_.norms.of_gradient(round_off);
    gradient_round_off_at_ = revision_;
  }
  return gradient_round_off_;
}

void Iterate::move_to(ConstVectorView x, double value) {
  x_ = x;
  value_ = value;
  ++revision_;
}

}  // namespace itr
