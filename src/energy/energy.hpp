// SPDX-License-Identifier: MIT
// The sum of terms of the incremental potential, for the interface itr/energy.hpp.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "energy/blocking.hpp"
#include "fem/hessian_sink.hpp"
#include "itr/energy.hpp"

namespace itr {

inline double projected(double eigenvalue, PsdProjection psd) {
  return eigenvalue >= 0 || psd == PsdProjection::none ? eigenvalue : 0;
}

/// A sum that does not own its terms' data but shares the terms.
class EnergySum final : public Energy {
 public:
  void add(std::shared_ptr<const Energy> term) { terms_.push_back(std::move(term)); }
  void clear() { terms_.clear(); }
  const std::vector<std::shared_ptr<const Energy>>& terms() const { return terms_; }
  std::string_view name() const override { return "total"; }
  double value(ConstVectorView x, Workspace& workspace) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  void add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes, Workspace& workspace) const override;
  double value_round_off(ConstVectorView x, Workspace& workspace) const override;
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override;
  /// Asks the one term that can tell; false where another cuts dx short.
  bool get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const override;
  /// Asks the first term that can tell.
  bool find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                     Workspace& workspace) const override;
  void add_rank_ones(ConstVectorView x, std::vector<RankOne>& parts) const override {
    for (const auto& term : terms_) term->add_rank_ones(x, parts);
  }

 private:
  std::vector<std::shared_ptr<const Energy>> terms_;
};

}  // namespace itr
