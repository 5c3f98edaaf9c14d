#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs a simple scene through the Python package, with values by vertex: by_vertex.py SCENE.json RESULT.npz

The scene has points, cells, facets by boundary, fixed displacements and tractions by boundary and vertex, and options."""
import json
import sys

import itr
import numpy as np


def main():
    with open(sys.argv[1]) as file:
        scene = json.load(file)
    model = itr.Model(np.array(scene["points"]), np.array(scene["cells"]))
    for name, facets in scene["boundaries"].items():
        model.add_boundary(name, facets=np.array(facets))
    model.set_options(scene["options"])
    simulation = itr.Simulation(model)
    simulation.watch_forces()
    for name, values in scene["fixed"].items():
        simulation.fix(name, np.array(values))
    for name, values in scene["tractions"].items():
        simulation.set_traction(name, np.array(values))
    while not simulation.finished:
        simulation.step()
    np.savez(sys.argv[2], rest=simulation.rest_positions, u=simulation.positions - simulation.rest_positions, step=simulation.steps,
             applied=simulation.forces("applied"), reaction=simulation.forces("reaction"))


if __name__ == "__main__":
    try:
        main()
    except itr.StepFailed as error:
        print(f"itr: {error}")
        sys.exit(3)
