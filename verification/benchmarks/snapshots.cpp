// SPDX-License-Identifier: MIT
// Times to save a simulation and to go back, at about 10^4 vertices: the two calls, and the copy of the state, mesh
// included, that the first step after them makes.
#include <benchmark/benchmark.h>

#include "block.hpp"
#include "random_tets.hpp"

namespace {

using namespace itr;

template <int Dim>
Mesh<Dim> large_mesh();
template <>
Mesh<2> large_mesh<2>() {
  const Grid grid = make_regular_grid(100, kSize, [](int i, int j) { return (i + j) % 2; });
  return Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
}
template <>
Mesh<3> large_mesh<3>() {
  return make_cubes(
      21, [](int i, int j, int k) { return Vec<3>(kSize / 21 * Vec<3>(i, j, k)); }, [](int, int, int) { return 1; });
}

template <int Dim>
Simulation<Dim> large_simulation() {
  static linear::Registry registry;
  auto setup = block<Dim>();
  setup.mesh = large_mesh<Dim>();
  setup.fields = {};
  return Simulation<Dim>(setup, registry);
}

template <int Dim>
void save_and_restore(benchmark::State& state) {
  auto simulation = large_simulation<Dim>();
  for (auto _ : state) {
    const Snapshot<Dim> snapshot = simulation.save();
    simulation.restore(snapshot);
    benchmark::DoNotOptimize(simulation.state());
  }
  state.counters["vertices"] = simulation.state().mesh.num_vertices();
}

template <int Dim>
void copy_of_state(benchmark::State& state) {
  const auto simulation = large_simulation<Dim>();
  State<Dim> whole = simulation.state();
  if (Dim == 3) whole.strata = Strata<Dim>(whole.mesh);  // as remeshing leaves it
  for (auto _ : state) {
    const State<Dim> copy = whole;
    benchmark::DoNotOptimize(&copy);
  }
  state.counters["vertices"] = simulation.state().mesh.num_vertices();
}

BENCHMARK(save_and_restore<2>)->Name("Snapshot/save and restore/2D");
BENCHMARK(save_and_restore<3>)->Name("Snapshot/save and restore/3D");
BENCHMARK(copy_of_state<2>)->Name("Snapshot/copy of the state/2D")->Unit(benchmark::kMillisecond);
BENCHMARK(copy_of_state<3>)->Name("Snapshot/copy of the state/3D")->Unit(benchmark::kMillisecond);

}  // namespace
