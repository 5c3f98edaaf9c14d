# SPDX-License-Identifier: MIT
"""Scenes that set no key of method: their forces on refined meshes, with other d-hats and in other units, and their cost."""
import copy
import csv
import json
import math

import numpy as np

from harness.bisection import ball
from harness.scenes import box_mesh, oriented, write_mesh
from harness.suite import Result, compare

TITLE = "Forces by defaults"
QUANTITY = "force, or ratio of forces, of scenes without a key of method; Newton iterations"
REFERENCE = "the same scene refined twice (once in 3D), with a third of d-hat, in millimetres and in a tenth and ten times its time; the fewest iterations by hand"
TOLERANCE = "3 %; 0.5 % in other units; twice the iterations; the quarter O-ring in two minutes of one processor"
NEEDS = ("numpy", "meshio")

FORCE, UNITS, COST, SECONDS = 0.03, 0.005, 2, 120
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


def swept_disc(radius, rings, around, sections):
    """Points and tetrahedra of a quarter of a ring about the z axis, of round cross-section: hexagons in it, wedges along it."""
    first = [0, *(1 + 3 * r * (r - 1) for r in range(1, rings + 1))]
    disc = [(0.0, 0.0), *((radius * r / rings * math.cos(math.pi * k / (3 * r)), radius * r / rings * math.sin(math.pi * k / (3 * r)))
                          for r in range(1, rings + 1) for k in range(6 * r))]
    triangles = []
    for r in range(1, rings + 1):
        at = lambda ring, k: first[ring] + k % (6 * ring) if ring else 0
        for side in range(6):
            for j in range(r):
                outer, inner = side * r + j, side * (r - 1) + j
                triangles.append((at(r, outer), at(r, outer + 1), at(r - 1, inner)))
                if j < r - 1:
                    triangles.append((at(r - 1, inner), at(r, outer + 1), at(r - 1, inner + 1)))
    points, cells, size = [], [], len(disc)
    for k in range(sections + 1):
        along, across = math.cos(math.pi * k / (2 * sections)), math.sin(math.pi * k / (2 * sections))
        points += [((around + x) * along if k < sections else 0, (around + x) * across, z) for x, z in disc]
    for k in range(sections):
        for triangle in triangles:
            (a, b, c), (d, e, f) = ([v + n * size for v in sorted(triangle)] for n in (k, k + 1))
            cells += [(a, b, c, f), (a, b, f, e), (a, e, f, d)]
    points = np.array(points)
    return points, oriented(points, cells)


def o_ring_3d(context):
    """A quarter of an O-ring, 3 mm thick, squeezed by a quarter between two plates and remeshed."""
    write_mesh(context.folder / "quarter.msh", *swept_disc(0.0015, 2, 0.01, 20))
    (context.folder / "square.obj").write_text("v -0.002 -0.002 0\nv 0.0135 -0.002 0\nv 0.0135 0.0135 0\nv -0.002 0.0135 0\n"
                                               "f 1 2 3\nf 1 3 4\n")
    plate = lambda tag, z: {"mesh": "square.obj", "is_obstacle": True, "surface_selection": tag,
                            "transformation": {"translation": [0, 0, z]}}
    return {"geometry": [{"mesh": "quarter.msh", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                         plate(11, -0.00152), plate(12, 0.00152)],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 6e6, "nu": 0.49, "rho": 1100}],
            "boundary_conditions": {"dirichlet_boundary": [held(1, 0), held(2, 1)],
                                    "obstacle_displacements": [{"id": 12, "value": [0, 0, "-0.00079 * t"]}]},
            "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3}, "space": {"remesh": {"enabled": True}},
            "output": {"forces": [{"name": "force", "obstacles": 12}]}}, lambda rows: abs(rows[-1]["all_z"])


def held(tag, axis, value=0):
    """A condition along one axis, in 3D."""
    return {"id": tag, "value": [value if k == axis else 0 for k in range(3)], "dimension": [k == axis for k in range(3)]}


def sphere(context):
    """A rigid sphere that is pressed into a quarter of a block of rubber by a fifth of its height."""
    write_mesh(context.folder / "block3.msh", *box_mesh([4, 4, 3], [0.01, 0.01, 0.008]))
    radius, around, down = 0.005, 48, 24
    angle = lambda k: math.pi / 2 * k / down
    points = [(0.0, 0.0, -radius)] + [(radius * math.sin(angle(k)) * math.cos(2 * math.pi * i / around),
                                       radius * math.sin(angle(k)) * math.sin(2 * math.pi * i / around), -radius * math.cos(angle(k)))
                                      for k in range(1, down + 1) for i in range(around)]
    at = lambda k, i: 2 + (k - 1) * around + i % around
    faces = [(1, at(1, i), at(1, i + 1)) for i in range(around)]
    for k in range(1, down):
        for i in range(around):
            faces += [(at(k, i), at(k + 1, i), at(k + 1, i + 1)), (at(k, i), at(k + 1, i + 1), at(k, i + 1))]
    (context.folder / "sphere.obj").write_text("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points) +
                                               "".join(f"f {a} {b} {c}\n" for a, b, c in faces))
    conditions = [held(1, 0), held(2, 1), {"id": 5, "value": [0, 0, 0]}]
    return {"geometry": [{"mesh": "block3.msh", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                         {"mesh": "sphere.obj", "is_obstacle": True, "surface_selection": 12,
                          "transformation": {"translation": [0, 0, 0.01302]}}],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 6e6, "nu": 0.49, "rho": 1100}],
            "boundary_conditions": {"dirichlet_boundary": conditions,
                                    "obstacle_displacements": [{"id": 12, "value": [0, 0, "-0.00162 * t"]}]},
            "time": {"dt": 0.25, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3}, "space": {"remesh": {"enabled": True}},
            "output": {"forces": [{"name": "force", "obstacles": 12}]}}, lambda rows: abs(rows[-1]["all_z"])


def hook(context):
    """A beam that is pushed over a bump, nose first: the force of insertion. Both have sharp tips."""
    points, cells = box_mesh([40, 4], [0.02, 0.002])
    depth = 0.0015 * np.maximum(0, 1 - np.abs(points[:, 0] - 0.018) / 0.002) * (1 - points[:, 1] / 0.002)
    write_mesh(context.folder / "hook.msh", points - np.outer(depth, [0, 1]), cells)
    return {"geometry": [body("hook.msh"), obstacle(context, "bump.obj", [(0.0205, -0.003), (0.0225, -0.0005), (0.0245, -0.003)],
                                                    [(1, 2), (2, 3)])],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 2e9, "nu": 0.35, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.006 * t", 0]}]},
            "time": {"dt": 1 / 60, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3},
            "output": {"forces": [{"name": "force", "bodies": 1}]}}, lambda rows: max(row["reaction_x"] for row in rows)


def remeshed(make):
    """The same scene, remeshed."""
    def scene_of(context):
        scene, quantity = make(context)
        return merged(scene, {"space": {"remesh": {"enabled": True}}}), quantity
    scene_of.__name__ = f"{make.__name__}_remeshed"
    return scene_of


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


IN_3D = [o_ring_3d, sphere, thin_wall]
SLOW = [o_ring_3d, sphere]
QUICK_SCENES = [o_ring, press_fit, plates, thin_wall]
SCENES = [o_ring, *SLOW, press_fit, remeshed(press_fit), hook, remeshed(hook), plates, thin_wall]


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


def chosen_dhat(context, scene):
    """What "auto" stands for [m]."""
    path = context.folder / "chosen.json"
    path.write_text(json.dumps(scene))
    return json.loads(context.call("itr", "explain", path, "--json"))["settings"]["/contact/dhat"]


def variants(context, scene, is_slow):
    """Name and scene of each run of a scene: by default first, then those that it is held against."""
    quasistatic = scene["time"].get("quasistatic", False)
    yield "default", scene
    for levels in (1,) if context.quick or is_slow else (1, 2):
        yield f"refined {levels}", refined(scene, levels)
    yield "d-hat / 3", merged(scene, {"contact": {"dhat": chosen_dhat(context, scene) / 3}})
    yield "mm", scaled(scene, length=1000.0)
    if quasistatic and not is_slow:
        yield "time x 10", scaled(scene, time=10.0)
        yield "time / 10", scaled(scene, time=0.1)
    dhat = 1e-3 * thickness(scene)
    for name, changes in BY_HAND.items():
        changes = copy.deepcopy(changes)
        changes["contact"]["dhat"] *= dhat
        yield name, merged(scene, changes)


def thickness(scene):
    return {"ring.msh": 0.003, "quarter.msh": 0.003, "block.msh": 0.01, "block3.msh": 0.008, "hook.msh": 0.002, "plate.msh": 0.02,
            "wall.msh": 0.001}[next(entry["mesh"] for entry in scene["geometry"] if not entry.get("is_obstacle"))]


def results(context):
    table = []
    for make in QUICK_SCENES if context.quick else SCENES:
        scene, quantity = make(context)
        name, found = make.__name__, {}
        for variant, content in variants(context, scene, make in SLOW):
            value, iterations, seconds = run(context, f"{name}-{variant}".replace(" ", "-").replace("/", "by"), content, quantity)
            if variant == "mm" and len(content["boundary_conditions"].get("rhs", [])) == 0 and make not in IN_3D:
                value *= 1000  # bodies are one unit of length thick
            found[variant] = value, iterations
            if make is o_ring_3d and variant == "default":
                yield Result(f"{name}: seconds of one processor", seconds, SECONDS)
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
