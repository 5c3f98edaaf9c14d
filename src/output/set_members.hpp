// SPDX-License-Identifier: MIT
// Members of the named sets of a setup on the mesh of a frame.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/setup.hpp"

namespace itr::output {

/// One set; other lists than its own are empty.
struct SetMembers {
  std::string name;
  std::vector<std::int64_t> cells;
  std::vector<std::int64_t> facets;    ///< rows of the boundary
  std::vector<std::int64_t> vertices;  ///< that are in it by themselves
};

template <int Dim>
std::vector<SetMembers> set_members(const FrameView<Dim>& frame) {
  std::vector<SetMembers> sets;
  if (!frame.names) return sets;
  const Mesh<Dim>& mesh = frame.mesh;
  const auto list = [](int count, const std::vector<int>& ids, const auto& id_of) {
    std::vector<std::int64_t> members;
    for (int i = 0; i < count; ++i)
      if (std::find(ids.begin(), ids.end(), id_of(i)) != ids.end()) members.push_back(i);
    return members;
  };
  for (const auto& [name, ids] : frame.names->bodies)
    sets.push_back({name, list(mesh.cell_slots(), ids, [&](CellId c) { return mesh.body(c); }), {}, {}});
  for (const auto& [name, tags] : frame.names->surfaces)
    sets.push_back({name,
                    {},
                    list(mesh.facet_slots(), tags, [&](FacetId f) { return mesh.facet_tag(f); }),
                    list(mesh.num_vertices(), tags, [&](VertexId v) { return mesh.vertex_tag(v); })});
  return sets;
}

/// The name with characters that end or quote names in files as in addresses of the web, such as %2F for a slash: different
/// names stay different.
inline std::string plain_name(const std::string& name) {
  const bool is_place = name == "." || name == "..";
  std::string plain;
  for (const char c : name) {
    const bool is_plain =
        std::string_view("/<>&\"'%").find(c) == std::string_view::npos && static_cast<unsigned char>(c) >= ' ';
    plain += is_plain && !is_place ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return plain;
}

}  // namespace itr::output
