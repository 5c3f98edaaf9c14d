// SPDX-License-Identifier: MIT
#pragma once

#include "fem/hessian_sink.hpp"
#include "itr/types.hpp"

namespace itr {

/// The values that a field has at its unknowns.
inline VectorX at_unknowns(const DofMap& dofs, ConstVectorView field) {
  VectorX values(dofs.num_unknowns);
  for (Eigen::Index i = 0; i < field.size(); ++i)
    if (dofs.unknown[i] != kNone) values[dofs.unknown[i]] = field[i];
  return values;
}
/// The field that has these values at its unknowns, and is 0 elsewhere.
inline VectorX at_dofs(const DofMap& dofs, ConstVectorView values) {
  VectorX field = VectorX::Zero(static_cast<Eigen::Index>(dofs.unknown.size()));
  for (Eigen::Index i = 0; i < field.size(); ++i)
    if (dofs.unknown[i] != kNone) field[i] = values[dofs.unknown[i]];
  return field;
}

}  // namespace itr
