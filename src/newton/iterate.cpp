// SPDX-License-Identifier: MIT
#include "iterate.hpp"

#include <cmath>
#include <limits>

#include "core/timer.hpp"

namespace itr {

namespace {

constexpr double kSpacing = 8 * std::numeric_limits<double>::epsilon();  ///< of the largest coordinate

}  // namespace

Iterate::Iterate(const Task& task, VectorView x)
    : task_(task),
      x_(x),
      gradient_(task.workspace.get<Kept>().gradient.resize(x.size())),
      value_(value_at(x)),
      first_value_(value_) {}

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
  gradient_at(x_, gradient_);
  has_gradient_ = true;
  gradient_norm_ = task_.norms.of_gradient(gradient_);
}

void Iterate::move_to(ConstVectorView x, double value) {
  x_ = x;
  value_ = value;
  ++revision_;
}

bool Iterate::is_unresolved(const Step& step) const {
  if (decrement_of(step) < kUnresolved * std::abs(value_)) return true;
  // Far from the origin the last bits are long distances.
  return step.way.lpNorm<Eigen::Infinity>() <= kSpacing * x_.lpNorm<Eigen::Infinity>();
}

}  // namespace itr
