// SPDX-License-Identifier: MIT
// Everything that defines a simulation, as plain values with units: what a scene file is read into, and what a program
// that embeds the library fills in itself. SI units throughout.
#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "itr/energy/contact/options.hpp"
#include "itr/energy/damping_options.hpp"
#include "itr/energy/host_terms.hpp"
#include "itr/energy/material.hpp"
#include "itr/fem/options.hpp"
#include "itr/linear/options.hpp"
#include "itr/mesh/mesh.hpp"
#include "itr/newton/options.hpp"
#include "itr/remesh/options.hpp"
#include "itr/time/options.hpp"

namespace itr {

/// A vector-valued function of rest position X [m] and time t [s].
template <int Dim>
using SpaceTimeFunction = std::function<Vec<Dim>(const Vec<Dim>& X, double t)>;

/// Collision-only geometry that moves as prescribed: no unknowns.
template <int Dim>
struct Obstacles {
  std::vector<Vec<Dim>> rest;                   ///< vertices [m]
  std::vector<std::array<int, 2>> edges;        ///< 2D: surface edges; 3D: edges of faces and codimensional edges
  std::vector<std::array<int, 3>> triangles;    ///< 3D only
  std::vector<int> motion;                      ///< per vertex: index into `motions`, or kNone for a fixed one
  std::vector<SpaceTimeFunction<Dim>> motions;  ///< displacement from rest [m]
};

/// A surface that touches in place of the bodies' boundary and moves with their vertices: displacements of its vertices are
/// `weights` times those of the mesh's.
template <int Dim>
struct CollisionProxy {
  std::vector<Vec<Dim>> rest;                            ///< vertices [m]
  std::vector<std::array<int, 2>> edges;                 ///< 2D: surface edges; 3D: edges of faces and codimensional edges
  std::vector<std::array<int, 3>> triangles;             ///< 3D only
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights;  ///< a row for each of its vertices, a column for each of the mesh's
};

/// Displacement prescribed at the vertices of the boundary facets with a tag, and at the vertices that have it themselves,
/// whatever their facets say.
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
  std::function<double(const Vec<Dim>& X, double t)> pressure;
};

template <int Dim>
struct InitialCondition {
  int body = 0;
  SpaceTimeFunction<Dim> value;  ///< evaluated at t = 0
};

/// Vertices whose forces are summed: on surfaces, of bodies, or of obstacles. Each counts once.
struct ForceTarget {
  std::string name;
  std::vector<int> surfaces;           ///< tags of boundary facets
  std::vector<int> bodies;             ///< ids
  std::vector<int> obstacle_vertices;  ///< indices into Obstacles::rest
  std::array<double, 3> about{};       ///< what moments are about [m]
};

/// What observers are shown beside positions, velocities and elastic density. What is not asked for is not computed.
struct FieldOptions {
  bool contact_forces = false, friction_forces = false, reaction_forces = false;
  bool von_mises = false, stress = false;
  bool kinetic_energy = false, momentum = false;
  bool applied_forces = false;
  std::vector<ForceTarget> curves;  ///< summed forces
  bool any_forces() const {
    return contact_forces || friction_forces || reaction_forces || applied_forces || !curves.empty();
  }
};

/// What acts in a step, whatever mesh it begins on.
template <int Dim>
struct StepSetup {
  Obstacles<Dim> obstacles;
  std::optional<CollisionProxy<Dim>> proxy;  ///< not with remeshing
  std::map<int, Material> materials;         ///< by body id; every body of the mesh has one
  std::vector<DirichletCondition<Dim>> dirichlet;
  std::vector<NeumannCondition<Dim>> neumann;
  std::vector<PressureCondition<Dim>> pressure;
  SpaceTimeFunction<Dim> body_acceleration;  ///< acts along +: gravity is (0, -9.81) [m/s^2]; empty: none

  TimeOptions time;
  ContactOptions contact;
  NewtonOptions newton;
  RemeshOptions remesh;
  /// Tolerances of splits and of collapses are at most those of `remesh`, and by RemeshOptions::relative_tolerance of the
  /// energy that the bodies have stored so far: Setup::choose_defaults sets it where neither is given.
  bool split_follows = false, collapse_follows = false;
  std::vector<DampingOptions> damping;  ///< Rayleigh damping; without effect in statics
  FieldOptions fields;
  bool lump_mass = false;
  int quadrature_degree = kElasticDegree;  ///< of elasticity on cells with curved edges: 1 to 5

  // What only a program can add.
  std::vector<TermFactory<Dim>> terms;
  FollowerForces<Dim> follower;
  /// Called after each Newton iteration of a whole mesh; false ends the step, which is then not done. Empty: nobody asks.
  std::function<bool(const NewtonProgress&)> on_iteration;

  /// Throws InputError for the first thing that is out of range, missing, or not finite. Places are those of a scene file
  /// where it has them.
  void validate() const;
};

/// A simulation from its start.
template <int Dim>
struct Setup : StepSetup<Dim> {
  Mesh<Dim> mesh;            ///< with body ids and tags of facets and vertices
  std::map<int, int> order;  ///< of the elements by body: 1, or 2 for curved edges; bodies that are not named: 1
  std::vector<InitialCondition<Dim>> initial_displacement, initial_velocity, initial_acceleration;
  bool consistent_initial_acceleration = false;  ///< solve M a0 = f0 instead
  LinearOptions linear;

  /// Fills in what is left open, and says what with, a sentence each. Activation distance 0: a thousandth of the thinnest
  /// body, less where edges are short or gaps narrow. Barrier stiffness 0, unless adaptive: a tenth of the stiffest body's
  /// modulus [Pa], or what that is in the other form. Split tolerance 0: relative_tolerance times an energy of the scene,
  /// where nothing prescribed feeds it what it has at the start and gravity gives, else what is stored so far; at most 1 %
  /// of sum(E V), which bodies have at strains of a tenth; collapses then may cost a hundredth of that. Least edge to split
  /// below 0: 1e-6 of the bodies' diagonal. A Simulation calls it.
  std::vector<std::string> choose_defaults();
  /// That of all, what belongs to the mesh included. A Simulation calls it.
  void validate() const;
};

extern template std::vector<std::string> Setup<2>::choose_defaults();
extern template std::vector<std::string> Setup<3>::choose_defaults();
extern template void StepSetup<2>::validate() const;
extern template void StepSetup<3>::validate() const;
extern template void Setup<2>::validate() const;
extern template void Setup<3>::validate() const;

}  // namespace itr
