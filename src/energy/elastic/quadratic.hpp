// SPDX-License-Identifier: MIT
// Elastic energy of cells with curved edges, by quadrature at rest.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
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

namespace itr {

constexpr std::size_t kCurvedBlock = 64;
constexpr double kInversionMargin = 0.9;  ///< fraction of the way to a vanishing volume that one step may go
constexpr double kLeastStep = 1e-12;
constexpr double kBlindFraction = 0.2;   ///< of det F at quadrature points: where it is less, they do not see it
constexpr double kBlindTolerance = 0.1;  ///< relative, of the bound that tells
/// Where the Jacobian varies less, det F is anywhere at least ((1 - 0.2) / (1 + 0.2))^3 of what points see, 0.29.
constexpr double kSeen = 0.2;

template <int Dim>
using Nodal = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>;

/// Displacements of the nodes from that of the first one, which derivatives do not depend on.
template <int Dim>
Nodal<Dim> relative_to_first(const typename CellSet<Dim>::Element& element, const Displacement<Dim>& u) {
  Nodal<Dim> values = Nodal<Dim>::Zero();
  const auto nodes = element.nodes();
  for (int k = 1; k < kQuadraticNodes<Dim>; ++k)
    if (has_node<Dim>(element.curved, k)) values.col(k) = u.difference(nodes[0], nodes[k]);
  return values;
}

/// Adds value * mode * mode^T over modes of the cell's forces to a block, many at a time: a product of matrices.
template <int Dim>
class ModalSum {
 public:
  static constexpr int kRows = Dim * kQuadraticNodes<Dim>;

  explicit ModalSum(Mat<kRows>& block) : block_(block) {}
  void add(double value, const Mat<Dim>& mode, const Nodal<Dim>& gradients) {
    if (value == 0) return;
    if (count_ == kBatch) flush();
    Eigen::Map<Nodal<Dim>>(modes_.col(count_).data()).noalias() = mode * gradients;
    weighted_.col(count_) = value * modes_.col(count_);
    ++count_;
  }
  /// Adds the modes of a density's Hessian at a point, `weight` times.
  void add(const EigenSystem<Dim>& system, PsdProjection psd, const Nodal<Dim>& gradients, double weight) {
    for (std::size_t k = 0; k < system.values.size(); ++k)
      add(weight * projected(system.values[k], psd), system.modes[k], gradients);
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

/// How far a step may go: not past an inversion, and not to where the least Bernstein coefficient of det F over its mean is
/// less than a tenth of that before (at most of s0).
template <int Dim>
double free_step(const typename CellSet<Dim>::Element& element, ConstVectorView x, ConstVectorView dx) {
  double t = max_positive_step<Dim>(at_all_nodes<Dim>(element, x), at_all_nodes<Dim>(element, dx));
  if (t < 1) t *= kInversionMargin;
  const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x), way = at_nodes<Dim>(element.nodes(), dx);
  const auto least = [&](double at) { return JacobianBarrier<Dim>(element, positions + at * way).least_ratio(); };
  double at_end = least(t);
  if (at_end >= JacobianBarrier<Dim>::kActive) return t;
  const double bound = (1 - kInversionMargin) * std::min(least(0), JacobianBarrier<Dim>::kActive);
  for (; bound > 0 && at_end < bound && t > kLeastStep; at_end = least(t)) t /= 2;
  return t;
}

/// scale * sum over curved elements of rest volume * (sum over points of share * W(F), plus barrier_density). Feasible: det
/// F > 0 everywhere in each cell. The energy is infinite in feasible cells, too, where the barrier cannot prove that.
template <int Dim>
class QuadraticElasticity {
 public:
  QuadraticElasticity(const CellSet<Dim>& cells, const std::map<int, Material>& materials, double scale, int degree)
      : cells_(cells), elements_(cells.curved()), first_(cells.straight().size()), degree_(degree), scale_(scale) {
    bool varies = false;
    for (const auto& [body, material] : materials) {
      varies = varies || material.has_varying_moduli();
      by_body_[body] = cell_moduli<Dim>(cells, material, Vec<Dim>::Zero());
    }
    by_element_.reserve(elements_.size());
    for (const Element& element : elements_) by_element_.push_back(&by_body_.at(element.body));
    if (!varies) return;
    materials_ = materials;
    sample_moduli();
  }

  /// `x` are the positions that `u` leads to.
  double value(const Displacement<Dim>& u, ConstVectorView x) const {
    return sum_over_cells(u, x, {}, [](const DisplacementGradient<Dim>& at, const ElasticModuli& moduli) {
      return elastic_density<Dim>(at, moduli);
    });
  }
  void add_gradient(const Displacement<Dim>& u, ConstVectorView x, const PatchPressures<Dim>& pressures,
                    VectorView gradient) const {
    const auto forces_of = [&](std::size_t e) -> Nodal<Dim> {
      const Element& element = elements_[e];
      const Nodal<Dim> displacements = relative_to_first<Dim>(element, u);
      Nodal<Dim> forces = Nodal<Dim>::Zero();
      const auto& rule = this->rule(e);
      for (std::size_t q = 0; q < rule.size(); ++q) {
        const Nodal<Dim> gradients = shape_gradients<Dim>(element, rule[q].weights);
        const DisplacementGradient<Dim> at{displacements * gradients.transpose()};
        const Mat<Dim> P = elastic_stress<Dim>(at, pressures.in(moduli(e, q), first_ + e, rule[q].weights));
        forces.noalias() += (scale_ * rule[q].fraction * element.volume) * (P * gradients);
      }
      if (const JacobianBarrier<Dim> barrier(element, at_nodes<Dim>(element.nodes(), x)); barrier.is_active())
        forces += scale_ * element.volume * stiffness_at_rest<Dim>(moduli_at_barycenter(e)) * barrier.gradient();
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
    return sum_over_cells(u, x, pressures, [](const DisplacementGradient<Dim>& at, const ElasticModuli& moduli) {
      return std::abs(elastic_density<Dim>(at, moduli)) + elastic_stress<Dim>(at, moduli).norm() * at.G.norm();
    });
  }
  void add_hessian(ConstVectorView x, const PatchPressures<Dim>& pressures, PsdProjection psd, HessianSink& sink) const {
    sink.target().add_curved_elements<Dim>(cells_, [&](std::size_t e, NodeSet nodes, Mat<Dim * kNodes>& block) {
      const Element& element = elements_[e];
      const Nodal<Dim> positions = at_nodes<Dim>(element.nodes(), x);
      const auto& rule = this->rule(e);
      block.setZero();
      ModalSum<Dim> modes(block);
      NeoHookeanSum<Dim> exact(nodes);
      const bool is_neo_hookean = by_element_[e]->law == MaterialLaw::neo_hookean;
      for (std::size_t q = 0; q < rule.size(); ++q) {
        const Nodal<Dim> gradients = shape_gradients<Dim>(element, rule[q].weights);
        const Mat<Dim> F = positions * gradients.transpose();
        const double weight = scale_ * rule[q].fraction * element.volume;
        const ElasticModuli here = pressures.in(moduli(e, q), first_ + e, rule[q].weights);
        if (!is_neo_hookean) {
          modes.add(elastic_eigensystem<Dim>(F, here), psd, gradients, weight);
          continue;
        }
        exact.add(F, gradients, here.lame, weight);
        if (psd == PsdProjection::none) continue;
        const NegativeModes<Dim> negative = neo_hookean_negative_modes<Dim>(F, here.lame);
        for (int k = 0; k < negative.count; ++k)
          modes.add(weight * (projected(negative.values[k], psd) - negative.values[k]), negative.modes[k], gradients);
      }
      modes.finish();
      if (is_neo_hookean) exact.add_to(block);
      if (const JacobianBarrier<Dim> barrier(element, positions); barrier.is_active()) {
        const double weight = scale_ * element.volume * stiffness_at_rest<Dim>(moduli_at_barycenter(e));
        Mat<Dim* kNodes> of_barrier = weight * barrier.hessian();
        project_block(of_barrier, psd);
        block += of_barrier;
      }
    });
  }
  double max_step(ConstVectorView x, ConstVectorView dx) const {
    return parallel_min(elements_.size(), kCurvedBlock, [&](std::size_t begin, std::size_t end) {
      double step = 1;
      for (const Element& element : elements_.subspan(begin, end - begin))
        step = std::min(step, free_step<Dim>(element, x, dx));
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
      const double t = free_step<Dim>(element, x, dx);
      if (t < least.step) least = {t, "cell", {element.vertices.begin(), element.vertices.end()}};
    }
  }

 private:
  using Element = typename CellSet<Dim>::Element;
  static constexpr int kNodes = kQuadraticNodes<Dim>;

  const ElasticModuli& moduli(std::size_t e, std::size_t point) const {
    return varying_.empty() ? *by_element_[e] : varying_[first_varying_[e] + point];
  }
  /// Sums share * volume * at_point(G, moduli) over all points, and the barriers.
  template <typename F>
  double sum_over_cells(const Displacement<Dim>& u, ConstVectorView x, const PatchPressures<Dim>& pressures,
                        const F& at_point) const {
    return scale_ * parallel_sum(elements_.size(), kCurvedBlock, [&](std::size_t begin, std::size_t end) {
             double sum = 0;
             for (std::size_t e = begin; e < end; ++e) {
               const Element& element = elements_[e];
               const Nodal<Dim> displacements = relative_to_first<Dim>(element, u);
               const auto& rule = this->rule(e);
               for (std::size_t q = 0; q < rule.size(); ++q) {
                 const Mat<Dim> G = displacements * shape_gradients<Dim>(element, rule[q].weights).transpose();
                 sum += rule[q].fraction * element.volume *
                        at_point(DisplacementGradient<Dim>{G}, pressures.in(moduli(e, q), first_ + e, rule[q].weights));
               }
               const JacobianBarrier<Dim> barrier(element, at_nodes<Dim>(element.nodes(), x));
               sum += element.volume * barrier_density<Dim>(barrier, moduli_at_barycenter(e));
             }
             return sum;
           });
  }
  void sample_moduli() {
    varying_.clear();
    first_varying_.clear();
    at_barycenters_.clear();
    if (materials_.empty()) return;
    for (std::size_t e = 0; e < by_element_.size(); ++e) {
      const Element& element = elements_[e];
      first_varying_.push_back(varying_.size());
      at_barycenters_.push_back(
          cell_moduli<Dim>(cells_, materials_.at(element.body), rest_barycenter<Dim>(cells_, element)));
      for (const auto& point : rule(e))
        varying_.push_back(
            cell_moduli<Dim>(cells_, materials_.at(element.body), rest_position<Dim>(cells_, element, point.weights)));
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
