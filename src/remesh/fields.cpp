// SPDX-License-Identifier: MIT
#include "remesh/fields.hpp"

#include <algorithm>

namespace itr {

template <int Dim>
void RemeshFields<Dim>::follow(const Edit<Dim>& edit, VertexId created, VertexId first_node) {
  if (!levels.empty())
    for (std::size_t i = 0; i < edit.inserted_cells.size(); ++i) levels.push_back(level_of_new_cell(edit, i));
  const int nodes = static_cast<int>(edit.inserted_nodes.size());
  if (nodes > 0) make_room(first_node + nodes);
  for_each([&](VectorX& field) {
    for (int i = 0; i < nodes; ++i)  // of values before the edit
      field.template segment<Dim>(Dim * (first_node + i)) = interpolate(field, edit.inserted_nodes[i]);
    if (!edit.value) return;
    const Vec<Dim> value = interpolate(field, *edit.value);
    const VertexId v = created == kNone ? edit.value->vertex : created;
    if (field.size() < Dim * (v + 1)) field.conservativeResize(Dim * (v + 1));
    field.template segment<Dim>(Dim * v) = value;
  });
}

template <int Dim>
std::uint8_t RemeshFields<Dim>::level_of_new_cell(const Edit<Dim>& edit, std::size_t i) const {
  using Kind = typename Edit<Dim>::Kind;
  if (levels.empty()) return 0;
  if (edit.kind == Kind::split || edit.kind == Kind::chords) return levels[edit.removed_cells[i / 2]];
  return edit.kind == Kind::curve || edit.kind == Kind::straighten ? levels[edit.removed_cells[i]] : std::uint8_t{0};
}

template <int Dim>
void RemeshFields<Dim>::make_room(int vertices) {
  const Eigen::Index least = Dim * static_cast<Eigen::Index>(vertices);
  for_each([&](VectorX& field) {
    if (field.size() < least) field.conservativeResize(std::max(least, field.size() + field.size() / 2));
  });
}

template <int Dim>
void RemeshFields<Dim>::trim(int vertices) {
  for_each([&](VectorX& field) { field.conservativeResize(Dim * static_cast<Eigen::Index>(vertices)); });
}

template struct RemeshFields<2>;
template struct RemeshFields<3>;

}  // namespace itr
