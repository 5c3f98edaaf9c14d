// SPDX-License-Identifier: MIT
// Terms that the past of bodies adds to their elastic energy over a step.
#pragma once

#include <utility>
#include <vector>

#include "core/parallel_reduce.hpp"
#include "energy/cell_field.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/elastic/quadratic.hpp"
#include "energy/increment.hpp"

namespace itr {

/// scale * integral over the rest shape of a density of the displacement gradient in space, which each `Point` has:
/// density(G), stress(G) = dW/dF and hessian(G), by columns.
template <int Dim, typename Point>
class PastEnergy final : public Energy, public IncrementalTerm {
 public:
  /// Takes the points from a step, by acts_on(body), past(cells, element) and point_at(body, X, weights, past). `cells` and
  /// `step` must outlive this; `degree` is that of the quadrature where F varies in an element.
  template <typename Step>
  PastEnergy(const char* name, const CellSet<Dim>& cells, const Step& step, double scale, int degree)
      : name_(name), cells_(cells), first_{0}, scale_(scale), degree_(degree) {
    for (const auto& element : cells.elements) {
      const std::size_t count = is_constant(cells, element) ? 1 : quadrature<Dim>(degree).size();
      first_.push_back(first_.back() + (step.acts_on(element.body) ? count : 0));
    }
    points_.resize(first_.back());
    parallel_blocks(cells.elements.size(), kElements, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const auto& element = cells.elements[e];
        if (first_[e] == first_[e + 1]) continue;
        const auto past = step.past(cells, element);
        std::size_t next = first_[e];
        visit_sites(cells, element, degree, [&](const auto& site) {
          const auto& weights = site.point.weights;
          points_[next++] = step.point_at(element.body, rest_position<Dim>(cells, element, weights), weights, past);
        });
      }
    });
  }
  std::string_view name() const override { return name_; }
  double value(ConstVectorView x, Workspace&) const override { return value_of({cells_.rest, x}); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    add_gradient_of({cells_.rest, x}, gradient);
  }
  double value_at(const Increment& at, Workspace&) const override { return value_of({cells_.rest, at.base, at.d}); }
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override {
    add_gradient_of({cells_.rest, at.base, at.d}, gradient);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override {
    constexpr int kCorners = Dim * (Dim + 1);
    const std::size_t straight = cells_.straight().size();
    sink.target().template add_elements<Dim>(cells_, [&](std::size_t e, Mat<kCorners>& block) {
      Block all;
      add_block(e, x, psd, all);
      block = all.template topLeftCorner<kCorners, kCorners>();
    });
    sink.target().template add_curved_elements<Dim>(
        cells_, [&](std::size_t e, NodeSet, Block& block) { add_block(straight + e, x, psd, block); });
  }

 private:
  static constexpr std::size_t kElements = 64;  ///< of a task
  using Block = Mat<Dim * kQuadraticNodes<Dim>>;

  /// f(site, point) for the points of an element that has a past.
  template <typename F>
  void for_each_point(std::size_t e, const F& f) const {
    if (first_[e] == first_[e + 1]) return;
    std::size_t next = first_[e];
    visit_sites(cells_, cells_.elements[e], degree_, [&](const auto& site) {
      const Point& point = points_[next++];
      if (site.turn > 0) f(site, point);
    });
  }
  double value_of(const Displacement<Dim>& u) const {
    return scale_ * parallel_sum(cells_.elements.size(), kElements, [&](std::size_t begin, std::size_t end) {
             double sum = 0;
             for (std::size_t e = begin; e < end; ++e) {
               const NodalDisplacements<Dim> nodal(cells_.elements[e], u);
               for_each_point(e, [&](const auto& site, const auto& point) {
                 sum += site.weight(1) * point.density(gradient_in_space(site.displacement_gradient(nodal).G));
               });
             }
             return sum;
           });
  }
  void add_gradient_of(const Displacement<Dim>& u, VectorView gradient) const {
    const auto forces_of = [&](std::size_t e) -> Nodal<Dim> {
      const NodalDisplacements<Dim> nodal(cells_.elements[e], u);
      Nodal<Dim> forces = Nodal<Dim>::Zero();
      for_each_point(e, [&](const auto& site, const auto& point) {
        const auto G = site.displacement_gradient(nodal).G;
        constexpr int kLaw = decltype(G)::RowsAtCompileTime;
        const Mat<3> P = point.stress(gradient_in_space(G));
        site.add_forces(site.weight(scale_), Mat<kLaw>(P.template topLeftCorner<kLaw, kLaw>()), forces);
      });
      return forces;
    };
    const std::size_t count = cells_.elements.size();
    parallel_then_ordered<Nodal<Dim>>(count, kElements, forces_of, [&](std::size_t e, const Nodal<Dim>& forces) {
      const auto& element = cells_.elements[e];
      const auto nodes = element.nodes();
      for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
        if (has_node<Dim>(element.curved, k)) gradient.segment<Dim>(Dim * nodes[k]) += forces.col(k);
    });
  }
  void add_block(std::size_t e, ConstVectorView x, PsdProjection psd, Block& block) const {
    const NodalDisplacements<Dim> nodal(cells_.elements[e], Displacement<Dim>(cells_.rest, x));
    block.setZero();
    ModalSum<Dim> modes(block);
    for_each_point(e, [&](const auto& site, const auto& point) {
      const auto G = site.displacement_gradient(nodal).G;
      constexpr int kLaw = decltype(G)::RowsAtCompileTime;
      const Mat<9> whole = point.hessian(gradient_in_space(G));
      if (whole.isZero(0)) return;
      Mat<kLaw * kLaw> hessian;
      for (int l = 0; l < kLaw * kLaw; ++l)
        for (int k = 0; k < kLaw * kLaw; ++k) hessian(k, l) = whole(k % kLaw + 3 * (k / kLaw), l % kLaw + 3 * (l / kLaw));
      modes.add(decompose<kLaw>(hessian), psd, site, site.weight(scale_));
    });
    modes.finish();
  }

  const char* name_;
  const CellSet<Dim>& cells_;
  std::vector<std::size_t> first_;  ///< points of an element begin there, those of the next one behind them
  std::vector<Point> points_;
  double scale_;
  int degree_;
};

}  // namespace itr
