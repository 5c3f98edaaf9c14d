// SPDX-License-Identifier: MIT
#include "itr/energy/pressure.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "project_block.hpp"

namespace itr {

namespace {

/// Signed volume of the simplex from the origin to the corners.
template <int Dim>
double cone_volume(const Mat<Dim>& p) {
  return p.determinant() / (Dim == 2 ? 2 : 6);
}

/// Its derivatives by the corners, as columns.
Mat<2> cone_gradient(const Mat<2>& p) {
  Mat<2> gradient;
  gradient << p(1, 1), -p(1, 0), -p(0, 1), p(0, 0);
  return gradient / 2;
}
Mat<3> cone_gradient(const Mat<3>& p) {
  Mat<3> gradient;
  for (int k = 0; k < 3; ++k) gradient.col(k) = p.col((k + 1) % 3).cross(p.col((k + 2) % 3)) / 6;
  return gradient;
}

/// What a unit pressure puts on each corner, up to its sign: area times normal over the number of corners.
Vec<2> corner_share(const Mat<2>& p) {
  const Vec<2> edge = p.col(1) - p.col(0);
  return Vec<2>(edge[1], -edge[0]) / 2;
}
Vec<3> corner_share(const Mat<3>& p) { return (p.col(1) - p.col(0)).cross(p.col(2) - p.col(0)) / 6; }

Mat<4> cone_hessian(const Mat<2>&) {
  Mat<4> hessian = Mat<4>::Zero();
  hessian(0, 3) = hessian(3, 0) = 0.5;
  hessian(1, 2) = hessian(2, 1) = -0.5;
  return hessian;
}
Mat<9> cone_hessian(const Mat<3>& p) {
  Mat<9> hessian = Mat<9>::Zero();
  for (int k = 0; k < 3; ++k) {
    // The derivative of p_i x p_j by p_i is minus the cross-product matrix of p_j, by p_j that of p_i.
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const auto cross_matrix = [](const Vec<3>& a) {
      Mat<3> m;
      m << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
      return m;
    };
    hessian.block<3, 3>(3 * k, 3 * i) = -cross_matrix(p.col(j)) / 6;
    hessian.block<3, 3>(3 * k, 3 * j) = cross_matrix(p.col(i)) / 6;
  }
  return hessian;
}

}  // namespace

template <int Dim>
PressureEnergy<Dim>::PressureEnergy(const CellSet<Dim>& cells, const Loads<Dim>& loads, ConstVectorView lagged_x,
                                    double scale)
    : correction_(VectorX::Zero(Dim * cells.num_vertices)), scale_(scale) {
  for (const auto& facet : cells.facets)
    for (const auto& [tag, pressure] : loads.pressures) {
      if (tag != facet.tag) continue;
      Vec<Dim> middle = Vec<Dim>::Zero();
      for (const int v : facet.vertices) middle += cells.rest[v] / Dim;
      facets_.push_back({facet.vertices, pressure(middle)});
      origin_ += middle;
    }
  if (facets_.empty()) return;
  origin_ /= static_cast<double>(facets_.size());
  for (const LoadedFacet& facet : facets_) {
    const Corners p = corners(facet, lagged_x);
    const Corners gradient = cone_gradient(p);
    const Vec<Dim> share = corner_share(p);
    largest_force_ = std::max(largest_force_, std::abs(facet.pressure) * share.norm());
    for (int k = 0; k < Dim; ++k)
      correction_.segment<Dim>(Dim * facet.vertices[k]) += facet.pressure * (share - gradient.col(k));
  }
  for (const LoadedFacet& facet : facets_) {
    Corners p;
    for (int k = 0; k < Dim; ++k) p.col(k) = cells.rest[facet.vertices[k]] - origin_;
    rest_work_ += facet.pressure * cone_volume<Dim>(p);
  }
  for (int v = 0; v < cells.num_vertices; ++v) rest_work_ += correction_.segment<Dim>(Dim * v).dot(cells.rest[v]);
}

template <int Dim>
auto PressureEnergy<Dim>::corners(const LoadedFacet& facet, ConstVectorView x) const -> Corners {
  Corners p;
  for (int k = 0; k < Dim; ++k) p.col(k) = x.segment<Dim>(Dim * facet.vertices[k]) - origin_;
  return p;
}

template <int Dim>
double PressureEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = correction_.dot(x) - rest_work_;
  for (const LoadedFacet& facet : facets_) sum += facet.pressure * cone_volume<Dim>(corners(facet, x));
  return scale_ * sum;
}

template <int Dim>
void PressureEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  gradient += scale_ * correction_;
  for (const LoadedFacet& facet : facets_) {
    const Corners forces = scale_ * facet.pressure * cone_gradient(corners(facet, x));
    for (int k = 0; k < Dim; ++k) gradient.segment<Dim>(Dim * facet.vertices[k]) += forces.col(k);
  }
}

template <int Dim>
void PressureEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  for (const LoadedFacet& facet : facets_) {
    Mat<Dim* Dim> block = scale_ * facet.pressure * cone_hessian(corners(facet, x));
    project_block(block, psd);
    sink.add<Dim>(facet.vertices, block.data());
  }
}

template <int Dim>
bool PressureEnergy<Dim>::is_lagged(const DofMap& dofs) const {
  constexpr double kRoundOff = 1e-9;
  for (Eigen::Index i = 0; i < correction_.size(); ++i)
    if (dofs.unknown[i] != kNone && std::abs(correction_[i]) > kRoundOff * largest_force_) return true;
  return false;
}

template class PressureEnergy<2>;
template class PressureEnergy<3>;

}  // namespace itr
