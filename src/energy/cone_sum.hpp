// SPDX-License-Identifier: MIT
// Volumes of cones from a fixed point to boundary facets, and their derivatives: what a pressure on the facets does. A facet
// that is turned about the axis has pi times the integral of r^2 dz over it instead.
#pragma once

#include <vector>

#include "energy/energy.hpp"
#include "fem/quadrature.hpp"

namespace itr {

/// The cone over a curved facet is the mean, over points of the facet, of cones over the corners x, x + t1, x + t1 + t2,
/// with the tangents t there: their volume is det(x, t1, t2) over 2 or 6. A row of these weights gives what a node adds to a
/// corner.
template <int Dim>
using CornerWeights = Eigen::Matrix<double, kQuadraticNodes<Dim - 1>, Dim>;
template <int Dim>
CornerWeights<Dim> corner_weights(CurvedEdges curved, const std::array<double, Dim>& l);

/// Derivatives of a cone's volume by its corners, as columns.
Mat<2> cone_gradient(const Mat<2>& corners);
Mat<3> cone_gradient(const Mat<3>& corners);

/// A point of an edge that is turned, with its shape functions and their derivatives along the edge.
struct TurnedPoint {
  using Nodal = Eigen::Matrix<double, 2, kQuadraticNodes<1>>;
  Vec<kQuadraticNodes<1>> shapes, slopes;
  double r, dr, dz;  ///< radius, and derivatives of the position along the edge

  TurnedPoint(CurvedEdges curved, const std::array<double, 2>& l, const Nodal& x);
  double volume() const;
  Nodal gradient() const;
  /// Area times normal, shared by shape functions.
  Nodal normal() const;
  Mat<2 * kQuadraticNodes<1>> hessian() const;
};

/// Adds the columns to the entries of a facet's nodes; at a straight edge the last column is zero.
template <std::size_t N, typename Forces>
void add_by_nodes(const std::array<int, N>& nodes, const Forces& forces, auto&& sum) {
  for (std::size_t n = 0; n < N; ++n) sum.template segment<2>(2 * nodes[n]) += forces.col(static_cast<Eigen::Index>(n));
}

/// Sum over facets of a pressure times the signed volume of the cone from a fixed point, or of what is turned.
template <int Dim>
class ConeSum {
 public:
  using Corners = Mat<Dim>;  ///< corners of a facet as columns, from the origin
  struct Facet {
    std::array<int, Dim> vertices;
    double pressure;
  };
  struct CurvedFacet {
    std::array<int, kQuadraticNodes<Dim - 1>> nodes;
    CurvedEdges curved;
    double pressure;
  };

  explicit ConeSum(bool axisymmetric) : axisymmetric_(axisymmetric) {}
  void add(const typename CellSet<Dim>::BoundaryFacet& facet, double pressure) {
    if (facet.curved || axisymmetric_)
      curves_.push_back({facet.nodes(), facet.curved, pressure});
    else
      facets_.push_back({facet.vertices, pressure});
  }
  /// Sets the fixed point: less is rounded off where it is near the facets.
  void set_origin(const Vec<Dim>& origin) { origin_ = origin; }
  bool empty() const { return facets_.empty() && curves_.empty(); }
  std::size_t size() const { return facets_.size() + curves_.size(); }
  const std::vector<Facet>& facets() const { return facets_; }  ///< straight ones, unless they are turned

  /// `sum` plus the volumes times their pressures.
  double add_value(ConstVectorView x, double sum) const;
  void add_gradient(ConstVectorView x, double scale, VectorView gradient) const;
  void add_hessian(ConstVectorView x, double scale, PsdProjection psd, HessianSink& sink) const;

  Corners corners(const Facet& facet, ConstVectorView x) const {
    Corners p;
    for (int k = 0; k < Dim; ++k) p.col(k) = x.segment<Dim>(Dim * facet.vertices[k]) - origin_;
    return p;
  }
  /// f(facet, pressure times the point's share, weights of its nodes, corners of the cone) at points of all curved facets,
  /// unless they are turned.
  template <typename F>
  void for_each_cone(ConstVectorView x, const F& f) const {
    if (axisymmetric_) return;
    constexpr int kDegree = Dim == 2 ? 3 : 4;  // of det(x, t1, t2), and of a shape function times the normal
    for (const CurvedFacet& facet : curves_) {
      auto nodes = at_nodes<Dim>(facet.nodes, x);
      nodes.colwise() -= origin_;
      for (const auto& point : quadrature<Dim - 1>(kDegree)) {
        const CornerWeights<Dim> weights = corner_weights<Dim>(facet.curved, point.weights);
        f(facet, facet.pressure * point.fraction, weights, Corners(nodes * weights));
      }
    }
  }
  /// f(facet, pressure times the point's share, what is turned there) at points of all facets of an axisymmetric mesh.
  template <typename F>
  void for_each_turned(ConstVectorView x, const F& f) const {
    if constexpr (Dim == 2) {
      constexpr int kDegree = 5;  // of r^2 dz
      if (!axisymmetric_) return;
      for (const CurvedFacet& facet : curves_)
        for (const auto& point : quadrature<1>(kDegree))
          f(facet, facet.pressure * point.fraction, TurnedPoint(facet.curved, point.weights, at_nodes<2>(facet.nodes, x)));
    }
  }

 private:
  bool axisymmetric_;
  std::vector<Facet> facets_;
  std::vector<CurvedFacet> curves_;
  Vec<Dim> origin_ = Vec<Dim>::Zero();
};

}  // namespace itr
