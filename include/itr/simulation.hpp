// SPDX-License-Identifier: MIT
// A simulation: the state, and one time step after another. `src/simulation/step.cpp` is the whole method on a page.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "itr/core.hpp"
#include "itr/frame.hpp"
#include "itr/setup.hpp"
#include "itr/solver.hpp"
#include "itr/transfer.hpp"

namespace itr {

/// All that the next steps depend on besides the setup: opaque, to be saved and restored.
template <int Dim>
struct State;

struct StepResult {
  bool ok = true;
  bool cancelled = false;  ///< not ok because Setup::on_iteration or NewtonOptions::cancel ended the step
  std::string reason;      ///< if not ok: why the step failed; the state is as before it
  StepReport report;
  NodalForces forces;           ///< the forces that the setup asks for
  ErrorFields errors;           ///< where it asks for error bars
  MeshRenumbering renumbering;  ///< of the mesh, where the step changed it; else empty
};

/// A saved state of a simulation. It costs almost nothing to make and copy, and may be restored any number of times.
template <int Dim>
struct Snapshot {
  std::shared_ptr<const State<Dim>> state;
  TimeOptions time;
  NodalForces forces;
  std::optional<StepReport> report;  ///< empty: nobody has asked for it
  ErrorFields errors{};
  std::shared_ptr<const void> owner;  ///< names the simulation that saved it
};

/// Callbacks of a step (listeners of iterations, terms, functions of conditions, the log) see the state before the step,
/// which the step does not write to, and may save it. To step, to restore and to change conditions from there is an
/// InputError; a listener of mesh changes, called when the step is done, may change conditions.
template <int Dim>
class ITR_EXPORT Simulation {
 public:
  /// Samples initial conditions. Throws InputError for a setup that cannot be simulated: surfaces that intersect at the
  /// start, an unsupported combination, an unknown solver.
  explicit Simulation(Setup<Dim> setup, linear::Registry& registry, Logger logger = {});
  ~Simulation();
  Simulation(Simulation&&) noexcept;

  /// The report of the last step. After adapt() it is that of the state on the new mesh with the cost of adapting, after
  /// restore() that of the saved state, before any step one whose counters are 0. Valid until a call changes the simulation.
  const StepReport& report() const;
  /// Takes one time step with remeshing inside it. Numerical failure gives a result with a reason and does not throw.
  StepResult advance();
  /// Takes one step of another length dt [s], which later steps keep. Newton's Euclidean tolerances scale with dt. BDF
  /// begins with order 1 again. A step that fails changes none of that. Throws InputError if dt is not positive.
  StepResult advance(double dt);
  /// Finds the mesh of a step of length dt and stays at the start of that step, on the new mesh. A program that repeats the
  /// step saves the state then, turns remesh.enabled off, and restores before each repetition. Steps are not cut.
  StepResult adapt(double dt);
  bool finished() const;
  /// Conditions that a program may change between steps: values, loads, motions of obstacles, terms, remesh.enabled. Mesh,
  /// bodies, numbers of vertices, contact, solver and integrator must stay.
  Setup<Dim>& conditions();
  /// Sets the listener that is called with the old mesh after each step that changed the mesh. mesh() is the new one.
  /// Null removes the listener.
  void on_mesh_change(std::function<void(const MeshChange<Dim>& change, const Mesh<Dim>& before)> listener);

  /// Saves the state, which takes no time. Steps after restore() have the same bits as those after save(), if conditions()
  /// and the program's functions are the same.
  Snapshot<Dim> save() const;
  /// Throws InputError for a snapshot of another simulation.
  void restore(const Snapshot<Dim>& snapshot);
  /// Restores a state of the same setup. Its curved edges stay curved also where the setup would curve none. Throws
  /// InputError if the state does not fit the setup, has numbers that are not finite or violates invariants
  /// (find_violation). Strata of another mesh are dropped and found anew.
  void restore(const State<Dim>& state);

  double time() const;                 ///< [s]
  int steps() const;                   ///< number of steps taken
  const Mesh<Dim>& mesh() const;       ///< compact; valid, as the next two, until a call changes the simulation
  ConstVectorView positions() const;   ///< of the bodies' nodes, vertices first, interleaved [m]
  ConstVectorView velocities() const;  ///< the same [m/s]
  /// All that steps depend on, for output::Writer and restore(). Valid while no snapshot shares it.
  const State<Dim>& state() const;
  const Setup<Dim>& setup() const;
  /// Energy stored at the start, where ContactOptions::resolve_overlap found surfaces that touched [J].
  double interference_energy() const;
  const NodalForces& forces() const;       ///< the forces that the setup asks for, at the end of the last step
  std::string solver_name() const;         ///< the name in the setup, such as "auto"
  std::string solver_name_in_use() const;  ///< the solver in charge now
  /// Calls `observer` with the present state as output sees it.
  void observe(const std::function<void(const FrameView<Dim>&)>& observer) const;
  /// With one that it has saved, also from another thread while a step is taken.
  void observe(const Snapshot<Dim>& snapshot, const std::function<void(const FrameView<Dim>&)>& observer) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Simulation<2>;
extern template class Simulation<3>;

/// Sum of the four kinds of forces of FieldOptions on some vertices, at the end of a step.
template <int Dim>
struct Resultant {
  Vec<Dim> force = Vec<Dim>::Zero();                                 ///< [N]; 2D: by thickness
  Vec<Dim == 2 ? 1 : 3> moment = Vec < Dim == 2 ? 1 : 3 > ::Zero();  ///< of them [N m]; 2D: about the axis out of the plane
};

/// Returns the sum of contact, friction, reactions, tractions, pressures and forces of the program on the vertices of the
/// boundary facets with these tags, and its moment about `about` [m]. A vertex counts once, also if other facets share it.
/// Over the whole boundary, together with body forces and the program's forces inside, it is the rate of the bodies'
/// momentum. Throws InputError for tags that no facet has, and if the setup does not ask for the four kinds of forces.
template <int Dim>
ITR_EXPORT Resultant<Dim> resultant(const Simulation<Dim>& simulation, std::span<const int> tags, const Vec<Dim>& about);

}  // namespace itr
