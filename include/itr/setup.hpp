// SPDX-License-Identifier: MIT
// Everything that defines a simulation, as plain values in SI units. A scene file is read into it; a program that embeds the
// library fills it in directly.
#pragma once

#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "itr/mesh.hpp"
#include "itr/options.hpp"

namespace itr {

/// A vector-valued function of rest position X [m] and time t [s]. A function may tell apart points of one position by the
/// other members of X; most take `const Vec<Dim>& X`.
template <int Dim>
using SpaceTimeFunction = std::function<Vec<Dim>(const RestPoint<Dim>& X, double t)>;

/// Collision-only geometry that moves as prescribed: no unknowns.
template <int Dim>
struct Obstacles {
  std::vector<Vec<Dim>> rest;                   ///< vertices [m]
  std::vector<std::array<int, 2>> edges;        ///< 2D: surface edges; 3D: edges of faces and codimensional edges
  std::vector<std::array<int, 3>> triangles;    ///< 3D only
  std::vector<int> motion;                      ///< per vertex: index into `motions`, or kNone for a fixed one
  std::vector<SpaceTimeFunction<Dim>> motions;  ///< displacement from rest [m]
  /// First vertices of planes without end, an edge in 2D and a regular triangle in 3D. A simulation makes them larger before
  /// bodies come near their borders.
  std::vector<int> flats{};
};

struct Retraction;  // opaque
struct Shape;       // opaque

/// A surface that collides in place of the bodies' boundary. Its vertices are displaced by `weights` times the displacements
/// of the mesh's vertices.
template <int Dim>
struct CollisionProxy {
  std::vector<Vec<Dim>> rest;                            ///< vertices [m]
  std::vector<std::array<int, 2>> edges;                 ///< 2D: surface edges; 3D: edges of faces and codimensional edges
  std::vector<std::array<int, 3>> triangles;             ///< 3D only
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights;  ///< a row for each of its vertices, a column for each of the mesh's
  std::shared_ptr<const Retraction> retraction{};        ///< where gaps are averaged
};

/// A displacement prescribed at the vertices of the boundary facets with a tag, and at vertices with this tag. The tag of a
/// vertex goes before those of its facets.
template <int Dim>
struct DirichletCondition {
  int tag = 0;
  std::array<bool, Dim> components{};   ///< which are prescribed
  SpaceTimeFunction<Dim> displacement;  ///< from rest [m]
};

/// Traction on the boundary facets with a tag, force per rest area [N/m^2] (2D: per rest length [N/m]).
template <int Dim>
struct NeumannCondition {
  int tag = 0;
  SpaceTimeFunction<Dim> traction;
};

/// Pressure on the deformed boundary facets with a tag, along their inward normals [N/m^2] (2D: [N/m]).
template <int Dim>
struct PressureCondition {
  int tag = 0;
  std::function<double(const RestPoint<Dim>& X, double t)> pressure;
};

/// A fluid that comes between surfaces in contact: it wets facets with given tags, along facets that share edges (2D:
/// vertices), where contact presses by less than a critical pressure, and leaves them where contact shuts them. A facet that
/// is wet has another tag, so that a PressureCondition with that one acts where the fluid is. Conditions that hold
/// everywhere need both tags.
struct Fluid {
  std::string place{};       ///< in messages
  std::map<int, int> wet{};  ///< tags of wet facets by those of dry ones
  std::vector<int> from{};   ///< tags (dry) of facets where it is in any case, or beside which it begins; empty: everywhere
  std::vector<int> leaks_to{};                ///< tags (dry) of facets that it should not come to; empty: none
  std::optional<double> critical_pressure{};  ///< [Pa] (2D: [N/m]); empty: that of the fluid
};

/// Gas or fluid in a closed cavity. Its overpressure p acts on the deformed facets with these tags and follows from the
/// volume V that they enclose, V0 at rest. Of a gas p = (p0 + external) (V0 / V)^exponent - external, of a fluid
/// p = p0 - bulk_modulus ln(V / V0).
struct Cavity {
  std::string name{};
  std::vector<int> surfaces{};                 ///< tags of facets; together they have to close
  std::function<double(double t)> pressure{};  ///< p0, the overpressure at V0 [Pa] (2D: [N/m])
  double external_pressure = 101300;           ///< that acts from outside anyway [Pa]
  double exponent = 1.4;                       ///< of a gas: 1 at constant temperature
  double bulk_modulus = 0;                     ///< of a fluid [Pa]; 0: a gas
};

template <int Dim>
struct InitialCondition {
  int body = 0;
  SpaceTimeFunction<Dim> value;  ///< evaluated at t0
};

/// Vertices whose forces are summed: on surfaces, of bodies, or of obstacles. Each counts once.
struct ForceTarget {
  std::string name{};
  std::vector<int> surfaces{};           ///< tags of boundary facets
  std::vector<int> bodies{};             ///< ids
  std::vector<int> obstacle_vertices{};  ///< indices into Obstacles::rest
  std::array<double, 3> about{};         ///< point of moments [m]
};

/// A point of a body of which the displacement is asked for.
struct PointTarget {
  std::string name{};
  std::array<double, 3> rest{};  ///< its rest position [m]
};

/// Ids that names stand for: of bodies, and of facets and vertices (their tags). An id may stand in several.
struct SetNames {
  std::map<std::string, std::vector<int>> bodies, surfaces;
};

/// Fields that observers get beside positions, velocities and elastic density. Others are not computed.
struct FieldOptions {
  bool contact_forces = false, friction_forces = false, reaction_forces = false;
  bool von_mises = false, stress = false;
  bool kinetic_energy = false, momentum = false;
  bool applied_forces = false;
  std::vector<ForceTarget> curves{};  ///< summed forces
  std::vector<PointTarget> points{};  ///< displacements
  bool error_bars = false;            ///< estimate errors of energy, curves and points
  bool pressure = false, stretches = false, contact_pressure = false;
  bool any_forces() const {
    return contact_forces || contact_pressure || friction_forces || reaction_forces || applied_forces || !curves.empty();
  }
};

/// Tolerances of remeshing that follow the energy stored so far, times RemeshOptions::relative_tolerance. The numbers of
/// `remesh` are their upper bounds. Setup::choose_defaults sets it.
struct FollowsStoredEnergy {
  bool split = false, collapse = false, swap = false, smooth = false;
};

/// Statics: half the weight [N/m] times |x - x0|^2 in the first rounds of a solve, x0 where the round begins. Nothing of it
/// is left where more rounds follow.
struct LaggedRegularization {
  double weight = 0;
  int rounds = 1;
};

/// The part of a setup that does not depend on the mesh: materials, conditions, options.
template <int Dim>
struct ITR_EXPORT StepSetup {
  Obstacles<Dim> obstacles;
  std::optional<CollisionProxy<Dim>> proxy;  ///< not with remeshing
  std::map<int, Material> materials;         ///< by body id; every body of the mesh has one
  std::vector<DirichletCondition<Dim>> dirichlet;
  std::vector<NeumannCondition<Dim>> neumann;
  std::vector<PressureCondition<Dim>> pressure;
  std::vector<Fluid> fluids;
  std::vector<Cavity> cavities;
  std::vector<Tie> ties;
  std::vector<std::shared_ptr<const Shape>> shapes;  ///< geometries of surfaces (docs/theory.md, "True shapes")
  SpaceTimeFunction<Dim> body_acceleration;  ///< [m/s^2], positive along the axes: gravity is (0, -9.81); empty: none

  std::vector<TermFactory<Dim>> nodal_loads;  ///< dead loads on vertices, as point_forces makes them

  TimeOptions time;
  ContactOptions contact;
  NewtonOptions newton;
  RemeshOptions remesh;
  FollowsStoredEnergy follows_stored_energy;
  std::vector<DampingOptions> damping;  ///< Rayleigh damping; without effect in statics
  FieldOptions fields;
  bool lump_mass = false;
  /// Pressure and follower forces that have no potential are taken at the solution of the solve before. A step fails where
  /// they end farther off those of its own solution than this fraction of themselves.
  double lagged_load_tolerance = 1e-2;
  /// Rounds for what is lagged (friction, pressure, damping) go on until no force at a vertex changes by more than this part
  /// of the largest. Where they do not get there the step is cut, or where it may not, a warning says so. 0: rounds as
  /// ContactOptions and DampingOptions say. A number of friction_iterations limits them.
  double lagging_tolerance = 0;
  LaggedRegularization lagged_regularization;
  int quadrature_degree = kElasticDegree;  ///< of elasticity on cells with curved edges: 1 to 5

  Units units;  ///< that messages and results are to be in; all numbers here are in SI units

  // Only a program can set the following.
  std::vector<TermFactory<Dim>> terms;
  FollowerForces<Dim> follower;
  /// Called after each Newton iteration on the whole mesh. Returning false cancels the step.
  std::function<bool(const NewtonProgress&)> on_iteration;

  /// Whether solutions without inertia depend on the steps that led to them.
  bool depends_on_path() const {
    return contact.has_friction() || contact.adhesion.tangential_coefficient > 0 || !damping.empty() || !fluids.empty() ||
           std::ranges::any_of(materials, [](const auto& entry) { return has_memory(entry.second); });
  }
  /// Throws InputError for the first value that is out of range, missing or not finite. Its place is the JSON pointer of a
  /// scene if there is one.
  void validate() const;
};

/// A whole problem: mesh, initial conditions, and everything of StepSetup.
template <int Dim>
struct ITR_EXPORT Setup : StepSetup<Dim> {
  Mesh<Dim> mesh;            ///< with body ids and tags of facets and vertices
  SetNames names;            ///< for output
  std::map<int, int> order;  ///< order of elements by body: 1, or 2 for curved edges; 1 for bodies that are not listed
  std::vector<InitialCondition<Dim>> initial_displacement, initial_velocity, initial_acceleration;
  bool consistent_initial_acceleration = false;  ///< solve M a0 = f0 instead
  LinearOptions linear;

  /// Fills in values that are left open and returns a sentence on each. A Simulation calls it.
  ///
  /// - Ties get ContactOptions::tie_reach, a quarter of the longest edge of what they bond.
  /// - dhat 0 becomes a thousandth of the thinnest body. It is less where edges are short, gaps narrow, or motions that
  ///   are prescribed without inertia small.
  /// - Friction velocity 0 becomes in dynamics a part of the speed that the scene is driven with. Without inertia each step
  ///   takes a thousandth of the largest relative motion in it, by its length.
  /// - Barrier stiffness 0 becomes a tenth of the stiffest body's modulus [Pa] in the convergent form, and its equivalent in
  ///   the plain form, unless it is adaptive.
  /// - An open split tolerance becomes relative_tolerance times an energy of the scene (docs/theory.md).
  /// - Whoever chose the split tolerance, collapses may cost a hundredth of it, and swaps and moves that improve the shape a
  ///   millionth.
  /// - A shortest edge to split that is left open becomes 1e-6 of the bodies' diagonal.
  std::vector<std::string> choose_defaults();
  /// Validates the whole setup, mesh included. A Simulation calls it.
  void validate() const;
};

extern template std::vector<std::string> Setup<2>::choose_defaults();
extern template std::vector<std::string> Setup<3>::choose_defaults();
extern template void StepSetup<2>::validate() const;
extern template void StepSetup<3>::validate() const;
extern template void Setup<2>::validate() const;
extern template void Setup<3>::validate() const;

}  // namespace itr
