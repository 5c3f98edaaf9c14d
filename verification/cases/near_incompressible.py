# SPDX-License-Identifier: MIT
"""Nearly incompressible bodies whose volume is averaged over patches of cells: Cook's membrane at finite strain, a bonded strip and a
ring between plates."""
import numpy as np
from harness.contact import with_contact, write_line
from harness.scenes import box_mesh, oriented, run_scene, scene, write_mesh
from harness.suite import Result, compare, excess

TITLE = "Nearly incompressible bodies"
QUANTITY = "potential energy and tip of Cook's membrane; stiffness of a bonded strip; force, iterations and least det F of a ring"
REFERENCE = "quadratic elements on a finer mesh; the strip's closed form; the ring of quadratic elements"
TOLERANCE = "at most twice the error at nu = 0.3; each other result's own"
NEEDS = ("meshio", "h5py")

MU = 80.194


def material(nu, volume):
    return {"type": "NeoHookean", "E": 2 * MU * (1 + nu), "nu": nu, "rho": 1.0, "plane_strain": True, "volume": volume}


def cook_run(context, n, order, nu, volume):
    points, cells = box_mesh([n, n], [1.0, 1.0])
    s, t = points.T
    points = np.column_stack([48 * s, 44 * s + t * (44 - 28 * s)])
    mesh = context.folder / f"cook-{n}.msh"
    write_mesh(mesh, points, oriented(points, cells))
    content = scene(mesh, material(nu, volume), order,
                    boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                         "neumann_boundary": [{"id": 3, "value": [0, 6.25]}]})
    content["geometry"] = [{"mesh": str(mesh), "surface_selection": [{"id": 1, "box": [[-1, -1], [1e-3, 100]]},
                                                                     {"id": 3, "box": [[47.999, -1], [49, 100]]}]}]
    return run_scene(context, f"cook-{nu}-p{order}-{n}-{volume}", content)


def cook(context):
    """Diagonals one way, as in most tables: linear elements lock at their worst there."""
    finest = 32 if context.quick else 64
    counts = {1: (4, 8, 16, 32), 2: (2, 4, 8, 16)}
    rows, error = [], {}
    for nu, forms in ((0.3, ("pointwise",)), (0.4999, ("patches", "pointwise"))):
        last = cook_run(context, finest, 2, nu, forms[0]).steps[-1]
        exact = last["energy"]["total"]
        for form in forms:
            for order in (1, 2):
                for n in counts[order]:
                    run = cook_run(context, n, order, nu, form)
                    step, frame = run.steps[-1], run.last()
                    tip = float(frame.u[np.isclose(frame.rest[:, 0], 48) & np.isclose(frame.rest[:, 1], 60), 1].max())
                    error[nu, form, order, n] = 1 - step["energy"]["total"] / exact
                    rows.append((nu, form, order, n, step["unknowns"], error[nu, form, order, n], tip, step["newton_iterations"],
                                 step["min_volume_ratio"], step["processor_seconds"]))
    context.table("cook", ["nu", "volume", "order", "cells a side", "unknowns", "relative error of the energy", "tip", "iterations",
                           "least det F", "processor time [s]"], rows)
    for order in (1, 2):
        for n in counts[order]:
            patches, plain, far = (abs(error[key]) for key in ((0.4999, "patches", order, n), (0.4999, "pointwise", order, n),
                                                               (0.3, "pointwise", order, n)))
            note = f"point by point {100 * plain:.2g} %, by patches {100 * patches:.2g} %"
            yield Result(f"Cook, P{order}, {n} cells a side, error at nu = 0.4999 over that at nu = 0.3", patches / far,
                         2 if order == 1 else None, patches, far, note + (", both by the clamped corner" if order == 2 else ""))
            yield Result(f"Cook, P{order}, {n} cells a side, error by patches over that point by point", patches / plain,
                         0.7 if n == 4 and order == 1 else 0.4, patches, plain)
    worst = max(row[7] for row in rows if row[1] == "patches")
    yield Result("Cook, most iterations by patches over 60", excess(worst, 60), 0, worst)
    least = min(row[8] for row in rows if row[1] == "patches")
    yield Result("Cook, cells inverted by patches", float(not least > 0), 0, least)


def smooth(context):
    """A square whose sides are all held, turned by a force that is a curl: nothing singular takes orders away."""
    counts = {1: (8, 16, 32), 2: (4, 8, 16)}
    rhs = ["-200 * sin(pi*x)^2 * sin(2*pi*y)", "200 * sin(2*pi*x) * sin(pi*y)^2"]

    def energy(n, order, nu, form):
        points, cells = box_mesh([n, n], [1.0, 1.0], jitter=0.1)
        mesh = context.folder / f"square-{n}.msh"
        write_mesh(mesh, points, cells)
        held = [{"id": side, "value": [0, 0]} for side in (1, 2, 3, 4)]
        content = scene(mesh, material(nu, form), order, boundary_conditions={"rhs": rhs, "dirichlet_boundary": held})
        return run_scene(context, f"smooth-{nu}-p{order}-{n}-{form}", content).steps[-1]["energy"]["total"]

    found = {}
    for nu, form in ((0.3, "pointwise"), (0.4999, "patches")):
        exact = energy(48, 2, nu, form)
        for order in (1, 2):
            found[nu, order] = [abs(energy(n, order, nu, form) / exact - 1) for n in counts[order]]
    for order in (1, 2):
        for n, near, far in zip(counts[order], found[0.4999, order], found[0.3, order]):
            yield Result(f"smooth, P{order}, {n} cells a side, error of the energy at nu = 0.4999 over that at nu = 0.3", near / far, 2,
                         near, far)
        rate = float(np.log2(found[0.4999, order][-2] / found[0.4999, order][-1]))
        yield Result(f"smooth, P{order}, order of the energy's error", excess(2 * order, rate), 0.3, rate, 2 * order)


def strip(context):
    """A strip of width 2 a and height h between plates that are pressed together, by thin-layer theory with p = 0 at the sides:
    M (1 - tanh(k a) / (k a)) with M = lambda + 2 mu and k^2 = 12 mu / (M h^2)."""
    a, h, squeeze = 20.0, 1.0, 1e-4
    for nu in (0.49, 0.4995):
        M = 2 * MU * (1 - nu) / (1 - 2 * nu)
        k = np.sqrt(12 * MU / M) / h
        exact = M * (1 - np.tanh(k * a) / (k * a))
        for order, layers in ((1, 8), (2, 4)):
            found = {}
            for form in ("patches", "pointwise"):
                points, cells = box_mesh([40 * layers, layers], [2 * a, h])
                mesh = context.folder / f"strip-{layers}.msh"
                write_mesh(mesh, points, cells)
                content = scene(mesh, material(nu, form), order,
                                boundary_conditions={"dirichlet_boundary": [{"id": 2, "value": [0, 0]},
                                                                            {"id": 4, "value": [0, -squeeze * h]}]})
                run = run_scene(context, f"strip-{nu}-p{order}-{form}", content)
                found[form] = run.steps[-1]["energy"]["elastic"] / (0.5 * squeeze**2 * 2 * a * h)
            yield compare(f"bonded strip, nu = {nu}, P{order}, modulus by patches", found["patches"], exact, 0.03,
                          f"point by point {100 * (found['pointwise'] / exact - 1):.2g} % off")


def ring_mesh(path, around, across, inner, outer):
    angle = 2 * np.pi * np.arange(around) / around
    radius = np.linspace(inner, outer, across + 1)
    points = np.concatenate([np.column_stack([r * np.cos(angle), r * np.sin(angle)]) for r in radius])
    cells = []
    for j in range(across):
        for i in range(around):
            p, q = j * around + i, j * around + (i + 1) % around
            r, s = p + around, q + around
            cells += [(p, q, s), (p, s, r)] if (i + j) % 2 else [(p, q, r), (q, s, r)]
    write_mesh(path, points, oriented(points, np.array(cells)))


def ring(context):
    """A ring of rubber that two plates squeeze by 30 % of its diameter; inside it cannot move sideways at top and bottom."""
    found, worst, least = {}, 0, np.inf
    for order, around, across in ((1, 48, 4), (2, 48, 4), (1, 96, 8)):
        mesh = context.folder / f"ring-{around}.msh"
        ring_mesh(mesh, around, across, 0.6, 1.0)
        top, bottom = context.folder / "top.obj", context.folder / "bottom.obj"
        write_line(top, (2, 1.005), (-2, 1.005))
        write_line(bottom, (-2, -1.005), (2, -1.005))
        for form in ("patches", "pointwise"):
            content = scene(mesh, {**material(0.4995, form), "E": 3.0}, order, time={"tend": 1, "dt": 0.1, "quasistatic": True})
            content["geometry"] = [{"mesh": str(mesh), "surface_selection": [{"id": 9, "box": [[-0.05, -0.65], [0.05, 0.65]]}]},
                                   {"mesh": str(bottom), "is_obstacle": True, "surface_selection": 11},
                                   {"mesh": str(top), "is_obstacle": True, "surface_selection": 12}]
            content["boundary_conditions"] = {"obstacle_displacements": [{"id": 12, "value": [0, "-0.6 * t"]}],
                                              "dirichlet_boundary": [{"id": 9, "value": [0, 0], "dimension": [True, False]}]}
            content["defaults"], content["contact"] = "itr", {"enabled": True}
            run = run_scene(context, f"ring-p{order}-{around}-{form}", content)
            found[order, around, form] = run.steps[-1]["energy"]["elastic"]
            if form == "patches":
                worst = max([worst, *(step["newton_iterations"] for step in run.steps)])
                least = min([least, *(step["min_volume_ratio"] for step in run.steps)])
    exact = found[2, 48, "patches"]
    for order, around in ((1, 48), (1, 96)):
        yield compare(f"ring, P{order}, {around} cells around, elastic energy by patches", found[order, around, "patches"], exact,
                      0.05, f"point by point {100 * (found[order, around, 'pointwise'] / exact - 1):.2g} % off")
    yield Result("ring, worst step's iterations over 60", excess(worst, 60), 0, worst)
    yield Result("ring, cells inverted", float(not least > 0), 0, least)


def results(context):
    for part in (cook, smooth, strip, ring):
        yield from part(context)
