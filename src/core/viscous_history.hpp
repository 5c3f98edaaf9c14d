// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// State of viscoelastic bodies (energy/viscous.hpp), a field of rest position: it needs no care where the mesh changes.
struct ViscousHistory {
  virtual ~ViscousHistory() = default;
};

}  // namespace itr
