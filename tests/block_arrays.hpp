// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "block.hpp"
#include "itr/itr.hpp"

namespace itr {

inline constexpr const char* kOptions = R"({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
  "time": {"dt": 0.01, "time_steps": 10, "integrator": "ImplicitEuler"},
  "solver": {"nonlinear": {"grad_norm": 1e-10}}})";

/// The block of block.hpp in arrays.
template <int Dim>
struct Arrays {
  std::vector<double> vertices;
  std::vector<int> cells, bodies;
  Arrays() {
    const Mesh<Dim> mesh = make_block<Dim>();
    for (int v = 0; v < mesh.node_slots(); ++v)
      vertices.insert(vertices.end(), mesh.rest(v).data(), mesh.rest(v).data() + Dim);
    for (int c = 0; c < mesh.cell_slots(); ++c) cells.insert(cells.end(), mesh.cell(c).begin(), mesh.cell(c).end());
    bodies.assign(static_cast<std::size_t>(mesh.cell_slots()), 1);
  }
};

inline constexpr const char* kRemesh =
    R"({"space": {"remesh": {"enabled": true, "split": {"acceptance_tolerance": 1e-4}}}})";

template <int Dim>
Model block_model() {
  const Arrays<Dim> arrays;
  Model model(Dim);
  model.set_mesh(arrays.vertices, arrays.cells, arrays.bodies);
  model.add_boundary("left", [](const double* X) { return X[0] < 1e-9; });
  model.add_boundary("top", [](const double* X) { return X[1] > kSize - 1e-9; });
  model.set_options(kOptions);
  return model;
}

}  // namespace itr
