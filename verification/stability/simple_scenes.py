# SPDX-License-Identifier: MIT
"""Simple scenes, drawn at random, with their right values: a function (rng) -> Scene for each kind. A drawing that a user would not
write is drawn again (`Redraw`)."""
import math
import pathlib
import sys

import numpy as np
import scipy.linalg

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
from harness.scenes import box_mesh  # noqa: E402
from reference import BDF, Motion, Solid, small_strain_moduli  # noqa: E402
from simple_bodies import (BAR, GRAVITY, SIDE_AXIS, Affine, Draw, Plan, Redraw, Scene, add_load,  # noqa: E402
                           add_remeshing, chance, choose_time, crossed_mesh, gap_contact, log_uniform, pick, pick_mode,
                           ramp_of, relative, relative_mesh, rotation, scale_to_strain, torque, with_true_gravity)


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
        mask = [True] * draw.dim if chance(rng, 0.7) else [chance(rng, 0.5) for _ in range(draw.dim)]
        plan.held = [(side, mask, Affine(np.zeros(draw.dim)))] if any(mask) else []
        plan.velocity = Affine(-B[:, axis] * at, B)
    else:
        plan.velocity = Affine(-B @ (draw.low + draw.high) / 2, B)
    solid = draw.solid()
    motion = plan.motion(solid)
    choose_time(plan, motion)
    if chance(rng, 0.15):
        plan.t0 = plan.dt * float(rng.integers(-20, 20))
    plan.add_contact()
    return plan.scene("ring", solid, scale_to_strain(plan, solid, motion, draw.strain()))


def load(rng):
    """A body held at a side carries small loads."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    side = pick(rng, draw.sides())
    plan.held = [(side, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    solid = draw.solid()
    choose_time(plan, plan.motion(solid), 0.85)
    add_load(plan, solid, [s for s in draw.sides() if s != side], ramp_of(plan))
    plan.add_contact()
    return plan.scene("load", solid, with_true_gravity(plan, solid, plan.motion(solid)))


def rollers(rng):
    """A body on rollers along each axis carries a load, or is pulled. It may be free to roll along an axis that nothing pushes."""
    draw = Draw(rng)
    plan = Plan(draw, pick_mode(rng))
    sides = {axis: pick(rng, [s for s, (a, _) in SIDE_AXIS.items() if a == axis]) for axis in range(draw.dim)}
    loose = int(rng.integers(draw.dim)) if chance(rng, 0.25) else None
    zero = Affine(np.zeros(draw.dim))
    plan.held = [(side, [k == axis for k in range(draw.dim)], zero) for axis, side in sides.items() if axis != loose]
    solid = draw.solid()
    choose_time(plan, plan.motion(solid), 0.85)
    free = [s for s in draw.sides() if s not in sides.values() and SIDE_AXIS[s][0] != loose]
    if loose is not None or chance(rng, 0.4):
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
    add_remeshing(draw)

    def check(outcome):
        pairs = [(f.u, value.at(f.rest, f.t)) for f in outcome.frames if f.step > 0]
        yield relative("displacement", pairs)

    return Scene("affine", plan.content(), draw.meshes(), check, plan.facts(strain=size))


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


def settle(rng):
    """A body above the ground sinks onto it by its weight, without inertia."""
    draw = Draw(rng)
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
        yield "moves sideways", float(np.abs(u[:, others]).max() / draw.size), 1e-3 + 2 * sag / draw.size
        bottom = np.abs(solid.nodes[:, 1] - draw.low[1]) < 1e-6 * draw.size
        lowest = float((u[bottom, 1] + gap).min())
        yield "gap", abs(lowest) / draw.size, 2e-3
        yield "passes the ground", max(0.0, -lowest), 0.0
        yield relative("force on the ground", [(outcome.forces["ground"][-1], -weight)], weight)

    return Scene("settle", content, draw.meshes(), check, plan.facts(strain=sag / draw.size, gap=gap / draw.size))


def press(rng):
    """A body is pressed over a gap, without friction: by a lid that moves down onto it, on rollers or free above the ground; or by
    its own top, which is moved down until the body meets the ground."""
    draw = Draw(rng, jitter=0.0)
    plan = Plan(draw, "quasistatic")
    choose_time(plan, None)
    gap, strain = draw.size * log_uniform(rng, 1e-3, 0.3), float(rng.uniform(2e-3, 1e-2))
    how = pick(rng, ["rollers", "rollers", "free", "top"])
    gaps, tend = {"rollers": 1, "free": 2, "top": 1}[how], plan.dt * plan.steps
    zero, along_y = Affine(np.zeros(draw.dim)), [k == 1 for k in range(draw.dim)]
    down = -(gaps * gap + strain * draw.extent[1]) * np.eye(draw.dim)[1]
    plan.held = {"rollers": [(2, along_y, zero)], "free": [], "top": [(4, along_y, Affine(down, ramp=tend))]}[how]
    if how != "free" and chance(rng, 0.6):
        plan.held += [(side, [k == axis for k in range(draw.dim)], zero) for side, axis in ((1, 0), (5, 2))[:draw.dim - 1]]
    draw.more["contact"] = gap_contact(rng) | {"friction_coefficient": 0.0}
    obstacles = []
    if how != "top":
        point = ((draw.low + draw.high) / 2)
        point[1] = draw.high[1] + gap
        obstacles.append({"type": "plane", "point": point.tolist(), "normal": (-np.eye(draw.dim)[1]).tolist(), "is_obstacle": True,
                          "surface_selection": 9, "name": "lid"})
    if how != "rollers":
        obstacles.append({"type": "ground", "height": float(draw.low[1] - gap), "surface_selection": 10, "name": "ground"})
    content = plan.content([draw.geometry(), *obstacles])
    if how != "top":
        content["boundary_conditions"]["obstacle_displacements"] = [{"id": 9, "value": Affine(down, ramp=tend).json()}]
    content["output"]["forces"] += [{"name": obstacle["name"], "obstacles": obstacle["name"]} for obstacle in obstacles]
    solid = draw.solid()

    def check(outcome):
        frame = outcome.frames[-1]
        others = [k for k in range(draw.dim) if k != 1]
        yield "moves sideways", float(np.abs(frame.u[:, others]).max() / draw.size), 2 * strain
        # Work of the stress with the displacement y: force = modulus * area * mean strain, however uneven the pressure is.
        mu, lam = small_strain_moduli(draw.material, draw.dim)
        modulus = 4 * mu * (lam + mu) / (lam + 2 * mu) if draw.dim == 2 else mu * (3 * lam + 2 * mu) / (lam + mu)
        top, bottom = (solid.traction(draw.facets_on(solid, side), np.ones(draw.dim))[:, 1] for side in (4, 2))
        sunk = float(((bottom - top) * frame.u[:, 1]).sum())  # over the area
        closed = (strain * draw.extent[1] - sunk / top.sum()) / draw.size  # minus what is left of gaps, or plus it
        force = modulus * strain * draw.extent[1] * top.sum() / draw.extent[1]
        yield "gap", abs(closed), 4e-3
        above = -outcome.forces["side4"][-1] if how == "top" else outcome.forces["lid"][-1]
        below = outcome.forces["side2"][-1] if how == "rollers" else -outcome.forces["ground"][-1]
        yield relative("force from above", [(above, modulus * sunk / draw.extent[1])], force, BAR + 3 * strain)
        yield relative("forces add up", [(below, above)], force)

    return Scene("press", content, draw.meshes(), check, plan.facts(strain=strain, gap=gap / draw.size, how=how))


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
        if by_weight and plan.integrator == "ImplicitEuler":
            yield "ends below its start", max(0.0, float(outcome.frames[-1].u[:, 1].mean()) / draw.size), 1e-2

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


def wild(rng):
    """A free body is thrown, with large strains: momentum is kept, and implicit Euler never gains energy."""
    draw = Draw(rng, laws=("NeoHookean", "NeoHookean", "FixedCorotational", "MooneyRivlin"))
    plan = Plan(draw, "dynamic")
    plan.integrator, plan.steps = pick(rng, ["ImplicitEuler", "ImplicitEuler", "BDF2"]), int(rng.integers(3, 25))
    B = rng.uniform(-1, 1, (draw.dim, draw.dim))
    speed = draw.wave_speed() * log_uniform(rng, 1e-2, 0.2) * math.sqrt(draw.softness())
    plan.dt = float(f"{min(draw.size / draw.wave_speed() * log_uniform(rng, 1e-2, 1e2), 0.3 * draw.size / speed):.3g}")
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
        if plan.integrator == "ImplicitEuler":  # a single step may gain some, where the energy is not convex
            yield "energy is gained", max(energies) / energies[0] - 1, 1e-3

    return Scene("wild", content, draw.meshes(), check, plan.facts(strain=speed / draw.wave_speed()))


def stack(rng):
    """A body above another one above the ground: both sink by their weight, without inertia. Friction keeps the upper one: without
    it the lower one tilts towards where the upper one is heavier, and that one slides off."""
    draw = Draw(rng)
    plan = Plan(draw, pick(rng, ["static", "quasistatic"]))
    choose_time(plan, None)
    softer = log_uniform(rng, 1e-2, 1)
    if draw.rho * GRAVITY * draw.size / (draw.E * softer) > 1e-3:
        raise Redraw
    gaps = [draw.size * log_uniform(rng, 1e-3, 0.3) for _ in range(2)]
    plan.gravity = np.zeros(draw.dim)
    plan.gravity[1] = -GRAVITY
    draw.more["contact"] = gap_contact(rng) | {"friction_coefficient": 0.3}
    up = [0.0] * draw.dim
    up[1] = float(draw.extent[1] + gaps[1])
    draw.is_unit_mesh = False
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


def critical_motion(plan, solid):
    """Displacement of the top at which a straight column bends, for a top that is moved by 1, and the load there."""
    motion, tend = plan.motion(solid), 1.0 if plan.mode == "static" else plan.dt * plan.steps
    u, reaction = motion.static(tend)
    block = np.ix_(motion.free, motion.free)
    critical = 1 / scipy.linalg.eigh(-solid.stress_stiffness(u)[block], solid.K[block], eigvals_only=True).max()
    return critical, abs(float(reaction[solid.nodes_on(plan.draw.facets_on(solid, 4)), 1].sum())) * critical


def buckling(rng):
    """A symmetric column is pressed along its axis, to below or above the load at which it bends: on its own mesh, or the true one
    where the mesh follows."""
    slender = float(rng.uniform(10, 25))
    draw = Draw(rng, dim=2, laws=("NeoHookean", "NeoHookean", "SaintVenant", "FixedCorotational", "MooneyRivlin"),
                order=pick(rng, [1, 2, 2]), counts=[int(rng.integers(1, 3)), int(rng.integers(6, 10))],
                aspect=[1 / slender, 1.0], jitter=0.0)
    points, draw.cells = crossed_mesh(draw.counts, draw.extent)
    draw.points, draw.tags = points + draw.low, np.ones(len(draw.cells), dtype=int)
    plan = Plan(draw, pick(rng, ["static", "quasistatic", "quasistatic"]))
    choose_time(plan, None)
    down = Affine([0.0, -1.0], ramp=None if plan.mode == "static" else plan.dt * plan.steps)
    plan.held = [(2, [True, True], Affine([0.0, 0.0])), (4, [chance(rng, 0.5), True], down)]
    is_remeshed = draw.order == 1 and chance(rng, 0.5)
    if is_remeshed:
        draw.more["space"] = {"remesh": {"enabled": True}}
    solid = Solid(draw.points, draw.cells, draw.tags, {1: draw.material}, 2 if is_remeshed else draw.order)
    critical, load = critical_motion(plan, solid)
    # Linear buckling is the reference: at a strain of 2.8 % a column of Neo-Hooke carries 14 % more on its twice refined mesh.
    if critical / draw.extent[1] > 0.015:
        raise Redraw
    share = float(pick(rng, [0.6, 1.6]))
    plan.scale(share * critical)

    def check(outcome):
        frame = outcome.frames[-1]
        bent = 2 * abs(float(frame.u[:, 0].mean())) / draw.extent[0]
        force = abs(outcome.forces["side4"][-1]) / load
        if share > 1:
            yield "load over that of buckling", abs(force - 1), 0.15
            yield "stays straight", max(0.0, 0.2 - bent), 0.0
        else:
            yield "load over that of buckling", abs(force - share), 0.05
            yield "bends", bent, 1e-2 if is_remeshed else 1e-4

    return Scene("buckling", plan.content(), draw.meshes(), check, plan.facts(strain=share * critical / draw.extent[1], share=share,
                                                                              remeshed=is_remeshed))


def cracked(rng):
    """A body of which half of the middle plane is cut: the vertices of its lower cells there are doubled."""
    draw = Draw(rng, jitter=0.0)
    half = 1 + int(rng.integers(2 if draw.dim == 2 else 1))
    points, draw.cells = box_mesh([2 * half, 2] if draw.dim == 2 else [2, 2, int(rng.integers(1, 3))], draw.extent)
    draw.points = points + draw.low
    middle = draw.low + draw.extent / 2
    on = (np.abs(draw.points[:, 1] - middle[1]) < 1e-6 * draw.size) & (draw.points[:, 0] < middle[0] - 1e-6 * draw.size)
    new = np.arange(len(draw.points))
    new[on] = len(draw.points) + np.arange(on.sum())
    draw.points = np.concatenate([draw.points, draw.points[on]])
    lower = draw.points[draw.cells].mean(axis=1)[:, 1] < middle[1]
    draw.cells[lower] = new[draw.cells[lower]]
    draw.tags = np.ones(len(draw.cells), dtype=int)
    solid = draw.solid()
    faces = np.flatnonzero(np.abs(solid.facet_center[:, 1] - middle[1]) < 1e-4 * draw.size)
    return draw, solid, middle[1], faces


def crack(rng):
    """A body with a crack, faces that coincide at rest, is pulled, or its crack pressed open."""
    draw, solid, middle, faces = cracked(rng)
    plan = Plan(draw, pick_mode(rng))
    plan.held = [(3, [True] * draw.dim, Affine(np.zeros(draw.dim)))]
    choose_time(plan, plan.motion(solid), 0.85)
    geometry = draw.geometry()
    low, high = draw.low - draw.size, draw.high + draw.size
    low[1], high[1] = middle - 1e-4 * draw.size, middle + 1e-4 * draw.size
    geometry["surface_selection"] = [{"id": s, "box": draw.side_box(s)} for s in draw.sides()]
    geometry["surface_selection"].append({"id": 8, "box": [low.tolist(), high.tolist()]})
    ramp = ramp_of(plan)
    if chance(rng, 0.5):
        plan.pressures.append((faces, 8, 1.0, ramp))
    else:
        value = np.eye(draw.dim)[1]
        plan.tractions += [(draw.facets_on(solid, side), side, Affine(sign * value, ramp=ramp)) for side, sign in ((4, 1), (2, -1))]
    states = scale_to_strain(plan, solid, plan.motion(solid), draw.strain())
    if plan.mode != "dynamic":  # a crack that rings would close
        plan.add_contact()
    return plan.scene("crack", solid, states, parts={"geometry": [geometry]})


def crack_faces(rng):
    """A crack whose faces, which only their vertices tell apart, are loaded or moved one by one through the Python package. Where
    the mesh changes, the loads and the opening are held against those of the first mesh."""
    draw, solid, middle, faces = cracked(rng)
    plan = Plan(draw, "quasistatic", dt=float(f"{log_uniform(rng, 1e-8, 10):.3g}"))
    is_upper = {f: solid.points[draw.cells[solid.facets[f][0]]].mean(axis=0)[1] > middle for f in faces}
    groups = {"upper": [f for f in faces if is_upper[f]], "lower": [f for f in faces if not is_upper[f]],
              "right": list(draw.facets_on(solid, 3))}
    values = {name: float(rng.uniform(0.2, 1)) * sign * np.eye(draw.dim)[1] for name, sign in (("upper", 1), ("lower", -1))}
    moves = chance(rng, 0.5)
    # The tip belongs to both faces, so that values by vertex cannot move it both ways.
    vertices = {name: np.unique([solid.facet_nodes(f)[0] for f in group]) for name, group in groups.items()}
    opened = {name: [v for v in vertices[name] if v not in vertices[{"upper": "lower", "lower": "upper"}[name]]] for name in values}
    held = np.zeros(solid.nodes.shape, dtype=bool)
    held[solid.nodes_on(groups["right"])] = True
    target, force = np.zeros(solid.nodes.shape), np.zeros(solid.nodes.shape)
    if moves:
        if draw.order == 2:
            raise Redraw
        for name, value in values.items():
            held[vertices[name]], target[opened[name]] = True, value
    else:
        force = sum(solid.traction(groups[name], value) for name, value in values.items())
    motion = Motion(solid, held, lambda t: target, lambda t: force)
    factor = float(f"{draw.strain() / solid.largest_gradient(motion.static()[0]):.3g}")
    u = motion.static()[0] * factor
    field = np.zeros((len(draw.points), draw.dim))
    fixed, tractions = {"right": field}, {}
    for name, value in values.items():
        chosen = field.copy()
        chosen[opened[name] if moves else vertices[name]] = factor * value
        (fixed if moves else tractions)[name] = chosen
    material = {key: value for key, value in draw.material.items() if key != "id"}
    is_remeshed = draw.order == 1 and chance(rng, 0.4)
    space = {"remesh": {"enabled": True}} if is_remeshed else {"discr_order": draw.order}
    options = {"materials": material, "time": {"dt": plan.dt, "time_steps": 1, "quasistatic": True}, "space": space}
    content = {"points": draw.points.tolist(), "cells": draw.cells.tolist(), "options": options,
               "boundaries": {name: [solid.facet_nodes(f)[0].tolist() for f in group] for name, group in groups.items()},
               "fixed": {name: v.tolist() for name, v in fixed.items()},
               "tractions": {name: v.tolist() for name, v in tractions.items()}}

    def check(outcome):
        frame = outcome.frames[-1]
        if not is_remeshed:
            relative_mesh(outcome, solid, draw.size)
            yield relative("displacement", [(frame.u, u)])
            return
        mouth = [np.hypot(*(rest[:, :2] - [draw.low[0], middle]).T) < 1e-6 * draw.size for rest in (frame.rest, solid.nodes)]
        opened, first = (float(np.ptp(field[at, 1])) for field, at in zip((frame.u, u), mouth))
        yield "crack opens less", max(0.0, 0.9 - opened / first), 0.0
        if not moves:
            load = factor * force
            yield relative("applied forces", [(frame.applied.sum(axis=0), load.sum(axis=0))], np.abs(load).sum())
        yield relative("forces add up", [(frame.reaction.sum(axis=0), -frame.applied.sum(axis=0))], np.abs(frame.reaction).sum())

    return Scene("crack_faces", content, {}, check, plan.facts(strain=solid.largest_gradient(u), remeshed=is_remeshed),
                 program="by_vertex.py")


KINDS = {kind.__name__: kind for kind in (rest, flight, ring, load, rollers, moved, affine, turned, spin, balanced, heavy, wild,
                                          settle, press, stack, drop, buckling, crack,
                                          crack_faces)}
# How often each kind is drawn.
DECK = ("ring", "load", "rest", "flight", "rollers", "load", "turned", "settle", "affine", "ring", "press", "drop", "moved",
        "load", "crack", "buckling", "rollers", "spin", "balanced", "stack", "ring", "settle", "turned", "heavy", "wild",
        "crack_faces")


def kind_of(index):
    return DECK[index % len(DECK)]


def draw_scene(seed, index, kind=None):
    """The scene of this number; each draws from its own random numbers, so that any can be made alone."""
    rng = np.random.default_rng([seed, index])
    kind = kind or kind_of(index)
    for _ in range(200):
        try:
            return KINDS[kind](rng)
        except Redraw:
            continue
    raise RuntimeError(f"no scene of kind {kind} comes out of seed {seed}, number {index}")
