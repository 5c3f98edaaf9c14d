// SPDX-License-Identifier: MIT
#include "least_motion.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mesh/connected_parts.hpp"

namespace itr {

namespace {

constexpr double kShare = 10;          ///< of the forces by the size: a step moves a body by a tenth of its size at most
constexpr double kLeastLeft = 1e-5;    ///< of the forces that act, below which sigma fades no more
constexpr double kLeastShare = 1e-12;  ///< of the elastic stiffness: what a factorisation resolves
constexpr double kHeld = 1e-8;         ///< of the best held rigid motion: what is held less is free

template <int Dim>
inline constexpr int kRigidModes = Dim == 2 ? 3 : 6;

/// Velocities of a point at `arm` from the centre by the rigid motions, as columns; `radius` makes them alike.
Eigen::Matrix<double, 2, 3> rigid_modes(const Vec<2>& arm, double radius) {
  Eigen::Matrix<double, 2, 3> modes;
  modes << 1, 0, -arm[1] / radius, 0, 1, arm[0] / radius;
  return modes;
}
Eigen::Matrix<double, 3, 6> rigid_modes(const Vec<3>& arm, double radius) {
  Eigen::Matrix<double, 3, 6> modes;
  modes.leftCols<3>().setIdentity();
  for (int c = 0; c < 3; ++c) modes.col(3 + c) = Vec<3>(Vec<3>::Unit(c)).cross(arm) / radius;
  return modes;
}

template <int Dim>
bool has_free_motion(const std::vector<int>& nodes, ConstVectorView x, const std::vector<char>& held, const Vec<Dim>& centre,
                     double radius) {
  Mat<kRigidModes<Dim>> gram = Mat<kRigidModes<Dim>>::Zero();
  for (const int node : nodes) {
    const auto modes = rigid_modes(Vec<Dim>(x.segment<Dim>(Dim * node) - centre), radius);
    for (int c = 0; c < Dim; ++c)
      if (held[Dim * node + c]) gram += modes.row(c).transpose() * modes.row(c);
  }
  const auto eigenvalues = Eigen::SelfAdjointEigenSolver<Mat<kRigidModes<Dim>>>(gram).eigenvalues();
  return !(eigenvalues[0] > kHeld * eigenvalues[kRigidModes<Dim> - 1]);
}

}  // namespace

template <int Dim>
std::vector<typename LeastMotion<Dim>::Part> find_loose_parts(const CellSet<Dim>& cells, ConstVectorView x,
                                                              const std::vector<char>& held,
                                                              const std::map<int, Material>& materials) {
  using Part = typename LeastMotion<Dim>::Part;
  std::vector<std::array<int, Dim + 1>> corners;
  for (const auto& element : cells.elements) corners.push_back(element.vertices);
  for (const auto& element : cells.curved_elements) {
    corners.emplace_back();
    std::copy_n(element.nodes.begin(), Dim + 1, corners.back().begin());
  }
  const std::vector<int> part_of =
      connected_parts<Dim + 1>(cells.rest.size(), std::span<const std::array<int, Dim + 1>>(corners));
  std::vector<double> weight(cells.rest.size(), 0);
  std::vector<int> part_of_node(cells.rest.size(), kNone);
  std::vector<double> modulus;
  const auto add = [&](const auto& nodes, int part, int body, double volume) {
    if (static_cast<std::size_t>(part) >= modulus.size()) modulus.resize(part + 1, 0);
    modulus[part] = std::max(modulus[part], materials.at(body).youngs_modulus);
    for (const int node : nodes) {
      weight[node] += volume / static_cast<double>(nodes.size());
      part_of_node[node] = part;
    }
  };
  for (const auto& element : cells.elements)
    add(element.vertices, part_of[element.vertices[0]], element.body, element.volume);
  for (const auto& element : cells.curved_elements)
    add(element.nodes, part_of[element.nodes[0]], element.body, element.volume);
  std::vector<Part> parts(modulus.size());
  for (std::size_t node = 0; node < part_of_node.size(); ++node) {
    if (part_of_node[node] == kNone) continue;
    parts[part_of_node[node]].nodes.push_back(static_cast<int>(node));
    parts[part_of_node[node]].weights.push_back(weight[node]);
  }
  std::vector<Part> loose;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    Part& part = parts[p];
    if (part.nodes.empty()) continue;
    double volume = 0;
    Vec<Dim> centre = Vec<Dim>::Zero();
    Eigen::AlignedBox<double, Dim> box;
    for (std::size_t k = 0; k < part.nodes.size(); ++k) {
      const Vec<Dim> place = x.segment<Dim>(Dim * part.nodes[k]);
      volume += part.weights[k];
      centre += part.weights[k] * place;
      box.extend(place);
    }
    centre /= volume;
    part.size = box.diagonal().norm();
    if (!has_free_motion<Dim>(part.nodes, x, held, centre, part.size / 2)) continue;
    for (double& w : part.weights) w /= volume;
    part.modulus = modulus[p] * std::pow(part.size, Dim - 2);
    loose.push_back(std::move(part));
  }
  return loose;
}

template <int Dim>
void LeastMotion<Dim>::follow(ConstVectorView gradient, ConstVectorView sizes, const DofMap& dofs) {
  for (Part& part : parts_) {
    double acting = 0, left = 0;
    for (const int node : part.nodes)
      for (int c = 0; c < Dim; ++c) {
        const int i = Dim * node + c;
        acting += sizes[i];
        if (dofs.unknown[i] != kNone) left += std::abs(gradient[i]);
      }
    const double fade = acting > 0 ? std::clamp(left / acting, kLeastLeft, 1.0) : 1;
    part.stiffness = std::max(kShare * fade * acting / part.size, kLeastShare * scaling_ * part.modulus);
  }
}

template <int Dim>
void LeastMotion<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  for (const Part& part : parts_)
    for (std::size_t k = 0; k < part.nodes.size(); ++k) {
      const Mat<Dim> block = part.stiffness * part.weights[k] * Mat<Dim>::Identity();
      sink.add<Dim>(std::array{part.nodes[k]}, block.data());
    }
}

template <int Dim>
bool LeastMotion<Dim>::get_single_ways(ConstVectorView, ConstVectorView dx, VectorView ways, Workspace&) const {
  ways = dx;
  return true;
}

template <int Dim>
MatrixX LeastMotion<Dim>::rigid_motions(ConstVectorView x, const DofMap& dofs) const {
  constexpr double kLeast = 1e-12;  ///< of the largest: a motion of which held dofs leave less is none
  using Motions = Eigen::Matrix<double, Dim, kRigidModes<Dim>>;
  MatrixX motions = MatrixX::Zero(x.size(), kRigidModes<Dim> * static_cast<Eigen::Index>(parts_.size()));
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Part& part = parts_[p];
    Vec<Dim> centre = Vec<Dim>::Zero();
    for (std::size_t k = 0; k < part.nodes.size(); ++k) centre += part.weights[k] * x.segment<Dim>(Dim * part.nodes[k]);
    const auto at = [&](int node) {
      Motions rows = rigid_modes(Vec<Dim>(x.segment<Dim>(Dim * node) - centre), part.size / 2);
      for (int c = 0; c < Dim; ++c)
        if (dofs.unknown[Dim * node + c] == kNone) rows.row(c).setZero();
      return rows;
    };
    Mat<kRigidModes<Dim>> gram = Mat<kRigidModes<Dim>>::Zero();
    for (std::size_t k = 0; k < part.nodes.size(); ++k) {
      const Motions rows = at(part.nodes[k]);
      gram += part.stiffness * part.weights[k] * rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Mat<kRigidModes<Dim>>> solver(gram);
    Mat<kRigidModes<Dim>> normal = Mat<kRigidModes<Dim>>::Zero();
    for (int k = 0; k < kRigidModes<Dim>; ++k)
      if (const double value = solver.eigenvalues()[k]; value > kLeast * solver.eigenvalues()[kRigidModes<Dim> - 1])
        normal.col(k) = solver.eigenvectors().col(k) / std::sqrt(value);
    for (const int node : part.nodes)
      motions.template block<Dim, kRigidModes<Dim>>(Dim * node, kRigidModes<Dim> * static_cast<Eigen::Index>(p)) =
          at(node) * normal;
  }
  return motions;
}

#define ITR_INSTANTIATE(Dim)                                          \
  template class LeastMotion<Dim>;                                    \
  template std::vector<LeastMotion<Dim>::Part> find_loose_parts<Dim>( \
      const CellSet<Dim>&, ConstVectorView, const std::vector<char>&, const std::map<int, Material>&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
