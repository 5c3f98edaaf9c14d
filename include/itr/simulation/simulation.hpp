// SPDX-License-Identifier: MIT
// A simulation: the state, and one time step after another. `src/simulation/step.cpp` is the whole method on a page.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "itr/core/log.hpp"
#include "itr/energy/contact/stiffness.hpp"
#include "itr/energy/elastic/elastic.hpp"
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

/// Where a simulation stands: a value. Fields are interleaved over the space's nodes (vertices first) followed by the
/// obstacles' vertices. The rest of a simulation is a pure function of this and of its setup, so that a run which is resumed
/// from a saved state has the same bits: what is added here is to be saved by output/checkpoint.cpp.
template <int Dim>
struct State {
  Mesh<Dim> mesh;   ///< compact
  Space space;      ///< on the mesh
  History history;  ///< history.x[0] is the present
  int step = 0;
  double t = 0;                 ///< [s]
  BarrierStiffness stiffness;   ///< where it is adaptive
  QuadratureLevels quadrature;  ///< of the elastic energy, by cell with curved edges
  RemeshMemory remesh_memory;   ///< what remeshing refused, and need not ask again
  Strata<Dim> strata;           ///< of the mesh, once remeshing in 3D has found them
  linear::FactorRecord factor;  ///< that may serve the next step
  VectorX deviation;            ///< x less x-hat of the last step, with which the next one begins; empty: there was none [m]
  double stored_energy = 0;     ///< most elastic and contact energy that a step has ended with [J]
  double created_energy = 0;    ///< balance of Newmark's steps, see StepProblem::created_energy [J]
};

struct StepResult {
  bool ok = true;
  bool cancelled = false;  ///< not ok because Setup::on_iteration or NewtonOptions::cancel said so
  std::string reason;      ///< where not ok: why the step could not be done; the state is that before the step
  StepReport report;
  NodalForces forces;           ///< those that the setup asks for
  MeshRenumbering renumbering;  ///< of the mesh, where the step changed it; else empty
};

/// A simulation as it stood: to go back to, as often as one likes. Cheap to have and to copy.
template <int Dim>
struct Snapshot {
  std::shared_ptr<const State<Dim>> state;
  TimeOptions time;
  NodalForces forces;
};

template <int Dim>
class Simulation {
 public:
  /// Samples initial conditions. Throws InputError for a setup that cannot be simulated: surfaces that intersect at the
  /// start (with the edges), what is not supported yet, an unknown solver.
  explicit Simulation(Setup<Dim> setup, linear::Registry& registry, Logger logger = {});
  ~Simulation();
  Simulation(Simulation&&) noexcept;

  /// What the state at t0 looks like: all counters 0.
  StepReport initial_report() const;
  /// One time step with remeshing inside it. Numerical failure is a result with a reason.
  StepResult advance();
  /// The same by another length of the step than before [s], which is that of steps from now on. Newton's Euclidean
  /// tolerances go with it, from what the setup has for its own; BDF begins with order 1 again. Throws InputError for a
  /// length that is not positive.
  StepResult advance(double dt);
  /// Finds the mesh of a step of the length dt and stays at its start, on the new mesh: for a program that goes over the
  /// step several times, remesh.enabled off, from what save() has then. As advance() but for that; steps are not cut.
  StepResult adapt(double dt);
  bool finished() const;
  /// What acts from the next step on may be changed between steps: values of conditions, loads, motions of obstacles, terms,
  /// remesh.enabled. Mesh, bodies, numbers of vertices, contact, solver and integrator may not.
  Setup<Dim>& conditions();
  /// Called after each step that changed the mesh, with the mesh before; the new one is state().mesh. Null: nobody is told.
  void on_mesh_change(std::function<void(const MeshChange<Dim>& change, const Mesh<Dim>& before)> listener);

  /// All that the next steps depend on, but for what conditions() and the program have set: with the same of that, steps
  /// after restore() have the bits of those after save(). Takes no time; the next step copies the state once.
  Snapshot<Dim> save() const;
  void restore(const Snapshot<Dim>& snapshot);
  /// Goes on from a state of the same setup. Throws InputError where the state does not fit the setup. Strata that are not
  /// its mesh's are dropped, to be found anew.
  void restore(State<Dim> state);

  const State<Dim>& state() const;
  const Setup<Dim>& setup() const;
  const NodalForces& forces() const;       ///< at the end of the last step, those that the setup asks for
  std::string solver_name() const;         ///< as it was asked for: "auto", say
  std::string solver_name_in_use() const;  ///< who answers now
  /// Calls `observer` with the present state as output sees it.
  template <typename Observer>
  void observe(Observer&& observer) const {
    const FrameData data = frame_data();
    FrameView<Dim> frame{state().mesh,
                         data.x,
                         data.v,
                         data.elastic_density,
                         data.obstacle_x,
                         setup().obstacles.edges,
                         setup().obstacles.triangles,
                         &data.asked};
    frame.space = &state().space;
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
  FrameData frame_data() const;
  void add_asked(const CellSet<Dim>& cells, FrameData& data) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Simulation<2>;
extern template class Simulation<3>;

}  // namespace itr
