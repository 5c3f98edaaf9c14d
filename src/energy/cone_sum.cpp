// SPDX-License-Identifier: MIT
#include "energy/cone_sum.hpp"

#include <numbers>

#include "geometry/cofactors.hpp"
#include "geometry/measures.hpp"
#include "project_block.hpp"

namespace itr {

namespace {

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

Mat<2> cone_gradient(const Mat<2>& p) { return cofactors(p) / 2; }
Mat<3> cone_gradient(const Mat<3>& p) { return cofactors(p) / 6; }

TurnedPoint::TurnedPoint(CurvedEdges curved, const std::array<double, 2>& l, const Nodal& x)
    : shapes(quadratic_shapes<1>(curved, l)),
      slopes(quadratic_gradients<1, 1>(curved, l, Eigen::RowVector2d(-1, 1)).transpose()),
      r(x.row(0) * shapes),
      dr(x.row(0) * slopes),
      dz(x.row(1) * slopes) {}

double TurnedPoint::volume() const { return std::numbers::pi * r * r * dz; }
TurnedPoint::Nodal TurnedPoint::gradient() const {
  Nodal g;
  g.row(0) = 2 * std::numbers::pi * r * dz * shapes.transpose();
  g.row(1) = std::numbers::pi * r * r * slopes.transpose();
  return g;
}
TurnedPoint::Nodal TurnedPoint::normal() const { return 2 * std::numbers::pi * r * Vec<2>(dz, -dr) * shapes.transpose(); }
Mat<2 * kQuadraticNodes<1>> TurnedPoint::hessian() const {
  Mat<2 * kQuadraticNodes<1>> H = Mat<2 * kQuadraticNodes<1>>::Zero();
  for (int a = 0; a < kQuadraticNodes<1>; ++a)
    for (int b = 0; b < kQuadraticNodes<1>; ++b) {
      H(2 * a, 2 * b) = 2 * std::numbers::pi * dz * shapes[a] * shapes[b];
      H(2 * a, 2 * b + 1) = H(2 * b + 1, 2 * a) = 2 * std::numbers::pi * r * shapes[a] * slopes[b];
    }
  return H;
}

template <int Dim>
CornerWeights<Dim> corner_weights(CurvedEdges curved, const std::array<double, Dim>& l) {
  Eigen::Matrix<double, Dim - 1, Dim> linear;
  linear.col(0).setConstant(-1);
  linear.template rightCols<Dim - 1>().setIdentity();
  const auto tangents = quadratic_gradients<Dim - 1, Dim - 1>(curved, l, linear);
  CornerWeights<Dim> weights;
  weights.col(0) = quadratic_shapes<Dim - 1>(curved, l);
  for (int k = 1; k < Dim; ++k) weights.col(k) = weights.col(k - 1) + tangents.row(k - 1).transpose();
  return weights;
}

template <int Dim>
double ConeSum<Dim>::add_value(ConstVectorView x, double sum) const {
  for (const Facet& facet : facets_) sum += facet.pressure * simplex_volume<Dim>(corners(facet, x));
  for_each_cone(x, [&](const CurvedFacet&, double pressure, const auto&, const Corners& p) {
    sum += pressure * simplex_volume<Dim>(p);
  });
  for_each_turned(x,
                  [&](const CurvedFacet&, double pressure, const TurnedPoint& point) { sum += pressure * point.volume(); });
  return sum;
}

template <int Dim>
void ConeSum<Dim>::add_gradient(ConstVectorView x, double scale, VectorView gradient) const {
  for (const Facet& facet : facets_) {
    const Corners forces = scale * facet.pressure * cone_gradient(corners(facet, x));
    for (int k = 0; k < Dim; ++k) gradient.segment<Dim>(Dim * facet.vertices[k]) += forces.col(k);
  }
  for_each_cone(x, [&](const CurvedFacet& facet, double pressure, const auto& weights, const Corners& p) {
    const Corners forces = scale * pressure * cone_gradient(p);
    for (int n = 0; n < kQuadraticNodes<Dim - 1>; ++n)
      gradient.segment<Dim>(Dim * facet.nodes[n]) += forces * weights.row(n).transpose();
  });
  for_each_turned(x, [&](const CurvedFacet& facet, double pressure, const TurnedPoint& point) {
    add_by_nodes(facet.nodes, scale * pressure * point.gradient(), gradient);
  });
}

template <int Dim>
void ConeSum<Dim>::add_hessian(ConstVectorView x, double scale, PsdProjection psd, HessianSink& sink) const {
  for (const Facet& facet : facets_) {
    Mat<Dim* Dim> block = scale * facet.pressure * cone_hessian(corners(facet, x));
    project_block(block, psd);
    sink.add<Dim>(facet.vertices, block.data());
  }
  constexpr int kNodes = kQuadraticNodes<Dim - 1>;
  for_each_cone(x, [&](const CurvedFacet& facet, double pressure, const auto& weights, const Corners& p) {
    Mat<Dim* Dim> block = scale * pressure * cone_hessian(p);
    project_block(block, psd);
    Eigen::Matrix<double, Dim * Dim, Dim * kNodes> by_nodes;
    for (int n = 0; n < kNodes; ++n)
      for (int k = 0; k < Dim; ++k)
        by_nodes.template block<Dim, Dim>(Dim * k, Dim * n) = weights(n, k) * Mat<Dim>::Identity();
    const Mat<Dim* kNodes> of_nodes = by_nodes.transpose() * block * by_nodes;
    sink.add<Dim>(facet.nodes, of_nodes.data());
  });
  for_each_turned(x, [&](const CurvedFacet& facet, double pressure, const TurnedPoint& point) {
    Mat<2 * kQuadraticNodes<1>> block = scale * pressure * point.hessian();
    project_block(block, psd);
    sink.add<2>(facet.nodes, block.data());
  });
}

#define ITR_INSTANTIATE(Dim)   \
  template class ConeSum<Dim>; \
  template CornerWeights<Dim> corner_weights<Dim>(CurvedEdges, const std::array<double, Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
