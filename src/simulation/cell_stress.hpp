// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "simulation/state.hpp"

namespace itr {

struct CellStress {
  std::vector<double> von_mises;  ///< a cell [Pa]; in 2D of the plane stress, or strain, that the material says
  std::vector<double> cauchy;     ///< Dim x Dim a cell, row-major [Pa]
  std::vector<double> pressure;   ///< as AskedFields::pressure [Pa]
  std::vector<double> stretches;  ///< as AskedFields::stretches
};

/// Stress of each cell in the present state.
template <int Dim>
CellStress cell_stress(const Simulation<Dim>& simulation);

extern template CellStress cell_stress(const Simulation<2>&);
extern template CellStress cell_stress(const Simulation<3>&);

}  // namespace itr
