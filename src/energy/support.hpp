// SPDX-License-Identifier: MIT
// Springs and coupled points of a setup, as plain values. They are entries of StepSetup::nodal_loads, as rigid bodies are
// of Material::own.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "itr/energy.hpp"

namespace itr {

/// Springs from a surface to where it is at rest: a traction -stiffness * displacement on boundary facets with these tags.
struct Spring {
  std::string name{};
  std::vector<int> surfaces{};
  Mat<3> stiffness = Mat<3>::Zero();  ///< by rest area [N/m^3], symmetric, not negative; in 2D of x and y
};

/// A point that moves with the mean of boundary facets with these tags, and acts on them by distributed forces
/// (docs/theory.md, "Coupled points"). In 2D third components of vectors mean nothing, and rotations are about z.
struct Coupling {
  std::string name{};
  std::vector<int> surfaces{};
  bool is_rigid = false;                     ///< the facets move as a rigid body
  Vec<3> point = Vec<3>::Zero();             ///< at rest [m]
  std::array<bool, 3> held_position{};       ///< components of its displacement that are prescribed
  std::array<bool, 3> held_rotation{};       ///< the same of the turn
  std::function<Vec<3>(double t)> motion{};  ///< its prescribed displacement [m]; empty: 0
  std::function<Vec<3>(double t)> turn{};    ///< its prescribed rotation vector [rad]; empty: 0
  std::function<Vec<3>(double t)> force{};   ///< on it [N] (2D: [N/m]); empty: none
  std::function<Vec<3>(double t)> moment{};  ///< a couple [N m] (2D: [N]); empty: none
  double mass = 0;                           ///< at it [kg]
  Mat<3> stiffness = Mat<3>::Zero();         ///< of a spring to where it is at rest [N/m]

  bool is_held() const { return held_position != std::array<bool, 3>{} || held_rotation != std::array<bool, 3>{}; }
  bool has_conditions() const { return is_rigid || is_held(); }
};

/// The entry of springs, which makes their energy on any cells.
template <int Dim>
struct SpringEntry {
  std::shared_ptr<const Spring> value;
  std::shared_ptr<const Energy> operator()(const CellSet<Dim>& cells, double t, double scale) const;
};

/// The entry of a coupled point, which makes nothing: a step makes its terms, of the whole surface (CoupledPoints).
template <int Dim>
struct CouplingEntry {
  std::shared_ptr<const Coupling> value;
  std::shared_ptr<const Energy> operator()(const CellSet<Dim>&, double, double) const { return nullptr; }
};

/// The values of all such entries, in their order.
template <typename Entry, typename Factory>
auto values_of(const std::vector<Factory>& loads) {
  std::vector<decltype(Entry::value)> values;
  for (const Factory& load : loads)
    if (const Entry* const entry = load.template target<Entry>()) values.push_back(entry->value);
  return values;
}
template <int Dim>
std::vector<std::shared_ptr<const Spring>> springs_of(const std::vector<TermFactory<Dim>>& loads) {
  return values_of<SpringEntry<Dim>>(loads);
}
template <int Dim>
std::vector<std::shared_ptr<const Coupling>> couplings_of(const std::vector<TermFactory<Dim>>& loads) {
  return values_of<CouplingEntry<Dim>>(loads);
}

}  // namespace itr
