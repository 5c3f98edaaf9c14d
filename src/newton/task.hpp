// SPDX-License-Identifier: MIT
#pragma once

#include "newton/newton.hpp"
#include "norms.hpp"

namespace itr {

/// Energy that a solve minimises, and how. All parts of the solve share it and keep their vectors in the workspace.
struct Task {
  const Energy& energy;
  const DofMap& dofs;
  NewtonSystem& system;
  const NewtonOptions& options;
  const NewtonExtras& extras;
  Workspace& workspace;
  const Norms norms;
  NewtonSummary& summary;  ///< each part adds its seconds and counts

  bool has_unknowns() const { return dofs.num_unknowns > 0; }
};

/// A full step, and what the quadratic model says of it.
struct Step {
  VectorView way;            ///< over all dofs
  bool is_set = false;       ///< `way` holds a step
  double norm = 0;           ///< of the options
  double curvature = 0;      ///< way^T H way
  bool is_of_shift = false;  ///< it is short because the Hessian was shifted, not because the end is near
};

}  // namespace itr
