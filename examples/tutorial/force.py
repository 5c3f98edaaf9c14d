#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Force on the first obstacle against its displacement, from the frames of runs (docs/tutorial.md).

usage: force.py RUN... [-o curve.png]      writes RUN/curve.csv, prints the last force of each run, draws all curves

The scene asks for the forces: "output": {"paraview": {"options": {"contact_forces": true}}}.
"""

import argparse
import pathlib

import h5py
import numpy as np


def curve(run):
    """Rows of displacement [m] and force [N], both along y, and numbers of vertices and nodes: those and curved edges'."""
    rows, start = [], None
    for path in sorted((run / "frames").glob("*.h5")):
        with h5py.File(path) as frame:
            place = frame["/obstacles/x"][0, 1]
            start = place if start is None else start
            force = frame["/fields/contact_force"][:].sum(axis=0)[1]  # on the bodies: the opposite acts on the obstacle
            nodes = len(frame["/fields/x"])
            curved = len(frame["/mesh/curved_edges"]) if "/mesh/curved_edges" in frame else 0
            rows.append((start - place, -force, nodes - curved, nodes))
    return np.array(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=pathlib.Path)
    parser.add_argument("-o", dest="picture")
    options = parser.parse_args()
    curves = {run: curve(run) for run in options.runs}
    for run, rows in curves.items():
        np.savetxt(run / "curve.csv", rows, delimiter=",", header="displacement [m],force [N],vertices,nodes", comments="")
        _, _, vertices, nodes = rows[-1]
        print(f"{run.name}: {rows[-1, 1]:.4g} N at {1000 * rows[-1, 0]:.4g} mm, {vertices:.0f} vertices"
              + (f", {nodes:.0f} nodes" if nodes > vertices else ""))
    if options.picture:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        for run, rows in curves.items():
            plt.plot(1000 * rows[:, 0], rows[:, 1], marker=".", label=run.name)
        plt.xlabel("displacement of the plate [mm]")
        plt.ylabel("force [N]")
        plt.legend(frameon=False)
        plt.savefig(options.picture, dpi=110)


if __name__ == "__main__":
    main()
