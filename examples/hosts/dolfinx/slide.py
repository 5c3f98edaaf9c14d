# SPDX-License-Identifier: MIT
"""A hot block is pressed on a cold bar and slides along it. ITR does contact and friction and refines the mesh, dolfinx the
heat, which flows where the block presses. Draws the temperature if it is given the name of a picture: slide.py [FILE.png]"""

import logging
import sys

import numpy as np
from heat import Heat

import itr

PRESS, SPEED, DT, STEPS = 4e-3, 0.05, 0.1, 40  # [m], [m/s], [s]
BOTTOM = 20.0  # [C], where the bar is cooled


def rectangle(columns, rows, low, high):
    x, y = np.linspace(low[0], high[0], columns + 1), np.linspace(low[1], high[1], rows + 1)
    points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    a = np.array([j * (columns + 1) + i for j in range(rows) for i in range(columns)])
    d = a + columns + 1
    return points, np.concatenate([np.stack([a, a + 1, d + 1], 1), np.stack([a, d + 1, d], 1)])


def make():
    bar, cells = rectangle(16, 3, (0, 0), (0.4, 0.08))
    block, block_cells = rectangle(4, 3, (0.05, 0.0802), (0.15, 0.16))
    points = np.concatenate([bar, block])
    model = itr.Model(points, np.concatenate([cells, block_cells + len(bar)]), np.repeat([0, 1], [len(cells), len(block_cells)]))
    bottom = model.add_boundary("bottom", where=lambda X: X[1] < 1e-9)
    model.add_boundary("top", where=lambda X: X[1] > 0.16 - 1e-9)
    model.set_options({
        "materials": [{"id": 0, "type": "NeoHookean", "E": 1e6, "nu": 0.4, "rho": 1000},
                      {"id": 1, "type": "NeoHookean", "E": 3e6, "nu": 0.4, "rho": 1000}],
        "time": {"dt": DT, "time_steps": STEPS, "integrator": "ImplicitEuler"},
        "contact": {"enabled": True, "dhat": 2e-4, "friction_coefficient": 0.3},
        "space": {"remesh": {"enabled": True, "split": {"acceptance_tolerance": 2e-3}}},
    })
    simulation = itr.Simulation(model)
    simulation.fix("bottom", [0, 0])
    simulation.fix("top", lambda X, t: 0 * X + [SPEED * max(t - 1, 0), -PRESS * min(t, 1)])
    heat = Heat(simulation, {0: 50.0, 1: 50.0}, 2e5, lambda p: 5e-2 * p, {bottom: BOTTOM}, BOTTOM)
    heat.temperature[heat.bodies() == 1] = 120
    return simulation, heat


def draw(simulation, heat, file):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    x, y = simulation.positions.T
    colours = axes.tripcolor(x, y, simulation.cells, heat.temperature, shading="gouraud", cmap="inferno")
    axes.triplot(x, y, simulation.cells, color="0.6", linewidth=0.4)
    figure.colorbar(colours, label="temperature [°C]", shrink=0.7)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    figure.savefig(file, dpi=90, bbox_inches="tight")


def main():
    logging.disable(logging.INFO)  # the form compiler tells of every file that it compiles
    simulation, heat = make()
    begin, put_in, vertices = heat.content, 0.0, simulation.num_vertices
    for step in range(STEPS):
        simulation.step()
        put_in += DT * sum(heat.step(DT).values())
        if step % 10 == 9:
            force = simulation.resultant("top")[0]
            print(f"{simulation.time:.1f} s: {simulation.num_vertices} vertices, the block is pressed by {-force[1]:.0f} N/m and "
                  f"pulled by {force[0]:.0f} N/m, {heat.temperature.min():.1f} to {heat.temperature.max():.1f} °C")
    lost = max(abs(after / before - 1) for before, after in heat.transfers)
    missing = abs(heat.content - begin - put_in) / abs(put_in)
    print(f"{len(heat.transfers)} changes of the mesh; heat content {begin:.6e} J/m, {put_in:.3e} J/m came in, {heat.content:.6e} "
          f"J/m at the end; off by {missing:.1e} of what came in, transfers by {lost:.1e}")
    if len(sys.argv) > 1:
        draw(simulation, heat, sys.argv[1])
    return 0 if lost < 1e-12 and missing < 1e-9 and simulation.num_vertices > 1.5 * vertices else 1


if __name__ == "__main__":
    sys.exit(main())
