// SPDX-License-Identifier: MIT
#pragma once

#include <gtest/gtest.h>

#include "mesh/strata.hpp"
#include "remesh/fields.hpp"

namespace itr {

/// Applies an edit with everything that follows it.
template <int Dim>
void apply_edit(const Edit<Dim>& edit, Mesh<Dim>& mesh, RemeshFields<Dim>& fields, Strata<Dim>& strata) {
  const VertexId created = mesh.apply(edit);
  fields.follow(edit, created, mesh.node_slots() - static_cast<int>(edit.inserted_nodes.size()));
  strata.follow(edit, created);
  ASSERT_EQ(mesh.find_defect(), "");
  ASSERT_EQ(strata.find_misfit(mesh), "");
}

}  // namespace itr
