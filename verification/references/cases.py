# SPDX-License-Identifier: MIT
"""The reference runs, and which of them a planned change may move, and by how much."""
import dataclasses
import fnmatch
import json
import pathlib

EXAMPLES = pathlib.Path(__file__).resolve().parent.parent.parent / "examples"

CURVES = ["/space/remesh/curve/enabled=true"]
FIXED = ["/space/remesh/enabled=false"]
SWAPS = ["/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"]
ORDER_2 = ["/space/discr_order=2"]


# PolyFEM's defaults but for the barrier's stiffness, which comes from the bodies unless a scene has a number.
DEFAULTS = ["--defaults", "polyfem"]
STIFFNESS = ["/solver/contact/barrier_stiffness=\"auto\""]
# Keys that the scenes had before defaults of ITR gave them.
CONTACT = ["/contact/use_convergent_formulation=true", "/contact/dhat=\"auto\""]
BDF2 = ["/time/integrator=\"BDF2\""]
ROUNDS = ["/solver/contact/friction_iterations=5"]
OWN = {"first.json": ["/contact/use_convergent_formulation=true", "/contact/dhat=5e-4"], "tasks/drop.json": CONTACT + BDF2,
       "tasks/roll.json": CONTACT + BDF2, "tasks/press.json": CONTACT + ROUNDS, "tasks/twist.json": CONTACT}


@dataclasses.dataclass
class Case:
    """A scene of examples/, changed by sets, run up to tend; `resumed` stops it before and goes on in a second process."""
    name: str
    scene: str
    tend: float
    sets: list = dataclasses.field(default_factory=list)
    threads: int = 1
    resumed: float = 0.0

    def commands(self, _folder):
        common = [EXAMPLES / self.scene, "--threads", self.threads, "--set", "/output/checkpoint_period=0", *DEFAULTS]
        scene = json.loads((EXAMPLES / self.scene).read_text())
        has_stiffness = "barrier_stiffness" in scene.get("solver", {}).get("contact", {})
        for assignment in [*OWN.get(self.scene, []), *([] if has_stiffness else STIFFNESS), *self.sets]:
            common += ["--set", assignment]
        first = [*common, "--set", f"/time/tend={self.resumed or self.tend}"]
        return [first, [*common, "--set", f"/time/tend={self.tend}", "--resume"]] if self.resumed else [first]


def law(name, **parameters):
    return [f"/materials/0={json.dumps({'id': 1, 'type': name, 'rho': 1, **parameters})}"]


# A ball that is about to touch its wall, and tolerances at which it is remeshed there.
NEAR_WALL = ["/geometry/0/transformation/translation=[0.0629, 0]", "/initial_conditions/velocity/0/value=[67, -20]"]
REMESHED = [*NEAR_WALL, "/space/remesh/split/acceptance_tolerance=0.3"]
CUBES = ["/space/remesh/enabled=true", "/space/remesh/split/acceptance_tolerance=1e-6"]
DYNAMIC = ["/time/quasistatic=false", "/materials/0/rho=1000", "/time/dt=0.01"]

CASES = [
    Case("cantilever", "cantilever.json", 0.3),
    Case("cantilever-fixed", "cantilever.json", 0.3, FIXED),
    Case("cantilever-order-2", "cantilever.json", 0.2, ORDER_2),
    Case("cantilever-curves", "cantilever.json", 0.3, CURVES),
    Case("cantilever-swaps", "cantilever.json", 0.3, SWAPS),
    Case("cantilever-euler", "cantilever.json", 0.05, DYNAMIC),
    Case("cantilever-bdf2", "cantilever.json", 0.05, [*DYNAMIC, "/time/integrator=\"BDF2\""]),
    Case("cantilever-newmark", "cantilever.json", 0.05, [*DYNAMIC, "/time/integrator=\"ImplicitNewmark\""]),
    Case("cantilever-cholmod", "cantilever.json", 0.3, ["/solver/linear/solver=\"cholmod\""]),
    Case("law-linear", "cantilever.json", 0.2, law("LinearElasticity", E=1098500, nu=0.3)),
    Case("law-hooke", "cantilever.json", 0.2, law("HookeLinearElasticity", E=1098500, nu=0.3)),
    Case("law-saint-venant", "cantilever.json", 0.2, law("SaintVenant", E=1098500, nu=0.3)),
    Case("law-fixed-corotational", "cantilever.json", 0.2, law("FixedCorotational", E=1098500, nu=0.3)),
    Case("law-mooney-rivlin", "cantilever.json", 0.2, law("MooneyRivlin", c1=1e5, c2=5e4, k=1e6)),
    Case("ball-wall", "ball_wall.json", 0.0006, REMESHED),
    Case("ball-wall-two-threads", "ball_wall.json", 0.0006, REMESHED, threads=2),
    Case("ball-wall-resumed", "ball_wall.json", 0.0006, REMESHED, resumed=0.0004),
    Case("ball-wall-fixed", "ball_wall.json", 0.0006, [*NEAR_WALL, *FIXED]),
    Case("ball-wall-curves", "ball_wall.json", 0.0004, [*REMESHED, *CURVES]),
    Case("ball-wall-friction", "ball_wall.json", 0.0004, [*REMESHED, "/contact/friction_coefficient=0.3"]),
    Case("ball-wall-order-2", "ball_wall.json", 0.0004, [*NEAR_WALL, *FIXED, *ORDER_2]),
    Case("ball-wall-paper", "ball_wall.json", 0.0004, [*REMESHED, "/space/remesh/screening=\"energy-percentile\""]),
    Case("ball-wall-sizing", "ball_wall.json", 0.0004, [*REMESHED, "/space/remesh/type=\"sizing_field\""]),
    Case("first", "first.json", 0.3),
    Case("masticator", "masticator.json", 2.0),
    Case("masticator-curves", "masticator.json", 2.0, CURVES),
    Case("press", "tasks/press.json", 0.3),
    Case("press-swaps", "tasks/press.json", 0.3, SWAPS),
    Case("press-curves", "tasks/press.json", 0.3, CURVES),
    Case("press-curves-two-threads", "tasks/press.json", 0.3, CURVES, threads=2),
    Case("press-curves-resumed", "tasks/press.json", 0.3, CURVES, resumed=0.15),
    Case("press-order-2", "tasks/press.json", 0.2, ORDER_2),
    Case("press-statics", "tasks/press.json", 0.2, ["/time/quasistatic=true"]),
    Case("press-damped", "tasks/press.json", 0.2,
         ["/solver/rayleigh_damping=[{\"form\": \"elasticity\", \"stiffness_ratio\": 0.1, \"lagging_iterations\": 3}]"]),
    Case("roll", "tasks/roll.json", 0.05),
    Case("drop", "tasks/drop.json", 0.2),
    Case("twist", "tasks/twist.json", 0.1),
    Case("twist-two-threads", "tasks/twist.json", 0.1, threads=2),
    Case("twist-curves", "tasks/twist.json", 0.05, CURVES),
    Case("twist-swaps", "tasks/twist.json", 0.1, SWAPS),
    Case("twist-order-2", "tasks/twist.json", 0.1, [*FIXED, *ORDER_2]),
    Case("cubes", "cubes.json", 0.08),
    Case("cubes-remeshed", "cubes.json", 0.06, CUBES),
    Case("cubes-remeshed-resumed", "cubes.json", 0.06, CUBES, resumed=0.04),
]


@dataclasses.dataclass
class Change:
    """What a change of structure may move, written before it is made.

    runs: patterns of names; digests: which may have other bits; energy: of the largest energy; counts: of each count;
    positions: of the extent of the ten vertices, None where the mesh may be another one."""
    what: str
    runs: tuple
    digests: tuple
    energy: float = 0.0
    counts: float = 0.0
    positions: float | None = 0.0


PLANNED: list[Change] = [
    Change("CCD sees more pairs that pass each other", ("cubes",), ("frames", "states", "reports"), energy=1e-6, counts=0.05,
           positions=1e-6)]


def planned(name):
    """The change that allows most, of those that name this run; None without one."""
    changes = [change for change in PLANNED if any(fnmatch.fnmatch(name, pattern) for pattern in change.runs)]
    if not changes:
        return None
    free = any(change.positions is None for change in changes)
    return Change("", (), tuple({kind for change in changes for kind in change.digests}), max(c.energy for c in changes),
                  max(c.counts for c in changes), None if free else max(c.positions for c in changes))
