// SPDX-License-Identifier: MIT
#include "energy/elastic/elastic.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/check.hpp"
#include "core/parallel_reduce.hpp"
#include "energy/round_off.hpp"
#include "fem/displacement.hpp"
#include "fem/shared_patches.hpp"
#include "geometry/measures.hpp"
#include "patched_volume.hpp"
#include "point.hpp"
#include "quadratic.hpp"

namespace itr {

namespace {

constexpr std::size_t kBlock = 256;

struct PositionScratch {
  ScratchVector x;
};

template <int Dim>
Mat<Dim> edges_of(const typename CellSet<Dim>::Element& element, ConstVectorView x) {
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k)
    edges.col(k) = x.segment<Dim>(Dim * element.vertices[k + 1]) - x.segment<Dim>(Dim * element.vertices[0]);
  return edges;
}

template <int Dim>
DisplacementGradient<Dim> displacement_gradient(const typename CellSet<Dim>::Element& element, const Displacement<Dim>& u) {
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = u.difference(element.vertices[0], element.vertices[k + 1]);
  return {edges * element.inverse_edges};
}

/// The law in an element without curved edges.
template <int Dim>
PatchedLaw law_in(const PatchPressures<Dim>& pressures, const ElasticModuli& moduli, std::size_t e) {
  const auto* shared = SharedPatches<Dim>::of(pressures.patches);
  if (!shared) return pressures.in_straight(moduli, e);
  PatchedLaw law(moduli);
  double pressure = 0;
  for (const auto& share : shared->shares_of(e)) pressure += share.weight * pressures.values[share.patch];
  if (!shared->shares_of(e).empty()) law.set_pressure(pressure);
  return law;
}

/// Smallest root in (0, 1] of a + b t + c t^2 (+ d t^3) with a > 0; 2 if there is none.
double first_root(double a, double b, double c, double d) {
  const auto f = [&](double t) { return a + t * (b + t * (c + t * d)); };
  double knots[4] = {0, 1, 1, 1};
  int count = 1;
  const double discriminant = c * c - 3 * d * b;  // of the derivative b + 2 c t + 3 d t^2
  if (d != 0 && discriminant > 0) {
    const double q = -(c + std::copysign(std::sqrt(discriminant), c));
    double r[2] = {q / (3 * d), q != 0 ? b / q : -1};
    if (r[0] > r[1]) std::swap(r[0], r[1]);
    for (const double t : r)
      if (t > 0 && t < 1) knots[count++] = t;
  } else if (d == 0 && c != 0) {
    const double t = -b / (2 * c);
    if (t > 0 && t < 1) knots[count++] = t;
  }
  knots[count] = 1;
  for (int k = 0; k < count; ++k) {
    double low = knots[k], high = knots[k + 1];
    if (f(high) > 0) continue;
    for (int i = 0; i < 50; ++i) {
      const double middle = (low + high) / 2;
      (f(middle) > 0 ? low : high) = middle;
    }
    return low;
  }
  return 2;
}

double first_inversion(const Mat<2>& E, const Mat<2>& D) {
  const double b = E(0, 0) * D(1, 1) + D(0, 0) * E(1, 1) - E(0, 1) * D(1, 0) - D(0, 1) * E(1, 0);
  return first_root(E.determinant(), b, D.determinant(), 0);
}

double first_inversion(const Mat<3>& E, const Mat<3>& D) {
  const auto det = [](const auto& a, const auto& b, const auto& c) { return a.dot(b.cross(c)); };
  const double b = det(D.col(0), E.col(1), E.col(2)) + det(E.col(0), D.col(1), E.col(2)) + det(E.col(0), E.col(1), D.col(2));
  const double c = det(E.col(0), D.col(1), D.col(2)) + det(D.col(0), E.col(1), D.col(2)) + det(D.col(0), D.col(1), E.col(2));
  return first_root(E.determinant(), b, c, D.determinant());
}

template <int Dim>
using ShapeGradients = Eigen::Matrix<double, Dim, Dim + 1>;
template <int Dim>
using ElementBlock = Mat<Dim*(Dim + 1)>;

/// weight * d2W/dx2 in terms of h_i = F^-T grad phi_i: no decomposition is needed.
template <int Dim>
void exact_block(const DisplacementGradient<Dim>& at, const ShapeGradients<Dim>& gradients, const LameParameters& lame,
                 double weight, ElementBlock<Dim>& block) {
  const NeoHookeanPoint<Dim> point(at, lame);
  const auto stiffness = point.stiffness(weight);
  const ShapeGradients<Dim> h = point.inverse().transpose() * gradients;
  for (int j = 0; j <= Dim; ++j)
    for (int i = j; i <= Dim; ++i) {
      const double diagonal = stiffness.diagonal(gradients.col(i), gradients.col(j));
      for (int b = 0; b < Dim; ++b)
        for (int a = 0; a < Dim; ++a)
          block(Dim * i + a, Dim * j + b) = block(Dim * j + b, Dim * i + a) =
              stiffness(h.col(i), h.col(j), a, b) + (a == b ? diagonal : 0);
    }
}

/// Makes the block of a cell's Hessian from the modes of any law, projected.
template <int Dim>
void block_of_modes(const EigenSystem<Dim>& system, const ShapeGradients<Dim>& gradients, double weight, PsdProjection psd,
                    ElementBlock<Dim>& block) {
  block.setZero();
  for (std::size_t k = 0; k < system.values.size(); ++k) {
    const double value = projected(system.values[k], psd);
    if (value == 0) continue;
    Vec<Dim*(Dim + 1)> w;
    for (int v = 0; v <= Dim; ++v) w.template segment<Dim>(Dim * v) = system.modes[k] * gradients.col(v);
    block.noalias() += (weight * value) * w * w.transpose();
  }
}

/// Projects a block that has these negative modes.
template <int Dim>
void project_modes(const NegativeModes<Dim>& negative, const ShapeGradients<Dim>& gradients, double weight,
                   PsdProjection psd, ElementBlock<Dim>& block) {
  for (int k = 0; k < negative.count; ++k) {
    Vec<Dim*(Dim + 1)> w;
    for (int v = 0; v <= Dim; ++v) w.template segment<Dim>(Dim * v) = negative.modes[k] * gradients.col(v);
    block.noalias() += weight * (projected(negative.values[k], psd) - negative.values[k]) * w * w.transpose();
  }
}

}  // namespace

template <int Dim>
ElasticEnergy<Dim>::ElasticEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale,
                                  int degree)
    : cells_(cells) {
  renew(materials, scale, degree);
}

template <int Dim>
ElasticEnergy<Dim>::~ElasticEnergy() = default;

template <int Dim>
void ElasticEnergy<Dim>::renew(const std::map<int, Material>& materials, double scale, int degree) {
  scale_ = scale;
  curved_.reset();
  if (!cells_.curved().empty()) curved_ = std::make_unique<QuadraticElasticity<Dim>>(cells_, materials, scale, degree);
  patched_.reset();
  if (cells_.patches)
    patched_ = std::make_unique<PatchedVolume<Dim>>(
        cells_, materials, scale, [this](std::size_t e) -> const auto& { return curved_->rule(e); });
  by_body_.clear();
  by_element_.clear();
  bool varies = false;
  for (const auto& [body, material] : materials) {
    varies = varies || material.has_varying_moduli();
    if (!material.has_varying_moduli()) by_body_.emplace_back(body, cell_moduli<Dim>(cells_, material, Vec<Dim>::Zero()));
  }
  if (!varies) return;
  by_element_.reserve(cells_.straight().size());
  for (const auto& element : cells_.straight())
    by_element_.push_back(cell_moduli<Dim>(cells_, element, materials.at(element.body), rest_barycenter(cells_, element)));
}

template <int Dim>
const ElasticModuli& ElasticEnergy<Dim>::moduli(std::size_t e) const {
  if (!by_element_.empty()) return by_element_[e];
  const int body = cells_.elements[e].body;
  for (const auto& entry : by_body_)
    if (entry.first == body) return entry.second;
  ITR_CHECK(false, "no material for body", body);
  return by_body_.front().second;
}

template <int Dim>
template <typename F>
double ElasticEnergy<Dim>::sum_over_elements(const F& f) const {
  return scale_ * parallel_sum(cells_.straight().size(), kBlock, [&](std::size_t begin, std::size_t end) {
           double sum = 0;
           for (std::size_t e = begin; e < end; ++e) sum += f(e);
           return sum;
         });
}

template <int Dim>
double ElasticEnergy<Dim>::value_of(const Displacement<Dim>& u, ConstVectorView x) const {
  const double straight = sum_over_elements([&](std::size_t e) {
    const auto& element = cells_.elements[e];
    return element.volume * elastic_density<Dim>(displacement_gradient<Dim>(element, u), moduli(e));
  });
  const double cells = curved_ ? straight + curved_->value(u, x) : straight;
  return patched_ && std::isfinite(cells) ? cells + patched_->value(patched_->changes(u)) : cells;
}

template <int Dim>
PatchPressures<Dim> ElasticEnergy<Dim>::pressures(const Displacement<Dim>& u) const {
  return patched_ ? patched_->pressures(patched_->changes(u)) : PatchPressures<Dim>{};
}

/// Stress and displacement gradient both round: W by epsilon of itself, and by epsilon |P| |G|.
template <int Dim>
double ElasticEnergy<Dim>::round_off_of(const Displacement<Dim>& u, ConstVectorView x) const {
  const std::vector<double> changes = patched_ ? patched_->changes(u) : std::vector<double>();
  const PatchPressures<Dim> pressures = patched_ ? patched_->pressures(changes) : PatchPressures<Dim>{};
  const double straight = sum_over_elements([&](std::size_t e) {
    const auto& element = cells_.elements[e];
    const auto at = displacement_gradient<Dim>(element, u);
    const PatchedLaw here = law_in(pressures, moduli(e), e);
    return element.volume * (std::abs(elastic_density<Dim>(at, here)) + elastic_stress<Dim>(at, here).norm() * at.G.norm());
  });
  const double patches = patched_ ? std::abs(patched_->value(changes)) : 0;
  return kEpsilon * (patches + (curved_ ? straight + curved_->size_of_summands(u, x, pressures) : straight));
}

template <int Dim>
void ElasticEnergy<Dim>::add_gradient_of(const Displacement<Dim>& u, ConstVectorView x, VectorView gradient) const {
  const PatchPressures<Dim> pressures = this->pressures(u);
  const auto forces_of = [&](std::size_t e) -> Mat<Dim> {  // on all vertices but the first
    const auto& element = cells_.elements[e];
    const Mat<Dim> P = elastic_stress<Dim>(displacement_gradient<Dim>(element, u), law_in(pressures, moduli(e), e));
    return scale_ * element.volume * P * element.inverse_edges.transpose();
  };
  parallel_then_ordered<Mat<Dim>>(cells_.straight().size(), kBlock, forces_of, [&](std::size_t e, const Mat<Dim>& forces) {
    const auto& vertices = cells_.elements[e].vertices;
    for (int k = 0; k < Dim; ++k) {
      gradient.segment<Dim>(Dim * vertices[k + 1]) += forces.col(k);
      gradient.segment<Dim>(Dim * vertices[0]) -= forces.col(k);
    }
  });
  if (curved_) curved_->add_gradient(u, x, pressures, gradient);
}

template <int Dim>
double ElasticEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  return value_of({cells_.rest, x}, x);
}

template <int Dim>
void ElasticEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  add_gradient_of({cells_.rest, x}, x, gradient);
}

/// Positions round, too: that changes the value by the work of the forces.
template <int Dim>
double ElasticEnergy<Dim>::value_round_off(ConstVectorView x, Workspace& workspace) const {
  return Energy::value_round_off(x, workspace) + round_off_of({cells_.rest, x}, x);
}

template <int Dim>
ConstVectorView ElasticEnergy<Dim>::curved_positions(const Increment& at, Workspace& workspace) const {
  if (!curved_) return at.base;
  VectorView x = workspace.get<PositionScratch>().x.resize(at.d.size());
  x = at.base + at.d;
  return x;
}

template <int Dim>
double ElasticEnergy<Dim>::value_at(const Increment& at, Workspace& workspace) const {
  return value_of({cells_.rest, at.base, at.d}, curved_positions(at, workspace));
}

template <int Dim>
void ElasticEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const {
  add_gradient_of({cells_.rest, at.base, at.d}, curved_positions(at, workspace), gradient);
}

template <int Dim>
double ElasticEnergy<Dim>::value_round_off_at(const Increment& at, Workspace& workspace) const {
  return IncrementalTerm::value_round_off_at(at, workspace) +
         round_off_of({cells_.rest, at.base, at.d}, curved_positions(at, workspace));
}

template <int Dim>
void ElasticEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  const Displacement<Dim> u(cells_.rest, x);
  const std::vector<double> changes = patched_ ? patched_->changes(u) : std::vector<double>();
  const PatchPressures<Dim> pressures = patched_ ? patched_->pressures(changes) : PatchPressures<Dim>{};
  sink.target().add_elements<Dim>(cells_, [&](std::size_t e, ElementBlock<Dim>& block) {
    const auto& element = cells_.elements[e];
    const auto at = displacement_gradient<Dim>(element, u);
    const auto gradients = barycentric_gradients<Dim>(element.inverse_edges);
    const double weight = scale_ * element.volume;
    const PatchedLaw law = law_in(pressures, moduli(e), e);
    const ElasticModuli& here = law;
    if (here.is_neo_hookean()) {
      exact_block<Dim>(at, gradients, here.lame, weight, block);
      if (psd != PsdProjection::none)
        project_modes<Dim>(neo_hookean_negative_modes<Dim>(at.F(), here.lame), gradients, weight, psd, block);
    } else {
      block_of_modes<Dim>(elastic_eigensystem<Dim>(at.F(), here), gradients, weight, psd, block);
    }
  });
  if (curved_) curved_->add_hessian(x, pressures, psd, sink);
  if (patched_) patched_->add_hessian(x, changes, psd, sink);
}

template <int Dim>
double ElasticEnergy<Dim>::max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const {
  const double straight = parallel_min(cells_.straight().size(), kBlock, [&](std::size_t begin, std::size_t end) {
    double step = 1;
    for (std::size_t e = begin; e < end; ++e) {
      const auto& element = cells_.elements[e];
      const double t = first_inversion(edges_of<Dim>(element, x), edges_of<Dim>(element, dx));
      if (t <= 1) step = std::min(step, kInversionMargin * t);
    }
    return step;
  });
  return curved_ ? std::min(straight, curved_->max_step(x, dx)) : straight;
}

template <int Dim>
bool ElasticEnergy<Dim>::refine_quadrature(ConstVectorView x) {
  return curved_ && curved_->refine_quadrature(x);
}

template <int Dim>
QuadratureLevels ElasticEnergy<Dim>::quadrature_levels() const {
  return curved_ ? curved_->levels() : QuadratureLevels();
}

template <int Dim>
void ElasticEnergy<Dim>::set_quadrature_levels(const QuadratureLevels& levels) {
  if (curved_) curved_->set_levels(levels);
}

template <int Dim>
StepLimit ElasticEnergy<Dim>::step_limit(ConstVectorView x, ConstVectorView dx) const {
  StepLimit least;
  for (const auto& element : cells_.straight()) {
    const double t = kInversionMargin * first_inversion(edges_of<Dim>(element, x), edges_of<Dim>(element, dx));
    if (t < least.step) least = {t, "cell", {element.vertices.begin(), element.vertices.end()}};
  }
  if (curved_) curved_->limit_step(x, dx, least);
  return least;
}

template class ElasticEnergy<2>;
template class ElasticEnergy<3>;

}  // namespace itr
