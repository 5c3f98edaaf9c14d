// SPDX-License-Identifier: MIT
// Planes and grounds have no end: the mesh of one is doubled about its middle before bodies come near its border.
#pragma once

#include <vector>

#include "simulation/state.hpp"

namespace itr {

template <int Dim>
class FlatObstacles {
 public:
  static constexpr int kMostDoublings = 40;

  /// Keeps the flats of obstacles as they are at the start, never doubled.
  explicit FlatObstacles(const Obstacles<Dim>& obstacles) : flats_(obstacles.flats), rest_(obstacles.rest) {}

  bool empty() const { return flats_.empty(); }
  /// Sets the rest positions in `obstacles` to those of flats that were doubled so often (State::doublings).
  void stretch(const std::vector<int>& doublings, Obstacles<Dim>& obstacles) const;
  /// How often flats have to be doubled until they reach `times` as far as the bodies are from their middles at each of
  /// these positions of all nodes. Empty: flats of the state do already.
  std::vector<int> find_doublings(const State<Dim>& state, const std::vector<VectorX>& positions, double times) const;
  /// The state with flats doubled so often, which `obstacles` have been already. Their velocities and past positions are
  /// those of the same rigid motion.
  State<Dim> doubled(const State<Dim>& state, const std::vector<int>& doublings, const Obstacles<Dim>& obstacles) const;

 private:
  static constexpr int kVertices = Dim;  ///< an edge or a triangle

  std::vector<int> flats_;  ///< first vertex of each
  std::vector<Vec<Dim>> rest_;
};

}  // namespace itr
