// SPDX-License-Identifier: MIT
#include "simulation/step_length.hpp"

#include <algorithm>

#include "simulation/step_problem.hpp"

namespace itr {

template <int Dim>
double prescribed_speed(const Setup<Dim>& setup, const Vec<Dim>& center, int steps) {
  const TimeOptions& time = setup.time;
  double speed = 0;
  for (const auto& condition : setup.initial_velocity) speed = std::max(speed, condition.value(center, time.t0).norm());
  constexpr int kSamples = 20;
  VectorX before = held_dofs(setup, setup.mesh, time.t0).target;
  for (int i = 1; i <= kSamples; ++i) {
    const VectorX after = held_dofs(setup, setup.mesh, time.t0 + time.dt * steps * i / kSamples).target;
    const VectorX path = after - before;
    for (Eigen::Index k = 0; k + Dim <= path.size(); k += Dim)
      speed = std::max(speed, path.template segment<Dim>(k).norm() * kSamples / (time.dt * steps));
    before = after;
  }
  return speed;
}

template double prescribed_speed(const Setup<2>&, const Vec<2>&, int);
template double prescribed_speed(const Setup<3>&, const Vec<3>&, int);

}  // namespace itr
