// SPDX-License-Identifier: MIT
// Energies as functions of the increment of a step. Positions round increments away that are small beside them; terms that
// read the increment itself do not.
#pragma once

#include <memory>
#include <vector>

#include "core/scratch_vector.hpp"
#include "energy/energy.hpp"

namespace itr {

/// Positions x = base + d of a solve, interleaved [m].
struct Increment {
  ConstVectorView base;  ///< where the step begins
  ConstVectorView d;
};

/// A term that reads increments. Its value may differ from Energy::value by a constant.
class IncrementalTerm {
 public:
  virtual ~IncrementalTerm() = default;
  virtual double value_at(const Increment& at, Workspace& workspace) const = 0;
  virtual void add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const = 0;
  /// See Energy::value_round_off. By default that of the value and of the work of its forces along d.
  virtual double value_round_off_at(const Increment& at, Workspace& workspace) const;
};

/// The sum of terms as a function of d. Terms that are not incremental see the rounded positions.
class EnergyOfIncrement final : public Energy {
 public:
  /// `base` has to outlive this.
  EnergyOfIncrement(const EnergySum& sum, ConstVectorView base);
  std::string_view name() const override { return "total"; }
  double value(ConstVectorView d, Workspace& workspace) const override;
  void add_gradient(ConstVectorView d, VectorView gradient, Workspace& workspace) const override;
  void add_hessian(ConstVectorView d, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  void add_gradient_and_sizes(ConstVectorView d, VectorView gradient, VectorView sizes, Workspace& workspace) const override;
  double value_round_off(ConstVectorView d, Workspace& workspace) const override;
  void add_gradient_round_off(ConstVectorView d, VectorView round_off, Workspace& workspace) const override;
  double max_step(ConstVectorView d, ConstVectorView dx, Workspace& workspace) const override;
  bool get_vertex_steps(ConstVectorView d, ConstVectorView dx, VectorView steps, Workspace& workspace) const override;
  bool find_blocking(ConstVectorView d, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                     Workspace& workspace) const override;
  void add_rank_ones(ConstVectorView d, std::vector<RankOne>& parts) const override { sum_.add_rank_ones(base_ + d, parts); }

 private:
  struct Term {
    std::shared_ptr<const Energy> energy;
    const IncrementalTerm* incremental;  ///< the same; null: it reads positions
  };
  ConstVectorView positions(ConstVectorView d, Workspace& workspace) const;
  void add_gradient_of(const Term& term, const Increment& at, ConstVectorView x, VectorView gradient,
                       Workspace& workspace) const;

  EnergySum sum_;
  std::vector<Term> terms_;
  ConstVectorView base_;
};

}  // namespace itr
