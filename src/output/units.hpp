// SPDX-License-Identifier: MIT
// Reports and forces in the units of a scene, as they are written.
#pragma once

#include <span>
#include <vector>

#include "itr/core.hpp"
#include "itr/output.hpp"

namespace itr::output {

std::vector<double> in_units(std::span<const double> values, const Units& units, const char* unit);
std::vector<ForceCurvePoint> in_units(std::vector<ForceCurvePoint> curves, const Units& units);
std::vector<PointValue> in_units(std::vector<PointValue> points, const Units& units);
StepReport in_units(StepReport report, const Units& units);
/// `lp` is that of the exponent 8.
DisplacementNorms in_units(DisplacementNorms norms, const Units& units);

}  // namespace itr::output
