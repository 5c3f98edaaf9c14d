// SPDX-License-Identifier: MIT
// Planes and grounds have no end: the mesh of one is doubled about its middle before bodies come near its border.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fem/chords.hpp"
#include "simulation/state.hpp"

namespace itr {

inline int doublings_of(const std::vector<int>& doublings, std::size_t flat) {
  return doublings.empty() ? 0 : doublings[flat];
}

template <int Dim>
class FlatObstacles {
 public:
  static constexpr int kMostDoublings = 40;

  /// Keeps the flats of obstacles as they are at the start, never doubled.
  explicit FlatObstacles(const Obstacles<Dim>& obstacles) : flats_(obstacles.flats), rest_(obstacles.rest) {}

  bool empty() const { return flats_.empty(); }
  /// Sets the rest positions in `obstacles` to those of flats that were doubled so often (State::doublings).
  void stretch(const std::vector<int>& doublings, Obstacles<Dim>& obstacles) const {
    for (std::size_t f = 0; f < flats_.size(); ++f) {
      const int times = doublings_of(doublings, f);
      Vec<Dim> middle = Vec<Dim>::Zero();
      for (int k = 0; k < kVertices; ++k) middle += rest_[flats_[f] + k] / kVertices;
      for (int v = flats_[f]; v < flats_[f] + kVertices; ++v)
        obstacles.rest[v] = times == 0 ? rest_[v] : Vec<Dim>(middle + std::ldexp(1.0, times) * (rest_[v] - middle));
    }
  }
  /// How often flats have to be doubled until they reach `times` as far as the bodies are from their middles at each of
  /// these positions of all nodes. Empty: flats of the state do already.
  std::vector<int> find_doublings(const State<Dim>& state, const std::vector<VectorX>& positions, double times) const {
    const Eigen::Index obstacles = Dim * static_cast<Eigen::Index>(rest_.size());
    const Eigen::Index bodies = state.history.x[0].size() - obstacles;
    std::vector<int> doublings = state.doublings;
    doublings.resize(flats_.size(), 0);
    bool is_enough = true;
    for (std::size_t f = 0; f < flats_.size(); ++f) {
      std::array<Vec<Dim>, kVertices> corners;
      Vec<Dim> middle = Vec<Dim>::Zero();
      for (int k = 0; k < kVertices; ++k) {
        corners[k] = state.history.x[0].template segment<Dim>(bodies + Dim * (flats_[f] + k));
        middle += corners[k] / kVertices;
      }
      const Vec<Dim> normal = unit_normal(corners);
      double farthest = 0;
      for (const VectorX& x : positions)
        for (Eigen::Index i = 0; i < x.size() - obstacles; i += Dim) {
          const Vec<Dim> arm = x.template segment<Dim>(i) - middle;
          farthest = std::max(farthest, (arm - arm.dot(normal) * normal).norm());
        }
      // An edge's ends are its corners, a triangle's sides are half as far as these.
      double reach = std::ldexp((corners[0] - middle).norm() / (Dim - 1), doublings[f] - doublings_of(state.doublings, f));
      while (reach < times * farthest && doublings[f] < kMostDoublings) {
        reach *= 2;
        ++doublings[f];
        is_enough = false;
      }
    }
    return is_enough ? std::vector<int>() : doublings;
  }
  /// The state with flats doubled so often, which `obstacles` have been already. Their velocities and past positions are
  /// those of the same rigid motion.
  State<Dim> doubled(const State<Dim>& state, const std::vector<int>& doublings, const Obstacles<Dim>& obstacles) const {
    State<Dim> result = state;
    const Eigen::Index bodies = state.history.x[0].size() - Dim * static_cast<Eigen::Index>(rest_.size());
    const auto stretch = [&](std::size_t f, VectorX& field, bool are_positions) {
      const double factor = std::ldexp(1.0, doublings[f] - doublings_of(state.doublings, f));
      auto of_flat = field.segment(bodies + Dim * flats_[f], Dim * kVertices).reshaped(Dim, kVertices);
      const Vec<Dim> middle = of_flat.rowwise().mean();
      for (int k = 0; k < kVertices; ++k) {
        const int v = flats_[f] + k;
        if (are_positions && obstacles.motion[v] == kNone)
          of_flat.col(k) = obstacles.rest[v];
        else
          of_flat.col(k) = middle + factor * (of_flat.col(k) - middle);
      }
    };
    for (std::size_t f = 0; f < flats_.size(); ++f) {
      if (doublings[f] == doublings_of(state.doublings, f)) continue;
      for (VectorX& x : result.history.x) stretch(f, x, true);
      for (VectorX& v : result.history.v) stretch(f, v, false);
      for (VectorX& a : result.history.a) stretch(f, a, false);
    }
    result.doublings = doublings;
    return result;
  }

 private:
  static constexpr int kVertices = Dim;  ///< an edge or a triangle

  std::vector<int> flats_;  ///< first vertex of each
  std::vector<Vec<Dim>> rest_;
};

}  // namespace itr
