// SPDX-License-Identifier: MIT
#include "softening.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace itr {

namespace {

constexpr std::size_t kElements = 64;  ///< of a task

/// Integral of erf from 0 to z, of which no digits cancel.
double integral_of_erf(double z) { return z * std::erf(z) + std::expm1(-z * z) * std::numbers::inv_sqrtpi; }

/// The law's part of shape at a point of a body.
template <int Dim>
ElasticModuli shape_at(const Material& material, const Vec<Dim>& X) {
  return shape_part(elastic_moduli<3>(material, point_in_space<Dim>(X)));
}

double shape_density(const Mat<3>& G, const ElasticModuli& shape) {
  return elastic_density<3>(DisplacementGradient<3>{G}, shape);
}

/// The largest density at a point. Functions that are linear may be negative beyond the points that made them.
template <int Dim>
double largest_at(const typename CellField<Dim>::Records& records, const std::array<double, Dim + 1>& weights) {
  return std::max(0.0, (records * weights_of(weights)).value());
}

}  // namespace

SofteningResponse softening(const MullinsSoftening& mullins, double W, double largest) {
  const double size = mullins.m + mullins.beta * largest;
  if (!(W < largest) || !(size > 0)) return {};
  const double z = (largest - W) / size;
  return {size / mullins.r * integral_of_erf(z), -std::erf(z) / mullins.r,
          2 * std::numbers::inv_sqrtpi * std::exp(-z * z) / (mullins.r * size)};
}

LostDensity lost_density(const MullinsSoftening& mullins, double largest) {
  const double size = mullins.m + mullins.beta * largest;
  if (!(size > 0)) return {0, (mullins.beta > 0 ? mullins.beta * integral_of_erf(1 / mullins.beta) : 1) / mullins.r};
  const double z = largest / size, integral = integral_of_erf(z);
  return {size / mullins.r * integral, (mullins.beta * integral + mullins.m / size * std::erf(z)) / mullins.r};
}

template <int Dim>
SofteningStep<Dim>::SofteningStep(std::shared_ptr<const CellField<Dim>> start, const std::map<int, Material>& materials)
    : start_(std::move(start)) {
  for (const auto& [body, material] : materials)
    if (material.mullins) materials_.emplace(body, material);
}

/// A cell after a step.
template <int Dim>
struct SofteningStep<Dim>::Cell {
  Records records;
  double lost = 0, lost_before = 0, displaced = 0;
};

template <int Dim>
typename SofteningStep<Dim>::Cell SofteningStep<Dim>::update(const CellSet<Dim>& cells,
                                                             const typename CellSet<Dim>::Element& element,
                                                             ConstVectorView x) const {
  VectorX variance;
  const Records before = start_->on(cells, element, &variance);
  const Material& material = materials_.at(element.body);
  const NodalDisplacements<Dim> u(element, Displacement<Dim>(cells.rest, x));
  Cell cell;
  cell.records.resize(1, Dim + 1);
  int q = 0;
  visit_sites(cells, element, kStateDegree, [&](const auto& site) {
    const auto& weights = site.point.weights;
    const double old = largest_at<Dim>(before, weights);
    const Mat<3> G = gradient_in_space(site.displacement_gradient(u).G);
    const ElasticModuli shape = shape_at<Dim>(material, rest_position<Dim>(cells, element, weights));
    const double largest = std::max(old, shape_density(G, shape));
    const LostDensity lost_before = lost_density(*material.mullins, old);
    cell.records(0, q++) = largest;
    cell.lost += site.weight(1) * lost_density(*material.mullins, largest).value;
    cell.lost_before += site.weight(1) * lost_before.value;
    if (variance.size() > 0) cell.displaced += site.weight(1) * lost_before.slope * std::sqrt(variance[0]);
  });
  cell.records = at_vertices<Dim>(cell.records, q);
  return cell;
}

template <int Dim>
double SofteningStep<Dim>::lost(const CellSet<Dim>& cells, ConstVectorView x) const {
  return parallel_sum(cells.elements.size(), kElements, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t e = begin; e < end; ++e)
      if (acts_on(cells.elements[e].body)) sum += update(cells, cells.elements[e], x).lost;
    return sum;
  });
}

template <int Dim>
HistoryEnd SofteningStep<Dim>::end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const {
  return update_cells(
      mesh, t, [&](int body) { return acts_on(body); },
      [&](const CellSet<Dim>& cells, const auto& element, Records& records) -> std::array<double, 2> {
        Cell cell = update(cells, element, x);
        records = std::move(cell.records);
        return {cell.lost - cell.lost_before, cell.displaced};
      });
}

template <int Dim>
std::shared_ptr<const CellHistory> begin_softening(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                   ConstVectorView x, double t) {
  using Records = typename CellField<Dim>::Records;
  if (std::ranges::none_of(materials, [](const auto& entry) { return entry.second.mullins.has_value(); })) return nullptr;
  std::vector<Records> at_rest;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    at_rest.push_back(Records::Zero(materials.at(mesh.body(c)).mullins ? 1 : 0, Dim + 1));
  const auto start = std::make_shared<CellField<Dim>>(mesh, t, std::move(at_rest));
  return SofteningStep<Dim>(start, materials).end(mesh, x, t).state;
}

template <int Dim>
SofteningPoint softening_point(const Material& material, const Vec<Dim>& X, const std::array<double, Dim + 1>& weights,
                               const typename CellField<Dim>::Records& largest) {
  return {*material.mullins, shape_at<Dim>(material, X), largest_at<Dim>(largest, weights)};
}

/// Where det F <= 0 the law itself is infinite.
double SofteningPoint::density(const Mat<3>& G) const { return softening(mullins, shape_density(G, shape), largest).value; }

Mat<3> SofteningPoint::stress(const Mat<3>& G) const {
  const SofteningResponse response = softening(mullins, shape_density(G, shape), largest);
  if (response.first == 0) return Mat<3>::Zero();
  return response.first * elastic_stress<3>(DisplacementGradient<3>{G}, shape);
}

Mat<9> SofteningPoint::hessian(const Mat<3>& G) const {
  const SofteningResponse response = softening(mullins, shape_density(G, shape), largest);
  if (response.second == 0 && response.first == 0) return Mat<9>::Zero();
  const Mat<3> P = elastic_stress<3>(DisplacementGradient<3>{G}, shape);
  const EigenSystem<3> system = elastic_eigensystem<3>(DisplacementGradient<3>{G}.F(), shape);
  const Eigen::Map<const Vec<9>> p(P.data());
  Mat<9> hessian = response.second * p * p.transpose();
  for (std::size_t k = 0; k < system.values.size(); ++k) {
    const Eigen::Map<const Vec<9>> mode(system.modes[k].data());
    hessian += response.first * system.values[k] * mode * mode.transpose();
  }
  return hessian;
}

template <int Dim>
std::pair<Mat<3>, double> softening_of_state(const typename CellField<Dim>::Records& records,
                                             const std::array<double, Dim + 1>& weights, const Material& material,
                                             const Vec<Dim>& X, const Mat<3>& F) {
  if (records.rows() == 0) return {Mat<3>::Zero(), 0};
  const SofteningPoint point = softening_point<Dim>(material, X, weights, records);
  const Mat<3> G = F - Mat<3>::Identity();
  const double largest = std::max(point.largest, shape_density(G, point.shape));
  return {point.stress(G) * F.transpose() / F.determinant(), point.density(G) - lost_density(point.mullins, largest).value};
}

#define ITR_INSTANTIATE(Dim)                                                                                         \
  template class SofteningStep<Dim>;                                                                                 \
  template class PastEnergy<Dim, SofteningPoint>;                                                                    \
  template SofteningPoint softening_point<Dim>(const Material&, const Vec<Dim>&, const std::array<double, Dim + 1>&, \
                                               const typename CellField<Dim>::Records&);                             \
  template std::shared_ptr<const CellHistory> begin_softening(const Mesh<Dim>&, const std::map<int, Material>&,      \
                                                              ConstVectorView, double);                              \
  template std::pair<Mat<3>, double> softening_of_state<Dim>(const typename CellField<Dim>::Records&,                \
                                                             const std::array<double, Dim + 1>&, const Material&,    \
                                                             const Vec<Dim>&, const Mat<3>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
