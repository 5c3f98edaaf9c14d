# SPDX-License-Identifier: MIT
"""Scenes that set no key of method: their forces on refined meshes, with other d-hats and in other units, and their cost."""
import copy
import csv
import json
import math

import numpy as np

from harness.bisection import ball
from harness.scenes import box_mesh, write_mesh
from harness.suite import Result, compare

TITLE = "Forces by defaults"
QUANTITY = "force, or ratio of forces, of scenes without a key of method; Newton iterations"
REFERENCE = "the same scene refined twice, with a third of d-hat, in millimetres and in a tenth and ten times its time; the fewest iterations by hand"
TOLERANCE = "3 %; 0.5 % in other units; twice the iterations"
NEEDS = ("numpy", "meshio")

FORCE, UNITS, COST = 0.03, 0.005, 2
# Settings of an expert: surfaces that stand off more, and friction of the step before.
BY_HAND = {"wide d-hat": {"contact": {"dhat": 10}}, "wider d-hat": {"contact": {"dhat": 30}},
           "one round": {"contact": {"dhat": 3}, "solver": {"contact": {"friction_iterations": 1}, "lagging_tolerance": 0}}}


def body(mesh, **transformation):
    entry = {"mesh": mesh, "volume_selection": 1, "surface_selection": {"threshold": 1e-6}}
    return {**entry, "transformation": transformation} if transformation else entry


def obstacle(context, name, points, lines, **more):
    text = [f"v {x!r} {y!r} 0" for x, y in points] + [f"l {a} {b}" for a, b in lines]
    (context.folder / name).write_text("\n".join(text) + "\n")
    return {"mesh": name, "is_obstacle": True, **more}


def o_ring(context):
    """A ring's cross-section, 3 mm wide, squeezed by a quarter between two plates."""
    signs = [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    write_mesh(context.folder / "ring.msh", *ball(0.0015, lambda x: np.full(len(x), 3.5e-4), signs))
    plate = [(-0.004, 0.0), (0.004, 0.0)]
    return {"geometry": [body("ring.msh"),
                         obstacle(context, "plate.obj", plate, [(1, 2)], surface_selection=1,
                                  transformation={"translation": [0, -0.00152]}),
                         obstacle(context, "plate.obj", plate, [(1, 2)], surface_selection=2,
                                  transformation={"translation": [0, 0.00152]})],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 6e6, "nu": 0.49, "rho": 1100, "plane_strain": True}],
            "boundary_conditions": {"obstacle_displacements": [{"id": 2, "value": [0, "-0.00079 * t"]}]},
            "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3},
            "output": {"forces": [{"name": "force", "obstacles": 2}]}}, lambda rows: abs(rows[-1]["all_y"])


def press_fit(context):
    """A block that is pushed into a slot narrower by 2 %."""
    write_mesh(context.folder / "block.msh", *box_mesh([12, 8], [0.015, 0.01]))
    wall = lambda y, out: ([(0.016, y + out), (0.022, y), (0.05, y)], [(1, 2), (2, 3)])
    return {"geometry": [body("block.msh"), obstacle(context, "low.obj", *wall(0.0001, -0.0006)),
                         obstacle(context, "high.obj", *wall(0.0099, 0.0006))],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 1e8, "nu": 0.35, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.014 * t", 0]}]},
            "time": {"dt": 0.04, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.2},
            "output": {"forces": [{"name": "force", "bodies": 1}]}}, lambda rows: abs(rows[-1]["reaction_x"])


def plates(context):
    """Two plates that stick to each other and to a slope: friction of the lower one by its contact force."""
    write_mesh(context.folder / "plate.msh", *box_mesh([10, 1], [0.2, 0.02]))
    slope = math.radians(15)
    return {"geometry": [{"type": "ground", "is_obstacle": True},
                         *({**body("plate.msh", translation=[0, 1e-5 + k * 0.02001]), "volume_selection": k + 1} for k in range(2))],
            "materials": {"type": "NeoHookean", "E": 1e8, "nu": 0.3, "rho": 1000},
            "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
            "time": {"dt": 0.01, "tend": 2},
            "contact": {"enabled": True, "friction_coefficient": 0.5},
            "output": {"forces": [{"name": "force", "bodies": [1, 2]}]}}, \
        lambda rows: sum(row["friction_x"] for row in rows[-50:]) / sum(row["contact_y"] for row in rows[-50:])


def thin_wall(context):
    """A wall, a millimetre thick, that is pressed and touches nothing."""
    write_mesh(context.folder / "wall.msh", *box_mesh([4, 4, 1], [0.004, 0.004, 0.001]))
    held = [{"id": 5, "value": [0, 0, 0], "dimension": [False, False, True]},
            {"id": 6, "value": [0, 0, "-0.0003 * t"], "dimension": [False, False, True]},
            {"id": 1, "value": [0, 0, 0], "dimension": [True, False, False]},
            {"id": 2, "value": [0, 0, 0], "dimension": [False, True, False]}]
    return {"geometry": [{"mesh": "wall.msh", "volume_selection": 1, "surface_selection": {"threshold": 1e-7}}],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": held},
            "time": {"dt": 0.25, "tend": 1, "quasistatic": True}, "contact": {"enabled": True},
            "output": {"forces": [{"name": "force", "surfaces": 5}]}}, lambda rows: abs(rows[-1]["all_z"])


SCENES = [o_ring, press_fit, plates, thin_wall]


def refined(scene, levels):
    scene = copy.deepcopy(scene)
    for entry in scene["geometry"]:
        if not entry.get("is_obstacle"):
            entry["n_refs"] = levels
    return scene


def scaled(scene, length=1.0, time=1.0):
    """The scene with its motions, meshes and moduli in metres by `length`, and with `time` times its times, if it has no inertia."""
    scene = copy.deepcopy(scene)
    if length != 1:
        scene["units"] = {"length": "mm", "mass": "t", "time": "s"}
        for entry in scene["geometry"]:
            if "mesh" in entry:
                entry["unit"] = "m"
            moved = entry.get("transformation", {}).get("translation")
            if moved:
                entry["transformation"]["translation"] = [length * x for x in moved]
            if isinstance(entry.get("surface_selection"), dict):
                entry["surface_selection"] = {"threshold": length * entry["surface_selection"]["threshold"]}
        for material in scene["materials"] if isinstance(scene["materials"], list) else [scene["materials"]]:
            material["E"], material["rho"] = material["E"] / 1e6, material["rho"] / 1e12
    conditions = scene["boundary_conditions"]
    for entry in conditions.get("dirichlet_boundary", []) + conditions.get("obstacle_displacements", []):
        entry["value"] = [x if x == 0 else f"{length!r} * ({x})".replace("* t", f"* (t / {time!r})") for x in entry["value"]]
    if "rhs" in conditions:
        conditions["rhs"] = [length * x for x in conditions["rhs"]]
    scene["time"].update({key: time * scene["time"][key] for key in ("dt", "tend")})
    return scene


def merged(scene, changes):
    result = dict(scene)
    for key, value in changes.items():
        result[key] = merged(result.get(key, {}), value) if isinstance(value, dict) else value
    return result


def run(context, name, scene, quantity):
    """Value, Newton iterations, d-hat [m] and seconds of a run with ITR's defaults."""
    path = context.folder / f"{name}.json"
    path.write_text(json.dumps(scene, indent=1))
    out = context.folder / name
    context.call("itr", "run", path, "-o", out, "--overwrite", "--threads", 1)
    steps = [json.loads(line) for line in open(out / "steps.jsonl")]
    with open(out / "forces.csv") as file:
        rows = [{key: value if key == "name" else float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    seconds = sum(step["processor_seconds"] for step in steps)
    return quantity(rows), sum(step["newton_iterations"] for step in steps), seconds


def variants(context, scene):
    """Name and scene of each run of a scene: by default first, then those that it is held against."""
    quasistatic = scene["time"].get("quasistatic", False)
    yield "default", scene
    for levels in (1,) if context.quick else (1, 2):
        yield f"refined {levels}", refined(scene, levels)
    dhat = 1e-3 * thickness(scene)
    yield "d-hat / 3", merged(scene, {"contact": {"dhat": dhat / 3}})
    yield "mm", scaled(scene, length=1000.0)
    if quasistatic:
        yield "time x 10", scaled(scene, time=10.0)
        yield "time / 10", scaled(scene, time=0.1)
    for name, changes in BY_HAND.items():
        changes = copy.deepcopy(changes)
        changes["contact"]["dhat"] *= dhat
        yield name, merged(scene, changes)


def thickness(scene):
    return {"ring.msh": 0.003, "block.msh": 0.01, "plate.msh": 0.02,
            "wall.msh": 0.001}[next(entry["mesh"] for entry in scene["geometry"] if not entry.get("is_obstacle"))]


def results(context):
    table = []
    for make in SCENES:
        scene, quantity = make(context)
        name, found = make.__name__, {}
        for variant, content in variants(context, scene):
            value, iterations, seconds = run(context, f"{name}-{variant}".replace(" ", "-").replace("/", "by"), content, quantity)
            if variant == "mm" and len(content["boundary_conditions"].get("rhs", [])) == 0 and make is not thin_wall:
                value *= 1000  # bodies are one unit of length thick
            found[variant] = value, iterations
            table.append([name, variant, repr(value), iterations, f"{seconds:.3g}"])
        finest = found[max(v for v in found if v.startswith("refined"))][0]
        value, iterations = found["default"]
        right = [count for variant, (other, count) in found.items()
                 if (variant == "default" or variant in BY_HAND) and abs(other / finest - 1) <= FORCE]
        yield compare(f"{name}: refined", value, finest, FORCE)
        yield compare(f"{name}: a third of d-hat", value, found["d-hat / 3"][0], FORCE)
        for variant in ("mm", "time x 10", "time / 10"):
            if variant in found:
                yield compare(f"{name}: {variant}", found[variant][0], value, UNITS)
        yield Result(f"{name}: iterations by the fewest", iterations / min(right, default=iterations), COST, iterations)
    context.table("runs", ["scene", "variant", "value", "newton_iterations", "processor_seconds"], table)
