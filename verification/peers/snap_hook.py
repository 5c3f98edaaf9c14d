# SPDX-License-Identifier: MIT
"""The snap hook of examples/assemblies: ITR's scene and CalculiX's deck from there, as far as 1.2 N/mm: the travel at that force.
Both have the same nodes; CalculiX has quadrilaterals of 8 nodes, which are its best elements."""
import json
import subprocess

import numpy as np

import problem  # noqa: F401
import make as assemblies
import peers
import studies

FORCE = 1.2


def measure(method, level, folder, options, timed):
    folder.mkdir(parents=True, exist_ok=True)
    run = run_itr if method.code == "ITR" else run_calculix
    return [run(level, folder, options, timed)]


def run_itr(level, folder, options, timed):
    assemblies.make(folder, ["snap_hook"], level)
    scene = json.loads((folder / "snap_hook.json").read_text())
    scene["time"]["tend"] = FORCE / 1.5
    (folder / "scene.json").write_text(json.dumps(scene))
    seconds = timed([str(options.itr), "run", "scene.json", "-o", "run", "--overwrite", "--threads", "1"], folder, options.limit)
    if seconds is None:
        return None
    steps = [json.loads(line) for line in open(folder / "run/steps.jsonl")]
    travel = studies.rows(folder / "run/points.csv", "carriage")[-1]["u_x"]
    return seconds, travel, sum(s.get("newton_iterations", 0) for s in steps), len(steps) - 1


def run_calculix(level, folder, options, timed):
    """The deck is run by its own script first, which also reads it, then once more for the time."""
    try:
        travel, force = peers.snap_hook(folder, 2**level)
    except subprocess.CalledProcessError:  # CalculiX found no solution
        return None
    name = f"hook{2**level}"
    seconds = timed(["ccx", "-i", name], folder, options.limit)
    if seconds is None:
        return None
    iterations = sum(int(line.split()[3]) for line in (folder / f"{name}.sta").read_text().splitlines()[2:])
    return seconds, float(np.interp(FORCE, force, travel)), iterations, len(force)


def unknowns(method, level):
    columns, rows = assemblies.hook_lines(2**level)
    _, cells = assemblies.grid(columns, rows, keep=lambda x, y: y > 0 or x > 20)
    edges = {tuple(sorted(pair)) for cell in cells for pair in zip(cell, np.roll(cell, 1))}
    return 2 * (len(np.unique(cells)) + len(edges))
