# SPDX-License-Identifier: MIT
"""Plans a study: a table of series, and the runs that it makes of a scene. Settings are JSON texts by pointer."""

import itertools
import json
import math
import os
import pathlib
from dataclasses import dataclass

REFERENCE = "reference"  # name of the first reference's run, and of whatever takes its place
SECOND_REFERENCE = "second-reference"  # run that shows the error of the reference

FACTORS = (4, 1, 1 / 4, 1 / 16)  # default tolerances by the scene's
REFERENCE_FRACTION = 1 / 16  # the reference's tolerance by the smallest of the study
REFERENCE_TRIES = 3  # tolerances of references, where none is asked for
NEXT_TRY = 1 / 16  # tolerance of a reference by that of the one before, which split nothing
SECOND_FRACTION = 4  # the second reference's tolerance by the first's
# A remeshed step solves twice, so only friction that has converged is the same on all meshes.
FRICTION_ROUNDS = {
    "/solver/contact/friction_iterations": "50",
    "/solver/contact/friction_convergence_tol": "0",
    "/solver/lagging_tolerance": "0",
}

ORDER = "/space/discr_order"
ENABLED, TOLERANCE = "/space/remesh/{}/enabled", "/space/remesh/{}/acceptance_tolerance"

# Kuhn's tetrahedra of a cube, one for each way along its edges from corner 0 to corner 7; bits are axes.
TETRAHEDRA = ((0, 1, 3, 7), (0, 5, 1, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 6, 4, 7))


@dataclass(frozen=True)
class Series:
    """A kind of run, as a row of the table."""

    name: str
    kind: str  # levels, rows, tolerances, solvers, time
    is_default: bool
    what: str
    settings: dict

    def enables(self, operation):
        return self.settings.get(ENABLED.format(operation)) == "true"

    @property
    def is_quadratic(self):
        return self.settings.get(ORDER) == "2"

    @property
    def varies_mesh(self):
        return self.kind not in ("solvers", "time")


@dataclass
class Run:
    name: str  # also of its folder
    series: Series
    label: str
    settings: dict
    solver: str = ""  # empty: the scene's
    reference: str = REFERENCE  # name of the run that it is compared with; empty: none


def remeshed(*operations, **changes):
    """Settings of remeshing that splits and collapses, with further operations and with values of keys of remeshing."""
    keys = {"enabled": "true", "type": '"physics"', "screening": '"bounds"'}
    keys |= {f"{name}/enabled": str(name in operations).lower() for name in ("curve", "straighten", "swap", "smooth")}
    keys |= {key.replace("__", "/"): value for key, value in changes.items()}
    return {f"/space/remesh/{key}": value for key, value in keys.items()}


P2 = {ORDER: "2"}
FIXED = {"/space/remesh/enabled": "false"}
CURVES = ("curve", "straighten")
SHAPES = ("swap", "smooth")
ALL_SERIES = {
    name: Series(name, kind, is_default, what, settings)
    for name, kind, is_default, what, settings in (
        ("uniform", "levels", True, "uniform refinement, linear elements (P1)", FIXED),
        ("rows", "rows", True, "in 3D, where the body is a box: as many linear elements in rows", FIXED),
        ("uniform-p2", "levels", True, "uniform refinement, quadratic elements (P2)", FIXED | P2),
        ("itr", "tolerances", True, "splits and collapses", remeshed()),
        ("swaps", "tolerances", True, "splits, collapses and swaps", remeshed("swap")),
        ("smoothing", "tolerances", True, "splits, collapses, swaps and smoothing", remeshed(*SHAPES)),
        ("hp", "tolerances", False, "splits, curved edges and collapses", remeshed(*CURVES)),
        ("hp-smoothing", "tolerances", False, "`hp`, swaps and smoothing", remeshed(*CURVES, *SHAPES)),
        ("p", "tolerances", False, "curved edges alone", remeshed(*CURVES, split__enabled="false")),
        ("splits-p2", "tolerances", False, "splits of quadratic elements", remeshed() | P2),
        ("no-screening", "tolerances", False, "`smoothing`, a patch relaxed for every edge", remeshed(*SHAPES, screening='"none"')),
        ("culling", "tolerances", False, "`smoothing`, the paper's culling by energy", remeshed(*SHAPES, screening='"energy-percentile"')),
        ("sizing-field", "levels", False, "the sizing-field baseline, from each uniform level", remeshed(type='"sizing_field"')),
        ("solvers", "solvers", False, "the linear solvers that are there, without remeshing", FIXED),
        ("time", "time", False, "dt, dt/2 and dt/4 without remeshing, against dt/4", FIXED),
    )
}


def text_of(number):
    return repr(number).removesuffix(".0") if isinstance(number, float) else str(number)


def merged(*parts):
    """One table of settings, in which the last of one pointer stands last, as it counts for `itr run`."""
    settings = {}
    for pointer, value in itertools.chain(*(part.items() for part in parts)):
        settings.pop(pointer, None)
        settings[pointer] = value
    return settings


def has(scene, pointer):
    for key in pointer.split("/")[1:]:
        scene = scene.get(key) if isinstance(scene, dict) else None
    return scene is not None


class Plan:
    """References, the first of which that splits anything counts, and the runs to compare: by the options of `itr study`, and
    by what `itr explain --json` says of the scene."""

    def __init__(self, options, facts):
        self.options, self.facts, self.scene = options, facts, facts["scene"]
        self.in_si = facts["units"]["in_si"]
        self.levels = options.levels or (3 if facts["dim"] == 2 else 2)
        self.finest = f"uniform-{self.levels}"  # level that is the reference where no other finishes
        self.coarser = f"uniform-{self.levels - 1}"  # level that shows its error then
        self.skip = max(1, facts["time"]["steps"] // options.frames)
        own = facts["settings"][TOLERANCE.format("split")] * self.in_si["J"]
        self.tolerances = sorted(options.tolerances or [factor * own for factor in FACTORS], reverse=True)
        geometry = self.scene["geometry"]
        is_list = isinstance(geometry, list)
        places = [(f"/geometry/{i}", one) for i, one in enumerate(geometry)] if is_list else [("/geometry", geometry)]
        self.bodies = [(p, one) for p, one in places if not one.get("is_obstacle") and one.get("enabled", True)]

        names = options.series or [series.name for series in ALL_SERIES.values() if series.is_default]
        asked = [series for series in ALL_SERIES.values() if series.name in names or "all" in names]
        self.references, self.runs = [], []
        if not options.reference:
            has_curves = any(s.kind == "tolerances" and (s.enables("curve") or s.is_quadratic) for s in asked)
            *self.references, second = self.make_references(has_curves)
            self.runs.append(second)
        for series in asked:
            self.runs += getattr(self, f"make_{series.kind}")(series)
        shared = self.shared_settings()
        for run in self.references + self.runs:
            run.settings = merged(options.sets, shared, run.settings)
            run.solver = run.solver or options.solver

    def shared_settings(self):
        """Values that the scene leaves open and all runs have to agree on, and those of their output."""
        settings = self.facts["settings"].items()
        shared = {pointer: text_of(value) for pointer, value in settings if not pointer.startswith("/space/remesh")}
        self.notes = ""  # further settings that all runs share, in words
        if self.facts["friction"]:
            shared |= {pointer: value for pointer, value in FRICTION_ROUNDS.items() if pointer not in self.options.sets}
            rounds = shared.get(next(iter(FRICTION_ROUNDS))) or self.scene["solver"]["contact"]["friction_iterations"]
            self.notes = f"friction lagged until it does not change, at most {rounds} rounds a solve"
        shared["/output/paraview/skip_frame"] = str(self.skip)
        shared |= {f"/output/paraview/options/{field}": "true" for field in ("kinetic_energy", "momentum")}
        return shared | ({} if set(self.in_si.values()) == {1} else {"/output/units": '"SI"'})

    def make_references(self, has_curves):
        """The finest level, split on where that gains least of all, and never coarsened: its space has all uniform ones. Beside
        series with quadratic functions it has these too. The last one, coarser by a level and a tolerance, shows its error."""
        settings = remeshed(collapse__enabled="false")
        if has_curves:  # only what is distorted becomes straight
            no_gain = {"straighten__acceptance_tolerance": "1e100"}
            settings = remeshed(*CURVES, collapse__enabled="false", **no_gain) | P2
        series = Series(REFERENCE, "levels", True, "what the others are compared with", settings)

        def split_on(name, level, joules, reference=""):
            label = f"{'order 2, ' if has_curves else ''}{self.level_label(level)}, split on to {joules:g} J"
            return Run(name, series, label, self.on_level(series, level, self.tolerances_of(series, joules)), "", reference)

        asked, finest = self.options.reference_tolerance, self.levels - has_curves
        joules = asked or REFERENCE_FRACTION * self.tolerances[-1]
        yield split_on(REFERENCE, finest, joules)
        for k in range(1, 1 if asked else REFERENCE_TRIES):
            yield split_on(f"{REFERENCE}-{joules * NEXT_TRY**k:g}", finest, joules * NEXT_TRY**k)
        yield split_on(SECOND_REFERENCE, max(finest - 1, 0), SECOND_FRACTION * joules, REFERENCE)

    def make_levels(self, series):
        # A level of quadratic elements has about as many unknowns as the next one of linear elements.
        for k in range(self.levels + (not series.is_quadratic)):
            yield Run(f"{series.name}-{k}", series, self.level_label(k), self.on_level(series, k))

    def make_rows(self, series):
        """A run for each level with about as many cells in rows, where the bodies are one box."""
        folder = pathlib.Path(self.options.output) / "meshes"
        bodies, corners = self.facts["bodies"], self.facts["box"]
        for level in range(self.levels + 1) if self.facts["dim"] == 3 and corners else ():
            file = folder / f"rows-{level}.msh"
            mesh = self.with_mesh(os.path.relpath(file))
            if not mesh:
                return
            low, high = ([c * self.in_si["m"] for c in corner] for corner in corners)
            body = bodies[0] if len(bodies) == 1 else 0
            counts = write_rows(low, high, self.facts["cells"] * 8**level, body, file)
            label = " x ".join(map(str, counts)) + " cubes"
            yield Run(f"{series.name}-{level}", series, label, merged(self.of_order(series), mesh))

    def make_tolerances(self, series):
        for start, joules in itertools.product(self.options.starts, self.tolerances):
            origin = (f"-from-{start}", f", from {self.level_label(start)}") if start else ("", "")
            settings = self.on_level(series, start, self.tolerances_of(series, joules))
            yield Run(f"{series.name}-{joules:g}{origin[0]}", series, f"tolerance {joules:g} J{origin[1]}", settings)

    def make_solvers(self, series):
        for name in self.facts["solvers"]:
            if name not in ("auto", "dense"):
                folder = f"{series.name}-{name.replace(':', '-')}"
                yield Run(folder, series, name, self.on_level(series, self.levels - 1), name)

    def make_time(self, series):
        """The same end in steps of dt / parts."""
        time = self.facts["time"]
        for parts in (1, 2, 4):
            steps = {"/output/paraview/skip_frame": str(self.skip * parts)}
            for key, value in (("dt", time["dt"] / parts), ("time_steps", time["steps"] * parts)):
                if has(self.scene, f"/time/{key}"):
                    steps[f"/time/{key}"] = text_of(value)
            label = f"dt {time['dt'] * self.in_si['s'] / parts:g} s"
            settings = self.on_level(series, self.levels - 1, steps)
            yield Run(f"{series.name}-{parts}", series, label, settings, "", f"{series.name}-4")

    def of_order(self, series):
        """A series' settings; where the scene asks for quadratic elements, those of linear ones too."""
        is_open = series.is_quadratic or not has(self.scene, ORDER)
        return series.settings if is_open else series.settings | {ORDER: "1"}

    def on_level(self, series, more, further=None):
        """A series' settings with every body refined so many times more than the scene has it."""
        refined = {f"{pointer}/n_refs": str(body.get("n_refs", 0) + more) for pointer, body in self.bodies}
        return merged(self.of_order(series), refined, further or {})

    def level_label(self, more):
        return f"n_refs {self.bodies[0][1].get('n_refs', 0) + more}"

    def tolerances_of(self, series, joules):
        """Tolerances of the operations of a series, in the ratio of the split's to the scene's own."""
        own, value = self.facts["settings"], joules / self.in_si["J"]
        needs = {"collapse": None, "swap": "swap", "smooth": "smooth", "curve": "curve", "straighten": "curve"}
        settings = {TOLERANCE.format("split"): text_of(value)}
        for key, needed in ((TOLERANCE.format(operation), needed) for operation, needed in needs.items()):
            if key in own and (not needed or series.enables(needed)):
                settings[key] = text_of(own[key] * value / own[TOLERANCE.format("split")])
        return settings

    def with_mesh(self, file):
        """The bodies' mesh replaced by one in a file, in metres; None where that would lose what the scene's own file says."""
        pointer, body = self.bodies[0]
        has_ids = len(self.facts["bodies"]) == 1 or "volume_selection" in body
        if len(self.bodies) > 1 or "array" in body or not has_ids or has(self.scene, "/contact/collision_mesh"):
            return None
        keys = {"mesh": json.dumps(file), "n_refs": "0", "unit": '"m"'}
        keys |= {"transformation": "{}"} if "transformation" in body else {}
        return {f"{pointer}/{key}": value for key, value in keys.items()}


def write_rows(low, high, cells, body, path):
    """Writes a box of rows of cubes, each of six tetrahedra, with about so many cells, as Gmsh 2.2: the best that uniform
    refinement can do, while `n_refs` gives worse shapes. Returns the numbers of cubes an axis."""
    extent = [b - a for a, b in zip(low, high)]
    edge = (6 * math.prod(extent) / cells) ** (1 / 3)
    counts = [max(1, math.floor(length / edge + 0.5)) for length in extent]
    n = [count + 1 for count in counts]
    nodes = [at[::-1] for at in itertools.product(*map(range, reversed(n)))]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    for number, at in enumerate(nodes, start=1):
        place = ((1 - i / m) * a + i / m * b for i, m, a, b in zip(at, counts, low, high))
        lines.append(f"{number} " + " ".join(f"{c:.17g}" for c in place))
    lines += ["$EndNodes", "$Elements", str(6 * math.prod(counts))]
    cells = itertools.product(*map(range, reversed(counts)), TETRAHEDRA)
    for number, (k, j, i, corners) in enumerate(cells, start=1):
        ids = (1 + i + (c & 1) + n[0] * (j + (c >> 1 & 1) + n[1] * (k + (c >> 2 & 1))) for c in corners)
        lines.append(f"{number} 4 2 {body} {body} " + " ".join(map(str, ids)))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return counts
