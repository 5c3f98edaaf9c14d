# SPDX-License-Identifier: MIT
"""Bodies that begin as coarse polyhedra and are remeshed with the true shape of their surface, `/shapes`, by defaults otherwise; the half
sphere with the accuracy that is asked of it, too."""
import csv
import json
import math

import numpy as np

from harness.bisection import ball
from harness.scenes import Run, write_mesh, wheel_mesh
from harness.suite import Result, compare

TITLE = "True shapes"
QUANTITY = "acceleration of a wheel that begins with 12 corners and rolls, its area; force on half a sphere that begins with h 1"
REFERENCE = "2/3 g sin 20°; pi r^2; 4.552, axisymmetric quadratic elements at h 0.2, 0.1, 0.05: 4.5487, 4.5511, 4.5517"
TOLERANCE = "wheel 0.3 %, half sphere 0.5 %; areas are shown"
NEEDS = ("numpy", "meshio", "h5py")

WHEEL, SLOPE = 0.05, math.radians(20)
HALF, APPROACH, FORCE = 10.0, 0.2, 4.552


def run(context, name, scene):
    path = context.folder / f"{name}.json"
    path.write_text(json.dumps(scene, indent=1))
    context.call("itr", "run", path, "-o", context.folder / name, "--overwrite", "--threads", 1)
    return Run(context.folder / name)


def speed_and_area(path):
    """Momentum by mass [m/s] of a stored frame of one body of density 1000, and its area at rest."""
    import h5py
    with h5py.File(path) as file:
        rest, cells = file["mesh/rest"][()], file["mesh/simplices"][()]
        momentum = file["totals/momentum"][0]
    a, b, c = (rest[cells[:, k]].T for k in range(3))
    area = float(((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).sum() / 2)
    return momentum / (1000 * area), area


def wheel(context, steps=300, dt=0.001, corners=12, gap=5e-5):
    """A wheel of rubber on a slope, without slip: mean acceleration by mass over the last two thirds of the run, and area."""
    points, cells = wheel_mesh(WHEEL, corners)
    write_mesh(context.folder / "wheel.msh", points + [0, WHEEL + gap], cells)
    made = run(context, "wheel", {
        "geometry": [{"mesh": "wheel.msh", "surface_selection": 3}, {"type": "ground", "is_obstacle": True}],
        "shapes": [{"surface": 3, "type": "circle", "center": [0, WHEEL + gap], "radius": WHEEL}],
        "materials": {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": 1000},
        "boundary_conditions": {"rhs": [-9.81 * math.sin(SLOPE), 9.81 * math.cos(SLOPE)]},
        "time": {"dt": dt, "time_steps": steps},
        "contact": {"enabled": True, "friction_coefficient": 0.5},
        "space": {"remesh": {"enabled": True}},
        "output": {"paraview": {"skip_frame": steps // 3, "options": {"momentum": True}}}})
    frames = [speed_and_area(path) for path in sorted((made.folder / "frames").glob("*.h5"))]
    return (frames[3][0] - frames[1][0]) / (2 * (steps // 3) * dt), frames[3][1]


def half_sphere(context, accuracy=None, h=1.0, dt=0.1, gap=1e-4):
    """The section of a half sphere, bonded to a plate that presses it onto a smooth rigid plane: force, and vertices."""
    away = lambda x: np.linalg.norm(x + [0, HALF], axis=1)
    points, cells = ball(HALF, lambda x: np.minimum(3 * h + 1, np.maximum(h, 0.6 * (away(x) - 2))), ((1, -1),))
    write_mesh(context.folder / "half.msh", points + [0, HALF + gap], cells)
    (context.folder / "plane.obj").write_text(f"v 0 0 0\nv {2 * HALF} 0 0\nl 1 2\n")
    far, top = 2 * HALF, HALF + gap
    made = run(context, "half_sphere", {
        "geometry": [{"mesh": "half.msh", "surface_selection": [
            {"id": 1, "box": [[-1, top - 1e-6], [far, far]]}, {"id": 2, "box": [[-1e-9, -1], [1e-9, far]]},
            {"id": 3, "box": [[1e-6, -1], [far, top - 1e-6]]}]}, {"mesh": "plane.obj", "is_obstacle": True}],
        "axisymmetric": True, **({"accuracy": accuracy} if accuracy else {}),
        "shapes": [{"surface": 3, "type": "circle", "center": [0, top], "radius": HALF}],
        "materials": {"type": "NeoHookean", "E": 10, "nu": 0.3, "rho": 1e-9},
        "boundary_conditions": {"dirichlet_boundary": [
            {"id": 1, "value": [0, f"-{APPROACH + gap} * t"]}, {"id": 2, "value": [0, 0], "dimension": [True, False]}]},
        "contact": {"enabled": True}, "time": {"dt": dt, "tend": 1, "quasistatic": True},
        "space": {"remesh": {"enabled": True}},
        "output": {"forces": [{"name": "force", "surfaces": 1}], "paraview": {"skip_frame": 1000}}})
    with open(context.folder / "half_sphere/forces.csv") as file:
        return -float(list(csv.DictReader(file))[-1]["all_y"]), made.summary["vertices"]


def results(context):
    acceleration, area = wheel(context)
    yield compare("wheel [m/s^2]", acceleration, 2 / 3 * 9.81 * math.sin(SLOPE), 3e-3)
    disc = math.pi * WHEEL**2
    yield Result("area of the wheel", 1 - area / disc, None, area, disc, "0.045 with 12 corners")
    if context.quick:
        return
    force, vertices = half_sphere(context)
    yield compare("half sphere, default tolerance [N]", force, FORCE, None, f"{vertices} vertices")
    force, vertices = half_sphere(context, accuracy=0.005)
    yield compare("half sphere, accuracy 0.005 [N]", force, FORCE, 5e-3, f"{vertices} vertices")
