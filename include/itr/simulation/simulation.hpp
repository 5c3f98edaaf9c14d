// SPDX-License-Identifier: MIT
// A simulation: the state, and one time step after another. `src/simulation/step.cpp` is the whole method on a page.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "itr/core/log.hpp"
#include "itr/energy/contact/stiffness.hpp"
#include "itr/energy/elastic/elastic.hpp"
#include "itr/fem/chord_levels.hpp"
#include "itr/linear/registry.hpp"
#include "itr/linear/reuse.hpp"
#include "itr/mesh/strata.hpp"
#include "itr/newton/newton.hpp"
#include "itr/remesh/memory.hpp"
#include "itr/simulation/frame.hpp"
#include "itr/simulation/mesh_change.hpp"
#include "itr/simulation/setup.hpp"
#include "itr/time/integrator.hpp"

namespace itr {

/// The state of a simulation. Fields are interleaved over the mesh's nodes, vertices first, and then the obstacles'
/// vertices. The rest of a simulation is a pure function of state and setup, so that a resumed run has the same bits. A new
/// member must be saved by output/checkpoint.cpp.
template <int Dim>
struct State {
  Mesh<Dim> mesh;   ///< compact
  History history;  ///< history.x[0] is the present
  int step = 0;
  double t = 0;                 ///< [s]
  BarrierStiffness stiffness;   ///< where it is adaptive
  QuadratureLevels quadrature;  ///< of the elastic energy, by cell with curved edges
  ChordLevels chords;           ///< that contact acts on
  RemeshMemory remesh_memory;   ///< operations that remeshing refused and need not try again
  Strata<Dim> strata;           ///< of the mesh, once remeshing has found them
  linear::FactorRecord factor;  ///< factor that may serve the next step
  VectorX deviation;            ///< x - x-hat of the last step, where the next one begins [m]; empty before the first
  std::vector<int> doublings;   ///< how often each of Obstacles::flats was made twice as large; empty: none was
  double stored_energy = 0;     ///< largest elastic and contact energy at the end of a step so far [J]
  double created_energy = 0;    ///< balance of Newmark's steps, see StepProblem::created_energy [J]
};

struct StepResult {
  bool ok = true;
  bool cancelled = false;  ///< not ok because Setup::on_iteration or NewtonOptions::cancel ended the step
  std::string reason;      ///< if not ok: why the step failed; the state is as before it
  StepReport report;
  NodalForces forces;           ///< the forces that the setup asks for
  MeshRenumbering renumbering;  ///< of the mesh, where the step changed it; else empty
};

/// A saved state of a simulation. It costs almost nothing to make and copy, and may be restored any number of times.
template <int Dim>
struct Snapshot {
  std::shared_ptr<const State<Dim>> state;
  TimeOptions time;
  NodalForces forces;
  std::optional<StepReport> report;   ///< empty: nobody has asked for it
  std::shared_ptr<const void> owner;  ///< names the simulation that saved it
};

/// Callbacks of a step (listeners of iterations, terms, functions of conditions, the log) see the state before the step,
/// which the step does not write to, and may save it. To step, to restore and to change conditions from there is an
/// InputError; a listener of mesh changes, called when the step is done, may change conditions.
template <int Dim>
class Simulation {
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
  /// Sets the listener that is called with the old mesh after each step that changed the mesh. state().mesh is the new one.
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
  void restore(State<Dim> state);

  const State<Dim>& state() const;  ///< valid while no snapshot shares it; spans of its fields until it changes
  const Setup<Dim>& setup() const;
  const NodalForces& forces() const;       ///< the forces that the setup asks for, at the end of the last step
  std::string solver_name() const;         ///< the name in the setup, such as "auto"
  std::string solver_name_in_use() const;  ///< the solver in charge now
  /// Calls `observer` with the present state as output sees it.
  template <typename Observer>
  void observe(Observer&& observer) const {
    observe(save(), std::forward<Observer>(observer));
  }
  /// With one that it has saved, also from another thread while a step is taken.
  template <typename Observer>
  void observe(const Snapshot<Dim>& snapshot, Observer&& observer) const {
    const State<Dim>& state = *snapshot.state;
    const FrameData data = frame_data(state, snapshot.forces);
    FrameView<Dim> frame{state.mesh,
                         data.x,
                         data.v,
                         data.elastic_density,
                         data.obstacle_x,
                         setup().obstacles.edges,
                         setup().obstacles.triangles,
                         &data.asked};
    frame.names = &setup().names;
    frame.dhat = setup().contact.dhat;
    if (setup().proxy) frame.proxy = {&data.proxy_x, &setup().proxy->edges, &setup().proxy->triangles};
    observer(frame);
  }

 private:
  struct FrameData {
    VectorX x, v;
    std::vector<double> elastic_density;
    std::vector<Vec<Dim>> obstacle_x, proxy_x;
    AskedFields asked;
  };
  FrameData frame_data(const State<Dim>& state, const NodalForces& forces) const;
  void add_asked(const CellSet<Dim>& cells, const State<Dim>& state, FrameData& data) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Simulation<2>;
extern template class Simulation<3>;

}  // namespace itr
