// SPDX-License-Identifier: MIT
// The hat function of the new vertex m is twice the shape function of a on the child that keeps b, and twice that of b on
// the child that keeps a; each child has half the volume, and the deformation gradient of the parent.
#include "prediction.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "itr/energy/elastic/laws.hpp"
#include "itr/fem/cell_set.hpp"

namespace itr {

namespace {
/// d2W/dF2 applied to motions of one vertex: the matrix of v -> v . d2W : (v x gradient).
class DirectionalStiffness {
 public:
  DirectionalStiffness(const Mat<2>& F, const ElasticModuli& moduli) : moduli_(moduli) {
    if (moduli.law != MaterialLaw::neo_hookean) {
      system_ = elastic_eigensystem<2>(F, moduli);
      return;
    }
    inverse_transposed_ = F.inverse().transpose();
    factor_ = moduli.lame.mu - moduli.lame.lambda * std::log(F.determinant()) + moduli.lame.lambda;
  }
  Mat<2> operator()(const Vec<2>& gradient) const {
    if (moduli_.law == MaterialLaw::neo_hookean) {
      const Vec<2> h = inverse_transposed_ * gradient;
      return moduli_.lame.mu * gradient.squaredNorm() * Mat<2>::Identity() + factor_ * h * h.transpose();
    }
    Mat<2> sum = Mat<2>::Zero();
    for (std::size_t k = 0; k < system_.values.size(); ++k) {
      const Vec<2> w = system_.modes[k] * gradient;
      sum += system_.values[k] * w * w.transpose();
    }
    return sum;
  }

 private:
  const ElasticModuli& moduli_;
  EigenSystem<2> system_;
  Mat<2> inverse_transposed_;
  double factor_ = 0;
};
}  // namespace

SplitPrediction predict_split(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
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
    const Vec<2> barycenter = (mesh.rest(cell[0]) + mesh.rest(cell[1]) + mesh.rest(cell[2])) / 3;
    const ElasticModuli moduli = elastic_moduli<2>(material, barycenter);
    factor = std::max(factor, patch_over_vertex(material.poisson_ratio));
    const CellSet<2>::Element element{cell, mesh.body(c), V, mesh.inverse_rest_edges(c)};
    const Mat<2> F = deformation_gradient<2>(element, fields.x), P = elastic_stress<2>(F, moduli);
    const DirectionalStiffness stiffness(F, moduli);
    for (const int k : {at_a, at_b}) {
      const Vec<2> gradient = k == 0 ? Vec<2>(-element.inverse_edges.colwise().sum().transpose())
                                     : Vec<2>(element.inverse_edges.row(k - 1).transpose());
      g += context.scaling * V * P * gradient;
      H += context.scaling * 2 * V * stiffness(gradient);
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
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  const double of_vertex = llt.info() == Eigen::Success ? 0.5 * g.dot(llt.solve(g)) : kUnknown;
  return {of_vertex, factor * of_vertex};
}

}  // namespace itr
