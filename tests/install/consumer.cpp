// SPDX-License-Identifier: MIT
// Embeds the library: fills in a Setup by hand, steps it, and reads the reports. A unit square falls freely for one second.
#include <cmath>
#include <cstdio>
#include <itr/simulation.hpp>
#include <itr/solver.hpp>

namespace {

constexpr double kGravity = 9.81;
constexpr double kStep = 0.1;
constexpr int kSteps = 10;

itr::Setup<2> falling_square() {
  itr::Setup<2> setup;
  setup.mesh = itr::Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {1, 1});
  setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.body_acceleration = [](const itr::Vec<2>&, double) { return itr::Vec<2>(0, -kGravity); };
  setup.time.dt = kStep;
  setup.time.steps = kSteps;
  return setup;
}

}  // namespace

/// Its argument is the linear solver, if there is one.
int main(int argc, char** argv) {
  static_assert(alignof(itr::Mat<2>) == 32, "else the library reads what we allocate with other alignment");
  itr::linear::Registry registry;
  itr::Setup<2> setup = falling_square();
  if (argc > 1) setup.linear.solvers = {argv[1]};
  itr::Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const itr::StepResult result = simulation.advance();
    if (!result.ok) {
      std::printf("step %d: %s\n", result.report.step, result.reason.c_str());
      return 1;
    }
  }
  double height = 0;
  simulation.observe([&](const itr::FrameView<2>& frame) { height = frame.x[1]; });
  const double expected = -kGravity * kStep * kStep * kSteps * (kSteps + 1) / 2;  // implicit Euler from rest
  std::printf("t = %g s, height %.9g m, expected %.9g m\n", simulation.time(), height, expected);
  return std::abs(height - expected) < 1e-8 ? 0 : 1;
}
