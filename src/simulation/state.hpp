// SPDX-License-Identifier: MIT
// The state of a simulation, for itr/simulation.hpp.
#pragma once

#include <vector>

#include "energy/cell_field.hpp"
#include "energy/contact/stiffness.hpp"
#include "energy/elastic/elastic.hpp"
#include "fem/chord_levels.hpp"
#include "itr/simulation.hpp"
#include "linear/reuse.hpp"
#include "mesh/strata.hpp"
#include "newton/newton.hpp"
#include "remesh/memory.hpp"
#include "time/integrator.hpp"
#include "time/step_control.hpp"

namespace itr {

/// The state of a simulation. Fields are interleaved over the mesh's nodes, vertices first, and then the obstacles'
/// vertices. The rest of a simulation is a pure function of state and setup, so that a resumed run has the same bits. A new
/// member must be saved by output/checkpoint.cpp.
template <int Dim>
struct State {
  Mesh<Dim> mesh;   ///< compact
  History history;  ///< history.x[0] is the present
  int step = 0;
  double t = 0;                 ///< [s]
  BarrierStiffness stiffness;   ///< where it is adaptive, or was raised so that curves stay near their chords
  QuadratureLevels quadrature;  ///< of the elastic energy, by cell with curved edges
  ChordLevels chords;           ///< that contact acts on
  RemeshMemory remesh_memory;   ///< operations that remeshing refused and need not try again
  Strata<Dim> strata;           ///< of the mesh, once remeshing has found them
  linear::FactorRecord factor;  ///< factor that may serve the next step
  VectorX deviation;            ///< x - x-hat of the last step, where the next one begins [m]; empty before the first
  std::vector<int> doublings;   ///< how often each of Obstacles::flats was made twice as large; empty: none was
  StepControl control;          ///< of adaptive steps
  double stored_energy = 0;     ///< largest elastic and contact energy at the end of a step so far [J]
  double created_energy = 0;    ///< balance of Newmark's steps, see StepProblem::created_energy [J]
};

}  // namespace itr
