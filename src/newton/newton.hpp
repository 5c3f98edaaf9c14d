// SPDX-License-Identifier: MIT
// Projected Newton with a line search whose steps are filtered by the energy's own feasibility (CCD and inversion). Sees
// only Energy: the global step, a local relaxation and the safe projection are the same code.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "core/scratch_vector.hpp"
#include "energy/energy.hpp"
#include "itr/options.hpp"
#include "linear/reuse.hpp"

namespace itr {

/// Residual of a direction, relative, far below what Newton needs; stiff contacts cannot reach much less, and refining there
/// costs solves.
constexpr double kTightResidual = 1e-8;

/// A shift of a Hessian's diagonal: a number, or a fraction of each entry. A number large enough for the stiffest entry
/// stops the motion of all others.
struct Shift {
  double value = 0;
  bool is_fraction = false;
  Shift() = default;
  Shift(double number) : value(number) {}  // NOLINT: a number is one
  static Shift fraction_of_diagonal(double fraction) {
    Shift shift(fraction);
    shift.is_fraction = true;
    return shift;
  }
  double of(double entry) const { return is_fraction ? value * std::abs(entry) : value; }
};

/// Assembles and solves the Newton system of one solve.
class NewtonSystem {
 public:
  virtual ~NewtonSystem() = default;
  /// Assembles the Hessian over the unknowns of `dofs`, and what `motion` of the held dofs does to it.
  virtual void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs,
                        PrescribedMotion& motion, Workspace& workspace) = 0;
  /// Solves (Hessian + shift) solution = rhs, by a factorisation unless a system knows better. If `solution` is empty,
  /// only what the matrix is is found out.
  virtual linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                                     VectorView solution);
  /// Solves the system with U U^T beside Hessian + shift, U of a few columns, which is never assembled.
  virtual linear::SystemReport solve_beside(const MatrixX& U, const Shift& shift, ConstVectorView rhs,
                                            const linear::Asked& asked, VectorView solution);
  /// Factorises Hessian + shift.
  virtual linear::SystemReport factorize(const Shift& shift) = 0;
  /// Solves with the matrix that was given last.
  virtual linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) = 0;
  /// Solves for every column of B, each on its own unless a system knows better. False where one fails.
  virtual bool solve_columns(const MatrixX& B, MatrixX& X);
  /// Whether solve and factorize tell of every matrix that is not positive definite.
  virtual bool tells_definiteness() const { return true; }
  /// Whether that is so whatever the right-hand side.
  virtual bool sees_all_directions() const { return tells_definiteness(); }
  /// A copy of the Hessian as it is assembled, which maps v to H v; null for a system that has no such copies.
  using Product = std::function<void(ConstVectorView v, VectorView Hv)>;
  virtual Product product() const { return {}; }
  /// Who failed and why, after an outcome that was not ok.
  virtual std::string message() const = 0;
  /// Largest absolute diagonal entry of the Hessian: the scale of shifts.
  virtual double diagonal_scale() const = 0;
  /// The curvature that a shift adds along a step of the unknowns.
  virtual double curvature_of(const Shift& shift, ConstVectorView step) const = 0;
};

/// For patches of up to some hundred unknowns. Keeps its memory.
class DenseSystem final : public NewtonSystem {
 public:
  void assemble(const Energy&, ConstVectorView x, PsdProjection, const DofMap&, PrescribedMotion&, Workspace&) override;
  linear::SystemReport factorize(const Shift& shift) override;
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override;
  Product product() const override;
  std::string message() const override { return "dense Cholesky"; }
  double diagonal_scale() const override;
  double curvature_of(const Shift& shift, ConstVectorView step) const override;

 private:
  Eigen::Index order_ = 0;
  ScratchVector hessian_, factor_;  ///< by columns
};

/// For whole meshes: fixed base pattern of the elements, contacts added as they appear, analysed when the pattern changes.
class SparseSystem final : public NewtonSystem {
 public:
  /// `solver` must outlive this.
  explicit SparseSystem(linear::Solver& solver) : solver_(solver) {}
  /// Its factors may serve several systems.
  explicit SparseSystem(linear::ReusingSolver& solver) : solver_(solver), reusing_(&solver) {}
  /// For the unknowns of `dofs` and elements of the vertices `stencils`, `stencil_size` each: cheap where they are as
  /// before.
  void reset(const DofMap& dofs, int dim, std::vector<Stencils> stencils);
  linear::Solver& solver() { return solver_; }
  const SparseAssembler& assembler() const { return assembler_; }
  void assemble(const Energy&, ConstVectorView x, PsdProjection, const DofMap&, PrescribedMotion&, Workspace&) override;
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override;
  linear::SystemReport solve_beside(const MatrixX& U, const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                                    VectorView solution) override;
  linear::SystemReport factorize(const Shift& shift) override;
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override;
  bool solve_columns(const MatrixX& B, MatrixX& X) override;
  bool tells_definiteness() const override { return solver_.capabilities().tells_definiteness; }
  bool sees_all_directions() const override { return tells_definiteness() && !solver_.capabilities().iterative; }
  Product product() const override;
  std::string message() const override;
  double diagonal_scale() const override;
  double curvature_of(const Shift& shift, ConstVectorView step) const override;

 private:
  linear::SystemReport solve_with(const MatrixX* U, const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                                  VectorView solution);
  linear::Outcome analyze();
  void shift_by(const Shift& shift);
  bool has_factor();

  linear::Solver& solver_;
  linear::ReusingSolver* reusing_ = nullptr;
  SparseAssembler assembler_;
  std::vector<double> shifted_;
  std::span<const double> matrix_;  ///< given last: the assembler's values, or the shifted ones
  bool pattern_changed_ = true;
  bool may_keep_order_ = false;  ///< not over resets: a resumed run begins with one
  int dim_ = 1;
  std::vector<int> dofs_;            ///< of each unknown
  std::vector<double> coordinates_;  ///< of each unknown's node when the pattern changed, dim each [m]
};

enum class Termination {
  gradient,    ///< gradient norm below tolerance
  step,        ///< full Newton step below tolerance
  decrement,   ///< Newton decrement below tolerance
  energy,      ///< energy does not change any more
  round_off,   ///< what a full step would gain or move is below round-off
  saddle,      ///< there are directions of negative curvature, and none lowers the energy by more than round-off
  iterations,  ///< out of iterations
  no_descent,  ///< no direction or no step that lowers the energy, and the gradient is not small
  infeasible,  ///< the start is not feasible or a number is not finite
  cancelled,   ///< as NewtonOptions::cancel or NewtonExtras::on_iteration asks for
  lagging      ///< of several solves: the loads that are lagged from one to the next do not settle
};
const char* to_string(Termination termination);

struct NewtonSummary {
  Termination termination = Termination::iterations;
  bool converged() const { return termination <= Termination::saddle; }
  int iterations = 0;
  int indefinite = 0;          ///< factorised Hessians with negative eigenvalues, where the solver tells
  int blocked = 0;             ///< iterations that went less than half of their step, for what is in the way
  double energy = 0;           ///< at the end
  double gradient_norm = 0;    ///< over the unknowns, at the last evaluation, in the options' norm
  double step_norm = 0;        ///< of the last full step, in the options' norm
  double decrement = 0;        ///< -p.g/2 of the last full step p: what the model says that it gains [J s^2]
  double linear_residual = 0;  ///< relative residual of the last linear solve
  double assembly_seconds = 0, linear_seconds = 0, line_search_seconds = 0, ccd_seconds = 0;
  /// Positions and step [m] of the last one blocked in a long solve, else empty: whoever explains it finds the pair or cell.
  VectorX blocked_from, blocked_step;
  VectorX failed_step;    ///< full step of the last iteration where it did not converge, [m]; else empty
  int worst_dof = kNone;  ///< unknown with the largest residual where it did not converge
  std::string message;    ///< what stopped it where it did not converge; what is lagged too far off where it did

  void add_effort(const NewtonSummary& other);
};

/// Inputs that a solve may have beside its options.
struct NewtonExtras {
  std::span<const double> norm_weights{};  ///< D of NewtonNorm by dof; may be empty for the Euclidean one
  /// Called with each accepted iterate; says whether it changed the energy.
  std::function<bool(const VectorX& x)> after_step{};
  /// Called after each iteration; false ends the solve, not converged.
  std::function<bool(const NewtonProgress& progress)> on_iteration{};
  /// Looks for negative curvature with every solver before it ends, at a start that has converged too: nothing but the end
  /// matters, as in statics.
  bool must_be_minimum = false;
  /// Says nothing of why it ended: neither message nor failed step. For solves that end after so many iterations anyway.
  bool is_brief = false;
  /// Where the solve begins elsewhere than the state is: the way from there, and what inertia does along it to the gradient.
  /// The solve has not converged there unless gradient and step are nothing beside these: whatever the tolerances, forces
  /// that just began to act are not passed over. Empty: it begins where the state is.
  VectorX step_to_start{}, gradient_of_step{};
  /// Adds to a gradient what inertia does along the motion from the start of the step to x. Forces that are left beside it,
  /// however small beside those that act, turn free bodies aside: one more step is taken then. Empty: nothing has inertia.
  std::function<void(ConstVectorView x, VectorView gradient)> add_inertia_of_motion{};
  /// Where x are increments, the round-off of positions. A first step that is far above it is taken, whatever the
  /// gradient's round-off; steps in a row that are not may end the solve, whatever they promise of the energy.
  std::optional<double> position_round_off{};
};

/// Minimises `energy` over the unknowns of `dofs`, in place. Held dofs move from where they are to `target` (same length as
/// x; empty: they stay), as far in each iteration as feasibility allows, by an exact-penalty merit function (Nocedal &
/// Wright 2006, §18.3); convergence is tested only once they are there. x stays feasible throughout.
NewtonSummary minimize(const Energy& energy, VectorView x, const DofMap& dofs, const VectorX& target, NewtonSystem& system,
                       const NewtonOptions& options, Workspace& workspace, const NewtonExtras& extras = {});

}  // namespace itr
