# SPDX-License-Identifier: MIT
"""Problems as scenes of ITR, by its defaults but for the keys that a run names."""
import csv
import json

import numpy as np

import problem  # noqa: F401
from harness.scenes import write_mesh

AXES = "xyz"


def expression(value):
    """Of t, for a number that grows linearly or for a curve."""
    if not isinstance(value, list):
        return f"{value:.17g} * t"
    parts = []
    for (t0, v0), (t1, v1) in zip(value, value[1:]):
        if v1 != v0:
            parts.append(f"{(v1 - v0) / (t1 - t0):.17g} * min(max(t - {t0:.17g}, 0), {t1 - t0:.17g})")
    return " + ".join(parts) or "0"


def material(body, number, section):
    law = {"id": number, "rho": 1e-9}
    if body.material["type"] == "IsochoricNeoHooke":
        E, nu = body.material["E"], body.material["nu"]
        return {**law, "type": "UnconstrainedOgden", "mus": [E / 2 / (1 + nu)], "alphas": [2.0], "Ds": [6 * (1 - 2 * nu) / E]}
    return {**law, **body.material, **({"plane_strain": True} if section == "plane strain" else {})}


def scene(problem, folder, order, dt):
    dim, geometry = problem.dim, []
    for k, body in enumerate(problem.bodies):
        write_mesh(folder / f"body{k}.msh", body.points, body.cells, np.full(len(body.cells), k + 1))
        rules = [{"id": 100 + i, "box": held.box} for i, held in enumerate(problem.held) if held.body == k]
        rules += [{"id": 200 + i, "box": load.box} for i, load in enumerate(problem.loads) if load.body == k]
        geometry.append({"mesh": f"body{k}.msh", "volume_selection": k + 1, "surface_selection": to_lists(rules)})
    if any(contact.master is None for contact in problem.contacts):
        write_plane(folder / "plane.obj", dim, problem.length, problem.section == "axisymmetric")
        geometry.append({"mesh": "plane.obj", "is_obstacle": True, "name": "plane"})
    held = [{"id": 100 + i, "value": [expression(h.values.get(a, 0.0)) for a in range(dim)],
             "dimension": [a in h.values for a in range(dim)]} for i, h in enumerate(problem.held)]
    loads = [{"id": 200 + i, "value": [expression(x) for x in load.traction]} for i, load in enumerate(problem.loads)]
    content = {"geometry": geometry,
               "materials": [material(b, k + 1, problem.section) for k, b in enumerate(problem.bodies)],
               "boundary_conditions": {"dirichlet_boundary": held, **({"neumann_boundary": loads} if loads else {})},
               "contact": {"enabled": True, **({"friction_coefficient": problem.friction} if problem.friction else {})},
               "time": {"dt": dt, "tend": problem.tend, "quasistatic": True},
               "output": {"forces": [{"name": name, "surfaces": 100 + i} for name, (i, _) in problem.reactions.items()],
                          "points": [{"name": name, "rest": [float(c) for c in at]} for name, (_, at, _) in problem.points.items()],
                          "paraview": {"skip_frame": 10000}}}
    if problem.section == "axisymmetric":
        content["axisymmetric"] = True
    if order == 2:
        content["space"] = {"discr_order": 2}
    return content


def to_lists(rules):
    return [{**rule, "box": [[float(c) for c in corner] for corner in rule["box"]]} for rule in rules]


def write_plane(path, dim, length, half):
    if dim == 2:
        path.write_text(f"v {0 if half else -length} 0 0\nv {length} 0 0\nl 1 2\n")
    else:
        path.write_text("".join(f"v {x * length} {y * length} 0\n" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
                        + "f 1 2 3\nf 1 3 4\n")


def set_keys(content, keys):
    for pointer, value in keys.items():
        *parents, last = pointer.strip("/").split("/")
        place = content
        for name in parents:
            place = place.setdefault(name, {})
        place[last] = value


def write(problem, folder, order, settings):
    """Settings: `dt`, and `keys`, pointer -> value."""
    content = scene(problem, folder, order, settings.get("dt", 1.0))
    set_keys(content, settings.get("keys", {}))
    (folder / "scene.json").write_text(json.dumps(content, indent=1) + "\n")


def command(itr, folder):
    return [str(itr), "run", str(folder / "scene.json"), "-o", str(folder / "run"), "--overwrite", "--threads", "1"]


def curve(folder, name, column):
    file = "points.csv" if column.startswith("u_") else "forces.csv"
    with open(folder / "run" / file, newline="") as rows:
        return [(float(row["t"]), float(row[column]), row) for row in csv.DictReader(rows) if row["name"] == name and row[column]]


def columns(problem):
    return {**{name: f"reaction_{AXES[axis]}" for name, (_, axis) in problem.reactions.items()},
            **{name: f"u_{AXES[axis]}" for name, (_, _, axis) in problem.points.items()}}


def read(problem, folder):
    """Curves, and the numbers of iterations and steps."""
    curves = {}
    for name, column in columns(problem).items():
        rows = [(t, v) for t, v, _ in curve(folder, name, column) if t > 0]
        curves["t"], curves[name] = (np.array(x) for x in zip(*rows))
    steps = [json.loads(line) for line in open(folder / "run/steps.jsonl")]
    return curves, sum(s.get("newton_iterations", 0) for s in steps), sum(s["step"] > 0 for s in steps)


def bar(problem, folder):
    """The sum of the sizes of all estimated errors of the last value, over it; of a run with /output/error_bars."""
    name, column = next(iter(columns(problem).items()))
    _, value, row = curve(folder, name, column)[-1]
    errors = [float(v) for key, v in row.items() if key.startswith(f"{column}_error_") and v]
    return sum(map(abs, errors)) / abs(value) if errors else None
