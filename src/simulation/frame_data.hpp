// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "simulation/state.hpp"

namespace itr {

/// Arrays behind a FrameView.
template <int Dim>
struct FrameData {
  VectorX x, v;
  std::vector<double> elastic_density;
  std::vector<Vec<Dim>> obstacle_x, proxy_x;
  AskedFields asked;
};

/// Computes what output sees of a state; `forces` and `errors` are those of the step that led to it.
template <int Dim>
FrameData<Dim> frame_data(const Setup<Dim>& setup, const State<Dim>& state, const NodalForces& forces,
                          const ErrorFields& errors);

}  // namespace itr
