// SPDX-License-Identifier: MIT
#include "least_motion.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include "core/connected_parts.hpp"
#include "mass_block.hpp"

namespace itr {

namespace {

constexpr double kFraction = 10;          ///< of the forces by the size: a step moves a body by a tenth of its size at most
constexpr double kLeastLeft = 1e-5;       ///< of the forces that act, below which sigma fades no more
constexpr double kLeastFraction = 1e-12;  ///< of the elastic stiffness: what a factorisation resolves
constexpr double kHeld = 1e-8;            ///< of the best held rigid motion: what is held less is free

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

/// f(part, nodes, scalar mass matrix) for each cell of a loose part.
template <int Dim, typename F>
void for_each_mass(const CellSet<Dim>& cells, const LooseParts<Dim>& loose, const F& f) {
  const ElementMass<Dim> unit(MassKind::consistent, 1);
  Mat<Dim + 1> linear = Mat<Dim + 1>::Constant(unit.off);
  linear.diagonal().array() += unit.extra;
  for (std::size_t e = 0; e < cells.elements.size(); ++e) {
    const auto& element = cells.elements[e];
    if (const int part = loose.of_element[e]; part == kNone)
      continue;
    else if (element.curved)
      f(part, element.nodes(), (loose.mass[e] * constant_quadratic_mass<Dim>(MassKind::consistent, element.curved)).eval());
    else
      f(part, element.vertices, (loose.mass[e] * linear).eval());
  }
}

/// The centre of mass of each part at positions x.
template <int Dim>
std::vector<Vec<Dim>> centres_of_mass(const CellSet<Dim>& cells, const LooseParts<Dim>& loose, ConstVectorView x) {
  std::vector<Vec<Dim>> centres(loose.parts.size(), Vec<Dim>(Vec<Dim>::Zero()));
  for_each_mass<Dim>(cells, loose, [&](int part, const auto& nodes, const auto& mass) {
    for (std::size_t k = 0; k < nodes.size(); ++k)
      centres[part] += mass.row(static_cast<Eigen::Index>(k)).sum() * x.segment<Dim>(Dim * nodes[k]);
  });
  return centres;
}

/// All connected parts, loose or not.
template <int Dim>
LooseParts<Dim> find_parts(const CellSet<Dim>& cells, const std::map<int, Material>& materials,
                           std::span<const std::vector<int>> bonds) {
  std::vector<std::array<int, Dim + 1>> corners;
  for (const auto& element : cells.elements) corners.push_back(element.vertices);
  for (const std::vector<int>& bond : bonds)
    for (const int node : bond) {
      corners.emplace_back().fill(node);
      corners.back().front() = bond.front();
    }
  const std::vector<int> part_of_vertex =
      connected_parts<Dim + 1>(cells.rest.size(), std::span<const std::array<int, Dim + 1>>(corners));
  LooseParts<Dim> all;
  std::map<int, int> numbers;  // parts without cells, such as single vertices, have none
  std::vector<double> total;
  std::vector<char> is_in(cells.rest.size(), 0);
  for (const auto& element : cells.elements) {
    const auto [entry, is_new] =
        numbers.try_emplace(part_of_vertex[element.vertices[0]], static_cast<int>(all.parts.size()));
    if (is_new) all.parts.emplace_back(), total.push_back(0);
    const int part = entry->second;
    const Material& material = materials.at(element.body);
    const double mass = element.volume * (material.density > 0 ? material.density : 1);
    all.parts[part].modulus = std::max(all.parts[part].modulus, material.youngs_modulus);
    total[part] += mass;
    for_each_node(element, [&](int node) {
      if (!std::exchange(is_in[node], 1)) all.parts[part].nodes.push_back(node);
    });
    all.of_element.push_back(part);
    all.mass.push_back(mass);
  }
  for (std::size_t e = 0; e < all.mass.size(); ++e) all.mass[e] /= total[all.of_element[e]];
  for (LoosePart<Dim>& part : all.parts) std::sort(part.nodes.begin(), part.nodes.end());
  return all;
}

}  // namespace

template <int Dim>
LooseParts<Dim> find_loose_parts(const CellSet<Dim>& cells, ConstVectorView x, const std::vector<char>& held,
                                 const std::map<int, Material>& materials, std::span<const std::vector<int>> bonds) {
  LooseParts<Dim> all = find_parts(cells, materials, bonds);
  const std::vector<Vec<Dim>> centres = centres_of_mass(cells, all, x);
  std::vector<LoosePart<Dim>> loose;
  std::vector<int> number(all.parts.size(), kNone);
  for (std::size_t p = 0; p < all.parts.size(); ++p) {
    LoosePart<Dim>& part = all.parts[p];
    Eigen::AlignedBox<double, Dim> box;
    for (const int node : part.nodes) box.extend(Vec<Dim>(x.segment<Dim>(Dim * node)));
    part.size = box.diagonal().norm();
    const bool is_loose = cells.axisymmetric  // only a motion along the axis is rigid
                              ? std::ranges::none_of(part.nodes, [&](int node) { return held[Dim * node + 1] != 0; })
                              : has_free_motion<Dim>(part.nodes, x, held, centres[p], part.size / 2);
    if (!is_loose) continue;
    part.modulus *= std::pow(part.size, Dim - 2);
    number[p] = static_cast<int>(loose.size());
    loose.push_back(std::move(part));
  }
  all.parts = std::move(loose);
  for (int& part : all.of_element) part = number[part];
  return all;
}

template <int Dim>
void LeastMotion<Dim>::follow(ConstVectorView gradient, ConstVectorView sizes, const DofMap& dofs) {
  for (LoosePart<Dim>& part : loose_.parts) {
    double left = 0;
    part.acting = 0;
    for (const int node : part.nodes)
      for (int c = 0; c < Dim; ++c) {
        const int i = Dim * node + c;
        part.acting += sizes[i];
        if (dofs.unknown[i] != kNone) left += std::abs(gradient[i]);
      }
    const double fade = part.acting > 0 ? std::clamp(left / part.acting, kLeastLeft, 1.0) : 1;
    part.stiffness = std::max(kFraction * fade * part.acting / part.size, kLeastFraction * scaling_ * part.modulus);
  }
}

template <int Dim>
void LeastMotion<Dim>::hold(ConstVectorView anchor, double reach) {
  anchor_ = std::isfinite(reach) ? VectorX(anchor) : VectorX();
  for (LoosePart<Dim>& part : loose_.parts) part.hold = part.acting / (reach * part.size);
}

template <int Dim>
bool LeastMotion<Dim>::is_holding() const {
  return std::ranges::any_of(loose_.parts, [](const LoosePart<Dim>& part) { return part.hold > 0; });
}

template <int Dim>
double LeastMotion<Dim>::value(ConstVectorView x, Workspace& workspace) const {
  if (anchor_.size() == 0) return 0;
  VectorX gradient = VectorX::Zero(x.size());
  add_gradient(x, gradient, workspace);
  return gradient.dot(x - anchor_) / 2;
}

template <int Dim>
void LeastMotion<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  if (anchor_.size() == 0) return;
  const VectorX motion = x - anchor_;
  for_each_mass<Dim>(cells_, loose_, [&](int part, const auto& nodes, const auto& mass) {
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (std::size_t j = 0; j < nodes.size(); ++j)
        gradient.segment<Dim>(Dim * nodes[i]) += loose_.parts[part].hold *
                                                 mass(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) *
                                                 motion.segment<Dim>(Dim * nodes[j]);
  });
}

template <int Dim>
void LeastMotion<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  std::vector<double> stiffness(loose_.mass.size(), 0);
  for (std::size_t e = 0; e < stiffness.size(); ++e)
    if (const int part = loose_.of_element[e]; part != kNone) stiffness[e] = loose_.parts[part].curvature() * loose_.mass[e];
  const auto curved = cells_.curved();
  const std::size_t num_straight = stiffness.size() - curved.size();
  sink.target().add_multiples<Dim>(cells_, std::span(stiffness).first(num_straight),
                                   unit_mass_block<Dim>(MassKind::consistent));
  sink.target().add_curved_multiples<Dim>(
      cells_, std::span(stiffness).subspan(num_straight), {}, [&](std::size_t e) -> const auto& {
        return constant_quadratic_mass<Dim>(MassKind::consistent, curved[e].curved);
      });
}

template <int Dim>
bool LeastMotion<Dim>::get_vertex_steps(ConstVectorView, ConstVectorView dx, VectorView steps, Workspace&) const {
  steps = dx;
  return true;
}

template <int Dim>
MatrixX LeastMotion<Dim>::rigid_motions(ConstVectorView x, const DofMap& dofs) const {
  constexpr double kLeast = 1e-12;  ///< of the largest: a motion of which held dofs leave less is none
  constexpr int kModes = kRigidModes<Dim>;
  using Motions = Eigen::Matrix<double, Dim, kModes>;
  const std::vector<Vec<Dim>> centres = centres_of_mass(cells_, loose_, x);
  const auto at = [&](int part, int node) {
    Motions rows = rigid_modes(Vec<Dim>(x.segment<Dim>(Dim * node) - centres[part]), loose_.parts[part].size / 2);
    for (int c = 0; c < Dim; ++c)
      if (dofs.unknown[Dim * node + c] == kNone) rows.row(c).setZero();
    if (cells_.axisymmetric) rows.row(0).setZero(), rows.template rightCols<kModes - Dim>().setZero();
    return rows;
  };
  std::vector<Mat<kModes>> gram(loose_.parts.size(), Mat<kModes>(Mat<kModes>::Zero()));
  for_each_mass<Dim>(cells_, loose_, [&](int part, const auto& nodes, const auto& mass) {
    std::array<Motions, std::tuple_size_v<std::remove_cvref_t<decltype(nodes)>>> rows;
    for (std::size_t i = 0; i < nodes.size(); ++i) rows[i] = at(part, nodes[i]);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      Motions product = Motions::Zero();
      for (std::size_t j = 0; j < nodes.size(); ++j)
        product += mass(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) * rows[j];
      gram[part] += loose_.parts[part].curvature() * rows[i].transpose() * product;
    }
  });
  MatrixX motions = MatrixX::Zero(x.size(), kModes * static_cast<Eigen::Index>(gram.size()));
  for (int p = 0; p < static_cast<int>(gram.size()); ++p) {
    const Eigen::SelfAdjointEigenSolver<Mat<kModes>> solver(gram[p]);
    Mat<kModes> normal = Mat<kModes>::Zero();
    for (int k = 0; k < kModes; ++k)
      if (const double value = solver.eigenvalues()[k]; value > kLeast * solver.eigenvalues()[kModes - 1])
        normal.col(k) = solver.eigenvectors().col(k) / std::sqrt(value);
    for (const int node : loose_.parts[p].nodes)
      motions.template block<Dim, kModes>(Dim * node, kModes * p) = at(p, node) * normal;
  }
  return motions;
}

#define ITR_INSTANTIATE(Dim)                                                                                     \
  template class LeastMotion<Dim>;                                                                               \
  template LooseParts<Dim> find_loose_parts<Dim>(const CellSet<Dim>&, ConstVectorView, const std::vector<char>&, \
                                                 const std::map<int, Material>&, std::span<const std::vector<int>>);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
