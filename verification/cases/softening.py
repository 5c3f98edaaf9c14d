# SPDX-License-Identifier: MIT
"""Mullins' softening: a bar of rubber that is stretched, let go and stretched again, and a block between two plates."""
import csv

import numpy as np
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, compare

TITLE = "Softening of rubber after Mullins"
QUANTITY = "bar: force and energy lost; block: work that is neither stored nor lost"
REFERENCE = "Ogden and Roxburgh's law of an incompressible bar; the work of the plate"
TOLERANCE = "0.2 % for the bar, 1 % for the block"
NEEDS = ("meshio", "h5py", "scipy")

C, K, MULLINS = [0.31237, 5.4257e-4, 6.962e-5], 1000, {"r": 1.6, "m": 0.05, "beta": 0.15}
SHARES = [0, 0.5, 1, 0.5, 0.2, 0.6, 1, 1.2, 0.4]  # of the largest stretch, of which the first turn is at t = 2
MATERIAL = {"type": "Yeoh", "C": C, "K": K, "rho": 1.0, "mullins": MULLINS}


def path(most):
    """An expression of t that is `most` times the shares, linear between whole numbers."""
    pieces = [f"if({k + 1} - t, {a} + {b - a:g} * (t - {k}), " for k, (a, b) in enumerate(zip(SHARES, SHARES[1:]))]
    return f"{most} * ({''.join(pieces)}{SHARES[-1]}{')' * len(pieces)})"


def forces(run):
    with open(run.folder / "forces.csv", newline="") as file:
        return [{key: float(value) for key, value in row.items() if key != "name" and value} for row in csv.DictReader(file)]


def lost_in(run, begin=0, end=np.inf):
    """Steps that lose nothing do not say so."""
    return sum(step.get("softening", 0) for step in run.steps if begin + 1e-9 < step["t"] < end + 1e-9)


def bar(context):
    """Uniaxial: a cube between a plane that moves and three that hold it."""
    from scipy.integrate import quad
    from scipy.special import erf

    most = 1.0
    points, cells = box_mesh([2] * 3, [1.0] * 3, jitter=0.2)
    write_mesh(context.folder / "bar.msh", points, cells)
    rollers = [{"id": k, "value": [0] * 3, "dimension": [c == axis for c in range(3)]} for axis, k in enumerate((1, 2, 5))]
    pulled = {"id": 3, "value": [path(most), 0, 0], "dimension": [True, False, False]}
    content = scene(context.folder / "bar.msh", MATERIAL, boundary_conditions={"dirichlet_boundary": [*rollers, pulled]},
                    defaults="itr", time={"dt": 0.25, "tend": len(SHARES) - 1, "quasistatic": True})
    content["output"] = {"forces": [{"name": "end", "surfaces": 3}]}
    run = run_scene(context, "bar", content)

    def density(s):
        return sum(c * (s**2 + 2 / s - 3) ** (i + 1) for i, c in enumerate(C))

    def stress(s):
        return 2 * (s - s**-2) * sum((i + 1) * c * (s**2 + 2 / s - 3) ** i for i, c in enumerate(C))

    def eta(W, largest):
        return 1 - erf((largest - W) / (MULLINS["m"] + MULLINS["beta"] * largest)) / MULLINS["r"] if W < largest else 1

    largest, worst, peak = 0, 0, 0
    for row in forces(run):
        s = 1 + most * float(np.interp(row["t"], range(len(SHARES)), SHARES))
        expected = eta(density(s), largest) * stress(s)
        largest, peak = max(largest, density(s)), max(peak, expected)
        worst = max(worst, abs(row["reaction_x"] - expected))
    yield Result("bar: largest difference of the force, by the largest force", worst / peak, 2e-3, worst, peak)
    lost = quad(lambda W: 1 - eta(W, largest), 0, largest)[0]
    found = lost_in(run)
    yield compare("bar: energy lost", found, lost, 2e-3)
    second = lost_in(run, 2, 6)
    yield Result("bar: energy lost in the second cycle, by that of the first", abs(second) / found, 1e-9, second)


def block(context, order, volume):
    """Plane strain between plates that hold it. The work of trapezoids of the plate's force is stored or lost."""
    points, cells = box_mesh([16, 8], [2.0, 1.0])
    mesh = context.folder / f"block-{order}.msh"
    write_mesh(mesh, points, cells)
    content = scene(mesh, {**MATERIAL, "volume": volume}, order, defaults="itr",
                    boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, 0]}, {"id": 3, "value": [path(0.8), 0]}]},
                    time={"dt": 0.05, "tend": len(SHARES) - 1, "quasistatic": True})
    content["output"] = {"forces": [{"name": "plate", "surfaces": 3}]}
    run = run_scene(context, f"block-{order}-{volume}", content)
    rows = forces(run)
    pull = np.interp([row["t"] for row in rows], range(len(SHARES)), np.array(SHARES) * 0.8)
    work = np.trapz([row["reaction_x"] for row in rows], pull)
    lost = lost_in(run)
    kept = run.steps[-1]["energy"]["elastic"]
    label = f"block, P{order}, {volume}"
    yield Result(f"{label}: work that is neither stored nor lost, by what is lost", abs(work - kept - lost) / lost, 0.01, work,
                 kept + lost)


def results(context):
    yield from bar(context)
    for order in (1, 2):
        yield from block(context, order, "patches")
