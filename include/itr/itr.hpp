// SPDX-License-Identifier: MIT
// All that a program needs to simulate: AnySimulation, the facade of either dimension, and below it Simulation<2> and
// Simulation<3> with their Setup. docs/embedding.md is the guide; parts that are of use alone have headers of their own.
#pragma once

#include "itr/core/error.hpp"
#include "itr/core/log.hpp"
#include "itr/core/parallel.hpp"
#include "itr/embed/any_simulation.hpp"
#include "itr/embed/model.hpp"
#include "itr/energy/point_forces.hpp"
#include "itr/linear/registry.hpp"
#include "itr/output/writer.hpp"
#include "itr/scene/scene.hpp"
#include "itr/simulation/resultant.hpp"
#include "itr/simulation/simulation.hpp"
