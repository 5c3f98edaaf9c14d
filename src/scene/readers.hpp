// SPDX-License-Identifier: MIT
// Readers of the parts of a scene.
#pragma once

#include <map>
#include <optional>
#include <set>

#include "energy/elastic/law_table.hpp"
#include "geometry.hpp"
#include "itr/scene.hpp"
#include "itr/setup.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

// From a scene file to one document: `common` and `patch` (docs/scenes.md), root path, command-line overrides.

/// Throws InputError: unreadable file, wrong JSON (with the line), a cycle of `common`, a patch that does not apply, an
/// override that is no JSON. The result has no `common`, `patch`, `root_path` and no null members.
Document load_document(const std::filesystem::path& file, const std::vector<Override>& overrides);

/// Parses a text that a program has made: paths in it are relative to the working directory, and errors call it `name`.
Document parse_document(const std::string& text, const std::string& name, const std::vector<Override>& overrides);

/// Makes values with units of their own numbers, in the units of the document. Throws InputError for other units than a
/// key's.
void convert_quantities(Document& document);

/// Throws InputError for the first key of the document that we do not know, whose value is not what it must be, or that asks
/// for something unsupported. Warns of what is asked for in vain.
void check_keys(const Document& document, std::vector<std::string>& warnings);

// The parts of a scene that are plain options: time, contact, solver, remeshing, output.

/// Reads the units of length, mass and time.
Units read_units(const Node& root);
TimeOptions read_time(const Node& root, std::vector<std::string>& warnings);
/// Warns of keys that are given, but do nothing as other keys are.
void warn_of_idle_keys(const Node& root, const TimeOptions& time, bool has_obstacles, std::vector<std::string>& warnings);
/// The length that PolyFEM multiplies tolerances with: h, or 1 for statics (docs/theory.md, "Tolerances").
double characteristic_length(const Node& root, const TimeOptions& time);

/// `shortest_edge` of the rest surfaces, obstacles included: dhat shrinks below it unless the scene gives it (§6.1).
ContactOptions read_contact(const Node& root, double shortest_edge, std::vector<std::string>& warnings);
LaggedRegularization read_lagged_regularization(const Node& root, const TimeOptions& time,
                                                std::vector<std::string>& warnings);
/// Extent of the bodies at rest, which tolerances are relative to.
struct SceneScale {
  int dimension = 2;
  double diagonal = 1;  ///< of the bounding box [m]
};
/// The tolerances of the paper's vocabulary if one of its keys is there, else those of PolyFEM's main branch.
NewtonOptions read_newton(const Node& root, double characteristic_length, const SceneScale& scale);
LinearOptions read_linear(const Node& root);
RemeshOptions read_remesh(const Node& root);
OutputOptions read_output(const Node& root);
std::vector<DampingOptions> read_damping(const Node& root, const TimeOptions& time);
/// Which fields output/paraview/options asks for.
FieldOptions read_fields(const Node& root);
bool read_lump_mass(const Node& root);
/// Orders of elements by body, of those that `bodies` names.
std::map<int, int> read_order(const Node& root, const LabelIds& labels, const std::set<int>& bodies);
int read_quadrature_degree(const Node& root);

/// Whether the scene of this place is axisymmetric.
bool is_axisymmetric(const Node& node);

// `materials` of a scene (docs/theory.md, "Materials").

/// By body id. InputError for a body of the mesh without one, and for moduli or densities out of range; those that vary are
/// looked at in every element.
template <int Dim>
std::map<int, Material> read_materials(const Node& root, const LabelIds& bodies, const Mesh<Dim>& mesh,
                                       std::vector<std::string>& warnings);

/// The sum of laws that an entry of materials is, whether or not it is stable at rest. InputError for other laws.
LawSum read_law_sum(const Node& node, int dimension);

// `boundary_conditions`, `initial_conditions` and the motion of obstacles (docs/theory.md, "Conditions").

/// Fills the conditions and the obstacles of a setup whose mesh and time are read.
template <int Dim>
void read_conditions(const Node& root, const Sets& sets, ObstacleGeometry<Dim> obstacles, Setup<Dim>& setup,
                     std::vector<std::string>& warnings);

/// Fills in the conditions of PolyFEM's preset problem, if there is one.
template <int Dim>
void read_preset_problem(const Node& root, const LabelIds& bodies, Setup<Dim>& setup);

// `contact/collision_mesh`: a surface that touches in place of the bodies' boundary (docs/theory.md, "Contact").

/// Whether the scene has a collision mesh that matters.
bool has_collision_mesh(const Node& root);

/// Whether it is the bodies' own boundary, cut into smaller facets.
bool is_cut_boundary(const Node& root);

/// Its surface, transformed as the first geometry is, and its weights over the vertices of the setup's mesh, which must be
/// those of the bodies' files in their order; or that mesh's boundary, cut. Nothing where the scene has none.
template <int Dim>
std::optional<CollisionProxy<Dim>> read_collision_mesh(const Node& root, const Geometries& geometries,
                                                       const Setup<Dim>& setup, MeshFiles& files,
                                                       std::vector<std::string>& warnings);

// `/output/forces`: whose forces are summed.

/// Names of sets go before those of geometries, of which one that several have is that of the first. Bodies whose
/// `volume_selection` is no single id have none.
template <int Dim>
PartNames name_parts(const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles, const Sets& sets);

/// Throws InputError for what nothing has, and for names that are there twice.
template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const PartNames& parts, const Sets& sets, const Mesh<Dim>& mesh);
template <int Dim>
std::vector<PointTarget> read_points(const Node& root);

/// Vertices of the obstacles of this name or this `surface_selection`, ascending.
std::vector<int> obstacle_vertices(const PartNames& parts, const Sets& sets, const Label& label);
/// Labels of surfaces with these ids and of obstacles, for messages.
std::string list_with_obstacles(const PartNames& parts, const Sets& sets, std::set<int> ids);

// `/contact/friction_pairs`.

/// Throws InputError for what nothing has, and for a number or a name that both a body and a surface have.
template <int Dim>
std::vector<FrictionPair> read_friction_pairs(const Node& root, const PartNames& parts, const Sets& sets,
                                              const Mesh<Dim>& mesh);

// `/ties`.

/// Throws InputError for ids that no surface of a body has, for one that both sides have, and for a jump of what is not
/// periodic.
template <int Dim>
std::vector<Tie> read_ties(const Node& root, const Sets& sets, const Mesh<Dim>& mesh, const TimeOptions& time);

}  // namespace itr::scene
