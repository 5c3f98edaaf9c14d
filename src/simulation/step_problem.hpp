// SPDX-License-Identifier: MIT
// The incremental potential of one time step on one mesh, and its solution: terms that the scene needs and no others.
#pragma once

#include <memory>

#include "energy/contact/stiffness.hpp"
#include "energy/incremental_potential.hpp"
#include "energy/least_motion.hpp"
#include "energy/tie.hpp"
#include "itr/frame.hpp"
#include "itr/setup.hpp"
#include "newton/newton.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/coupled_points.hpp"
#include "simulation/rigid_coordinates.hpp"
#include "simulation/step_terms.hpp"
#include "time/integrator.hpp"

namespace itr {

/// Data that depend on the mesh alone: problems share them while the mesh stays.
template <int Dim>
struct MeshScope {
  /// The mesh must be compact.
  MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords = {});
  /// Whether this is of such a mesh, obstacles and levels of chords.
  bool is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords) const;

  std::uint64_t mesh_revision;
  ChordLevels chords;
  CellSet<Dim> cells;
  ContactSurface<Dim> surface;                         ///< empty without contact
  std::unique_ptr<const RigidCoordinates<Dim>> rigid;  ///< null without rigid bodies
  double diagonal;                                     ///< of the bodies at rest [m]
  std::vector<Mortar<Dim>> mortars;                    ///< one a tie
  std::vector<CoupledSurface<Dim>> coupled;
  Workspace workspace;  ///< search trees of the surface
};

/// Data that a simulation keeps from step to step, so that they are not made again: they change no result, only the time.
template <int Dim>
struct ProblemCache {
  /// `solver`, a linear::Solver or linear::ReusingSolver, must outlive this.
  template <typename Solver>
  explicit ProblemCache(Solver& solver) : system(solver) {}
  /// The newest scope, where it is of that mesh; else a new one.
  std::shared_ptr<MeshScope<Dim>> scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                           const ChordLevels& chords = {});

  SparseSystem system;       ///< with its pattern, analysis and factors
  unsigned long served = 0;  ///< problems that the system was reset for, so many; it is the last one's
  std::shared_ptr<MeshScope<Dim>> scope;
};

template <int Dim>
class LaggedSolve;

/// Errors in time of a step that is solved.
struct TimeErrors {
  double local = 0;           ///< energy of its local error [J]
  double work = 0;            ///< of loads along the local error [J]
  double energy = 0;          ///< kinetic, elastic and contact energy at its end [J]
  double impact = 0;          ///< kinetic energy that nodes lost as they came into contact [J]
  double resolving_dt = 0;    ///< which resolves how contact stops these nodes [s]
  double way_to_contact = 1;  ///< the part of the flight to x-hat after which the first surfaces would touch
};

template <int Dim>
class StepProblem {
 public:
  /// `history` has the state that the step starts from; `t` is the time at its end. All arguments must outlive this but
  /// `stiffness`, which the barrier starts from where it is adaptive, `levels` of quadrature, which the solve may raise, and
  /// those of `chords`.
  /// Problems may share a cache and solve in turn, each as if alone.
  StepProblem(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const History& history, double t, ProblemCache<Dim>& cache,
              const BarrierStiffness& stiffness = {}, const QuadratureLevels& levels = {}, const ChordLevels& chords = {});

  /// Solves from x (feasible) in place, with rounds for what is lagged: friction, damping, pressure without a potential. In
  /// the first round they are lagged at `lagged_x`. Newton begins where the bodies are `expected` (empty: nowhere), if the
  /// way there is free and the energy lower. With `must_settle` it fails where StepSetup::lagging_tolerance is not reached.
  NewtonSummary solve(VectorX& x, const VectorX& lagged_x, const VectorX& expected = {}, bool must_settle = false);

  /// x minus the positions at the start of the step [m]; of the last solve's x without the round-off of x.
  VectorX increment_of(const VectorX& x) const;

  /// Why the last solve took as many iterations as its summary says.
  std::string describe_effort(const NewtonSummary& summary);

  /// With friction lagged at x, so that numbers compare between meshes and with other codes; else as in the last solve.
  EnergyReport report(const VectorX& x);
  /// A direction in which the energy has negative curvature at x; empty where there is none.
  VectorX find_instability(const VectorX& x);
  double min_distance(const VectorX& x);
  /// At a solution x, those that the setup asks for, as they were in the solve. Remeshing aside.
  NodalForces forces(const VectorX& x);
  /// Forces on bodies that start from x: no step has led there, so that neither reactions, friction nor residual are known.
  NodalForces forces_at_start(const VectorX& x);
  /// Forces of all terms but inertia, where the bodies are at x and move with v [N]. Makes the lagged terms there.
  VectorX total_force(const VectorX& x, const VectorX& v);
  /// Mechanical energy that the integrator (the trapezoidal rule or implicit Euler) creates by a step to x [J]. Its work is
  /// a mean of the forces at both ends times the displacement, the potential's the integral along it; friction and loads
  /// aside.
  double created_energy(const History& history, const VectorX& x);
  /// Kinetic, elastic and contact energy [J].
  double mechanical_energy(const VectorX& x, const VectorX& v);
  /// The errors of the step to x that the last solve found; `has_system`: in iterations, so that its system is about x's.
  TimeErrors time_errors(const History& history, const VectorX& x, bool has_system);
  /// Finds the impact of the step to x. Returns, by dof, how contact acts at its end and at the states before, of which only
  /// where it is zero matters; empty without contact.
  VectorX contact_in_step(const History& history, const VectorX& x, TimeErrors& errors);
  VectorX momentum(const VectorX& v) const;  ///< M v
  /// Elastic energies that differ by less are the same to round-off, whatever their values [J].
  double energy_resolution() const;

  // For estimates of errors, all scaled.

  /// Lags at x, with the velocity of friction of another problem of the same step.
  void lag_as(const StepProblem& other, const VectorX& x);
  /// Gradients at x of the sum, and of what is reported as contact, friction and applied forces.
  struct Gradients {
    VectorX all, contact, friction, applied;
  };
  Gradients gradients(const VectorX& x);
  /// The sum as in the last solve, or as lagged since then.
  EnergySum sum() const { return potential_.sum(lagged_); }
  /// Value and gradient of a term at x.
  struct TermAt {
    double value = 0;
    VectorX gradient;
  };
  /// Contact at x where it acts from `factor` times d-hat, with the same pressure at the same part of it.
  TermAt contact_at(const VectorX& x, double factor);
  /// Friction lagged at x, smoothed below `factor` times its velocity.
  TermAt friction_at(const VectorX& x, double factor);
  /// Assembles the Hessian of the sum at x.
  SparseSystem& assemble(const VectorX& x, PsdProjection psd);
  Workspace& workspace() { return workspace_; }
  const BarrierStiffness& stiffness() const { return stiffness_; }
  QuadratureLevels quadrature_levels() const { return potential_.elastic()->quadrature_levels(); }
  const DofMap& dofs() const { return solve_dofs_; }
  const CellSet<Dim>& cells() const { return cells_; }
  const CollisionSurface& surface() const { return surface_.surface; }
  double scaling() const { return terms_.scaling; }
  /// The tractions by which ties act on both surfaces, in the last solution.
  std::vector<TractionOfTie<Dim>> tie_tractions() const;
  /// Tractions of coupled points likewise, where the bodies are at x.
  std::vector<TractionOfTie<Dim>> coupling_tractions(const VectorX& x) const { return coupled_->tractions(x); }
  double friction_velocity() const { return terms_.contact.friction_velocity; }  ///< eps_v of the last solve [m/s]

 private:
  friend class LaggedSolve<Dim>;
  using Lagged = typename IncrementalPotential<Dim>::Lagged;
  using Traits = TermTraits<Dim>;
  void initialize_stiffness(const VectorX& x);
  void smooth_friction_by(double motion);
  void find_local_error(const History& history, const VectorX& increment, const VectorX& contact, TimeErrors& errors);
  VectorX contact_gradient(const VectorX& x);
  void find_impact(const History& history, const VectorX& x, const VectorX& v, const VectorX& before, const VectorX& now,
                   TimeErrors& errors);
  void add_ties(const History& history, double t);
  void reset_system();
  SparseSystem& system();
  /// Adds what is never assembled to it.
  NewtonSystem& newton_system();
  double average_mass() const;
  /// Finds rigid bodies with forces or moments, and makes the loads of one, lagged at x.
  std::vector<int> loaded_rigid_bodies() const;
  std::shared_ptr<const Energy> rigid_load(int body, const VectorX& x, double t) const;

  const StepSetup<Dim>& setup_;
  PotentialTerms<Dim> terms_;
  std::shared_ptr<MeshScope<Dim>> scope_;
  const CellSet<Dim>& cells_;
  const ContactSurface<Dim>& surface_;
  Workspace& workspace_;
  HeldDofs<Dim> held_;
  DofMap dofs_;
  const RigidCoordinates<Dim>* rigid_;  ///< null without rigid bodies
  DofMap solve_dofs_;                   ///< of the coordinates that a solve has; without rigid bodies the same
  IncrementalPotential<Dim> potential_;
  struct Solution {
    VectorX x, increment;
  };
  std::shared_ptr<TieEnergy<Dim>> tie_;  ///< null: there are no ties
  std::unique_ptr<const CoupledPoints<Dim>> coupled_;
  std::vector<Constraint*> constraints_;              ///< that a solve is repeated for
  std::shared_ptr<LeastMotion<Dim>> least_motion_;    ///< null: inertia or conditions hold all bodies
  VectorX base_;                                      ///< positions at the start of the step
  Solution solution_;                                 ///< of the last solve
  std::unique_ptr<AdaptiveStiffness<Dim>> adaptive_;  ///< null where the stiffness is a number
  BarrierStiffness stiffness_;
  Lagged lagged_;  ///< of the last solve
  ProblemCache<Dim>& cache_;
  std::unique_ptr<NewtonSystem> rank_ones_;  ///< over it, where there are cavities; null: not needed yet
  unsigned long turn_ = 0;                   ///< of the cache's system, when it was reset for this
  int rounds_ = 0;                           ///< of the last solve
  double last_motion_ = 0;                   ///< the largest relative motion in the step before [m]
  VectorX start_velocity_;                   ///< where static friction is above kinetic [m/s]; else empty
};

/// The least det F over the elements; of a curved one a lower bound.
template <int Dim>
double min_volume_ratio(const CellSet<Dim>& cells, ConstVectorView x);

}  // namespace itr
