// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

enum class LineSearch { backtracking, armijo, robust_armijo };

/// When a solve has converged, and how it searches. The tolerances of the paper's vocabulary (scene-format §7.2) are already
/// multiplied by the characteristic length (h, or 1 for statics) when they stand here.
struct NewtonOptions {
  int max_iterations = 500;
  double step_tolerance = 0;                ///< stop when the full step has an L2 norm below it [m]; 0: off
  double gradient_tolerance = 1e-8;         ///< stop when the gradient has an L2 norm below it
  double first_gradient_tolerance = 1e-10;  ///< the same before the first iteration
  LineSearch line_search = LineSearch::robust_armijo;
  bool project_to_psd = true;  ///< project the Hessian of every stencil to positive semi-definite
};

}  // namespace itr
