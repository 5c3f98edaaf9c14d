// SPDX-License-Identifier: MIT
// The parts of a scene that are plain options: time, contact, solver, remeshing, output.
#pragma once

#include <map>
#include <set>
#include "itr/scene.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// Reads the units of length, mass and time.
Units read_units(const Node& root);
TimeOptions read_time(const Node& root, std::vector<std::string>& warnings);
/// Warns of keys that are given, but do nothing as other keys are.
void warn_of_idle_keys(const Node& root, const TimeOptions& time, bool has_obstacles, std::vector<std::string>& warnings);
/// The length that PolyFEM multiplies tolerances with: h, or 1 for statics (docs/theory.md, "Tolerances").
double characteristic_length(const Node& root, const TimeOptions& time);

/// `shortest_edge` of the rest surfaces, obstacles included: dhat shrinks below it unless the scene gives it (§6.1).
ContactOptions read_contact(const Node& root, double shortest_edge, std::vector<std::string>& warnings);
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

}  // namespace itr::scene
