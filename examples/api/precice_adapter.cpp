// SPDX-License-Identifier: MIT
// A participant of a coupled simulation by preCICE (3.2 or later): the flap of its tutorials, as "Solid", which reads
// "Force" and writes "Displacement" on "Solid-Mesh". The library changes its mesh at the start of a time window only and
// keeps it frozen in the iterations over it: preCICE lets participants reset a mesh there (and not in the first window),
// with <precice-configuration experimental="true" allow-remeshing="true">.
//   precice_adapter precice-config.xml
#include <cstdio>
#include <itr/itr.hpp>
#include <optional>
#include <precice/precice.hpp>
#include <set>

namespace {

constexpr const char* kMesh = "Solid-Mesh";

itr::Model flap() {
  itr::Model model(2);
  std::vector<double> vertices;
  std::vector<int> cells;
  for (int i = 0; i <= 20; ++i)
    for (int j = 0; j <= 2; ++j) vertices.insert(vertices.end(), {0.05 * j - 0.05, 0.05 * i});
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 2; ++j) {
      const int a = 3 * i + j, b = a + 3;
      cells.insert(cells.end(), {a, a + 1, b + 1, a, b + 1, b});
    }
  model.set_mesh(vertices, cells);
  model.add_boundary("ground", [](const double* X) { return X[1] < 1e-9; });
  model.add_boundary("wet", [](const double* X) { return X[1] > 1e-9; });
  model.set_options(R"({"materials": {"type": "NeoHookean", "E": 4e6, "nu": 0.3, "rho": 3000},
    "time": {"dt": 0.01, "time_steps": 1, "integrator": "ImplicitNewmark"},
    "space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-3}}}})");
  return model;
}

/// Interface that preCICE knows: the vertices of the wet boundary, at rest.
struct Interface {
  std::vector<int> vertices;  ///< ours
  std::vector<precice::VertexID> ids;

  Interface(const itr::AnySimulation& simulation, precice::Participant& participant) {
    const std::vector<int> facets = simulation.facets(), boundaries = simulation.facet_boundaries();
    std::set<int> found;
    for (std::size_t i = 0; i < facets.size(); ++i)
      if (boundaries[i / 2] == 2) found.insert(facets[i]);
    vertices.assign(found.begin(), found.end());
    ids.resize(vertices.size());
    participant.setMeshVertices(kMesh, of(simulation.rest_positions()), ids);
  }
  std::vector<double> of(const std::vector<double>& field) const {
    std::vector<double> values;
    for (const int v : vertices) values.insert(values.end(), {field[2 * v], field[2 * v + 1]});
    return values;
  }
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) throw std::runtime_error("expected precice-config.xml");
  itr::AnySimulation simulation(flap());
  simulation.fix("ground", std::array{1, 1}, [](const double*, double, double* u) { u[0] = u[1] = 0; });
  bool is_new_mesh = false;
  simulation.on_mesh_change([&](const itr::AnyMeshChange&) { is_new_mesh = true; });
  simulation.freeze_mesh(true);

  precice::Participant participant("Solid", argv[1], 0, 1);
  Interface interface(simulation, participant);
  participant.initialize();
  std::optional<itr::AnySimulation::Saved> start;
  while (participant.isCouplingOngoing()) {
    const double dt = participant.getMaxTimeStepSize();
    std::vector<double> read(2 * interface.ids.size()), forces(simulation.positions().size(), 0.0);
    participant.readData(kMesh, "Force", interface.ids, dt, read);  // before a reset, after which nothing can be read
    for (std::size_t i = 0; i < read.size(); ++i) forces[2 * interface.vertices[i / 2] + i % 2] = read[i];
    simulation.set_forces(forces);  // which stay where they act when the mesh changes
    if (participant.isTimeWindowComplete()) {
      simulation.freeze_mesh(false);
      if (const auto result = simulation.adapt(dt); !result.ok) throw std::runtime_error(result.reason);
      simulation.freeze_mesh(true);
      if (std::exchange(is_new_mesh, false)) {
        participant.resetMesh(kMesh);
        interface = Interface(simulation, participant);
      }
    }
    if (participant.requiresWritingCheckpoint()) start = simulation.save();
    if (const auto result = simulation.step(dt); !result.ok) throw std::runtime_error(result.reason);
    std::vector<double> displacement = simulation.rest_positions();
    for (std::size_t i = 0; i < displacement.size(); ++i) displacement[i] = simulation.positions()[i] - displacement[i];
    participant.writeData(kMesh, "Displacement", interface.ids, interface.of(displacement));
    participant.advance(dt);
    if (participant.requiresReadingCheckpoint()) simulation.restore(*start);
  }
  participant.finalize();
} catch (const std::exception& error) {
  return std::fprintf(stderr, "precice_adapter: %s\n", error.what()), 1;
}
