// SPDX-License-Identifier: MIT
// All that a program needs to simulate: AnySimulation, the facade of either dimension, and below it Simulation<2> and
// Simulation<3> with their Setup. docs/embedding.md is the guide; parts that are of use alone have headers of their own.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "itr/frame.hpp"
#include "itr/mesh.hpp"
#include "itr/options.hpp"
#include "itr/output.hpp"
#include "itr/scene.hpp"
#include "itr/setup.hpp"
#include "itr/simulation.hpp"
#include "itr/solver.hpp"
#include "itr/transfer.hpp"
#include "itr/types.hpp"

namespace itr {

// The description of a problem in plain arrays. The dimension is chosen at run time.

/// The description of a problem, from which simulations are made by copy. Arrays are interleaved, positions are in metres,
/// vertices are numbered from 0. Wrong arguments throw an InputError, which names the array, the index, what was found and
/// what was expected.
class ITR_EXPORT Model {
 public:
  /// An empty model of dimension 2 or 3.
  explicit Model(int dimension);
  /// Reads bodies, obstacles and options of a scene file. Its surfaces become boundaries by their names or ids: "1", "2",
  /// ...
  static Model from_scene(const std::string& file, const std::vector<scene::Override>& overrides = {});

  /// Merges a JSON object with keys of a scene, other than `geometry` and `output`, into the options. Materials refer to
  /// bodies by `id`. Conditions refer to boundaries and obstacles by their names, or the ids that their add functions
  /// return.
  void set_options(const std::string& json);
  /// Sets one key by its JSON pointer and JSON text. A scene that was read is read again, so any key may be set.
  void set_option(const std::string& pointer, const std::string& value);

  /// Sets the mesh: `dimension` numbers a vertex [m], dimension + 1 vertices a cell, cells of positive volume, and one body
  /// id a cell. Without ids all cells belong to body 0.
  void set_mesh(std::span<const double> vertices, std::span<const int> cells, std::span<const int> bodies = {});

  /// Sets quadratic cells, which have a node at the middle of each edge: 6 nodes in 2D (edges 01, 12, 20), 10 in 3D (01, 12,
  /// 20, 03, 13, 23), as in VTK and meshio; vertices keep their order, and /space/discr_order becomes 2. Throws InputError
  /// for a node off the middle of its edge.
  void set_quadratic_mesh(std::span<const double> nodes, std::span<const int> cells, std::span<const int> bodies = {});

  /// Names facets of the mesh's boundary, `dimension` vertices each in any order, and returns their id. A facet may
  /// belong to several boundaries. The mesh must be set before.
  int add_boundary(const std::string& name, std::span<const int> facets);
  /// Names the facets whose vertices are all in the closed box. Throws InputError if there are none.
  int add_boundary(const std::string& name, std::span<const double> box_min, std::span<const double> box_max);
  /// Names the facets whose middle X (`dimension` numbers) satisfies the rule.
  int add_boundary(const std::string& name, const std::function<bool(const double* X)>& rule);

  /// Gives bodies a name, which options may write instead of their ids; several bodies may have the same.
  void name_body(const std::string& name, int body) { body_names_[name].push_back(body); }

  /// Adds an obstacle of edges (two vertices each) and, in 3D, triangles (three vertices each), and returns its id. Vertices
  /// of no edge and no triangle collide as points.
  int add_obstacle(const std::string& name, std::span<const double> vertices, std::span<const int> edges,
                   std::span<const int> triangles = {});

  /// Sets a law of the program for a body. The options still give that body a material, for its density and as a scale.
  void set_law(int body, std::shared_ptr<const OwnLaw> law);

  int dimension() const { return dimension_; }  ///< 2 or 3

 private:
  friend class AnySimulation;
  struct Part {  ///< a boundary or an obstacle
    std::string name;
    int id;
    std::vector<double> vertices;
    std::vector<int> edges, triangles;
    std::vector<int> facets;  ///< of the mesh
  };
  template <int Dim>
  scene::Geometry<Dim> geometry() const;
  template <int Dim>
  Setup<Dim> setup(std::vector<std::string>& warnings) const;
  int max_threads() const;
  int next_id(const std::string& name) const;
  int add_facets(const std::string& name, const std::function<bool(const std::vector<int>& facet)>& takes);

  int dimension_;
  std::string options_ = "{}";
  std::string scene_file_;
  std::vector<scene::Override> overrides_;
  std::vector<double> vertices_;
  std::vector<int> cells_, bodies_;
  std::vector<Part> boundaries_, obstacles_;
  std::map<std::string, std::vector<int>> body_names_;
  std::map<int, std::shared_ptr<const OwnLaw>> laws_;  ///< by body
  std::optional<scene::Scene> scene_;
};

/// Writes `dimension` numbers (a scalar: one) for the rest position X [m] and the time t [s].
using HostFunction = std::function<void(const double* X, double t, double* value)>;

/// The part of the mesh over which a term sums: the whole mesh, or the patch around an operation of the remesher. A patch
/// has its own vertex numbers. Valid during a call.
struct HostPart {
  int dimension;
  std::span<const double> X;                ///< rest positions [m]; obstacles' vertices come last
  std::span<const int> cells, bodies;       ///< dimension + 1 vertices each, and their body
  std::span<const int> facets, boundaries;  ///< of the bodies' boundary, dimension vertices each; ids, -1: none
  double t;                                 ///< end of the step [s]
};

/// An energy E(x) of the program with gradient and Hessian, at positions x [m] of the same size as part.X. It must be a sum
/// over cells, facets or points at rest positions, because vertex numbers change. Several threads may call the functions.
struct HostTerm {
  std::function<double(const HostPart& part, ConstVectorView x)> energy;  ///< [J]; NaN where it is not defined
  std::function<void(const HostPart& part, ConstVectorView x, VectorView gradient)> add_gradient;  ///< [N]
  /// Passes symmetric blocks [N/m] to `add`. The library projects them to semi-definite ones where it needs to.
  std::function<void(const HostPart& part, ConstVectorView x, const StiffnessReceiver& add)> add_hessian;
};

/// MeshChange for a program that does not know the dimension at compile time.
struct AnyMeshChange {
  std::vector<int> vertex, cell, facet, facet_parent;
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation;
  /// L2 projection, which keeps integrals: takes a row for each old vertex, returns a row for each new one. Throws
  /// InputError once the listener's call has ended.
  std::function<MatrixX(const MatrixX& fields)> project;
};

/// A simulation that a program advances step by step. One thread uses it at a time; different objects are independent.
/// Spans are valid until a call changes the simulation. An unknown name throws an InputError that lists the known ones.
/// A callback may read and save the state, which is that before the step, and must change nothing (see Simulation).
///
///     itr::AnySimulation simulation(itr::Model::from_scene("scene.json"));
///     while (!simulation.finished() && simulation.step().ok) use(simulation.positions());
class ITR_EXPORT AnySimulation {
 public:
  /// Copies the model. Throws InputError if the model cannot be simulated. `registry` holds the linear solvers; null means
  /// those that the library finds.
  explicit AnySimulation(const Model& model, Logger logger = {}, std::shared_ptr<linear::Registry> registry = nullptr);
  ~AnySimulation();
  AnySimulation(AnySimulation&&) noexcept;  ///< a moved-from object may only be destroyed

  int dimension() const;  ///< 2 or 3
  /// The wrapped simulation. Throws std::bad_variant_access for the other dimension.
  template <int Dim>
  Simulation<Dim>& as();

  // Steps.

  /// Takes one step of length dt [s]. With dt = 0 the length is that of the step before, or the one in the options. If the
  /// result is not ok, the state is as before the step.
  StepResult step(double dt = 0);
  /// Finds the mesh of the next step and stays at the start of that step, on the new mesh. Sub-iterations on a frozen mesh
  /// begin with it.
  StepResult adapt(double dt);
  double step_length() const;                        ///< dt of the next step() without argument [s]
  double time() const;                               ///< [s]
  int steps() const;                                 ///< number of steps taken
  bool finished() const;                             ///< whether all steps of the options are taken
  const StepReport& report() const;                  ///< see Simulation::report
  const std::vector<std::string>& warnings() const;  ///< of the model's options

  // Conditions, from the next step on. An array has values at the vertices of the present mesh, or at all nodes. It is taken
  // as a function of rest position, linear on the present cells or quadratic along curved edges, so that it survives
  // remeshing.

  /// Prescribes displacements [m] of the components whose flag in `mask` is not 0. If all flags are 0, the boundary is
  /// released.
  void fix(const std::string& boundary, std::span<const int> mask, HostFunction displacement);
  void fix(const std::string& boundary, std::span<const int> mask, std::span<const double> displacements);  ///< the same
  /// Sets the force by rest area [N/m^2], in 2D by rest length [N/m]. Null removes it.
  void set_traction(const std::string& boundary, HostFunction traction);
  void set_traction(const std::string& boundary, std::span<const double> tractions);  ///< dimension numbers a vertex
  /// Sets the pressure against the deformed surface [N/m^2], in 2D [N/m]. Null removes it.
  void set_pressure(const std::string& boundary, HostFunction pressure);
  void set_pressure(const std::string& boundary, std::span<const double> pressures);  ///< a number a vertex
  void set_acceleration(HostFunction acceleration);              ///< body force by mass [m/s^2]; null removes it
  void set_acceleration(std::span<const double> accelerations);  ///< dimension numbers a vertex
  /// Sets the strain of the bodies where they are free of stress, the same in all directions (docs/theory.md,
  /// "Eigenstrain"): a number a vertex, above -1, such as that of heat. An empty span removes it, as it does one of the
  /// options.
  void set_eigenstrain(std::span<const double> strains);
  /// Moves an obstacle by a displacement from rest [m].
  void move_obstacle(const std::string& obstacle, HostFunction displacement);
  /// Moves the vertices of an obstacle to positions at the end of the next steps [m], in the order of add_obstacle.
  void move_obstacle(const std::string& obstacle, std::span<const double> positions);
  /// Sets dead forces [N] on the nodes, `dimension` numbers each. They keep acting on the same points of the body when
  /// the mesh changes. An empty span removes them.
  void set_forces(std::span<const double> forces);
  /// Adds forces that depend on present positions to f [N], for vertices at rest positions X and positions x [m]. The
  /// vectors' sizes change when the mesh does, also within a step.
  using ForceFunction = std::function<void(ConstVectorView X, ConstVectorView x, double t, VectorView f)>;
  /// Passes blocks of -df/dx [N/m] to `add`.
  using StiffnessFunction =
      std::function<void(ConstVectorView X, ConstVectorView x, double t, const StiffnessReceiver& add)>;
  /// Sets forces that depend on present positions. Null removes them. With their stiffness a step takes fewer rounds.
  /// Throws InputError if the mesh has curved edges.
  void set_follower_forces(ForceFunction forces, StiffnessFunction stiffness = nullptr);
  /// Adds a term to the incremental potential, or replaces the one of this name. A term of null functions is removed.
  /// Throws InputError if the mesh has curved edges.
  void set_term(const std::string& name, HostTerm term);
  /// Sets the velocities of the bodies' nodes [m/s], for a start or for a state from elsewhere.
  void set_velocities(std::span<const double> velocities);
  void freeze_mesh(bool frozen);  ///< stops remeshing while true

  // The state.

  int num_vertices() const;  ///< of the bodies
  int num_cells() const;     ///< triangles or tetrahedra
  int num_facets() const;    ///< of their boundary
  /// Vertices, then the nodes of curved edges; as many as vertices where all edges are straight.
  int num_nodes() const;
  std::vector<int> curved_edges() const;           ///< two vertices each, in the order of their nodes
  std::span<const double> positions() const;       ///< dimension numbers a node [m]
  std::span<const double> velocities() const;      ///< the same [m/s]
  std::vector<double> rest_positions() const;      ///< the same [m]
  std::vector<int> cells() const;                  ///< dimension + 1 vertices each
  std::vector<int> bodies() const;                 ///< a cell
  std::vector<int> facets() const;                 ///< of the boundary: dimension vertices each, outward
  std::vector<int> facet_boundaries() const;       ///< ids of Model::add_boundary; -1: none
  std::vector<double> obstacle_positions() const;  ///< of all obstacles, one after the other [m]
  /// Turns the computation of forces after each step on or off. It costs a few gradients a step.
  void watch_forces(bool watched);
  const NodalForces& forces() const;  ///< dimension numbers a node [N]; empty unless watched
  /// Sum of all forces on parts [N] and its moment about a point [N m], see itr::resultant. Forces must be watched.
  struct Resultants {
    std::vector<double> force, moment;  ///< dimension numbers; one in 2D, three in 3D
  };
  /// The resultant on several parts together: of what acts on boundaries and bodies, and of what bodies do to obstacles. A
  /// part is a name or an id (`"3"`): names are tried before ids, and of each those of boundaries, then obstacles, then
  /// bodies; `"boundary:3"`, `"obstacle:3"` and `"body:3"` look among these alone. Throws InputError for what nothing has.
  Resultants resultant(std::span<const std::string> parts, std::span<const double> about) const;
  Resultants resultant(const std::string& part) const;  ///< about the origin
  /// The resultant on the part with this id, whatever has it for its name; about the origin where no point is given.
  Resultants resultant(int id, std::span<const double> about = {}) const;
  /// Contact force by present area at each node [Pa], in 2D [N/m]; below 0 where it pulls. Forces must be watched.
  std::vector<double> contact_pressure() const;
  std::vector<double> elastic_density() const;  ///< by cell, of rest volume [J/m^Dim]
  std::vector<double> von_mises() const;        ///< by cell [Pa]
  std::vector<double> stress() const;           ///< Cauchy's by cell, dimension^2 numbers, row by row [Pa]

  /// A saved state, see Snapshot.
  using Saved = std::variant<Snapshot<2>, Snapshot<3>>;
  Saved save() const;  ///< costs almost nothing, see Simulation::save
  /// Goes back to a saved state. Throws InputError for a state of another simulation.
  void restore(const Saved& saved);

  // Events. Null removes a listener. An exception of a listener leaves step(): the step is undone, except after a change of
  // the mesh, when it is done.

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
