# SPDX-License-Identifier: MIT
"""Simple scenes, drawn at random, with their right values: bodies at rest, in flight, ringing, loaded, on rollers, above a gap,
turned, buckling or cracked. A drawing that a user would not write is drawn again (`Redraw`)."""
import dataclasses
import math
import pathlib
import sys

import numpy as np
import scipy.linalg

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
from harness.scenes import box_mesh, oriented  # noqa: E402
from reference import BDF, Motion, Solid, small_strain_moduli  # noqa: E402

LAWS = ("NeoHookean", "LinearElasticity", "HookeLinearElasticity", "SaintVenant", "FixedCorotational", "MooneyRivlin",
        "MooneyRivlin3Param")
LINEAR = ("LinearElasticity", "HookeLinearElasticity")
INTEGRATORS = ("ImplicitEuler", "ImplicitEuler", "BDF2", "BDF2", "BDF3", "ImplicitNewmark")
SOLVERS = (None, None, None, None, "eigen", "cholmod", "eigen:lu", "eigen:cg")
BAR = 0.01            # relative error of a right value
SMALL_STRAIN = 2.5e-4  # the laws differ from the linear one by a few times the displacement's gradient
GRAVITY = 9.81
EPSILON = np.finfo(float).eps


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
        si = {"mm": 1e-3, "cm": 1e-2, "um": 1e-6}[length], {"t": 1e3, "g": 1e-3, "ug": 1e-9}[mass], {"s": 1, "ms": 1e-3, "us": 1e-6}[time]
        modulus = self.E * si[1] / (si[0] * si[2]**2)
        if not (1e3 <= modulus <= 1e12 and 1e-4 <= self.size * si[0] <= 1e3):
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
        return {"body.msh": (self.points, self.cells, self.tags)}


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
            return list(motion.quasistatic(self.dt, self.steps))
        v0 = np.zeros(solid.nodes.shape) if self.velocity is None else self.velocity.at(solid.nodes, 0)
        return list(motion.run(self.integrator, self.dt, self.steps, np.zeros_like(v0), v0))

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
            content["time"] = {"dt": self.dt, "time_steps": self.steps}
            content["time"] |= {"quasistatic": True} if self.mode == "quasistatic" else {"integrator": self.integrator}
        return content

    def facts(self, **more):
        return self.draw.facts(mode=self.mode, integrator=self.integrator if self.mode == "dynamic" else "", dt=self.dt,
                               steps=self.steps, **more)

    def scene(self, kind, solid, states, **more):
        largest = max(solid.largest_gradient(u) for _, u, _, _ in states)
        return Scene(kind, self.content(**more.pop("parts", {})), self.draw.meshes(), self.checker(solid, states),
                     self.facts(strain=largest), **more)

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
                scale = max(float(np.abs(s[3]).sum()) for s in states)
                yield relative("reaction", [(f.reaction.sum(axis=0), s[3].sum(axis=0)) for f, s in pairs], scale)
                yield relative("reaction of a vertex", [(f.reaction, s[3]) for f, s in pairs], most[2])

        return check


def relative_mesh(outcome, solid, size):
    """The frames' nodes are the reference's. Anything else is an error of the script."""
    frame = outcome.frames[-1]
    if frame.rest.shape != solid.nodes.shape or not np.allclose(frame.rest, solid.nodes, rtol=0, atol=1e-9 * size + 1e-12 * np.abs(solid.nodes).max()):
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


# ---- kinds: (rng) -> Scene -------------------------------------------------------------------------------------------------


def rest(rng):
    """Nothing acts on a body, so that it stays."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    is_held = chance(rng, 0.5)
    if is_held:
        plan.held = [(pick(rng, draw.sides()), [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    solid = draw.solid()
    choose_time(plan, plan.motion(solid))
    geometry = [draw.geometry()]
    if chance(rng, 0.5):
        gap = draw.size * log_uniform(rng, 1e-3, 0.3)
        geometry.append({"type": "ground", "height": float(draw.low[1] - gap), "surface_selection": 9, "name": "ground"})
        draw.more["contact"] = {"enabled": True, "dhat": "auto", "use_convergent_formulation": chance(rng, 0.5)}
    return plan.scene("rest", solid, plan.states(solid), parts={"geometry": geometry},
                      may_refuse=not is_held and plan.mode != "dynamic")


def flight(rng):
    """A free body falls, or flies on."""
    draw = Draw(rng)
    plan = Plan(draw, "dynamic")
    choose_time(plan, None, typical=0)
    if chance(rng, 0.6):
        plan.gravity = np.zeros(draw.dim)
        plan.gravity[1] = -GRAVITY
    if plan.gravity is None or chance(rng, 0.3):
        plan.velocity = Affine(rng.uniform(-1, 1, draw.dim) * log_uniform(rng, 1e-3, 1e2))
    solid = draw.solid()
    states = plan.states(solid)
    if not np.abs(states[-1][1]).max() < 1e3 * draw.size:
        raise Redraw
    return plan.scene("flight", solid, states)


def ring(rng):
    """A body that moves at the start rings, held at a side or free."""
    draw = Draw(rng)
    plan = Plan(draw, "dynamic")
    B = rng.uniform(-1, 1, (draw.dim, draw.dim))
    side = pick(rng, draw.sides())
    if chance(rng, 0.7):
        axis, is_high = SIDE_AXIS[side]
        at = draw.high[axis] if is_high else draw.low[axis]
        B[:, [k for k in range(draw.dim) if k != axis]] = 0
        plan.held = [(side, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
        plan.velocity = Affine(-B[:, axis] * at, B)
    else:
        plan.velocity = Affine(-B @ (draw.low + draw.high) / 2, B)
    solid = draw.solid()
    motion = plan.motion(solid)
    choose_time(plan, motion)
    return plan.scene("ring", solid, scale_to_strain(plan, solid, motion, draw.strain()))


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
    """Loads grow in time, or are there at once; Newmark's guard would take a jump of load for growing energy."""
    if plan.mode == "static":
        return None
    rng = plan.draw.rng
    return plan.dt * plan.steps if plan.mode == "quasistatic" and chance(rng, 0.7) else None if chance(rng, 0.7) else plan.dt * plan.steps


def with_true_gravity(plan, solid, motion):
    """Scales the loads, but not the weight, whose acceleration is no user's choice."""
    if plan.gravity is None:
        return scale_to_strain(plan, solid, motion, plan.draw.strain())
    states = plan.states(solid, motion)
    if max(solid.largest_gradient(u) for _, u, _, _ in states) > SMALL_STRAIN * plan.draw.softness():
        raise Redraw
    return states


def load(rng):
    """A body held at a side carries small loads."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    side = pick(rng, draw.sides())
    plan.held = [(side, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    solid = draw.solid()
    choose_time(plan, plan.motion(solid), 0.85)
    add_load(plan, solid, [s for s in draw.sides() if s != side], ramp_of(plan))
    return plan.scene("load", solid, with_true_gravity(plan, solid, plan.motion(solid)))


def rollers(rng):
    """A body on rollers along each axis carries a load, or is pulled."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    sides = {axis: pick(rng, [s for s, (a, _) in SIDE_AXIS.items() if a == axis]) for axis in range(draw.dim)}
    zero = Affine(np.zeros(draw.dim))
    plan.held = [(side, [k == axis for k in range(draw.dim)], zero) for axis, side in sides.items()]
    solid = draw.solid()
    choose_time(plan, plan.motion(solid), 0.85)
    free = [s for s in draw.sides() if s not in sides.values()]
    if chance(rng, 0.4):
        pulled = pick(rng, free)
        axis = SIDE_AXIS[pulled][0]
        value = np.zeros(draw.dim)
        value[axis] = draw.size * float(pick(rng, [-1, 1]))
        plan.held.append((pulled, [k == axis for k in range(draw.dim)],
                          Affine(value, ramp=None if plan.mode == "static" else plan.dt * plan.steps)))
    else:
        add_load(plan, solid, free, ramp_of(plan))
    return plan.scene("rollers", solid, with_true_gravity(plan, solid, plan.motion(solid)))


def moved(rng):
    """A held side is moved a little, the rest follows."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    solid = draw.solid()
    choose_time(plan, plan.motion(solid), 0.85)
    side = pick(rng, draw.sides())
    axis = SIDE_AXIS[side][0]
    opposite = next(s for s, (a, _) in SIDE_AXIS.items() if a == axis and s != side)
    ramp = None if plan.mode == "static" else plan.dt * plan.steps
    center = (draw.low + draw.high) / 2
    B = rng.uniform(-1, 1, (draw.dim, draw.dim))
    plan.held = [(side, [True] * draw.dim, Affine(draw.size * rng.uniform(-1, 1, draw.dim) - B @ center, B, ramp))]
    if chance(rng, 0.6):
        plan.held.append((opposite, [True] * draw.dim, Affine(np.zeros(draw.dim))))
    return plan.scene("moved", solid, scale_to_strain(plan, solid, plan.motion(solid), draw.strain()))


def affine(rng):
    """All sides are moved as one affine map asks: the inside follows, for every law and any strain."""
    draw = Draw(rng, counts=None)
    plan = Plan(draw, pick(rng, ["static", "quasistatic"]))
    choose_time(plan, None)
    size = log_uniform(rng, 1e-12, 1e-4) if chance(rng, 0.3) else float(rng.uniform(1e-3, 0.12))
    B = size * rng.uniform(-1, 1, (draw.dim, draw.dim))
    ramp = None if plan.mode == "static" else plan.dt * plan.steps
    value = Affine(-B @ (draw.low + draw.high) / 2, B, ramp)
    plan.held = [(side, [True] * draw.dim, value) for side in draw.sides()]
    solid = draw.solid()

    add_remeshing(draw)

    def check(outcome):
        pairs = [(f.u, value.at(f.rest, f.t)) for f in outcome.frames if f.step > 0]
        yield relative("displacement", pairs)

    return Scene("affine", plan.content(), draw.meshes(), check, plan.facts(strain=size))


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


def turned(rng):
    """A held side is turned by an angle, and the body follows as a rigid one."""
    draw = Draw(rng, laws=("NeoHookean", "NeoHookean", "SaintVenant", "FixedCorotational", "MooneyRivlin", "MooneyRivlin3Param"))
    plan = Plan(draw, pick(rng, ["static", "quasistatic", "quasistatic"]))
    choose_time(plan, None)
    step = float(rng.uniform(1, 30) if draw.law != "NeoHookean" or chance(rng, 0.5) else rng.uniform(30, 95))
    degrees = step if plan.mode == "static" else step * plan.steps
    axis = 2 if draw.dim == 2 else int(rng.integers(3))
    i, j = (0, 1) if axis == 2 else (1, 2) if axis == 0 else (2, 0)
    side = pick(rng, draw.sides())
    center = draw.low + rng.uniform(0, 1, draw.dim) * draw.extent if chance(rng, 0.5) else np.zeros(draw.dim)
    tend = 1.0 if plan.mode == "static" else plan.dt * plan.steps
    names, angle = "xyz", f"({degrees / 180 * math.pi / tend!r})*t"
    a, b = (f"({names[k]}-({float(center[k])!r}))" for k in (i, j))
    value = ["0"] * draw.dim
    value[i] = f"{a}*(cos({angle})-1)-{b}*sin({angle})"
    value[j] = f"{b}*(cos({angle})-1)+{a}*sin({angle})"
    solid = draw.solid()
    plan.held = [(side, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    add_remeshing(draw)
    content = plan.content()
    content["boundary_conditions"]["dirichlet_boundary"] = [{"id": side, "value": value}]

    def check(outcome):
        pairs = []
        for f in (f for f in outcome.frames if f.step > 0):
            R = rotation(draw.dim, axis, math.radians(degrees) * f.t / tend)
            pairs.append((f.u, (f.rest - center) @ (R - np.eye(draw.dim)).T))
        yield relative("displacement", pairs)
        modulus = small_strain_moduli(draw.material, draw.dim)[0]
        area = draw.size**(draw.dim - 1)
        yield "reaction over modulus", max(float(np.abs(f.reaction).max()) for f in outcome.frames) / (modulus * area), 1e-5

    return Scene("turned", content, draw.meshes(), check, plan.facts(strain=0.0, angle=step))


def gap_contact(rng):
    return {"enabled": True, "dhat": "auto", "use_convergent_formulation": chance(rng, 0.7),
            "friction_coefficient": float(pick(rng, [0.0, 0.0, 0.3]))}


def dhat_of(outcome, draw):
    """Surfaces end at most so far apart: a thousandth of the thickness, twice the volume over the surface."""
    return 1e-3 * draw.size


def settle(rng):
    """A body above the ground sinks onto it by its weight, without inertia."""
    draw = Draw(rng, laws=tuple(law for law in LAWS))
    plan = Plan(draw, pick(rng, ["static", "quasistatic"]))
    choose_time(plan, None)
    if draw.rho * GRAVITY * draw.size / draw.E > 1e-3:
        raise Redraw
    gap = draw.size * log_uniform(rng, 1e-3, 0.5)
    plan.gravity = np.zeros(draw.dim)
    plan.gravity[1] = -GRAVITY
    on_rollers = chance(rng, 0.4)
    if on_rollers:
        zero = Affine(np.zeros(draw.dim))
        plan.held = [(1, [True] + [False] * (draw.dim - 1), zero)]
        if draw.dim == 3:
            plan.held.append((5, [False, False, True], zero))
    draw.more["contact"] = gap_contact(rng)
    ground = {"type": "ground", "height": float(draw.low[1] - gap), "surface_selection": 9, "name": "ground"}
    content = plan.content([draw.geometry(), ground])
    content["output"]["forces"].append({"name": "ground", "obstacles": "ground"})
    solid = draw.solid()
    sag = draw.rho * GRAVITY * draw.size**2 / draw.E

    def check(outcome):
        u, weight = outcome.frames[-1].u, solid.mass() * GRAVITY
        others = [k for k in range(draw.dim) if k != 1]
        yield "moves sideways", float(np.abs(u[:, others]).max() / draw.size), 2e-3 + 10 * sag / draw.size
        bottom = np.abs(solid.nodes[:, 1] - draw.low[1]) < 1e-6 * draw.size
        lowest = float((u[bottom, 1] + gap).min())
        yield "gap", abs(lowest) / draw.size, 2e-3
        yield "passes the ground", max(0.0, -lowest), 0.0
        yield relative("force on the ground", [(outcome.forces["ground"][-1], -weight)], weight)

    return Scene("settle", content, draw.meshes(), check, plan.facts(strain=sag / draw.size, gap=gap / draw.size))


def press(rng):
    """A body on rollers is pressed by a lid that moves down over a gap."""
    draw = Draw(rng, jitter=0.0)
    plan = Plan(draw, "quasistatic")
    choose_time(plan, None)
    gap, strain = draw.size * log_uniform(rng, 1e-3, 0.3), float(rng.uniform(2e-3, 1e-2))
    zero = Affine(np.zeros(draw.dim))
    plan.held = [(2, [k == 1 for k in range(draw.dim)], zero)]
    if chance(rng, 0.6):
        plan.held.append((1, [k == 0 for k in range(draw.dim)], zero))
        if draw.dim == 3:
            plan.held.append((5, [k == 2 for k in range(draw.dim)], zero))
    draw.more["contact"] = gap_contact(rng)
    draw.more["contact"]["friction_coefficient"] = 0.0
    normal = [0.0] * draw.dim
    normal[1] = -1.0
    point = ((draw.low + draw.high) / 2).tolist()
    point[1] = float(draw.high[1] + gap)
    lid = {"type": "plane", "point": point, "normal": normal, "is_obstacle": True, "surface_selection": 9, "name": "lid"}
    content = plan.content([draw.geometry(), lid])
    travel, tend = gap + strain * draw.extent[1], plan.dt * plan.steps
    value = [0.0] * draw.dim
    value[1] = f"{-travel!r}*t/{tend!r}"
    content["boundary_conditions"]["obstacle_displacements"] = [{"id": 9, "value": value}]
    content["output"]["forces"].append({"name": "lid", "obstacles": "lid"})
    solid = draw.solid()

    def check(outcome):
        frame = outcome.frames[-1]
        others = [k for k in range(draw.dim) if k != 1]
        yield "moves sideways", float(np.abs(frame.u[:, others]).max() / draw.size), 2 * strain
        # Work of the stress with the displacement y: lid force = modulus * area * mean strain, however uneven the pressure is.
        mu, lam = small_strain_moduli(draw.material, draw.dim)
        modulus = 4 * mu * (lam + mu) / (lam + 2 * mu) if draw.dim == 2 else mu * (3 * lam + 2 * mu) / (lam + mu)
        top = solid.traction(draw.facets_on(solid, 4), np.ones(draw.dim))[:, 1]
        sunk = -float((top * frame.u[:, 1]).sum())  # over the area
        force = modulus * sunk / draw.extent[1]
        yield "lid below the top", max(0.0, travel - gap - sunk / top.sum()) / draw.size, 2e-3
        yield relative("force on the lid", [(outcome.forces["lid"][-1], force)], force, BAR + 3 * strain)
        held = sum(outcome.forces[name][-1] for name in outcome.forces if name == "side2")
        yield relative("forces add up", [(held, outcome.forces["lid"][-1])], force)

    return Scene("press", content, draw.meshes(), check, plan.facts(strain=strain, gap=gap / draw.size))


def drop(rng):
    """A free body falls or is thrown onto the ground, with inertia."""
    draw = Draw(rng)
    plan = Plan(draw, "dynamic")
    plan.integrator = pick(rng, ["ImplicitEuler", "BDF2"])
    gap = draw.size * log_uniform(rng, 1e-2, 0.5)
    by_weight = chance(rng, 0.5)
    most = 3e-3 * draw.wave_speed()
    speed = math.sqrt(2 * GRAVITY * gap) if by_weight else log_uniform(rng, 1e-3, 1e2)
    if speed > most or (by_weight and draw.rho * GRAVITY * draw.size / draw.E > 1e-3):
        raise Redraw
    duration = (2 if by_weight else 1) * gap / speed
    plan.steps = int(rng.integers(10, 30))
    plan.dt = float(f"{duration * float(rng.uniform(1.1, 2)) / plan.steps:.3g}")
    if not 1e-8 <= plan.dt <= 10:
        raise Redraw
    if by_weight:
        plan.gravity = np.zeros(draw.dim)
        plan.gravity[1] = -GRAVITY
    else:
        velocity = np.zeros(draw.dim)
        velocity[1] = -speed
        plan.velocity = Affine(velocity)
    draw.more["contact"] = gap_contact(rng) | {"friction_coefficient": 0.0}
    ground = {"type": "ground", "height": float(draw.low[1] - gap), "surface_selection": 9, "name": "ground"}
    solid = draw.solid()
    states = plan.states(solid)  # as if there were no ground
    content = plan.content([draw.geometry(), ground])
    content["output"]["paraview"]["skip_frame"] = 1
    content["output"]["paraview"]["options"]["kinetic_energy"] = True

    def check(outcome):
        relative_mesh(outcome, solid, draw.size)
        largest = max(np.abs(s[2]).max() for s in states)
        before = [(f, states[f.step]) for f in outcome.frames if f.step > 0 and states[f.step][1][:, 1].min() > -0.85 * gap]
        if before:
            yield relative("flight", [(f.u, s[1]) for f, s in before], gap)
            yield relative("velocity in flight", [(f.v, s[2]) for f, s in before], largest)
        lowest = min(float((f.u[:, 1] + solid.nodes[:, 1]).min()) for f in outcome.frames)
        yield "passes the ground", max(0.0, draw.low[1] - gap - lowest) / draw.size, 1e-9
        side = [k for k in range(draw.dim) if k != 1]
        momentum = solid.mass() * largest
        yield "sideways momentum", max(float(np.abs(f.momentum[side]).max()) for f in outcome.frames) / momentum, BAR
        energies = [s["energy"]["elastic"] + s["energy"]["contact"] + f.kinetic
                    + (GRAVITY * float(solid.scalar_mass.sum(axis=1) @ f.u[:, 1]) if by_weight else 0.0)
                    for s, f in zip(outcome.steps, outcome.frames)]
        scale = solid.mass() * largest**2 / 2
        if plan.integrator == "ImplicitEuler":  # BDF2 goes on with half of a velocity's jump, and may gain energy by that
            yield "energy grows", max(b - a for a, b in zip(energies, energies[1:])) / scale, 1e-3
        yield "ends below its start", max(0.0, float(outcome.frames[-1].u[:, 1].mean()) / draw.size), 1e-2 + (0 if by_weight else 10)

    return Scene("drop", content, draw.meshes(), check, plan.facts(strain=speed / draw.wave_speed(), gap=gap / draw.size))


def spin(rng):
    """A free stiff body turns. Its right motion is that of a rigid body by the same integrator: each step ends at the rotation that
    is nearest to where inertia alone would take the body, in the mass norm."""
    draw = Draw(rng, laws=("NeoHookean", "NeoHookean", "SaintVenant", "FixedCorotational", "MooneyRivlin", "MooneyRivlin3Param"))
    plan = Plan(draw, "dynamic")
    plan.integrator, plan.steps = pick(rng, ["ImplicitEuler", "BDF2"]), int(rng.integers(3, 25))
    angle = log_uniform(rng, 1e-2, 0.3)  # a step
    strain = min(1e-4 * draw.softness(), 1e-2 * angle**2) * log_uniform(rng, 1e-3, 1)
    speed = math.sqrt(strain * draw.E / draw.rho) / draw.size
    plan.dt = float(f"{angle / speed:.3g}")
    if not 1e-8 <= plan.dt <= 10:
        raise Redraw
    solid = draw.solid()
    axis = 2 if draw.dim == 2 else int(rng.integers(3))
    slope = rotation(draw.dim, axis, math.pi / 2) * speed  # of a plane; its axis does not move
    if draw.dim == 3:
        slope[axis, axis] = 0
    share = solid.scalar_mass.sum(axis=1)
    center = share @ solid.nodes / share.sum()
    arm = solid.nodes - center
    spread = arm.T @ solid.scalar_mass @ arm
    plan.velocity = Affine(-slope @ center, slope)
    add_remeshing(draw)
    past_x, past_v, turns = [np.eye(draw.dim)], [slope], [np.eye(draw.dim)]
    for _ in range(plan.steps):
        weights, rate, divisor = BDF[min(2 if plan.integrator == "BDF2" else 1, len(past_x))]
        b = rate / divisor * plan.dt
        before = sum(w / divisor * x for w, x in zip(weights, past_x))
        left, _, right = np.linalg.svd((before + b * sum(w / divisor * v for w, v in zip(weights, past_v))) @ spread)
        turns.append(left @ right)
        past_v, past_x = [(turns[-1] - before) / b, past_v[0]], [turns[-1], past_x[0]]

    def check(outcome):
        pairs = [(f.u, (f.rest - center) @ (turns[f.step] - np.eye(draw.dim)).T) for f in outcome.frames if f.step > 0]
        yield relative("displacement", pairs)
        momentum = solid.mass() * speed * draw.size
        yield "momentum", max(float(np.abs(f.momentum).max()) for f in outcome.frames) / momentum, BAR

    return Scene("spin", plan.content(), draw.meshes(), check, plan.facts(strain=strain, angle=math.degrees(angle)))


def balanced(rng):
    """Loads that balance each other deform a free body without inertia; it moves as little as may be otherwise."""
    draw = Draw(rng)
    plan = Plan(draw, pick(rng, ["static", "quasistatic"]))
    choose_time(plan, None)
    solid, ramp = draw.solid(), ramp_of(plan)
    if chance(rng, 0.5):
        plan.pressures = [(draw.facets_on(solid, side), side, 1.0, ramp) for side in draw.sides()]
    else:
        axis = int(rng.integers(draw.dim))
        pull = np.zeros(draw.dim)
        pull[axis] = 1.0
        plan.tractions = [(draw.facets_on(solid, side), side, Affine(pull if is_high else -pull, ramp=ramp))
                          for side, (a, is_high) in SIDE_AXIS.items() if a == axis]
    states = scale_to_strain(plan, solid, plan.motion(solid), draw.strain())
    return plan.scene("balanced", solid, states, may_refuse=True)


def heavy(rng):
    """A held body carries a large load: what holds it bears the whole of it."""
    draw = Draw(rng, laws=("NeoHookean", "NeoHookean", "SaintVenant", "FixedCorotational", "MooneyRivlin"))
    plan = Plan(draw, pick(rng, ["static", "quasistatic", "quasistatic"]))
    choose_time(plan, None)
    axis, is_high = SIDE_AXIS[side := pick(rng, draw.sides())]
    plan.held = [(side, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    solid = draw.solid()
    opposite = next(s for s, (a, h) in SIDE_AXIS.items() if a == axis and s != side and s in draw.sides())
    facets = draw.facets_on(solid, opposite)
    pull = rng.uniform(-0.2, 0.2, draw.dim)
    pull[axis] = -1.0 if is_high else 1.0
    strain = log_uniform(rng, 1e-3, 0.15)
    ramp = None if plan.mode == "static" else plan.dt * plan.steps
    value = Affine(strain * draw.E * pull, ramp=ramp)
    plan.tractions = [(facets, opposite, value)]
    load = solid.traction(facets, value.a)

    def check(outcome):
        relative_mesh(outcome, solid, draw.size)
        frame = outcome.frames[-1]
        yield relative("reaction", [(frame.reaction.sum(axis=0), -load.sum(axis=0))], float(np.abs(load).sum()))
        arm = frame.u + solid.nodes
        size = float(np.abs(load).sum()) * draw.size
        yield "moment", float(np.abs(torque(arm - arm[0], frame.reaction + load)).max()) / size, BAR

    return Scene("heavy", plan.content(), draw.meshes(), check, plan.facts(strain=strain))


def torque(arm, force):
    """Sum of moments about the origin."""
    crossed = np.cross(arm, force) if arm.shape[1] == 3 else arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
    return np.sum(crossed, axis=0)


def wild(rng):
    """A free body is thrown, with large strains: momentum is kept, and implicit Euler never gains energy."""
    draw = Draw(rng, laws=("NeoHookean", "NeoHookean", "FixedCorotational", "MooneyRivlin"))
    plan = Plan(draw, "dynamic")
    plan.integrator, plan.steps = pick(rng, ["ImplicitEuler", "ImplicitEuler", "BDF2"]), int(rng.integers(3, 25))
    B = rng.uniform(-1, 1, (draw.dim, draw.dim))
    speed = draw.wave_speed() * log_uniform(rng, 1e-2, 0.2) * math.sqrt(draw.softness())
    plan.dt = float(f"{draw.size / draw.wave_speed() * log_uniform(rng, 1e-2, 1e2):.3g}")
    if not 1e-8 <= plan.dt <= 10:
        raise Redraw
    drift = speed * rng.uniform(-1, 1, draw.dim)
    plan.velocity = Affine(drift - speed / draw.size * B @ (draw.low + draw.high) / 2, speed / draw.size * B)
    solid = draw.solid()
    content = plan.content()
    content["output"]["paraview"]["skip_frame"] = 1
    content["output"]["paraview"]["options"]["kinetic_energy"] = True

    def check(outcome):
        start = (solid.scalar_mass @ plan.velocity.at(solid.nodes, 0)).sum(axis=0)
        scale = solid.mass() * speed
        yield relative("momentum", [(f.momentum, start) for f in outcome.frames], scale, 1e-3)
        energies = [f.kinetic + s["energy"]["elastic"] for f, s in zip(outcome.frames, outcome.steps)]
        if plan.integrator == "ImplicitEuler":
            yield "energy grows", max(b - a for a, b in zip(energies, energies[1:])) / energies[0], 1e-3

    return Scene("wild", content, draw.meshes(), check, plan.facts(strain=speed / draw.wave_speed()))


def stack(rng):
    """A body above another one above the ground: both sink by their weight, without inertia."""
    draw = Draw(rng)
    plan = Plan(draw, pick(rng, ["static", "quasistatic"]))
    choose_time(plan, None)
    softer = log_uniform(rng, 1e-2, 1)
    if draw.rho * GRAVITY * draw.size / (draw.E * softer) > 1e-3:
        raise Redraw
    gaps = [draw.size * log_uniform(rng, 1e-3, 0.3) for _ in range(2)]
    plan.gravity = np.zeros(draw.dim)
    plan.gravity[1] = -GRAVITY
    draw.more["contact"] = gap_contact(rng)
    up = [0.0] * draw.dim
    up[1] = float(draw.extent[1] + gaps[1])
    second = {"mesh": "body.msh", "volume_selection": 2, "transformation": {"translation": up}}
    ground = {"type": "ground", "height": float(draw.low[1] - gaps[0]), "surface_selection": 9, "name": "ground"}
    content = plan.content([draw.geometry(), second, ground])
    other = draw.material | {"id": 2}
    for key in ("E", "c1", "c2", "c3", "k", "d1"):
        if key in other:
            other[key] = other[key] * softer
    content["materials"].append(other)
    content["output"]["forces"].append({"name": "ground", "obstacles": "ground"})
    solid = draw.solid()
    count = len(solid.points)

    def check(outcome):
        u, weight = outcome.frames[-1].u, 2 * solid.mass() * GRAVITY
        sag = 10 * draw.rho * GRAVITY * draw.size / (draw.E * softer)
        yield "moves sideways", float(np.abs(u[:, [k for k in range(draw.dim) if k != 1]]).max() / draw.size), 2e-3 + sag
        yield "lower body", abs(float(u[:count, 1].mean()) + gaps[0]) / draw.size, 2e-3 + sag
        yield "upper body", abs(float(u[count:2 * count, 1].mean()) + sum(gaps)) / draw.size, 4e-3 + sag
        yield relative("force on the ground", [(outcome.forces["ground"][-1], -weight)], weight)

    return Scene("stack", content, draw.meshes(), check, plan.facts(gap=gaps[1] / draw.size))


def crossed_mesh(counts, size):
    """A rectangle of squares cut into four triangles each, which is its own mirror image."""
    points, _ = box_mesh(counts, size)
    corner = np.arange(len(points)).reshape(counts[0] + 1, counts[1] + 1)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel(), corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    middle = len(points) + np.arange(len(a))
    points = np.concatenate([points, (points[a] + points[b] + points[c] + points[d]) / 4])
    return points, oriented(points, np.concatenate([np.stack(t, axis=1) for t in
                                                    [(a, b, middle), (b, c, middle), (c, d, middle), (d, a, middle)]]))


def buckling(rng):
    """A symmetric column is pressed along its axis, to below or above the load at which it bends."""
    slender = float(rng.uniform(10, 25))
    draw = Draw(rng, dim=2, laws=("NeoHookean", "NeoHookean", "SaintVenant", "FixedCorotational", "MooneyRivlin"), order=pick(rng, [1, 2, 2]),
                counts=[1, int(rng.integers(6, 10))], aspect=[1 / slender, 1.0], jitter=0.0)
    points, draw.cells = crossed_mesh([int(rng.integers(1, 3)), draw.counts[1]], draw.extent)
    draw.points, draw.tags = points + draw.low, np.ones(len(draw.cells), dtype=int)
    solid = draw.solid()
    plan = Plan(draw, pick(rng, ["static", "quasistatic", "quasistatic"]))
    choose_time(plan, None)
    clamped = chance(rng, 0.5)
    down = Affine([0.0, -1.0], ramp=None if plan.mode == "static" else plan.dt * plan.steps)
    plan.held = [(2, [True, True], Affine([0.0, 0.0])), (4, [clamped, True], down)]
    motion = plan.motion(solid)
    u, reaction = motion.static(1.0 if plan.mode == "static" else plan.dt * plan.steps)
    block = np.ix_(motion.free, motion.free)
    softening = scipy.linalg.eigh(-solid.stress_stiffness(u)[block], solid.K[block], eigvals_only=True).max()
    critical = 1 / softening  # displacement of the top
    if critical / draw.extent[1] > 0.03:
        raise Redraw
    share = float(pick(rng, [0.6, 1.6]))
    plan.scale(share * critical)
    at_critical = abs(float(reaction[solid.nodes_on(draw.facets_on(solid, 4)), 1].sum())) * critical
    buckles = share > 1
    center = draw.low[0] + draw.extent[0] / 2
    mirror = np.array([np.argmin(np.abs(solid.nodes - [2 * center - x, y]).sum(axis=1)) for x, y in solid.nodes])

    def check(outcome):
        relative_mesh(outcome, solid, draw.size)
        frame = outcome.frames[-1]
        bent = float(np.abs(frame.u[:, 0] + frame.u[mirror, 0]).max()) / 2 / draw.extent[0]
        force = abs(outcome.forces["side4"][-1]) / at_critical
        if buckles:
            yield "load over that of buckling", abs(force - 1), 0.15
            yield "stays straight", max(0.0, 0.2 - bent), 0.0
        else:
            yield "load over that of buckling", abs(force - share), 0.05
            yield "bends", bent, 1e-4

    return Scene("buckling", plan.content(), draw.meshes(), check, plan.facts(strain=share * critical / draw.extent[1], share=share))


def crack(rng):
    """A body with a crack, faces that coincide at rest, is pulled, moved, or its crack pressed open."""
    draw = Draw(rng, counts=None, jitter=0.0)
    half = 1 + int(rng.integers(2 if draw.dim == 2 else 1))
    counts = [2 * half, 2] if draw.dim == 2 else [2, 2, int(rng.integers(1, 3))]
    points, draw.cells = box_mesh(counts, draw.extent)
    draw.points = points + draw.low
    # Vertices of the lower cells along the crack, x < half, are doubled.
    middle = draw.low + draw.extent / 2
    on = (np.abs(draw.points[:, 1] - middle[1]) < 1e-6 * draw.size) & (draw.points[:, 0] < middle[0] - 1e-6 * draw.size)
    new = np.arange(len(draw.points))
    new[on] = len(draw.points) + np.arange(on.sum())
    draw.points = np.concatenate([draw.points, draw.points[on]])
    lower = draw.points[draw.cells].mean(axis=1)[:, 1] < middle[1]
    draw.cells[lower] = new[draw.cells[lower]]
    draw.tags = np.ones(len(draw.cells), dtype=int)
    solid = draw.solid()
    plan = Plan(draw, pick_mode(rng))
    plan.held = [(3, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    choose_time(plan, plan.motion(solid), 0.85)
    geometry = draw.geometry()
    low, high = draw.low - draw.size, draw.high + draw.size
    low[1], high[1] = middle[1] - 1e-4 * draw.size, middle[1] + 1e-4 * draw.size
    geometry["surface_selection"] = [{"id": s, "box": draw.side_box(s)} for s in draw.sides()]
    geometry["surface_selection"].append({"id": 8, "box": [low.tolist(), high.tolist()]})
    faces = np.flatnonzero(np.abs(solid.facet_center[:, 1] - middle[1]) < 1e-4 * draw.size)
    ramp = ramp_of(plan)
    if chance(rng, 0.5):
        plan.pressures.append((faces, 8, 1.0, ramp))
    else:
        value = np.zeros(draw.dim)
        value[1] = 1.0
        plan.tractions += [(draw.facets_on(solid, 4), 4, Affine(value, ramp=ramp)), (draw.facets_on(solid, 2), 2, Affine(-value, ramp=ramp))]
    states = scale_to_strain(plan, solid, plan.motion(solid), draw.strain())
    return plan.scene("crack", solid, states, parts={"geometry": [geometry]})


KINDS = {kind.__name__: kind for kind in (rest, flight, ring, load, rollers, moved, affine, turned, spin, balanced, heavy, wild,
                                          settle, press, stack, drop, buckling, crack)}
# How often each kind is drawn.
DECK = ("ring", "load", "rest", "flight", "rollers", "load", "turned", "settle", "affine", "ring", "press", "drop", "moved",
        "load", "crack", "buckling", "rollers", "spin", "balanced", "stack", "ring", "settle", "turned", "heavy", "wild")


def draw_scene(seed, index, kind=None):
    """The scene of this number; each draws from its own random numbers, so that any can be made alone."""
    rng = np.random.default_rng([seed, index])
    kind = kind or DECK[index % len(DECK)]
    for _ in range(200):
        try:
            return KINDS[kind](rng)
        except Redraw:
            continue
    raise RuntimeError(f"no scene of kind {kind} comes out of seed {seed}, number {index}")
