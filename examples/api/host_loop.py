# SPDX-License-Identifier: MIT
"""The Python package, cell by cell as in a notebook: a block is pressed by a wall that the host moves."""

# %% A mesh from NumPy arrays
import numpy as np

import itr

n = 6
grid = np.array([(i / n * 0.2, j / n * 0.2) for j in range(n + 1) for i in range(n + 1)])
corners = np.array([j * (n + 1) + i for j in range(n) for i in range(n)])
cells = np.concatenate(
    [np.stack([corners, corners + 1, corners + n + 2], 1), np.stack([corners, corners + n + 2, corners + n + 1], 1)]
)
model = itr.Model(grid, cells)
model.add_boundary("floor", where=lambda X: X[1] < 1e-9)
model.add_obstacle("wall", [[-0.1, 0.201], [0.3, 0.201]], edges=[[0, 1]])
model.set_options(
    {
        "materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
        "time": {"dt": 0.01, "time_steps": 10, "integrator": "ImplicitEuler"},
        "contact": {"enabled": True, "dhat": 1e-3},
        "solver": {"contact": {"barrier_stiffness": 1e6}},
        "space": {"remesh": {"enabled": True, "split": {"acceptance_tolerance": 1e-4}}},
    }
)

# %% A simulation, and what the host does with it
simulation = itr.Simulation(model)
simulation.fix("floor", [0, 0])
simulation.set_traction("floor", lambda X, t: 0 * X)  # a function is sampled once a step
simulation.watch_forces()
temperature = 20 + 100 * grid[:, 1]  # a field of the host's own


def carry(change: itr.MeshChange) -> None:
    global temperature
    temperature = change.interpolate(temperature)


simulation.on_mesh_change(carry)
wall = np.array([[-0.1, 0.201], [0.3, 0.201]])
while not simulation.finished:
    wall[:, 1] -= 0.3 * simulation.time * 0.1
    simulation.move_obstacle("wall", wall)
    report = simulation.step()
    force, moment = simulation.resultant("floor")
    print(f"t = {report['t']:.2f} s: {report['vertices']} vertices, the floor carries {force[1]:.2f} N")

# %% Results in other programs: a file by meshio, functions of dolfinx (both where they are there)
try:
    simulation.to_meshio().write("host_loop.vtu")
except ImportError:
    print("no meshio")
try:
    mesh, functions = simulation.to_dolfinx()
    print(f"in dolfinx: {mesh.topology.index_map(2).size_local} cells, {', '.join(functions)}")
except ImportError:
    print("no dolfinx")

# %% What came out
assert np.allclose(temperature, 20 + 100 * simulation.rest_positions[:, 1])
assert len(simulation.positions) > len(grid)
assert force[1] > 0
