// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "energy/energy.hpp"
#include "energy/project_block.hpp"
#include "fem/cell_set.hpp"
#include "fem/hessian_sink.hpp"
#include "itr/itr.hpp"

namespace itr {

/// A term of a program, HostTerm, as an energy.
template <int Dim>
class TermOfHost final : public Energy {
 public:
  TermOfHost(std::shared_ptr<const HostTerm> term, std::string place, const CellSet<Dim>& cells, double t, double scale)
      : term_(std::move(term)), place_(std::move(place)), scale_(scale) {
    if (cells.has_curved()) throw InputError({"", place_, "curved edges", "a mesh with straight edges alone"});
    part_.dimension = Dim;
    part_.t = t;
    for (const Vec<Dim>& X : cells.rest) X_.insert(X_.end(), X.begin(), X.end());
    for (const auto& element : cells.elements) {
      cells_.insert(cells_.end(), element.vertices.begin(), element.vertices.end());
      bodies_.push_back(element.body);
    }
    for (const auto& facet : cells.facets) {
      facets_.insert(facets_.end(), facet.vertices.begin(), facet.vertices.end());
      boundaries_.push_back(facet.tag == kNoTag ? -1 : facet.tag);
    }
    part_.X = X_;
    part_.cells = cells_, part_.bodies = bodies_;
    part_.facets = facets_, part_.boundaries = boundaries_;
  }
  TermOfHost(const TermOfHost&) = delete;

  std::string_view name() const override { return "host term"; }
  double value(ConstVectorView x, Workspace&) const override {
    const double energy = scale_ * term_->energy(part_, x.head(size()));
    return std::isnan(energy) ? std::numeric_limits<double>::infinity() : energy;
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    VectorX own = VectorX::Zero(size());
    term_->add_gradient(part_, x.head(size()), own);
    check_finite(place_ + ".gradient", {own.data(), X_.size()});
    gradient.head(size()) += scale_ * own;
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override {
    term_->add_hessian(part_, x.head(size()), [&](std::span<const int> vertices, const double* block) {
      const Eigen::Index side = Dim * static_cast<Eigen::Index>(vertices.size());
      check_block(place_, vertices, {block, static_cast<std::size_t>(side * side)}, X_.size() / Dim);
      const Eigen::Map<const MatrixX> given(block, side, side);
      MatrixX own = scale_ / 2 * (given + given.transpose());
      project_block(own, psd);
      sink.add<Dim>(vertices, own.data());
    });
  }

 private:
  Eigen::Index size() const { return static_cast<Eigen::Index>(X_.size()); }

  std::shared_ptr<const HostTerm> term_;
  std::string place_;
  double scale_;
  HostPart part_{};
  std::vector<double> X_;
  std::vector<int> cells_, bodies_, facets_, boundaries_;
};

/// A program's term in one dimension; `name` is for its errors. Throws InputError (when it is asked for its Hessian) for
/// blocks of vertices that are not there.
template <int Dim>
TermFactory<Dim> as_factory(std::shared_ptr<const HostTerm> term, std::string name) {
  return [term = std::move(term), place = "term '" + name + "'"](const CellSet<Dim>& cells, double t, double scale) {
    return std::make_shared<TermOfHost<Dim>>(term, place, cells, t, scale);
  };
}

}  // namespace itr
