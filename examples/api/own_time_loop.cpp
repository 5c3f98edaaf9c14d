// SPDX-License-Identifier: MIT
// A host with a time loop of its own: a mesh from arrays, loads that it changes, steps as long as it likes.
#include <cstdio>
#include <itr/itr.hpp>

namespace {

/// A bar of n x 1 squares of side 0.1 m, two triangles each.
struct Bar {
  std::vector<double> vertices;
  std::vector<int> cells;
  explicit Bar(int n) {
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j < 2; ++j) vertices.insert(vertices.end(), {0.1 * i, 0.1 * j});
    for (int i = 0; i < n; ++i) {
      const int a = 2 * i, b = a + 2, c = a + 3, d = a + 1;
      cells.insert(cells.end(), {a, b, c, a, c, d});
    }
  }
};

int run() {
  const Bar bar(10);
  itr::Model model(2);
  model.set_mesh(bar.vertices, bar.cells);
  model.add_boundary("left", std::array{-1e-9, 0.0}, std::array{1e-9, 0.1});
  model.add_boundary("right", std::array{1 - 1e-9, 0.0}, std::array{1 + 1e-9, 0.1});
  model.set_options(R"({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
    "time": {"dt": 0.01, "time_steps": 1, "integrator": "ImplicitEuler"},
    "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-3}}},
    "solver": {"nonlinear": {"grad_norm": 1e-8}}})");

  itr::AnySimulation simulation(model);
  simulation.fix("left", std::array{1, 1}, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  simulation.watch_forces(true);

  double dt = 0.01;
  while (simulation.time() < 0.5) {
    const bool pulls = simulation.time() < 0.25;  // this is the host's business
    simulation.set_traction("right", [=](const double*, double, double* f) { f[0] = 0, f[1] = pulls ? -500 : 0; });
    const itr::StepResult result = simulation.step(dt);
    if (!result.ok) {  // the state is as before
      if ((dt /= 2) < 1e-5) return std::printf("stopped: %s\n", result.reason.c_str()), 1;
      continue;
    }
    dt = result.report.newton_iterations > 8 ? 0.8 * dt : std::min(1.1 * dt, 0.02);
    const auto held = simulation.resultant("left");
    std::printf("t = %.4f s: %d vertices, tip at %.5f m, %.2f N and %.2f N m at the left end\n", simulation.time(),
                simulation.num_vertices(), simulation.positions()[2 * 20 + 1], held.force[1], held.moment[0]);
  }
  return simulation.num_vertices() > 22 ? 0 : 1;  // it was refined
}

}  // namespace

int main() {
  try {
    return run();
  } catch (const itr::InputError& error) {
    std::fprintf(stderr, "own_time_loop: %s\n", error.what());
    return 2;
  }
}
