// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "itr/mesh.hpp"
#include "itr/scene.hpp"
#include "itr/setup.hpp"

namespace itr {

/// The boundaries, obstacles and bodies that a program may name in conditions and resultants. Edits of the mesh keep them.
class NamedParts {
 public:
  NamedParts() = default;
  /// `boundaries`: tags by name; `takes_ids`: conditions may name boundaries by id, too.
  template <int Dim>
  NamedParts(const Mesh<Dim>& mesh, std::map<std::string, std::vector<int>> boundaries, const scene::PartNames& named,
             bool takes_ids);

  /// The facet and vertex tags of a boundary. Throws InputError where there is none.
  std::vector<int> tags(const std::string& boundary) const;
  /// All of these parts together: names, else ids, of boundaries, else of obstacles, else of bodies, or "body:3". Throws
  /// InputError for one that nothing has, and where none is given.
  ForceTarget target(std::span<const std::string> parts) const;
  /// The part with this id, whatever names there are.
  ForceTarget target(int id) const;

 private:
  struct Part {
    const char* kind;
    std::string name;  ///< or id
    bool is_id;
    ForceTarget target;
  };
  const ForceTarget& find(const std::string& text) const;
  [[noreturn]] void refuse_unknown(const std::string& text) const;

  std::vector<Part> parts_;  ///< names before ids, boundaries before obstacles before bodies
  std::map<std::string, std::vector<int>> boundaries_;
  std::set<int> tags_;  ///< of facets and vertices, where conditions may name them
  bool takes_ids_ = false;
};

}  // namespace itr
