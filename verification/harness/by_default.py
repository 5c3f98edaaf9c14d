# SPDX-License-Identifier: MIT
"""Scenes that set no numeric key of method, held against converged values, other d-hats and units, and choices by hand."""
import copy
import csv
import dataclasses
import json
import re

from harness.suite import Result, compare

FORCE, UNITS, COST = 0.03, 0.005, 2
LEVELS = 3  # of refinement of the converged value
HONEST = 2  # times the error, or a share of it: what a warning may say of it
SHORT, REPEATS = 1.0, 3  # runs of fewer seconds are timed so often
QUADRATIC = "fixed quadratic"
REMESHED = {"space": {"remesh": {"enabled": True}}}


def body(mesh, **more):
    return {"mesh": mesh, "volume_selection": 1, "surface_selection": {"threshold": 1e-6}, **more}


def polyline(points):
    """Points of an obstacle and its edges, one after the other."""
    return points, [(k + 1, k + 2) for k in range(len(points) - 1)]


def obstacle(context, name, points, lines, **more):
    text = [f"v {float(x)!r} {float(y)!r} 0" for x, y in points] + [f"l {a} {b}" for a, b in lines]
    (context.folder / name).write_text("\n".join(text) + "\n")
    return {"mesh": name, "is_obstacle": True, **more}


def held(tag, axis, value=0):
    """A condition along one axis, in 3D."""
    return {"id": tag, "value": [value if k == axis else 0 for k in range(3)], "dimension": [k == axis for k in range(3)]}


def merged(scene, changes):
    result = dict(scene)
    for key, value in changes.items():
        result[key] = merged(result.get(key, {}), value) if isinstance(value, dict) else value
    return result


def is_remeshed(scene):
    return scene.get("space", {}).get("remesh", {}).get("enabled", False)


def fixed(scene):
    """The scene on the mesh that it has."""
    return {key: value for key, value in scene.items() if key != "space"}


def refined(scene, levels):
    scene = copy.deepcopy(scene)
    for entry in scene["geometry"]:
        if not entry.get("is_obstacle"):
            entry["n_refs"] = levels
    return scene


def quarters_on_finer_meshes(scene):
    """Runs of a body of revolution in a plane through its axis, of which a quarter bears a quarter of the force."""
    for level in range(LEVELS + 1):
        yield f"of revolution refined {level}", refined(scene, level), lambda rows, _: abs(rows[-1]["all_y"]) / 4


def materials_of(scene):
    return scene["materials"] if isinstance(scene["materials"], list) else [scene["materials"]]


def in_millimetres(scene):
    """The scene with numbers in mm, t and s."""
    scene = copy.deepcopy(scene)
    scene["units"] = {"length": "mm", "mass": "t", "time": "s"}
    for entry in scene["geometry"]:
        if "mesh" in entry:
            entry["unit"] = "m"
        if moved := entry.get("transformation", {}).get("translation"):
            entry["transformation"]["translation"] = [1000 * x for x in moved]
        if isinstance(entry.get("surface_selection"), dict):
            entry["surface_selection"] = {"threshold": 1000 * entry["surface_selection"]["threshold"]}
    for material in materials_of(scene):
        material["E"], material["rho"] = material["E"] / 1e6, material["rho"] / 1e12
    conditions = scene["boundary_conditions"]
    for entry in conditions.get("dirichlet_boundary", []) + conditions.get("obstacle_displacements", []):
        entry["value"] = [x if x == 0 else f"1000 * ({x})" for x in entry["value"]]
    if "rhs" in conditions:
        conditions["rhs"] = [1000 * x for x in conditions["rhs"]]
    for point in scene["output"].get("points", []):
        point["rest"] = [1000 * x for x in point["rest"]]
    for shape in scene.get("shapes", []):
        for key in {"center", "radius", "tube_radius"} & set(shape):
            shape[key] = [1000 * x for x in shape[key]] if isinstance(shape[key], list) else 1000 * shape[key]
    return scene


def in_milliseconds(scene):
    """The scene with numbers in m, kg and ms: a load by `rhs` is all that moves it."""
    scene = copy.deepcopy(scene)
    scene["units"] = {"length": "m", "mass": "kg", "time": "ms"}
    for material in materials_of(scene):
        material["E"] /= 1e6
    scene["boundary_conditions"]["rhs"] = [x / 1e6 for x in scene["boundary_conditions"]["rhs"]]
    scene["time"].update({key: 1000 * scene["time"][key] for key in ("dt", "tend")})
    return scene


def with_time(scene, factor):
    """The scene without inertia along the same path in `factor` times its time."""
    scene = copy.deepcopy(scene)
    conditions = scene["boundary_conditions"]
    for entry in conditions.get("dirichlet_boundary", []) + conditions.get("obstacle_displacements", []):
        entry["value"] = [x if x == 0 else x.replace("* t", f"* (t / {factor!r})") for x in entry["value"]]
    scene["time"].update({key: factor * scene["time"][key] for key in ("dt", "tend")})
    return scene


@dataclasses.dataclass
class Study:
    """A scene and what it is held against."""
    make: object  # of the context: the scene and its quantity, of the rows of forces.csv and the folder of a run
    thickness: float = 0.0  # of the thinnest part of its bodies [m], for choices by hand
    finer: object = None  # of the context: name, scene and quantity of runs for the converged value, the finest last
    exact: float | None = None
    is_judged: bool = True  # False: a mesh or shape on which no force is within the bar, held against what is told of it
    is_slow: bool = False  # fewer runs
    millimetres: float = 1.0  # factors that turn values in other units into SI units
    milliseconds: float = 1.0
    seconds: float | None = None  # most that the run may take, of one processor

    @property
    def name(self):
        return self.make.__name__


@dataclasses.dataclass
class Outcome:
    value: float
    iterations: int
    seconds: float  # of one processor, the least of the runs
    vertices: int
    told: float | None  # by how much forces are too large, as a warning says


def run(context, name, scene, quantity):
    """Value in the scene's units, and cost, of a run."""
    path, out, seconds = context.folder / f"{name}.json", context.folder / name, []
    path.write_text(json.dumps(scene, indent=1))
    while not seconds or (sum(seconds) < SHORT and len(seconds) < REPEATS):
        context.call("itr", "run", path, "-o", out, "--overwrite", "--threads", 1)
        steps = [json.loads(line) for line in open(out / "steps.jsonl")]
        seconds.append(sum(step["processor_seconds"] for step in steps))
    with open(out / "forces.csv") as file:
        rows = [{key: value if key == "name" else float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    warnings = [warning["text"] for warning in json.loads((out / "summary.json").read_text()).get("warnings", [])]
    told = [float(found[1]) / 100 for text in warnings if (found := re.search(r"too large by about ([\d.]+) %", text))]
    return Outcome(quantity(rows, out), sum(step["newton_iterations"] for step in steps), min(seconds), steps[-1]["vertices"],
                   max(told, default=None))


def chosen_dhat(context, scene):
    """What "auto" stands for [m]."""
    path = context.folder / "chosen.json"
    path.write_text(json.dumps(scene))
    return json.loads(context.call("itr", "explain", path, "--json"))["settings"]["/contact/dhat"]


def by_hand(study, scene):
    """Settings of an expert: surfaces that stand off more, friction of the step before, coarser remeshing."""
    stands_off = lambda share: {"contact": {"dhat": share * study.thickness}}
    if not study.is_slow:
        yield "wide d-hat", stands_off(0.01)
        yield "wider d-hat", stands_off(0.03)
    yield "one round", merged(stands_off(0.003), {"solver": {"contact": {"friction_iterations": 1}, "lagging_tolerance": 0}})
    if is_remeshed(scene):
        yield "coarser remeshing", merged(stands_off(0.01), {"space": {"remesh": {"relative_tolerance": 4e-4}}})


def variants(context, study, scene):
    """Name, scene and factor of the value of each run beside that by default."""
    yield "d-hat / 3", merged(scene, {"contact": {"dhat": chosen_dhat(context, scene) / 3}}), 1
    yield "mm", in_millimetres(scene), study.millimetres
    if not scene["time"].get("quasistatic", False):
        yield "ms", in_milliseconds(scene), study.milliseconds
    elif not study.is_slow:
        yield "time x 10", with_time(scene, 10.0), 1
        yield "time / 10", with_time(scene, 0.1), 1
    if is_remeshed(scene) and not study.is_slow:
        yield "refined", refined(scene, 1), 1
        if "shapes" not in scene:
            yield QUADRATIC, merged(fixed(scene), {"space": {"discr_order": 2}}), 1
    for name, changes in by_hand(study, scene):
        yield name, merged(scene, changes), 1


class Held:
    """The runs of a study, and its judgement."""

    def __init__(self, context, study, table):
        self.context, self.study, self.table = context, study, table
        self.scene, self.quantity = study.make(context)

    def run(self, variant, scene, quantity, factor=1):
        name = f"{self.study.name}-{variant}".replace(" ", "-").replace("/", "by")
        found = run(self.context, name, scene, quantity)
        found.value *= factor
        self.table.append([self.study.name, variant, repr(found.value), found.iterations, f"{found.seconds:.3g}", found.vertices])
        return found

    def fixed_meshes(self):
        first = 0 if is_remeshed(self.scene) else 1  # the default is on the mesh itself
        for level in range(first, 1 + (1 if self.context.quick else LEVELS)):
            yield f"fixed refined {level}", refined(fixed(self.scene), level), self.quantity

    def converged(self):
        """The exact value, or that of the finest mesh."""
        study = self.study
        if study.exact is not None:
            return study.exact
        for variant, scene, quantity in study.finer(self.context) if study.finer else self.fixed_meshes():
            finest = self.run(variant, scene, quantity).value
        return finest

    def results(self):
        study, name = self.study, self.study.name
        default = self.run("default", self.scene, self.quantity)
        if study.seconds:
            yield Result(f"{name}: seconds of one processor", default.seconds, study.seconds)
        converged = self.converged()
        yield compare(f"{name}: default", default.value, converged, FORCE if study.is_judged else None)
        if not study.is_judged:
            yield from self.words(default, converged)
            return
        found = {variant: self.run(variant, scene, self.quantity, factor)
                 for variant, scene, factor in variants(self.context, study, self.scene)}
        for variant in ("d-hat / 3", "refined"):
            if variant in found:
                yield compare(f"{name}: {variant}", found[variant].value, converged, FORCE)
        for variant in ("mm", "ms", "time x 10", "time / 10"):
            if variant in found:
                yield compare(f"{name}: {variant}", found[variant].value, default.value, UNITS)
        chosen = [name for name, _ in by_hand(study, self.scene)]
        right = [found[variant] for variant in chosen if abs(found[variant].value / converged - 1) <= FORCE] + [default]
        fewest, least = min(run.iterations for run in right), min(run.seconds for run in right)
        yield Result(f"{name}: iterations by the fewest", default.iterations / fewest, COST, default.iterations, fewest)
        yield Result(f"{name}: processor seconds by the least", default.seconds / least, COST, default.seconds, least)
        if other := found.get(QUADRATIC):
            yield Result(f"{name}: processor seconds by those of quadratic elements", default.seconds / other.seconds, None,
                         default.seconds, other.seconds, f"whose force is {100 * (other.value / converged - 1):+.2g} % off")

    def words(self, default, converged):
        """How what a warning tells of the error compares with it."""
        error = default.value / converged - 1
        if default.told is None:
            return
        apart = max(error / default.told, default.told / error) if error > 0 else float("inf")
        yield Result(f"{self.study.name}: error and what the warning tells", apart, HONEST, default.told, error)


def results(context, studies):
    """Of all studies; the runs are a table of the report."""
    table = []
    for study in studies:
        yield from Held(context, study, table).results()
    context.table("runs", ["scene", "variant", "value", "newton_iterations", "processor_seconds", "vertices"], table)
