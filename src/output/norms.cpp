// SPDX-License-Identifier: MIT
// Norms of the displacement u = x - X: one centroid point a straight cell, quadrature of degree 2 in others is what the
// regression scenes' reference values use (docs/theory.md, "Norms").
#include <algorithm>
#include <cmath>

#include "fem/cell_set.hpp"
#include "fem/quadrature.hpp"
#include "geometry/measures.hpp"
#include "itr/output.hpp"
#include "mesh/turn.hpp"

namespace itr::output {

template <int Dim>
DisplacementNorms displacement_norms(const Mesh<Dim>& mesh, ConstVectorView x) {
  constexpr int kExponent = 8;  // the p of `lp`
  double l2_squared = 0, h1_semi_squared = 0, lp_power = 0;
  DisplacementNorms norms;
  const auto add = [&](double volume, double size, double gradient) {
    l2_squared += volume * size * size;
    h1_semi_squared += volume * gradient * gradient;
    lp_power += volume * std::pow(size, kExponent);
    norms.linf = std::max(norms.linf, size);
    norms.linf_grad = std::max(norms.linf_grad, gradient);
  };
  for (const CellId c : mesh.live_cells()) {
    const auto element = element_of(mesh, c);
    if (!element.curved) {
      std::array<Vec<Dim>, Dim + 1> u;
      Vec<Dim> mean = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) {
        u[k] = vertex_of<Dim>(x, element.vertices[k]) - mesh.rest(element.vertices[k]);
        mean += u[k] / (Dim + 1);
      }
      add(element.volume * turn_at(mesh, mesh.barycenter(c)), mean.norm(),
          (edge_matrix<Dim>(u) * element.inverse_edges).norm());
      continue;
    }
    const auto positions = at_nodes<Dim>(element.nodes(), x);
    for (const auto& point : quadrature<Dim>(kElasticDegree)) {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) X += point.weights[k] * mesh.rest(element.vertices[k]);
      const Vec<Dim> u = positions * quadratic_shapes<Dim>(element.curved, point.weights) - X;
      const Mat<Dim> F = positions * shape_gradients<Dim>(element, point.weights).transpose();
      add(point.fraction * element.volume * turn_at(mesh, X), u.norm(), (F - Mat<Dim>::Identity()).norm());
    }
  }
  norms.l2 = std::sqrt(l2_squared);
  norms.h1_semi = std::sqrt(h1_semi_squared);
  norms.h1 = std::sqrt(l2_squared + h1_semi_squared);
  norms.lp = std::pow(lp_power, 1.0 / kExponent);
  return norms;
}

template DisplacementNorms displacement_norms<2>(const Mesh<2>&, ConstVectorView);
template DisplacementNorms displacement_norms<3>(const Mesh<3>&, ConstVectorView);

}  // namespace itr::output
