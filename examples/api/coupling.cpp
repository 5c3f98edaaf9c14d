// SPDX-License-Identifier: MIT
// Coupling with sub-iterations and roll-back: the library has a beam, the program a rigid mass at the beam's tip, which it
// integrates itself. In each time window the two exchange displacement and force until they agree, each time from the saved
// state; the mesh changes before a window's iterations only, as preCICE has it.
#include <cmath>
#include <cstdio>
#include <itr/itr.hpp>

namespace {

constexpr double kMass = 2, kGravity = 9.81, kWindow = 0.02, kTolerance = 1e-7;

/// The program's solver: a mass that can move up and down (implicit Euler).
struct Body {
  double y = 0, v = 0;
  void advance(double force, double h) {
    v += h * (force / kMass - kGravity);
    y += h * v;
  }
};

itr::Model beam() {
  itr::Model model(2);
  std::vector<double> vertices;
  std::vector<int> cells;
  for (int i = 0; i <= 10; ++i)
    for (int j = 0; j <= 2; ++j) vertices.insert(vertices.end(), {0.1 * i, 0.05 * j});
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 2; ++j) {
      const int a = 3 * i + j, b = a + 3;
      cells.insert(cells.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  model.set_mesh(vertices, cells);
  model.add_boundary("wall", [](const double* X) { return X[0] < 1e-9; });
  model.add_boundary("tip", [](const double* X) { return X[0] > 1 - 1e-9; });
  model.set_options(R"({"materials": {"type": "NeoHookean", "E": 2e6, "nu": 0.3, "rho": 100},
    "time": {"dt": 0.02, "time_steps": 1, "integrator": "ImplicitEuler"},
    "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 0.01}}},
    "solver": {"nonlinear": {"grad_norm": 1e-9}}})");
  return model;
}

}  // namespace

int main() try {
  itr::AnySimulation simulation(beam());
  const std::array all{1, 1}, vertical{0, 1};
  simulation.fix("wall", all, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  simulation.watch_forces(true);
  Body body;
  double force = 0, momentum = 0, lowest = 0;
  int iterations = 0;
  for (int window = 0; window < 40; ++window) {
    const Body start = body;
    simulation.freeze_mesh(false);
    simulation.fix("tip", vertical, [&](const double*, double, double* u) { u[0] = 0, u[1] = body.y + kWindow * body.v; });
    if (const auto result = simulation.adapt(kWindow); !result.ok) return std::printf("%s\n", result.reason.c_str()), 1;
    simulation.freeze_mesh(true);
    const auto saved = simulation.save();
    double relaxation = 0.3, last_residual = 0;
    for (int i = 0;; ++i, ++iterations) {
      body = start;
      body.advance(force, kWindow);
      simulation.restore(saved);
      simulation.fix("tip", vertical, [&](const double*, double, double* u) { u[0] = 0, u[1] = body.y; });
      if (const auto result = simulation.step(kWindow); !result.ok) return std::printf("%s\n", result.reason.c_str()), 1;
      const double residual = -simulation.resultant("tip").force[1] - force;  // of the beam on the mass
      if (std::abs(residual) < kTolerance * kMass * kGravity) break;
      if (i == 50) return std::printf("the window does not converge\n"), 1;
      if (i > 0) relaxation *= -last_residual / (residual - last_residual);  // Aitken's rule
      force += relaxation * residual;
      last_residual = residual;
    }
    momentum += kWindow * (force - kMass * kGravity);
    lowest = std::min(lowest, body.y);
  }
  std::printf("%d iterations, mass at most %.4f m down, momentum %.6f, by forces %.6f kg m/s\n", iterations, -lowest,
              kMass * body.v, momentum);
  return lowest < 0 && std::abs(kMass * body.v - momentum) < 1e-9 ? 0 : 1;
} catch (const itr::InputError& error) {
  return std::fprintf(stderr, "coupling: %s\n", error.what()), 2;
}
