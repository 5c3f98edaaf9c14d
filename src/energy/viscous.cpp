// SPDX-License-Identifier: MIT
#include "viscous.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/parallel_reduce.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/elastic/quadratic.hpp"
#include "energy/elastic/strain.hpp"
#include "energy/elastic/turned.hpp"
#include "fem/quadrature.hpp"

namespace itr {

namespace {

using Voigt = Vec<6>;  ///< 00, 11, 22, 01, 02, 12 of a symmetric tensor
constexpr std::array<std::array<int, 2>, 6> kEntries{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
constexpr std::size_t kElements = 64;  ///< of a task
constexpr int kStateDegree = 2, kSampleDegree = 4;

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

template <int LawDim>
Mat<3> in_space(const Mat<LawDim>& G) {
  Mat<3> all = Mat<3>::Zero();
  all.template topLeftCorner<LawDim, LawDim>() = G;
  return all;
}

/// M(F).
Mat<3> shape_change(ShapeMeasure measure, const Mat<3>& G) {
  if (measure == ShapeMeasure::small) return G + G.transpose();
  const Strain<3> strain(G);
  if (measure == ShapeMeasure::whole) return strain.A;
  const double change = std::expm1(-2.0 / 3 * strain.log_J);
  return strain.A + change * (strain.A + Mat<3>::Identity());
}

/// The instantaneous law's part of shape at a point: S = 2 dW/dM, W and M.
struct ShapeResponse {
  Voigt S, M;
  double density;

  ShapeResponse(const Material& material, const Vec<3>& X, const Mat<3>& G) {
    const ShapeMeasure measure = shape_measure(material);
    const ElasticModuli moduli = shape_part(elastic_moduli<3>(material, X));
    const DisplacementGradient<3> at{G};
    density = elastic_density<3>(at, moduli);
    const Mat<3> P = elastic_stress<3>(at, moduli);
    M = voigt(shape_change(measure, G));
    if (measure == ShapeMeasure::small) {
      S = voigt(P);
    } else {
      const double factor = measure == ShapeMeasure::whole ? 1 : std::exp(2.0 / 3 * Strain<3>(G).log_J);
      S = voigt(factor * at.F().inverse() * P);
    }
  }
};

template <int Dim>
Vec<3> point_in_space(const Vec<Dim>& X) {
  Vec<3> all = Vec<3>::Zero();
  all.template head<Dim>() = X;
  return all;
}

template <int Dim>
bool is_constant(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) {
  return element.curved == 0 && !cells.axisymmetric;
}

/// f(site) for the points of an element by a rule, or for its barycenter where F is the same everywhere.
template <int Dim, typename F>
void visit_sites(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, int degree, const F& f) {
  const auto& rule = quadrature<Dim>(is_constant(cells, element) ? 1 : degree);
  for (const auto& point : rule) {
    if constexpr (Dim == 2)
      if (cells.axisymmetric) {
        f(ElasticSite<2, 3>(cells, element, point));
        continue;
      }
    f(ElasticSite<Dim, Dim>(cells, element, point));
  }
}

template <int Columns>
auto weights_of(const std::array<double, Columns>& weights) {
  return Eigen::Map<const Vec<Columns>>(weights.data());
}

/// Values at the vertices of the function that is linear on a cell and has these values at the points of the rule of degree
/// 2: of each point one weight is larger than the others.
template <int Dim>
typename ViscousField<Dim>::Records at_vertices(const typename ViscousField<Dim>::Records& at_points) {
  const auto& rule = quadrature<Dim>(kStateDegree);
  Mat<Dim + 1> weights;
  for (int q = 0; q <= Dim; ++q) weights.col(q) = weights_of<Dim + 1>(rule[static_cast<std::size_t>(q)].weights);
  return at_points * weights.inverse();
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

template <int Dim>
ViscousField<Dim>::ViscousField(const Mesh<Dim>& mesh, double t, std::vector<Records> by_cell)
    : rest_(mesh.rest().begin(), mesh.rest().begin() + mesh.num_vertices()), t_(t), by_cell_(std::move(by_cell)) {
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    cells_.push_back(mesh.cell(c));
    body_.push_back(mesh.body(c));
  }
}

/// Whether an element is a cell of the field's mesh.
template <int Dim>
bool ViscousField<Dim>::has(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const {
  if (element.cell < 0 || element.cell >= static_cast<int>(cells_.size()) || body_[element.cell] != element.body)
    return false;
  for (int k = 0; k <= Dim; ++k)
    if (rest_[cells_[element.cell][k]] != cells.rest[element.vertices[k]]) return false;
  return true;
}

template <int Dim>
const Locator<Dim>& ViscousField<Dim>::locator() const {
  std::call_once(once_, [this] { locator_ = std::make_unique<Locator<Dim>>(Mesh<Dim>(rest_, cells_, body_)); });
  return *locator_;
}

template <int Dim>
std::array<double, Dim + 1> ViscousField<Dim>::weights_in(CellId c, const Vec<Dim>& X) const {
  const auto& vertices = cells_[c];
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = rest_[vertices[k + 1]] - rest_[vertices[0]];
  return barycentric_weights<Dim>(rest_[vertices[0]], Mat<Dim>(edges.inverse()), X);
}

template <int Dim>
typename ViscousField<Dim>::Records ViscousField<Dim>::on(const CellSet<Dim>& cells,
                                                          const typename CellSet<Dim>::Element& element,
                                                          VectorX* variance) const {
  if (has(cells, element)) return by_cell_[element.cell];
  const auto& rule = quadrature<Dim>(kSampleDegree);
  std::vector<CellId> found;
  for (const auto& point : rule)
    found.push_back(locator().find(rest_position<Dim>(cells, element, point.weights), element.body).cell);
  Records records;
  if (std::ranges::all_of(found, [&](CellId c) { return c == found[0]; })) {
    const Records& whole = by_cell_[found[0]];
    records.resize(whole.rows(), Dim + 1);
    for (int k = 0; k <= Dim; ++k)
      records.col(k) = whole * weights_of<Dim + 1>(weights_in(found[0], cells.rest[element.vertices[k]]));
    return records;
  }
  Records moments = Records::Zero(by_cell_[found[0]].rows(), Dim + 1);
  MatrixX values(moments.rows(), static_cast<Eigen::Index>(rule.size()));
  for (std::size_t q = 0; q < rule.size(); ++q) {
    const Vec<Dim> X = rest_position<Dim>(cells, element, rule[q].weights);
    const auto column = static_cast<Eigen::Index>(q);
    values.col(column) = by_cell_[found[q]] * weights_of<Dim + 1>(weights_in(found[q], X));
    moments += rule[q].fraction * values.col(column) * weights_of<Dim + 1>(rule[q].weights).transpose();
  }
  const VectorX mean = moments.rowwise().sum();
  if (is_constant(cells, element))
    records = mean.replicate(1, Dim + 1);
  else  // by the mass matrix of linear functions, (1 + delta) / ((d + 1) (d + 2))
    records = (Dim + 1) * (Dim + 2) * (moments - (mean / (Dim + 2)).replicate(1, Dim + 1));
  if (!variance) return records;
  if (variance->size() == 0) variance->setZero(mean.size());
  for (std::size_t q = 0; q < rule.size(); ++q)
    *variance += rule[q].fraction *
                 (values.col(static_cast<Eigen::Index>(q)) - records * weights_of<Dim + 1>(rule[q].weights)).cwiseAbs2();
  return records;
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
ViscousStep<Dim>::ViscousStep(std::shared_ptr<const ViscousField<Dim>> start, const std::map<int, Material>& materials,
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
  using Field = ViscousField<Dim>;
  const Records records = start_->on(cells, element);
  Stress H = Stress::Zero();
  Eigen::Index row = Field::kOfLaw;
  for (const ViscousWeights& w : weights_.at(element.body)) {
    H -= w.decay * records.template middleRows<6>(row) + w.g * w.carried * records.template topRows<6>();
    row += Field::kOfTerm;
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
  using Field = ViscousField<Dim>;
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
    const VectorX old = before * weights_of<Dim + 1>(site.point.weights);
    const Vec<3> X = point_in_space<Dim>(rest_position<Dim>(cells, element, site.point.weights));
    const ShapeResponse law(material, X, in_space(site.displacement_gradient(u).G));
    const double weight = site.weight(1);
    auto now = cell.records.col(q++);
    const Voigt S_before = old.head<6>();
    now.template head<6>() = law.S;
    now[Field::kDensity] = law.density;
    now[Field::kProduct] = product(law.S, law.M) / 2;
    const double change = product(S_before, law.M) / 2 - old[Field::kProduct];  // S : dM / 2 with the S before
    const double rest = law.density - old[Field::kDensity] - change;
    Eigen::Index row = Field::kOfLaw;
    double dissipation = 0, excess = 0;
    for (const ViscousWeights& w : weights) {
      const Voigt Q_before = old.segment<6>(row);
      const double energy_before = old[row + Field::kDensity];
      const double change_by_past = w.g * change - (product(Q_before, law.M) / 2 - old[row + Field::kProduct]);
      const Voigt Q = w.decay * Q_before + w.g * (w.carried * S_before + w.relaxed * law.S);
      const double energy = w.decay * (energy_before + change_by_past) + 2 * w.g * w.stored * rest;
      dissipation += w.left * change_by_past + 2 * w.g * w.work * rest + energy_before - energy;
      excess += energy - w.g * w.left * law.density +
                (w.decay * product(Q_before, law.M) + w.g * w.carried * product(S_before, law.M)) / 2;
      now.template segment<6>(row) = Q;
      now[row + Field::kDensity] = energy;
      now[row + Field::kProduct] = product(Q, law.M) / 2;
      row += Field::kOfTerm;
    }
    cell.dissipation += weight * dissipation;
    cell.stored_excess += weight * excess;
    volume += weight;
    shear = elastic_moduli<3>(material, X).lame.mu;
  });
  cell.records = q == 1 ? Records(cell.records.col(0).replicate(1, Dim + 1)) : at_vertices<Dim>(cell.records);
  Eigen::Index row = Field::kOfLaw;
  for (const ViscousWeights& w : weights) {
    if (variance.size() > 0) {
      const Voigt squares = variance.segment<6>(row);
      cell.loss += volume * (squares.head<3>().sum() + 2 * squares.tail<3>().sum()) / (4 * shear * w.g);
    }
    row += Field::kOfTerm;
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
typename ViscousStep<Dim>::End ViscousStep<Dim>::end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  std::vector<Records> by_cell(cells.elements.size());
  std::vector<std::array<double, 2>> lost(cells.elements.size());
  parallel_blocks(cells.elements.size(), kElements, [&](std::size_t first, std::size_t last) {
    for (std::size_t e = first; e < last; ++e) {
      const auto& element = cells.elements[e];
      if (!acts_on(element.body)) continue;
      Cell cell = update(cells, element, x);
      lost[e] = {cell.dissipation, cell.loss};
      by_cell[static_cast<std::size_t>(element.cell)] = std::move(cell.records);
    }
  });
  End end;
  for (const auto& [dissipation, loss] : lost) {
    end.dissipation += dissipation;
    end.loss += loss;
  }
  end.state = std::make_shared<ViscousField<Dim>>(mesh, t, std::move(by_cell));
  return end;
}

template <int Dim>
std::shared_ptr<const ViscousHistory> begin_viscous(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                    ConstVectorView x, double t, bool has_relaxed) {
  using Field = ViscousField<Dim>;
  if (std::ranges::all_of(materials, [](const auto& entry) { return entry.second.prony.empty(); })) return nullptr;
  std::vector<typename Field::Records> at_rest;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    const auto terms = static_cast<Eigen::Index>(materials.at(mesh.body(c)).prony.size());
    at_rest.push_back(Field::Records::Zero(terms == 0 ? 0 : Field::kOfLaw + Field::kOfTerm * terms, Dim + 1));
  }
  const double dt = has_relaxed ? std::numeric_limits<double>::infinity() : 0;
  return ViscousStep<Dim>(std::make_shared<Field>(mesh, t, std::move(at_rest)), materials, dt).end(mesh, x, t).state;
}

template <int Dim>
ViscousEnergy<Dim>::ViscousEnergy(const CellSet<Dim>& cells, std::shared_ptr<const ViscousStep<Dim>> step, double scale,
                                  int degree)
    : cells_(cells),
      step_(std::move(step)),
      past_(cells.elements.size()),
      scale_(scale),
      degree_(degree_with_turn(degree, cells.axisymmetric)) {
  parallel_blocks(past_.size(), kElements, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e)
      if (step_->acts_on(cells_.elements[e].body))
        past_[e] = step_->past(cells_, cells_.elements[e]);
      else
        past_[e].setZero();
  });
}

/// f(site, measure, H) for the points of a viscoelastic element.
template <int Dim>
template <typename F>
void ViscousEnergy<Dim>::for_each_site(std::size_t e, const F& f) const {
  const auto& element = cells_.elements[e];
  if (!step_->acts_on(element.body)) return;
  const ShapeMeasure measure = step_->measure(element.body);
  visit_sites(cells_, element, degree_, [&](const auto& site) {
    if (site.turn > 0) f(site, measure, tensor(past_[e] * weights_of<Dim + 1>(site.point.weights)));
  });
}

template <int Dim>
double ViscousEnergy<Dim>::value_of(const Displacement<Dim>& u) const {
  return scale_ * parallel_sum(past_.size(), kElements, [&](std::size_t begin, std::size_t end) {
           double sum = 0;
           for (std::size_t e = begin; e < end; ++e) {
             const NodalDisplacements<Dim> nodal(cells_.elements[e], u);
             for_each_site(e, [&](const auto& site, ShapeMeasure measure, const Mat<3>& H) {
               sum += site.weight(1) * past_density(measure, in_space(site.displacement_gradient(nodal).G), H);
             });
           }
           return sum;
         });
}

template <int Dim>
void ViscousEnergy<Dim>::add_gradient_of(const Displacement<Dim>& u, VectorView gradient) const {
  const auto forces_of = [&](std::size_t e) -> Nodal<Dim> {
    const NodalDisplacements<Dim> nodal(cells_.elements[e], u);
    Nodal<Dim> forces = Nodal<Dim>::Zero();
    for_each_site(e, [&](const auto& site, ShapeMeasure measure, const Mat<3>& H) {
      const auto G = site.displacement_gradient(nodal).G;
      constexpr int kLaw = decltype(G)::RowsAtCompileTime;
      const Mat<3> P = past_stress(measure, in_space(G), H);
      site.add_forces(site.weight(scale_), Mat<kLaw>(P.topLeftCorner<kLaw, kLaw>()), forces);
    });
    return forces;
  };
  parallel_then_ordered<Nodal<Dim>>(past_.size(), kElements, forces_of, [&](std::size_t e, const Nodal<Dim>& forces) {
    const auto& element = cells_.elements[e];
    const auto nodes = element.nodes();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (has_node<Dim>(element.curved, k)) gradient.segment<Dim>(Dim * nodes[k]) += forces.col(k);
  });
}

template <int Dim>
void ViscousEnergy<Dim>::add_block(std::size_t e, ConstVectorView x, PsdProjection psd, Block& block) const {
  const NodalDisplacements<Dim> nodal(cells_.elements[e], Displacement<Dim>(cells_.rest, x));
  block.setZero();
  ModalSum<Dim> modes(block);
  for_each_site(e, [&](const auto& site, ShapeMeasure measure, const Mat<3>& H) {
    if (measure == ShapeMeasure::small) return;
    const auto G = site.displacement_gradient(nodal).G;
    constexpr int kLaw = decltype(G)::RowsAtCompileTime;
    const Mat<9> whole = past_hessian(measure, Mat<3>(in_space(G) + Mat<3>::Identity()), H);
    Mat<kLaw * kLaw> hessian;
    for (int l = 0; l < kLaw * kLaw; ++l)
      for (int k = 0; k < kLaw * kLaw; ++k) hessian(k, l) = whole(k % kLaw + 3 * (k / kLaw), l % kLaw + 3 * (l / kLaw));
    modes.add(decompose<kLaw>(hessian), psd, site, site.weight(scale_));
  });
  modes.finish();
}

template <int Dim>
double ViscousEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  return value_of({cells_.rest, x});
}

template <int Dim>
void ViscousEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  add_gradient_of({cells_.rest, x}, gradient);
}

template <int Dim>
double ViscousEnergy<Dim>::value_at(const Increment& at, Workspace&) const {
  return value_of({cells_.rest, at.base, at.d});
}

template <int Dim>
void ViscousEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const {
  add_gradient_of({cells_.rest, at.base, at.d}, gradient);
}

template <int Dim>
void ViscousEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  constexpr int kCorners = Dim * (Dim + 1);
  const std::size_t straight = cells_.straight().size();
  sink.target().add_elements<Dim>(cells_, [&](std::size_t e, Mat<kCorners>& block) {
    Block all;
    add_block(e, x, psd, all);
    block = all.template topLeftCorner<kCorners, kCorners>();
  });
  sink.target().add_curved_elements<Dim>(
      cells_, [&](std::size_t e, NodeSet, Block& block) { add_block(straight + e, x, psd, block); });
}

template <int Dim>
std::pair<Mat<3>, double> past_of_state(const typename ViscousField<Dim>::Records& records,
                                        const std::array<double, Dim + 1>& weights, const Material& material,
                                        const Mat<3>& F) {
  using Field = ViscousField<Dim>;
  if (records.rows() == 0) return {Mat<3>::Zero(), 0};
  const VectorX here = records * weights_of<Dim + 1>(weights);
  Voigt Q = Voigt::Zero();
  double density = 0;
  for (std::size_t i = 0; i < material.prony.size(); ++i) {
    const Eigen::Index row = Field::kOfLaw + Field::kOfTerm * static_cast<Eigen::Index>(i);
    Q += here.segment<6>(row);
    density += here[row + Field::kDensity] - material.prony[i].g * here[Field::kDensity];
  }
  const Mat<3> P = past_stress(shape_measure(material), Mat<3>(F - Mat<3>::Identity()), tensor(-Q));
  return {P * F.transpose() / F.determinant(), density};
}

#define ITR_INSTANTIATE(Dim)                                                                                     \
  template class ViscousField<Dim>;                                                                              \
  template class ViscousStep<Dim>;                                                                               \
  template class ViscousEnergy<Dim>;                                                                             \
  template std::shared_ptr<const ViscousHistory> begin_viscous(const Mesh<Dim>&, const std::map<int, Material>&, \
                                                               ConstVectorView, double, bool);                   \
  template std::pair<Mat<3>, double> past_of_state<Dim>(                                                         \
      const ViscousField<Dim>::Records&, const std::array<double, Dim + 1>&, const Material&, const Mat<3>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
