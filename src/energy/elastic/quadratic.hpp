// SPDX-License-Identifier: MIT
// Elastic energy of cells with curved edges, by quadrature at rest.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/parallel_reduce.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/elastic/neo_hookean.hpp"
#include "energy/energy.hpp"
#include "energy/project_block.hpp"
#include "fem/cell_set.hpp"
#include "fem/displacement.hpp"
#include "fem/quadrature.hpp"
#include "geometry/quadratic_validity.hpp"
#include "itr/types.hpp"
#include "jacobian_barrier.hpp"
#include "patched_volume.hpp"
#include "turned.hpp"

namespace itr {

constexpr std::size_t kCurvedBlock = 64;
constexpr double kInversionMargin = 0.9;  ///< fraction of the way to a vanishing volume that one step may go
constexpr double kLeastStep = 1e-12;
constexpr double kBlindFraction = 0.2;   ///< of det F at quadrature points: where it is less, they do not see it
constexpr double kBlindTolerance = 0.1;  ///< relative, of the bound that tells
/// Where the Jacobian varies less, det F is anywhere at least ((1 - 0.2) / (1 + 0.2))^3 of what points see, 0.29.
constexpr double kSeen = 0.2;

/// Adds value * mode * mode^T over modes of the cell's forces to a block, many at a time: a product of matrices.
template <int Dim>
class ModalSum {
 public:
  static constexpr int kRows = Dim * kQuadraticNodes<Dim>;

  explicit ModalSum(Mat<kRows>& block) : block_(block) {}
  template <int LawDim>
  void add(double value, const Mat<LawDim>& mode, const ElasticSite<Dim, LawDim>& site) {
    if (value == 0) return;
    if (count_ == kBatch) flush();
    Eigen::Map<Nodal<Dim>> column(modes_.col(count_).data());
    column.setZero();
    site.add_forces(1, mode, column);
    weighted_.col(count_) = value * modes_.col(count_);
    ++count_;
  }
  /// Adds the modes of a density's Hessian at a point, `weight` times.
  template <int LawDim>
  void add(const EigenSystem<LawDim>& system, PsdProjection psd, const ElasticSite<Dim, LawDim>& site, double weight) {
    for (std::size_t k = 0; k < system.values.size(); ++k)
      add(weight * projected(system.values[k], psd), system.modes[k], site);
  }
  void finish() {
    if (count_ == 0) return;
    flush();
    block_.template triangularView<Eigen::StrictlyUpper>() = block_.transpose();
  }

 private:
  static constexpr int kBatch = (Dim == 2 ? 3 : 4) * Dim * Dim;  ///< all modes of the default rule's points

  void flush() {
    block_.noalias() += weighted_.leftCols(count_) * modes_.leftCols(count_).transpose();
    count_ = 0;
  }

  Mat<kRows>& block_;
  Eigen::Matrix<double, kRows, kBatch> modes_, weighted_;
  int count_ = 0;
};

/// The sum over points of neo-Hookean Hessians, not projected: with h = F^-T grad of the shape functions, the entry of nodes
/// a, b and directions i, j is l h_ai h_bj + c h_aj h_bi + (i == j) mu grad_a . grad_b (neo_hookean.cpp). Directions are
/// kept apart, which makes columns of one node's entries.
template <int Dim>
class NeoHookeanSum {
 public:
  explicit NeoHookeanSum(NodeSet nodes) {
    for_each_node<Dim>(nodes, [&](int k) { nodes_[count_++] = k; });
    padded_ = (count_ + 3) / 4 * 4;
    for (int b = 0; b < count_; ++b) {
      std::fill_n(same_[b], padded_, 0.0);
      for (auto& pair : pairs_) std::fill_n(pair[b], padded_, 0.0);
    }
  }
  void add(const Mat<Dim>& F, const Nodal<Dim>& gradients, const LameParameters& lame, double weight) {
    const double J = F.determinant(), pJ = lame.pressure * J;
    const double c = weight * (lame.mu - lame.lambda * std::log(J) - pJ);
    const double lambda = weight * (lame.lambda + pJ), mu = weight * lame.mu;
    const Nodal<Dim> transformed = F.inverse().transpose() * gradients;
    double h[Dim][kPadded] = {}, g[Dim][kPadded] = {};
    for (int i = 0; i < Dim; ++i)
      for (int a = 0; a < count_; ++a) h[i][a] = transformed(i, nodes_[a]), g[i][a] = gradients(i, nodes_[a]);
    for (int b = 0; b < count_; ++b) {
      int pair = 0;
      for (int i = 0; i < Dim; ++i) {
        add_column(mu * g[i][b], g[i], same_[b]);
        add_column((lambda + c) * h[i][b], h[i], pairs_[pair++][b]);
        for (int j = i + 1; j < Dim; ++j, ++pair) {
          add_column(lambda * h[j][b], h[i], pairs_[pair][b]);
          add_column(c * h[i][b], h[j], pairs_[pair][b]);
        }
      }
    }
  }

  void add_to(Mat<Dim * kQuadraticNodes<Dim>>& block) const {
    for (int b = 0; b < count_; ++b)
      for (int a = 0; a < count_; ++a)
        for (int i = 0, pair = 0; i < Dim; ++i) {
          const int low = std::min(a, b), high = std::max(a, b);  // the two halves have the same bits
          const int row = Dim * nodes_[a], column = Dim * nodes_[b];
          block(row + i, column + i) += same_[low][high] + pairs_[pair++][low][high];
          for (int j = i + 1; j < Dim; ++j, ++pair) {
            block(row + i, column + j) += pairs_[pair][b][a];
            block(column + j, row + i) += pairs_[pair][b][a];
          }
        }
  }

 private:
  static constexpr int kNodes = kQuadraticNodes<Dim>, kPadded = (kNodes + 3) / 4 * 4;

  void add_column(double factor, const double* values, double* sum) const {
    for (int first = 0; first < padded_; first += 4)
      for (int a = first; a < first + 4; ++a) sum[a] += factor * values[a];
  }

  int nodes_[kNodes];  ///< of the cell; the others have no entries
  int count_ = 0, padded_ = 0;
  double same_[kNodes][kPadded];                        ///< of mu, for i == j
  double pairs_[Dim * (Dim + 1) / 2][kNodes][kPadded];  ///< of i <= j; columns of b
};

/// How far a step may go: not past an inversion or the axis, and not to where the least Bernstein coefficient of det F over
/// its mean is less than a tenth of that before (at most of s0).
template <int Dim>
double free_step(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, ConstVectorView x,
                 ConstVectorView dx) {
  double t = max_positive_step<Dim>(at_all_nodes<Dim>(element, x), at_all_nodes<Dim>(element, dx));
  if (t < 1) t *= kInversionMargin;
  const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x), way = at_nodes<Dim>(element.nodes(), dx);
  if constexpr (Dim == 2)
    if (cells.axisymmetric) t = std::min(t, HoopBarrier(cells, element).free_step(positions, way, kInversionMargin));
  const auto least = [&](double at) { return JacobianBarrier<Dim>(element, positions + at * way).least_ratio(); };
  double at_end = least(t);
  if (at_end >= JacobianBarrier<Dim>::kActive) return t;
  const double bound = (1 - kInversionMargin) * std::min(least(0), JacobianBarrier<Dim>::kActive);
  for (; bound > 0 && at_end < bound && t > kLeastStep; at_end = least(t)) t /= 2;
  return t;
}

/// scale * sum over curved elements of rest volume * (sum over points of share * W(F), plus the barriers), with the turn
/// where they are turned. Feasible: det F > 0 everywhere in each cell, and a positive hoop stretch. The energy is infinite
/// in feasible cells, too, where the barriers cannot prove that.
template <int Dim>
class QuadraticElasticity {
 public:
  QuadraticElasticity(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale, int degree)
      : cells_(cells),
        elements_(cells.curved()),
        first_(cells.straight().size()),
        degree_(degree_with_turn(degree, cells.axisymmetric)),
        scale_(scale) {
    bool varies = false;
    for (const auto& [body, material] : materials) {
      varies = varies || material.has_varying_moduli();
      by_body_[body] = cell_moduli<Dim>(cells_, material, Vec<Dim>::Zero());
    }
    by_element_.reserve(elements_.size());
    for (const Element& element : elements_) by_element_.push_back(&by_body_.at(element.body));
    if (!varies) return;
    materials_ = materials;
    sample_moduli();
  }

  /// `x` are the positions that `u` leads to.
  double value(const Displacement<Dim>& u, ConstVectorView x) const {
    return sum_over_cells(u, x, {}, [](const auto& at, const ElasticModuli& moduli) { return elastic_density(at, moduli); });
  }
  void add_gradient(const Displacement<Dim>& u, ConstVectorView x, const PatchPressures<Dim>& pressures,
                    VectorView gradient) const {
    const auto forces_of = [&](std::size_t e) -> Nodal<Dim> {
      const Element& element = elements_[e];
      const NodalDisplacements<Dim> displacements(element, u);
      Nodal<Dim> forces = Nodal<Dim>::Zero();
      for_each_site(e, [&](std::size_t q, const auto& site) {
        const auto P = elastic_stress(site.displacement_gradient(displacements), law(e, q, site, pressures));
        site.add_forces(site.weight(scale_), P, forces);
      });
      const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x);
      if (const JacobianBarrier<Dim> barrier(element, positions); barrier.is_active())
        forces += barrier_weight(e) * barrier.gradient();
      if constexpr (Dim == 2)
        if (cells_.axisymmetric)
          if (const HoopBarrier barrier(cells_, element); barrier.is_active(positions))
            barrier.add_gradient(positions, barrier_weight(e), forces);
      return forces;
    };
    parallel_then_ordered<Nodal<Dim>>(elements_.size(), kCurvedBlock, forces_of,
                                      [&](std::size_t e, const Nodal<Dim>& forces) {
                                        const auto nodes = elements_[e].nodes();
                                        for (int k = 0; k < kNodes; ++k)
                                          gradient.segment<Dim>(Dim * nodes[k]) += forces.col(k);
                                      });
  }
  /// The sum of |W| + |P| |G| over points: what value() rounds.
  double size_of_summands(const Displacement<Dim>& u, ConstVectorView x, const PatchPressures<Dim>& pressures) const {
    return sum_over_cells(u, x, pressures, [](const auto& at, const ElasticModuli& moduli) {
      return std::abs(elastic_density(at, moduli)) + elastic_stress(at, moduli).norm() * at.G.norm();
    });
  }
  void add_hessian(ConstVectorView x, const PatchPressures<Dim>& pressures, PsdProjection psd, HessianSink& sink) const {
    sink.target().add_curved_elements<Dim>(cells_, [&](std::size_t e, NodeSet nodes, Mat<Dim * kNodes>& block) {
      const Nodal<Dim> positions = at_nodes<Dim>(elements_[e].nodes(), x);
      block.setZero();
      if (cells_.axisymmetric || !by_element_[e]->is_neo_hookean())
        add_modes(e, positions, pressures, psd, block);
      else
        add_neo_hookean(e, positions, pressures, psd, nodes, block);
      add_barriers(e, positions, psd, block);
    });
  }
  double max_step(ConstVectorView x, ConstVectorView dx) const {
    return parallel_min(elements_.size(), kCurvedBlock, [&](std::size_t begin, std::size_t end) {
      double step = 1;
      for (const Element& element : elements_.subspan(begin, end - begin))
        step = std::min(step, free_step<Dim>(cells_, element, x, dx));
      return step;
    });
  }
  /// See ElasticEnergy.
  bool refine_quadrature(ConstVectorView x) {
    const std::size_t n = by_element_.size();
    std::vector<char> is_to_refine(n, 0);
    parallel_blocks(n, kCurvedBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e)
        is_to_refine[e] = (levels_.empty() || levels_[e] < kMostClosedLevel) && is_blind(e, x);
    });
    if (std::find(is_to_refine.begin(), is_to_refine.end(), 1) == is_to_refine.end()) return false;
    levels_.resize(n, 0);
    for (std::size_t e = 0; e < n; ++e) levels_[e] = static_cast<std::uint8_t>(levels_[e] + is_to_refine[e]);
    sample_moduli();
    return true;
  }
  const QuadratureLevels& levels() const { return levels_; }
  const std::vector<QuadraturePoint<Dim>>& rule(std::size_t e) const {
    return cell_quadrature<Dim>(levels_.empty() ? 0 : levels_[e], degree_);
  }
  void set_levels(const QuadratureLevels& levels) {
    levels_ = levels;
    sample_moduli();
  }
  void limit_step(ConstVectorView x, ConstVectorView dx, StepLimit& least) const {
    for (const Element& element : elements_) {
      const double t = free_step<Dim>(cells_, element, x, dx);
      if (t < least.step) least = {t, "cell", {element.vertices.begin(), element.vertices.end()}};
    }
  }

 private:
  using Element = typename CellSet<Dim>::Element;
  static constexpr int kNodes = kQuadraticNodes<Dim>;

  const ElasticModuli& moduli(std::size_t e, std::size_t point) const {
    return varying_.empty() ? *by_element_[e] : varying_[first_varying_[e] + point];
  }
  template <int LawDim>
  PatchedLaw law(std::size_t e, std::size_t point, const ElasticSite<Dim, LawDim>& site,
                 const PatchPressures<Dim>& pressures) const {
    return pressures.in(moduli(e, point), first_ + e, site.point.weights);
  }
  double volume_of(const Element& element) const {
    return element.volume * cells_.turn(rest_barycenter<Dim>(cells_, element));
  }
  double barrier_stiffness(std::size_t e) const {
    return cells_.axisymmetric ? stiffness_at_rest<3>(moduli_at_barycenter(e))
                               : stiffness_at_rest<Dim>(moduli_at_barycenter(e));
  }
  double barrier_weight(std::size_t e) const { return scale_ * volume_of(elements_[e]) * barrier_stiffness(e); }
  /// f(point's number, site) for the points of a cell that have a weight.
  template <typename F>
  void for_each_site(std::size_t e, const F& f) const {
    itr::for_each_site<Dim>(cells_, elements_[e], rule(e), f);
  }
  /// Sums share * volume * at_point(G, moduli) over all points, and the barriers.
  template <typename F>
  double sum_over_cells(const Displacement<Dim>& u, ConstVectorView x, const PatchPressures<Dim>& pressures,
                        const F& at_point) const {
    return scale_ * parallel_sum(elements_.size(), kCurvedBlock, [&](std::size_t begin, std::size_t end) {
             double sum = 0;
             for (std::size_t e = begin; e < end; ++e) {
               const Element& element = elements_[e];
               const NodalDisplacements<Dim> displacements(element, u);
               for_each_site(e, [&](std::size_t q, const auto& site) {
                 sum += site.weight(1) * at_point(site.displacement_gradient(displacements), law(e, q, site, pressures));
               });
               const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x);
               double barriers = 0;
               if (const JacobianBarrier<Dim> barrier(element, positions); barrier.is_active()) barriers = barrier.value();
               if constexpr (Dim == 2)
                 if (cells_.axisymmetric) barriers += HoopBarrier(cells_, element).value(positions);
               if (barriers != 0) sum += volume_of(element) * (barrier_stiffness(e) * barriers);
             }
             return sum;
           });
  }
  void add_modes(std::size_t e, const Nodal<Dim>& positions, const PatchPressures<Dim>& pressures, PsdProjection psd,
                 Mat<Dim * kNodes>& block) const {
    ModalSum<Dim> modes(block);
    for_each_site(e, [&](std::size_t q, const auto& site) {
      const auto F = site.deformation_gradient(positions);
      modes.add(elastic_eigensystem(F, law(e, q, site, pressures)), psd, site, site.weight(scale_));
    });
    modes.finish();
  }
  void add_neo_hookean(std::size_t e, const Nodal<Dim>& positions, const PatchPressures<Dim>& pressures, PsdProjection psd,
                       NodeSet nodes, Mat<Dim * kNodes>& block) const {
    ModalSum<Dim> modes(block);
    NeoHookeanSum<Dim> exact(nodes);
    const auto& rule = this->rule(e);
    for (std::size_t q = 0; q < rule.size(); ++q) {
      const ElasticSite<Dim, Dim> site(cells_, elements_[e], rule[q]);
      const Mat<Dim> F = site.deformation_gradient(positions);
      const double weight = site.weight(scale_);
      const PatchedLaw law = this->law(e, q, site, pressures);
      const LameParameters& lame = static_cast<const ElasticModuli&>(law).lame;
      exact.add(F, site.gradients, lame, weight);
      if (psd == PsdProjection::none) continue;
      const NegativeModes<Dim> negative = neo_hookean_negative_modes<Dim>(F, lame);
      for (int k = 0; k < negative.count; ++k)
        modes.add(weight * (projected(negative.values[k], psd) - negative.values[k]), negative.modes[k], site);
    }
    modes.finish();
    exact.add_to(block);
  }
  void add_barriers(std::size_t e, const Nodal<Dim>& positions, PsdProjection psd, Mat<Dim * kNodes>& block) const {
    std::optional<Mat<Dim * kNodes>> of_barriers;
    if (const JacobianBarrier<Dim> barrier(elements_[e], positions); barrier.is_active()) of_barriers = barrier.hessian();
    if constexpr (Dim == 2)
      if (cells_.axisymmetric)
        if (const HoopBarrier hoop(cells_, elements_[e]); hoop.is_active(positions)) {
          if (!of_barriers) of_barriers = Mat<Dim * kNodes>::Zero();
          hoop.add_hessian(positions, *of_barriers);
        }
    if (!of_barriers) return;
    *of_barriers *= barrier_weight(e);
    project_block(*of_barriers, psd);
    block += *of_barriers;
  }
  void sample_moduli() {
    varying_.clear();
    first_varying_.clear();
    at_barycenters_.clear();
    if (materials_.empty()) return;
    for (std::size_t e = 0; e < by_element_.size(); ++e) {
      const Element& element = elements_[e];
      first_varying_.push_back(varying_.size());
      const Material& material = materials_.at(element.body);
      at_barycenters_.push_back(cell_moduli<Dim>(cells_, element, material, rest_barycenter<Dim>(cells_, element)));
      for (const auto& point : rule(e))
        varying_.push_back(cell_moduli<Dim>(cells_, element, material, rest_position<Dim>(cells_, element, point.weights)));
    }
  }
  /// Whether det F is somewhere in the cell much smaller than at all of its quadrature points.
  bool is_blind(std::size_t e, ConstVectorView x) const {
    const Element& element = elements_[e];
    const QuadraticCell<Dim> all = at_all_nodes<Dim>(element, x);
    if (varies_little<Dim>(all, kSeen)) return false;
    const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x);
    double seen = std::numeric_limits<double>::infinity();
    for (const auto& point : rule(e))
      seen = std::min(seen, (positions * shape_gradients<Dim>(element, point.weights).transpose()).determinant());
    const double enough = kBlindFraction * seen / element.inverse_edges.determinant();
    return min_jacobian_bound<Dim>(all, kBlindTolerance, enough) < enough;
  }
  const ElasticModuli& moduli_at_barycenter(std::size_t e) const {
    return varying_.empty() ? *by_element_[e] : at_barycenters_[e];
  }

  const CellSet<Dim>& cells_;
  std::span<const Element> elements_;  ///< the curved ones
  std::size_t first_;                  ///< number of the first of them in the cells
  int degree_;                         ///< of level 0
  QuadratureLevels levels_;
  std::map<int, Material> materials_;  ///< empty unless moduli vary in space
  std::map<int, ElasticModuli> by_body_;
  std::vector<const ElasticModuli*> by_element_;
  std::vector<ElasticModuli> varying_;  ///< by element and point; empty unless moduli vary in space
  std::vector<ElasticModuli> at_barycenters_;
  std::vector<std::size_t> first_varying_;  ///< by element
  double scale_;
};

}  // namespace itr
