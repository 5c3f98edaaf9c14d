// SPDX-License-Identifier: MIT
// Two simulations in two threads of one process: each has the bits that it has alone.
#include <cstdio>
#include <itr/itr.hpp>
#include <thread>

namespace {

/// A block that falls onto the ground, with contact and remeshing, at this speed [m/s].
std::vector<double> fall(double speed) {
  itr::Model model(2);
  std::vector<double> vertices;
  std::vector<int> cells;
  for (int i = 0; i < 25; ++i) vertices.insert(vertices.end(), {0.05 * (i % 5), 0.05 * (i / 5) + 0.01});
  for (int i = 0; i < 20; ++i)
    if (i % 5 < 4) cells.insert(cells.end(), {i, i + 1, i + 6, i, i + 6, i + 5});
  model.set_mesh(vertices, cells);
  model.add_obstacle("ground", std::array{-1.0, 0.0, 1.0, 0.0}, std::array{0, 1});
  model.set_options(R"({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
    "time": {"dt": 0.002, "time_steps": 20, "integrator": "ImplicitEuler"},
    "contact": {"enabled": true, "dhat": 0.002, "friction_coefficient": 0.3, "epsv": 0.01},
    "solver": {"contact": {"barrier_stiffness": 1e6}},
    "boundary_conditions": {"rhs": [0, 9.81]},
    "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-3}}}})");
  itr::AnySimulation simulation(model);
  std::vector<double> velocities(vertices.size());
  for (std::size_t i = 0; i < velocities.size(); i += 2) velocities[i] = speed / 2, velocities[i + 1] = -speed;
  simulation.set_velocities(velocities);
  while (!simulation.finished())
    if (const auto result = simulation.step(); !result.ok) return {};
  return {simulation.positions().begin(), simulation.positions().end()};
}

}  // namespace

int main() {
  const std::vector<double> slow = fall(1), fast = fall(3);
  std::vector<double> slow_again, fast_again;
  std::thread first([&] { slow_again = fall(1); }), second([&] { fast_again = fall(3); });
  first.join();
  second.join();
  std::printf("%zu and %zu vertices\n", slow.size() / 2, fast.size() / 2);
  return !slow.empty() && slow == slow_again && !fast.empty() && fast == fast_again ? 0 : 1;
}
