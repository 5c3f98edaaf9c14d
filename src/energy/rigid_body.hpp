// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "core/check.hpp"
#include "itr/options.hpp"

namespace itr {

/// A body that moves without deforming. The materials of its cells, and of no others, carry it as Material::own; their law
/// is Saint Venant's with nu = 0, by a modulus that Setup::choose_defaults chooses. In 2D third components mean nothing.
struct RigidBody final : OwnLaw {
  Vec<3> about = Vec<3>::Zero();            ///< its point at rest that force and held components refer to [m]
  std::array<bool, 3> held_position{};      ///< components of that point that stay where they are
  std::array<bool, 3> held_rotation{};      ///< about x, y and z; in 2D the last one counts
  std::function<Vec<3>(double t)> force{};  ///< on that point [N] (2D: [N/m]); empty: none
  /// A couple, which does the work moment times turn [N m]; in 2D about z [N]. Empty: none.
  std::function<Vec<3>(double t)> moment{};

  double density(const Eigen::Ref<const MatrixX>&) const override { return no_law(); }
  void stress(const Eigen::Ref<const MatrixX>&, Eigen::Ref<MatrixX>) const override { no_law(); }
  void hessian(const Eigen::Ref<const MatrixX>&, Eigen::Ref<MatrixX>) const override { no_law(); }

 private:
  static double no_law() {
    ITR_CHECK(false, "a rigid body has the law of its material");
    return 0;
  }
};

/// The rigid body that a material is of, or null.
inline const RigidBody* rigid_body_of(const Material& material) {
  return dynamic_cast<const RigidBody*>(material.own.get());
}

/// The rigid bodies with the ids of their cells, in the order of the least of these.
inline std::vector<std::pair<const RigidBody*, std::vector<int>>> rigid_bodies(const std::map<int, Material>& materials) {
  std::vector<std::pair<const RigidBody*, std::vector<int>>> bodies;
  for (const auto& [id, material] : materials) {
    const RigidBody* const body = rigid_body_of(material);
    if (!body) continue;
    const auto known = std::find_if(bodies.begin(), bodies.end(), [&](const auto& entry) { return entry.first == body; });
    (known == bodies.end() ? bodies.emplace_back(body, std::vector<int>()) : *known).second.push_back(id);
  }
  return bodies;
}
inline bool has_rigid_bodies(const std::map<int, Material>& materials) {
  return std::any_of(materials.begin(), materials.end(), [](const auto& entry) { return rigid_body_of(entry.second); });
}

}  // namespace itr
