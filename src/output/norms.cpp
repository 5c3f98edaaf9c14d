// SPDX-License-Identifier: MIT
// Norms of the displacement u = x - X: one centroid point a cell is what the regression scenes' reference values use
// (CONVENTIONS.md, "Norms").
#include <algorithm>
#include <cmath>

#include "itr/geometry/measures.hpp"
#include "itr/output/writer.hpp"

namespace itr::output {

template <int Dim>
DisplacementNorms displacement_norms(const Mesh<Dim>& mesh, ConstVectorView x) {
  constexpr int kExponent = 8;  // the p of `lp`
  double l2_squared = 0, h1_semi_squared = 0, lp_power = 0;
  DisplacementNorms norms;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    std::array<Vec<Dim>, Dim + 1> u;
    Vec<Dim> mean = Vec<Dim>::Zero();
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = mesh.cell(c)[k];
      u[k] = vertex_of<Dim>(x, v) - mesh.rest(v);
      mean += u[k] / (Dim + 1);
    }
    const double gradient = (edge_matrix<Dim>(u) * mesh.inverse_rest_edges(c)).norm();
    const double size = mean.norm();
    l2_squared += mesh.volume(c) * size * size;
    h1_semi_squared += mesh.volume(c) * gradient * gradient;
    lp_power += mesh.volume(c) * std::pow(size, kExponent);
    norms.linf = std::max(norms.linf, size);
    norms.linf_grad = std::max(norms.linf_grad, gradient);
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
