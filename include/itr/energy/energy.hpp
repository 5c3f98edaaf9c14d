// SPDX-License-Identifier: MIT
// The interface of every term of the incremental potential (paper eq. 4), and their sum.
#pragma once

#include <map>
#include <memory>
#include <string_view>
#include <typeindex>
#include <vector>

#include "itr/core/types.hpp"
#include "itr/energy/blocking.hpp"
#include "itr/fem/hessian_sink.hpp"

namespace itr {

/// Projection of a stencil's Hessian to a positive semidefinite one: none, or its negative eigenvalues become 0.
enum class PsdProjection { none, clamp };
inline double projected(double eigenvalue, PsdProjection psd) {
  return eigenvalue >= 0 || psd == PsdProjection::none ? eigenvalue : 0;
}

/// Scratch of one solve, owned by the caller: terms keep no mutable caches, so solves never meet. What is in it never
/// changes a result, only the time that it takes.
class Workspace {
 public:
  /// The one object of type T of this workspace.
  template <typename T>
  T& get() {
    auto& slot = slots_[std::type_index(typeid(T))];
    if (!slot) slot = std::make_shared<T>();
    return *static_cast<T*>(slot.get());
  }

 private:
  std::map<std::type_index, std::shared_ptr<void>> slots_;
};

/// E: R^n -> R, +infinity outside the feasible set; x interleaved positions [m], n = Dim * num_vertices.
class Energy {
 public:
  virtual ~Energy() = default;
  virtual std::string_view name() const = 0;  ///< for logs and per-term statistics
  virtual double value(ConstVectorView x, Workspace& workspace) const = 0;
  virtual void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const = 0;
  virtual void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const = 0;
  /// Adds the gradient, and to `sizes` the absolute forces of which it is the sum: those of each term.
  virtual void add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes, Workspace& workspace) const;
  /// By how much round-off may change the value: epsilon times the size of what is summed. By default that of the value and
  /// of the work of its forces along x.
  virtual double value_round_off(ConstVectorView x, Workspace& workspace) const;
  /// Adds by how much round-off may change each entry of the gradient: the change where each number that it is computed from
  /// changes in its last bits.
  virtual void add_gradient_round_off(ConstVectorView x, VectorView round_off, Workspace& workspace) const;
  /// Largest a in [0, 1] such that x + s dx is feasible for all s in [0, a] (conservative).
  virtual double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const;
  /// The motion dx with each vertex' way as long as it is feasible whatever stops others, for where max_step cuts dx short
  /// as a whole. False where the term cannot tell; `ways` is as long as dx, and undefined then.
  virtual bool get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const;
  /// Adds the pairs that stop dx before `fraction` of it, and bounds the gaps of all pairs in `blocking` at its end. False
  /// where the term cannot tell.
  virtual bool find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                             Workspace& workspace) const;
};

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

 private:
  std::vector<std::shared_ptr<const Energy>> terms_;
};

}  // namespace itr
