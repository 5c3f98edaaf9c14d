// SPDX-License-Identifier: MIT
#include "held_turn.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <map>
#include <span>
#include <vector>

#include "core/connected_parts.hpp"
#include "geometry/rotation.hpp"

namespace itr {

namespace {

constexpr double kLarge = 120;   ///< [degrees]
constexpr double kFlat = 1e-12;  ///< of squares: vertices on a line
constexpr double kRigid = 1e-3;  ///< of the set's size: what a rotation and a translation may miss

template <int Dim>
bool is_held(const DofMap& dofs, int node) {
  for (int c = 0; c < Dim; ++c)
    if (dofs.unknown[Dim * node + c] != kNone) return false;
  return true;
}

/// Edges of cells whose both ends are held.
template <int Dim>
std::vector<std::array<int, 2>> held_edges(const CellSet<Dim>& cells, const DofMap& dofs) {
  std::vector<std::array<int, 2>> edges;
  for (const auto& element : cells.elements)
    for_each_edge<Dim>([&](int, int i, int j) {
      const int a = element.vertices[i], b = element.vertices[j];
      if (is_held<Dim>(dofs, a) && is_held<Dim>(dofs, b)) edges.push_back({a, b});
    });
  return edges;
}

/// Angle of the rigid motion of vertices [degrees], or 0 where they have none.
template <int Dim>
double angle_of(const std::vector<int>& vertices, ConstVectorView from, ConstVectorView to) {
  using Points = Eigen::Matrix<double, Dim, Eigen::Dynamic>;
  const auto n = static_cast<Eigen::Index>(vertices.size());
  Points a(Dim, n), b(Dim, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    a.col(i) = from.segment<Dim>(Dim * vertices[i]);
    b.col(i) = to.segment<Dim>(Dim * vertices[i]);
  }
  if constexpr (Dim == 3) {  // points of a line do not tell a turn about it
    const Points arms = a.colwise() - a.rowwise().mean();
    const Eigen::SelfAdjointEigenSolver<Mat<3>> spread(Mat<3>(arms * arms.transpose()));
    if (!(spread.eigenvalues()[1] > kFlat * spread.eigenvalues()[2])) return 0;
  }
  const Eigen::Matrix<double, Dim + 1, Dim + 1> motion = Eigen::umeyama(a, b, false);
  const Mat<Dim> rotation = motion.template topLeftCorner<Dim, Dim>();
  const Points missed = (rotation * a).colwise() + motion.template topRightCorner<Dim, 1>() - b;
  const double size = (a.rowwise().maxCoeff() - a.rowwise().minCoeff()).norm();
  return missed.colwise().norm().maxCoeff() < kRigid * size ? rotation_angle(rotation) : 0;
}

}  // namespace

template <int Dim>
std::string describe_large_turn(const CellSet<Dim>& cells, const DofMap& dofs, ConstVectorView from, ConstVectorView to) {
  const std::vector<std::array<int, 2>> edges = held_edges(cells, dofs);
  const std::vector<int> part_of = connected_parts<2>(cells.rest.size(), std::span<const std::array<int, 2>>(edges));
  std::map<int, std::vector<int>> parts;
  for (int v = 0; v < static_cast<int>(cells.rest.size()); ++v)
    if (is_held<Dim>(dofs, v)) parts[part_of[v]].push_back(v);
  double largest = 0;
  int vertex = kNone;
  for (const auto& [part, vertices] : parts) {
    const double degrees = vertices.size() < Dim ? 0 : angle_of<Dim>(vertices, from, to);
    if (degrees > largest) largest = degrees, vertex = vertices.front();
  }
  if (!(largest > kLarge)) return {};
  return fmt::format(
      "the step turns held vertices, such as {}, by {:.4g} degrees: straight ways to the other side of a turn press bodies "
      "flat, and the side of half a turn is not told; smaller steps (/time/dt, or /time/step_cuts) turn by less",
      vertex, largest);
}

template std::string describe_large_turn<2>(const CellSet<2>&, const DofMap&, ConstVectorView, ConstVectorView);
template std::string describe_large_turn<3>(const CellSet<3>&, const DofMap&, ConstVectorView, ConstVectorView);

}  // namespace itr
