// SPDX-License-Identifier: MIT
// Where the Hessian blocks of stencils go: a dense matrix for patches, a sparse one with a reusable pattern for the mesh.
// Blocks are added in the order of the calls, by one thread, so the sums have the same bits for any number of threads.
#pragma once

#include <span>
#include <vector>

#include "itr/core/types.hpp"
#include "itr/linear/solver.hpp"

namespace itr {

/// Which entries of an interleaved field are unknowns of a solve.
struct DofMap {
  std::vector<int> unknown;  ///< per dof: its unknown, or kNone where it is held or prescribed
  int num_unknowns = 0;

  /// Numbers the dofs that are not `held` in ascending order.
  static DofMap from_held(const std::vector<char>& held);
};

/// Lower triangle of a sparse symmetric matrix whose pattern grows where blocks ask for it: elasticity gives the base,
/// contacts add to it. The pattern (and with it a solver's analysis) stays as long as nothing new appears.
class SparseAssembler {
 public:
  /// Base pattern: all pairs of unknowns of the vertices of one stencil. `stencils` holds `stencil_size` vertices each.
  void reset(const DofMap& dofs, int dim, std::span<const int> stencils, int stencil_size);
  void begin();
  /// Adds to entry (row, column), row >= column.
  void add(int row, int column, double value);
  /// Takes in entries that the pattern did not have. Returns whether the pattern changed since the last call.
  bool finish();
  const linear::SparsityPattern& pattern() const { return pattern_; }
  std::span<const double> values() const { return values_; }

 private:
  struct Entry {
    int column, row;
    double value;
  };
  linear::SparsityPattern pattern_;
  std::vector<double> values_;
  std::vector<Entry> overflow_;
  int last_ = kNone;  ///< entry that was added to last
  bool changed_ = false;
};

/// A step that held dofs are made to take, and what it does to the Newton system of the unknowns.
struct PrescribedMotion {
  VectorX step;          ///< full length, zero at unknowns; empty: held dofs stay
  VectorX coupling;      ///< out, by unknown: H_fD * step_D
  double curvature = 0;  ///< out: step_D^T H_DD step_D
};

class HessianSink {
 public:
  HessianSink(const DofMap& dofs, MatrixX& dense) : dofs_(dofs), dense_(&dense) {}
  HessianSink(const DofMap& dofs, SparseAssembler& sparse) : dofs_(dofs), sparse_(&sparse) {}

  /// Collects `motion.coupling` and `motion.curvature` along with the blocks.
  void set_motion(PrescribedMotion& motion) {
    motion.coupling.setZero(dofs_.num_unknowns);
    motion.curvature = 0;
    if (motion.step.size() > 0) motion_ = &motion;
  }
  /// Adds the symmetric `block` (column-major, Dim * vertices.size() squared) of a stencil.
  template <int Dim>
  void add(std::span<const int> vertices, const double* block);

 private:
  const DofMap& dofs_;
  MatrixX* dense_ = nullptr;
  SparseAssembler* sparse_ = nullptr;
  PrescribedMotion* motion_ = nullptr;
};

}  // namespace itr
