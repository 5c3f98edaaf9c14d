# SPDX-License-Identifier: MIT
"""A quarter of an O-ring of rubber between two plates, remeshed, without a numeric key of method."""
import math

import numpy as np

from harness import by_default
from harness.by_default import REMESHED, Study, body, held, obstacle
from harness.scenes import oriented, write_mesh

TITLE = "An O-ring by defaults"
QUANTITY = "force of a quarter of an O-ring squeezed by a quarter; Newton iterations, processor seconds"
REFERENCE = ("the ring as a body of revolution with the same section, on its mesh refined three times; with a third of d-hat, in "
             "mm; the cheapest choice by hand")
TOLERANCE = "3 %; 0.5 % in other units; twice the iterations and the seconds; two minutes of one processor"
NEEDS = ("numpy", "meshio")
QUICK = False

RADIUS, AROUND = 0.0015, 0.01
RUBBER = [{"id": 1, "type": "NeoHookean", "E": 6e6, "nu": 0.49, "rho": 1100}]


def section(radius, rings):
    """Points and triangles of hexagonal rings."""
    first = [0, *(1 + 3 * r * (r - 1) for r in range(1, rings + 1))]
    place = lambda length, angle: (length * math.cos(angle), length * math.sin(angle))
    disc = [(0.0, 0.0), *(place(radius * r / rings, math.pi * k / (3 * r)) for r in range(1, rings + 1) for k in range(6 * r))]
    triangles = []
    for r in range(1, rings + 1):
        at = lambda ring, k: first[ring] + k % (6 * ring) if ring else 0
        for side in range(6):
            for j in range(r):
                outer, inner = side * r + j, side * (r - 1) + j
                triangles.append((at(r, outer), at(r, outer + 1), at(r - 1, inner)))
                if j < r - 1:
                    triangles.append((at(r - 1, inner), at(r, outer + 1), at(r - 1, inner + 1)))
    return disc, triangles


def swept(disc, triangles, around, sections):
    """Points and tetrahedra of a quarter of a ring about the z axis with this section: wedges along it."""
    points, cells, size = [], [], len(disc)
    for k in range(sections + 1):
        along, across = math.cos(math.pi * k / (2 * sections)), math.sin(math.pi * k / (2 * sections))
        points += [((around + x) * along if k < sections else 0, (around + x) * across, z) for x, z in disc]
    for k in range(sections):
        for triangle in triangles:
            (a, b, c), (d, e, f) = ([v + n * size for v in sorted(triangle)] for n in (k, k + 1))
            cells += [(a, b, c, f), (a, b, f, e), (a, e, f, d)]
    points = np.array(points)
    return points, oriented(points, cells)


def o_ring_3d(context):
    """A quarter of an O-ring, 3 mm thick, squeezed by a quarter between two plates and remeshed."""
    write_mesh(context.folder / "quarter.msh", *swept(*section(RADIUS, 2), AROUND, 20))
    (context.folder / "square.obj").write_text("v -0.002 -0.002 0\nv 0.0135 -0.002 0\nv 0.0135 0.0135 0\nv -0.002 0.0135 0\n"
                                               "f 1 2 3\nf 1 3 4\n")
    plate = lambda tag, z: {"mesh": "square.obj", "is_obstacle": True, "surface_selection": tag,
                            "transformation": {"translation": [0, 0, z]}}
    return {"geometry": [{"mesh": "quarter.msh", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                         plate(11, -0.00152), plate(12, 0.00152)],
            "materials": RUBBER,
            "boundary_conditions": {"dirichlet_boundary": [held(1, 0), held(2, 1)],
                                    "obstacle_displacements": [{"id": 12, "value": [0, 0, "-0.00079 * t"]}]},
            "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
            "contact": {"enabled": True, "friction_coefficient": 0.3}, **REMESHED,
            "output": {"forces": [{"name": "force", "obstacles": 12}]}}, lambda rows, _: abs(rows[-1]["all_z"])


def of_revolution(context):
    """The same ring in a plane through its axis, on finer and finer meshes."""
    points, triangles = section(RADIUS, 2)
    points = np.array(points)
    write_mesh(context.folder / "section.msh", points + [AROUND, 0], oriented(points, triangles))
    plate = lambda tag, z: obstacle(context, "line.obj", [(0, 0), (0.0135, 0)], [(1, 2)], surface_selection=tag,
                                    transformation={"translation": [0, z]})
    scene = {"axisymmetric": True, "geometry": [body("section.msh"), plate(11, -0.00152), plate(12, 0.00152)], "materials": RUBBER,
             "boundary_conditions": {"obstacle_displacements": [{"id": 12, "value": [0, "-0.00079 * t"]}]},
             "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
             "contact": {"enabled": True, "friction_coefficient": 0.3},
             "output": {"forces": [{"name": "force", "obstacles": 12}]}}
    return by_default.quarters_on_finer_meshes(scene)


def results(context):
    return by_default.results(context, [Study(o_ring_3d, 2 * RADIUS, finer=of_revolution, is_slow=True, seconds=120)])
