// SPDX-License-Identifier: MIT
#include "viscous.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/parallel_reduce.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/elastic/strain.hpp"

namespace itr {

namespace {

using Voigt = Vec<6>;  ///< 00, 11, 22, 01, 02, 12 of a symmetric tensor
constexpr std::array<std::array<int, 2>, 6> kEntries{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
constexpr std::size_t kElements = 64;  ///< of a task

Mat<3> tensor(const Voigt& v) {
  Mat<3> A;
  for (int k = 0; k < 6; ++k) A(kEntries[k][0], kEntries[k][1]) = A(kEntries[k][1], kEntries[k][0]) = v[k];
  return A;
}
Voigt voigt(const Mat<3>& A) {
  Voigt v;
  for (int k = 0; k < 6; ++k) v[k] = (A(kEntries[k][0], kEntries[k][1]) + A(kEntries[k][1], kEntries[k][0])) / 2;
  return v;
}
double product(const Voigt& a, const Voigt& b) { return a.head<3>().dot(b.head<3>()) + 2 * a.tail<3>().dot(b.tail<3>()); }

/// M(F).
Mat<3> shape_change(ShapeMeasure measure, const Mat<3>& G) {
  if (measure == ShapeMeasure::small) return G + G.transpose();
  const Strain<3> strain(G);
  if (measure == ShapeMeasure::whole) return strain.A;
  const double change = std::expm1(-2.0 / 3 * strain.log_J);
  return strain.A + change * (strain.A + Mat<3>::Identity());
}

/// The instantaneous law's part of shape at a point: S = 2 dW/dM, W and M, of what is strain beyond the eigenstrain, by the
/// volume that is free of stress.
struct ShapeResponse {
  Voigt S, M;
  double density, volume;

  ShapeResponse(const Material& material, const Vec<3>& X, const Mat<3>& G) {
    const ShapeMeasure measure = shape_measure(material);
    const ElasticModuli grown = elastic_moduli<3>(material, X), moduli = without_growth(shape_part(grown));
    const DisplacementGradient<3> at{elastic_gradient(G, grown.growth)};
    const Mat<3> P = elastic_stress<3>(at, moduli);
    volume = volume_ratio(grown.growth);
    density = grown.growth.is_subtracted ? P.cwiseProduct(at.G).sum() / 2 : elastic_density<3>(at, moduli);
    M = voigt(shape_change(measure, at.G));
    if (measure == ShapeMeasure::small) {
      S = voigt(P);
    } else {
      const double factor = measure == ShapeMeasure::whole ? 1 : std::exp(2.0 / 3 * Strain<3>(at.G).log_J);
      S = voigt(factor * at.F().inverse() * P);
    }
  }
};

/// The stress by F of a stress by F_e, and the derivative of that.
Mat<3> grown(const Mat<3>& P, const Growth& growth) {
  return growth && !growth.is_subtracted ? Mat<3>(growth.volume * P * growth.inverse) : P;
}
Mat<9> grown(const Mat<9>& hessian, const Growth& growth) {
  if (!growth || growth.is_subtracted) return hessian;
  Mat<9> change = Mat<9>::Zero();  // of F_e by F
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) change(i + 3 * j, i + 3 * k) = growth.inverse(j, k);
  return growth.volume * change * hessian * change;
}

Growth growth_of(const Material& material, const Vec<3>& X) {
  return material.eigenstrain ? growth_at<3>(material, X) : Growth{};
}

}  // namespace

ShapeMeasure shape_measure(const Material& material) {
  if (material.law == MaterialLaw::linear) return ShapeMeasure::small;
  const bool is_isochoric = material.law == MaterialLaw::own || material.law == MaterialLaw::mooney_rivlin;
  return is_isochoric ? ShapeMeasure::isochoric : ShapeMeasure::whole;
}

double past_density(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H) {
  if (measure != ShapeMeasure::small && !(G.trace() + sum_of_minors(G) > -1)) return std::numeric_limits<double>::infinity();
  return H.cwiseProduct(shape_change(measure, G)).sum() / 2;
}

Mat<3> past_stress(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H) {
  if (measure == ShapeMeasure::small) return H;
  const Strain<3> strain(G);
  const Mat<3> N = strain.F * H;
  if (measure == ShapeMeasure::whole) return N;
  const double q = H.trace() + H.cwiseProduct(strain.A).sum();
  return std::exp(-2.0 / 3 * strain.log_J) * (N - q / 3 * strain.inverse_transpose());
}

Mat<9> past_hessian(ShapeMeasure measure, const Mat<3>& F, const Mat<3>& H) {
  Mat<9> hessian = Mat<9>::Zero();
  if (measure == ShapeMeasure::small) return hessian;
  const bool is_isochoric = measure == ShapeMeasure::isochoric;
  const Mat<3> N = F * H, L = F.inverse().transpose();
  const double q = is_isochoric ? N.cwiseProduct(F).sum() : 0;
  const double scale = is_isochoric ? std::pow(F.determinant(), -2.0 / 3) : 1;
  for (int k = 0; k < 9; ++k)
    for (int l = 0; l < 9; ++l) {
      const int i = k % 3, j = k / 3, a = l % 3, b = l / 3;
      double entry = i == a ? H(j, b) : 0;
      if (is_isochoric)
        entry +=
            q / 3 * L(i, b) * L(a, j) - 2.0 / 3 * (N(a, b) * L(i, j) + L(a, b) * N(i, j)) + 2.0 / 9 * q * L(a, b) * L(i, j);
      hessian(k, l) = scale * entry;
    }
  return hessian;
}

ViscousWeights::ViscousWeights(const PronyTerm& term, double dt) : g(term.g) {
  constexpr double kLong = 500;
  const double y = dt / term.tau;
  decay = std::exp(-y);
  if (y > kLong) {
    left = carried = 1 / y;
    relaxed = 1 - left;
    work = relaxed / y;
    stored = left / y;
  } else if (y == 0) {
    left = 1;
    relaxed = carried = 0;
    work = stored = 0.5;
  } else {
    left = -std::expm1(-y) / y;
    relaxed = minus_expm1(-y) / y;
    carried = decay * minus_expm1(y) / y;
    work = relaxed / y;
    stored = carried / y;
  }
}

template <int Dim>
ViscousStep<Dim>::ViscousStep(std::shared_ptr<const CellField<Dim>> start, const std::map<int, Material>& materials,
                              double dt)
    : start_(std::move(start)) {
  for (const auto& [body, material] : materials) {
    if (material.prony.empty()) continue;
    materials_.emplace(body, material);
    for (const PronyTerm& term : material.prony) weights_[body].emplace_back(term, dt);
  }
}

template <int Dim>
double ViscousStep<Dim>::factor(int body) const {
  double factor = 1;
  for (const ViscousWeights& w : weights_.at(body)) factor -= w.g * w.relaxed;
  return factor;
}

template <int Dim>
typename ViscousStep<Dim>::Stress ViscousStep<Dim>::past(const CellSet<Dim>& cells,
                                                         const typename CellSet<Dim>::Element& element) const {
  const Records records = start_->on(cells, element);
  Stress H = Stress::Zero();
  Eigen::Index row = ViscousRecord::kOfLaw;
  for (const ViscousWeights& w : weights_.at(element.body)) {
    H -= w.decay * records.template middleRows<6>(row) + w.g * w.carried * records.template topRows<6>();
    row += ViscousRecord::kOfTerm;
  }
  return H;
}

/// A cell after a step.
template <int Dim>
struct ViscousStep<Dim>::Cell {
  Records records;
  double dissipation = 0, loss = 0, stored_excess = 0;
};

template <int Dim>
typename ViscousStep<Dim>::Cell ViscousStep<Dim>::update(const CellSet<Dim>& cells,
                                                         const typename CellSet<Dim>::Element& element,
                                                         ConstVectorView x) const {
  VectorX variance;
  const Records before = start_->on(cells, element, &variance);
  const Material& material = materials_.at(element.body);
  const auto& weights = weights_.at(element.body);
  const NodalDisplacements<Dim> u(element, Displacement<Dim>(cells.rest, x));
  Cell cell;
  cell.records.resize(before.rows(), Dim + 1);
  int q = 0;
  double volume = 0, shear = 0;
  visit_sites(cells, element, kStateDegree, [&](const auto& site) {
    const VectorX old = before * weights_of(site.point.weights);
    const Vec<3> X = point_in_space<Dim>(rest_position<Dim>(cells, element, site.point.weights));
    const ShapeResponse law(material, X, gradient_in_space(site.displacement_gradient(u).G));
    const double weight = site.weight(1);
    auto now = cell.records.col(q++);
    const Voigt S_before = old.head<6>();
    now.template head<6>() = law.S;
    now[ViscousRecord::kDensity] = law.density;
    now[ViscousRecord::kProduct] = product(law.S, law.M) / 2;
    const double change = product(S_before, law.M) / 2 - old[ViscousRecord::kProduct];  // S : dM / 2 with the S before
    const double rest = law.density - old[ViscousRecord::kDensity] - change;
    Eigen::Index row = ViscousRecord::kOfLaw;
    double dissipation = 0, excess = 0;
    for (const ViscousWeights& w : weights) {
      const Voigt Q_before = old.segment<6>(row);
      const double energy_before = old[row + ViscousRecord::kDensity];
      const double change_by_past = w.g * change - (product(Q_before, law.M) / 2 - old[row + ViscousRecord::kProduct]);
      const Voigt Q = w.decay * Q_before + w.g * (w.carried * S_before + w.relaxed * law.S);
      const double energy = w.decay * (energy_before + change_by_past) + 2 * w.g * w.stored * rest;
      dissipation += w.left * change_by_past + 2 * w.g * w.work * rest + energy_before - energy;
      excess += energy - w.g * w.left * law.density +
                (w.decay * product(Q_before, law.M) + w.g * w.carried * product(S_before, law.M)) / 2;
      now.template segment<6>(row) = Q;
      now[row + ViscousRecord::kDensity] = energy;
      now[row + ViscousRecord::kProduct] = product(Q, law.M) / 2;
      row += ViscousRecord::kOfTerm;
    }
    cell.dissipation += weight * law.volume * dissipation;
    cell.stored_excess += weight * law.volume * excess;
    volume += weight * law.volume;
    shear = elastic_moduli<3>(material, X).lame.mu;
  });
  cell.records = at_vertices<Dim>(cell.records, q);
  Eigen::Index row = ViscousRecord::kOfLaw;
  for (const ViscousWeights& w : weights) {
    if (variance.size() > 0) {
      const Voigt squares = variance.segment<6>(row);
      cell.loss += volume * (squares.head<3>().sum() + 2 * squares.tail<3>().sum()) / (4 * shear * w.g);
    }
    row += ViscousRecord::kOfTerm;
  }
  return cell;
}

template <int Dim>
double ViscousStep<Dim>::stored_excess(const CellSet<Dim>& cells, ConstVectorView x) const {
  return parallel_sum(cells.elements.size(), kElements, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t e = begin; e < end; ++e)
      if (acts_on(cells.elements[e].body)) sum += update(cells, cells.elements[e], x).stored_excess;
    return sum;
  });
}

template <int Dim>
HistoryEnd ViscousStep<Dim>::end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const {
  return update_cells(
      mesh, t, [&](int body) { return acts_on(body); },
      [&](const CellSet<Dim>& cells, const auto& element, Records& records) -> std::array<double, 2> {
        Cell cell = update(cells, element, x);
        records = std::move(cell.records);
        return {cell.dissipation, cell.loss};
      });
}

template <int Dim>
std::shared_ptr<const CellHistory> begin_viscous(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                 ConstVectorView x, double t, bool has_relaxed) {
  using Field = CellField<Dim>;
  if (std::ranges::all_of(materials, [](const auto& entry) { return entry.second.prony.empty(); })) return nullptr;
  std::vector<typename Field::Records> at_rest;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    at_rest.push_back(Field::Records::Zero(ViscousRecord::size(materials.at(mesh.body(c))), Dim + 1));
  const double dt = has_relaxed ? std::numeric_limits<double>::infinity() : 0;
  const auto state = ViscousStep<Dim>(std::make_shared<Field>(mesh, t, at_rest), materials, dt).end(mesh, x, t).state;
  std::vector<typename Field::Records> records = std::dynamic_pointer_cast<const Field>(state)->by_cell();
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    bool is_at_rest = true;
    for_each_node(mesh, mesh.cell(c),
                  [&](int node) { is_at_rest = is_at_rest && x.segment<Dim>(Dim * node) == mesh.rest(node); });
    if (is_at_rest) records[static_cast<std::size_t>(c)] = at_rest[static_cast<std::size_t>(c)];
  }
  return std::make_shared<Field>(mesh, t, std::move(records));
}

template <int Dim>
ViscousPoint ViscousStep<Dim>::point_at(int body, const Vec<Dim>& X, const std::array<double, Dim + 1>& weights,
                                        const Stress& past) const {
  const Material& material = materials_.at(body);
  return {shape_measure(material), tensor(past * weights_of(weights)), growth_of(material, point_in_space<Dim>(X))};
}

double ViscousPoint::density(const Mat<3>& G) const {
  return volume_ratio(growth) * past_density(measure, elastic_gradient(G, growth), H);
}

Mat<3> ViscousPoint::stress(const Mat<3>& G) const {
  return grown(past_stress(measure, elastic_gradient(G, growth), H), growth);
}

Mat<9> ViscousPoint::hessian(const Mat<3>& G) const {
  return grown(past_hessian(measure, elastic_gradient(G, growth) + Mat<3>::Identity(), H), growth);
}

template <int Dim>
std::pair<Mat<3>, double> past_of_state(const typename CellField<Dim>::Records& records,
                                        const std::array<double, Dim + 1>& weights, const Material& material,
                                        const Vec<3>& X, const Mat<3>& F) {
  if (records.rows() == 0) return {Mat<3>::Zero(), 0};
  const VectorX here = records * weights_of(weights);
  Voigt Q = Voigt::Zero();
  double density = 0;
  for (std::size_t i = 0; i < material.prony.size(); ++i) {
    const Eigen::Index row = ViscousRecord::kOfLaw + ViscousRecord::kOfTerm * static_cast<Eigen::Index>(i);
    Q += here.segment<6>(row);
    density += here[row + ViscousRecord::kDensity] - material.prony[i].g * here[ViscousRecord::kDensity];
  }
  const ViscousPoint point{shape_measure(material), tensor(-Q), growth_of(material, X)};
  const Mat<3> P = point.stress(F - Mat<3>::Identity());
  return {P * F.transpose() / F.determinant(), volume_ratio(point.growth) * density};
}

#define ITR_INSTANTIATE(Dim)                                                                                                \
  template class ViscousStep<Dim>;                                                                                          \
  template class PastEnergy<Dim, ViscousPoint>;                                                                             \
                                                                                                                            \
  template std::shared_ptr<const CellHistory> begin_viscous(const Mesh<Dim>&, const std::map<int, Material>&,               \
                                                            ConstVectorView, double, bool);                                 \
  template std::pair<Mat<3>, double> past_of_state<Dim>(const CellField<Dim>::Records&, const std::array<double, Dim + 1>&, \
                                                        const Material&, const Vec<3>&, const Mat<3>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
