# SPDX-License-Identifier: MIT
"""Scenes in 2D, and a thin wall, that set no numeric key of method: their forces against finer meshes, with other d-hats and in
other units, and their cost."""
import csv
import math

import numpy as np

from harness import by_default
from harness.bisection import ball
from harness.by_default import REMESHED, Study, body, held, merged, obstacle, polyline
from harness.scenes import box_mesh, write_mesh, wheel_mesh

TITLE = "Forces by defaults"
QUANTITY = "force, or ratio of forces, of scenes without a numeric key of method; Newton iterations, processor seconds"
REFERENCE = ("the same scene on its first mesh refined three times, the slope's tangent, 2/3 g sin 10°; with a third of d-hat, in mm "
             "and ms, in a tenth and ten times its time; the cheapest choice by hand")
TOLERANCE = "3 %; 0.5 % in other units; twice the iterations and the seconds; warnings within a factor 2 of the error"
NEEDS = ("numpy", "meshio")


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
            "output": {"forces": [{"name": "force", "obstacles": 2}]}}, lambda rows, _: abs(rows[-1]["all_y"])


def beam(context, depth, tip):
    """A beam with a nose of `depth` that is pushed over a bump with this polyline: the force of insertion."""
    points, cells = box_mesh([40, 4], [0.02, 0.002])
    write_mesh(context.folder / "hook.msh", points - np.outer(depth(points[:, 0]) * (1 - points[:, 1] / 0.002), [0, 1]), cells)
    return {"geometry": [body("hook.msh"), obstacle(context, "bump.obj", *polyline(tip))],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 2e9, "nu": 0.35, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.006 * t", 0]}]},
            "time": {"dt": 1 / 60, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3},
            "output": {"forces": [{"name": "force", "bodies": 1}]}}, \
        lambda rows, _: max(row["reaction_x"] for row in rows)


def hook_coarse(context):
    """Nose and bump are round. Four layers of linear elements bend too little."""
    radius, flank = 0.0005, math.atan2(0.0025, 0.002)
    arc = [(0.0225 + radius * math.sin(angle), -0.0005 - radius + radius * math.cos(angle))
           for angle in np.linspace(-flank, flank, 25)]
    foot = lambda end, side: (end[0] + side * (end[1] + 0.003) / math.tan(flank), -0.003)
    depth = lambda x: 0.0015 * np.cos(np.pi / 2 * np.minimum(1, np.abs(x - 0.018) / 0.002)) ** 2
    return beam(context, depth, [foot(arc[0], -1), *arc, foot(arc[-1], 1)])


def hook(context):
    return remeshed(hook_coarse(context))


def hook_sharp(context):
    """Tips without a radius, on which finer meshes find lower forces for ever, and four layers."""
    return beam(context, lambda x: 0.0015 * np.maximum(0, 1 - np.abs(x - 0.018) / 0.002),
                [(0.0205, -0.003), (0.0225, -0.0005), (0.0245, -0.003)])


def slot(context, entry):
    """A block that is pushed into a slot narrower by 2 %. `entry` has places and depths of its wall before it is straight."""
    write_mesh(context.folder / "block.msh", *box_mesh([12, 8], [0.015, 0.01]))
    wall = lambda y, side: polyline([*((x, y + side * depth) for x, depth in entry), (0.05, y)])
    return {"geometry": [body("block.msh"), obstacle(context, "low.obj", *wall(0.0001, -1)),
                         obstacle(context, "high.obj", *wall(0.0099, 1))],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 1e8, "nu": 0.35, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.014 * t", 0]}]},
            "time": {"dt": 0.04, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.2},
            "output": {"forces": [{"name": "force", "bodies": 1}]}}, lambda rows, _: abs(rows[-1]["reaction_x"])


def press_fit_coarse(context):
    """The slot's entry is round. The force grows edge by edge, of which six are in it at the end."""
    radius, opening = 0.03, math.asin(0.006 / 0.03)
    return slot(context, [(0.022 - radius * math.sin(angle), radius * (1 - math.cos(angle)))
                          for angle in np.linspace(opening, 0, 49)])


def press_fit(context):
    return remeshed(press_fit_coarse(context))


def press_fit_sharp(context):
    """The entry ends at a corner, where pressure has a singularity and each edge that passes makes a wave of the force."""
    return slot(context, [(0.016, 0.0006), (0.022, 0)])


def remeshed(made):
    scene, quantity = made
    return merged(scene, REMESHED), quantity


def wheel(context):
    """A wheel that begins with 12 corners and rolls down a slope: acceleration of its centre."""
    radius, gap, corners, slope, end = 0.05, 5e-5, 12, math.radians(10), 0.8
    points, cells = wheel_mesh(radius, corners)
    write_mesh(context.folder / "wheel.msh", points + [0, radius + gap], cells)

    def acceleration(_, folder):
        """From where the centre is in the middle of the time and at its end."""
        with open(folder / "points.csv") as file:
            rows = [{key: float(row[key]) for key in ("t", "x")} for row in csv.DictReader(file)]
        middle, last = rows[len(rows) // 2], rows[-1]
        return (rows[0]["x"] - 2 * middle["x"] + last["x"]) / (last["t"] / 2) ** 2
    return {"geometry": [{"mesh": "wheel.msh", "volume_selection": 1, "surface_selection": 3},
                         {"type": "ground", "is_obstacle": True}],
            "shapes": [{"surface": 3, "type": "circle", "center": [0, radius + gap], "radius": radius}],
            "materials": {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": 1000},
            "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
            "time": {"dt": 0.005, "tend": end},
            "contact": {"enabled": True, "friction_coefficient": 0.5}, **REMESHED,
            "output": {"forces": [{"name": "force", "bodies": 1}], "points": [{"name": "centre", "rest": [0, radius + gap]}]}}, \
        acceleration


def plates(context):
    """Two plates that stick to each other and to a slope: friction of the lower one by its contact force."""
    write_mesh(context.folder / "plate.msh", *box_mesh([10, 1], [0.2, 0.02]))
    slope = math.radians(15)
    return {"geometry": [{"type": "ground", "is_obstacle": True},
                         *({**body("plate.msh", transformation={"translation": [0, 1e-5 + k * 0.02001]}), "volume_selection": k + 1}
                           for k in range(2))],
            "materials": {"type": "NeoHookean", "E": 1e8, "nu": 0.3, "rho": 1000},
            "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
            "time": {"dt": 0.01, "tend": 2},
            "contact": {"enabled": True, "friction_coefficient": 0.5},
            "output": {"forces": [{"name": "force", "bodies": [1, 2]}]}}, \
        lambda rows, _: sum(row["friction_x"] for row in rows[-50:]) / sum(row["contact_y"] for row in rows[-50:])


def thin_wall(context):
    """A wall, a millimetre thick, that is pressed and touches nothing."""
    write_mesh(context.folder / "wall.msh", *box_mesh([4, 4, 1], [0.004, 0.004, 0.001]))
    return {"geometry": [{"mesh": "wall.msh", "volume_selection": 1, "surface_selection": {"threshold": 1e-7}}],
            "materials": [{"id": 1, "type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000}],
            "boundary_conditions": {"dirichlet_boundary": [held(5, 2), held(6, 2, "-0.0003 * t"), held(1, 0), held(2, 1)]},
            "time": {"dt": 0.25, "tend": 1, "quasistatic": True}, "contact": {"enabled": True},
            "output": {"forces": [{"name": "force", "surfaces": 5}]}}, lambda rows, _: abs(rows[-1]["all_z"])


IN_PLANE = {"millimetres": 1000}  # bodies are one unit of length thick
STUDIES = [
    Study(o_ring, 0.003, **IN_PLANE), Study(press_fit, 0.01, **IN_PLANE), Study(hook, 0.002, **IN_PLANE),
    Study(wheel, 0.1, exact=2 / 3 * 9.81 * math.sin(math.radians(10)), millimetres=1e-3, milliseconds=1e6),
    Study(plates, 0.02, exact=-math.tan(math.radians(15))), Study(thin_wall, 0.001),
    *(Study(make, is_judged=False) for make in (press_fit_coarse, press_fit_sharp, hook_coarse, hook_sharp))]
QUICK_STUDIES = {o_ring, press_fit, plates, thin_wall}


def results(context):
    yield from by_default.results(context, [study for study in STUDIES if not context.quick or study.make in QUICK_STUDIES])
