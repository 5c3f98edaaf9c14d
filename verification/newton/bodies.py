# SPDX-License-Identifier: MIT
"""Small scenes of bodies squeezed hard, which run in seconds; squeeze.py runs them beside the paper's."""
import json
import pathlib
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "stability")]
from harness.scenes import box_mesh  # noqa: E402
from hard_cases import Scene  # noqa: E402


def ball_mesh(dim, cells, radius, centre):
    """A cube's mesh drawn onto a ball: each point keeps its direction, and its distance is that of the cube's faces."""
    points, simplices = box_mesh([cells] * dim, [2.0] * dim)
    points -= 1
    length = np.linalg.norm(points, axis=1, keepdims=True)
    points *= np.abs(points).max(axis=1, keepdims=True) / np.where(length > 0, length, 1)
    return radius * points + np.array(centre[:dim]), simplices


def surface_of_revolution(profile, sides):
    """Points and faces that a line of (radius, height) leaves when it turns around the y axis; a radius of 0 closes it."""
    angles = 2 * np.pi * (np.arange(sides) + 0.25) / sides  # no vertex on a plane of symmetry of the body
    points, rings = [], []
    for radius, height in profile:
        count = 1 if radius == 0 else sides
        rings.append([len(points) + k % count for k in range(sides + 1)])
        points += [[radius * np.cos(a), height, radius * np.sin(a)] for a in angles[:count]]
    faces = []
    for low, high in zip(rings, rings[1:]):
        for k in range(sides):
            quad = [low[k], low[k + 1], high[k + 1], high[k]]
            faces += [face for face in (quad[:3], [quad[0], quad[2], quad[3]]) if len(set(face)) == 3]
    return points, faces


def wall(scene, profile, move=None, sides=16):
    """An obstacle of a line of (x >= 0, height) and its mirror image, or in 3D of what it leaves when it turns."""
    if scene.dim == 3:
        points, faces = surface_of_revolution(profile, sides)
        scene.obstacle(points, faces=faces, move=move)
        return
    line = [(-x, y) for x, y in profile[::-1]]
    if profile[0][0] == 0:
        line = line[:-1]
        line += profile
        scene.obstacle(line, edges=[(k, k + 1) for k in range(len(line) - 1)], move=move)
        return
    edges = [(k, k + 1) for k in range(2 * len(profile) - 1) if k != len(profile) - 1]
    scene.obstacle(line + profile, edges=edges, move=move)


def funnel(scene):
    """A soft ball pressed by a piston through a throat of three quarters of its width, with friction."""
    scene.gravity, scene.dt, scene.steps, scene.kappa, scene.friction = 0.0, 0.02, 60, 1e4, 0.1
    points, cells = ball_mesh(scene.dim, 14 if scene.dim == 2 else 6, 0.5, (0.013, 0.93, 0.007))
    scene.body(points, cells, nu=0.4)
    wall(scene, [(0.36, -3.0), (0.36, -0.2), (0.75, 0.6), (0.75, 2.0)])
    wall(scene, [(0, 1.45), (0.3, 1.45)], move=[0, "-1.6 * t", 0][:scene.dim])


def mats(scene):
    """Four mats on each other, held at their ends, twisted by a turn and drawn together by a tenth."""
    scene.gravity, scene.quasistatic, scene.dt, scene.steps, scene.kappa, scene.friction = 0.0, True, 0.02, 50, 1e4, 0.1
    angle, drawn = "2 * pi * t", "-0.2 * t"
    for k in range(4):
        low = -0.16 + 0.081 * k
        body = scene.box([12, 1, 5], [0, low, -0.5], [2, low + 0.07, 0.5], nu=0.4)
        scene.hold(body, 1)
        scene.hold(body, 3, [drawn, f"y * (cos({angle}) - 1) - z * sin({angle})", f"y * sin({angle}) + z * (cos({angle}) - 1)"])


def shrinking_box(scene):
    """Turned cubes in a box whose walls come in until it has three fifths of its width."""
    scene.gravity, scene.dt, scene.steps, scene.kappa = 0.0, 0.02, 50, 1e4
    half, reach, turn = 1.1, 1.6, 0.2
    rotation = np.eye(scene.dim)
    rotation[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    for corner in np.ndindex(*[2] * scene.dim):
        points, cells = box_mesh([5 if scene.dim == 2 else 3] * scene.dim, [0.75] * scene.dim)
        sign = 1 if sum(corner) % 2 else -1
        centre = 0.52 * (2 * np.array(corner) - 1)
        scene.body((points - 0.375) @ (rotation if sign > 0 else rotation.T) + centre, cells, nu=0.4)
    for axis in range(scene.dim):
        for side in (-1, 1):
            others = [k for k in range(scene.dim) if k != axis]
            corners = np.zeros((2 ** (scene.dim - 1), scene.dim))
            corners[:, axis] = side * half
            for column, other in enumerate(others):
                corners[:, other] = [reach * (1 if index >> column & 1 else -1) for index in range(len(corners))]
            move = [0.0] * scene.dim
            move[axis] = f"{-side * 0.45} * t"
            scene.obstacle(corners, move=move, **({"edges": [(0, 1)]} if scene.dim == 2 else {"faces": [(0, 1, 2), (1, 3, 2)]}))


def indentation(scene):
    """A nearly incompressible block on a rough floor, under a punch with a round tip that goes in by almost half."""
    scene.gravity, scene.quasistatic, scene.dt, scene.steps, scene.kappa, scene.friction = 0.0, True, 0.05, 20, 1e4, 0.3
    counts = [20, 10] if scene.dim == 2 else [8, 4, 8]
    law = {"plane_strain": True} if scene.dim == 2 else {}
    body = scene.box(counts, [-1, 0, -1][:scene.dim], [1, 1, 1][:scene.dim], jitter=0.1, nu=0.499, **law)
    scene.hold(body, 2)
    tip = [(0.3 * np.sin(a), 1.302 - 0.3 * np.cos(a)) for a in np.linspace(0, np.pi / 2, 7)]
    wall(scene, [*[(0 if k == 0 else x, y) for k, (x, y) in enumerate(tip)], (0.3, 2.0)], move=[0, "-0.45 * t", 0][:scene.dim])


def bowl(scene):
    """A soft creature with arms falls fast into a bowl, in steps of 0.07 s."""
    scene.dt, scene.steps, scene.kappa, scene.friction = 0.07, 15, 1e4, 0.1
    counts = [15, 15] if scene.dim == 2 else [10, 10, 10]
    points, cells = box_mesh(counts, [1.5] * scene.dim)
    points -= 0.75
    middle = points[cells].mean(axis=1)
    # Arms along the axes: cells that are near the middle in all coordinates but one.
    cells = cells[(np.abs(middle) > 0.16).sum(axis=1) <= 1]
    used, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, scene.dim + 1)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    points = points[used]
    points[:, :2] = points[:, :2] @ turn.T
    scene.body(points + np.array([0.03, 1.2, 0.02][:scene.dim]), cells, E=2e4, nu=0.4, velocity=[0, -6.0, 0][:scene.dim])
    wall(scene, [(0 if k == 0 else np.sin(a), 1 - np.cos(a)) for k, a in enumerate(np.linspace(0, 0.6 * np.pi, 10))])


def half_ball(scene):
    """Half a ball pressed flat on a floor by its flat side: many pairs meet in each step."""
    scene.gravity, scene.quasistatic, scene.dt, scene.steps, scene.kappa, scene.dhat = 0.0, True, 0.1, 10, 1e4, 2e-5
    points, cells = ball_mesh(scene.dim, 32 if scene.dim == 2 else 12, 1.0, (0, 1.002, 0))
    cells = cells[points[cells].mean(axis=1)[:, 1] < 1.002]
    used, cells = np.unique(cells, return_inverse=True)
    body = scene.body(points[used], cells.reshape(-1, scene.dim + 1))
    scene.hold(body, 4, [0, "-0.2 * t", 0][:scene.dim])
    wall(scene, [(0, 0), (3, 0)])


# Name in the table: what fills its scene, the dimension, and the order of elements where it is not 1.
BODIES = {
    "ball through a funnel 2D": (funnel, 2), "ball through a funnel 3D": (funnel, 3), "mats twisted 3D": (mats, 3),
    "cubes in a shrinking box 2D": (shrinking_box, 2), "cubes in a shrinking box 3D": (shrinking_box, 3),
    "nearly incompressible indentation 2D": (indentation, 2), "nearly incompressible indentation 3D": (indentation, 3),
    "creature in a bowl 2D": (bowl, 2), "creature in a bowl 3D": (bowl, 3),
    "half a ball pressed flat 2D": (half_ball, 2), "half a ball pressed flat 2D, quadratic": (half_ball, 2, 2),
    "half a ball pressed flat 3D": (half_ball, 3),
}


def build(name, folder):
    """Writes meshes and scene into a folder, and returns the scene's file."""
    fill, dim, *order = BODIES[name]
    scene = Scene(pathlib.Path(folder), dim=dim)
    fill(scene)
    content = scene.content()
    # Tolerances and limits as the paper's scenes have them, not those of round-off.
    content["solver"]["nonlinear"] = {"x_delta": 1e-3, "grad_norm": 1e-8, "max_iterations": 3000}
    content["solver"]["contact"]["friction_iterations"] = 1
    content["output"] = {}
    if order:
        content["space"] = {"discr_order": order[0]}
    path = pathlib.Path(folder) / "scene.json"
    path.write_text(json.dumps(content, indent=1))
    return path
