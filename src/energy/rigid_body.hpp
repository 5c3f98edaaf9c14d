// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
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

  /// Whether anything of its motion is held.
  bool is_held() const {
    const auto any = [](const std::array<bool, 3>& held) { return held[0] || held[1] || held[2]; };
    return any(held_position) || any(held_rotation);
  }

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

/// The rigid bodies, in the order of the least of their ids.
inline std::vector<const RigidBody*> rigid_bodies(const std::map<int, Material>& materials) {
  std::vector<const RigidBody*> bodies;
  for (const auto& [id, material] : materials)
    if (const RigidBody* const body = rigid_body_of(material))
      if (std::find(bodies.begin(), bodies.end(), body) == bodies.end()) bodies.push_back(body);
  return bodies;
}
inline bool has_rigid_bodies(const std::map<int, Material>& materials) {
  return std::any_of(materials.begin(), materials.end(), [](const auto& entry) { return rigid_body_of(entry.second); });
}

}  // namespace itr
