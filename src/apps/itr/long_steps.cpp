// SPDX-License-Identifier: MIT
#include "long_steps.hpp"
#include "energy/rigid_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "itr/core.hpp"
#include "simulation/fluid_front.hpp"
#include "simulation/sizes.hpp"
#include "simulation/step_length.hpp"

namespace itr::cli {

namespace {

/// Value that a scene prescribes, as a function of time at one place.
struct Prescribed {
  std::string name;
  std::function<VectorX(double t)> value;
};

template <int Dim>
RestPoint<Dim> place_with(const Setup<Dim>& setup, int tag) {
  const Mesh<Dim>& mesh = setup.mesh;
  for (const FacetId f : mesh.live_facets())
    if (mesh.facet_tag(f) == tag) return mesh.point(mesh.facet(f)[0]);
  for (const VertexId v : mesh.live_vertices())
    if (mesh.vertex_tag(v) == tag) return mesh.point(v);
  return mesh.point(0);
}

template <int Dim>
std::vector<Prescribed> all_prescribed(const Setup<Dim>& setup, const Vec<Dim>& center) {
  std::vector<Prescribed> all;
  for (const auto& c : setup.dirichlet)
    all.push_back({fmt::format("the prescribed displacement of the surface {}", c.tag),
                   [&c, X = place_with(setup, c.tag)](double t) -> VectorX { return c.displacement(X, t); }});
  for (const auto& c : setup.neumann)
    all.push_back({fmt::format("the traction on the surface {}", c.tag),
                   [&c, X = place_with(setup, c.tag)](double t) -> VectorX { return c.traction(X, t); }});
  for (const auto& c : setup.pressure) {
    const int tag = tag_without_fluid(setup.fluids, c.tag);
    all.push_back({fmt::format("the pressure on the surface {}", tag),
                   [&c, X = place_with(setup, tag)](double t) { return VectorX(VectorX::Constant(1, c.pressure(X, t))); }});
  }
  for (const Cavity& cavity : setup.cavities)
    if (cavity.pressure)
      all.push_back({"the pressure of " + cavity.name,
                     [&cavity](double t) { return VectorX(VectorX::Constant(1, cavity.pressure(t))); }});
  if (setup.body_acceleration)
    all.push_back({"the acceleration of the bodies",
                   [&setup, center](double t) -> VectorX { return setup.body_acceleration(center, t); }});
  const Obstacles<Dim>& obstacles = setup.obstacles;
  for (std::size_t m = 0; m < obstacles.motions.size(); ++m) {
    const auto first = std::find(obstacles.motion.begin(), obstacles.motion.end(), static_cast<int>(m));
    if (first == obstacles.motion.end()) continue;
    const auto vertex = static_cast<std::size_t>(first - obstacles.motion.begin());
    all.push_back({fmt::format("the motion of the obstacle at vertex {}", vertex),
                   [&move = obstacles.motions[m], X = obstacles.rest[vertex]](double t) -> VectorX { return move(X, t); }});
  }
  return all;
}

/// How far values go beyond the straight way from one end of a step to the other, in the worst of some steps, by their range
/// over all of these.
struct Detour {
  double fraction = 0, t = 0;
};

Detour find_detour(const Prescribed& prescribed, const TimeOptions& time) {
  constexpr int kSteps = 64, kSamples = 16;
  Detour worst;
  VectorX low = prescribed.value(time.t0), high = low;
  double longest = 0;
  const int steps = std::min(time.steps, kSteps);
  for (int k = 0; k < steps; ++k) {
    const double begin = time.t0 + time.dt * std::floor(static_cast<double>(k) * time.steps / steps);
    const VectorX start = prescribed.value(begin);
    VectorX last = start;
    double path = 0;
    for (int i = 1; i <= kSamples; ++i) {
      VectorX value = prescribed.value(begin + time.dt * i / kSamples);
      low = low.cwiseMin(value);
      high = high.cwiseMax(value);
      path += (value - last).norm();
      last = std::move(value);
    }
    if (const double detour = path - (last - start).norm(); detour > longest) {
      longest = detour;
      worst.t = begin;
    }
  }
  const double range = (high - low).norm();
  if (range > 0 && std::isfinite(range)) worst.fraction = longest / range;
  return worst;
}

/// Period of the slowest bending of a slender cantilever that fits into the largest body [s].
template <int Dim>
double slowest_period(const Setup<Dim>& setup) {
  double slowest = 0;
  for (const auto& [body, size] : body_sizes(setup.mesh)) {
    const Material& material = setup.materials.at(body);
    if (rigid_body_of(material)) continue;
    const double speed = std::sqrt(material.youngs_modulus / material.density);
    slowest = std::max(slowest, 6.2 * size.diagonal * size.diagonal / (size.thickness * speed));
  }
  return slowest;
}

}  // namespace

template <int Dim>
double driven_speed(const Setup<Dim>& setup, double size, const Vec<Dim>& center) {
  const TimeOptions& time = setup.time;
  const double speed = prescribed_speed(setup, center, time.steps);
  if (!setup.body_acceleration) return speed;
  const double a = setup.body_acceleration(center, time.t0).norm(), duration = time.dt * time.steps;
  return std::max(speed, std::min(a * duration, std::sqrt(2 * a * size)));
}

template <int Dim>
void find_long_steps(const Setup<Dim>& setup, double size, const Vec<Dim>& center, std::vector<std::string>& found) {
  constexpr double kDetour = 0.5;  ///< of a wave that has less than three steps a period
  const TimeOptions& time = setup.time;
  if (time.is_static || time.adaptive.enabled) return;
  const std::string dt = "dt = " + setup.units.text(time.dt, "s", 6);
  for (const Prescribed& prescribed : all_prescribed(setup, center)) {
    Detour detour;
    try {
      detour = find_detour(prescribed, time);
    } catch (const InputError&) {  // no value at a time that no step ends at
      continue;
    }
    if (detour.fraction > kDetour)
      found.push_back(
          fmt::format("{} is too long for {}: within a step, from t = {} on, it goes to and fro, and only its "
                      "values at the ends of steps count",
                      dt, prescribed.name, setup.units.text(detour.t, "s", 4)));
  }
  if (time.quasistatic) return;
  double speed = 0;
  try {
    speed = driven_speed(setup, size, center);
  } catch (const InputError&) {  // no value at a time or place that no step asks for
  }
  const double crossing = speed > 0 ? size / speed : 0;
  if (speed > 0 && time.dt > crossing)
    found.push_back(fmt::format(
        "{} is longer than {}, in which bodies cross {}, their own size, at {}: a step passes over "
        "what happens on the way",
        dt, setup.units.text(crossing, "s", 2), setup.units.text(size, "m", 2), setup.units.text(speed, "m/s", 2)));
  const bool swings = !setup.dirichlet.empty() && (!setup.initial_displacement.empty() || !setup.initial_velocity.empty());
  const double period = slowest_period(setup);
  if (swings && time.dt > period && !(time.dt > crossing && speed > 0))
    found.push_back(
        fmt::format("{} is longer than {}, about the longest period of the bodies: they come to rest in a few "
                    "steps, as the integrator damps what it does not resolve",
                    dt, setup.units.text(period, "s", 2)));
}

template double driven_speed(const Setup<2>&, double, const Vec<2>&);
template double driven_speed(const Setup<3>&, double, const Vec<3>&);
template void find_long_steps(const Setup<2>&, double, const Vec<2>&, std::vector<std::string>&);
template void find_long_steps(const Setup<3>&, double, const Vec<3>&, std::vector<std::string>&);

}  // namespace itr::cli
