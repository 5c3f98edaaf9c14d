// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>

namespace itr {

/// How gradients g and steps p are measured, with D the diagonal of the mass matrix of unit density: the last two do not
/// depend on the mesh.
enum class NewtonNorm {
  euclidean,  ///< sqrt(g.g), sqrt(p.p)
  l2,         ///< sqrt(g.g/D), sqrt(p.Dp)
  linf        ///< max |g/D|, max |p|
};

/// Treatment of Hessians with negative eigenvalues. It does not depend on the linear solver.
enum class IndefiniteHessian {
  /// Looks for a minimum: projects the Hessian, and does not converge while a factorisation finds the Hessian indefinite.
  /// Solvers that cannot find that get projected Hessians always.
  project,
  /// Takes the direction of the true Hessian if it descends, as PolyFEM does with an L D L^T. May end at a saddle.
  accept
};

/// Progress of a solve after an iteration.
struct NewtonProgress {
  int iteration = 0;         ///< 1 after the first
  double energy = 0;         ///< [J s^2]
  double gradient_norm = 0;  ///< before the iteration, and that of its full step: in the options' norm
  double step_norm = 0;
};

/// Convergence tests and search of a solve. Absolute tolerances are those of the scene, already multiplied by the factors of
/// docs/theory.md, "Tolerances". 0 turns a test off. Where none is given, forces are compared with the forces that act.
struct NewtonOptions {
  int max_iterations = 3000;
  NewtonNorm norm = NewtonNorm::euclidean;
  double step_tolerance = 0;               ///< stop when the full step has a norm below it
  double force_tolerance = 1e-9;           ///< stop when the gradient is below this part of the forces that act; not
                                           ///< where a gradient tolerance is given
  double gradient_tolerance = 0;           ///< stop when the gradient has a norm below it
  double first_gradient_tolerance = 0;     ///< the same before the first iteration
  double relative_step_tolerance = 0;      ///< of the norm of the solve's first full step
  double relative_gradient_tolerance = 0;  ///< of the norm of the solve's first gradient
  double decrement_tolerance = 0;          ///< stop when the Newton decrement -p.g / 2 is below it [J s^2]
  double energy_tolerance = 0;             ///< stop after `energy_steps` steps in a row that change less [J s^2]
  int energy_steps = 100;
  IndefiniteHessian indefinite = IndefiniteHessian::project;
  bool project_to_psd = true;    ///< project stencils' Hessians to semi-definite ones where the sum is not definite
  int projected_iterations = 5;  ///< iterations with it before the true Hessian is tried again; 0: it never is
  /// If it becomes true, the solve ends before its next iteration without convergence and the step is dropped. Another
  /// thread or a signal handler may set it. It must outlive the solves. Null: solves cannot be cancelled.
  const std::atomic<bool>* cancel = nullptr;

  bool is_cancelled() const { return cancel && cancel->load(std::memory_order_relaxed); }
};

}  // namespace itr
