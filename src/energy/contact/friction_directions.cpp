// SPDX-License-Identifier: MIT
#include "energy/contact/friction_directions.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "energy/contact/pairs.hpp"

namespace itr {

namespace {

/// By vertex, a direction at rest as the triangles there have deformed it: the mean of its parts in their planes, by area.
std::vector<Vec<3>> turned_directions(const CollisionSurface& surface, ConstVectorView x, const Vec<3>& direction) {
  std::vector<Vec<3>> turned(surface.area.size(), Vec<3>::Zero());
  const auto edges = [](ConstVectorView at, const std::array<int, 3>& t) {
    Eigen::Matrix<double, 3, 2> e;
    for (int k = 0; k < 2; ++k) e.col(k) = at.segment<3>(3 * t[k + 1]) - at.segment<3>(3 * t[0]);
    return e;
  };
  for (const auto& triangle : surface.triangles) {
    const Eigen::Matrix<double, 3, 2> rest = edges(surface.rest, triangle);
    const double area = rest.col(0).cross(rest.col(1)).norm() / 2;
    if (area == 0) continue;
    const Vec<2> parts = Mat<2>(rest.transpose() * rest).inverse() * (rest.transpose() * direction);
    const Vec<3> here = edges(x, triangle) * parts;
    for (const int v : triangle) turned[v] += area * here;
  }
  return turned;
}

}  // namespace

Vec<3> FrictionDirections::at(const ContactStencil& pair, const Vec<4>& weights, const FrictionPair& by_direction,
                              bool is_first_a) {
  const FrictionAcross& across = *by_direction.across;
  if (across.frame == FrictionAcross::Frame::space) return across.direction;
  const auto [found, is_new] = turned_.try_emplace(&by_direction);
  if (is_new) found->second = turned_directions(surface_, x_, across.direction);
  const bool is_of_first = (across.frame == FrictionAcross::Frame::a) == is_first_a;
  const int first = size_of_first(pair.kind);
  Vec<3> sum = Vec<3>::Zero();
  for (int k = is_of_first ? 0 : first; k < (is_of_first ? first : pair.size()); ++k)
    sum += std::abs(weights[k]) * found->second[pair.vertices[k]].normalized();
  return sum;
}

}  // namespace itr
