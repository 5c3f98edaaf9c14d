// SPDX-License-Identifier: MIT
#include "energy/pressure.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <numbers>

#include "fem/quadrature.hpp"
#include "geometry/measures.hpp"
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

/// Force of a unit pressure on each corner, up to its sign: area times normal over the number of corners. At corners of
/// curved_corners it is the force on the whole facet, as if x's normal were everywhere.
Vec<2> corner_fraction(const Mat<2>& p) {
  const Vec<2> edge = p.col(1) - p.col(0);
  return Vec<2>(edge[1], -edge[0]) / 2;
}
Vec<3> corner_fraction(const Mat<3>& p) { return (p.col(1) - p.col(0)).cross(p.col(2) - p.col(0)) / 6; }

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

/// The cone over a curved facet is the mean, over points of the facet, of cones over the corners x, x + t1, x + t1 + t2,
/// with the tangents t there: their volume is det(x, t1, t2) over 2 or 6. A row of these weights gives what a node adds to a
/// corner.
template <int Dim>
using CornerWeights = Eigen::Matrix<double, kQuadraticNodes<Dim - 1>, Dim>;

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

/// A point of an edge that is turned, with its shape functions and their derivatives along the edge.
struct TurnedPoint {
  using Nodal = Eigen::Matrix<double, 2, kQuadraticNodes<1>>;
  Vec<kQuadraticNodes<1>> shapes, slopes;
  double r, dr, dz;  ///< radius, and derivatives of the position along the edge

  TurnedPoint(CurvedEdges curved, const std::array<double, 2>& l, const Nodal& x)
      : shapes(quadratic_shapes<1>(curved, l)),
        slopes(quadratic_gradients<1, 1>(curved, l, Eigen::RowVector2d(-1, 1)).transpose()),
        r(x.row(0) * shapes),
        dr(x.row(0) * slopes),
        dz(x.row(1) * slopes) {}

  double volume() const { return std::numbers::pi * r * r * dz; }
  Nodal gradient() const {
    Nodal g;
    g.row(0) = 2 * std::numbers::pi * r * dz * shapes.transpose();
    g.row(1) = std::numbers::pi * r * r * slopes.transpose();
    return g;
  }
  /// Area times normal, shared by shape functions.
  Nodal normal() const { return 2 * std::numbers::pi * r * Vec<2>(dz, -dr) * shapes.transpose(); }
  Mat<2 * kQuadraticNodes<1>> hessian() const {
    Mat<2 * kQuadraticNodes<1>> H = Mat<2 * kQuadraticNodes<1>>::Zero();
    for (int a = 0; a < kQuadraticNodes<1>; ++a)
      for (int b = 0; b < kQuadraticNodes<1>; ++b) {
        H(2 * a, 2 * b) = 2 * std::numbers::pi * dz * shapes[a] * shapes[b];
        H(2 * a, 2 * b + 1) = H(2 * b + 1, 2 * a) = 2 * std::numbers::pi * r * shapes[a] * slopes[b];
      }
    return H;
  }
};

/// Adds the columns to the entries of a facet's nodes; at a straight edge the last column is zero.
template <typename Facet, typename Forces>
void add_by_nodes(const Facet& facet, const Forces& forces, auto&& sum) {
  for (std::size_t n = 0; n < facet.nodes.size(); ++n)
    sum.template segment<2>(2 * facet.nodes[n]) += forces.col(static_cast<Eigen::Index>(n));
}

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
    : axisymmetric_(cells.axisymmetric), correction_(VectorX::Zero(Dim * cells.num_vertices)), scale_(scale) {
  for (const bool is_curved : {false, true})
    for (const auto& facet : cells.facets)
      for (const auto& [tag, pressure] : loads.pressures) {
        if (tag != facet.tag || is_curved != (facet.curved != 0)) continue;
        const RestPoint<Dim> middle = middle_of<Dim>(facet.vertices, facet.part, cells);
        if (is_curved || axisymmetric_)
          curves_.push_back({facet.nodes(), facet.curved, pressure(middle)});
        else
          facets_.push_back({facet.vertices, pressure(middle)});
        origin_ += middle;
      }
  if (empty()) return;
  origin_ /= static_cast<double>(facets_.size() + curves_.size());
  for (const LoadedFacet& facet : facets_) {
    const Corners p = corners(facet, lagged_x);
    const Corners gradient = cone_gradient(p);
    const Vec<Dim> fraction = corner_fraction(p);
    largest_force_ = std::max(largest_force_, std::abs(facet.pressure) * fraction.norm());
    for (int k = 0; k < Dim; ++k)
      correction_.segment<Dim>(Dim * facet.vertices[k]) += facet.pressure * (fraction - gradient.col(k));
  }
  for_each_turned(lagged_x, [&](const CurvedLoadedFacet& facet, double pressure, const TurnedPoint& point) {
    const TurnedPoint::Nodal normal = pressure * point.normal();
    largest_force_ = std::max(largest_force_, normal.norm());
    add_by_nodes(facet, normal - pressure * point.gradient(), correction_);
  });
  for_each_cone(lagged_x, [&](const CurvedLoadedFacet& facet, double pressure, const auto& weights, const Corners& p) {
    const Corners gradient = cone_gradient(p);
    const Vec<Dim> normal = Dim * corner_fraction(p);
    largest_force_ = std::max(largest_force_, std::abs(facet.pressure) * normal.norm() / Dim);
    for (int n = 0; n < kQuadraticNodes<Dim - 1>; ++n)
      correction_.segment<Dim>(Dim * facet.nodes[n]) +=
          pressure * (weights(n, 0) * normal - gradient * weights.row(n).transpose());
  });
  VectorX rest(correction_.size());
  for (int v = 0; v < cells.num_vertices; ++v) rest.segment<Dim>(Dim * v) = cells.rest[v];
  for (const LoadedFacet& facet : facets_) rest_work_ += facet.pressure * cone_volume<Dim>(corners(facet, rest));
  for_each_cone(rest, [&](const CurvedLoadedFacet&, double pressure, const auto&, const Corners& p) {
    rest_work_ += pressure * cone_volume<Dim>(p);
  });
  for_each_turned(rest, [&](const CurvedLoadedFacet&, double pressure, const TurnedPoint& point) {
    rest_work_ += pressure * point.volume();
  });
  for (int v = 0; v < cells.num_vertices; ++v) rest_work_ += correction_.segment<Dim>(Dim * v).dot(cells.rest[v]);
}

template <int Dim>
auto PressureEnergy<Dim>::corners(const LoadedFacet& facet, ConstVectorView x) const -> Corners {
  Corners p;
  for (int k = 0; k < Dim; ++k) p.col(k) = x.segment<Dim>(Dim * facet.vertices[k]) - origin_;
  return p;
}

template <int Dim>
template <typename F>
void PressureEnergy<Dim>::for_each_cone(ConstVectorView x, const F& f) const {
  if (axisymmetric_) return;
  constexpr int kDegree = Dim == 2 ? 3 : 4;  // of det(x, t1, t2), and of a shape function times the normal
  for (const CurvedLoadedFacet& facet : curves_) {
    auto nodes = at_nodes<Dim>(facet.nodes, x);
    nodes.colwise() -= origin_;
    for (const auto& point : quadrature<Dim - 1>(kDegree)) {
      const CornerWeights<Dim> weights = corner_weights<Dim>(facet.curved, point.weights);
      f(facet, facet.pressure * point.fraction, weights, Corners(nodes * weights));
    }
  }
}

template <int Dim>
template <typename F>
void PressureEnergy<Dim>::for_each_turned(ConstVectorView x, const F& f) const {
  if constexpr (Dim == 2) {
    constexpr int kDegree = 5;  // of r^2 dz
    if (!axisymmetric_) return;
    for (const CurvedLoadedFacet& facet : curves_)
      for (const auto& point : quadrature<1>(kDegree))
        f(facet, facet.pressure * point.fraction, TurnedPoint(facet.curved, point.weights, at_nodes<2>(facet.nodes, x)));
  }
}

template <int Dim>
double PressureEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = correction_.dot(x) - rest_work_;
  for (const LoadedFacet& facet : facets_) sum += facet.pressure * cone_volume<Dim>(corners(facet, x));
  for_each_cone(x, [&](const CurvedLoadedFacet&, double pressure, const auto&, const Corners& p) {
    sum += pressure * cone_volume<Dim>(p);
  });
  for_each_turned(
      x, [&](const CurvedLoadedFacet&, double pressure, const TurnedPoint& point) { sum += pressure * point.volume(); });
  return scale_ * sum;
}

template <int Dim>
void PressureEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  gradient += scale_ * correction_;
  for (const LoadedFacet& facet : facets_) {
    const Corners forces = scale_ * facet.pressure * cone_gradient(corners(facet, x));
    for (int k = 0; k < Dim; ++k) gradient.segment<Dim>(Dim * facet.vertices[k]) += forces.col(k);
  }
  for_each_cone(x, [&](const CurvedLoadedFacet& facet, double pressure, const auto& weights, const Corners& p) {
    const Corners forces = scale_ * pressure * cone_gradient(p);
    for (int n = 0; n < kQuadraticNodes<Dim - 1>; ++n)
      gradient.segment<Dim>(Dim * facet.nodes[n]) += forces * weights.row(n).transpose();
  });
  for_each_turned(x, [&](const CurvedLoadedFacet& facet, double pressure, const TurnedPoint& point) {
    add_by_nodes(facet, scale_ * pressure * point.gradient(), gradient);
  });
}

template <int Dim>
void PressureEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  for (const LoadedFacet& facet : facets_) {
    Mat<Dim* Dim> block = scale_ * facet.pressure * cone_hessian(corners(facet, x));
    project_block(block, psd);
    sink.add<Dim>(facet.vertices, block.data());
  }
  constexpr int kNodes = kQuadraticNodes<Dim - 1>;
  for_each_cone(x, [&](const CurvedLoadedFacet& facet, double pressure, const auto& weights, const Corners& p) {
    Mat<Dim* Dim> block = scale_ * pressure * cone_hessian(p);
    project_block(block, psd);
    Eigen::Matrix<double, Dim * Dim, Dim * kNodes> by_nodes;
    for (int n = 0; n < kNodes; ++n)
      for (int k = 0; k < Dim; ++k)
        by_nodes.template block<Dim, Dim>(Dim * k, Dim * n) = weights(n, k) * Mat<Dim>::Identity();
    const Mat<Dim* kNodes> of_nodes = by_nodes.transpose() * block * by_nodes;
    sink.add<Dim>(facet.nodes, of_nodes.data());
  });
  for_each_turned(x, [&](const CurvedLoadedFacet& facet, double pressure, const TurnedPoint& point) {
    Mat<2 * kQuadraticNodes<1>> block = scale_ * pressure * point.hessian();
    project_block(block, psd);
    sink.add<2>(facet.nodes, block.data());
  });
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
