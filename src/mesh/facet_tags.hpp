// SPDX-License-Identifier: MIT
#pragma once

#include <set>

#include "itr/mesh.hpp"

namespace itr {

/// The tags that facets of a mesh have.
template <int Dim>
std::set<int> facet_tags(const Mesh<Dim>& mesh) {
  std::set<int> tags;
  for (const FacetId f : mesh.live_facets()) tags.insert(mesh.facet_tag(f));
  tags.erase(kNoTag);
  return tags;
}

}  // namespace itr
