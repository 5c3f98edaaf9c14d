# SPDX-License-Identifier: MIT
"""A soft disc and a soft ball that turn, fall on a floor and bounce, remeshed all the time by all operations: what that adds to
energy and momentum."""
import shutil

import h5py
import numpy as np
from harness.bisection import ball
from harness.contact import with_obstacle, write_line, write_plane
from harness.fields import volumes
from harness.scenes import Frame, run_scene, scene, write_mesh
from harness.suite import Result

TITLE = "Remeshing adds no energy"
QUANTITY = ("growth of the energy in a step, by the largest that was stored; of these, what remeshing and projection jump by; momentum "
            "in flight")
REFERENCE = "conservation of energy and momentum"
TOLERANCE = ("implicit Euler: no growth in a step, and no jump by remeshing above what the scene lets collapses cost, beyond 1e-6; "
             "momentum in flight to 1e-10")
NEEDS = ("meshio", "h5py")

R, YOUNG, NU, RHO, G, DHAT, H = 0.5, 1e5, 0.3, 1000.0, 9.81, 1e-3, 2e-3
DROP = 0.05


def bounce(context, dim, integrator, steps, size, remesh=True):
    """Rows of t, kinetic, elastic and other energy [J], momentum; the lines of steps.jsonl; mass; what a collapse may cost [J]."""
    signs = np.array(np.meshgrid(*[(-1, 1)] * dim)).reshape(dim, -1).T
    points, cells = ball(R, lambda x: np.full(len(x), size), signs)
    points[:, -1] -= points[:, -1].min() - DROP
    name = f"{dim}d-{integrator}-{'remeshed' if remesh else 'fixed'}"
    mesh, floor = context.folder / f"{name}.msh", context.folder / f"{name}.obj"
    write_mesh(mesh, points, cells)
    if dim == 2:
        write_line(floor, (-50, 0), (53, 0))
    else:
        write_plane(floor, 0)
    turn = ["0.5 - y", "x"] if dim == 2 else ["0.5 - z", "0.2", "x"]
    share = {2: 1e-3, 3: 1e-2}[dim]
    tolerance = share * RHO * G * DROP * volumes(points, cells).sum()
    cost = 0.01 * tolerance if remesh else 0.0  # that a collapse may have [J]
    content = scene(mesh, {"type": "NeoHookean", "E": YOUNG, "nu": NU, "rho": RHO},
                    boundary_conditions={"rhs": [0] * (dim - 1) + [G]}, initial_conditions={"velocity": [{"id": 1, "value": turn}]},
                    time={"dt": H, "time_steps": steps, "integrator": integrator},
                    output={"checkpoint_period": 3600, "paraview": {"options": {"kinetic_energy": True, "momentum": True}}})
    if remesh:
        content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": tolerance}, "swap": {"enabled": True},
                                       "smooth": {"enabled": True},
                                       "collapse": {"acceptance_tolerance": -cost, "rel_max_edge_length": 3}}}
    content["solver"]["nonlinear"]["x_delta"] = 1e-9
    run = run_scene(context, name, with_obstacle(content, floor, DHAT, YOUNG))
    totals, momentum = [], []
    for path, step in zip(sorted((run.folder / "frames").glob("*.h5")), run.steps):
        with h5py.File(path) as file:
            kinetic = float(file["totals/kinetic_energy"][()][0])
            momentum.append(file["totals/momentum"][()].ravel())
        totals.append((step["t"], kinetic, step["energy"]["elastic"] + step["energy"]["contact"], step["energy"]["body"]))
    frame = Frame(path)
    mass = RHO * volumes(frame.rest, frame.cells).sum()
    shutil.rmtree(run.folder)  # a file a step
    return np.array(totals), np.array(momentum), run.steps, mass, cost


KINDS = ("splits", "collapses", "swaps", "smooths")


def judge(label, totals, momentum, steps, mass, cost, tolerance):
    t, kinetic, inner, body = totals.T
    whole, stored = kinetic + inner + body, np.maximum.accumulate(kinetic + inner)
    growth = np.diff(whole) / stored[1:]
    remeshed = np.array([sum(step[kind]["accepted"] for kind in KINDS) > 0 for step in steps])[1:]
    accepted = {kind: sum(step[kind]["accepted"] for step in steps) for kind in KINDS}
    done = ", ".join(f"{count} {kind}" for kind, count in accepted.items())
    forgotten = sum(step["history_loss"] for step in steps) / stored.max()
    touching = np.array([step["min_distance"] is not None for step in steps])
    bounces = int((np.diff(touching.astype(int)) == 1).sum())
    yield Result(f"{label}: largest growth of energy in a step", float(growth.max()), tolerance,
                 note=f"{len(t) - 1} steps, {bounces} times to the floor, {steps[0]['vertices']} to {max(s['vertices'] for s in steps)} "
                      f"vertices; {done}; the projection forgot {forgotten:.2e} of the energy in all")
    if remeshed.any():
        yield Result(f"{label}: the same of the {remeshed.sum()} steps that remeshed", float(growth[remeshed].max()), tolerance)
        jumps = np.array([step["energy"]["total"] - step["energy_before_remesh"] for step in steps])[1:] / stored[1:]
        allowed = np.array([step["collapses"]["accepted"] for step in steps])[1:] * cost / stored[1:]
        yield Result(f"{label}: largest jump of the step's own energy by remeshing and projection, less what its collapses may cost",
                     float((jumps - allowed).max()), tolerance,
                     note=f"jumps {jumps.max():.2e} at most, up {jumps[jumps > 0].sum():.2e} in all, down {-jumps[jumps < 0].sum():.2e}; "
                          f"a collapse may cost {(cost / stored[1:]).max():.2e}")
    first = int(np.argmax(touching)) if touching.any() else len(steps)
    exact = momentum[0] - np.outer(t, np.eye(momentum.shape[1])[-1]) * G * mass
    in_flight = sum(step[kind]["accepted"] for step in steps[:first] for kind in KINDS)
    yield Result(f"{label}: momentum before the first impact", float(np.abs(momentum - exact)[:first].max() / np.abs(exact[first - 1]).max()),
                 1e-10, note=f"{first - 1} steps, {in_flight} operations")


def results(context):
    runs = {}
    # Implicit Euler loses energy in every step; BDF2 much less, so that what remeshing does shows, beside the same on a fixed mesh.
    plan = [(2, "ImplicitEuler", True, 10000), (3, "ImplicitEuler", True, 10000), (2, "BDF2", True, 1500), (2, "BDF2", False, 1500)]
    if context.quick:
        plan = [(2, "ImplicitEuler", True, 150), (3, "ImplicitEuler", True, 80)]
    for dim, integrator, remesh, steps in plan:
        label = f"{dim}D, {integrator}, {'remeshed' if remesh else 'fixed mesh'}"
        runs[label] = bounce(context, dim, integrator, steps, {2: 0.25, 3: 0.5}[dim], remesh)
        yield from judge(label, *runs[label], 1e-6 if integrator == "ImplicitEuler" else None)
    context.figure("energy", lambda axes: draw(axes, runs))


def draw(axes, runs):
    for label, (totals, *_) in runs.items():
        axes.plot(totals[:, 0], totals[:, 1:].sum(axis=1) / totals[0, 1:].sum(), label=label, linewidth=0.8)
    axes.set(xlabel="t [s]", ylabel="energy / initial")
    axes.legend(fontsize=7)
