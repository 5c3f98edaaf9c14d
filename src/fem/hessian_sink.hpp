// SPDX-License-Identifier: MIT
// Where the Hessian blocks of stencils go: a dense matrix for patches, a sparse one with a reusable pattern for the mesh.
// Addends of an entry come in an order that does not depend on the number of threads, so its bits do not either.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "core/parallel.hpp"
#include "fem/cell_set.hpp"
#include "itr/energy.hpp"
#include "itr/solver.hpp"

namespace itr {

/// Which entries of an interleaved field are unknowns of a solve.
struct DofMap {
  std::vector<int> unknown;  ///< per dof: its unknown, or kNone where it is held or prescribed
  int num_unknowns = 0;

  /// Numbers the dofs that are not `held` in ascending order.
  static DofMap from_held(const std::vector<char>& held);
  /// Holds components in place.
  void hold(const std::vector<char>& held);
};

/// Lower triangle of a sparse symmetric matrix whose pattern grows where blocks ask for it: elasticity gives the base,
/// contacts add to it. The pattern (and with it a solver's analysis) stays as long as nothing new appears.
class SparseAssembler {
 public:
  /// Stencils that are gathered at a time: what their blocks add to an entry is listed once, and summed entry by entry.
  static constexpr std::size_t kBatch = 512;

  /// Base pattern: all pairs of unknowns of the vertices of one stencil, of any kind. What was found out about the same
  /// stencils before is used again; what blocks added to their pattern is forgotten.
  void reset(const DofMap& dofs, int dim, std::vector<Stencils> stencils);
  void begin();
  /// Adds to entry (row, column), row >= column.
  void add(int row, int column, double value);
  /// Number of base stencils of one kind.
  std::size_t num_stencils(std::size_t kind) const { return kind < stencils_.size() ? stencils_[kind].count() : 0; }
  /// Adds the blocks (column-major, side dim * size) of base stencils of one kind from `first`, a multiple of kBatch, to the
  /// end of its batch.
  void add_batch(std::size_t kind, std::size_t first, const double* blocks);

  /// A part of the matrix that is the same each time, for each base stencil of one kind a factor times a block that follows
  /// from the stencil and `block`: adds the sum that was kept, if it is of these and the stencils are still those that it
  /// was kept with.
  bool add_cached(std::size_t kind, std::span<const double> factors, std::span<const double> block);
  /// Begins and ends a part, added to entries of the base pattern only, that is kept as the sum of these blocks.
  void begin_keeping();
  void end_keeping(std::size_t kind, std::span<const double> factors, std::span<const double> block);

  /// Takes in entries that the pattern did not have. Returns whether the pattern changed since the last call.
  bool finish();
  const linear::SparsityPattern& pattern() const { return pattern_; }
  std::span<const double> values() const { return values_; }

 private:
  struct Entry {
    int column, row;
    double value;
  };
  /// Sources of a batch: for entry `nonzero[k]` of the base, the numbers `source[offset[k]..offset[k + 1])` of the blocks.
  struct Gather {
    std::vector<int> nonzero, offset, source;
  };
  /// Kept part, by the base's entries, and the blocks that it is the sum of; without factors: nothing is kept.
  struct Cached {
    std::vector<double> sum, factors, block;
  };
  const Gather& gather(std::size_t kind, std::size_t batch);
  int place(int base_nonzero) const { return place_.empty() ? base_nonzero : place_[base_nonzero]; }

  linear::SparsityPattern pattern_;
  std::vector<double> values_;
  std::vector<Entry> overflow_;
  int last_ = kNone;  ///< entry that was added to last
  bool changed_ = false;

  std::vector<int> unknown_;  ///< per dof
  std::vector<Stencils> stencils_;
  int dim_ = 1;
  linear::SparsityPattern base_;
  std::vector<int> place_;                    ///< of the base's entries in the present pattern; empty: the same
  std::vector<std::vector<Gather>> gathers_;  ///< by kind
  std::vector<Cached> cached_;                ///< by kind
  std::vector<double> others_;                ///< what was there before begin_keeping
};

/// A step that held dofs are made to take, and what it does to the Newton system of the unknowns.
struct PrescribedMotion {
  VectorX step;          ///< full length, zero at unknowns; empty: held dofs stay
  VectorX coupling;      ///< out, by unknown: H_fD * step_D; empty where held dofs stay
  double curvature = 0;  ///< out: step_D^T H_DD step_D
};

/// Some of the nodes of a curved element, a bit each.
using NodeSet = std::uint16_t;
/// The nodes that an element with these curved edges has: its corners, and one on each of these edges.
template <int Dim>
NodeSet all_nodes(CurvedEdges curved) {
  return static_cast<NodeSet>(((1 << (Dim + 1)) - 1) | curved << (Dim + 1));
}
/// Calls f(k) for each node k of the set.
template <int Dim, typename F>
void for_each_node(NodeSet nodes, const F& f) {
  for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
    if (nodes >> k & 1) f(k);
}

/// Destination of the blocks of a Hessian: a dense matrix, a sparse one, or a program's receiver.
class HessianTarget {
 public:
  /// `dense` must outlive this.
  HessianTarget(const DofMap& dofs, Eigen::Ref<MatrixX> dense)
      : dofs_(&dofs), dense_(dense.data()), dense_stride_(dense.outerStride()) {}
  HessianTarget(const DofMap& dofs, SparseAssembler& sparse) : dofs_(&dofs), sparse_(&sparse) {}
  explicit HessianTarget(BlockReceiver receiver) : receiver_(std::move(receiver)) {}

  /// Collects `motion.coupling` and `motion.curvature` along with the blocks.
  void set_motion(PrescribedMotion& motion);
  /// Adds the symmetric `block` of a stencil.
  template <int Dim>
  void add(std::span<const int> vertices, const double* block);
  /// Adds a block for each straight element; `fill(e, block)` may be called at the same time for several of them.
  template <int Dim, typename Fill>
  void add_elements(const CellSet<Dim>& cells, const Fill& fill);
  /// Adds each curved element by `fill(e, nodes, block)`: only entries of these nodes count, the others are zero.
  template <int Dim, typename Fill>
  void add_curved_elements(const CellSet<Dim>& cells, const Fill& fill);
  /// One block times a factor for each straight element: a sum that is kept, and made anew only where it changes.
  template <int Dim>
  void add_multiples(const CellSet<Dim>& cells, std::span<const double> factors, const Mat<Dim*(Dim + 1)>& block);
  /// A factor times a matrix `of(e)` by nodes for each curved element, the same in all directions. The sum is kept in the
  /// same way; `matrices` are all that there are.
  template <int Dim, typename Of>
  void add_curved_multiples(const CellSet<Dim>& cells, std::span<const double> factors, std::span<const double> matrices,
                            const Of& of);

 private:
  bool is_patch() const { return dense_ && !motion_; }
  template <int Dim>
  NodeSet free_nodes(const typename CellSet<Dim>::Element& element) const;
  template <int Dim, typename F>
  void for_each_free_pair(const typename CellSet<Dim>::Element& element, NodeSet nodes, const F& f);
  template <int Dim, typename Element, typename NodesOf, typename Fill>
  void add_blocks(ElementKind kind, std::span<const Element> elements, const NodesOf& ids_of, const Fill& fill);
  template <int Dim, typename Element, typename NodesOf, typename Fill>
  void add_constant(ElementKind kind, std::span<const Element> elements, const NodesOf& ids_of,
                    std::span<const double> factors, std::span<const double> block, const Fill& fill);
  template <int Dim>
  bool is_moved(std::span<const int> nodes) const;
  template <int Dim>
  void add_motion(std::span<const int> vertices, const double* block);

  const DofMap* dofs_ = nullptr;  ///< null where there is a receiver
  double* dense_ = nullptr;
  Eigen::Index dense_stride_ = 0;  ///< from column to column
  SparseAssembler* sparse_ = nullptr;
  BlockReceiver receiver_;
  PrescribedMotion* motion_ = nullptr;
};

namespace detail {
constexpr std::size_t kElementsPerTask = 64;
inline constexpr auto vertices_of = [](const auto& element) -> const auto& { return element.vertices; };
inline constexpr auto nodes_of = [](const auto& element) { return element.nodes(); };
}  // namespace detail

inline void HessianTarget::set_motion(PrescribedMotion& motion) {
  motion.curvature = 0;
  motion.coupling.resize(0);
  if (motion.step.size() == 0) return;
  motion.coupling.setZero(dofs_->num_unknowns);
  motion_ = &motion;
}

template <int Dim, typename Fill>
void HessianTarget::add_elements(const CellSet<Dim>& cells, const Fill& fill) {
  add_blocks<Dim>(kStraight, cells.straight(), detail::vertices_of, fill);
}

template <int Dim, typename Fill>
void HessianTarget::add_curved_elements(const CellSet<Dim>& cells, const Fill& fill) {
  const auto elements = cells.curved();
  if (elements.empty()) return;
  if (!is_patch())
    return add_blocks<Dim>(kCurved, elements, detail::nodes_of,
                           [&](std::size_t e, auto& block) { fill(e, all_nodes<Dim>(elements[e].curved), block); });
  Mat<Dim * kQuadraticNodes<Dim>> block;
  for (std::size_t e = 0; e < elements.size(); ++e) {
    const NodeSet nodes = free_nodes<Dim>(elements[e]);
    if (nodes == 0) continue;
    fill(e, nodes, block);
    for_each_free_pair<Dim>(elements[e], nodes, [&](int row, int column, double& sum) { sum += block(row, column); });
  }
}

template <int Dim>
void HessianTarget::add_multiples(const CellSet<Dim>& cells, std::span<const double> factors,
                                  const Mat<Dim*(Dim + 1)>& block) {
  const auto fill = [&](std::size_t e, Mat<Dim*(Dim + 1)>& multiple) { multiple = factors[e] * block; };
  add_constant<Dim>(kStraight, cells.straight(), detail::vertices_of, factors,
                    {block.data(), static_cast<std::size_t>(block.size())}, fill);
}

template <int Dim, typename Of>
void HessianTarget::add_curved_multiples(const CellSet<Dim>& cells, std::span<const double> factors,
                                         std::span<const double> matrices, const Of& of) {
  const auto elements = cells.curved();
  if (elements.empty()) return;
  constexpr int kNodes = kQuadraticNodes<Dim>;
  if (is_patch()) {
    for (std::size_t e = 0; e < elements.size(); ++e) {
      const Mat<kNodes>& matrix = of(e);
      for_each_free_pair<Dim>(elements[e], free_nodes<Dim>(elements[e]), [&](int row, int column, double& sum) {
        if (row % Dim == column % Dim) sum += factors[e] * matrix(row / Dim, column / Dim);
      });
    }
    return;
  }
  add_constant<Dim>(kCurved, elements, detail::nodes_of, factors, matrices, [&](std::size_t e, Mat<Dim * kNodes>& block) {
    const Mat<kNodes>& matrix = of(e);
    block.setZero();
    for (int i = 0; i < kNodes; ++i)
      for (int j = 0; j < kNodes; ++j)
        block.template block<Dim, Dim>(Dim * i, Dim * j).diagonal().setConstant(factors[e] * matrix(i, j));
  });
}

/// The nodes of an element of which at least one component is an unknown.
template <int Dim>
NodeSet HessianTarget::free_nodes(const typename CellSet<Dim>::Element& element) const {
  NodeSet free = 0;
  const auto of_element = element.nodes();
  for_each_node<Dim>(all_nodes<Dim>(element.curved), [&](int k) {
    for (int c = 0; c < Dim; ++c)
      if (dofs_->unknown[Dim * of_element[k] + c] != kNone) free = static_cast<NodeSet>(free | 1 << k);
  });
  return free;
}

/// Calls f(row, column, entry) for the rows and columns of a block of the element, of these nodes, that are unknowns in the
/// lower triangle of the dense matrix.
template <int Dim, typename F>
void HessianTarget::for_each_free_pair(const typename CellSet<Dim>::Element& element, NodeSet nodes, const F& f) {
  std::array<int, Dim * kQuadraticNodes<Dim>> local, unknown;
  const auto of_element = element.nodes();
  int count = 0;
  for_each_node<Dim>(nodes, [&](int k) {
    for (int c = 0; c < Dim; ++c) {
      const int number = dofs_->unknown[Dim * of_element[k] + c];
      if (number == kNone) continue;
      local[count] = Dim * k + c;
      unknown[count++] = number;
    }
  });
  for (int j = 0; j < count; ++j) {
    double* const column = dense_ + dense_stride_ * unknown[j];
    for (int i = 0; i < count; ++i)
      if (unknown[i] >= unknown[j]) f(local[i], local[j], column[unknown[i]]);
  }
}

template <int Dim, typename Element, typename NodesOf, typename Fill>
void HessianTarget::add_blocks(ElementKind kind, std::span<const Element> elements, const NodesOf& ids_of,
                               const Fill& fill) {
  constexpr int kNodes = static_cast<int>(std::tuple_size_v<std::decay_t<decltype(ids_of(elements[0]))>>);
  using Block = Mat<Dim * kNodes>;
  const std::size_t n = elements.size();
  if (dense_ && !motion_) {  // a patch: one block after the other, without a buffer for all
    Block block;
    for (std::size_t e = 0; e < n; ++e) {
      fill(e, block);
      add<Dim>(ids_of(elements[e]), block.data());
    }
    return;
  }
  std::vector<Block> blocks(std::min(n, SparseAssembler::kBatch));
  for (std::size_t first = 0; first < n; first += SparseAssembler::kBatch) {
    const std::size_t count = std::min(SparseAssembler::kBatch, n - first);
    parallel_blocks(count, detail::kElementsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) fill(first + i, blocks[i]);
    });
    const bool is_base = sparse_ && sparse_->num_stencils(kind) == n;
    if (is_base) sparse_->add_batch(kind, first, blocks.data()->data());
    if (is_base && !motion_) continue;
    for (std::size_t i = 0; i < count; ++i) {
      const auto& nodes = ids_of(elements[first + i]);
      if (!is_base)
        add<Dim>(nodes, blocks[i].data());
      else if (is_moved<Dim>(nodes))
        add_motion<Dim>(nodes, blocks[i].data());
    }
  }
}

template <int Dim, typename Element, typename NodesOf, typename Fill>
void HessianTarget::add_constant(ElementKind kind, std::span<const Element> elements, const NodesOf& ids_of,
                                 std::span<const double> factors, std::span<const double> block, const Fill& fill) {
  if (!sparse_ || sparse_->num_stencils(kind) != elements.size()) return add_blocks<Dim>(kind, elements, ids_of, fill);
  PrescribedMotion* const motion = std::exchange(motion_, nullptr);
  if (!sparse_->add_cached(kind, factors, block)) {
    sparse_->begin_keeping();
    add_blocks<Dim>(kind, elements, ids_of, fill);
    sparse_->end_keeping(kind, factors, block);
  }
  motion_ = motion;
  if (!motion) return;
  constexpr int kNodes = static_cast<int>(std::tuple_size_v<std::decay_t<decltype(ids_of(elements[0]))>>);
  Mat<Dim * kNodes> of_element;
  for (std::size_t e = 0; e < elements.size(); ++e) {
    const auto& nodes = ids_of(elements[e]);
    if (!is_moved<Dim>(nodes)) continue;
    fill(e, of_element);
    add_motion<Dim>(nodes, of_element.data());
  }
}

/// Whether held dofs of these nodes take a step: others have no part in the coupling.
template <int Dim>
bool HessianTarget::is_moved(std::span<const int> nodes) const {
  for (const int v : nodes)
    for (int i = Dim * v; i < Dim * (v + 1); ++i)
      if (dofs_->unknown[i] == kNone && motion_->step[i] != 0) return true;
  return false;
}

}  // namespace itr
