// SPDX-License-Identifier: MIT
// Terms that the past of bodies adds to their elastic energy over a step.
#pragma once

#include <utility>

#include "core/parallel_reduce.hpp"
#include "energy/cell_field.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/elastic/quadratic.hpp"
#include "energy/increment.hpp"

namespace itr {

/// scale * integral over the rest shape of a density of the displacement gradient in space. `Past` has acts_on(element), and
/// at(number, element, point) of its points, with density(G), stress(G) = dW/dF and hessian(G), by columns.
template <int Dim, typename Past>
class PastEnergy final : public Energy, public IncrementalTerm {
 public:
  /// `cells` must outlive this; `degree` is that of the quadrature where F varies in an element.
  PastEnergy(const char* name, const CellSet<Dim>& cells, Past past, double scale, int degree)
      : name_(name), cells_(cells), past_(std::move(past)), scale_(scale), degree_(degree) {}
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
    const auto& element = cells_.elements[e];
    if (!past_.acts_on(element)) return;
    visit_sites(cells_, element, degree_, [&](const auto& site) {
      if (site.turn > 0) f(site, past_.at(e, element, site.point));
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
  Past past_;
  double scale_;
  int degree_;
};

}  // namespace itr
