// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// State of bodies that remember (energy/cell_field.hpp), a field of rest position: it needs no care where the mesh changes.
struct CellHistory {
  virtual ~CellHistory() = default;
};

}  // namespace itr
