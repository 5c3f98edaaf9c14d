// SPDX-License-Identifier: MIT
// A simulation of either dimension that a host program advances: the facade over Simulation<2> and Simulation<3>, which
// stay reachable for what needs types (terms, materials).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "itr/embed/model.hpp"
#include "itr/simulation/simulation.hpp"

namespace itr {

/// Writes `dimension` numbers (a scalar: one) for the rest position X [m] and the time t [s].
using HostFunction = std::function<void(const double* X, double t, double* value)>;

/// What a term of the program's own is a sum over: the whole mesh, or the patch around an edit, which numbers its vertices
/// itself. Valid during a call.
struct HostPart {
  int dimension;
  std::span<const double> X;                ///< rest positions [m]; obstacles' vertices come last
  std::span<const int> cells, bodies;       ///< dimension + 1 vertices each, and their body
  std::span<const int> facets, boundaries;  ///< of the bodies' boundary, dimension vertices each; ids, -1: none
  double t;                                 ///< end of the step [s]
};

/// An energy E(x) of the program's own, its gradient and Hessian, at positions x [m] as long as part.X: a sum over cells,
/// facets or points at rest positions, not over vertex numbers. All three are needed; several threads may call them.
struct HostTerm {
  std::function<double(const HostPart& part, ConstVectorView x)> energy;  ///< [J]; not a number: not defined there
  std::function<void(const HostPart& part, ConstVectorView x, VectorView gradient)> add_gradient;  ///< [N]
  /// Symmetric blocks [N/m]; the library projects them where it needs to.
  std::function<void(const HostPart& part, ConstVectorView x, const StiffnessReceiver& add)> add_hessian;
};

/// What MeshChange says, for a program that does not know the dimension at compile time.
struct AnyMeshChange {
  std::vector<int> vertex, cell, facet, facet_parent;
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation;
  /// project_fields: rows by old vertex in, by new vertex out; integrals are kept.
  std::function<MatrixX(const MatrixX& fields)> project;
};

/// Everything between steps is done by the thread that steps. Two objects do not disturb each other. Spans are valid until
/// the next call that changes the simulation. A name that is not known is an InputError that lists the known ones.
class AnySimulation {
 public:
  /// Copies the model. Throws InputError for what cannot be simulated. `registry` has the linear solvers; null: those that
  /// the library finds.
  explicit AnySimulation(const Model& model, Logger logger = {}, std::shared_ptr<linear::Registry> registry = nullptr);
  ~AnySimulation();
  AnySimulation(AnySimulation&&) noexcept;  ///< what is moved from can only be destroyed

  int dimension() const;  ///< 2 or 3
  /// The simulation below. Throws std::bad_variant_access for the other dimension.
  template <int Dim>
  Simulation<Dim>& as();

  // Steps.

  /// One of the length dt [s] (0: as the step before, or as the options say). Where it is not ok the state is as before.
  StepResult step(double dt = 0);
  /// Finds the mesh of the next step and stays at its start, on that mesh: before sub-iterations on a frozen one.
  StepResult adapt(double dt);
  double step_length() const;                        ///< dt of the next step unless step() says another one [s]
  double time() const;                               ///< [s]
  int steps() const;                                 ///< done
  bool finished() const;                             ///< as many as the options ask for
  const StepReport& report() const;                  ///< of the last step, or of the state at the start
  const std::vector<std::string>& warnings() const;  ///< of the model's options

  // What acts from the next step on. Arrays of nodal values are by vertex of the present mesh, and are functions of rest
  // position from then on: linear on its cells.

  /// Prescribes displacements [m] of the components for which `mask` (dimension flags) is not 0; all 0: releases.
  void fix(const std::string& boundary, std::span<const int> mask, HostFunction displacement);
  void fix(const std::string& boundary, std::span<const int> mask, std::span<const double> displacements);  ///< the same
  /// Force by rest area [N/m^2] (2D: length [N/m]). Null: none.
  void set_traction(const std::string& boundary, HostFunction traction);
  void set_traction(const std::string& boundary, std::span<const double> tractions);  ///< dimension numbers a vertex
  /// Along inward normals as they are then, the same unit. Null: none.
  void set_pressure(const std::string& boundary, HostFunction pressure);
  void set_pressure(const std::string& boundary, std::span<const double> pressures);  ///< a number a vertex
  void set_acceleration(HostFunction acceleration);              ///< body force by mass [m/s^2]; null: none
  void set_acceleration(std::span<const double> accelerations);  ///< dimension numbers a vertex
  /// Displacement of an obstacle from rest [m].
  void move_obstacle(const std::string& obstacle, HostFunction displacement);
  /// Its vertices' positions at the end of the next steps [m]: dimension numbers each, in the order of add_obstacle.
  void move_obstacle(const std::string& obstacle, std::span<const double> positions);
  /// Dead forces [N] on the vertices, `dimension` each; they stay where they act however the mesh changes. Empty: none.
  void set_forces(std::span<const double> forces);
  /// Forces of present positions: adds to f [N] for vertices at rest positions X and positions x [m]; `stiffness`, if it is
  /// there, gives blocks of -df/dx. The mesh may be a new one within a step: lengths say so.
  using ForceFunction = std::function<void(ConstVectorView X, ConstVectorView x, double t, VectorView f)>;
  /// Gives blocks of -df/dx [N/m].
  using StiffnessFunction =
      std::function<void(ConstVectorView X, ConstVectorView x, double t, const StiffnessReceiver& add)>;
  /// Null: none.
  void set_follower_forces(ForceFunction forces, StiffnessFunction stiffness = nullptr);
  /// Adds a term to the incremental potential, or puts it in the place of the one of this name. All null: it goes.
  void set_term(const std::string& name, HostTerm term);
  /// Of the bodies' vertices [m/s]; for a start, or a state that the program has from elsewhere.
  void set_velocities(std::span<const double> velocities);
  void freeze_mesh(bool frozen);  ///< no remeshing while it is; no effect where the options do not ask for it

  // The state.

  int num_vertices() const;                        ///< of the bodies
  int num_cells() const;                           ///< triangles or tetrahedra
  int num_facets() const;                          ///< of their boundary
  std::span<const double> positions() const;       ///< dimension numbers a vertex [m]
  std::span<const double> velocities() const;      ///< the same [m/s]
  std::vector<double> rest_positions() const;      ///< the same [m]
  std::vector<int> cells() const;                  ///< dimension + 1 vertices each
  std::vector<int> bodies() const;                 ///< a cell
  std::vector<int> facets() const;                 ///< of the boundary: dimension vertices each, outward
  std::vector<int> facet_boundaries() const;       ///< ids of Model::add_boundary; -1: none
  std::vector<double> obstacle_positions() const;  ///< of all obstacles, one after the other [m]
  /// Asks for forces, which then are there after each step: their cost is that of some gradients a step.
  void watch_forces(bool watched);
  const NodalForces& forces() const;  ///< dimension numbers a vertex [N]; empty where they are not watched
  /// Force [N] and moment about a point [N m] (2D: one number) of all forces on boundaries, see itr::resultant. Forces have
  /// to be watched.
  struct Resultants {
    std::vector<double> force, moment;  ///< dimension numbers; one in 2D, three in 3D
  };
  /// On several boundaries and obstacles together: what acts on boundaries, and what bodies do to obstacles.
  Resultants resultant(std::span<const std::string> boundaries, std::span<const double> about) const;
  Resultants resultant(const std::string& boundary) const;  ///< about the origin
  std::vector<double> elastic_density() const;              ///< by cell, of rest volume [J/m^Dim]
  std::vector<double> von_mises() const;                    ///< by cell [Pa]
  std::vector<double> stress() const;                       ///< Cauchy's by cell, dimension^2 numbers, row by row [Pa]

  /// See Snapshot.
  using Saved = std::variant<Snapshot<2>, Snapshot<3>>;
  Saved save() const;  ///< cheap, see Simulation::save
  /// Throws InputError for one of another dimension.
  void restore(const Saved& saved);

  // Events; null: nobody listens. What they throw comes out of step(), which then did nothing or (mesh change) was done.

  void on_iteration(std::function<bool(const NewtonProgress&)> listener);   ///< false cancels the step
  void on_mesh_change(std::function<void(const AnyMeshChange&)> listener);  ///< after a step that changed the mesh

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <>
Simulation<2>& AnySimulation::as<2>();  ///< in 2D
template <>
Simulation<3>& AnySimulation::as<3>();  ///< in 3D

}  // namespace itr
