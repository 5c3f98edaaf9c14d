// SPDX-License-Identifier: MIT
#include "energy/pressure.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "geometry/measures.hpp"

namespace itr {

namespace {

/// Force of a unit pressure on each corner, up to its sign: area times normal over the number of corners. At corners of
/// curved_corners it is the force on the whole facet, as if x's normal were everywhere.
Vec<2> corner_fraction(const Mat<2>& p) {
  const Vec<2> edge = p.col(1) - p.col(0);
  return Vec<2>(edge[1], -edge[0]) / 2;
}
Vec<3> corner_fraction(const Mat<3>& p) { return (p.col(1) - p.col(0)).cross(p.col(2) - p.col(0)) / 6; }

/// Barycenter of a facet as a point of its body.
template <int Dim>
RestPoint<Dim> middle_of(const std::array<int, Dim>& nodes, int part, const CellSet<Dim>& cells) {
  std::array<Vec<Dim>, Dim> corners;
  Vec<Dim> middle = Vec<Dim>::Zero();
  for (int k = 0; k < Dim; ++k) {
    corners[k] = cells.rest[nodes[k]];
    middle += corners[k] / Dim;
  }
  return {middle, inward_normal(corners), part};
}

}  // namespace

template <int Dim>
PressureEnergy<Dim>::PressureEnergy(const CellSet<Dim>& cells, const Loads<Dim>& loads, ConstVectorView lagged_x,
                                    double scale)
    : cones_(cells.axisymmetric), correction_(VectorX::Zero(Dim * cells.num_vertices)), scale_(scale) {
  Vec<Dim> origin = Vec<Dim>::Zero();
  for (const bool is_curved : {false, true})
    for (const auto& facet : cells.facets)
      for (const auto& [tag, pressure] : loads.pressures) {
        if (tag != facet.tag || is_curved != (facet.curved != 0)) continue;
        const RestPoint<Dim> middle = middle_of<Dim>(facet.vertices, facet.part, cells);
        cones_.add(facet, pressure(middle));
        origin += middle;
      }
  if (empty()) return;
  cones_.set_origin(origin / static_cast<double>(cones_.size()));
  for (const auto& facet : cones_.facets()) {
    const Mat<Dim> p = cones_.corners(facet, lagged_x);
    const Mat<Dim> gradient = cone_gradient(p);
    const Vec<Dim> fraction = corner_fraction(p);
    largest_force_ = std::max(largest_force_, std::abs(facet.pressure) * fraction.norm());
    for (int k = 0; k < Dim; ++k)
      correction_.segment<Dim>(Dim * facet.vertices[k]) += facet.pressure * (fraction - gradient.col(k));
  }
  cones_.for_each_turned(lagged_x, [&](const auto& facet, double pressure, const TurnedPoint& point) {
    const TurnedPoint::Nodal normal = pressure * point.normal();
    largest_force_ = std::max(largest_force_, normal.norm());
    add_by_nodes(facet.nodes, normal - pressure * point.gradient(), correction_);
  });
  cones_.for_each_cone(lagged_x, [&](const auto& facet, double pressure, const auto& weights, const Mat<Dim>& p) {
    const Mat<Dim> gradient = cone_gradient(p);
    const Vec<Dim> normal = Dim * corner_fraction(p);
    largest_force_ = std::max(largest_force_, std::abs(facet.pressure) * normal.norm() / Dim);
    for (int n = 0; n < kQuadraticNodes<Dim - 1>; ++n)
      correction_.segment<Dim>(Dim * facet.nodes[n]) +=
          pressure * (weights(n, 0) * normal - gradient * weights.row(n).transpose());
  });
  VectorX rest(correction_.size());
  for (int v = 0; v < cells.num_vertices; ++v) rest.segment<Dim>(Dim * v) = cells.rest[v];
  rest_work_ = cones_.add_value(rest, 0);
  for (int v = 0; v < cells.num_vertices; ++v) rest_work_ += correction_.segment<Dim>(Dim * v).dot(cells.rest[v]);
}

template <int Dim>
double PressureEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  return scale_ * cones_.add_value(x, correction_.dot(x) - rest_work_);
}

template <int Dim>
void PressureEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  gradient += scale_ * correction_;
  cones_.add_gradient(x, scale_, gradient);
}

template <int Dim>
void PressureEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  cones_.add_hessian(x, scale_, psd, sink);
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
