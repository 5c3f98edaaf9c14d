# SPDX-License-Identifier: MIT
"""The problems of the page, each as a function of a level (cells half as large as one level below) and of the work folder."""
import importlib.util
import math
import subprocess
import sys

import numpy as np

from problem import ROOT, Body, Contact, Held, Load, Problem, facets_in
from cases import nafems_contact
from harness.bisection import ball
from harness.scenes import box_mesh, oriented
import make as assemblies  # of examples/assemblies

SHARED = ROOT.parent / "shared"
FAR = 1e6


def rubber_parts():
    """make.py of examples/rubber, whose name that of the assemblies has."""
    path = ROOT / "examples/rubber/make.py"
    spec = importlib.util.spec_from_file_location("make_rubber", path)
    module = sys.modules["make_rubber"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rubber(E, nu):
    """CalculiX's compressible neo-Hooke, mu/2 (I - 3) + K/2 (J - 1)^2 with the isochoric I, a law that all codes have."""
    return {"type": "IsochoricNeoHooke", "E": E, "nu": nu}


def last(name, scale=1.0):
    return lambda curves: scale * float(curves[name][-1])


def sphere(level, folder, directions=((1, 1, -1),), h=1.0):
    """A half sphere of radius 10, bonded to a plate that presses it by 0.2 onto a smooth rigid plane; a quarter of it, or its section."""
    R, approach, gap, h = 10.0, 0.2, 1e-4, h / 2**level
    dim = len(directions[0])
    away = lambda x: np.linalg.norm(x + R * np.eye(dim)[-1], axis=1)
    points, cells = ball(R, lambda x: np.minimum(3 * h + 1, np.maximum(h, 0.6 * (away(x) - 2))), directions)
    points[:, -1] += R + gap
    push = Held(0, [[-1] * (dim - 1) + [R], [2 * R] * dim], {**{a: 0.0 for a in range(dim - 1)}, dim - 1: -approach - gap})
    sides = [Held(0, [[-1 if a != axis else -1e-9 for a in range(dim)], [2 * R if a != axis else 1e-9 for a in range(dim)]],
                  {axis: 0.0}) for axis in range(dim - 1)]
    return Problem("axisymmetric" if dim == 2 else "solid",
                   [Body(points, cells, rubber(10.0, 0.3))], [push, *sides],
                   [Contact(0, [[1e-6] * (dim - 1) + [-1], [6] * (dim - 1) + [3]])], {"force": (0, dim - 1)}, {},
                   last("force", -1.0 if dim == 2 else -4.0), length=2 * R)


def sphere_section(level, folder):
    return sphere(level, folder, ((1, -1),), 0.5)


def ring(level, folder, friction=0.3):
    """A quarter of a ring 10/6 mm, squeezed by 6 mm between rigid plates with friction: force of the whole."""
    outer, inner, gap, n = 10.0, 6.0, 1e-4, 2**level
    points, cells = assemblies.quarter(assemblies.span(inner, outer, 4 * n), 12 * n)
    points = points * [1, -1] + [0, outer + gap]
    top = outer + gap
    held = [Held(0, [[-1, top - 1e-9], [20, top + 1e-9]], {1: -3.0 - gap}), Held(0, [[-1e-9, -1], [1e-9, 20]], {0: 0.0})]
    return Problem("plane strain", [Body(points, oriented(points, cells), rubber(5.0, 0.45))], held,
                   [Contact(0, [[1e-6, -1], [9.9, 6]])], {"force": (0, 1)}, {}, last("force", -2.0), friction=friction, length=20.0)


def block(level, folder, parts=1):
    """A cube of rubber whose top is bonded to a plate that presses it by a fifth onto a smooth rigid plane: all of it, or with parts 2
    a quarter."""
    side, gap, n = 10.0, 1e-4, 4 * 2**level
    points, cells = box_mesh([n // parts, n // parts, n], [side / parts, side / parts, side])
    points[:, 2] += gap
    held = [Held(0, [[-1, -1, side], [20, 20, 20]], {0: 0.0, 1: 0.0, 2: -2.0 - gap})]
    if parts == 2:
        held += [Held(0, [[-1, -1, -1], [1e-9, 20, 20]], {0: 0.0}), Held(0, [[-1, -1, -1], [20, 1e-9, 20]], {1: 0.0})]
    return Problem("solid", [Body(points, cells, rubber(5.0, 0.3))], held,
                   [Contact(0, [[-1, -1, -1], [20, 20, 1e-3]])], {"force": (0, 2)}, {}, last("force", -float(parts**2)), length=3 * side)


def block_quarter(level, folder):
    return block(level, folder, 2)


def hertz(level, folder):
    """NAFEMS' cylinder on a block, on the meshes of the suite's case; the cylinder touches the block at rest."""
    c, h = nafems_contact, 8 / 2**level
    bodies = [Body(points, cells, {"type": "SaintVenant", "E": young, "nu": c.NU})
              for (points, cells), young in zip(c.meshes(h, h / 4), (c.ALUMINIUM, c.STEEL))]
    top = 2 * c.R
    pushed = [[1e-6, top - 2], [c.SIDE, top + 1]]
    _, corners = facets_in(bodies[1], pushed)
    length = np.linalg.norm(np.diff(bodies[1].points[corners], axis=1), axis=2).sum()
    held = [Held(0, [[-1, -2 * c.SIDE - 1], [FAR, -2 * c.SIDE + 1e-6]], {0: 0.0, 1: 0.0}),
            *(Held(k, [[-1, -FAR], [1e-6, FAR]], {0: 0.0}) for k in (0, 1))]
    return Problem("plane strain", bodies, held,
                   [Contact(1, [[1e-6, -1], [30, 20]], 0, [[1e-6, -1e-6], [40, 1]])], {}, {"top": (0, (0.0, -1e-6), 1)},
                   last("top", -1.0), loads=[Load(1, pushed, [0.0, -c.FORCE / length])], friction=0.1, length=c.R)


def punch(level, folder):
    """NAFEMS' punch with a rounded edge on a block, axisymmetric; they touch at rest."""
    polygon = rubber_parts().polygon
    s, n = 0.125, 8 * 2**level
    arc = [(40 + 10 * math.sin(a), 10 - 10 * math.cos(a), s) for a in np.linspace(0, math.pi / 2, n + 1)]
    outlines = [[(0, -200), (100, -200), (100, 0), (50, 0, s), (40, 0, s), (0, 0, 0.5)],
                [(0, 0, 0.5), *arc, (50, 100), (0, 100)]]
    bodies = [Body(*polygon(outline, 16 / 2**level), {"type": "SaintVenant", "E": young, "nu": 0.3})
              for outline, young in zip(outlines, (70000.0, 210000.0))]
    held = [Held(0, [[-1, -201], [FAR, -200 + 1e-6]], {1: 0.0}), *(Held(k, [[-1, -FAR], [1e-6, FAR]], {0: 0.0}) for k in (0, 1))]
    return Problem("axisymmetric", bodies, held, [Contact(1, [[1e-6, -1], [51, 8]], 0, [[1e-6, -1e-6], [60, 1]])], {},
                   {"middle": (0, (0.0, -1e-6), 1)}, last("middle", -1.0), loads=[Load(1, [[-1, 99.9], [60, 101]], [0.0, -100.0])],
                   friction=0.1, length=100.0)


def press_fit(level, folder):
    """A steel ring in an aluminium ring with 20 um of overlap, by their section (examples/assemblies): growth of the rim."""
    meshes, _ = assemblies.press_fit_axisymmetric(2**level)
    laws = [{key: material[key] for key in ("type", "E", "nu")} for material in (assemblies.STEEL, assemblies.ALUMINIUM)]
    bodies = [Body(*mesh, law) for mesh, law in zip(meshes.values(), laws)]
    held = [Held(k, [[-1, -1], [FAR, 1e-9]], {1: 0.0}) for k in (0, 1)]
    return Problem("axisymmetric", bodies, held, [Contact(0, [[39.9, -1], [41, 11]], 1, [[39.9, -1], [40, 11]])], {},
                   {"rim": (1, (60.0, 0.0), 0)}, last("rim"), length=10.0)


def lame_rim():
    """Growth of the outer rim of the rings as they are meshed, in linear elasticity and plane stress."""
    a = assemblies
    inner, outer = a.FIT + a.OVERLAP / 2, a.FIT - a.OVERLAP / 2
    hub = inner / a.STEEL["E"] * ((inner**2 + a.BORE**2) / (inner**2 - a.BORE**2) - a.STEEL["nu"])
    ring = outer / a.ALUMINIUM["E"] * ((a.RIM**2 + outer**2) / (a.RIM**2 - outer**2) + a.ALUMINIUM["nu"])
    pressure = a.OVERLAP / (hub + ring)
    return 2 * pressure * outer**2 * a.RIM / (a.ALUMINIUM["E"] * (a.RIM**2 - outer**2))


def ironing(level, folder):
    """Shallow ironing on the meshes of ../shared/ironing/make.py: the mean horizontal force over t in [2, 5]."""
    import meshio
    h = 0.2 / 2**level
    made = folder / "made"
    subprocess.run([sys.executable, str(SHARED / "ironing/make.py"), f"{h:g}", f"{h:g}", "none", "1", str(made)], check=True,
                   capture_output=True)
    bodies = []
    for name, young in (("base", 6.896e8), ("die", 6.896e9)):
        mesh = meshio.read(made / f"{name}.msh")
        bodies.append(Body(mesh.points[:, :2], mesh.cells_dict["triangle"].astype(int), rubber(young, 0.32)))
    top = bodies[1].points[:, 1].max()
    tend = 5.0
    held = [Held(0, [[-1, -1], [13, 1e-6]], {0: 0.0, 1: 0.0}),
            Held(1, [[0, top - 1e-6], [10, 9]], {0: [(0.0, 0.0), (1.0, 0.0), (tend, 2 * (tend - 1))],
                                                 1: [(0.0, 0.0), (1.0, -1.0), (tend, -1.0)]})]
    mean = lambda curves: float(np.trapz(*over(curves["t"], curves["H"], 2, 5)) / 3 / 1e8)
    return Problem("plane strain", bodies, held, [Contact(1, [[1.3, 3], [2.7, 4.9]], 0, [[-1, 3.9], [13, 4.1]])],
                   {"H": (1, 0)}, {}, mean, friction=0.3, tend=tend, length=12.0)


def over(t, values, low, high):
    """The curve between two times, as np.trapz takes it."""
    times = np.unique(np.concatenate([[low, high], t[(t > low) & (t < high)]]))
    return np.interp(times, t, values), times
