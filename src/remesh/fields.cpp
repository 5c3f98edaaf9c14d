// SPDX-License-Identifier: MIT
#include "itr/remesh/fields.hpp"

namespace itr {

template <int Dim>
void RemeshFields<Dim>::follow(const Edit<Dim>& edit, VertexId created) {
  if (!edit.value) return;
  for_each([&](VectorX& field) {
    const Vec<Dim> value = interpolate(field, *edit.value);
    const VertexId v = created == kNone ? edit.value->vertex : created;
    if (created != kNone) field.conservativeResize(field.size() + Dim);
    field.template segment<Dim>(Dim * v) = value;
  });
}

template struct RemeshFields<2>;
template struct RemeshFields<3>;

}  // namespace itr
