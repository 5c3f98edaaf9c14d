// SPDX-License-Identifier: MIT
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "arrays.hpp"
#include "itr/mesh.hpp"
#include "itr/scene.hpp"
#include "itr/setup.hpp"
#include "mesh/facet_tags.hpp"

namespace itr {

/// The boundaries, obstacles and bodies that a program may name in conditions and resultants. Edits of the mesh keep them.
class NamedParts {
 public:
  NamedParts() = default;
  /// `boundaries`: tags by name; `takes_ids`: conditions may name boundaries by id, too.
  template <int Dim>
  NamedParts(const Mesh<Dim>& mesh, std::map<std::string, std::vector<int>> boundaries, const scene::PartNames& named,
             bool takes_ids)
      : boundaries_(std::move(boundaries)), takes_ids_(takes_ids) {
    boundaries_.insert(named.surfaces.begin(), named.surfaces.end());
    const std::set<int> surfaces = facet_tags(mesh);
    std::set<int> bodies;
    for (CellId c = 0; c < mesh.cell_slots(); ++c) bodies.insert(mesh.body(c));
    if (takes_ids) {
      tags_ = surfaces;
      for (VertexId v = 0; v < mesh.node_slots(); ++v)
        if (mesh.vertex_tag(v) != kNoTag) tags_.insert(mesh.vertex_tag(v));
    }
    bool are_ids = false;
    const auto add = [&](const char* kind, const std::string& name, ForceTarget target) {
      parts_.push_back({kind, name, are_ids, std::move(target)});
    };
    for (const auto& [name, tags] : boundaries_) add("boundary", name, {.surfaces = tags});
    for (const auto& [name, vertices] : named.obstacles) add("obstacle", name, {.obstacle_vertices = vertices});
    for (const auto& [name, ids] : named.bodies) add("body", name, {.bodies = ids});
    are_ids = true;
    for (const int id : surfaces) add("boundary", std::to_string(id), {.surfaces = {id}});
    for (const auto& [id, vertices] : named.obstacles_by_id)
      add("obstacle", std::to_string(id), {.obstacle_vertices = vertices});
    for (const int id : bodies) add("body", std::to_string(id), {.bodies = {id}});
  }

  /// The facet and vertex tags of a boundary. Throws InputError where there is none.
  std::vector<int> tags(const std::string& boundary) const {
    if (const auto found = boundaries_.find(boundary); found != boundaries_.end()) return found->second;
    int id = 0;
    const auto [end, error] = std::from_chars(boundary.data(), boundary.data() + boundary.size(), id);
    const bool is_id = error == std::errc() && end == boundary.data() + boundary.size();
    if (is_id && tags_.contains(id)) return {id};
    std::vector<std::string> known;
    for (const auto& [name, ignored] : boundaries_) known.push_back("'" + name + "'");
    for (const int other : tags_) known.push_back(std::to_string(other));
    const char* of = takes_ids_ ? "the id of a surface or of points: " : "";
    refuse("boundary", "'" + boundary + "'",
           known.empty() ? "none: there are none" : fmt::format("{}{}", of, fmt::join(known, ", ")));
  }
  /// All of these parts together: names, else ids, of boundaries, else of obstacles, else of bodies, or "body:3". Throws
  /// InputError for one that nothing has, and where none is given.
  ForceTarget target(std::span<const std::string> parts) const {
    if (parts.empty()) refuse("resultant", "no boundary, obstacle or body", "at least one");
    ForceTarget all{.name = "resultant"};
    std::set<int> vertices;
    for (const std::string& text : parts) {
      const ForceTarget& part = find(text);
      all.surfaces.insert(all.surfaces.end(), part.surfaces.begin(), part.surfaces.end());
      all.bodies.insert(all.bodies.end(), part.bodies.begin(), part.bodies.end());
      vertices.insert(part.obstacle_vertices.begin(), part.obstacle_vertices.end());
    }
    all.obstacle_vertices.assign(vertices.begin(), vertices.end());
    return all;
  }
  /// The part with this id, whatever names there are.
  ForceTarget target(int id) const {
    const std::string text = std::to_string(id);
    for (const Part& part : parts_)
      if (part.is_id && part.name == text) {
        ForceTarget target = part.target;
        target.name = "resultant";
        return target;
      }
    refuse_unknown(text);
  }

 private:
  struct Part {
    const char* kind;
    std::string name;  ///< or id
    bool is_id;
    ForceTarget target;
  };
  /// The first part that is called `text`, or else `kind:name`.
  const ForceTarget& find(const std::string& text) const {
    for (const Part& part : parts_)
      if (part.name == text) return part.target;
    for (const Part& part : parts_)
      if (fmt::format("{}:{}", part.kind, part.name) == text) return part.target;
    refuse_unknown(text);
  }
  [[noreturn]] void refuse_unknown(const std::string& text) const {
    std::vector<std::string> known;
    std::string_view kind;
    for (const Part& part : parts_) {
      known.push_back(fmt::format("{}'{}'", kind == part.kind ? "" : part.kind + std::string(" "), part.name));
      kind = part.kind;
    }
    refuse("resultant", "'" + text + "', which nothing has",
           fmt::format("a name or the id of a surface, obstacle or body: {}", fmt::join(known, ", ")));
  }

  std::vector<Part> parts_;  ///< names before ids, boundaries before obstacles before bodies
  std::map<std::string, std::vector<int>> boundaries_;
  std::set<int> tags_;  ///< of facets and vertices, where conditions may name them
  bool takes_ids_ = false;
};

}  // namespace itr
