// SPDX-License-Identifier: MIT
#include "units.hpp"

#include <cmath>
#include <type_traits>

#include "simulation/report_fields.hpp"

namespace itr::output {

std::vector<double> in_units(std::span<const double> values, const Units& units, const char* unit) {
  const double factor = units.factor(unit);
  std::vector<double> result(values.begin(), values.end());
  for (double& value : result) value /= factor;
  return result;
}

std::vector<ForceCurvePoint> in_units(std::vector<ForceCurvePoint> curves, const Units& units) {
  const double force = units.factor("N"), moment = units.factor("N m");
  for (ForceCurvePoint& curve : curves) {
    const auto convert = [&](std::vector<double>& kind) {
      const std::size_t components = kind.size() == 3 ? 2 : 3;  // then those of the moment, 1 in 2D
      for (std::size_t i = 0; i < kind.size(); ++i) kind[i] /= i < components ? force : moment;
    };
    for (auto& kind : curve.kinds) convert(kind);
    if (!curve.cavity.empty()) {
      curve.cavity[0] /= std::pow(units.factor("m"), units.dim);
      curve.cavity[1] /= units.factor("Pa");
    }
    for (auto& source : curve.errors)
      for (auto& kind : source) convert(kind);
  }
  return curves;
}

std::vector<PointValue> in_units(std::vector<PointValue> points, const Units& units) {
  const double length = units.factor("m");
  const auto convert = [&](std::vector<double>& values) {
    for (double& value : values) value /= length;
  };
  for (PointValue& point : points) {
    convert(point.x);
    convert(point.u);
    for (auto& source : point.errors) convert(source);
  }
  return points;
}

StepReport in_units(StepReport report, const Units& units) {
  if (units.is_si()) return report;
  const auto convert = [&](auto& whole, const auto& field) {
    auto& value = whole.*field.member;
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, double>) value = units.from_si(value, field.unit);
  };
  for_each_field(kStepFields, [&](const auto& field) { convert(report, field); });
  for_each_field(kEnergyFields, [&](const auto& field) { convert(report.energy, field); });
  for (RejectedStep& step : report.rejections) step.dt = units.from_si(step.dt, "s");
  for (double& error : report.errors.energy) error = units.from_si(error, "J");
  const double momentum = units.factor("kg m/s"), angular = units.factor("kg m^2/s");
  for (MomentumChange& change : report.remeshing) {
    for (double& value : change.linear) value /= momentum;
    for (double& value : change.angular) value /= angular;
  }
  return report;
}

DisplacementNorms in_units(DisplacementNorms norms, const Units& units) {
  if (units.is_si()) return norms;
  const double length = units.factor("m"), root_of_volume = std::pow(length, 0.5 * units.dim);
  norms.l2 /= length * root_of_volume;
  norms.h1_semi /= root_of_volume;
  norms.h1 = std::hypot(norms.l2, norms.h1_semi);
  norms.linf /= length;
  norms.lp /= length * std::pow(length, units.dim / 8.0);
  return norms;
}

}  // namespace itr::output
