# SPDX-License-Identifier: MIT
"""What kinds of simple scenes share: a body of a random size, law, order and mesh, conditions and loads, their linear reference,
and how they are written into a scene."""
import dataclasses
import math
import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
from harness.scenes import box_mesh, oriented  # noqa: E402
from reference import Motion, Solid, small_strain_moduli  # noqa: E402

LAWS = ("NeoHookean", "LinearElasticity", "HookeLinearElasticity", "SaintVenant", "FixedCorotational", "MooneyRivlin",
        "MooneyRivlin3Param")
INTEGRATORS = ("ImplicitEuler", "ImplicitEuler", "BDF2", "BDF2", "BDF3", "ImplicitNewmark")
SOLVERS = (None, None, None, None, "eigen", ["cholmod", "eigen"], "eigen:lu", "eigen:cg")
BAR = 0.01            # relative error of a right value
SMALL_STRAIN = 2.5e-4  # the laws differ from the linear one by a few times the displacement's gradient
GRAVITY = 9.81


class Redraw(Exception):
    """These random numbers make no scene of this kind."""


@dataclasses.dataclass
class Scene:
    kind: str
    content: dict
    meshes: dict                # name -> (points, cells, tags)
    check: object               # (Outcome) -> iterable of (quantity, error, bar)
    facts: dict
    may_refuse: bool = False    # an end with a reason is an answer
    program: str = ""           # beside this file, instead of `itr run`


def log_uniform(rng, low, high):
    return float(10**rng.uniform(math.log10(low), math.log10(high)))


def chance(rng, probability):
    return bool(rng.random() < probability)


def pick(rng, choices):
    return choices[int(rng.integers(len(choices)))]


class Draw:
    """What all kinds share: a box-shaped body of a random size, law, order and dimension, and how it is written into a scene.
    `points` are those of the scene; `sides` numbers them as `threshold` does: left 1, bottom 2, right 3, top 4, back 5, front 6."""

    def __init__(self, rng, dim=None, laws=LAWS, counts=None, aspect=None, order=None, jitter=None):
        self.rng = rng
        self.dim = dim or int(rng.integers(2, 4))
        self.order = order or int(rng.integers(1, 3))
        self.size = log_uniform(rng, 1e-4, 1e3)
        self.E, self.rho = log_uniform(rng, 1e3, 1e12), pick(rng, [1.0, 100.0, 1000.0, 1000.0, 2700.0, 7800.0, 19000.0])
        self.nu = float(pick(rng, [0.0, 0.2, 0.3, 0.3, 0.4, 0.45, -0.3]))
        self.material = self.draw_material(pick(rng, laws))
        most = {2: 4, 3: 2}[self.dim]
        if chance(rng, 0.06):
            most = {2: 8, 3: 4 - self.order}[self.dim]
        if counts is None:
            counts = [int(rng.integers(1, most + 1)) for _ in range(self.dim)]
        self.counts = counts
        aspect = [float(rng.uniform(0.5, 1.0)) for _ in range(self.dim)] if aspect is None else aspect
        self.extent = self.size * np.array(aspect) / max(aspect)
        jitter = float(pick(rng, [0.0, 0.2])) if jitter is None else jitter
        points, self.cells = box_mesh(counts, self.extent, jitter, int(rng.integers(1 << 30)))
        self.low = self.draw_offset()
        self.points = points + self.low
        self.tags = np.ones(len(self.cells), dtype=int)
        self.more = {}  # further top-level keys
        self.is_unit_mesh = chance(rng, 0.2)  # sized and placed by the scene
        if chance(rng, 0.1):
            self.more["units"] = self.draw_units()

    def draw_material(self, law):
        rng, material = self.rng, {"id": 1, "type": law, "E": self.E, "nu": self.nu, "rho": self.rho}
        if self.dim == 2 and chance(rng, 0.3):
            material["plane_strain"] = True
        if law.startswith("MooneyRivlin"):
            self.nu = max(self.nu, 0.0)
            mu, bulk = self.E / (2 * (1 + self.nu)), self.E / (3 * (1 - 2 * self.nu))
            material = {"id": 1, "type": law, "c1": 0.4 * mu, "c2": 0.1 * mu, "rho": self.rho}
            material |= {"k": bulk} if law == "MooneyRivlin" else {"c3": 0.05 * mu, "d1": bulk / 2}
        return material

    def draw_units(self):
        """A consistent system, in which the numbers stay what they are; not one that makes diamonds of jelly."""
        length, mass, time = pick(self.rng, [("mm", "t", "s"), ("mm", "g", "ms"), ("cm", "g", "s"), ("um", "ug", "us")])
        si = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "ug": 1e-9, "g": 1e-3, "t": 1e3, "us": 1e-6, "ms": 1e-3, "s": 1}
        modulus = self.E * si[mass] / (si[length] * si[time]**2)
        if not (1e3 <= modulus <= 1e12 and 1e-4 <= self.size * si[length] <= 1e3):
            return {"length": "m"}
        return {"length": length, "mass": mass, "time": time}

    def draw_offset(self):
        kind = self.rng.random()
        if kind < 0.5:
            return np.zeros(self.dim)
        return self.rng.uniform(-1, 1, self.dim) * self.size * (2 if kind < 0.95 else 100)

    @property
    def high(self):
        return self.low + self.extent

    @property
    def law(self):
        return self.material["type"]

    def solid(self):
        return Solid(self.points, self.cells, self.tags, {1: self.material}, self.order)

    def softness(self):
        """Strain is kept smaller for bodies that resist compression much more than shear, since these are less linear."""
        mu, lam = small_strain_moduli(self.material, self.dim)
        return 1 / (1 + max(lam, 0) / mu)

    def wave_speed(self):
        mu, lam = small_strain_moduli(self.material, self.dim)
        return math.sqrt((lam + 2 * mu) / self.rho)

    def strain(self):
        """How much the body may be strained: at times next to nothing."""
        largest = SMALL_STRAIN * self.softness()
        return log_uniform(self.rng, 1e-6, largest) if chance(self.rng, 0.85) else log_uniform(self.rng, 1e-12, 1e-6)

    def geometry(self, name="body.msh"):
        """The body's entry: sides by threshold or by boxes, sizes in the mesh or by a transformation."""
        entry = {"mesh": name, "volume_selection": 1}
        if self.is_unit_mesh:
            entry["transformation"] = {"scale": self.size, "translation": self.low.tolist()}
        if chance(self.rng, 0.5):
            entry["surface_selection"] = {"threshold": 1e-4 * self.size}
        else:
            entry["surface_selection"] = [{"id": side, "box": self.side_box(side)} for side in self.sides()]
        return entry

    def sides(self):
        return (1, 2, 3, 4) if self.dim == 2 else (1, 2, 3, 4, 5, 6)

    def side_box(self, side):
        axis, is_high = SIDE_AXIS[side]
        low, high = self.low - self.size, self.high + self.size
        at = self.high[axis] if is_high else self.low[axis]
        low[axis], high[axis] = at - 1e-4 * self.size, at + 1e-4 * self.size
        return [low.tolist(), high.tolist()]

    def facets_on(self, solid, side):
        axis, is_high = SIDE_AXIS[side]
        at = self.high[axis] if is_high else self.low[axis]
        return np.flatnonzero(np.abs(solid.facet_center[:, axis] - at) < 1e-4 * self.size)

    def content(self, geometry, **parts):
        scene = {"geometry": geometry, "materials": [self.material], **parts, **self.more}
        if self.order == 2:
            scene["space"] = {**scene.get("space", {}), "discr_order": 2}
        if (solver := pick(self.rng, SOLVERS)) is not None:
            scene["solver"] = {**scene.get("solver", {}), "linear": {"solver": solver}}
        return scene

    def facts(self, **more):
        return {"law": self.law, "order": self.order, "dim": self.dim, "size": self.size, "E": self.E, "nu": self.nu,
                "rho": self.rho, "cells": len(self.cells), **more}

    def meshes(self):
        points = (self.points - self.low) / self.size if self.is_unit_mesh else self.points
        return {"body.msh": (points, self.cells, self.tags)}


SIDE_AXIS = {1: (0, False), 2: (1, False), 3: (0, True), 4: (1, True), 5: (2, False), 6: (2, True)}


class Affine:
    """A vector that is affine in the rest position, and constant or in proportion to time: `factor` (a + B X) [t / ramp]."""

    def __init__(self, a, B=None, ramp=None):
        self.a = np.asarray(a, dtype=float)
        self.B = np.zeros((len(self.a), len(self.a))) if B is None else np.asarray(B, dtype=float)
        self.ramp = ramp

    def scaled(self, factor):
        return Affine(factor * self.a, factor * self.B, self.ramp)

    def at(self, X, t):
        value = self.a + X @ self.B.T
        return value if self.ramp is None else value * (t / self.ramp)

    def json(self):
        """As a scene has it: numbers where these do."""
        out = []
        for a, row in zip(self.a, self.B):
            if self.ramp is None and not row.any():
                out.append(float(a))
                continue
            text = "+".join([repr(float(a))] + [f"({float(b)!r})*{name}" for b, name in zip(row, "xyz") if b])
            out.append(text if self.ramp is None else f"({text})*t/{self.ramp!r}")
        return out


def output(steps, sides=(), options=("momentum", "reaction_forces"), frames=4):
    paraview = {"skip_frame": max(1, steps // frames), "options": {name: True for name in options}}
    return {"paraview": paraview, "forces": [{"name": f"side{s}", "surfaces": s} for s in sides]}


def relative(name, pairs, scale=None, bar=BAR):
    """Largest difference of pairs (seen, right) over the largest right value, or over `scale`."""
    largest = scale if scale is not None else max((float(np.abs(r).max()) for _, r in pairs), default=0)
    off = max((float(np.abs(np.asarray(s) - r).max()) for s, r in pairs), default=math.inf)
    return name, off / largest if largest > 0 else (0.0 if off == 0 else math.inf), bar


@dataclasses.dataclass
class Plan:
    """A scene that is linear in its loads, as its reference needs it."""
    draw: Draw
    mode: str                                       # static, quasistatic or dynamic
    integrator: str = "ImplicitEuler"
    dt: float = 1.0
    steps: int = 1
    t0: float = 0.0
    held: list = dataclasses.field(default_factory=list)       # (side, dimension mask, Affine)
    tractions: list = dataclasses.field(default_factory=list)  # (facets, id, Affine)
    pressures: list = dataclasses.field(default_factory=list)  # (facets, id, number, ramp or None)
    gravity: object = None                                     # acceleration
    velocity: object = None                                    # Affine, of the start

    def motion(self, solid):
        held = np.zeros(solid.nodes.shape, dtype=bool)
        nodes = {}
        for side, mask, _ in self.held:
            nodes[side] = solid.nodes_on(self.draw.facets_on(solid, side))
            held[np.ix_(nodes[side], np.flatnonzero(mask))] = True

        def target(t):
            u = np.zeros(solid.nodes.shape)
            for side, mask, value in self.held:
                components = np.flatnonzero(mask)
                u[np.ix_(nodes[side], components)] = value.at(solid.nodes[nodes[side]], t)[:, components]
            return u

        shares = [(solid.traction(facets, value.a), value.ramp) for facets, _, value in self.tractions]
        shares += [(solid.traction(facets, value), ramp) for facets, _, value, ramp in self.pressures]
        if self.gravity is not None:
            shares.append((solid.weight(self.gravity), None))

        def force(t):
            return sum((f if ramp is None else f * (t / ramp) for f, ramp in shares), np.zeros(solid.nodes.shape))

        return Motion(solid, held, target, force)

    def states(self, solid, motion=None):
        """t, u, v and reactions after each step."""
        motion = motion or self.motion(solid)
        if self.mode == "static":
            u, reaction = motion.static()
            zero = np.zeros_like(u)
            return [(0.0, zero, zero, zero), (1.0, u, zero, reaction)]
        if self.mode == "quasistatic":
            return list(motion.quasistatic(self.dt, self.steps, self.t0))
        v0 = np.zeros(solid.nodes.shape) if self.velocity is None else self.velocity.at(solid.nodes, 0)
        return list(motion.run(self.integrator, self.dt, self.steps, np.zeros_like(v0), v0, self.t0))

    def scale(self, factor):
        self.held = [(side, mask, value.scaled(factor)) for side, mask, value in self.held]
        self.tractions = [(facets, side, value.scaled(factor)) for facets, side, value in self.tractions]
        self.pressures = [(facets, side, value * factor, ramp) for facets, side, value, ramp in self.pressures]
        self.gravity = None if self.gravity is None else self.gravity * factor
        self.velocity = None if self.velocity is None else self.velocity.scaled(factor)

    def content(self, geometry=None, **parts):
        draw, conditions = self.draw, {}
        if self.held:
            conditions["dirichlet_boundary"] = []
            for side, mask, value in self.held:
                entry = {"id": side, "value": value.json()}
                if not all(mask):
                    entry["dimension"] = [bool(m) for m in mask]
                conditions["dirichlet_boundary"].append(entry)
        if self.tractions:
            conditions["neumann_boundary"] = [{"id": side, "value": value.json()} for _, side, value in self.tractions]
        if self.pressures:
            conditions["pressure_boundary"] = [{"id": side, "value": value if ramp is None else f"{value!r}*t/{ramp!r}"}
                                               for _, side, value, ramp in self.pressures]
        if self.gravity is not None:
            conditions["rhs"] = [-float(g) if g else 0.0 for g in self.gravity]
        content = draw.content(geometry or [draw.geometry()], boundary_conditions=conditions, **parts)
        content["output"] = output(self.steps, sorted({side for side, _, _ in self.held}))
        if self.velocity is not None:
            content["initial_conditions"] = {"velocity": [{"id": 1, "value": self.velocity.json()}]}
        if self.mode != "static":
            ends = {"tend": self.t0 + self.dt * self.steps} if chance(draw.rng, 0.5) else {"time_steps": self.steps}
            content["time"] = {"dt": self.dt, **ends} | ({"t0": self.t0} if self.t0 else {})
            content["time"] |= {"quasistatic": True} if self.mode == "quasistatic" else {"integrator": self.integrator}
        return content

    def facts(self, **more):
        return self.draw.facts(mode=self.mode, integrator=self.integrator if self.mode == "dynamic" else "", dt=self.dt,
                               steps=self.steps, **more)

    def add_contact(self):
        """Contact changes nothing where nothing touches: not even where faces coincide at rest and open."""
        if chance(self.draw.rng, 0.2):
            self.draw.more["contact"] = {"enabled": True, "dhat": "auto"}

    def scene(self, kind, solid, states, **more):
        largest = max(solid.largest_gradient(u) for _, u, _, _ in states)
        motion = max(float(np.abs(b[1] - a[1]).max()) for a, b in zip(states, states[1:])) / np.abs(solid.points).max()
        return Scene(kind, self.content(**more.pop("parts", {})), self.draw.meshes(), self.checker(solid, states),
                     self.facts(strain=largest, motion=motion), **more)

    def checker(self, solid, states):
        dynamic = self.mode == "dynamic"

        def check(outcome):
            frames = [f for f in outcome.frames if f.step > 0]
            yield from relative_mesh(outcome, solid, self.draw.size)
            pairs = [(f, states[f.step]) for f in frames]
            # Between stored frames, displacements and velocities may have been larger.
            most = [max(float(np.abs(s[k]).max()) for s in states) for k in (1, 2, 3)]
            if most[0] > 0:
                yield relative("displacement", [(f.u, s[1]) for f, s in pairs], most[0])
            else:
                yield "displacement", max(float(np.abs(f.u).max()) for f in frames) / (1e-9 * self.draw.size) * BAR, BAR
            if dynamic and most[1] > 0:
                yield relative("velocity", [(f.v, s[2]) for f, s in pairs], most[1])
                momenta = [(f.momentum, (solid.scalar_mass @ s[2]).sum(axis=0)) for f, s in pairs]
                yield relative("momentum", momenta, solid.mass() * most[1])
            if self.held and most[2] > 0:
                # The linear system leaves out stresses of second order, as of turns.
                largest = max(solid.largest_gradient(s[1]) for s in states)
                left_out = max(solid.mu.max(), solid.lam.max()) * largest**2 * solid.facet_area.max() * 2 / BAR
                scale = max(float(np.abs(s[3]).sum()) for s in states) + left_out
                yield relative("reaction", [(f.reaction.sum(axis=0), s[3].sum(axis=0)) for f, s in pairs], scale)
                yield relative("reaction of a vertex", [(f.reaction, s[3]) for f, s in pairs], most[2] + left_out)

        return check


def relative_mesh(outcome, solid, size):
    """The frames' nodes are the reference's. Anything else is an error of the script."""
    frame = outcome.frames[-1]
    slack = 1e-9 * size + 1e-12 * np.abs(solid.nodes).max()
    if frame.rest.shape != solid.nodes.shape or np.abs(frame.rest - solid.nodes).max() > slack:
        raise AssertionError("the frames have other nodes than the reference")
    return []


def choose_time(plan, motion, typical=0.75):
    """dt: of the order of the body's periods, mostly; any number of [1e-8, 10] s otherwise."""
    rng = plan.draw.rng
    if plan.mode == "dynamic" and motion and motion.slowest() > 0 and chance(rng, typical):
        plan.dt = float(np.clip(2 * math.pi / motion.slowest() * log_uniform(rng, 3e-3, 1e2), 1e-8, 10))
    else:
        plan.dt = log_uniform(rng, 1e-8, 10)
    plan.dt = float(f"{plan.dt:.3g}")
    plan.steps = int(rng.integers(1, 25)) if plan.mode == "dynamic" else int(rng.integers(1, 5))
    if plan.mode == "dynamic" and chance(rng, 0.04):
        plan.steps *= 10
    plan.integrator = pick(rng, INTEGRATORS)


def scale_to_strain(plan, solid, motion, strain, most_load=1e-2):
    """Scales all loads so that displacements have gradients of this size at most, no traction is above a share of the modulus and
    no velocity above a twentieth of the waves'. Returns the states."""
    states = plan.states(solid, motion)
    largest = max(solid.largest_gradient(u) for _, u, _, _ in states)
    if not largest > 0:
        raise Redraw
    factor = strain / largest
    for _, _, value in plan.tractions:
        factor = min(factor, most_load * plan.draw.E / np.abs(value.a).max())
    for _, _, value, _ in plan.pressures:
        factor = min(factor, most_load * plan.draw.E / abs(value))
    if plan.velocity is not None:
        factor = min(factor, 0.05 * plan.draw.wave_speed() / np.abs(plan.velocity.at(solid.nodes, 0)).max())
    plan.scale(float(f"{factor:.3g}"))
    return plan.states(solid)


def pick_mode(rng):
    return pick(rng, ["static", "quasistatic", "dynamic", "dynamic"])


def add_load(plan, solid, sides, ramp):
    """A traction, a pressure or the weight."""
    draw, rng = plan.draw, plan.draw.rng
    what = pick(rng, ["traction", "traction", "pressure", "gravity"])
    side = pick(rng, sides)
    facets = draw.facets_on(solid, side)
    if what == "traction":
        plan.tractions.append((facets, side, Affine(rng.uniform(-1, 1, draw.dim), ramp=ramp)))
    elif what == "pressure":
        plan.pressures.append((facets, side, float(rng.uniform(0.2, 1) * pick(rng, [-1, 1])), ramp))
    else:
        plan.gravity = np.zeros(draw.dim)
        plan.gravity[int(rng.integers(draw.dim))] = -GRAVITY
    return what


def ramp_of(plan):
    """Loads grow in time, or are there at once."""
    if plan.mode == "static":
        return None
    return plan.dt * plan.steps if chance(plan.draw.rng, 0.8 if plan.mode == "quasistatic" else 0.3) else None


def with_true_gravity(plan, solid, motion):
    """Scales the loads, but not the weight, whose acceleration is no user's choice."""
    if plan.gravity is None:
        return scale_to_strain(plan, solid, motion, plan.draw.strain())
    states = plan.states(solid, motion)
    if max(solid.largest_gradient(u) for _, u, _, _ in states) > SMALL_STRAIN * plan.draw.softness():
        raise Redraw
    return states


def add_remeshing(draw):
    """Where the right value does not depend on the mesh, the mesh may change."""
    if chance(draw.rng, 0.25):
        draw.more["space"] = {"remesh": {"enabled": True}}


def rotation(dim, axis, angle):
    """Matrix of a turn about an axis (in 2D the only one, 2)."""
    R = np.eye(dim)
    i, j = [k for k in range(3) if k != axis][:2] if dim == 3 else (0, 1)
    if axis == 1:
        i, j = j, i
    R[i, i] = R[j, j] = math.cos(angle)
    R[i, j], R[j, i] = -math.sin(angle), math.sin(angle)
    return R


def gap_contact(rng):
    return {"enabled": True, "dhat": "auto", "use_convergent_formulation": chance(rng, 0.7),
            "friction_coefficient": float(pick(rng, [0.0, 0.0, 0.3]))}


def torque(arm, force):
    """Sum of moments about the origin."""
    crossed = np.cross(arm, force) if arm.shape[1] == 3 else arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
    return np.sum(crossed, axis=0)


def crossed_mesh(counts, size):
    """A rectangle of squares cut into four triangles each, which is its own mirror image."""
    points, _ = box_mesh(counts, size)
    corner = np.arange(len(points)).reshape(counts[0] + 1, counts[1] + 1)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel(), corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    middle = len(points) + np.arange(len(a))
    points = np.concatenate([points, (points[a] + points[b] + points[c] + points[d]) / 4])
    return points, oriented(points, np.concatenate([np.stack(t, axis=1) for t in
                                                    [(a, b, middle), (b, c, middle), (c, d, middle), (d, a, middle)]]))
