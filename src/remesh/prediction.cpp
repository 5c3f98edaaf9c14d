// SPDX-License-Identifier: MIT
// The hat function of the new vertex m is twice the shape function of a on the child that keeps b, and twice that of b on
// the child that keeps a; each child has half the volume, and the deformation gradient of the parent.
#include "itr/remesh/prediction.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "itr/energy/elastic/neo_hookean.hpp"
#include "itr/fem/cell_set.hpp"

namespace itr {

namespace {
constexpr double kPatchOverVertex = 4;  ///< what a patch gains over its new vertex, times 1 / (1 - 2 nu)
}

double predicted_split_gain(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                            const EdgeKey& edge) {
  const auto [a, b] = edge;
  const Vec<2> middle = 0.5 * (mesh.rest(a) + mesh.rest(b));
  Vec<2> g = Vec<2>::Zero();
  Mat<2> H = Mat<2>::Zero();
  double factor = 0;
  for (const CellId c : mesh.cells_of(a)) {
    const auto& cell = mesh.cell(c);
    int at_a = kNone, at_b = kNone;
    for (int k = 0; k < 3; ++k) (cell[k] == a ? at_a : cell[k] == b ? at_b : k) = k;
    if (at_b == kNone) continue;
    const double V = mesh.volume(c);
    const Material& material = context.materials.at(mesh.body(c));
    const LameParameters lame{material.lame_mu(), material.lame_lambda(2)};
    factor = std::max(factor, kPatchOverVertex / (1 - 2 * material.poisson_ratio));
    const CellSet<2>::Element element{cell, mesh.body(c), V, mesh.inverse_rest_edges(c)};
    const Mat<2> F = deformation_gradient<2>(element, fields.x), P = neo_hookean_stress<2>(F, lame);
    const Mat<2> inverse_transposed = F.inverse().transpose();
    const double c_plus_lambda = lame.mu - lame.lambda * std::log(F.determinant()) + lame.lambda;
    for (const int k : {at_a, at_b}) {
      const Vec<2> gradient = k == 0 ? Vec<2>(-element.inverse_edges.colwise().sum().transpose())
                                     : Vec<2>(element.inverse_edges.row(k - 1).transpose());
      const Vec<2> h = inverse_transposed * gradient;
      g += context.scaling * V * P * gradient;
      H += context.scaling * 2 * V *
           (lame.mu * gradient.squaredNorm() * Mat<2>::Identity() + c_plus_lambda * h * h.transpose());
    }
    if (context.has_inertia) {
      const auto off = [&](int v) { return Vec<2>(fields.x.segment<2>(2 * v) - fields.predictor.segment<2>(2 * v)); };
      const int opposite = cell[3 - at_a - at_b];
      const double mass = material.density * V / 24;  // of one child, over (d + 1)(d + 2)
      g += mass * (3 * (off(a) + off(b)) + 2 * off(opposite));
      H += 4 * mass * Mat<2>::Identity();
    }
    if (context.loads.acceleration) g -= context.scaling * material.density * V / 3 * context.loads.acceleration(middle);
  }
  if (const FacetId f = mesh.find_facet({a, b}); f != kNone)
    for (const auto& [tag, traction] : context.loads.tractions)
      if (tag == mesh.facet_tag(f)) g -= context.scaling * (mesh.rest(b) - mesh.rest(a)).norm() / 2 * traction(middle);
  const Eigen::LLT<Mat<2>> llt(H);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  return factor * 0.5 * g.dot(llt.solve(g));
}

}  // namespace itr
